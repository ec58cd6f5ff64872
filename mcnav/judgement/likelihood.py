"""Likelihood of innovations when sizes of a campaign are multiplied by factors.

The filter that judges knows all errors s of the campaign with the sizes that it is given. The innovations nu of the
filter that is judged are its measurements; the corrections that this filter made are known, and taken out of them
once. With the mean m and the covariance P of s, and the measurements y that are left ::

    r = y - H m      S = H P H^T + R      log-likelihood = -1/2 sum (r^T S^-1 r + log det S)

S and the gain depend on the sizes alone, so that many records are whitened at once (Kalman filter in innovation form;
Anderson and Moore 1979, *Optimal Filtering*, section 10.5).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.linalg import LinAlgError

from mcnav.arrays.products import innovation_covariance, transform
from mcnav.arrays.types import Array
from mcnav.contract.recorded import FilteredRecord
from mcnav.errors import NumericalError
from mcnav.judgement.simulation import Innovations

WIDEST: Final = 30.0
"""Largest factor that is looked for, and the inverse of the smallest."""

DROP: Final = 1.920729410347062
"""Fall of the log-likelihood at the ends of a 95 % interval: half the 95 % point of chi-square of one degree."""


def without_corrections(record: FilteredRecord, innovations: Innovations) -> Innovations:
    """Return the innovations that R records would have without the corrections that the filter made.

    With the correction c of the errors s, which obeys c <- F c - [B a; 0] and c <- c - [K nu; 0], they are
    nu - (H c - E a): measurements of errors that no filter touches.
    """
    corrections = np.zeros((len(record.mean), len(innovations)))
    estimates = np.zeros((len(record.stages[0].decay), len(innovations)))
    values = []
    for stage, innovation in zip(record.stages, innovations.values, strict=True):
        if stage.transition is not None:
            corrections = stage.transition @ corrections
            corrections[:9] -= stage.feedback @ estimates
            estimates = stage.decay[:, None] * estimates
        values.append(innovation - (stage.response @ corrections - stage.own_response @ estimates))
        corrections[:9] -= stage.gain[:9] @ innovation
        estimates = estimates + stage.gain[9:] @ innovation
    return Innovations(tuple(values), innovations.errors)


def whiten(
    record: FilteredRecord, measured: Innovations, factors: Sequence[Mapping[int, float]]
) -> Iterator[tuple[Array, Array]]:
    """Whiten the innovations of R records, stage by stage, with each of f sets of sizes.

    Parameters
    ----------
    measured : Innovations
        `without_corrections`.
    factors : sequence of mapping of int to float
        By cause; of others one.

    Yields
    ------
    tuple of ndarray
        Whitened innovations, shape (f, c, R), and log det S, shape (f,).
    """
    scale = np.ones((len(factors), len(record.causes) + 1))  # the last column is that of no cause, -1
    for row, sizes in zip(scale, factors, strict=True):
        row[list(sizes)] = list(sizes.values())
    initial = scale[:, record.initial_causes]
    covariance = transform(record.to_states, record.initial * initial[:, :, None] * initial[:, None, :])
    mean = np.broadcast_to(record.mean[None, :, None], (len(factors), len(record.mean), len(measured))).copy()
    squared = scale[:, :, None, None] ** 2
    for stage, innovation in zip(record.stages, measured.values, strict=True):
        if stage.transition is not None:
            mean = stage.transition @ mean
            covariance = transform(stage.transition, covariance)
            for part in stage.processes:
                covariance[:, *part.block] += part.covariance * squared[:, part.cause]
        cross, total = innovation_covariance(covariance, stage.response)
        for part in stage.noise:
            total[:, *part.block] += part.covariance * squared[:, part.cause]
        try:
            root = np.linalg.cholesky(total)
        except LinAlgError:
            raise LinAlgError(f"the covariance of an innovation lost its definiteness at {stage.time:.6g} s") from None
        inverse = np.linalg.inv(root)
        whitened = inverse @ (innovation - stage.response @ mean)
        half = inverse @ cross  # S^-1/2 H P
        back = np.swapaxes(half, -1, -2)
        mean += back @ whitened
        covariance -= back @ half
        yield whitened, 2.0 * np.sum(np.log(np.diagonal(root, axis1=1, axis2=2)), axis=1)


def log_likelihood(record: FilteredRecord, measured: Innovations, factors: Sequence[Mapping[int, float]]) -> Array:
    """Compute the log-likelihoods of R records with each of f sets of sizes, but for a constant, shape (f, R)."""
    total = np.zeros((len(factors), len(measured)))
    for whitened, log_determinants in whiten(record, measured, factors):
        total -= 0.5 * (np.einsum("fcr,fcr->fr", whitened, whitened) + log_determinants[:, None])
    return total


@dataclass(frozen=True)
class Factor:
    """The factor of a size by maximum likelihood.

    Attributes
    ----------
    value : float
    low, high : float
        Ends of the 95 % interval; 0 or infinite where the likelihood does not fall that far.
    gain : float
        Log-likelihood above that of the factor one.
    """

    value: float
    low: float
    high: float
    gain: float


def estimate_factor(record: FilteredRecord, innovations: Innovations, cause: int, drop: float = DROP) -> Factor:
    """Estimate the factor of one size from one record, on grids of its logarithm that become finer.

    Parameters
    ----------
    drop : float
        Fall of the log-likelihood at the ends of the interval.
    """
    measured = without_corrections(record, innovations)

    def values(logarithms: Array) -> Array:
        factors = [{cause: float(np.exp(logarithm))} for logarithm in logarithms]
        likelihoods = log_likelihood(record, measured, factors)[:, 0]
        if np.isnan(likelihoods).any():
            raise NumericalError(f"the likelihood of a record is not a number for some of the factors {factors}")
        return likelihoods

    widest = float(np.log(WIDEST))
    grid = np.linspace(-widest, widest, 13)
    of_grid, at_one = values(grid), float(values(np.zeros(1))[0])
    for _ in range(3):
        grid, of_grid = _finer(grid, of_grid, values)
    best = int(np.argmax(of_grid))
    top, most = float(grid[best]), float(of_grid[best])
    low, high = (_end(grid, of_grid, best, most - drop, side, values) for side in (-1, 1))
    return Factor(float(np.exp(top)), float(np.exp(low)), float(np.exp(high)), most - at_one)


def _finer(grid: Array, of_grid: Array, values: Callable[[Array], Array]) -> tuple[Array, Array]:
    """Add points between the highest value and its neighbours."""
    best = int(np.argmax(of_grid))
    around = grid[[max(best - 1, 0), best, min(best + 1, len(grid) - 1)]]
    new = np.concatenate([np.linspace(around[0], around[1], 6)[1:-1], np.linspace(around[1], around[2], 6)[1:-1]])
    new = np.setdiff1d(new, grid)
    every = np.concatenate([grid, new])
    order = np.argsort(every)
    return every[order], np.concatenate([of_grid, values(new)])[order]


def _end(
    grid: Array, of_grid: Array, best: int, level: float, side: int, values: Callable[[Array], Array]
) -> float:  # fmt: skip
    """Return where the log-likelihood falls to a level on one side of its highest value; infinite where it does not."""
    below = np.flatnonzero(of_grid[best::side] < level) if side > 0 else np.flatnonzero(of_grid[best::-1] < level)
    if not len(below):
        return side * np.inf
    outer = best + side * int(below[0])
    ends, at_ends = grid[[outer - side, outer]], of_grid[[outer - side, outer]]
    for _ in range(3):
        points = np.linspace(ends[0], ends[1], 9)
        heights = np.concatenate([at_ends[:1], values(points[1:-1]), at_ends[1:]])
        first = int(np.argmax(heights < level))
        ends, at_ends = points[first - 1 : first + 1], heights[first - 1 : first + 1]
    share = (at_ends[0] - level) / (at_ends[0] - at_ends[1])
    return float(ends[0] + share * (ends[1] - ends[0]))
