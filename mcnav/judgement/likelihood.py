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
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.linalg import LinAlgError

from mcnav.arrays.products import innovation_covariance, transform
from mcnav.arrays.types import Array, IndexArray
from mcnav.contract.recorded import FilteredRecord
from mcnav.judgement.simulation import Innovations

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


def respond_freely(record: FilteredRecord, start: Array) -> Innovations:
    """Return the measurements that errors at the start alone bring about, without corrections, of shape (e, R)."""
    errors, values = start, []
    for stage in record.stages:
        errors = errors if stage.transition is None else stage.transition @ errors
        values.append(stage.response @ errors)
    return Innovations(tuple(values), np.zeros((0, 9, start.shape[1])))


def without_mean(record: FilteredRecord) -> FilteredRecord:
    """Return the record of errors of mean zero."""
    return replace(record, mean=np.zeros_like(record.mean))


def at_start_alone(record: FilteredRecord) -> frozenset[int]:
    """Return the causes that are errors at the start, and no process and no noise besides."""
    acting = {part.cause for stage in record.stages for part in (*stage.processes, *stage.noise)}
    return frozenset(record.initial_causes.tolist()) - acting - {-1}


def sources_at_start(record: FilteredRecord) -> tuple[Array, Array, IndexArray]:
    """Return errors of one sigma of each source at the start, (e, m), their correlations, (m, m), and causes, (m,)."""
    sigmas = np.sqrt(np.diag(record.initial))
    kept = np.flatnonzero(sigmas > 0.0)
    correlations = record.initial[np.ix_(kept, kept)] / np.outer(sigmas[kept], sigmas[kept])
    return record.to_states[:, kept] * sigmas[kept], correlations, record.initial_causes[kept]


def rescale_start(information: Array, correlations: Array, scales: Array) -> tuple[Array, Array]:
    """Return what other sizes of errors at the start change in products of whitened records.

    With their whitened responses W, of one sigma, M = W^T W and the change D of their covariance, products u^T v become
    u^T v - u^T W K W^T v with K = D (I + M D)^-1, and log det S grows by log det (I + M D).

    Parameters
    ----------
    information, correlations : ndarray, shape (m, m)
        M, and the covariance in units of the sigmas.
    scales : ndarray, shape (f, m)
        Of each source, in each of f sets.

    Returns
    -------
    tuple of ndarray, shapes (f, m, m) and (f,)
        K, and what log det S grows by.
    """
    change = correlations * (scales[:, :, None] * scales[:, None, :] - 1.0)
    inner = np.eye(len(information)) + information @ change
    return np.asarray(change @ np.linalg.inv(inner)), np.asarray(np.linalg.slogdet(inner)[1])


def log_likelihood(record: FilteredRecord, measured: Innovations, factors: Sequence[Mapping[int, float]]) -> Array:
    """Compute the log-likelihoods of R records with each of f sets of sizes, but for a constant, shape (f, R)."""
    total = np.zeros((len(factors), len(measured)))
    for whitened, log_determinants in whiten(record, measured, factors):
        total -= 0.5 * (np.einsum("fcr,fcr->fr", whitened, whitened) + log_determinants[:, None])
    return total
