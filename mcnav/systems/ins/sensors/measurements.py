"""Measurements of aiding sensors along the truth: their geometry, and the responses of innovations to errors.

The innovation of a component is what the navigator predicts less what is measured. Files of this folder have the
geometry of each quantity (`mcnav.systems.ins.sensors.registry`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Final

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
    numbers : ndarray of int, shape (U,)
        Number of the update among those of its sensor.
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
    numbers: IndexArray
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

    def between(self, first: int, last: int) -> Measurements:
        """Return the updates from the first to before the last, in the same memory."""
        return Measurements(*(getattr(self, each.name)[first:last] for each in fields(self)))

    @classmethod
    def join(cls, blocks: Sequence[Measurements]) -> Measurements:
        """Return the updates of blocks that follow one another."""
        return cls(*(np.concatenate([getattr(block, each.name) for block in blocks]) for each in fields(cls)))

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
    return Schedule.of(truth, platform, start, sensors).whole


LEAST: Final = 8_192
"""Updates up to which all tables are kept."""

BLOCK: Final = 1_024
"""Updates of a block where there are more."""

LATEST: Final = 2
"""Blocks that are kept."""


@dataclass(frozen=True, eq=False)
class Schedule:
    """Updates of sensors in order of time, and of the sensors at one instant; their tables are computed in blocks.

    Attributes
    ----------
    times : ndarray, shape (U,)
    order : ndarray of int, shape (U,)
        Number of the sensor.
    sizes : ndarray of int, shape (U,)
        Components of each.
    """

    truth: Truth
    platform: Platform
    start: float
    sensors: tuple[Sensor, ...]
    times: Array
    order: IndexArray
    sizes: IndexArray
    _latest: list[tuple[int, Measurements]] = field(default_factory=list, repr=False)

    @classmethod
    def of(cls, truth: Truth, platform: Platform, start: float, sensors: Sequence[Sensor]) -> Schedule:
        """Order the measurements of sensors."""
        times = np.concatenate([np.zeros(0), *(sensor.times for sensor in sensors)])
        numbers = np.repeat(np.arange(len(sensors)), [len(sensor.times) for sensor in sensors])
        order = np.lexsort((numbers, times))
        sizes = np.array([len(sensor.components) for sensor in sensors], dtype=np.int64)
        return cls(truth, platform, start, tuple(sensors), times[order], numbers[order], sizes[numbers[order]])

    @cached_property
    def whole(self) -> Measurements:
        """Tables of all updates."""
        return self._measure(0, len(self.times))

    @property
    def most(self) -> int:
        """Most components of an update."""
        return max((len(sensor.components) for sensor in self.sensors), default=0)

    def between(self, first: int, last: int) -> Measurements:
        """Return the tables of the updates from the first to before the last."""
        count = len(self.times)
        if count <= LEAST:
            return self.whole.between(first, last)
        blocks = [
            self._block(number).between(max(first - number * BLOCK, 0), min(last - number * BLOCK, BLOCK))
            for number in range(min(first, count - 1) // BLOCK, max(last - 1, first) // BLOCK + 1)
        ]
        return blocks[0] if len(blocks) == 1 else Measurements.join(blocks)

    def _block(self, number: int) -> Measurements:
        latest = list(self._latest)
        for known, measured in latest:
            if known == number:
                return measured
        measured = self._measure(number * BLOCK, min((number + 1) * BLOCK, len(self.times)))
        self._latest[:] = [*latest, (number, measured)][-LATEST:]
        return measured

    @cached_property
    def _faults(self) -> dict[int, Array]:
        """Errors by faults in the measurements of each faulty sensor, by its number; a spike is in the next one."""
        return {
            number: fault_errors(sensor.faults, sensor.times, len(sensor.components))
            for number, sensor in enumerate(self.sensors)
            if sensor.faults
        }

    @cached_property
    def _numbers(self) -> IndexArray:
        """Number of each update among those of its sensor, shape (U,)."""
        numbers = np.empty(len(self.order), dtype=np.int64)
        for number, sensor in enumerate(self.sensors):
            numbers[self.order == number] = np.arange(len(sensor.times))
        return numbers

    @cached_property
    def _parameters(self) -> int:
        """Number of parameters of the geometry that has most of them."""
        along = [(each, self._around(each, each.times[:1])) for each in self.sensors if len(each.times)]
        known = [geometry.parameters for of_sensor in along for geometry in _geometries(*of_sensor)]
        return max((table.shape[1] for table in known if table is not None), default=0)

    def _around(self, sensor: Sensor, times: Array) -> Surroundings:
        return Surroundings.at(self.truth, self.platform, self.start, times, sensor.lever_arm, sensor.arrangement)

    def _measure(self, first: int, last: int) -> Measurements:
        sensors, order = self.sensors, self.order[first:last]
        names = {name: number for number, name in enumerate(aiding_constants(sensors))}
        tables = _no_measurements(sensors, last - first, len(names), self._parameters)
        tables.times[:], tables.sensors[:], tables.sizes[:] = self.times[first:last], order, self.sizes[first:last]
        tables.numbers[:] = self._numbers[first:last]
        offset = 0
        for number, sensor in enumerate(sensors):
            rows = np.flatnonzero(order == number)
            if len(rows):
                self._fill(tables, rows, number, offset, names)
            offset += len(sensor.components)
        return tables

    def _fill(self, tables: Measurements, rows: IndexArray, number: int, offset: int, names: Mapping[str, int]) -> None:
        """Fill in a sensor's updates: their rows, and the number of its first component."""
        sensor = self.sensors[number]
        around, count = self._around(sensor, tables.times[rows]), len(sensor.components)
        tables.places[rows] = around.position
        if number in self._faults:
            tables.faults[rows, :count] = self._faults[number][tables.numbers[rows]]
        if swings(sensor):
            _fill_rates(tables, rows, around)
        for column, geometry in enumerate(_geometries(sensor, around)):
            tables.components[rows, column] = offset + column
            if sensor.has_delay:
                tables.changes[rows, column] = _change(sensor, column, around, geometry)
                tables.constants[rows, column, names[sensor.delay_name]] = tables.changes[rows, column]
            _fill_component(tables, (rows, column), sensor, geometry, names)


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
                sigmas[rows, column] = np.asarray(component.noise_at)[measured.numbers[rows]]
    return sigmas


def _geometries(sensor: Sensor, around: Surroundings) -> tuple[Geometry, ...]:
    """Return the geometry of each component of a sensor."""
    return tuple(QUANTITIES[each.quantity].geometry(around, each.axis) for each in sensor.components)


def _change(sensor: Sensor, column: int, around: Surroundings, geometry: Geometry) -> Array:
    """Return how fast what a component measures changes, shape (u,)."""
    quantity = sensor.components[column].quantity
    return change_along_truth(around, geometry, QUANTITIES[quantity], reference_of(sensor.kind, quantity))


def _no_measurements(sensors: Sequence[Sensor], total: int, constants: int, parameters: int) -> Measurements:
    """Return tables of zeros for a number of updates."""
    most, whole = max((len(sensor.components) for sensor in sensors), default=0), np.int64
    gyros = len(GYRO) if any(swings(sensor) for sensor in sensors) else 0
    return Measurements(
        np.zeros(total), np.zeros(total, whole), np.zeros(total, whole), np.zeros(total, whole),
        np.zeros((total, most), whole), np.zeros((total, most), whole),
        np.zeros((total, most, 3)), np.zeros((total, most, parameters)), np.zeros((total, most, constants)),
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
