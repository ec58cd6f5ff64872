"""Range of linearity: the multiple of the stated errors at which the nonlinear result departs from the linear one.

Two questions are answered. *One error alone*: at which multiple m does the final error ``y(m s)`` depart from
the linear ``y0 + m P s`` by a share of the latter's change (NASA TN D-1772, figure 5)? *All errors together, as
dispersions*: at which multiple does the sigma ratio of Monte Carlo to P S P^T leave the tolerance?
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Final

import numpy as np

from mcnav.analysis.comparison import Criterion, compare
from mcnav.analysis.model import Model
from mcnav.analysis.verdict import LARGEST_FAILED_SHARE, Verdict
from mcnav.arrays.types import Array, IndexArray
from mcnav.contract.linear import LinearModel
from mcnav.contract.samples import SimulationResult
from mcnav.linear.partials import Propagate
from mcnav.sampler.designs import SamplingDesign
from mcnav.statistics.bisection import root_between

Simulator = Callable[[float], Propagate]
"""Function from a multiple to a simulation of errors that is accurate for errors of about that size; in `together` with
so many times the noise, if it has any."""

SMALLEST: Final = 0.1
PER_DECADE: Final = 8
"""Grid of multiples on which departures are bracketed before roots are found."""

BEYOND: Final = 1e6
"""Departure (share) of a sample that failed, and ratio of a dispersion where linear analysis has none."""

ROOT_TOLERANCE: Final = 1e-3
"""Relative accuracy of the multiples of dispersion."""


def decade(multiple: Array) -> Array:
    """Return the largest multiple of the decade in which a multiple lies: the engine is prepared for it."""
    return np.asarray(SMALLEST * 10.0 ** np.ceil(np.log10(multiple / SMALLEST) - 1e-9))


def ladder(largest: float) -> Array:
    """Return multiples from `SMALLEST` to the largest, evenly spaced on a logarithmic scale, shape (n,)."""
    count = int(np.ceil(PER_DECADE * np.log10(largest / SMALLEST))) + 1
    return np.geomspace(SMALLEST, largest, max(count, 2))


@dataclass(frozen=True)
class AloneRange:
    """Range of linearity of single directions in the space of errors.

    Attributes
    ----------
    multiples : ndarray, shape (directions, outputs)
        Smallest multiple of either sign at which the departure reaches the tolerance; infinite when it does not up to
        the largest one tried, NaN when the direction has no linear effect on the output.
    signs : ndarray, shape (directions, outputs)
        Sign of the errors for which that multiple holds; zero where there is none.
    largest : float
        Largest multiple tried.
    """

    multiples: Array
    signs: Array
    largest: float


def alone(simulate: Simulator, linear: LinearModel, directions: Array, tolerance: float, largest: float) -> AloneRange:
    """Find the range of linearity of each of several error vectors, for a tolerance as a share of the linear change.

    The directions are the errors whose multiples are simulated, shape (directions, sources), SI.
    """
    from scipy.optimize.elementwise import find_root  # slow to import: a tenth of a second

    engines = cache(simulate)
    both = np.vstack([directions, -directions])
    changes = both @ linear.partials.T

    def departures(multiples: Array, which: IndexArray) -> Array:
        """Compute the departure of each output for multiples of chosen directions of both signs, shape (n, outputs)."""
        tops = decade(multiples)
        values = np.empty((len(multiples), len(linear.nominal)))
        for top in np.unique(tops):
            rows = np.flatnonzero(tops == top)
            values[rows] = engines(float(top))(multiples[rows, None] * both[which[rows]]).values
        expected = multiples[:, None] * changes[which]
        with np.errstate(divide="ignore", invalid="ignore"):
            shares = np.abs(values - linear.nominal - expected) / np.abs(expected)
        return np.where(np.isfinite(values), shares, BEYOND)

    def excess(log: Array, direction: Array, output: Array) -> Array:
        shares = departures(np.exp(log.ravel()), direction.astype(int).ravel())
        return np.asarray(shares[np.arange(log.size), output.astype(int).ravel()] - tolerance).reshape(log.shape)

    steps = ladder(largest)
    first = _first_crossings(departures, steps, tolerance, changes.shape)
    alone_range = np.where(first == 0, SMALLEST, np.inf)
    which, output = np.nonzero(first > 0)
    if len(which):
        last = first[which, output]
        bracket = (np.log(steps[last - 1]), np.log(steps[last]))
        root = find_root(excess, bracket, args=(which.astype(float), output.astype(float)), tolerances={"xatol": 1e-6})
        alone_range[which, output] = np.exp(root.x)
    alone_range[changes == 0.0] = np.nan
    alone_range = alone_range.reshape(2, len(directions), -1)
    nearest = np.argmin(np.nan_to_num(alone_range, nan=np.inf), axis=0)
    multiples = np.take_along_axis(alone_range, nearest[None], axis=0)[0]
    return AloneRange(multiples, np.where(np.isfinite(multiples), 1.0 - 2.0 * nearest, 0.0), largest)


def _first_crossings(
    departures: Callable[[Array, IndexArray], Array], steps: Array, tolerance: float, shape: tuple[int, ...]
) -> IndexArray:
    """Find the ladder's first departure beyond the tolerance, shape (directions, outputs); -1 for none.

    Directions that have departed in every output are not simulated further.
    """
    first = np.full(shape, -1)
    for position, multiple in enumerate(steps):
        open_rows = np.flatnonzero((first < 0).any(axis=1))
        if len(open_rows) == 0:
            break
        shares = departures(np.full(len(open_rows), multiple), open_rows)
        rows, columns = np.nonzero((shares >= tolerance) & (first[open_rows] < 0))
        first[open_rows[rows], columns] = position
    return first


@dataclass(frozen=True)
class DispersionRange:
    """Range of linearity of dispersions: each output's sigma, and last the joint distribution (root mean NEES).

    Attributes
    ----------
    multiples : ndarray, shape (n,)
        Multiples at which the dispersions were compared.
    ratios, lower, upper : ndarray, shape (n, outputs + 1)
        Paired sigma ratio and its interval.
    departs : ndarray, shape (outputs + 1,)
        Multiple at which the estimated ratio leaves the tolerance.
    agrees_until, differs_from : ndarray, shape (outputs + 1,)
        Multiples up to which the whole interval lies inside the tolerance, and from which on it lies outside. Infinite
        where not reached up to the largest multiple, NaN for an output without dispersion.
    """

    multiples: Array
    ratios: Array
    lower: Array
    upper: Array
    departs: Array
    agrees_until: Array
    differs_from: Array


def _ratios(
    model: Model, draws: Array, simulated: SimulationResult, criterion: Criterion, design: SamplingDesign
) -> Array:
    """Compute ratio, lower and upper bound for each output and the joint distribution, shape (outputs + 1, 3).

    NaN where there is none: a size of zero nominal has a law of its own, and no linear sigma.
    """
    rows, outcomes = np.full((len(model.nominal) + 1, 3), np.nan), simulated.values
    unknown = list(model.laws_of_sizes)
    if not np.isfinite(outcomes).all(axis=1).mean() >= 1.0 - LARGEST_FAILED_SHARE:
        rows[:] = BEYOND
        rows[unknown] = np.nan
        return rows
    result = compare(model, draws, outcomes, criterion, design, simulated.linear_values)
    judgements = [output.paired for output in result.outputs]
    if result.ellipsoid is not None:
        judgements.append(result.ellipsoid.judgement)
    for row, judgement in zip(rows, judgements, strict=False):
        if judgement.ratio is not None and judgement.interval is not None:
            row[:] = judgement.ratio, *judgement.interval
        elif judgement.verdict == Verdict.DIFFERS:  # dispersed where linear analysis has no dispersion
            row[:] = BEYOND
    if result.ellipsoid is not None and result.ellipsoid.surprised:
        rows[-1] = BEYOND
    rows[unknown] = np.nan
    return rows


def together(
    simulate: Simulator, model: Model, draws: Array, criterion: Criterion, design: SamplingDesign, largest: float
) -> DispersionRange:
    """Find where the dispersions of all errors together leave the linear ones.

    The same draws are used at every multiple, so that the ratio is a smooth function of the multiple. The model and the
    draws, shape (n, sources), are of the stated errors and noise; for the rest see `mcnav.analysis.comparison.compare`.
    """
    count = len(model.nominal) + 1

    @cache
    def judged(multiple: float) -> Array:
        simulated, square = simulate(multiple)(multiple * draws), multiple**2
        scaled = replace(
            model, mean=multiple * model.mean, covariance=square * model.covariance,
            processes={name: square * process for name, process in model.processes.items()},
        )  # fmt: skip
        return _ratios(scaled, multiple * draws, simulated, criterion, design)

    low, high = 1.0 - criterion.tolerance, 1.0 + criterion.tolerance

    def excess(kind: str, row: int, multiple: float) -> float:
        """Return the distance from the tolerance: negative inside, positive outside."""
        ratio, lower, upper = np.minimum(judged(multiple)[row], BEYOND)
        bounds = {"departs": (ratio, ratio), "agrees": (lower, upper), "differs": (upper, lower)}
        below, above = bounds[kind]
        return float(max(above - high, low - below))

    steps = []
    for multiple in map(float, ladder(largest)):
        steps.append(multiple)
        rows = [row for row in range(count) if np.isfinite(judged(multiple)[row, 0])]
        if all(excess("differs", row, multiple) > 0.0 for row in rows):
            break

    def crossing(kind: str, row: int) -> float:
        values = [excess(kind, row, multiple) for multiple in steps]
        if np.isnan(values[0]):
            return float("nan")
        outside = next((place for place, value in enumerate(values) if value > 0.0), None)
        if outside is None:
            return float("inf")
        if outside == 0:
            return steps[0]
        low, high = ((math.log(steps[place]), values[place]) for place in (outside - 1, outside))
        ends = root_between(lambda log: excess(kind, row, math.exp(log)), low, high, ROOT_TOLERANCE)
        return math.exp(0.5 * (ends[0] + ends[1]))

    curves = np.array([judged(multiple) for multiple in steps])
    crossings = [np.array([crossing(kind, row) for row in range(count)]) for kind in ("departs", "agrees", "differs")]
    return DispersionRange(np.array(steps), curves[..., 0], curves[..., 1], curves[..., 2], *crossings)
