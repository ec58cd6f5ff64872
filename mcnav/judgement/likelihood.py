"""Likelihood of innovations when sizes of a campaign are multiplied by factors.

The filter that judges knows all errors s of the campaign with the sizes that it is given. The innovations nu of the
filter that is judged are its measurements; the corrections that this filter made are known. With the mean m and the
covariance P of s ::

    r = nu - (H m - E a)      S = H P H^T + R      log-likelihood = -1/2 sum (r^T S^-1 r + log det S)

S and the gain depend on the sizes alone, so that many records are whitened at once (Kalman filter in innovation form;
Anderson and Moore 1979, *Optimal Filtering*, section 10.5).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.linalg import LinAlgError
from scipy.linalg import cholesky, solve_triangular
from scipy.optimize import brentq, minimize_scalar

from mcnav._types import Array
from mcnav.contract.recorded import FilteredRecord
from mcnav.judgement.simulation import Innovations

WIDEST: Final = 30.0
"""Largest factor that is looked for, and the inverse of the smallest."""

DROP: Final = 1.920729410347062
"""What the log-likelihood falls by at the ends of a 95 % interval: half the 95 % point of chi-square of one degree."""


def whiten(
    record: FilteredRecord, innovations: Innovations, factors: Mapping[int, float]
) -> Iterator[tuple[Array, float]]:
    """Whiten the innovations of R records, stage by stage.

    Parameters
    ----------
    factors : mapping of int to float
        By cause; of others one.

    Yields
    ------
    tuple of ndarray, float
        Whitened innovations, shape (c, R), and log det S.
    """
    scale = np.array([factors.get(int(cause), 1.0) for cause in record.initial_causes])
    covariance = record.to_states @ (record.initial * np.outer(scale, scale)) @ record.to_states.T
    mean = np.repeat(record.mean[:, None], len(innovations), axis=1)
    estimates = np.zeros((len(record.stages[0].decay), len(innovations)))
    for stage, innovation in zip(record.stages, innovations.values, strict=True):
        if stage.transition is not None:
            mean = stage.transition @ mean
            mean[:9] -= stage.feedback @ estimates
            estimates = stage.decay[:, None] * estimates
            covariance = stage.transition @ covariance @ stage.transition.T
            for part in stage.processes:
                covariance[np.ix_(part.places, part.places)] += part.covariance * factors.get(part.cause, 1.0) ** 2
        cross = stage.response @ covariance
        total = cross @ stage.response.T
        for part in stage.noise:
            total[np.ix_(part.places, part.places)] += part.covariance * factors.get(part.cause, 1.0) ** 2
        try:
            root = cholesky(total, lower=True, check_finite=False)
        except LinAlgError:
            raise LinAlgError(f"the covariance of an innovation lost its definiteness at {stage.time:.6g} s") from None
        residual = innovation - (stage.response @ mean - stage.own_response @ estimates)
        whitened = solve_triangular(root, residual, lower=True, check_finite=False)
        half = solve_triangular(root, cross, lower=True, check_finite=False)  # S^-1/2 H P
        mean += half.T @ whitened
        covariance -= half.T @ half
        mean[:9] -= stage.gain[:9] @ innovation
        estimates = estimates + stage.gain[9:] @ innovation
        yield whitened, 2.0 * float(np.sum(np.log(np.diag(root))))


def log_likelihood(record: FilteredRecord, innovations: Innovations, factors: Mapping[int, float]) -> Array:
    """Compute the log-likelihoods of R records, but for a constant, shape (R,)."""
    total = np.zeros(len(innovations))
    for whitened, log_determinant in whiten(record, innovations, factors):
        total -= 0.5 * (np.einsum("cr,cr->r", whitened, whitened) + log_determinant)
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
    """Estimate the factor of one size from one record.

    Parameters
    ----------
    drop : float
        What the log-likelihood falls by at the ends of the interval.
    """

    def value(logarithm: float) -> float:
        return float(log_likelihood(record, innovations, {cause: float(np.exp(logarithm))})[0])

    widest = float(np.log(WIDEST))
    grid = np.linspace(-widest, widest, 13)
    values = [value(each) for each in grid]
    best = int(np.argmax(values))
    bounds = grid[max(best - 1, 0)], grid[min(best + 1, len(grid) - 1)]
    least = minimize_scalar(lambda x: -value(x), bounds=bounds, method="bounded", options={"xatol": 1e-3})
    top, most = float(least.x), -float(least.fun)

    def end(bound: float) -> float:
        if value(bound) > most - drop:
            return np.inf if bound > 0.0 else -np.inf
        return float(brentq(lambda x: value(x) - most + drop, top, bound, xtol=1e-3))

    return Factor(
        float(np.exp(top)), float(np.exp(end(-widest))), float(np.exp(end(widest))), most - value(0.0)
    )  # fmt: skip
