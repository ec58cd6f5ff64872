"""Readings of LANES aided samples at an epoch: navigation errors, linear ones, and records of their filters.

The columns of a record are those of `mcnav.contract.filter_record.FilterSchema`, in this order: normalized estimation
errors squared of all estimated states, navigation, position, velocity, attitude and, if there are any, the other
estimated states; the lower triangle of the filter's covariance of the outputs, by rows; whether each output's error is
within one sigma of it, and within three; errors and variances of the other states; five counts of each sensor.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array, IndexArray
from mcnav.compiled.jit import allocation_free_part, allocation_free_subroutine
from mcnav.compiled.vectors import LANES, load, room, store, where
from mcnav.systems.ins.ensemble.normalization import (
    GROUPS,
    NormalizationRooms,
    SharedCovariances,
    normalization_rooms,
    normalize_by_own,
    normalize_by_shared,
)
from mcnav.systems.ins.ensemble.readout import LOCAL, TrueStates, copy_linear, copy_rows, read_errors
from mcnav.systems.ins.ensemble.steps import Deviations
from mcnav.systems.ins.ensemble.updates import Estimates
from mcnav.systems.ins.filter.consistency import COUNTS
from mcnav.systems.ins.sensors.innovation import rotation_vectors

COVARIANCE: Final = 45
"""Numbers of the lower triangle of the outputs' covariance."""


class EpochTables(NamedTuple):
    """Tables that samples share of the epochs and of their start.

    Attributes
    ----------
    numbers : ndarray of int, shape (m,)
        Steps that begin at the epochs.
    initial : ndarray, shape (n, n, 9)
        Covariance of the filter at the start, as blocks.
    chosen : ndarray of int
        Numbers of the states that are estimated.
    natural, partners : ndarray, shapes (m, q, 2), (q,)
        What states that are shown have of themselves and of others, as
        `mcnav.systems.ins.filter.tables.FilterTables` has it.
    stops : ndarray of bool, shape (K + 1,)
        Whether steps begin at the start, at updates or at epochs, the end of all steps included.
    """

    numbers: IndexArray
    truth: TrueStates
    output_maps: Array
    covariances: SharedCovariances
    first_updates: IndexArray
    sizes: Array
    initial: Array
    biases: IndexArray
    drifts: IndexArray
    drift_sigmas: Array
    faded: Array
    chosen: IndexArray
    natural: Array
    partners: IndexArray
    stops: NDArray[np.bool_]


class ReadingRooms(NamedTuple):
    """Room for a reading; the last axis is the lanes.

    Attributes
    ----------
    local, axes : ndarray, shapes (LOCAL, LANES), (9, LANES)
    outputs : ndarray, shape (9, LANES)
    record : ndarray, shape (width, LANES)
    """

    normalization: NormalizationRooms
    local: Array
    axes: Array
    outputs: Array
    record: Array


class Readings(NamedTuple):
    """Results of n samples at m epochs.

    Attributes
    ----------
    values : ndarray, shape (n, m, 9)
    linear : ndarray, shape (n, 9)
        At the last epoch.
    outcomes : ndarray of int, shape (n,)
    records : ndarray, shape (m, n, width)
    states : ndarray, shape (n, m, 10)
        Quaternions, deviations of velocity and of position, for a smoother; else none.
    innovations : ndarray, shape (n, U, M)
        Zero where a measurement is rejected, for a smoother; else none.
    """

    values: Array
    linear: Array
    outcomes: IndexArray
    records: Array
    states: Array
    innovations: Array


def width_of_record(estimated: int, states: int, sensors: int) -> int:
    """Return the numbers of a record.

    Parameters
    ----------
    estimated, states : int
        States that are estimated, and all states besides those of navigation.
    """
    return GROUPS - (estimated == 9) + COVARIANCE + 18 + 2 * states + COUNTS * sensors


def reading_rooms(states: int, width: int, own: bool) -> ReadingRooms:
    """Return room for readings of filters with a number of states besides those of navigation.

    Parameters
    ----------
    width : int
        Numbers of a record.
    own : bool
        Whether each filter has a covariance of its own.
    """
    return ReadingRooms(normalization_rooms(states, own), room(LOCAL), room(9), room(9), room(width))


@allocation_free_part
def change_correlated_errors(reached: int, epochs: EpochTables, normals: Array, own: Estimates) -> None:
    """Change the correlated errors of the sensors from their last measurements to an epoch."""
    for c in range(len(own.shown)):
        kept = epochs.faded[reached, c]
        driven = epochs.drift_sigmas[c] * np.sqrt(1.0 - kept * kept)
        store(own.shown, c, kept * load(own.shown, c) + driven * load(normals, c))


@allocation_free_part
def _collect_errors(
    reached: int, begin: int, size: int, epochs: EpochTables, of_states: Array, samples: Deviations, own: Estimates,
    rooms: ReadingRooms,
) -> None:  # fmt: skip
    """Compute the errors of the filters' states.

    Parameters
    ----------
    of_states : ndarray, shape (n, m, q) or (n, 1, q)
        Constant errors and flexures that the other states model.
    """
    at = min(reached, of_states.shape[1] - 1)
    errors = rooms.normalization.errors
    rotation_vectors(samples.turn, own.rotation)
    for r in range(3):
        store(errors, r, load(own.rotation, r))
    for r in range(6):
        store(errors, 3 + r, load(samples.moved, r))
    for s in range(len(own.estimate)):
        for i in range(LANES):
            errors[9 + s, i] = of_states[begin + min(i, size - 1), at, s]
        x = load(errors, 9 + s) - load(own.estimate, s)
        if epochs.biases[s] >= 0:
            x += load(samples.bias, epochs.biases[s])
        if epochs.drifts[s] >= 0:
            x += load(own.shown, epochs.drifts[s])
        store(errors, 9 + s, x)


@allocation_free_part
def _record(reached: int, epochs: EpochTables, own_gains: bool, own: Estimates, p: Array, rooms: ReadingRooms) -> None:
    """Fill the record of the filters, whose covariances are p or those that all share."""
    record, outputs, errors, shared = rooms.record, rooms.outputs, rooms.normalization.errors, epochs.covariances
    nothing, at, states = 0.0 * load(outputs, 0), 0, len(own.estimate)
    for group in range(GROUPS - (len(epochs.chosen) == 9)):
        store(record, at, load(rooms.normalization.nees, group))
        at += 1
    covariance, within = at, at + COVARIANCE
    for r in range(9):
        for c in range(r + 1):
            if own_gains:
                store(record, at, load(rooms.normalization.mapped, (r, c)))
            else:
                store(record, at, nothing + shared.mapped[reached, at - covariance])
            at += 1
        variance = load(record, at - 1)
        size, sigma = np.abs(load(outputs, r)), np.sqrt(where(variance > 0.0, variance, 0.0))
        store(record, within + r, where(size <= sigma, 1.0, 0.0))
        store(record, within + 9 + r, where(size <= 3.0 * sigma, 1.0, 0.0))
    at += 18
    for s in range(states):
        e = epochs.partners[s]
        if e == s:
            store(record, at + s, load(errors, 9 + s))
        else:
            # of a flexure: the angle or its rate, a combination of two states
            a, b = epochs.natural[reached, s, 0], epochs.natural[reached, s, 1]
            store(record, at + s, a * load(errors, 9 + s) + b * load(errors, 9 + e))
        if not own_gains:
            store(record, at + states + s, nothing + shared.variances[reached, s])
        elif e == s:
            store(record, at + states + s, load(p, (9 + s, 9 + s)))
        else:
            a, b = epochs.natural[reached, s, 0], epochs.natural[reached, s, 1]
            variance = a * a * load(p, (9 + s, 9 + s)) + b * b * load(p, (9 + e, 9 + e))
            store(record, at + states + s, variance + 2.0 * a * b * load(p, (9 + max(s, e), 9 + min(s, e))))
    at += 2 * states
    for sensor in range(len(own.tally)):
        for c in range(COUNTS):
            store(record, at, load(own.tally, (sensor, c)))
            store(own.tally, (sensor, c), 0.0)
            at += 1


@allocation_free_part
def keep_innovation(u: int, m: int, begin: int, size: int, innovation: Array, out: Array) -> None:
    """Keep the innovations of an update for a smoother, shape (n, U, M)."""
    for i in range(size):
        for c in range(m):
            out[begin + i, u, c] = innovation[c, i]


@allocation_free_subroutine
def read(
    reached: int, begin: int, size: int, constants: Array, epochs: EpochTables, of_states: Array, own_gains: bool,
    samples: Deviations, own: Estimates, p: Array, rooms: ReadingRooms, results: Readings,
) -> None:  # fmt: skip
    """Read samples and their filters at an epoch.

    Parameters
    ----------
    of_states : ndarray, shape (n, m, q) or (n, 1, q)
        Constant errors and flexures that the other states model.
    p : ndarray, shape (9 + q, 9 + q, LANES)
        Covariances of the filters, where each has its own.
    """
    _collect_errors(reached, begin, size, epochs, of_states, samples, own, rooms)
    if own_gains:
        normalize_by_own(p, epochs.chosen, epochs.output_maps[reached], rooms.normalization)
    else:
        normalize_by_shared(
            reached, epochs.covariances, epochs.chosen, epochs.output_maps[reached], rooms.normalization
        )
    read_errors(reached, constants, epochs.truth, samples.turn, samples.moved, rooms.local, rooms.axes, rooms.outputs)
    copy_rows(rooms.outputs, begin, size, reached, results.values)
    _record(reached, epochs, own_gains, own, p, rooms)
    for i in range(size):
        for c in range(len(rooms.record)):
            results.records[reached, begin + i, c] = rooms.record[c, i]
    if len(results.states) > 0:
        for i in range(size):
            for r in range(4):
                results.states[begin + i, reached, r] = samples.turn[r, i]
            for r in range(6):
                results.states[begin + i, reached, 4 + r] = samples.moved[r, i]
    if reached == len(epochs.numbers) - 1:
        copy_linear(samples.linear, begin, size, results.linear)
