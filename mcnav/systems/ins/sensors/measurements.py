"""Measurements of aiding sensors along the truth: their geometry, and the responses of innovations to errors.

The innovation of a component is what the navigator predicts less what is measured. Files of this folder have the
geometry of each quantity (`mcnav.systems.ins.sensors.registry`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array, IndexArray
from mcnav.systems.faults import fault_errors
from mcnav.systems.ins.imu.instruments import GYRO
from mcnav.systems.ins.sensors.aiding import Sensor, aiding_constants
from mcnav.systems.ins.sensors.delay import change_along_truth, reference_of
from mcnav.systems.ins.sensors.flexure import Flexure
from mcnav.systems.ins.sensors.quantity import OFFSETS, Geometry
from mcnav.systems.ins.sensors.registry import KINDS, QUANTITIES
from mcnav.systems.ins.sensors.surroundings import Surroundings
from mcnav.systems.ins.truth.trajectory import Platform, Truth


def rate_error(name: str) -> int:
    """Return the number in `GYRO` of the constant error as which an error enters a navigator's rate, -1 for none.

    >>> rate_error("gyro_rate_random_walk_y"), rate_error("gyro_angle_random_walk_y")
    (1, -1)
    """
    for process in ("_bias_instability_", "_rate_random_walk_"):
        name = name.replace(process, "_bias_")
    return GYRO.index(name) if name in GYRO else -1


@dataclass(frozen=True)
class Measurements:
    """All updates in order, U of them; each has at most M components. G components are those of all sensors.

    Attributes
    ----------
    times : ndarray, shape (U,)
    sensors : ndarray of int, shape (U,)
        Number of the sensor.
    sizes : ndarray of int, shape (U,)
        Components of the update.
    components : ndarray of int, shape (U, M)
        Number of each component among those of all sensors.
    kinds : ndarray of int, shape (U, M)
        As `KINDS` has them.
    directions : ndarray, shape (U, M, 3)
        The direction d of each component.
    parameters : ndarray, shape (U, M, P)
        What else the innovation of each component needs, as its `Geometry` has it; P is what the longest takes.
    constants : ndarray, shape (U, M, A)
        Responses of the innovations to the constant errors of `aiding_constants`.
    places : ndarray, shape (U, 3)
        True positions.
    rows : ndarray, shape (U, M, 9)
        Responses of the innovations to psi, v, x along the truth.
    levers : ndarray, shape (U, 3)
        The lever arm L of updates that need the rate of the body, zero for others.
    swung : ndarray of bool, shape (U, M)
        The components of these updates that need it.
    rates : ndarray, shape (U, 3, G)
        Responses of the navigator's rate there to the constant errors of the gyros, in the order of `GYRO`. G is 0
        where no update needs the rate.
    swings : ndarray, shape (U, M, G)
        Responses of the innovations to them.
    faults : ndarray, shape (U, M)
        What faults add to the measurements.
    changes : ndarray, shape (U, M)
        How fast what is measured changes (`mcnav.systems.ins.sensors.delay`): responses of the innovations to a delay
        of the update's sensor; zero for one that cannot be late.
    flexure : ndarray, shape (U, M, 6)
        Responses of the measured values to the flexure of the update's sensor: to angles about the body's axes and to
        their rates. The last axis is empty where no sensor flexes.
    """

    times: Array
    sensors: IndexArray
    sizes: IndexArray
    components: IndexArray
    kinds: IndexArray
    directions: Array
    parameters: Array
    constants: Array
    places: Array
    rows: Array
    levers: Array
    swung: NDArray[np.bool_]
    rates: Array
    swings: Array
    faults: Array
    changes: Array
    flexure: Array

    @property
    def swinging(self) -> NDArray[np.bool_]:
        """Updates that need the rate of the body, as an antenna's velocity on a lever arm does, shape (U,)."""
        return np.asarray(self.levers.any(axis=1), dtype=np.bool_)


def swings(sensor: Sensor) -> bool:
    """Return whether a sensor needs the rate of the body, as that of an antenna's velocity on a lever arm does."""
    needing = any(QUANTITIES[component.quantity].swings for component in sensor.components)
    return needing and bool(sensor.lever_arm.any())


def measure(truth: Truth, platform: Platform, start: float, sensors: Sequence[Sensor]) -> Measurements:
    """Tabulate the measurements of sensors: in order of time, and of the sensors at one instant."""
    names = {name: number for number, name in enumerate(aiding_constants(tuple(sensors)))}
    located = [
        (sensor, Surroundings.at(truth, platform, start, sensor.times, sensor.lever_arm, sensor.arrangement))
        if len(sensor.times)
        else None
        for sensor in sensors
    ]
    along = [() if each is None else _geometries(*each) for each in located]
    tables = _no_measurements(sensors, along, len(names))
    offset = 0
    for number, sensor in enumerate(sensors):
        of_sensor = located[number]
        if of_sensor is not None:
            rows = np.flatnonzero(tables.sensors == number)
            tables.places[rows] = of_sensor[1].position
            count = len(sensor.components)
            tables.faults[rows, :count] = fault_errors(sensor.faults, sensor.times, count)
            if swings(sensor):
                _fill_rates(tables, rows, of_sensor[1])
            for column, geometry in enumerate(along[number]):
                tables.components[rows, column] = offset + column
                if sensor.has_delay:
                    tables.changes[rows, column] = _change(sensor, column, of_sensor[1], geometry)
                    tables.constants[rows, column, names[sensor.delay_name]] = tables.changes[rows, column]
                _fill_component(tables, (rows, column), sensor, geometry, names)
        offset += len(sensor.components)
    order = np.lexsort((tables.sensors, tables.times))
    return Measurements(*(getattr(tables, each.name)[order] for each in fields(tables)))


def flexure_rows(measured: Measurements, number: int, flexure: Flexure, axis: int, start: float) -> Array:
    """Return the responses of innovations to the two states s of a sensor's flexure about an axis, shape (U, M, 2).

    Parameters
    ----------
    number : int
        Of the sensor.
    start : float
        Of navigation, s.
    """
    of_sensor = measured.flexure[:, :, [axis, 3 + axis]] * (measured.sensors == number)[:, None, None]
    return np.asarray(-of_sensor @ flexure.natural(measured.times - start))


def jitter_rows(measured: Measurements, number: int) -> Array:
    """Return the responses of innovations to the jitter of a sensor, by its number, shape (U, M)."""
    return np.asarray(measured.changes * (measured.sensors == number)[:, None])


def white_sigmas(sensors: Sequence[Sensor], measured: Measurements) -> Array:
    """Return the sigmas of the white noise of all updates, shape (U, M)."""
    components = [component for sensor in sensors for component in sensor.components]
    sigmas = np.array([component.noise for component in components])[measured.components]
    for number, sensor in enumerate(sensors):
        rows = np.flatnonzero(measured.sensors == number)
        for column, component in enumerate(sensor.components):
            if component.noise_at is not None:
                sigmas[rows, column] = component.noise_at
    return sigmas


def _geometries(sensor: Sensor, around: Surroundings) -> tuple[Geometry, ...]:
    """Return the geometry of each component of a sensor."""
    return tuple(QUANTITIES[each.quantity].geometry(around, each.axis) for each in sensor.components)


def _change(sensor: Sensor, column: int, around: Surroundings, geometry: Geometry) -> Array:
    """Return how fast what a component measures changes, shape (u,)."""
    quantity = sensor.components[column].quantity
    return change_along_truth(around, geometry, QUANTITIES[quantity], reference_of(sensor.kind, quantity))


def _no_measurements(sensors: Sequence[Sensor], along: Sequence[Sequence[Geometry]], constants: int) -> Measurements:
    """Return tables of zeros for all updates, sensor by sensor."""
    times = np.concatenate([np.zeros(0), *(sensor.times for sensor in sensors)])
    numbers = np.repeat(np.arange(len(sensors)), [len(sensor.times) for sensor in sensors])
    sizes = np.array([len(sensor.components) for sensor in sensors], dtype=np.int64)[numbers]
    total, most = len(times), max((len(sensor.components) for sensor in sensors), default=0)
    used = [each.parameters.shape[1] for geometries in along for each in geometries if each.parameters is not None]
    gyros = len(GYRO) if any(swings(sensor) for sensor in sensors) else 0
    return Measurements(
        times, numbers, sizes, np.zeros((total, most), dtype=np.int64), np.zeros((total, most), dtype=np.int64),
        np.zeros((total, most, 3)), np.zeros((total, most, max(used, default=0))), np.zeros((total, most, constants)),
        np.zeros((total, 3)), np.zeros((total, most, 9)), np.zeros((total, 3)),
        np.zeros((total, most), dtype=np.bool_), np.zeros((total, 3, gyros)), np.zeros((total, most, gyros)),
        np.zeros((total, most)), np.zeros((total, most)),
        np.zeros((total, most, 6 if any(each.flexure for each in sensors) else 0)),
    )  # fmt: skip


def _fill_rates(tables: Measurements, rows: IndexArray, around: Surroundings) -> None:
    """Fill in the lever arms of a sensor's updates, and the responses of the rate of the body."""
    tables.levers[rows], tables.rates[rows] = around.lever, around.rate_responses()


def _fill_component(
    tables: Measurements, place: tuple[IndexArray, int], sensor: Sensor, geometry: Geometry, names: Mapping[str, int]
) -> None:
    """Fill in one component of a sensor's updates: their rows, and its column."""
    rows, column = place
    component = sensor.components[column]
    quantity = QUANTITIES[component.quantity]
    tables.kinds[place] = KINDS[quantity.name]
    tables.directions[place], tables.rows[place] = geometry.direction, geometry.row
    if geometry.parameters is not None:
        tables.parameters[rows, column, : geometry.parameters.shape[1]] = geometry.parameters
    tables.constants[rows, column, names[component.error_name("bias")]] = -1.0
    if quantity.scaled:
        if geometry.true is None:
            raise ValueError(f"geometry of {quantity.name} lacks the true value, which a scale factor needs")
        tables.constants[rows, column, names[component.error_name("scale_factor")]] = -geometry.true
    if sensor.has_lever_arm and geometry.lever_arm is not None:
        first = names[f"{sensor.name}_lever_arm_x"]
        tables.constants[rows, column, first : first + 3] = geometry.lever_arm
    for offset, responses in geometry.offsets.items():
        if offset in sensor.offsets:
            first = names[f"{sensor.name}_{offset}_{OFFSETS[offset][0][0]}"]
            tables.constants[rows, column, first : first + 3] = responses
    if sensor.flexure is not None:
        if geometry.flexure is None:
            raise ValueError(f"geometry of {quantity.name} lacks the responses to a flexure, which {sensor.name} has")
        tables.flexure[place] = geometry.flexure
    if quantity.swings and swings(sensor):
        # d . (e x L) = (L x d) . e
        moment = np.cross(tables.levers[rows], geometry.direction)
        tables.swung[place] = True
        tables.swings[place] = np.einsum("ni,nij->nj", moment, tables.rates[rows])
