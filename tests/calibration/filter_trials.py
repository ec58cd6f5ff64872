"""Synthetic campaigns with a filter, and whether each statement of the program about it is right.

Nine normal errors at 61 epochs, correlated from epoch to epoch by 0.9, and a filter that states one fixed covariance;
three measurements between two epochs, of three components each.

`filter, matched`
    The covariance is that of the errors, and the innovations are white.
`filter, at the tolerance`
    All errors are larger than the filter states by just the tolerance: it must neither be called consistent, nor be
    blamed.
`filter, one error at the tolerance`
    One of nine errors is: the groups are within the tolerance, and the filter must not be called consistent.
`filter, one error at 10 %`
    One of nine errors is larger by 10 %: with this tolerance, which 2,000 samples decide, it must not be called
    consistent.
`filter, 20 % optimistic`
    The position errors are larger than the filter states by 20 %: tests power.
`filter, one error 20 % larger`
    One of nine errors is larger by 20 %: tests power.
`filter, two errors that cancel`
    One error is larger by 20 %, and another of its group smaller, so that the mean NEES of every group is as expected.
`filter, one axis`
    One of three position errors is twice as large as the filter states: tests coverage.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from mcnav.analysis.comparison import Criterion
from mcnav.analysis.filter_assessment import assess_filter
from mcnav.analysis.filter_consistency import FilterConsistency, Honesty
from mcnav.analysis.filter_evidence import FilterEvidence, MeanSquares
from mcnav.arrays.types import Array
from mcnav.contract.filter_record import FilterSchema
from mcnav.contract.quantities import Output
from mcnav.numerics.power_sums import sum_powers_about_zero
from mcnav.statistics.filter_sums import FilterMeans, FilterSums
from tests.calibration.cells import LEVEL, Cell, Tally, tally

FILTER: Final = "filter"
"""Beginning of the names of the systems."""

CRITERION: Final = Criterion(tolerance=0.05, confidence=LEVEL)
WIDE: Final = Criterion(tolerance=0.1, confidence=LEVEL)
"""A tolerance that 2,000 samples decide."""

SIZES: Final = (100, 200, 500, 1_000, 2_000)

EPOCHS: Final = 61
KEPT: Final = 0.9
"""Correlation of the errors at neighbouring epochs."""

UPDATES: Final = 3
"""Measurements between two epochs."""

OUTPUTS: Final = tuple(
    Output(f"{group}_{axis}", "m", "m") for group in ("position", "velocity", "tilt") for axis in "xyz"
)
SCHEMA: Final = FilterSchema(
    {"all": 9, "navigation": 9, "position": 3, "velocity": 3, "attitude": 3}, outputs=9, sensors={"fix": 3}
)
PLACES: Final = {"navigation": slice(0, 9), "position": slice(0, 3), "velocity": slice(3, 6), "attitude": slice(6, 9)}

MATCHED, TOLERATED, OPTIMISTIC, AXIS = (
    f"{FILTER}, {each}" for each in ("matched", "at the tolerance", "20 % optimistic", "one axis")
)
ONE_TOLERATED, ONE_WIDE, ONE, CANCELLING = (
    f"{FILTER}, {each}"
    for each in ("one error at the tolerance", "one error at 10 %", "one error 20 % larger", "two errors that cancel")
)

SCALES: Final = {
    MATCHED: np.ones(9),
    TOLERATED: np.full(9, 1.0 + CRITERION.tolerance),
    ONE_TOLERATED: np.array([*[1.0] * 8, 1.0 + CRITERION.tolerance]),
    OPTIMISTIC: np.repeat([1.2, 1.0, 1.0], 3),
    ONE_WIDE: np.array([*[1.0] * 8, 1.0 + WIDE.tolerance]),
    ONE: np.array([*[1.0] * 8, 1.2]),
    CANCELLING: np.array([*[1.0] * 7, np.sqrt(2.0 - 1.2**2), 1.2]),
    AXIS: np.array([2.0, *[1.0] * 8]),
}
"""Sigma of each error over the filter's, by system."""


def evidence(normals: Array, innovations: Array, scale: Array) -> FilterEvidence:
    """Form the evidence of a campaign whose filter states unit covariances.

    Parameters
    ----------
    normals : ndarray, shape (n, m, 9)
        Independent standard normals.
    innovations : ndarray, shape (n, m - 1, updates, 3)
        Whitened.
    scale : ndarray, shape (9,)
        True sigma of each error.
    """
    return _evidence(_correlated(normals), _of_fixes(innovations), scale)


def _correlated(normals: Array) -> Array:
    """Correlate normals from epoch to epoch."""
    errors = np.empty_like(normals)
    errors[:, 0] = normals[:, 0]
    for epoch in range(1, errors.shape[1]):
        errors[:, epoch] = KEPT * errors[:, epoch - 1] + np.sqrt(1.0 - KEPT**2) * normals[:, epoch]
    return errors


def _evidence(errors: Array, fix: Array, scale: Array) -> FilterEvidence:
    """Form the evidence from errors of unit sigma, shape (n, m, 9), and a sensor's columns, (n, m - 1, 5)."""
    errors = errors * scale
    records = np.zeros((*errors.shape[:2], SCHEMA.width))
    places, squares = SCHEMA.places, errors**2
    members = np.zeros((len(OUTPUTS), len(SCHEMA.groups)))
    for group, name in enumerate(SCHEMA.groups):
        members[PLACES.get(name, slice(None)), group] = 1.0
    records[:, :, places["nees"]] = squares @ members
    first, each = places["covariance"].start, np.arange(len(OUTPUTS))
    records[:, :, first + each * (each + 3) // 2] = 1.0
    records[:, :, places["within_1"]], records[:, :, places["within_3"]] = squares <= 1.0, squares <= 9.0
    records[:, 1:, places["sensor:fix"]] = fix
    return FilterEvidence(
        "time [s]",
        np.arange(float(errors.shape[1])),
        OUTPUTS,
        FilterMeans.of(SCHEMA, FilterSums.of(SCHEMA, records)),
        MeanSquares.of(sum_powers_about_zero(errors)),
        failed=0,
    )


def _of_fixes(innovations: Array) -> Array:
    """Return the columns of the sensor, shape (n, m - 1, 5), of its whitened innovations."""
    count, intervals, updates, size = innovations.shape
    chain = innovations.reshape(count, intervals * updates, size)
    products = np.zeros((count, intervals * updates))
    products[:, 1:] = np.sum(chain[:, 1:] * chain[:, :-1], axis=2) / size
    lags = np.ones((count, intervals * updates))
    lags[:, 0] = 0.0
    return np.stack(
        [
            np.sum(chain**2, axis=2).reshape(count, intervals, updates).sum(axis=2),
            np.full((count, intervals), float(updates)),
            np.zeros((count, intervals)),
            products.reshape(count, intervals, updates).sum(axis=2),
            lags.reshape(count, intervals, updates).sum(axis=2),
        ],
        axis=2,
    )


def run_filter_trials(trials: int, jobs: int, sizes: Sequence[int] = SIZES) -> Tally:
    """Simulate so many campaigns of each system and size, with seeds 0, 1, ..."""
    return tally(trials, jobs, sizes, _count)


def _count(count: int, seeds: Sequence[int], result: Tally) -> None:
    for seed in seeds:
        generator = np.random.Generator(np.random.Philox(np.random.SeedSequence(seed, spawn_key=(count,))))
        normals = generator.standard_normal((count, EPOCHS, len(OUTPUTS)))
        innovations = generator.standard_normal((count, EPOCHS - 1, UPDATES, 3))
        errors, fix = _correlated(normals), _of_fixes(innovations)
        for name, scale in SCALES.items():
            given = _evidence(errors, fix, scale)
            statements = [*_statements(name, scale, assess_filter(given, CRITERION))]
            if name in (MATCHED, ONE_WIDE):
                statements += _within(name, assess_filter(given, WIDE))
            for kind, statement, hit in statements:
                result.add(Cell(kind, name, statement, "normal", "random", count), hit)


def _within(name: str, wide: FilterConsistency) -> Iterator[tuple[str, str, bool]]:
    """Yield what is said with a wide tolerance."""
    kind = "power" if name == MATCHED else "false alarm"
    yield kind, "filter consistent within 10 %", wide.verdict == Honesty.CONSISTENT
    if name == MATCHED:
        yield kind, "filter consistent as a whole within 10 %", wide.on_groups == Honesty.CONSISTENT
    else:
        departs = wide.verdict in (Honesty.OPTIMISTIC, Honesty.PESSIMISTIC)
        yield kind, "filter optimistic or pessimistic, beyond 10 %", departs


def _statements(name: str, scale: Array, consistency: FilterConsistency) -> Iterator[tuple[str, str, bool]]:
    """Yield kind, statement, and whether it is made or, of coverage, right."""
    departs = consistency.verdict in (Honesty.OPTIMISTIC, Honesty.PESSIMISTIC)
    if name == MATCHED:
        fix = consistency.sensors[0]
        yield "false alarm", "NIS or whiteness beyond bounds", fix.beyond or fix.whiteness.beyond
        yield "power", "filter consistent", consistency.verdict == Honesty.CONSISTENT
    if name in (MATCHED, TOLERATED, ONE_TOLERATED):
        yield "false alarm", "filter optimistic or pessimistic", departs
    if name not in (MATCHED, AXIS):
        yield "false alarm", "filter consistent", consistency.verdict == Honesty.CONSISTENT
    if name == OPTIMISTIC:
        right = consistency.verdict == Honesty.OPTIMISTIC and consistency.group == "position"
        yield "power", "filter optimistic, in position", right
    if name in (ONE, CANCELLING):
        right = consistency.verdict == Honesty.OPTIMISTIC and consistency.output == OUTPUTS[8].name
        yield "power", "filter optimistic, in the one output", right
    if name == CANCELLING:
        named = {(each.verdict, each.name) for each in consistency.departures}
        both = {(Honesty.OPTIMISTIC, OUTPUTS[8].name), (Honesty.PESSIMISTIC, OUTPUTS[7].name)} <= named
        yield "power", "filter optimistic and pessimistic, in both outputs", both
    if name in (MATCHED, AXIS):
        position = next(group for group in consistency.groups if group.name == "position")
        true = float(np.sqrt(np.mean(scale[PLACES["position"]] ** 2)))
        each, ratio = position.ratio.each[-1], consistency.outputs[0].ratio.each[-1]
        yield "coverage", "sigma ratio by NEES, at one epoch", bool(each[0] <= true <= each[1])
        yield "coverage", "sigma of an output over the filter's", bool(ratio[0] <= scale[0] <= ratio[1])
        low, high = position.ratio.together.T
        yield "coverage", "sigma ratio by NEES, at all epochs", bool(np.all((low <= true) & (true <= high)))
