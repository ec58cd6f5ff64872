"""Synthetic campaigns with a filter, and whether each statement of the program about it is right.

Nine normal errors at 21 epochs, correlated from epoch to epoch by 0.9, and a filter that states one fixed covariance;
three measurements between two epochs, of three components each.

`filter, matched`
    The covariance is that of the errors, and the innovations are white.
`filter, at the tolerance`
    All errors are larger than the filter states by just the tolerance: it must not be called consistent.
`filter, 20 % optimistic`
    The position errors are larger than the filter states by 20 %: tests power.
`filter, one axis`
    One of three position errors is twice as large as the filter states: tests coverage.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from mcnav._types import Array
from mcnav.analysis.comparison import Criterion
from mcnav.analysis.filter_assessment import assess_filter
from mcnav.analysis.filter_consistency import FilterConsistency, Honesty
from mcnav.analysis.filter_evidence import FilterEvidence, MeanSquares
from mcnav.calibration.cells import LEVEL, Cell, Tally, tally
from mcnav.physics.power_sums import PowerSums
from mcnav.scenarios.filter_record import FilterSchema
from mcnav.scenarios.filter_sums import FilterMeans, FilterSums
from mcnav.scenarios.protocol import Output

FILTER: Final = "filter"
"""Beginning of the names of the systems."""

CRITERION: Final = Criterion(tolerance=0.05, confidence=LEVEL)
SIZES: Final = (100, 200, 500, 2_000)

EPOCHS: Final = 21
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

SCALES: Final = {
    "filter, matched": np.ones(9),
    "filter, at the tolerance": np.full(9, 1.0 + CRITERION.tolerance),
    "filter, 20 % optimistic": np.repeat([1.2, 1.0, 1.0], 3),
    "filter, one axis": np.array([2.0, *[1.0] * 8]),
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
    errors = np.empty_like(normals)
    errors[:, 0] = normals[:, 0]
    for epoch in range(1, errors.shape[1]):
        errors[:, epoch] = KEPT * errors[:, epoch - 1] + np.sqrt(1.0 - KEPT**2) * normals[:, epoch]
    errors *= scale
    records = np.zeros((*errors.shape[:2], SCHEMA.width))
    places, squares = SCHEMA.places, errors**2
    records[:, :, places["nees"]] = np.stack(
        [squares[:, :, PLACES.get(name, slice(None))].sum(axis=2) for name in SCHEMA.groups], axis=2
    )
    first, each = places["covariance"].start, np.arange(len(OUTPUTS))
    records[:, :, first + each * (each + 3) // 2] = 1.0
    records[:, :, places["within_1"]], records[:, :, places["within_3"]] = squares <= 1.0, squares <= 9.0
    count, intervals, updates, size = innovations.shape
    chain = innovations.reshape(count, intervals * updates, size)
    products = np.zeros((count, intervals * updates))
    products[:, 1:] = np.sum(chain[:, 1:] * chain[:, :-1], axis=2) / size
    lags = np.ones((count, intervals * updates))
    lags[:, 0] = 0.0
    fix = np.stack(
        [
            np.sum(chain**2, axis=2).reshape(count, intervals, updates).sum(axis=2),
            np.full((count, intervals), float(updates)),
            np.zeros((count, intervals)),
            products.reshape(count, intervals, updates).sum(axis=2),
            lags.reshape(count, intervals, updates).sum(axis=2),
        ],
        axis=2,
    )
    records[:, 1:, places["sensor:fix"]] = fix
    return FilterEvidence(
        "time [s]",
        np.arange(float(errors.shape[1])),
        OUTPUTS,
        FilterMeans.of(SCHEMA, FilterSums.of(SCHEMA, records)),
        MeanSquares.of(PowerSums.about_zero(errors)),
        failed=0,
    )


def run_filter_trials(trials: int, jobs: int, sizes: Sequence[int] = SIZES) -> Tally:
    """Simulate so many campaigns of each system and size, with seeds 0, 1, ..."""
    return tally(trials, jobs, sizes, _count)


def _count(count: int, seeds: Sequence[int], found: Tally) -> None:
    for seed in seeds:
        generator = np.random.Generator(np.random.Philox(np.random.SeedSequence(seed, spawn_key=(count,))))
        normals = generator.standard_normal((count, EPOCHS, len(OUTPUTS)))
        innovations = generator.standard_normal((count, EPOCHS - 1, UPDATES, 3))
        for name, scale in SCALES.items():
            judged = assess_filter(evidence(normals, innovations, scale), CRITERION)
            for kind, statement, hit in _statements(name, scale, judged):
                found.add(Cell(kind, name, statement, "normal", "random", count), hit)


def _statements(name: str, scale: Array, found: FilterConsistency) -> Iterator[tuple[str, str, bool]]:
    """Yield kind, statement, and whether it is made or, of coverage, right."""
    if name == "filter, matched":
        departs = found.verdict in (Honesty.OPTIMISTIC, Honesty.PESSIMISTIC)
        yield "false alarm", "filter optimistic or pessimistic", departs
        fix = found.sensors[0]
        yield "false alarm", "NIS or whiteness beyond bounds", fix.beyond or fix.whiteness.beyond
        yield "power", "filter consistent", found.verdict == Honesty.CONSISTENT
    if name == "filter, at the tolerance":
        yield "false alarm", "filter consistent", found.verdict == Honesty.CONSISTENT
    if name == "filter, 20 % optimistic":
        right = found.verdict == Honesty.OPTIMISTIC and found.group == "position"
        yield "power", "filter optimistic, in position", right
    if name in ("filter, matched", "filter, one axis"):
        position = next(group for group in found.groups if group.name == "position")
        true = float(np.sqrt(np.mean(scale[PLACES["position"]] ** 2)))
        each, ratio = position.ratio.each[-1], found.outputs[0].ratio.each[-1]
        yield "coverage", "sigma ratio by NEES, at one epoch", bool(each[0] <= true <= each[1])
        yield "coverage", "sigma of an output over the filter's", bool(ratio[0] <= scale[0] <= ratio[1])
        low, high = position.ratio.together.T
        yield "coverage", "sigma ratio by NEES, at all epochs", bool(np.all((low <= true) & (true <= high)))
