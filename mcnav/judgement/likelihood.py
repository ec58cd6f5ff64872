"""Likelihood of innovations when sizes of a campaign are multiplied by factors.

The filter that judges knows all errors s of the campaign with the sizes that it is given. The innovations nu of the
filter that is judged are its measurements; the corrections that this filter made are known, and taken out of them
once. With the mean m and the covariance P of s, and the measurements y that are left ::

    r = y - H m      S = H P H^T + R      log-likelihood = -1/2 sum (r^T S^-1 r + log det S)

S and the gain depend on the sizes alone, so that many records are whitened at once (Kalman filter in innovation form;
Anderson and Moore 1979, *Optimal Filtering*, section 10.5).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.linalg import LinAlgError
from scipy.optimize import brentq, minimize_scalar

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
    """Estimate the factor of one size from one record.

    Parameters
    ----------
    drop : float
        Fall of the log-likelihood at the ends of the interval.
    """
    measured = without_corrections(record, innovations)

    def values(logarithms: Array) -> Array:
        factors = [{cause: float(np.exp(each))} for each in logarithms]
        likelihoods = log_likelihood(record, measured, factors)[:, 0]
        if np.isnan(likelihoods).any():
            raise NumericalError(f"the likelihood of a record is not a number for some of the factors {factors}")
        return likelihoods

    def value(logarithm: float) -> float:
        return float(values(np.array([logarithm]))[0])

    widest = float(np.log(WIDEST))
    grid = np.linspace(-widest, widest, 13)
    best = int(np.argmax(values(grid)))
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
