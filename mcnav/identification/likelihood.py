"""Likelihood of a record's cosine transform, its maximum, and intervals by profiles.

With variances λ_b(θ) of the bands, n_b ordinates and their sums S_b,

    −2 log L(θ) = Σ_b [ n_b log λ_b + S_b / λ_b ]        information  ½ Σ_b n_b ∂log λ_b ∂log λ_bᵀ

(Whittle 1953). The maximum is found by Fisher's scoring, damped as in Levenberg's method. A 95 % interval holds the
values of a parameter at which the largest likelihood over the others is within a factor exp(−1.92) of the maximum.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.identification.processes import CORRELATION_TIME, Grid, Model
from mcnav.identification.spectrum import Bands

STEPS: Final = 60
CONVERGED: Final = 1e-7
"""Decrement of -2 log L below which the maximum is reached: far below the 3.84 of an interval."""

LARGEST_STEP: Final = 1.5
"""Largest change of a logarithm within one step of scoring."""

SHORTEST_TIME: Final = 10.0
"""Smallest correlation time that is tried, in intervals between readings: a shorter one is a filter of the readings."""

LONGEST_TIME: Final = 50.0
"""Largest correlation time that is tried, in lengths of the record: beyond, the process is a random walk."""

NEAR: Final = 1e-3
"""Tolerance of -2 log L about the end of an interval: its probability is right to 1e-4."""

FLAT: Final = 2.0
"""Standard deviation of a logarithm, at most, by which the search for the end of an interval begins and ends."""

REACH: Final = 60.0
"""Distance from the estimate within which the end of an interval is looked for, in a logarithm."""


@dataclass(frozen=True)
class Maximum:
    """A maximum of the likelihood.

    Attributes
    ----------
    logs : ndarray, shape (parameters,)
        Logarithms of the parameters.
    deviance : float
        −2 log L there.
    """

    logs: Array
    deviance: float


def deviance(model: Model, bands: Bands, logs: Array) -> float:
    """Compute −2 log L."""
    return float(_deviances(bands.numbers, bands.sums, model.variances(bands.grid, logs)[0]))


def _deviances(numbers: Array, sums: Array, variances: Array) -> Array:
    """Compute −2 log L of records, shape (...,), from sums and variances of shape (..., m)."""
    return np.asarray(np.sum(numbers * np.log(variances) + sums / variances, axis=-1))


def information(model: Model, bands: Bands, logs: Array) -> Array:
    """Compute the expected information of the logarithms, shape (parameters, parameters)."""
    variances, slopes = model.variances(bands.grid, logs)
    relative = slopes / variances[:, None]
    return np.asarray(0.5 * (relative.T * bands.numbers) @ relative)


def limits(model: Model, grid: Grid) -> tuple[Array, Array]:
    """Return the smallest and largest logarithms that are tried: those of correlation times have ends."""
    timed = np.array([name == CORRELATION_TIME for name in model.parameters])
    shortest, longest = np.log(SHORTEST_TIME * grid.interval), np.log(LONGEST_TIME * grid.duration)
    return np.where(timed, shortest, -np.inf), np.where(timed, longest, np.inf)


def maximize(
    model: Model, bands: Bands, start: Array, held: Iterable[int] = (), converged: float = CONVERGED
) -> Maximum:
    """Find the maximum near a start; ``held`` are parameters that stay as they are."""
    starts = np.asarray(start, dtype=float)[None]
    logs, deviances = maximize_many(model, bands.grid, bands.numbers, bands.sums[None], starts, held, converged)
    return Maximum(logs[0], float(deviances[0]))


def maximize_many(
    model: Model,
    grid: Grid,
    numbers: Array,
    sums: Array,
    starts: Array,
    held: Iterable[int] = (),
    converged: float = CONVERGED,
) -> tuple[Array, Array]:
    """Find the maxima of records with the same bands, each near its start.

    Parameters
    ----------
    numbers : ndarray, shape (m,)
    sums : ndarray, shape (k, m)
    starts : ndarray, shape (k, parameters)
    held : iterable of int
        Parameters that stay as they are.
    converged : float
        Decrement of −2 log L at which a maximum is reached.

    Returns
    -------
    logs : ndarray, shape (k, parameters)
    deviances : ndarray, shape (k,)
    """
    lowest, highest = limits(model, grid)
    logs = np.clip(starts, lowest, highest)
    free = np.array([at for at in range(logs.shape[1]) if at not in set(held)], dtype=np.intp)
    variances, slopes = model.variances(grid, logs)
    values, damping = _deviances(numbers, sums, variances), np.full(len(logs), 1e-3)
    going, diagonal = np.arange(len(logs)), np.arange(len(free))
    for _ in range(STEPS if len(free) else 0):
        relative = slopes[going][:, :, free] / variances[going, :, None]
        across = np.swapaxes(relative, 1, 2)
        gradient = 0.5 * across @ (sums[going] / variances[going] - numbers)[:, :, None]
        scoring = 0.5 * (across * numbers) @ relative
        ridge = damping[going, None] * np.maximum(scoring[:, diagonal, diagonal], 1e-6)
        scoring[:, diagonal, diagonal] += ridge
        step = np.clip(np.linalg.solve(scoring, gradient)[:, :, 0], -LARGEST_STEP, LARGEST_STEP)
        trial = logs[going]
        trial[:, free] = np.clip(trial[:, free] + step, lowest[free], highest[free])
        new, new_slopes = model.variances(grid, trial)
        real = np.all((new > 0.0) & np.isfinite(new), axis=1)
        after = np.full(len(going), np.inf)
        after[real] = _deviances(numbers, sums[going[real]], new[real])
        better = after <= values[going]
        on, back = going[better], going[~better]
        gained = values[on] - after[better]
        logs[on], values[on], variances[on], slopes[on] = trial[better], after[better], new[better], new_slopes[better]
        damping[on], damping[back] = np.maximum(damping[on] * 0.2, 1e-9), damping[back] * 8.0
        left = np.concatenate([on[(gained >= converged) | (damping[on] >= 1e-2)], back[damping[back] <= 1e12]])
        if not len(left):
            break
        going = np.sort(left)
    return logs, values


def profile_end(
    model: Model, bands: Bands, best: Maximum, parameter: int, sign: float, rise: float, reached: float
) -> float:
    """Find the end of an interval of a parameter's logarithm, where −2 log L is larger by ``rise`` than at the maximum.

    Parameters
    ----------
    sign : float
        1 for the upper end, −1 for the lower one.
    reached : float
        A logarithm that the interval already reaches, which is returned where the end is not beyond.
    """
    center = float(best.logs[parameter])
    sd = min(1.0 / np.sqrt(max(information(model, bands, best.logs)[parameter, parameter], 1e-12)), FLAT)
    lowest, highest = limits(model, bands.grid)
    bound = (highest if sign > 0.0 else lowest)[parameter]
    reach = abs(bound - center) if np.isfinite(bound) else REACH
    known: list[tuple[float, Array]] = [(0.0, best.logs)]

    def excess(distance: float) -> float:
        start = min(known, key=lambda pair: abs(pair[0] - distance))[1].copy()
        start[parameter] = center + sign * distance
        profile = maximize(model, bands, start, held=(parameter,))
        known.append((distance, profile.logs))
        return profile.deviance - best.deviance - rise

    inner = max(sign * (reached - center), 0.0)
    if inner >= reach or (inner > 0.0 and excess(inner) >= 0.0):
        return reached
    outer = min(inner + 2.0 * sd, reach)
    while not (above := excess(outer)) >= 0.0:
        if outer >= reach:
            return sign * np.inf
        inner, outer = outer, min(2.0 * outer, reach)
    while outer - inner > max(1e-3 * sd, 1e-9):
        # a parabola from the maximum is near the profile; the middle makes sure
        parabola, margin = outer * np.sqrt(rise / (rise + above)), 0.05 * (outer - inner)
        trial = parabola if inner + margin < parabola < outer - margin else 0.5 * (inner + outer)
        value = excess(trial)
        if value < 0.0:
            inner = trial
        else:
            outer, above = trial, value
        if abs(value) < NEAR:
            return float(center + sign * trial)
    return float(center + sign * 0.5 * (inner + outer))
