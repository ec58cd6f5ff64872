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
from mcnav.arrays.types import Array
from mcnav.contract.recorded import FilteredRecord, Stage
from mcnav.judgement.simulation import Innovations

AT_ONCE: Final = 4
"""Stages of which the innovations of many records are whitened at once; with 15 states and 6 components, few products.
"""


def without_corrections(record: FilteredRecord, innovations: Innovations) -> Innovations:
    """Return the measurements that R records would have without the corrections that the filter made.

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
    return Innovations(tuple(values), np.zeros((0, 9, len(innovations))))


class Whitening:
    """The covariances of the filter that judges, with each of f sets of sizes, on its way through the stages."""

    def __init__(self, record: FilteredRecord, factors: Sequence[Mapping[int, float]]) -> None:
        scale = np.ones((len(factors), len(record.causes) + 1))  # the last column is that of no cause, -1
        for row, sizes in zip(scale, factors, strict=True):
            row[list(sizes)] = list(sizes.values())
        initial = scale[:, record.initial_causes]
        self.covariance = transform(record.to_states, record.initial * initial[:, :, None] * initial[:, None, :])
        self.squared = scale[:, :, None, None] ** 2

    def through(self, stage: Stage, mean: Array, innovation: Array) -> tuple[Array, Array, Array]:
        """Take means, (f, e, R), through a stage; return them, whitened innovations, (f, c, R), and log det S, (f,)."""
        covariance, squared = self.covariance, self.squared
        if stage.transition is not None:
            mean = stage.transition @ mean
            covariance = self.covariance = transform(stage.transition, covariance)
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
        covariance -= back @ half
        return mean + back @ whitened, whitened, 2.0 * np.sum(np.log(np.diagonal(root, axis1=1, axis2=2)), axis=1)


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
    filters = Whitening(record, factors)
    mean = np.broadcast_to(record.mean[None, :, None], (len(factors), len(record.mean), len(measured)))
    for stage, innovation in zip(record.stages, measured.values, strict=True):
        mean, whitened, log_determinants = filters.through(stage, mean, innovation)
        yield whitened, log_determinants


def whiten_many(
    record: FilteredRecord, measured: Innovations, factors: Sequence[Mapping[int, float]]
) -> Iterator[tuple[int, Array, float]]:
    """Whiten the innovations of many records of mean zero, some stages at once, with each of f sets of sizes.

    The whitened innovations of k stages and the mean behind them are linear in the mean before and the innovations: one
    matrix for all records, which is what the filter makes of unit columns.

    Yields
    ------
    tuple of int, ndarray, float
        Number of the set; whitened innovations of some stages, shape (c, R), until the next is asked for; log det S.
    """
    filters, size = Whitening(record, factors), len(record.mean)
    means = np.zeros((len(factors), size, len(measured)))
    for begin in range(0, len(record.stages), AT_ONCE):
        stages = record.stages[begin : begin + AT_ONCE]
        inputs = np.concatenate([means[0], *measured.values[begin : begin + AT_ONCE]])
        units, rows, at = np.eye(len(inputs)), list[Array](), size
        mean, grown = np.broadcast_to(units[:size], (len(factors), size, len(units))), np.zeros(len(factors))
        for stage in stages:
            innovation = units[at : at + len(stage.response)]
            mean, whitened, log_determinants = filters.through(stage, mean, innovation)
            rows.append(whitened)
            grown += log_determinants
            at += len(innovation)
        maps = np.concatenate([mean, *rows], axis=1)
        outputs = np.empty_like(inputs)
        for number, growth in enumerate(grown.tolist()):
            inputs[:size] = means[number]
            np.matmul(maps[number], inputs, out=outputs)
            means[number] = outputs[:size]
            yield number, outputs[size:], growth


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


def log_likelihood(record: FilteredRecord, measured: Innovations, factors: Sequence[Mapping[int, float]]) -> Array:
    """Compute the log-likelihoods of R records with each of f sets of sizes, but for a constant, shape (f, R)."""
    total = np.zeros((len(factors), len(measured)))
    for whitened, log_determinants in whiten(record, measured, factors):
        total -= 0.5 * (np.einsum("fcr,fcr->fr", whitened, whitened) + log_determinants[:, None])
    return total
