"""Timeline of an aided navigator: the closed loop of its true errors, the estimates it subtracts, and biases.

X is (y, e^, b): true deviations y = (psi, v, x), the filter's estimates e^ of other errors, which are subtracted in the
navigator (feedback), and the biases b of processes. Over a step and in an update (Gelb 1974, chapter 7; Maybeck 1979,
section 6.8)::

    y' = Phi y + (errors of the instruments) - C e^          e^' = D e^
    n = H y + (errors of the measurement) - H_e e^           y+ = y - K_y n          e^+ = e^ + K_e n

Its sources are the constant errors of instruments and sensors. Faults of sensors are deterministic. Processes of noise
are of size one, for the truth and for the filter: sizes are those of a timeline, so that one system has many tunings.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.rows import Rows
from mcnav.arrays.types import Array, IndexArray
from mcnav.contract.timeline import FilterSteps, Instants, Start, StepNoise, Steps, Timeline, TimelineFilter, Updates
from mcnav.systems.ins.filter.model import NAVIGATION, FilterModel
from mcnav.systems.ins.filter.tables import FilterTables, initial_covariance
from mcnav.systems.ins.imu.instruments import CONSTANTS, Imu, of_unit_sizes, process_variances
from mcnav.systems.ins.linear.covariance import biased_processes, output_map, process_systems
from mcnav.systems.ins.linear.inertial_steps import InertialSteps
from mcnav.systems.ins.linear.response_blocks import Responses
from mcnav.systems.ins.linear.sensor_processes import SensorProcess, sensor_processes, white_processes, white_variances
from mcnav.systems.ins.linear.sizes import states_of_sizes
from mcnav.systems.ins.sensors.aiding import Sensor, aiding_constants, aiding_processes
from mcnav.systems.ins.sensors.measurements import Measurements, Schedule, rate_error, white_sigmas
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
    responses: Responses
    schedule: Schedule
    filter: FilterTables
    first_updates: IndexArray

    @cached_property
    def timeline(self) -> Timeline:
        """The timeline; navigation may start at any time of its grid."""
        return self.tuned(self.imu, self.sensors, self.model)

    def tuned(self, imu: Imu, sensors: tuple[Sensor, ...], model: FilterModel) -> Timeline:
        """Return the timeline of errors and of a filter that differ from this system's in sizes alone."""
        timeline, beliefs, states = self._of_unit_sizes, model.beliefs, states_of_sizes(self.model.states, model.states)
        updates, filtered = timeline.updates, timeline.filter
        assert updates is not None
        assert filtered is not None
        if states is None:
            raise ValueError("model: got a filter that differs in more than sizes")
        start = float(self.responses.times[0])
        return replace(
            timeline, sizes=_sizes(imu, sensors, timeline.processes),
            updates=replace(updates, variances=self._white_variances(sensors)),
            filter=replace(
                filtered, covariance=initial_covariance(self.truth, beliefs.covariance, states, start, 0.0),
                variances=self._rows((), partial(_believed_variances, beliefs.sensors)),
                sizes=_sizes(beliefs.imu, beliefs.sensors, self._believed_processes),
            ),
        )  # fmt: skip

    @cached_property
    def _of_unit_sizes(self) -> Timeline:
        places, count = np.arange(len(self.responses.times)), len(self.schedule.times)
        before, after = self.first_updates[:-1] + places, self.first_updates[1:] + places
        is_update = np.ones(count + len(places) - 1, dtype=np.bool_)
        is_update[after[:-1]] = False
        return Timeline(
            self._begin(0), is_update, self._steps, Instants(self.responses.times, before, after), self._readout,
            (*self._inertial.variances, *aiding_processes(self.sensors)), self._biases, self._updates, self._filter,
            self._begin,
        )  # fmt: skip

    @property
    def _others(self) -> int:
        return len(self.filter.constants)

    @cached_property
    def _processes(self) -> dict[str, SensorProcess]:
        return sensor_processes(self.sensors, float(self.responses.times[0]))

    @cached_property
    def _inertial(self) -> InertialSteps:
        added = sum(process.biases for process in self._processes.values())
        sources = len(CONSTANTS) + len(aiding_constants(self.sensors))
        return InertialSteps.of(self.responses, self.imu, sources, NAVIGATION + self._others, added)

    @cached_property
    def _biases(self) -> dict[str, IndexArray]:
        biases = dict(self._inertial.biases)
        first = NAVIGATION + self._others + sum(map(len, biases.values()))
        for name, process in self._processes.items():
            count = process.biases
            biases[name] = np.arange(first, first + count)
            first += count
        return biases

    def _begin(self, position: int) -> Start:
        """Return the start of a navigator that has all measurements from a position on."""
        inertial, started, number = self._inertial, dict(self._inertial.started), self._number_of_time(position)
        start = float(self.responses.times[number])
        since, model = start - float(self.responses.times[0]), self.model
        partials = np.zeros((inertial.states, inertial.sources + 1))
        partials[:NAVIGATION, :NAVIGATION] = np.linalg.inv(output_map(self.truth, start))
        for name, process in self._processes.items():
            started[name] = np.zeros((inertial.states,) * 2)
            started[name][np.ix_(self._biases[name], self._biases[name])] = process.started(since)
        own = initial_covariance(self.truth, model.beliefs.covariance, model.states, start, since)
        return Start(partials, started, filter_covariance=own if number else None)

    def _readout(self, _: int, time: float) -> Array:
        return np.pad(output_map(self.truth, time), ((0, 0), (0, self._inertial.states - NAVIGATION)))

    def _steps(self, first: int, last: int) -> Steps:
        steps, estimates = self._inertial.between(first, last), NAVIGATION + np.arange(self._others)
        over, noise = steps.transitions, dict(steps.noise)
        of_filter, decay = self.filter.between(first, last)
        over[:, :NAVIGATION, estimates] = -of_filter[:, :, NAVIGATION:]
        over[:, estimates, estimates] = decay
        times = self.responses.times[first : last + 1] - self.responses.times[0]
        for name, process in self._processes.items():
            rows = self._biases[name]
            over[:, rows, rows], added = process.over(times)
            noise[name] = StepNoise(rows, added)
        return Steps(over, steps.inputs, noise)

    def _rows(self, width: tuple[int, ...], compute: Callable[[Measurements], Array]) -> Rows:
        """Return a table of the updates by component, shape (U, M, ...), from what computes it of measurements."""
        shape = (len(self.schedule.times), self.schedule.most, *width)
        return Rows(shape, partial(_computed, self.schedule, compute))

    def _white_variances(self, sensors: tuple[Sensor, ...]) -> dict[str, Rows]:
        numbers = white_processes(sensors, self.schedule)
        return {name: self._rows((), partial(white_variances, sensors, number)) for name, number in numbers.items()}

    @cached_property
    def _updates(self) -> Updates:
        inertial = self._inertial
        responses = self._rows((inertial.states,), self._responses_of)
        return Updates(self.schedule.sizes, responses, self._rows((inertial.sources + 1,), self._disturbances_of))

    def _responses_of(self, measured: Measurements) -> Array:
        inertial = self._inertial
        responses = np.zeros((*measured.components.shape, inertial.states))
        responses[:, :, : NAVIGATION + self._others] = np.concatenate(
            [measured.rows, -self.filter.rows_of(measured)], axis=2
        )
        for name, rows in inertial.biases.items():
            if measured.swings.size and rate_error(name) >= 0:
                responses[:, :, rows] = measured.swings[:, :, [rate_error(name)]]
        for name, process in self._processes.items():
            responses[:, :, self._biases[name]] = process.seen(measured)
        return np.asarray(responses * _within(measured))

    def _disturbances_of(self, measured: Measurements) -> Array:
        disturbances = np.zeros((*measured.components.shape, self._inertial.sources + 1))
        disturbances[:, :, NAVIGATION : NAVIGATION + measured.swings.shape[2]] = measured.swings
        disturbances[:, :, len(CONSTANTS) : -1] = measured.constants
        disturbances[:, :, -1] = -measured.faults
        return np.asarray(disturbances * _within(measured))

    @property
    def _filter(self) -> TimelineFilter:
        tables, size = self.filter, NAVIGATION + self._others
        place = np.zeros((self._inertial.states, size))
        place[:size] = np.diag(np.repeat([1.0, -1.0], [NAVIGATION, self._others]))
        return TimelineFilter(
            self._filter_steps, self._rows((size,), self._own_responses_of), self._rows((), tables.variances_of),
            tables.initial, tables.corrected, place, self._true_errors,
        )  # fmt: skip

    def _own_responses_of(self, measured: Measurements) -> Array:
        return np.concatenate([measured.rows, self.filter.rows_of(measured)], axis=2)

    def _filter_steps(self, first: int, last: int) -> FilterSteps:
        systems = process_systems(self.filter.believed.between(first, last), of_unit_sizes(self.model.beliefs.imu))
        states = NAVIGATION + np.arange(self._others)
        over = np.zeros((last - first, NAVIGATION + self._others, NAVIGATION + self._others))
        over[:, :NAVIGATION], over[:, states, states] = self.filter.between(first, last, systems)
        return FilterSteps(over, self._believed_noise(first, last, systems))

    @cached_property
    def _believed_processes(self) -> tuple[str, ...]:
        """Names of the processes of the filter's noise: white ones, and biases that are states."""
        beliefs, modelled = self.model.beliefs, {name for names in self.filter.processes for name in names}
        biased = biased_processes(self.filter.believed.between(0, 1), beliefs.imu)
        white = set(process_variances(beliefs.imu)) - set(biased)
        return tuple(sorted(white | modelled))

    def _believed_noise(
        self, first: int, last: int, systems: Mapping[str, tuple[Array, Array, Array]]
    ) -> dict[str, StepNoise]:
        """Return what the filter's processes, of size one, add in some steps to psi, v, x and to its other states."""
        noise, times = dict[str, StepNoise](), self.responses.times
        place_of = {name: place for place, names in enumerate(self.filter.processes, NAVIGATION) for name in names[:1]}
        for name, (_, added, _) in systems.items():
            if name in self._believed_processes:
                rows = np.arange(NAVIGATION + 1)
                used = np.asarray(np.diagonal(added, axis1=1, axis2=2).any(axis=0))
                rows[NAVIGATION] = place_of.get(name, NAVIGATION)
                used[NAVIGATION] &= name in place_of
                noise[name] = StepNoise(rows[used], added[:, used][:, :, used])
        for place, (state, names) in enumerate(zip(self.model.states, self.filter.processes, strict=True), NAVIGATION):
            if state.flexure is not None and not state.flexure.rate:
                added = state.flexure.flexure.noise(times[first : last + 1] - times[0])
                noise[names[0]] = StepNoise(np.array([place, place + 1]), added)
            elif names and names[0] not in noise and state.flexure is None and np.isfinite(state.correlation_time):
                added = -np.expm1(-2.0 * np.diff(times[first : last + 1]) / state.correlation_time)
                noise[names[0]] = StepNoise(np.array([place]), added[:, None, None])
        return noise

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


def _within(measured: Measurements) -> NDArray[np.bool_]:
    """Return which components an update has, shape (u, M, 1)."""
    return (np.arange(measured.components.shape[1]) < measured.sizes[:, None])[:, :, None]


def _believed_variances(sensors: tuple[Sensor, ...], measured: Measurements) -> Array:
    return np.asarray(white_sigmas(sensors, measured) ** 2)


def _sizes(imu: Imu, sensors: tuple[Sensor, ...], names: Collection[str]) -> dict[str, float]:
    """Return the variances of processes by name, zero of those that are absent."""
    sizes = process_variances(imu) | {name: size**2 for name, size in aiding_processes(sensors).items()}
    return {name: sizes.get(name, 0.0) for name in names}


def _computed(schedule: Schedule, compute: Callable[[Measurements], Array], first: int, last: int) -> Array:
    """Compute a table of some updates; a function that travels to workers."""
    return compute(schedule.between(first, last))
