"""Range of linearity: the multiple of the stated errors at which the nonlinear result departs from the linear one.

Two questions are answered. *One error alone*: at which multiple m does the final error ``y(m s)`` depart from
the linear ``y0 + m P s`` by a share of the latter's change (NASA TN D-1772, figure 5)? *All errors together, as
dispersions*: at which multiple does the sigma ratio of Monte Carlo to P S P^T leave the tolerance?
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Final

import numpy as np

from mcnav._types import Array, IndexArray
from mcnav.analysis.comparison import LARGEST_FAILED_SHARE, Criterion, Model, compare
from mcnav.analysis.verdict import Judgement
from mcnav.lincov.partials import Propagate
from mcnav.sampling.designs import SamplingDesign
from mcnav.scenarios.protocol import LinearModel

Simulator = Callable[[float], Propagate]
"""Function from the largest multiple to a simulation of errors that is accurate for errors of about that size."""

SMALLEST: Final = 0.1
PER_DECADE: Final = 8
"""Grid of multiples on which departures are bracketed before roots are found."""

BEYOND: Final = 1e6
"""Departure (share) assigned to a sample that failed."""

ROOT_TOLERANCE: Final = 1e-3
"""Relative accuracy of the multiples of dispersion."""


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

    Parameters
    ----------
    directions : ndarray, shape (directions, sources)
        Errors whose multiples are simulated, SI: one source in each, or several.
    """
    from scipy.optimize.elementwise import find_root  # slow to import: a tenth of a second

    engines = cache(simulate)
    changes = directions @ linear.partials.T

    def departures(multiples: Array, which: IndexArray, signs: Array) -> Array:
        """Compute the departure of each output for signed multiples of chosen directions, shape (n, outputs)."""
        signed = signs * multiples
        decade = SMALLEST * 10.0 ** np.ceil(np.log10(multiples / SMALLEST) - 1e-9)
        values = np.empty((len(multiples), len(linear.nominal)))
        for top in np.unique(decade):
            rows = np.flatnonzero(decade == top)
            values[rows] = engines(float(top))(signed[rows, None] * directions[which[rows]]).values
        expected = signed[:, None] * changes[which]
        with np.errstate(divide="ignore", invalid="ignore"):
            shares = np.abs(values - linear.nominal - expected) / np.abs(expected)
        return np.where(np.isfinite(values), shares, BEYOND)

    steps = ladder(largest)
    found = np.full((2, *changes.shape), np.inf)
    for side, sign in enumerate((1.0, -1.0)):
        first = _first_crossings(departures, steps, len(directions), sign, tolerance, changes.shape)
        which, output = np.nonzero(first > 0)
        found[side][first == 0] = SMALLEST
        if len(which) == 0:
            continue
        last = first[which, output]

        def excess(log: Array, direction: Array, at: Array, side_sign: float = sign) -> Array:
            chosen, own = direction.astype(int).ravel(), at.astype(int).ravel()
            shares = departures(np.exp(log.ravel()), chosen, np.full(log.size, side_sign))
            return np.asarray(shares[np.arange(log.size), own] - tolerance).reshape(log.shape)

        bracket = (np.log(steps[last - 1]), np.log(steps[last]))
        root = find_root(excess, bracket, args=(which.astype(float), output.astype(float)), tolerances={"xatol": 1e-6})
        found[side][which, output] = np.exp(root.x)
    found[:, changes == 0.0] = np.nan
    nearest = np.argmin(np.nan_to_num(found, nan=np.inf), axis=0)
    multiples = np.take_along_axis(found, nearest[None], axis=0)[0]
    return AloneRange(multiples, np.where(np.isfinite(multiples), 1.0 - 2.0 * nearest, 0.0), largest)


def _first_crossings(
    departures: Callable[..., Array], steps: Array, count: int, sign: float, tolerance: float, shape: tuple[int, ...]
) -> IndexArray:
    """Find the ladder's first departure beyond the tolerance, shape (directions, outputs); -1 for none.

    Directions that have departed in every output are not simulated further.
    """
    first = np.full(shape, -1)
    for position, multiple in enumerate(steps):
        open_rows = np.flatnonzero((first < 0).any(axis=1))
        if len(open_rows) == 0:
            break
        shares = departures(np.full(len(open_rows), multiple), open_rows, np.full(len(open_rows), sign))
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


def together(
    simulate: Simulator, model: Model, draws: Array, criterion: Criterion, design: SamplingDesign, largest: float
) -> DispersionRange:
    """Find where the dispersions of all errors together leave the linear ones.

    The same draws are used at every multiple, so that the ratio is a smooth function of the multiple.

    Parameters
    ----------
    model : Model
        Of the stated errors.
    draws : ndarray, shape (n, sources)
        Of the stated errors.
    criterion, design
        See `mcnav.analysis.comparison.compare`.
    """
    count = len(model.nominal) + 1
    engines = cache(simulate)

    @cache
    def judged(multiple: float) -> Array:
        """Compute ratio, lower and upper bound for each output and the joint distribution, shape (count, 3)."""
        top = float(SMALLEST * 10.0 ** np.ceil(np.log10(multiple / SMALLEST) - 1e-9))
        outcomes = engines(top)(multiple * draws).values
        if not np.isfinite(outcomes).all(axis=1).mean() >= 1.0 - LARGEST_FAILED_SHARE:
            return np.full((count, 3), BEYOND)
        scaled = Model(model.partials, model.nominal, multiple * model.mean, multiple**2 * model.covariance)
        found = compare(scaled, multiple * draws, outcomes, criterion, design)
        joint = [] if found.ellipsoid is None else [found.ellipsoid.judgement]
        rows = [_ratio_and_interval(judgement) for judgement in [*(o.paired for o in found.outputs), *joint]]
        return np.array([*rows, *[[np.nan] * 3] * (count - len(rows))])

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
        from scipy.optimize import brentq  # slow to import: a tenth of a second

        values = [excess(kind, row, multiple) for multiple in steps]
        if np.isnan(values[0]):
            return float("nan")
        outside = next((place for place, value in enumerate(values) if value > 0.0), None)
        if outside is None:
            return float("inf")
        if outside == 0:
            return steps[0]
        bracket = np.log(steps[outside - 1 : outside + 1])
        root = brentq(lambda log: excess(kind, row, float(np.exp(log))), *bracket, xtol=ROOT_TOLERANCE)
        return float(np.exp(root))

    curves = np.array([judged(multiple) for multiple in steps])
    crossings = [np.array([crossing(kind, row) for row in range(count)]) for kind in ("departs", "agrees", "differs")]
    return DispersionRange(np.array(steps), curves[..., 0], curves[..., 1], curves[..., 2], *crossings)


def _ratio_and_interval(judgement: Judgement) -> list[float]:
    if judgement.ratio is None or judgement.interval is None:
        return [float("nan")] * 3
    return [judgement.ratio, *judgement.interval]
