"""Measurements of samples that are late: what they measure at t - d, by the truth there and each quantity's innovation.

Seen from the truth at the time stamp t, the truth at t - d is a navigator with deviations, and h(t - d) - h(t) its
innovation without errors of the measurement. Nothing of it is linear in d; the linear closed loop of the same draws has
``-h' d``. A sample's delays are constant, one for each sensor, and jitter of its own at each time.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Final, NamedTuple

import numpy as np

from mcnav.arrays.types import Array, IndexArray
from mcnav.compiled.jit import allocation_free_loop, allocation_free_part
from mcnav.compiled.vectors import LANES, load, room, store
from mcnav.systems.ins.earth import Earth, local_axes
from mcnav.systems.ins.ensemble.innovations import INNOVATION, places_of
from mcnav.systems.ins.ensemble.own_responses import DelayTables
from mcnav.systems.ins.ensemble.steps import turn_less_one
from mcnav.systems.ins.linear.closed_loop import ClosedLoop
from mcnav.systems.ins.sensors.aiding import Sensor
from mcnav.systems.ins.sensors.comparison import Reference
from mcnav.systems.ins.sensors.delay import motion_along_truth, reference_of
from mcnav.systems.ins.sensors.innovation import MeasurementTables, NavigatorErrors
from mcnav.systems.ins.sensors.registry import QUANTITIES
from mcnav.systems.ins.sensors.surroundings import Surroundings
from mcnav.systems.ins.truth.trajectory import Platform, TruthStates

JITTER_STREAM: Final = (1 << 21) + 3
"""Number of the counter's highest word of jitter."""

AT_ONCE: Final = 50_000
"""Measurements whose truth is in memory together, some 1 kB each."""


def draw_jitters(loop: ClosedLoop, epochs: IndexArray, seed: int, samples: IndexArray) -> tuple[Array, Array]:
    """Draw jitter from the counter-based generators keyed by seed and sample.

    Parameters
    ----------
    epochs : ndarray of int, shape (m,)
        Numbers of their times.

    Returns
    -------
    jitters : ndarray, shape (n, U)
        s.
    values : ndarray, shape (n, m, q)
        Of the filter's states that are jitter at the epochs, zero of others.
    """
    measured, states = loop.measurements, [state.name for state in loop.model.states]
    jitters = np.zeros((len(samples), len(measured.times)))
    values = np.zeros((len(samples), len(epochs), len(states)))
    for number, sensor in enumerate(loop.sensors):
        if sensor.jitter == 0.0:
            continue
        updates = np.flatnonzero(measured.sensors == number)
        _, places = np.unique(np.concatenate([loop.times_of(updates), epochs]), return_inverse=True)
        drawn = np.empty((len(samples), int(places.max(initial=-1)) + 1))
        for row, index in enumerate(samples.tolist()):
            counter = np.array([0, 0, number, JITTER_STREAM], dtype=np.uint64)
            generator = np.random.Philox(counter=counter, key=np.array([seed, index], dtype=np.uint64))
            np.random.Generator(generator).standard_normal(out=drawn[row])
        at_updates, at_epochs = np.split(sensor.jitter * drawn[:, places], [len(updates)], axis=1)
        jitters[:, updates] = at_updates
        if sensor.jitter_name in states:
            values[:, :, states.index(sensor.jitter_name)] = at_epochs
    return jitters, values


def delay_tables(loop: ClosedLoop) -> DelayTables:
    """Tabulate how what sensors measure changes along the truth, for the filter's states that are delays and jitter."""
    measured, names = loop.measurements, [state.name for state in loop.model.states]
    updates, most = measured.components.shape
    of_sensors = np.array([
        [names.index(name) if name in names else -1 for name in (sensor.delay_name, sensor.jitter_name)]
        for sensor in loop.sensors
    ]).reshape(-1, 2)  # fmt: skip
    states = of_sensors[measured.sensors]
    present = np.any(states >= 0, axis=1)
    shape = (updates if present.any() else 0, most)
    before = np.append(np.inf, np.diff(loop.times))[loop.times_of(np.arange(updates))]
    tables = DelayTables(present, states, np.zeros((*shape, 9)), np.zeros(shape), np.zeros((shape[0], 3)), 1.0 / before)
    for number in np.flatnonzero(np.any(of_sensors >= 0, axis=1)):
        sensor, here = loop.sensors[number], np.flatnonzero(measured.sensors == number)
        if not len(here):
            continue
        around = Surroundings.at(
            loop.truth, loop.platform, float(loop.times[0]), measured.times[here], sensor.lever_arm, sensor.arrangement
        )
        tables.force[here] = np.einsum("nij,nj->ni", around.instruments, around.force)
        for column, component in enumerate(sensor.components):
            quantity = QUANTITIES[component.quantity]
            motion = motion_along_truth(around, quantity, reference_of(sensor.kind, quantity.name))
            tables.motion[here, column] = motion
            tables.along[here, column] = np.einsum("ni,ni->n", measured.rows[here, column], motion)
    return tables


def late_errors(loop: ClosedLoop, delays: Array) -> Array:
    """Compute h(t - d) - h(t) of all measurements, shape (n, U, M), with delays d, shape (n, U), s; zero without."""
    errors, measured = np.zeros((*delays.shape, loop.measurements.components.shape[1])), loop.measurements
    # of a budget's or a derivative's samples hardly any has a delay
    samples = np.flatnonzero(delays.any(axis=1))
    if not len(samples):
        return errors
    of_late, delays = np.zeros((len(samples), *errors.shape[1:])), delays[samples]
    together = max(1, AT_ONCE // len(samples))
    for number, sensor in enumerate(loop.sensors):
        updates = np.flatnonzero((measured.sensors == number) & delays.any(axis=0))
        for begin in range(0, len(updates), together):
            chosen = updates[begin : begin + together]
            late = _LateTruth.of(loop, chosen, delays[:, chosen])
            for reference, of_instruments, columns in _measured_alike(sensor):
                deviations = late.deviations(reference, of_instruments, sensor.lever_arm)
                _measure(places_of(measured), chosen, columns, _tables(loop), deviations, _rooms(), of_late)
    errors[samples] = np.where(delays[:, :, None] == 0.0, 0.0, of_late)
    return errors


def _measured_alike(sensor: Sensor) -> Iterator[tuple[Reference, bool, IndexArray]]:
    """Yield what components are measured against, whether along the instruments' axes, and which these are."""
    kinds = [
        (reference_of(sensor.kind, component.quantity), QUANTITIES[component.quantity].of_instruments)
        for component in sensor.components
    ]
    for reference, of_instruments in dict.fromkeys(kinds):
        yield reference, of_instruments, np.flatnonzero([kind == (reference, of_instruments) for kind in kinds])


def _tables(loop: ClosedLoop) -> MeasurementTables:
    measured = loop.measurements
    return MeasurementTables(
        measured.directions, measured.parameters, measured.places, measured.levers, measured.swinging,
        loop.truth.earth.constants,
    )  # fmt: skip


class _Deviations(NamedTuple):
    """Deviations of the truth at t - d from that at t, of n samples at r updates, in the inertial axes.

    Attributes
    ----------
    turn : ndarray, shape (n, r, 4)
        Quaternion, scalar first.
    velocity, position, swing : ndarray, shape (n, r, 3)
        As `NavigatorErrors` has them; the velocity is that over the earth.
    """

    turn: Array
    velocity: Array
    position: Array
    swing: Array


@dataclass(frozen=True)
class _LateTruth:
    """The truth of n samples at t - d, and that at the time stamps t of r updates, in inertial axes.

    Attributes
    ----------
    stamped, late : TruthStates
        Of the body: arrays begin with (r,) and (n, r).
    """

    loop: ClosedLoop
    stamped: TruthStates
    late: TruthStates

    @classmethod
    def of(cls, loop: ClosedLoop, updates: IndexArray, delays: Array) -> _LateTruth:
        """Evaluate it at updates, with delays, shape (n, r), s."""
        stamps = loop.measurements.times[updates]
        return cls(loop, _states(loop, stamps, "strapdown"), _states(loop, stamps - delays, "strapdown"))

    def deviations(self, reference: Reference, of_instruments: bool, lever_arm: Array) -> _Deviations:
        """Compute the deviations as they are seen against a reference."""
        from scipy.spatial.transform import Rotation

        earth, stamped, late = self.loop.truth.earth, self.stamped, self.late
        back = earth.turned(stamped.time - late.time)  # of the earth, from t - d to t
        seen = self._turned(reference) @ back
        axes, late_axes = stamped.axes, late.axes
        if of_instruments and self.loop.platform != "strapdown":
            axes, late_axes = (_states(self.loop, each.time, self.loop.platform).axes for each in (stamped, late))
        turn = Rotation.from_matrix((seen @ late_axes @ np.swapaxes(axes, -1, -2)).reshape(-1, 3, 3))
        (velocity, turning), (late_velocity, late_turning) = (_over_earth(each, earth) for each in (stamped, late))
        swing = np.cross(late_turning - turning, lever_arm)
        return _Deviations(
            np.roll(turn.as_quat(), 1, axis=1).reshape(*late.time.shape, 4),
            np.einsum("nrij,nrj->nri", seen, late_velocity) - velocity,
            np.einsum("nrij,nrj->nri", back, late.position) - stamped.position,
            np.einsum("rij,nrj->nri", stamped.axes, swing),
        )

    def _turned(self, reference: Reference) -> Array:
        """Return the turn of a reference over the earth from t - d to t, shape (n, r, 3, 3) or (3, 3)."""
        truth, stamps, times = self.loop.truth, self.stamped.time, self.late.time
        if reference == "earth":
            return np.eye(3)
        to_inertial = truth.earth.turned(stamps - truth.times[0])
        if reference == "stars":
            return np.asarray(truth.earth.turned(times - stamps))
        level, late_level = (
            local_axes(*truth.geodetic(each.ravel()).T[:2]).reshape(*each.shape, 3, 3) for each in (stamps, times)
        )
        return np.asarray((to_inertial @ level) @ np.swapaxes(to_inertial @ late_level, -1, -2))


def _states(loop: ClosedLoop, times: Array, platform: Platform) -> TruthStates:
    """Return the truth at times of any shape."""
    states = loop.truth.states(times.ravel(), platform, float(loop.times[0]))
    return TruthStates(
        *(
            getattr(states, part.name).reshape(*times.shape, *getattr(states, part.name).shape[1:])
            for part in fields(states)
        )
    )


def _over_earth(states: TruthStates, earth: Earth) -> tuple[Array, Array]:
    """Return the velocity over the earth, and the body's rate over it in its own axes."""
    spin = np.array([0.0, 0.0, earth.rotation_rate])
    return states.velocity - np.cross(spin, states.position), states.rate - states.axes[..., 2, :] * earth.rotation_rate


class _Rooms(NamedTuple):
    """Room for LANES samples at an update; the last axis is the lanes."""

    turn: Array
    turned: Array
    moved: Array
    rotation: Array
    swing: Array
    offset: Array
    rows: Array


def _rooms() -> _Rooms:
    return _Rooms(room(4), room(9), room(6), room(3), room(3), room(3), room(0, 9))


@allocation_free_part
def _innovate(innovation: int, u: int, c: int, tables: MeasurementTables, lanes: _Rooms) -> None:
    """Compute what component c of update u measures late, and leave it in the room of the first row."""
    x, y, z = load(lanes.moved, 3), load(lanes.moved, 4), load(lanes.moved, 5)
    vx, vy, vz = load(lanes.moved, 0), load(lanes.moved, 1), load(lanes.moved, 2)
    errors = NavigatorErrors(
        x, y, z, vx, vy, vz, lanes.turn, lanes.turned, lanes.rotation, lanes.swing, lanes.swing, lanes.offset,
        lanes.offset,
    )  # fmt: skip
    store(lanes.turn, 0, INNOVATION(innovation, 0.0 * x, u, c, tables, errors, lanes.rows, False))


@allocation_free_loop
def _measure(
    innovations: IndexArray, updates: IndexArray, columns: IndexArray, tables: MeasurementTables, late: _Deviations,
    lanes: _Rooms, out: Array,
) -> None:  # fmt: skip
    """Measure components of updates by late samples, LANES at a time: errors, shape (n, U, M)."""
    count = len(late.turn)
    for begin in range(0, count, LANES):
        size = min(LANES, count - begin)
        for r in range(len(updates)):
            u = updates[r]
            for c in columns:
                for i in range(LANES):
                    n = begin + min(i, size - 1)
                    for j in range(4):
                        lanes.turn[j, i] = late.turn[n, r, j]
                    for j in range(3):
                        lanes.moved[j, i] = late.velocity[n, r, j]
                        lanes.moved[3 + j, i] = late.position[n, r, j]
                        lanes.swing[j, i] = late.swing[n, r, j]
                turn_less_one(lanes.turn, lanes.turned)
                _innovate(innovations[u, c], u, c, tables, lanes)
                for i in range(size):
                    out[begin + i, u, c] = lanes.turn[0, i]
