"""The filter of an aided navigation on a recorded flight, and the linear system of its innovations.

The navigator and its filter are those of the reference engine (`mcnav.systems.ins.reference.filtered_navigator`).
Beside them the error model with all errors of the campaign is carried along the indicated trajectory, from measurement
to measurement: what a `mcnav.contract.recorded.FilteredRecord` consists of.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final, TypeAlias

import numpy as np
from numpy.linalg import LinAlgError

from mcnav.arrays.products import map_covariances, transform
from mcnav.arrays.types import Array, IndexArray
from mcnav.contract.recorded import (
    FilteredRecord,
    Part,
    ReadOut,
    RecordedMeasurements,
    RecordedSensor,
    Recording,
    RecordingError,
    Stage,
)
from mcnav.systems.ins.earth import Earth, local_axes
from mcnav.systems.ins.filter.model import NAVIGATION, FilterModel
from mcnav.systems.ins.recorded.causes import Campaign, CauseTable, list_offsets, tabulate_causes
from mcnav.systems.ins.recorded.clocks import with_clock_rates
from mcnav.systems.ins.recorded.measurements import true_state
from mcnav.systems.ins.recorded.readings import gauss_readings
from mcnav.systems.ins.recorded.reference import ReferenceStates
from mcnav.systems.ins.reference.aided import LONGEST_FILTER_STEP, SHARE_OF_CORRELATION
from mcnav.systems.ins.reference.earth_fixed_errors import ErrorModel, FilterSteps
from mcnav.systems.ins.reference.earth_fixed_sensors import SensorModel
from mcnav.systems.ins.reference.filtered_navigator import FilteredNavigator, Passage
from mcnav.systems.ins.reference.mechanization import LONGEST_STEP, SAME_INSTANT, Diverged, divide, with_stops
from mcnav.systems.ins.reference.normal_field import field_constants
from mcnav.systems.ins.sensors.aiding import Component, Sensor
from mcnav.systems.ins.sensors.delay import WITHOUT_MEMORY

Motion: TypeAlias = tuple[Array | None, Array, Array, tuple[Part, ...]]
"""F, B, D and the noise of the processes, as a `Stage` has them."""

LEAST_MEASUREMENTS: Final = 10
"""Measurements below which a record says nothing."""


@dataclass(frozen=True)
class RecordedFlight:
    """A recorded flight of an aided strapdown navigator.

    Attributes
    ----------
    recording : Recording
    sensors : tuple of Sensor
        Those that have measurements, as the truth has them.
    model : FilterModel
        The filter, which believes the same sensors.
    campaign : Campaign
        True errors.
    state : ndarray, shape (10,)
        Indicated quaternion, velocity and position at the start.
    """

    earth: Earth
    recording: Recording
    sensors: tuple[Sensor, ...]
    model: FilterModel
    campaign: Campaign
    state: Array

    @cached_property
    def own(self) -> ErrorModel:
        """System of the filter's states."""
        return ErrorModel(self.model)

    @cached_property
    def measured(self) -> tuple[tuple[int, int, float], ...]:
        """Sensor, row and instant of all measurements within the readings, in order."""
        first, last = float(self.recording.ends[0]), float(self.recording.ends[-1])
        rows = [
            (number, row, float(time))
            for number, sensor in enumerate(self.sensors)
            for row, time in enumerate(self.recording.measurements[sensor.name].times)
            if first <= time <= last + SAME_INSTANT
        ]
        rows.sort(key=lambda each: (each[2], each[0]))
        return tuple(rows)

    @cached_property
    def stops(self) -> Array:
        """Instants of the measurements, s."""
        times = np.array([time for _, _, time in self.measured])
        return times[np.diff(times, prepend=-1.0) > SAME_INSTANT]

    @cached_property
    def step_times(self) -> Array:
        """Boundaries of the navigator's steps, s: ends of the readings' intervals, and measurements."""
        knots = with_stops(np.concatenate([[0.0], self.recording.ends]), self.stops)
        knots = knots[knots <= self.stops[-1] + SAME_INSTANT]
        return divide(knots, np.diff(knots) / (LONGEST_STEP * (1.0 + 1e-9)))

    @cached_property
    def sensor_models(self) -> tuple[tuple[SensorModel, SensorModel], ...]:
        """Sensors with the responses to the filter's states, and to all errors."""
        pairs = []
        believed = {sensor.name: sensor for sensor in self.model.beliefs.sensors}
        for sensor in self.sensors:
            recorded = replace(sensor, lever_arm=np.zeros(3))
            measured = self.recording.measurements[sensor.name]
            models = (
                SensorModel(recorded, _at_instants(believed[sensor.name], measured), None, model.states, self.earth)
                for model in (self.own, self.campaign.model)
            )
            pairs.append((next(models), next(models)))
        return tuple(pairs)

    def fly(self) -> FilteredRecord:
        """Take the filter through the record.

        Raises
        ------
        RecordingError
            When there are too few measurements, or the navigator or its filter breaks down.
        """
        if len(self.measured) < LEAST_MEASUREMENTS:
            span = f"the readings last from {self.recording.ends[0]:.6g} to {self.recording.ends[-1]:.6g} s"
            raise RecordingError(f"has {len(self.measured)} measurements in the time of the readings ({span})")
        try:
            with np.errstate(over="ignore", invalid="ignore"):  # what breaks down is told as such
                return _Passing(self).record()
        except LinAlgError:
            raise RecordingError("the filter's covariance lost its definiteness") from None
        except Diverged as failure:
            raise RecordingError(str(failure)) from None


class _Passing:
    """A filter on its way through a record."""

    def __init__(self, flight: RecordedFlight) -> None:
        self.flight, self.everything = flight, flight.campaign.model
        self.causes: CauseTable = tabulate_causes(flight.campaign)
        gravitation = field_constants(flight.earth)
        self.navigator = FilteredNavigator(flight.earth, gravitation, flight.own, flight.state, 0.0)
        self.to_outputs = self.navigator.frame().to_outputs(flight.state[4:7])
        self.readings = gauss_readings(flight.recording, flight.step_times)
        rates = [*flight.own.decay_rates, *self.everything.decay_rates]
        remembered = [rate for rate in rates if 0.0 < rate < 1.0 / WITHOUT_MEMORY]
        self.longest = min([LONGEST_FILTER_STEP, *(SHARE_OF_CORRELATION / rate for rate in remembered)])
        self.supports = [self._support(number) for number in range(len(self.causes.driving))]
        self.reference = ReferenceStates.of(flight.earth, flight.recording.reference)

    def _support(self, number: int) -> IndexArray:
        """Return the errors that a process drives, at once or later."""
        states = np.flatnonzero(self.causes.driving[number][1].states)
        driven = self.causes.driving[number][1]
        reads = {each.place for each in self.everything.instruments}
        moves = np.any(driven.gyro > 0.0) or np.any(driven.accelerometer > 0.0) or any(n in reads for n in states)
        return np.concatenate([np.arange(NAVIGATION if moves else 0), NAVIGATION + states]).astype(np.int64)

    def record(self) -> FilteredRecord:
        """Return the whole record."""
        flight, stages, at = self.flight, list[Stage](), 0
        for sensor, row, time in flight.measured:
            end = int(np.searchsorted(flight.step_times, time - SAME_INSTANT))
            motion = self._advance(at, end)
            at = end
            stages.append(self._measure(sensor, row, time, motion))
        covariance = np.zeros((self.everything.size, self.everything.size))
        campaign, names = flight.campaign, [state.name for state in self.everything.states]
        covariance[:NAVIGATION, :NAVIGATION] = campaign.covariance[:NAVIGATION, :NAVIGATION]
        # correlations of the campaign's sources, among them those with the initial navigation errors
        places = [campaign.names.index(name) if name in campaign.names else -1 for name in names]
        known = [(NAVIGATION + here, there) for here, there in enumerate(places) if there >= 0]
        all_places = [*((n, n) for n in range(NAVIGATION)), *known]
        here, there = (list(each) for each in zip(*all_places, strict=True))
        covariance[np.ix_(here, here)] = campaign.covariance[np.ix_(there, there)]
        for place, state in enumerate(self.everything.states):
            if places[place] < 0:
                covariance[NAVIGATION + place, NAVIGATION + place] = state.sigma**2
        mean = np.zeros(self.everything.size)
        mean[here] = campaign.mean[there]
        to_states = np.eye(self.everything.size)
        to_states[:NAVIGATION, :NAVIGATION] = np.linalg.inv(self.to_outputs)
        sensors = tuple(_recorded_sensor(sensor, campaign) for sensor in flight.sensors)
        delays = {
            sensor.name: NAVIGATION + names.index(sensor.delay_name)
            for sensor in flight.sensors if sensor.has_delay and sensor.delay_name in names
        }  # fmt: skip
        record = FilteredRecord(
            sensors, tuple(stages), self.causes.causes, list_offsets(campaign), to_states @ mean, covariance,
            self.causes.start, to_states, float(flight.stops[-1]),
        )  # fmt: skip
        return with_clock_rates(record, delays)

    def _advance(self, first: int, last: int) -> Motion:
        """Navigate over steps; return F, B, D and the noise of the processes."""
        size, states = self.everything.size, len(self.flight.own.states)
        if first == last:
            return None, np.zeros((NAVIGATION, states)), np.ones(states), ()
        times = self.flight.step_times[first : last + 1]
        durations = np.diff(times)
        steps = FilterSteps.group(durations, self.longest, self.flight.own.decay_rates)
        passage = self.navigator.advance(self.readings[first:last], times[:-1], durations, steps, float(times[-1]))
        whole = FilterSteps.group(durations, self.longest, self.everything.decay_rates)
        transitions, noises = self.everything.transitions_by_cause(
            self.flight.earth.rotation_rate, whole, *passage[:4], [driving for _, driving in self.causes.driving]
        )
        feedback, decay = self._feedback(passage)
        transition = np.eye(size)
        parts = [np.zeros((len(support), len(support))) for support in self.supports]
        for number, support in enumerate(self.supports):
            block = np.s_[:, support[:, None], support]
            for inner, noise in zip(transitions[block], noises[number][block], strict=True):
                parts[number] = transform(inner, parts[number]) + noise
        for passed in transitions:
            transition = passed @ transition
        processes = tuple(
            Part(cause, support, part)
            for (cause, _), support, part in zip(self.causes.driving, self.supports, parts, strict=True)
        )
        return transition, feedback, decay, processes

    def _feedback(self, passage: Passage) -> tuple[Array, Array]:
        """Compute what the filter's estimates at the beginning of steps do to navigation, and what is left of them."""
        states = len(self.flight.own.states)
        feedback, decay = np.zeros((NAVIGATION, states)), np.ones(states)
        for each in passage.transitions:
            feedback = each[:NAVIGATION, :NAVIGATION] @ feedback + each[:NAVIGATION, NAVIGATION:] * decay
            decay = decay * np.diag(each)[NAVIGATION:]
        return feedback, decay

    def _measure(self, sensor: int, row: int, time: float, motion: Motion) -> Stage:
        """Update the filter by a measurement."""
        flight, navigator = self.flight, self.navigator
        own, everything = flight.sensor_models[sensor]
        step = int(np.searchsorted(flight.step_times, time - SAME_INSTANT)) - 1
        indicated = navigator.indicated(navigator.extrapolated(self.readings[step : step + 1]))
        values = flight.recording.measurements[own.sensor.name].values
        true = true_state(flight.earth, values, row, indicated)
        nothing = np.zeros(own.size)
        innovation, response = own.innovation(true, indicated, navigator.estimates, nothing, nothing, np.zeros(3))
        if not np.all(np.isfinite(innovation)):
            raise RecordingError(f"an innovation of {own.sensor.name} ceased to be finite at {time:.6g} s")
        _, of_all = everything.innovation(
            true, indicated, np.zeros(len(self.everything.states)), nothing, nothing, np.zeros(3)
        )
        update = navigator.update(innovation, response, own.variances[row], own.threshold)
        transition, feedback, decay, processes = motion
        return Stage(
            time, sensor, innovation, update.covariance, update.accepted, transition, feedback, decay, of_all,
            response[:, NAVIGATION:], update.gain, processes, self._noise(sensor, row), self._read_out(time),
        )  # fmt: skip

    def _noise(self, sensor: int, row: int) -> tuple[Part, ...]:
        """Return the covariance of a measurement's noise by cause."""
        recorded = self.flight.sensors[sensor]
        measured = self.flight.recording.measurements[recorded.name]
        components, count = _at_instants(recorded, measured).components, len(measured.times)
        parts = []
        for label in dict.fromkeys(component.label for component in components):
            places = np.array([n for n, each in enumerate(components) if each.label == label], dtype=np.int64)
            variances = np.array([components[place].white_variances(count)[row] for place in places])
            parts.append(Part(self.causes.noise[label], places, np.diag(variances)))
        return tuple(parts)

    def _read_out(self, time: float) -> ReadOut | None:
        """Compare with the reference, where there is one."""
        if self.reference is None:
            return None
        navigator = self.navigator
        compared = self.reference.compare(time, navigator.state)
        if compared is None:
            return None
        errors, variances = compared
        to_outputs = navigator.frame().to_outputs(navigator.state[4:7])
        covariance = map_covariances(to_outputs, navigator.filter.P[:NAVIGATION, :NAVIGATION])
        return ReadOut(errors, to_outputs, covariance, variances)


def _at_instants(sensor: Sensor, measured: RecordedMeasurements) -> Sensor:
    """Return a sensor that measures at recorded instants, with recorded sigmas where those of its log are believed."""
    components = tuple(
        each if each.noise_at is None else replace(each, noise_at=_recorded_sigmas(sensor, each, measured))
        for each in sensor.components
    )
    return replace(sensor, times=measured.times, components=components)


def _recorded_sigmas(sensor: Sensor, component: Component, measured: RecordedMeasurements) -> tuple[float, ...] | None:
    """Return the sigmas of a component in a record; none, for their root mean square in the log, if there are none."""
    sigmas = measured.sigmas.get(component.quantity)
    factor = 1.0 if sensor.log is None else sensor.log.factor
    return None if sigmas is None else tuple((factor * sigmas[:, component.axis]).tolist())


def _recorded_sensor(sensor: Sensor, campaign: Campaign) -> RecordedSensor:
    names = tuple(component.error_name("noise").replace("_noise", "", 1) for component in sensor.components)
    units = tuple(campaign.units[component.error_name("noise")][:2] for component in sensor.components)
    return RecordedSensor(sensor.name, names, units, sensor.gate)


def indicated_start(earth: Earth, position: Array, velocity: Array, attitude: Array) -> Array:
    """Return the state, shape (10,), at latitude, longitude and altitude with a velocity in local axes, and angles.

    Parameters
    ----------
    attitude : ndarray, shape (3,)
        Roll, pitch, heading, rad.
    """
    from scipy.spatial.transform import Rotation

    level = local_axes(position[0], position[1])
    turn = (Rotation.from_matrix(level) * Rotation.from_euler("ZYX", attitude[::-1])).as_quat()
    return np.concatenate([turn[3:], turn[:3], level @ velocity, earth.from_geodetic(*position)])
