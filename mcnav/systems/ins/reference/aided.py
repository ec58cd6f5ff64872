"""The aided navigator itself, one sample at a time: the reference path of closed-loop navigation.

The indicated state is integrated in earth-fixed axes (`mcnav.systems.ins.reference.collocation`) from compensated
readings (`mcnav.systems.ins.reference.compensation`) to the instant of each measurement. The filter is filterpy's
`KalmanFilter` with an error model along the indicated trajectory (`mcnav.systems.ins.reference.earth_fixed_errors`);
after each sensor's update the navigator is corrected::

    q <- exp(-psi / 2) o q        v <- v - dv        r <- r - dr        estimates <- estimates + their corrections

so that the filter's own state is always zero. Considered states keep their covariance and are not corrected (Schmidt).

The rate for an antenna's velocity is that of the readings of the step before, compensated and extrapolated to the
instant of the measurement by the polynomial through the step's Gauss points. In place of the means of their noise over
the step, these readings have the gyros' bias instability and rate random walk at that instant; what white noise a
navigator's mean of readings has depends on how long it averages, and is part of the noise of the measurement.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.linalg import LinAlgError

from mcnav.arrays.products import map_covariances
from mcnav.arrays.types import Array, IndexArray
from mcnav.systems.faults import fault_errors
from mcnav.systems.ins.filter.consistency import SensorCounts, normalized_errors, record_row
from mcnav.systems.ins.filter.model import ITERATED, NAVIGATION, UKF, FilterModel
from mcnav.systems.ins.imu.instruments import ACCELEROMETER, CONSTANTS, GYRO, OUTPUTS, Imu
from mcnav.systems.ins.imu.sample_noise import SampleNoise, draw_sample_noise
from mcnav.systems.ins.reference.compensation import measure as measure_readings
from mcnav.systems.ins.reference.earth_fixed_errors import ErrorModel, FilterSteps
from mcnav.systems.ins.reference.earth_fixed_sensors import SensorModel, SensorTruth
from mcnav.systems.ins.reference.filtered_navigator import FilteredNavigator, Update
from mcnav.systems.ins.reference.mechanization import (
    LONGEST_STEP,
    NEAREST_POLE,
    SAME_INSTANT,
    Diverged,
    Mechanization,
    matrices,
)
from mcnav.systems.ins.reference.navigation_errors import EarthFixedStates, navigation_errors
from mcnav.systems.ins.reference.nonlinear_updates import (
    Measure,
    advance_by_sigma_points,
    iterate,
    update_by_sigma_points,
)
from mcnav.systems.ins.sensors.aiding import Sensor, aiding_constants
from mcnav.systems.ins.sensors.comparison import TrueState
from mcnav.systems.ins.sensors.delay import WITHOUT_MEMORY
from mcnav.systems.ins.truth.gravity import GravityPath
from mcnav.systems.ins.truth.trajectory import Platform, Truth

LONGEST_FILTER_STEP: Final = 0.2
"""Longest step of the filter's covariance, s."""

SHARE_OF_CORRELATION: Final = 0.1
"""Longest step of the filter's covariance as a share of the shortest believed correlation time."""

UPDATES: Final[Mapping[str, Callable[[FilteredNavigator, Measure, Array, float], Update]]] = {
    ITERATED: iterate, UKF: update_by_sigma_points
}  # fmt: skip
"""Updates by kind of filter; others have the linear one."""

FIRST_OF_ACCELEROMETERS: Final = len(OUTPUTS) + len(GYRO)


@dataclass(frozen=True)
class Stop:
    """An instant at which there are measurements, an epoch, or both.

    Attributes
    ----------
    first, last : int
        The navigator's steps from the stop before to this one.
    steps : FilterSteps or None
        The filter's; none for no steps.
    updates : tuple of (int, int)
        Numbers of sensor and measurement, in order.
    epochs : range
        Epochs at this instant.
    """

    time: float
    first: int
    last: int
    steps: FilterSteps | None
    updates: tuple[tuple[int, int], ...]
    epochs: range


@dataclass(frozen=True)
class AidedMechanization:
    """An aided navigator along a truth, from the start to the end of navigation.

    Attributes
    ----------
    start, end : float
        In the trajectory's time, s.
    times : ndarray, shape (m,)
        Epochs in order, from start to end; at least one.
    sensors : tuple of Sensor
        As the truth has them.
    model : FilterModel
    longest_step : float
        Of the navigator, s; noise is constant over a step.
    longest_filter_step : float
        s.
    """

    truth: Truth
    platform: Platform
    start: float
    end: float
    times: Array
    sensors: tuple[Sensor, ...]
    model: FilterModel
    longest_step: float = LONGEST_STEP
    longest_filter_step: float = LONGEST_FILTER_STEP

    @cached_property
    def stop_times(self) -> Array:
        """Instants of measurements and epochs after the start, s."""
        instants = np.sort(np.concatenate([self.times, *(self.measured(sensor) for sensor in self.sensors)]))
        instants = instants[instants > self.start + SAME_INSTANT]
        return np.asarray(instants[np.diff(instants, prepend=-np.inf) > SAME_INSTANT])

    @cached_property
    def navigator(self) -> Mechanization:
        """The navigator without aiding, whose steps end at the stops."""
        return Mechanization(
            self.truth, self.platform, self.start, self.end, self.times, self.longest_step, self.stop_times
        )

    @property
    def step_times(self) -> Array:
        """Boundaries of the navigator's steps, s; the epochs are among them."""
        return self.navigator.step_times

    @cached_property
    def epoch_steps(self) -> IndexArray:
        """Boundaries of steps that are epochs, shape (m,)."""
        return self._boundaries(self.times)

    @cached_property
    def errors(self) -> ErrorModel:
        """System of the filter's states."""
        return ErrorModel(self.model)

    @cached_property
    def sensor_models(self) -> tuple[SensorModel, ...]:
        """Sensors with the truth at their instants."""
        models = []
        for sensor, believed in zip(self.sensors, self.model.beliefs.sensors, strict=True):
            truth = self._truth_of(sensor, self._stamps(sensor))
            models.append(SensorModel(sensor, believed, truth, self.errors.states, self.truth.earth))
        return tuple(models)

    def _stamps(self, sensor: Sensor) -> Array:
        return np.asarray(self.step_times[self._boundaries(self.measured(sensor))])

    def _truth_of(self, sensor: Sensor, times: Array) -> SensorTruth:
        """Return the truth that a sensor measures at times, s."""
        rate = None
        if self.platform != "strapdown":
            rate = self.truth.states(times, self.platform, self.start).rate
        states = self.navigator.earth_fixed(times)
        return SensorTruth.at(self.truth, states, times, rate, bool(sensor.lever_arm.any()))

    def late_truth(self, number: int, delays: Array) -> SensorTruth:
        """Return the truth that a sensor, by its number, measures before its time stamps, by delays, shape (u,), s."""
        model = self.sensor_models[number]
        assert model.truth is not None
        late = self._truth_of(model.sensor, self._stamps(model.sensor) - delays)
        return late.late(model.truth, delays, self.truth.earth.rotation_rate)

    @cached_property
    def stops(self) -> tuple[Stop, ...]:
        """The start and all instants of measurements and epochs, in order."""
        times = np.concatenate([[self.start], self.stop_times])
        boundaries, durations = self._boundaries(times), np.diff(self.step_times)
        rates = self.errors.rates_at(np.array([self._fastest]))[0]
        remembered = (rates > 0.0) & (rates < 1.0 / WITHOUT_MEMORY)
        longest = min([self.longest_filter_step, *(SHARE_OF_CORRELATION / rates[remembered])])
        updates: dict[int, list[tuple[int, int]]] = {}
        for number, sensor in enumerate(self.sensors):
            for row, boundary in enumerate(self._boundaries(self.measured(sensor))):
                updates.setdefault(int(boundary), []).append((number, row))
        epochs = np.searchsorted(self.epoch_steps, boundaries), np.searchsorted(self.epoch_steps, boundaries, "right")
        result = []
        for place, boundary in enumerate(boundaries.tolist()):
            first = int(boundaries[place - 1]) if place else boundary
            of_step = durations[first:boundary]
            steps = FilterSteps.group(of_step, longest, self.errors.decay_rates) if boundary > first else None
            here = range(int(epochs[0][place]), int(epochs[1][place]))
            result.append(Stop(float(times[place]), first, boundary, steps, tuple(updates.get(boundary, ())), here))
        return tuple(result)

    @cached_property
    def true_states(self) -> EarthFixedStates:
        """The truth at the epochs."""
        return self.navigator.earth_fixed(self.step_times[self.epoch_steps])

    def draw(self, imu: Imu, seed: int, index: int) -> SampleNoise:
        """Draw the noise of one sample."""
        path = self._path if imu.gravity.sizes else None
        return draw_sample_noise(imu, self.sensors, self.step_times, self.epoch_steps, seed, index, path)

    @cached_property
    def _fastest(self) -> float:
        """Largest true speed at the stops, m/s."""
        velocity = self.navigator.earth_fixed(np.concatenate([[self.start], self.stop_times])).velocity
        return float(np.linalg.norm(velocity, axis=1).max())

    @cached_property
    def _path(self) -> GravityPath:
        """Action of gravity disturbances in the steps."""
        return GravityPath.along(self.truth, self.platform, self.step_times)

    def updated(self, sensor: int) -> IndexArray:
        """Return the steps at whose ends a sensor has its measurements, by its number."""
        return self._boundaries(self.measured(self.sensors[sensor])) - 1

    def quiet(self) -> SampleNoise:
        """Return the noise of a sample without any."""
        nothing = np.zeros((len(self.step_times) - 1, 3))
        return SampleNoise(nothing, nothing)

    def simulate(self, errors: Array, noise: SampleNoise | None = None) -> tuple[Array, Array]:
        """Simulate one sample: its navigation errors at the epochs, and the record of its filter.

        Parameters
        ----------
        errors : ndarray, shape (39 + a,)
            In the order of `mcnav.systems.ins.imu.instruments.CONSTANTS`, then of `aiding_constants`.
        noise : SampleNoise, optional

        Returns
        -------
        tuple of ndarray, shape (m, 9), (m, F)
            In the order of `mcnav.systems.ins.imu.instruments.OUTPUTS`; columns as `FilterSchema` has them. The error
            of another state is its true value less the estimate.

        Raises
        ------
        Diverged
            When the indicated state breaks down, or the filter's covariance ceases to be one.
        """
        errors = np.asarray(errors, dtype=float)
        expected = len(CONSTANTS) + len(aiding_constants(self.sensors))
        if errors.shape != (expected,):
            raise ValueError(f"errors must have shape ({expected},), one for each constant; got {errors.shape}")
        if not np.all(np.isfinite(errors)):
            raise Diverged("the sample has errors that are not finite")
        return AidedFlight(self, errors, self.quiet() if noise is None else noise).fly()

    def measured(self, sensor: Sensor) -> Array:
        """Return the instants of a sensor within navigation."""
        return np.asarray(sensor.times[(sensor.times > self.start) & (sensor.times <= self.end + SAME_INSTANT)])

    def _boundaries(self, times: Array) -> IndexArray:
        """Find the boundaries of steps nearest to instants."""
        after = np.searchsorted(self.step_times, times).clip(1, len(self.step_times) - 1)
        nearer = times - self.step_times[after - 1] < self.step_times[after] - times
        return np.asarray(after - nearer, dtype=np.int64)


class AidedFlight:
    """One sample on its way."""

    def __init__(self, engine: AidedMechanization, errors: Array, noise: SampleNoise) -> None:
        self.engine, self.noise, self.errors = engine, noise, errors
        self.earth, self.model = engine.truth.earth, engine.errors
        navigator = engine.navigator
        steps = len(engine.step_times) - 1
        self.drifts = np.zeros((steps, 3)) if noise.drifts is None else noise.drifts
        for each in (noise.gyro, noise.accelerometer, self.drifts):
            if each.shape != (steps, 3):
                raise ValueError(f"noise must have shape ({steps}, 3), one row for each step; got {each.shape}")
        self.gyro = errors[len(OUTPUTS) : FIRST_OF_ACCELEROMETERS]
        self.accelerometer = errors[FIRST_OF_ACCELEROMETERS : FIRST_OF_ACCELEROMETERS + len(ACCELEROMETER)]
        self.measured = measure_readings(
            navigator.readings.values[:steps], self.gyro, self.accelerometer, noise.gyro, noise.accelerometer
        )
        self.durations = np.diff(engine.step_times)
        state = navigator.indicated_start(errors[: len(OUTPUTS)])
        aligned = float(engine.truth.times[0])
        self.navigator = FilteredNavigator(self.earth, navigator.gravitation, self.model, state, engine.start, aligned)
        self.counts = [SensorCounts() for _ in engine.sensors]
        self.offsets = list(self._measurement_errors())
        self.late = tuple(self._late_truths())

    def fly(self) -> tuple[Array, Array]:
        """Simulate the sample; results as those of `AidedMechanization.simulate`."""
        result = []
        for stop in self.engine.stops:
            try:
                with np.errstate(over="ignore", invalid="ignore"):  # what breaks down is told as such
                    result += self._pass(stop)
            except LinAlgError:
                raise Diverged(f"the filter's covariance lost its definiteness at {stop.time:.1f} s") from None
        return np.array([errors for errors, _ in result]), np.array([record for _, record in result])

    def _pass(self, stop: Stop) -> list[tuple[Array, Array]]:
        """Navigate to a stop and return what is read there."""
        if stop.steps is not None:
            self._advance(stop, stop.steps)
        for sensor, row in stop.updates:
            self._update(stop, sensor, row)
        return [self._read(epoch) for epoch in stop.epochs]

    def _measurement_errors(self) -> Iterator[tuple[Array, Array, Array]]:
        """Arrange the sample's errors of each sensor's measurements."""
        self.known: list[dict[str, Array]] = []
        first = len(CONSTANTS)
        for model in self.engine.sensor_models:
            last = first + sum(1 for _ in model.sensor.constants())
            shape = (len(self.engine.measured(model.sensor)), model.size)
            noise = self.noise.measurements.get(model.sensor.name, np.zeros(shape))
            noise = noise + fault_errors(model.sensor.faults, self.engine.measured(model.sensor), model.size)
            self.known.append(model.offsets_of(self.errors[first:last]))
            yield model.measurement_errors(self.errors[first:last], noise)
            first = last

    def _late_truths(self) -> Iterator[SensorTruth | None]:
        """Yield the truth that each sensor measures, where it is not that of the time stamps."""
        constants = dict(zip((*CONSTANTS, *aiding_constants(self.engine.sensors)), self.errors, strict=True))
        for number, model in enumerate(self.engine.sensor_models):
            delays = np.full(len(model.variances), constants.get(model.sensor.delay_name, 0.0))
            delays = delays + self.noise.jitters.get(model.sensor.name, 0.0)
            yield self.engine.late_truth(number, delays) if delays.any() else None

    def true_at(self, sensor: int, row: int) -> TrueState:
        """Return the truth that a sensor measures, both by their numbers."""
        model, late = self.engine.sensor_models[sensor], self.late[sensor]
        return model.true_at(row) if late is None else late.at_row(row, model.sensor.lever_arm)

    def _advance(self, stop: Stop, steps: FilterSteps) -> None:
        """Integrate the indicated state and the filter's covariance to a stop."""
        here = slice(stop.first, stop.last)
        begins, durations = self.engine.step_times[here], self.durations[here]
        passed = (self.measured[here], begins, durations, steps, stop.time)
        if self.navigator.kind == UKF:
            advance_by_sigma_points(self.navigator, *passed)
        else:
            self.navigator.advance(*passed)

    def _update(self, stop: Stop, sensor: int, row: int) -> None:
        """Update the filter by a measurement and correct the navigator."""
        model, navigator = self.engine.sensor_models[sensor], self.navigator
        offsets, factors, arm = self.offsets[sensor]
        true, stamped = self.true_at(sensor, row), model.true_at(row)
        measured = self._measured_at_end(stop.last - 1)
        flexures = self.noise.flexures.get(model.sensor.name)
        bent = None if flexures is None else flexures[row]

        def measure(state: Array, estimates: Array) -> tuple[Array, Array]:
            indicated = navigator.indicated(navigator.extrapolated(measured, estimates), state)
            innovation, response = model.innovation(
                true, indicated, estimates, offsets[row], factors, arm, bent, self.known[sensor], stamped
            )
            if not np.all(np.isfinite(innovation)):
                raise Diverged(f"an innovation of {model.sensor.name} ceased to be finite at {stop.time:.1f} s")
            return innovation, response

        believed = (model.variances[row], model.threshold)
        if navigator.kind in UPDATES:
            update = UPDATES[navigator.kind](navigator, measure, *believed)
        else:
            update = navigator.update(*measure(navigator.state, navigator.estimates), *believed)
        self.counts[sensor].add(update.whitened, update.accepted)

    def _measured_at_end(self, step: int) -> Array:
        """Compute what instruments read in a step, shape (1, 3, 6), without the noise of readings."""
        here, nothing = slice(step, step + 1), np.zeros((1, 3))
        values = self.engine.navigator.readings.values[here]
        return measure_readings(values, self.gyro, self.accelerometer, self.drifts[here], nothing)

    def _read(self, epoch: int) -> tuple[Array, Array]:
        """Compute the navigation errors and the record at an epoch."""
        from scipy.spatial.transform import Rotation

        engine, state = self.engine, self.navigator.state
        if not np.hypot(state[7], state[8]) >= NEAREST_POLE * self.earth.radius:
            raise Diverged(f"the indicated position came near a pole at {engine.times[epoch]:.1f} s")
        here = slice(epoch, epoch + 1)
        all_true = engine.true_states
        true = EarthFixedStates(all_true.position[here], all_true.velocity[here], all_true.axes[here])
        fixed_states = EarthFixedStates(state[None, 7:], state[None, 4:7], matrices(state[None, :4]))
        errors = navigation_errors(self.earth, true, fixed_states)[0]
        turn = Rotation.from_matrix(fixed_states.axes[0] @ true.axes[0].T).as_rotvec()
        states = self._true_values(epoch) - self.navigator.estimates
        deviation = np.concatenate(
            [turn, fixed_states.velocity[0] - true.velocity[0], fixed_states.position[0] - true.position[0], states]
        )
        to_outputs = self.navigator.frame().to_outputs(state[4:7])
        own = self.navigator.filter.P
        covariance = map_covariances(to_outputs, own[:NAVIGATION, :NAVIGATION])
        counts = [count.read() for count in self.counts]
        nees = normalized_errors(self.model, deviation, own, to_outputs)
        return errors, record_row(nees, covariance, errors, states, np.diag(own)[NAVIGATION:], counts)

    def _true_values(self, epoch: int) -> Array:
        """Return the true values of the filter's states besides those of navigation, shape (q,)."""
        constants = dict(zip((*CONSTANTS, *aiding_constants(self.engine.sensors)), self.errors, strict=True))
        true_values = np.zeros(len(self.model.states))
        for place, state in enumerate(self.model.states):
            true_values[place] = constants.get(state.name, 0.0)
            for name in {state.name, state.name.replace("_bias_", "_rate_random_walk_")}:
                if name in self.noise.processes:
                    true_values[place] += self.noise.processes[name][epoch]
        return true_values
