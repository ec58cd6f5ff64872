"""Samples behind a smoother: their errors, which the innovations of all of their measurements correct backwards.

The filters have gains along the truth, so that samples share F, H, K, S and P. A sample needs its innovations n, eight
bytes for each component of each measurement, and its states at the epochs. Backwards from the end, as rows::

    lambda- = n S^-1 H + lambda+ (I - K H)       lambda+ (before) = lambda- F       correction lambda P

All innovations between two epochs are multiplied at once by what they add to lambda at the earlier one. The
navigator's state is corrected as the filter corrects it: exactly, not to first order. A smoother with a lag
has the measurements up to T = t + lag: those after it are taken away by the product X of the same maps from T to t::

    lambda (of the lag) = lambda(t) - lambda(T) X
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from mcnav.arrays.types import Array, IndexArray
from mcnav.compiled.jit import allocation_free_loop, allocation_free_part
from mcnav.compiled.vectors import LANES, load, room
from mcnav.linear.engine.smoother import SAME_INSTANT
from mcnav.systems.ins.ensemble.aided import AidedErrors, AidedTables
from mcnav.systems.ins.ensemble.gains import SharedGains
from mcnav.systems.ins.ensemble.readout import LOCAL, TrueStates, copy_rows, read_errors
from mcnav.systems.ins.ensemble.updates import turn_back
from mcnav.systems.ins.filter.model import NAVIGATION
from mcnav.systems.ins.linear.closed_loop import ClosedLoop
from mcnav.systems.ins.sensors.innovation import rotation_vectors

GROUPS: Final = {"navigation": slice(0, 9), "position": slice(0, 3), "velocity": slice(3, 6), "attitude": slice(6, 9)}
"""Outputs whose normalized errors are recorded, by group."""

SINGULAR: Final = 1e-10
"""Eigenvalue of a claimed correlation below which there is rounding: the claim is a difference of covariances."""


@dataclass(frozen=True)
class SmootherTables:
    """Tables that samples share behind a smoother with f states, at m epochs.

    Attributes
    ----------
    epochs, ends : ndarray of int, shape (m,)
        Numbers of the stops at which the epochs are, and at which the last measurements are that count.
    gathered : ndarray, shape (U, M, f)
        What an innovation adds to lambda at the stop before it.
    across : ndarray, shape (stops - 1, f, f)
        From lambda at a stop to that at the stop before it.
    updates : ndarray of int, shape (stops,)
        Numbers of the first updates after the stops.
    covariances, claimed : ndarray, shapes (m, f, f), (m, 9, 9)
        P of the filter; covariance of the outputs that the smoother claims.
    later : ndarray, shape (m, f, f)
        X, from the last measurement that counts; zero where that is the last of all.
    output_maps : ndarray, shape (m, 9, 9)
    truth : TrueStates
    constants : ndarray
        Of the earth.
    """

    epochs: IndexArray
    ends: IndexArray
    gathered: Array
    across: Array
    updates: IndexArray
    covariances: Array
    claimed: Array
    later: Array
    output_maps: Array
    truth: TrueStates
    constants: Array

    @classmethod
    def of(cls, tables: AidedTables, lag: float, claimed: Array) -> SmootherTables:
        """Prepare them.

        Parameters
        ----------
        lag : float
            s, infinite with a fixed interval.
        claimed : ndarray, shape (m, 9, 9)
        """
        loop, shared = tables.loop, tables.ensemble
        ends = last_times(loop.times, shared.epochs, lag)
        stops = np.union1d(shared.epochs, ends)
        gathered, across = _gather(loop, tables.shared, stops)
        epochs, ends = np.searchsorted(stops, shared.epochs), np.searchsorted(stops, ends)
        return cls(
            epochs, ends, gathered, across, loop.first_updates[stops + 1], tables.shared.covariances, claimed,
            _from_ends(across, epochs, ends), shared.output_maps, shared.truth, loop.truth.earth.constants,
        )  # fmt: skip

    def corrections(self, innovations: Array) -> Array:
        """Compute what is known of the states' errors at the epochs, shape (n, m, f), from innovations, (n, U, M)."""
        count, states = len(innovations), self.gathered.shape[2]
        adjoints = np.zeros((len(self.updates), count, states))
        for stop in range(len(self.across) - 1, -1, -1):
            first, last = self.updates[stop : stop + 2]
            between = innovations[:, first:last].reshape(count, -1) @ self.gathered[first:last].reshape(-1, states)
            adjoints[stop] = adjoints[stop + 1] @ self.across[stop] + between
        known = adjoints[self.epochs] - adjoints[self.ends] @ self.later
        return np.asarray((known @ self.covariances).swapaxes(0, 1))


def last_times(times: Array, readings: IndexArray, lag: float) -> IndexArray:
    """Return the numbers of the last times whose measurements count at readings, shape (m,)."""
    until = np.searchsorted(times, times[readings] + lag + SAME_INSTANT, side="right") - 1
    return np.asarray(np.maximum(until, readings), dtype=np.int64)


def _gather(loop: ClosedLoop, shared: SharedGains, stops: IndexArray) -> tuple[Array, Array]:
    """Return `SmootherTables.gathered` and `SmootherTables.across`."""
    rows = np.concatenate([loop.measurements.rows, loop.filter.rows], axis=2)
    assert loop.timeline.filter is not None
    transitions = loop.timeline.filter.steps(0, len(loop.times) - 1).transitions
    states = rows.shape[2]
    gathered, across = np.zeros_like(rows), np.zeros((len(stops) - 1, states, states))
    for stop, (first, last) in enumerate(pairwise(stops.tolist())):
        back = np.eye(states)
        for k in range(first, last):
            back = transitions[k] @ back
            for u in range(loop.first_updates[k + 1], loop.first_updates[k + 2]):
                m = loop.measurements.sizes[u]
                root, row = shared.roots[u, :m, :m], rows[u, :m]
                gathered[u, :m] = np.linalg.solve(root.T, np.linalg.solve(root, row)) @ back
                back = back - shared.gains[u, :, :m] @ (row @ back)
        across[stop] = back
    return gathered, across


def _from_ends(across: Array, epochs: IndexArray, ends: IndexArray) -> Array:
    """Return X of each epoch, all at once from stop to stop; zero where nothing is later."""
    later = np.zeros((len(epochs), *across.shape[1:]))
    later[ends < len(across)] = np.eye(across.shape[1])
    for stop in range(len(across) - 1, -1, -1):
        between = (epochs <= stop) & (ends > stop)
        later[between] = later[between] @ across[stop]
    return later


@dataclass(frozen=True)
class SmoothedSamples:
    """Samples behind a smoother.

    Attributes
    ----------
    values : ndarray, shape (n, m, 9)
    records : ndarray, shape (n, m, width)
        As `mcnav.contract.filter_record.FilterSchema` has them: NEES of `GROUPS`, the claimed covariance of the
        outputs, and whether each error is within one and three sigmas of it.
    """

    values: Array
    records: Array


def smooth_samples(tables: SmootherTables, aided: AidedErrors) -> SmoothedSamples:
    """Smooth samples whose innovations and states were kept."""
    corrections = np.ascontiguousarray(tables.corrections(aided.innovations)[:, :, :NAVIGATION])
    values, errors = np.empty_like(aided.values), np.empty_like(aided.values)
    _correct(
        tables.constants, tables.truth, aided.states, corrections, room(4), room(6), room(1), room(3), room(LOCAL),
        room(9), room(9), values, errors,
    )  # fmt: skip
    to_first_order = np.einsum("mij,nmj->nmi", tables.output_maps, errors)
    nees = [_normalize(to_first_order[:, :, each], tables.claimed[:, each, each]) for each in GROUPS.values()]
    rows, columns = np.tril_indices(values.shape[2])
    sigmas = np.sqrt(np.maximum(np.diagonal(tables.claimed, axis1=1, axis2=2), 0.0))
    within = [(np.abs(values) <= factor * sigmas).astype(float) for factor in (1.0, 3.0)]
    stated = np.broadcast_to(tables.claimed[:, rows, columns], (*values.shape[:2], len(rows)))
    return SmoothedSamples(values, np.concatenate([np.stack(nees, axis=2), stated, *within], axis=2))


def _normalize(errors: Array, covariance: Array) -> Array:
    """Compute ``e^T P^-1 e`` of errors, shape (n, m, d), by covariances, shape (m, d, d), which may be singular."""
    sigmas = np.sqrt(np.maximum(np.diagonal(covariance, axis1=1, axis2=2), 0.0))
    scale = np.where(sigmas > 0.0, 1.0 / np.where(sigmas > 0.0, sigmas, 1.0), 0.0)
    values, vectors = np.linalg.eigh(covariance * scale[:, :, None] * scale[:, None, :])
    along = np.einsum("nmi,mij->nmj", errors * scale, vectors)
    kept = values > SINGULAR
    return np.asarray(np.sum(along**2 * np.where(kept, 1.0 / np.where(kept, values, 1.0), 0.0), axis=2))


@allocation_free_part
def _place_corrected(
    m: int, begin: int, size: int, states: Array, corrections: Array, turn: Array, moved: Array, rotation: Array
) -> None:
    """Put samples with corrected velocities and positions into the lanes; the last one fills what is left of them."""
    for i in range(LANES):
        n = begin + min(i, size - 1)
        for r in range(4):
            turn[r, i] = states[n, m, r]
        for r in range(3):
            rotation[r, i] = corrections[n, m, r]
        for r in range(6):
            moved[r, i] = states[n, m, 4 + r] - corrections[n, m, 3 + r]


@allocation_free_part
def _turn_corrected(turn: Array, rotation: Array, sound: Array) -> None:
    """Turn the attitudes in the lanes by their corrections."""
    turn_back(load(rotation, 0), load(rotation, 1), load(rotation, 2), turn, sound)


@allocation_free_part
def _copy_errors(m: int, begin: int, size: int, rotation: Array, moved: Array, errors: Array) -> None:
    """Copy psi, v, x of the lanes to the samples' errors."""
    for i in range(size):
        for r in range(3):
            errors[begin + i, m, r] = rotation[r, i]
        for r in range(6):
            errors[begin + i, m, 3 + r] = moved[r, i]


@allocation_free_loop
def _correct(
    constants: Array, truth: TrueStates, states: Array, corrections: Array, turn: Array, moved: Array, sound: Array,
    rotation: Array, local: Array, axes: Array, outputs: Array, values: Array, errors: Array,
) -> None:  # fmt: skip
    """Correct the states of all samples at all epochs, LANES at a time, and read their errors.

    Parameters
    ----------
    states, corrections : ndarray, shapes (n, m, 10), (n, m, 9)
    values, errors : ndarray, shape (n, m, 9)
        Of the outputs; psi, v, x.
    """
    for begin in range(0, len(states), LANES):
        size = min(LANES, len(states) - begin)
        for m in range(states.shape[1]):
            _place_corrected(m, begin, size, states, corrections, turn, moved, rotation)
            _turn_corrected(turn, rotation, sound)
            read_errors(m, constants, truth, turn, moved, local, axes, outputs)
            rotation_vectors(turn, rotation)
            copy_rows(outputs, begin, size, m, values)
            _copy_errors(m, begin, size, rotation, moved, errors)
