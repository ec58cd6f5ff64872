"""Records of the same campaign, simulated by the linear system of a record's innovations.

See `mcnav.contract.recorded` for the equations. All simulated records have the gains that the filter used on the
record.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.recorded import FilteredRecord, Part

Drawn: TypeAlias = Callable[[int, tuple[Part, ...]], Array]
"""Draws the noise of parts, shape (size, R)."""


@dataclass(frozen=True)
class Innovations:
    """Innovations of R records, and their navigation errors.

    Attributes
    ----------
    values : tuple of ndarray, shape (c, R)
        By stage.
    errors : ndarray, shape (m, 9, R)
        Navigation errors less the reference's, at the stages with a read-out.
    """

    values: tuple[Array, ...]
    errors: Array

    def __len__(self) -> int:
        return int(self.values[0].shape[1])

    def chosen(self, columns: slice) -> Innovations:
        """Return some of the records."""
        return Innovations(tuple(each[:, columns] for each in self.values), self.errors[:, :, columns])


def beside(parts: Sequence[Innovations]) -> Innovations:
    """Put records beside each other."""
    values = tuple(np.concatenate(each, axis=1) for each in zip(*(part.values for part in parts), strict=True))
    return Innovations(values, np.concatenate([part.errors for part in parts], axis=2))


def recorded(record: FilteredRecord) -> Innovations:
    """Return the record's own innovations and errors."""
    errors = [stage.read_out.errors for stage in record.stages if stage.read_out is not None]
    values = tuple(stage.innovation[:, None] for stage in record.stages)
    return Innovations(values, np.array(errors).reshape(-1, 9, 1))


def simulate(record: FilteredRecord, count: int, generator: np.random.Generator) -> Innovations:
    """Simulate records without the mean of the errors."""
    start = record.to_states @ semidefinite_root(record.initial) @ generator.standard_normal((len(record.mean), count))
    return _propagate(record, start, _drawn(count, generator), generator)


def simulate_alone(record: FilteredRecord, count: int, generator: np.random.Generator, cause: int) -> Innovations:
    """Simulate measurements of one cause alone, without the corrections of the filter."""
    wanted = record.initial_causes == cause
    covariance = np.where(np.outer(wanted, wanted), record.initial, 0.0)
    errors = record.to_states @ semidefinite_root(covariance) @ generator.standard_normal((len(covariance), count))
    drawn, values = _drawn(count, generator, cause), []
    for stage in record.stages:
        if stage.transition is not None:
            errors = stage.transition @ errors + drawn(len(errors), stage.processes)
        values.append(stage.response @ errors + drawn(len(stage.response), stage.noise))
    return Innovations(tuple(values), np.zeros((0, 9, count)))


def _drawn(count: int, generator: np.random.Generator, cause: int | None = None) -> Drawn:
    """Return what draws the noise of all causes, or of one."""

    def drawn(size: int, parts: tuple[Part, ...]) -> Array:
        total, result = np.zeros((size, size)), np.zeros((size, count))
        chosen = [part for part in parts if cause in (None, part.cause)]
        for part in chosen:
            total[part.block] += part.covariance
        if chosen:
            places = np.unique(np.concatenate([part.places for part in chosen]))
            root = semidefinite_root(total[np.ix_(places, places)])
            result[places] = root @ generator.standard_normal((size, count))[places]
        return result

    return drawn


def respond(record: FilteredRecord, start: Array) -> Innovations:
    """Compute the innovations that errors at the start alone bring about, shape (e, R)."""
    return _propagate(record, start, lambda size, parts: np.zeros((size, start.shape[1])), None)


def less_mean(record: FilteredRecord, given: Innovations) -> Innovations:
    """Take what the mean of the errors brings about out of innovations and errors."""
    mean = respond(record, record.mean[:, None])
    values = tuple(value - offset for value, offset in zip(given.values, mean.values, strict=True))
    return Innovations(values, given.errors - mean.errors if len(mean.errors) else given.errors)


def _propagate(
    record: FilteredRecord, start: Array, drawn: Drawn, generator: np.random.Generator | None
) -> Innovations:
    """Propagate errors s and estimates a of R records through the stages."""
    size, count = start.shape
    navigation = slice(0, 9)
    errors, estimates = start.copy(), np.zeros((len(record.stages[0].decay), count))
    values, read = [], []
    reference = None if generator is None else generator.standard_normal((9, count))
    for stage in record.stages:
        if stage.transition is not None:
            errors = stage.transition @ errors + drawn(size, stage.processes)
            errors[navigation] -= stage.feedback @ estimates
            estimates = stage.decay[:, None] * estimates
        innovation = stage.response @ errors - stage.own_response @ estimates
        innovation += drawn(len(innovation), stage.noise)
        errors[navigation] -= stage.gain[navigation] @ innovation
        estimates = estimates + stage.gain[9:] @ innovation
        values.append(innovation)
        if stage.read_out is not None:
            outputs = stage.read_out.to_outputs @ errors[navigation]
            if reference is not None:
                outputs -= np.sqrt(stage.read_out.reference)[:, None] * reference
            read.append(outputs)
    return Innovations(tuple(values), np.array(read).reshape(-1, 9, count))


def semidefinite_root(covariance: Array) -> Array:
    """Return a root R of a positive semidefinite covariance, R R^T, by its eigenvectors in units of its sigmas.

    >>> semidefinite_root(np.array([[4.0, 0.0], [0.0, 0.0]])) @ np.array([1.0, 1.0])
    array([2., 0.])
    """
    sigma = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    scale = np.divide(1.0, sigma, out=np.zeros_like(sigma), where=sigma > 0.0)
    values, vectors = np.linalg.eigh(covariance * np.outer(scale, scale))
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    return np.asarray(sigma[:, None] * (root @ vectors.T))
