"""Updates of LANES aided samples: measurements' errors, innovations, gates, and corrections."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array, IndexArray
from mcnav.compiled.blocks import THREE
from mcnav.compiled.jit import allocation_free_part, inlined
from mcnav.compiled.lanes import half_turn_of_square
from mcnav.compiled.vectors import Rooms, Vector, load, room, store, where
from mcnav.systems.ins.ensemble.filters import SIX, FilterUpdates, room_for
from mcnav.systems.ins.ensemble.innovations import INNOVATION
from mcnav.systems.ins.ensemble.own_responses import (
    DelayTables,
    OffsetTables,
    change_late,
    find_offset,
    respond_to_offset,
    scale_responses,
)
from mcnav.systems.ins.ensemble.steps import Deviations, turn_less_one
from mcnav.systems.ins.filter.consistency import COUNTS
from mcnav.systems.ins.filter.model import NAVIGATION
from mcnav.systems.ins.sensors.innovation import MeasurementTables, NavigatorErrors
from mcnav.systems.ins.sensors.measurements import Measurements
from mcnav.systems.ins.sensors.registry import KINDS, QUANTITIES

LARGEST_CORRECTION: Final = 3.0
"""Largest rotation by a correction, rad: beyond it a sample leaves the engine's validity."""


class UpdateTables(NamedTuple):
    """Tables that samples share of U updates, as `Measurements` and `AidedTables` have them.

    Attributes
    ----------
    innovations : ndarray of int, shape (U, M)
        As `mcnav.systems.ins.ensemble.innovations.places_of` returns them.
    constant_rows : ndarray, shape (U, M, a)
        Responses to the constant errors of the sensors that are not zero.
    adjoint : ndarray, shape (U, 9, M)
        As `mcnav.systems.ins.ensemble.adjoint.Adjoint` has it.
    lags : ndarray of bool, shape (U,)
        Whether an update's sensor has had one before.
    state_rows : ndarray, shape (U, M, q)
        Responses to those of the filter's states that are errors of sensors.
    linked : ndarray of int
        Those of them that any innovation responds to.
    scales : ndarray of int, shape (U, M)
        Number of the state that is the scale factor of a component, -1 for none.
    swings : RateTables
    faulty : ndarray of bool, shape (U,)
        Whether an update has a fault.
    faults : ndarray, shape (U, M)
        What faults add to the measurements.
    offsets : OffsetTables
    delays : DelayTables
    """

    sensors: IndexArray
    sizes: IndexArray
    components: IndexArray
    innovations: IndexArray
    directions: Array
    parameters: Array
    constant_rows: Array
    places: Array
    correlated: Array
    memory: Array
    white: Array
    limits: Array
    state_rows: Array
    gains: Array
    roots: Array
    adjoint: Array
    lags: NDArray[np.bool_]
    linked: IndexArray
    scales: IndexArray
    of_filter: FilterUpdates
    swings: RateTables
    faulty: NDArray[np.bool_]
    faults: Array
    offsets: OffsetTables
    delays: DelayTables


class RateTables(NamedTuple):
    """Tables of the rate with which navigators compute an antenna's velocity, in U updates.

    Attributes
    ----------
    swinging : ndarray of bool, shape (U,)
        Whether an update needs the rate, as that of an antenna's velocity on a lever arm does.
    swung : ndarray of bool, shape (U, M)
        Which of its components do.
    levers : ndarray, shape (U, 3)
        The lever arms.
    errors : ndarray, shape (U, 3, p)
        Responses of the rate to the constant errors of the gyros that are not zero.
    biases, states : ndarray, shapes (U, 3, n), (U, 3, s)
        Responses to biases of processes, and to the errors that states of the filter are.
    drifting, estimated : ndarray of int, shapes (n,), (s,)
        Numbers of these biases and states.
    """

    swinging: NDArray[np.bool_]
    swung: NDArray[np.bool_]
    levers: Array
    errors: Array
    biases: Array
    states: Array
    drifting: IndexArray
    estimated: IndexArray


def along_truth(measured: Measurements) -> NDArray[np.bool_]:
    """Return which updates have innovations whose responses do not depend on a sample's attitude, shape (U,).

    Those of position and velocity without a lever arm.
    """
    used = np.arange(measured.kinds.shape[1]) < measured.sizes[:, None]
    fixed = [KINDS[name] for name, quantity in QUANTITIES.items() if quantity.fixed_row]
    plain = np.isin(measured.kinds, fixed) & ~measured.parameters.any(axis=2) & ~measured.swinging[:, None]
    return np.asarray((plain | ~used).all(axis=1))


class Estimates(NamedTuple):
    """Estimates of the filters of LANES samples, and room for an update; the last axis is the lanes.

    Attributes
    ----------
    estimate : ndarray, shape (q, LANES)
        Of the other states; of a constant that a state models exactly, less its true value.
    aiding : ndarray, shape (A, LANES)
        Constant errors of the sensors.
    drifts, shown : ndarray, shape (G, LANES)
        Correlated errors of all components, and those that the epochs show.
    disturbance, innovation, whitened : ndarray, shape (3 C, LANES)
        Of an update's components; C blocks of three hold them.
    rotation : ndarray, shape (3, LANES)
        Rotation vector from true to indicated axes.
    rate : ndarray, shape (3, LANES)
        What errors of the gyros make of a navigator's rate, in inertial axes, before the filter's estimates.
    swing, corrected : ndarray, shape (3, LANES)
        Velocity of the antenna by the error of that rate, and what of it is not the gyros' own errors.
    offset, known : ndarray, shape (3, LANES)
        Errors of the sensor's offset less what is estimated of them, in inertial axes and in their own.
    of_offset : ndarray, shape (3, LANES)
        Responses of a component to them, in inertial axes.
    accepted : ndarray, shape (1, LANES)
    before : ndarray, shape (sensors, 3 C, LANES)
        Whitened innovation of each sensor's update before.
    tally : ndarray, shape (sensors, 5, LANES)
        As `mcnav.contract.filter_record.BY_SENSOR` has them.
    """

    estimate: Array
    aiding: Array
    drifts: Array
    shown: Array
    disturbance: Array
    innovation: Array
    whitened: Array
    rotation: Array
    rate: Array
    swing: Array
    corrected: Array
    offset: Array
    known: Array
    of_offset: Array
    accepted: Array
    before: Array
    tally: Array


def estimates_of(
    states: int, aiding: int, components: int, sensors: int, keep: Rooms = room, drifting: Rooms = room,
    most: int = SIX,
) -> Estimates:  # fmt: skip
    """Return room for estimates.

    Parameters
    ----------
    keep : callable
        Makes the rooms that outlast an update.
    drifting : callable
        Makes those of correlated errors: the same, unless there are none.
    most : int
        Components of the largest measurement.
    """
    size = room_for(most)
    return Estimates(
        keep(states), keep(aiding), drifting(components), drifting(components), room(size), room(size), room(size),
        room(3), room(3), room(3), room(3), room(3), room(3), room(3), room(1),
        keep(sensors, size), keep(sensors, COUNTS),
    )  # fmt: skip


@allocation_free_part
def disturb(u: int, m: int, tables: UpdateTables, white: Array, drifting: Array, first: int, own: Estimates) -> None:
    """Draw the errors of an update's measurements, from normal variates of white and of correlated errors.

    Parameters
    ----------
    white, drifting : ndarray, shape (rows, LANES)
    first : int
        Row of the update's first variate.
    """
    for c in range(m):
        value = tables.white[u, c] * load(white, first + c)
        if tables.correlated[u, c] > 0.0:
            at, kept = tables.components[u, c], tables.memory[u, c]
            driven = tables.correlated[u, c] * np.sqrt(1.0 - kept * kept)
            drift = kept * load(own.drifts, at) + driven * load(drifting, first + c)
            store(own.drifts, at, drift)
            store(own.shown, at, drift)
            value += drift
        store(own.disturbance, c, value)


@allocation_free_part
def add_constant_errors(u: int, m: int, tables: UpdateTables, own: Estimates) -> None:
    """Add what constant errors of the sensors contribute to an update."""
    for c in range(m):
        value = load(own.disturbance, c)
        for a in range(len(own.aiding)):
            value -= tables.constant_rows[u, c, a] * load(own.aiding, a)
        store(own.disturbance, c, value)


@allocation_free_part
def add_faults(u: int, m: int, tables: UpdateTables, own: Estimates) -> None:
    """Add what faults of the sensors contribute to an update."""
    for c in range(m):
        store(own.disturbance, c, load(own.disturbance, c) + tables.faults[u, c])


@allocation_free_part
def add_rate_errors(u: int, m: int, tables: UpdateTables, samples: Deviations, own: Estimates) -> None:
    """Add what errors of the gyros contribute to an update of an antenna's velocity: ``d . (e x L)``."""
    rates = tables.swings
    x = y = z = 0.0 * load(own.disturbance, 0)
    for q in range(rates.errors.shape[2]):
        error = load(samples.errors, q)
        x += rates.errors[u, 0, q] * error
        y += rates.errors[u, 1, q] * error
        z += rates.errors[u, 2, q] * error
    for n in range(len(rates.drifting)):
        error = load(samples.bias, rates.drifting[n])
        x += rates.biases[u, 0, n] * error
        y += rates.biases[u, 1, n] * error
        z += rates.biases[u, 2, n] * error
    store(own.rate, 0, x)
    store(own.rate, 1, y)
    store(own.rate, 2, z)
    a, b, c = rates.levers[u, 0], rates.levers[u, 1], rates.levers[u, 2]
    sx, sy, sz = y * c - z * b, z * a - x * c, x * b - y * a
    for e in range(m):
        if rates.swung[u, e]:
            dx, dy, dz = tables.directions[u, e, 0], tables.directions[u, e, 1], tables.directions[u, e, 2]
            store(own.disturbance, e, load(own.disturbance, e) - (dx * sx + dy * sy + dz * sz))


@allocation_free_part
def _swing(u: int, spin: float, rates: RateTables, turned: Array, own: Estimates) -> None:
    """Compute what the error of a navigator's rate makes of the antenna's velocity, before it is turned.

    The rate over the earth has the earth's rate W along indicated axes, ``-(R^T - I) W``.
    """
    x, y, z = -spin * load(turned, 6), -spin * load(turned, 7), -spin * load(turned, 8)
    for n in range(len(rates.estimated)):
        estimate = load(own.estimate, rates.estimated[n])
        x -= rates.states[u, 0, n] * estimate
        y -= rates.states[u, 1, n] * estimate
        z -= rates.states[u, 2, n] * estimate
    a, b, c = rates.levers[u, 0], rates.levers[u, 1], rates.levers[u, 2]
    store(own.corrected, 0, y * c - z * b)
    store(own.corrected, 1, z * a - x * c)
    store(own.corrected, 2, x * b - y * a)
    x, y, z = x + load(own.rate, 0), y + load(own.rate, 1), z + load(own.rate, 2)
    store(own.swing, 0, y * c - z * b)
    store(own.swing, 1, z * a - x * c)
    store(own.swing, 2, x * b - y * a)


@allocation_free_part
def innovate(
    u: int, m: int, constants: Array, tables: UpdateTables, samples: Deviations, rows: Array, own: Estimates
) -> None:
    """Compute the innovations of the samples, and their responses to errors about each sample's own state.

    Parameters
    ----------
    rows : ndarray, shape (3 C, 9 + q, LANES)
        Or with more columns, or none if the responses are not needed; those along the truth are computed for Joseph's
        form alone.
    """
    turn, turned, moved = samples.turn, samples.turned, samples.moved
    plain = tables.of_filter.along_truth[u]
    spin, wanted = constants[3], len(rows) > 0 and (tables.of_filter.careful[u] or not plain)
    swinging = tables.swings.swinging[u]
    if not plain:
        turn_less_one(turn, turned)
    if swinging:
        _swing(u, spin, tables.swings, turned, own)
    x, y, z = load(moved, 3), load(moved, 4), load(moved, 5)
    vx, vy, vz = load(moved, 0) + spin * y, load(moved, 1) - spin * x, load(moved, 2)  # over the earth
    if wanted:
        for c in range(THREE * ((m + 2) // THREE)):
            for r in range(NAVIGATION):
                store(rows, (c, r), 0.0)
            for s in tables.of_filter.linked:
                if tables.of_filter.responding[u, s]:
                    for e in range(THREE):
                        response = tables.of_filter.state_rows[u, c // THREE, s, THREE * (c % THREE) + e]
                        store(rows, (c, NAVIGATION + THREE * s + e), response)
    shared = MeasurementTables(
        tables.directions, tables.parameters, tables.places, tables.swings.levers, tables.swings.swinging, constants
    )
    offsets = tables.offsets
    if offsets.present[u]:
        find_offset(u, offsets, own.aiding, own.estimate, own.known, own.offset)
    errors = NavigatorErrors(
        x, y, z, vx, vy, vz, turn, turned, own.rotation, own.swing, own.corrected, own.offset,
        own.of_offset,
    )  # fmt: skip
    for c in range(m):
        value = INNOVATION(tables.innovations[u, c], -load(own.disturbance, c), u, c, shared, errors, rows, wanted)
        change, scale = value + load(own.disturbance, c), tables.scales[u, c]
        if wanted and tables.delays.present[u]:
            value -= change_late(u, c, tables.delays, errors, samples.response, rows, own.estimate)
        if scale >= 0:
            factor = load(own.estimate, scale)
            value += factor * change
            if wanted:
                scale_responses(c, scale, change, factor, rows, own.of_offset)
        for s in tables.linked:
            value -= tables.state_rows[u, c, s] * load(own.estimate, s)
        if offsets.present[u]:  # the first order is in the disturbance and in the responses to states already
            for j in range(THREE):
                value -= offsets.rows[u, c, j] * load(own.known, j)
            if wanted:
                respond_to_offset(u, c, offsets, own.of_offset, rows)
        store(own.innovation, c, value)


@allocation_free_part
def whiten_by_own(m: int, root: Array, inverse: Array, own: Estimates) -> None:
    """Whiten the innovations of samples by covariances of their own.

    Parameters
    ----------
    root, inverse : ndarray, shapes (3 C, 3 C, LANES), (3 C, LANES)
        Cholesky factor of the innovations' covariance, and its diagonal inverted.
    """
    for c in range(m):
        value = load(own.innovation, c)
        for e in range(c):
            value -= load(root, (c, e)) * load(own.whitened, e)
        store(own.whitened, c, value * load(inverse, c))


@allocation_free_part
def whiten_by_shared(u: int, m: int, roots: Array, own: Estimates) -> None:
    """Whiten the innovations of samples by the covariance that they share, whose Cholesky factors are given."""
    for c in range(m):
        value = load(own.innovation, c)
        for e in range(c):
            value -= roots[u, c, e] * load(own.whitened, e)
        store(own.whitened, c, value * (1.0 / roots[u, c, c]))


@allocation_free_part
def judge(m: int, limit: float, lags: bool, sensor: int, own: Estimates) -> None:
    """Normalize the whitened innovations of a sample, count them, and accept or reject the measurement.

    Parameters
    ----------
    lags : bool
        Whether the sensor has had an update before.
    """
    normalized = lag = 0.0 * load(own.innovation, 0)
    for c in range(m):
        value = load(own.whitened, c)
        normalized += value * value
        lag += value * load(own.before, (sensor, c))
        store(own.before, (sensor, c), value)
    accepted = where(normalized <= limit, 1.0, 0.0)
    store(own.accepted, 0, accepted)
    tally = own.tally
    store(tally, (sensor, 0), load(tally, (sensor, 0)) + normalized)
    store(tally, (sensor, 1), load(tally, (sensor, 1)) + accepted)
    store(tally, (sensor, 2), load(tally, (sensor, 2)) + (1.0 - accepted))
    if lags:
        store(tally, (sensor, 3), load(tally, (sensor, 3)) + lag * (1.0 / m))
        store(tally, (sensor, 4), load(tally, (sensor, 4)) + 1.0)


@inlined
def turn_back(x: Vector, y: Vector, z: Vector, turn: Array, sound: Array) -> None:
    """Rotate navigators by what their filters have estimated of psi, backwards; beyond a limit they are not sound."""
    square = x * x + y * y + z * z
    sine, w = half_turn_of_square(square)
    store(sound, 0, where(square < LARGEST_CORRECTION * LARGEST_CORRECTION, load(sound, 0), 0.0))
    factor = -sine
    x, y, z = factor * x, factor * y, factor * z
    a, b, c, e = load(turn, 0), load(turn, 1), load(turn, 2), load(turn, 3)
    store(turn, 0, w * a - (x * b + y * c + z * e))
    store(turn, 1, w * b + (x * a + y * e - z * c))
    store(turn, 2, w * c + (y * a + z * b - x * e))
    store(turn, 3, w * e + (z * a + x * c - y * b))


@inlined
def _correction(
    u: int, m: int, gains: Array, r: int, s: int, t: int, innovation: Array
) -> tuple[Vector, Vector, Vector]:
    """Compute ``K n`` of three states."""
    n = load(innovation, 0)
    x, y, z = gains[u, r, 0] * n, gains[u, s, 0] * n, gains[u, t, 0] * n
    for c in range(1, m):
        n = load(innovation, c)
        x += gains[u, r, c] * n
        y += gains[u, s, c] * n
        z += gains[u, t, c] * n
    return x, y, z


@inlined
def _add_three(out: Array, r: int, s: int, t: int, x: Vector, y: Vector, z: Vector) -> None:
    """Add to three rows, or to fewer where some are the same."""
    x, y, z = load(out, r) + x, load(out, s) + y, load(out, t) + z
    store(out, r, x)
    store(out, s, y)
    store(out, t, z)


@allocation_free_part
def feed_back_own(correction: Array, corrected: Array, samples: Deviations, own: Estimates) -> None:
    """Correct the navigators and the estimates by ``K n``, rows of lanes."""
    turn_back(load(correction, 0), load(correction, 1), load(correction, 2), samples.turn, samples.sound)
    for r in range(6):
        store(samples.moved, r, load(samples.moved, r) - load(correction, 3 + r))
    for s in range(len(own.estimate)):
        store(own.estimate, s, load(own.estimate, s) + corrected[9 + s] * load(correction, 9 + s))


@allocation_free_part
def feed_back_shared(u: int, m: int, gains: Array, samples: Deviations, own: Estimates) -> None:
    """Correct the navigators and the estimates by gains along the truth."""
    moved, last = samples.moved, len(own.estimate) - 1
    for c in range(m):
        store(own.innovation, c, load(own.accepted, 0) * load(own.innovation, c))
    x, y, z = _correction(u, m, gains, 0, 1, 2, own.innovation)
    turn_back(x, y, z, samples.turn, samples.sound)
    for r in range(0, 6, 3):
        x, y, z = _correction(u, m, gains, 3 + r, 4 + r, 5 + r, own.innovation)
        _add_three(moved, r, r + 1, r + 2, -x, -y, -z)
    for s in range(0, last + 1, 3):
        t, e = min(s + 1, last), min(s + 2, last)
        x, y, z = _correction(u, m, gains, 9 + s, 9 + t, 9 + e, own.innovation)
        _add_three(own.estimate, s, t, e, x, y, z)
