"""Timeline of an aided navigator: the closed loop of its true errors, the estimates it subtracts, and biases.

X is (y, e^, b): true deviations y = (psi, v, x), the filter's estimates e^ of other errors, which are subtracted in the
navigator (feedback), and the biases b of processes. Over a step and in an update (Gelb 1974, chapter 7; Maybeck 1979,
section 6.8)::

    y' = Phi y + (errors of the instruments) - C e^          e^' = D e^
    n = H y + (errors of the measurement) - H_e e^           y+ = y - K_y n          e^+ = e^ + K_e n

Its sources are the constant errors of instruments and sensors. Faults of sensors are deterministic.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mcnav._types import Array, IndexArray
from mcnav.contract.timeline import FilterSteps, Instants, Start, StepNoise, Steps, Timeline, TimelineFilter, Updates
from mcnav.systems.ins.filter.model import NAVIGATION, FilterModel
from mcnav.systems.ins.filter.tables import FilterTables, initial_covariance
from mcnav.systems.ins.imu.instruments import CONSTANTS, Imu
from mcnav.systems.ins.linear.covariance import output_map, transitions
from mcnav.systems.ins.linear.inertial_steps import InertialSteps
from mcnav.systems.ins.linear.response import StepResponses, responses_between
from mcnav.systems.ins.linear.sensor_processes import SensorProcess, sensor_processes
from mcnav.systems.ins.sensors.aiding import Sensor, aiding_constants
from mcnav.systems.ins.sensors.measurements import Measurements, rate_error
from mcnav.systems.ins.truth.trajectory import Truth


@dataclass(frozen=True)
class AidedSystem:
    """What the timeline of an aided navigator consists of, on a grid of K steps with U updates.

    Attributes
    ----------
    first_updates : ndarray of int, shape (K + 2,)
        Number of the first update at each time.
    """

    truth: Truth
    imu: Imu
    sensors: tuple[Sensor, ...]
    model: FilterModel
    responses: StepResponses
    measurements: Measurements
    filter: FilterTables
    first_updates: IndexArray

    @property
    def timeline(self) -> Timeline:
        """The timeline; navigation may start at any time of its grid."""
        places, count = np.arange(len(self.responses.times)), len(self.measurements.times)
        before, after = self.first_updates[:-1] + places, self.first_updates[1:] + places
        is_update = np.ones(count + len(places) - 1, dtype=np.bool_)
        is_update[after[:-1]] = False
        return Timeline(
            self._begin(0), is_update, self._steps, Instants(self.responses.times, before, after), self._readout,
            (*self._inertial.variances, *self._processes), self._biases, self._updates, self._filter, self._begin,
        )  # fmt: skip

    @property
    def _others(self) -> int:
        return len(self.filter.constants)

    @cached_property
    def _processes(self) -> dict[str, SensorProcess]:
        return sensor_processes(self.sensors, self.measurements, self.responses.times)

    @cached_property
    def _inertial(self) -> InertialSteps:
        added = sum(process.decay.shape[1] for process in self._processes.values())
        sources = len(CONSTANTS) + len(aiding_constants(self.sensors))
        return InertialSteps.of(self.responses, self.imu, sources, NAVIGATION + self._others, added)

    @cached_property
    def _biases(self) -> dict[str, IndexArray]:
        biases = dict(self._inertial.biases)
        first = NAVIGATION + self._others + sum(map(len, biases.values()))
        for name, process in self._processes.items():
            if count := process.decay.shape[1]:
                biases[name] = np.arange(first, first + count)
                first += count
        return biases

    def _begin(self, position: int) -> Start:
        """Return the start of a navigator that has all measurements from a position on."""
        inertial, started, number = self._inertial, dict(self._inertial.started), self._number_of_time(position)
        start = float(self.responses.times[number])
        partials = np.zeros((inertial.states, inertial.sources + 1))
        partials[:NAVIGATION, :NAVIGATION] = np.linalg.inv(output_map(self.truth, start))
        for name, process in self._processes.items():
            if name in self._biases:
                started[name] = np.zeros((inertial.states,) * 2)
                started[name][np.ix_(self._biases[name], self._biases[name])] = process.started[number]
        own = initial_covariance(self.truth, self.model, start, start - float(self.responses.times[0]))
        return Start(partials, started, filter_covariance=own if number else None)

    def _readout(self, _: int, time: float) -> Array:
        return np.pad(output_map(self.truth, time), ((0, 0), (0, self._inertial.states - NAVIGATION)))

    def _steps(self, first: int, last: int) -> Steps:
        steps, estimates = self._inertial.between(first, last), NAVIGATION + np.arange(self._others)
        over, noise = steps.transitions, dict(steps.noise)
        over[:, :NAVIGATION, estimates] = -self.filter.coupling[first:last]
        over[:, estimates, estimates] = self.filter.decay[first:last]
        for name, process in self._processes.items():
            if name in self._biases:
                rows = self._biases[name]
                over[:, rows, rows] = process.decay[first:last]
                noise[name] = StepNoise(rows, process.noise[first:last])
        return Steps(over, steps.inputs, noise)

    @cached_property
    def _updates(self) -> Updates:
        measured, inertial = self.measurements, self._inertial
        within = (np.arange(measured.components.shape[1]) < measured.sizes[:, None])[:, :, None]
        responses = np.zeros((*measured.components.shape, inertial.states))
        responses[:, :, : NAVIGATION + self._others] = np.concatenate([measured.rows, -self.filter.rows], axis=2)
        for name, rows in inertial.biases.items():
            if measured.swings.size and rate_error(name) >= 0:
                responses[:, :, rows] = measured.swings[:, :, [rate_error(name)]]
        for name, process in self._processes.items():
            if name in self._biases:
                responses[:, :, self._biases[name]] = process.seen
        disturbances = np.zeros((*measured.components.shape, inertial.sources + 1))
        disturbances[:, :, NAVIGATION : NAVIGATION + measured.swings.shape[2]] = measured.swings
        disturbances[:, :, len(CONSTANTS) : -1] = measured.constants
        disturbances[:, :, -1] = -measured.faults
        variances = {name: process.measured for name, process in self._processes.items() if process.measured.any()}
        return Updates(measured.sizes, responses * within, disturbances * within, variances)

    @property
    def _filter(self) -> TimelineFilter:
        tables, size = self.filter, NAVIGATION + self._others
        place = np.zeros((self._inertial.states, size))
        place[:size] = np.diag(np.repeat([1.0, -1.0], [NAVIGATION, self._others]))
        return TimelineFilter(
            self._filter_steps, np.concatenate([self.measurements.rows, tables.rows], axis=2), tables.variances,
            tables.initial, tables.corrected, place, self._true_errors,
        )  # fmt: skip

    def _filter_steps(self, first: int, last: int) -> FilterSteps:
        tables, states = self.filter, NAVIGATION + np.arange(self._others)
        over = np.zeros((last - first, NAVIGATION + self._others, NAVIGATION + self._others))
        over[:, :NAVIGATION, :NAVIGATION] = transitions(responses_between(self.responses, first, last))
        over[:, :NAVIGATION, NAVIGATION:] = tables.coupling[first:last]
        over[:, states, states] = tables.decay[first:last]
        return FilterSteps(over, tables.noise[first:last])

    def _true_errors(self, position: int) -> tuple[Array, Array]:
        """Return W and E: true errors are y, and what the other states model less its estimates."""
        tables, inertial, size = self.filter, self._inertial, NAVIGATION + self._others
        of_state, of_constants = np.zeros((size, inertial.states)), np.zeros((size, inertial.sources + 1))
        of_state[:, :size] = np.diag(np.repeat([1.0, -1.0], [NAVIGATION, self._others]))
        flexures = {sensor.name: sensor.flexure for sensor in self.sensors}
        for place, (state, modelled) in enumerate(zip(self.model.states, tables.processes, strict=True), NAVIGATION):
            number, of = tables.constants[place - NAVIGATION], state.flexure
            if number >= 0:
                of_constants[place, number] = 1.0
            for name in modelled:
                if name not in self._biases:
                    continue
                if of is None:
                    of_state[place, self._biases[name][0]] = 1.0
                elif not of.rate and (flexure := flexures[of.sensor]) is not None:
                    # the filter's states s of the true angle and rate
                    times = self.responses.times
                    since = times[[self._number_of_time(position)]] - times[0]
                    true_states = np.linalg.solve(of.flexure.natural(since), flexure.natural(since))[0]
                    of_state[place : place + 2, self._biases[name]] = true_states
        return of_state, of_constants

    def _number_of_time(self, position: int) -> int:
        """Return the number of the time of a position."""
        before = self.first_updates[:-1] + np.arange(len(self.responses.times))
        return int(np.searchsorted(before, position, side="right")) - 1
