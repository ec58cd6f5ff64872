"""Inertial navigation in three dimensions as a scenario: a vehicle's trajectory, its instruments and their noise.

Two engines simulate it. ``ensemble`` carries deviations from the truth over tables that all samples share;
``reference`` mechanizes the navigator at the instruments' rate, sample by sample. They share no equation but the truth
and the definition of their noise, which each draws by generators of its own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array
from mcnav.contract.engine import Engine
from mcnav.contract.failure import Failure, Reason
from mcnav.contract.filter_record import FilterPrediction, FilterSchema
from mcnav.contract.gates import USUAL, FaultLaw, GateLaw, GateQuestion, RejectionLaws
from mcnav.contract.history import Epochs, History, Panel, StartClock
from mcnav.contract.linear import TRAJECTORY_TIME, CovarianceReadings, LinearSystem
from mcnav.contract.quantities import Output, Source
from mcnav.contract.questions import TimelineParts
from mcnav.contract.recorded import FilteredRecord, MeasurementFile, Recording
from mcnav.contract.samples import Batch, SimulationResult
from mcnav.contract.scenario import Capability, CovarianceQuestion, PlainScenario, ScenarioError
from mcnav.contract.time_axis import TimeAxis, time_axis
from mcnav.linear.engine.propagate import Propagated
from mcnav.physics.constants import EARTH_RADIUS, STANDARD_GRAVITY
from mcnav.systems.gates import GatedFilter, GatedSensor, fault_laws, gate_laws, rejection_laws
from mcnav.systems.histories import first_and_last
from mcnav.systems.ins.aided import (
    PROBES,
    AidedEngine,
    AidedNavigation,
    AidedReferenceEngine,
    believed_shares,
    filter_schema,
)
from mcnav.systems.ins.ensemble.adjoint import Adjoint, adjoint_of_free
from mcnav.systems.ins.ensemble.aided import GivenNoise
from mcnav.systems.ins.ensemble.conditional import ConditionalSamples, Measured, NoiseSystem
from mcnav.systems.ins.ensemble.free import EnsembleErrors, EnsembleTables, simulate, simulate_given, tabulate
from mcnav.systems.ins.filter.model import EKF, UKF, FilterModel
from mcnav.systems.ins.imu.fine_noise import draw_noise
from mcnav.systems.ins.imu.gravity import CAUSES, DISTURBANCES, cause_of
from mcnav.systems.ins.imu.instruments import CONSTANTS, OUTPUTS, PROCESSES, Imu, process_sizes
from mcnav.systems.ins.imu.linear_noise import NoiseResponse
from mcnav.systems.ins.kept import settle
from mcnav.systems.ins.linear.covariance import LinearErrors
from mcnav.systems.ins.linear.delay_remarks import remarks_on_delays
from mcnav.systems.ins.linear.free_timeline import free_errors, free_starts
from mcnav.systems.ins.linear.response_blocks import Responses, recent_responses
from mcnav.systems.ins.reference.mechanization import Diverged, Mechanization, longest_step
from mcnav.systems.ins.sensors.aiding import Component, Sensor
from mcnav.systems.ins.sensors.registry import QUANTITIES
from mcnav.systems.ins.sensors.sources import aiding_outputs, aiding_sources, flexure_rates
from mcnav.systems.ins.truth.gravity import GravityPath
from mcnav.systems.ins.truth.trajectory import Platform, Truth
from mcnav.systems.ins.tunings import Navigated, Tunings
from mcnav.systems.sample_loop import simulate_each

DEGREE: Final = np.pi / 180.0

KINDS: Final = {
    "position": ("m", "m", 10.0),
    "velocity": ("m/s", "m/s", 0.1),
    "tilt": ("rad", "arcsec", 1e-4),
    "heading": ("rad", "arcsec", 1e-3),
    "gyro_bias": ("rad/s", "deg/h", 0.01 * DEGREE / 3600.0),
    "gyro_scale_factor": ("1", "ppm", 1e-5),
    "gyro_misalignment": ("rad", "arcsec", 1e-5),
    "gyro_g_sensitivity": ("rad/s/(m/s^2)", "deg/h/g", 0.01 * DEGREE / 3600.0 / STANDARD_GRAVITY),
    "accelerometer_bias": ("m/s^2", "ug", 1e-4 * STANDARD_GRAVITY),
    "accelerometer_scale_factor": ("1", "ppm", 1e-4),
    "accelerometer_misalignment": ("rad", "arcsec", 1e-5),
    "accelerometer_nonlinearity": ("(m/s^2)/(m/s^2)^2", "ug/g^2", 1e-5 / STANDARD_GRAVITY),
}
"""SI unit, unit shown and usual size of each kind of error source, by the beginning of its name."""

SHOWN: Final = {"position": ("m", "m"), "velocity": ("m/s", "m/s"), "tilt": ("rad", "mrad"), "heading": ("rad", "mrad")}
"""SI unit and unit shown of each kind of output."""

PROCESS_UNITS: Final = {
    "gyro_angle_random_walk": ("rad/sqrt(s)", "deg/sqrt(h)"),
    "gyro_bias_instability": ("rad/s", "deg/h"),
    "gyro_rate_random_walk": ("rad/s/sqrt(s)", "deg/h/sqrt(h)"),
    "gyro_quantization": ("rad", "arcsec"),
    "accelerometer_velocity_random_walk": ("m/s/sqrt(s)", "m/s/sqrt(h)"),
    "accelerometer_bias_instability": ("m/s^2", "ug"),
    "accelerometer_rate_random_walk": ("m/s^2/sqrt(s)", "ug/sqrt(h)"),
    "accelerometer_quantization": ("m/s", "m/s"),
    "gravity_deflection": ("rad", "arcsec"),
    "gravity_anomaly": ("m/s^2", "mGal"),
}
"""SI unit and unit shown of each kind of process."""


NO_FLIGHT: Final = "there are too many measurements for flights, so that none has examined linear analysis"


def kind_of(name: str) -> str:
    """Return the kind of a source, a beginning of its name in `KINDS`."""
    return next(kind for kind in KINDS if name == kind or name.startswith(f"{kind}_"))


SOURCES: Final = tuple(Source(name, *KINDS[kind_of(name)], group=kind_of(name)) for name in CONSTANTS)
"""Constant error sources: initial errors, gyros, accelerometers."""

LIMITS: Final = {
    "position": EARTH_RADIUS,
    "velocity": float(np.sqrt(STANDARD_GRAVITY * EARTH_RADIUS)),
    "tilt": 1.0,
    "heading": 1.0,
}
"""Size of each kind of output beyond which a linear error has no meaning, SI.

The earth's radius R, over which gravity and the local axes change altogether; sqrt(g R), the velocity in a Schuler
oscillation with the amplitude R; a radian.
"""

NAVIGATION_ERRORS: Final = tuple(Output(name, *SHOWN[kind_of(name)], limit=LIMITS[kind_of(name)]) for name in OUTPUTS)
"""Final navigation errors."""

NOISE: Final = (
    *(Output(name, *PROCESS_UNITS[name.rpartition("_")[0]]) for name in PROCESSES),
    *(Output(name, *PROCESS_UNITS[name]) for name in CAUSES),
)
"""Processes of the instruments, and gravity disturbances."""

GRAVITY: Final = tuple(Output(name, *PROCESS_UNITS[cause_of(name)]) for name in DISTURBANCES)
"""Gravity disturbances as states of a filter."""

REVISION: Final = 7
"""Counts the changes of the samples' digits: 1 drew normal variates one at a time, 2 two of a block of random bits.

4 computes them in single precision, 5 linear errors as sums. 6 computes the velocity of an antenna on a lever arm with
measured rates. 7 turns the force's error to the attitude that a filter's sample indicates. It is two more where
samples have responses of their own to a heading, a boresight, a map, a scale factor or a delay (`measures_exactly`),
and one more with an unscented filter, whose points are columns of Cholesky's factor.
"""

EPOCHS: Final = 60
"""Intervals between instants at which the errors of all samples are read out; fewer in a shorter navigation."""

HISTORY_POINTS: Final = 401
ENSEMBLE_CHUNK: Final = 2_048
REFERENCE_CHUNK: Final = 8

TOLERANCE: Final = 3e-6
"""Largest numerical error of any probe at any epoch, as a share of the probes' standard deviation in that output."""

MOST_STEPS: Final = 256
"""Steps between two epochs."""

SHORTEST: Final = 1.0
"""Shortest navigation, s."""

FEWEST_PROBES: Final = 2

START_CLOCK: Final = StartClock("min of the trajectory", aligned="at the navigation's own start")


@dataclass(frozen=True)
class Navigation:
    """A navigation along a trajectory.

    Attributes
    ----------
    start, end : float
        In the trajectory's time, s.
    imu : Imu
        Processes of the instruments.
    sensors : tuple of Sensor
        Aiding.
    filter : FilterModel, optional
        Of an aided navigation.
    sigmas : mapping of str to float
        True root mean squares of the constant sources, where they are known: what a filter believes is compared.
    further : tuple of float
        Times at which errors are looked at besides the usual epochs, s, such as those of requirements.
    together : bool
        Whether linear analysis of aided navigation has the variances of all processes together, in less time.
    """

    truth: Truth
    platform: Platform
    start: float
    end: float
    imu: Imu
    sensors: tuple[Sensor, ...] = ()
    filter: FilterModel | None = None
    sigmas: Mapping[str, float] = field(default_factory=dict)
    further: tuple[float, ...] = ()
    together: bool = False

    @property
    def measures_exactly(self) -> bool:
        """True with a sensor's boresight, map or heading, and with a filter's state for a scale factor or a delay."""
        if self.filter is None:
            return False
        components = [each for sensor in self.sensors for each in sensor.components]
        exact = {each.error_name("scale_factor") for each in components}
        exact |= {name for sensor in self.sensors for name in (sensor.delay_name, sensor.jitter_name)}
        known = any(sensor.offsets for sensor in self.sensors) or any(each.quantity == "heading" for each in components)
        return known or any(state.name in exact for state in self.filter.states)

    @property
    def latest_start(self) -> float:
        """Start of the shortest navigation to the same end, s; not before the present one."""
        latest = self.end - SHORTEST
        if self.end - latest < SHORTEST:  # rounded
            latest = float(np.nextafter(latest, -np.inf))
        return max(self.start, latest)

    @property
    def times(self) -> Array:
        """Epochs, the start first, s; begin and end of each outage are among them, and further times."""
        times = np.linspace(self.start, self.end, EPOCHS + 1)
        ends = (first_and_last(*outage) for sensor in self.sensors for outage in sensor.outages)
        faults = (span for sensor in self.sensors for span in _around_faults(sensor))
        for added in (*ends, *faults, *((time,) for time in self.further)):
            inside = [time for time in added if self.start < time < self.end]
            far = [time for time in inside if np.abs(times - time).min() > 1e-6]
            times = np.union1d(times, far)
        return times

    @property
    def clock(self) -> TimeAxis:
        """Name and unit in which times of the trajectory are read."""
        return time_axis("time", self.end - self.start)

    @property
    def epochs(self) -> Epochs:
        """Epochs in times of the trajectory as they are read."""
        events = {
            f"{sensor.name} outage {number} {edge}": self.clock.read(float(time))
            for sensor in self.sensors
            for number, outage in enumerate(sensor.outages, 1)
            for edge, time in zip(("begins", "ends"), outage, strict=True)
        }
        return Epochs(self.clock.label, self.clock.read(self.times), events)

    @cached_property
    def aided(self) -> AidedNavigation | None:
        """The navigation with its filter; none without."""
        if self.filter is None:
            return None
        return AidedNavigation(
            self.truth, self.platform, self.start, self.imu, self.sensors, self.filter, self.epochs, self.times,
            self.together,
        )  # fmt: skip

    def grid(self, steps: int) -> Array:
        """Return the times of so many steps between epochs."""
        times = self.times
        if len(times) == EPOCHS + 1:
            return np.linspace(self.start, self.end, EPOCHS * steps + 1)
        places = np.arange((len(times) - 1) * steps + 1) / steps
        return np.interp(places, np.arange(len(times)), times)

    @cached_property
    def responses(self) -> Responses:
        """The linear responses between epochs."""
        return recent_responses(self.truth, self.platform, self.times, self.imu)

    def tables(self, steps: int) -> EnsembleTables:
        """Prepare the ensemble's tables."""
        grid = self.grid(steps)
        responses = self.responses
        if not np.array_equal(grid, self.times):
            responses = Responses(self.truth, self.platform, grid, self.imu)
        return tabulate(self.truth, self.platform, responses, self.imu, np.arange(len(self.times)) * steps)

    @cached_property
    def linear(self) -> LinearErrors:
        """The linear system at the epochs, after their updates."""
        if self.aided is not None:
            closed = self.aided.linear
            return LinearErrors(closed.times, closed.partials, closed.processes)
        return free_errors(self.truth, self.responses, self.imu, np.arange(len(self.times)))


def _described(component: Component) -> tuple[str, str, str]:
    """Return the name of a component, its SI unit, and the unit in which it is shown."""
    quantity = QUANTITIES[component.quantity]
    return component.name, quantity.unit, quantity.shown_in


def _around_faults(sensor: Sensor) -> list[tuple[float, ...]]:
    """Return the times of the last measurement before each fault, and of the last one during it."""
    around = []
    for fault in sensor.faults:
        during = np.flatnonzero(fault.errors(sensor.times) != 0.0)
        if len(during):
            around.append(tuple(sensor.times[[max(int(during[0]) - 1, 0), int(during[-1])]].tolist()))
    return around


@dataclass(frozen=True)
class EnsembleEngine:
    """Deviations over shared tables; a sample beyond their validity fails."""

    navigation: Navigation
    tables: EnsembleTables
    accuracy: str
    parallel: str = "threads"
    chunk: int = ENSEMBLE_CHUNK
    noisy: bool = True
    filter: FilterSchema | None = None

    @property
    def epochs(self) -> Epochs:
        """Instants of the histories."""
        return self.navigation.epochs

    def simulate(self, batch: Batch, noise: bool = True) -> SimulationResult:
        """Simulate samples, with their noise or without."""
        if not noise:
            return self._without_noise(batch.errors)
        return self._result(simulate(self.tables, batch.errors, batch.seed, batch.index))

    def _result(self, simulated: EnsembleErrors) -> SimulationResult:
        values = simulated.values
        values[~simulated.valid] = np.nan
        return SimulationResult(
            values[:, -1], self._failures(simulated.valid), linear_values=simulated.linear, history=values
        )

    @cached_property
    def noise(self) -> NoiseSystem:
        """The noise of samples as a linear system."""
        tables = self.tables
        return NoiseSystem(tables, tables.adjoint, Measured.nothing(len(tables.durations), len(tables.sizes)))

    def conditional_noise(self, outputs: tuple[int, ...], epochs: tuple[int, ...] | None = None) -> ConditionalSamples:
        """Return the samples with conditions on what noise adds to some outputs."""
        return ConditionalSamples.of(self.noise, outputs, epochs, self._adjoint_at, self.chunk, self._simulate_given)

    def _adjoint_at(self, epoch: int) -> Adjoint:
        tables = self.tables
        return adjoint_of_free(tables.motion, int(tables.epochs[epoch]), tables.output_maps[epoch])

    def _simulate_given(self, batch: Batch, noise: GivenNoise) -> SimulationResult:
        assert noise.added is not None  # the instruments' noise is all there is
        return self._result(simulate_given(self.tables, batch.errors, noise.added))

    def _without_noise(self, errors: Array) -> SimulationResult:
        simulated = simulate(self._quiet, errors, 0, np.arange(len(errors)))
        simulated.values[~simulated.valid] = np.nan
        return SimulationResult(simulated.values[:, -1], self._failures(simulated.valid))

    @cached_property
    def _quiet(self) -> EnsembleTables:
        return self.tables.without_noise().at_the_end()

    def _failures(self, valid: NDArray[np.bool_]) -> dict[int, Failure]:
        failure = Failure(Reason.STATED, "errors too large for the ensemble engine; the reference engine takes them")
        return dict.fromkeys((int(row) for row in np.flatnonzero(~valid)), failure)


@dataclass(frozen=True)
class ReferenceEngine:
    """The navigator's own equations at the instruments' rate, one sample at a time."""

    navigation: Navigation
    accuracy: str = "mechanization in earth-fixed axes, Gauss collocation of order 6 with steps of at most 0.1 s"
    parallel: str = "processes"  # Python holds the interpreter's lock
    chunk: int = REFERENCE_CHUNK
    noisy: bool = True
    filter: FilterSchema | None = None

    @property
    def epochs(self) -> Epochs:
        """Instants of the histories."""
        return self.navigation.epochs

    @cached_property
    def mechanization(self) -> Mechanization:
        """The navigator."""
        navigation = self.navigation
        return Mechanization(
            navigation.truth, navigation.platform, navigation.start, navigation.end, navigation.times,
            longest_step(navigation.imu),
        )  # fmt: skip

    @cached_property
    def _response(self) -> NoiseResponse:
        navigation = self.navigation
        return NoiseResponse.along(
            navigation.truth, navigation.platform, self.mechanization.step_times, navigation.times
        )

    @cached_property
    def _path(self) -> GravityPath | None:
        navigation = self.navigation
        if not navigation.imu.gravity.sizes:
            return None
        return GravityPath.along(navigation.truth, navigation.platform, self.mechanization.step_times)

    def simulate(self, batch: Batch, noise: bool = True) -> SimulationResult:
        """Simulate samples, with their noise or without."""
        if not noise:
            return self._without_noise(batch.errors)
        partials = self.navigation.linear.partials
        linear = np.einsum("mij,nj->nmi", partials, batch.errors)
        noisy = bool(process_sizes(self.navigation.imu))
        histories = np.full((len(batch.errors), len(self.navigation.times), len(OUTPUTS)), np.nan)

        def simulate(row: int) -> Array:
            drawn: tuple[Array, ...] = ()
            if noisy:
                drawn = draw_noise(
                    self.navigation.imu, self.mechanization.step_times, batch.seed, int(batch.index[row]), self._path
                )
                linear[row] += self._response.respond(*drawn)
            histories[row] = self.mechanization.simulate(batch.errors[row], *drawn)
            return np.asarray(histories[row, -1])

        values = np.empty((len(batch.errors), len(OUTPUTS)))
        failures = simulate_each(simulate, range(len(values)), values, Diverged)
        return SimulationResult(values, failures, linear_values=linear[:, -1], history=histories)

    def _without_noise(self, errors: Array) -> SimulationResult:
        values = np.empty((len(errors), len(OUTPUTS)))
        rows = range(len(errors))
        return SimulationResult(
            values, simulate_each(lambda row: self.mechanization.simulate(errors[row])[-1], rows, values, Diverged)
        )


class Ins(PlainScenario):
    """The scenario.

    Raises
    ------
    ScenarioError
        When navigation does not lie within the trajectory.

    Attributes
    ----------
    remarks : tuple of str
        What was noticed of the files that it reads, and assumed of them, a clause each.
    """

    outputs = NAVIGATION_ERRORS
    start_clock = START_CLOCK

    def __init__(self, navigation: Navigation, remarks: tuple[str, ...] = ()) -> None:
        first, last = navigation.truth.times[[0, -1]]
        for key, time in (("start", navigation.start), ("end", navigation.end)):
            if not first <= time <= last:
                raise ScenarioError(key, f"got {time:g} s; the trajectory has {first:g} to {last:g} s")
        if navigation.end - navigation.start < SHORTEST:
            least = f"at least {navigation.start + SHORTEST:g} s, {SHORTEST:g} s after the start"
            raise ScenarioError("end", f"got {navigation.end:g} s; expected {least}")
        self.navigation = navigation
        unscented = navigation.filter is not None and navigation.filter.kind == UKF
        self.revision = REVISION + 2 * navigation.measures_exactly + unscented
        self.further_epochs = navigation.further  # samples' noise depends on all epochs
        self.remarks = remarks
        self._last_starts: tuple[tuple[str, bytes], Propagated] | None = None
        self._tunings = Tunings()

    @property
    def can(self) -> frozenset[Capability]:
        """Capabilities of the scenario."""
        always = frozenset({Capability.COVARIANCE, Capability.TRAJECTORY})
        sensors = self.navigation.sensors
        gated = self.navigation.filter is not None and any(
            sensor.gate is not None or sensor.faults for sensor in sensors
        )
        return always | {Capability.GATES} if gated else always

    @property
    def parts(self) -> TimelineParts:
        """Parts of its timeline."""
        model = self.navigation.filter
        aided = model is not None
        smoothed = model is not None and model.smoothed
        return TimelineParts("any time", noise=True, updates=aided, filter=aided, smoother=smoothed)

    def remarks_on(self, mean: Array, covariance: Array) -> tuple[str, ...]:
        """Return `remarks`, and what has to be said of delays of these errors."""
        aided, names = self.navigation.aided, [source.name for source in self.sources]
        if aided is None:
            return self.remarks
        means = dict(zip(names, mean.tolist(), strict=True))
        sigmas = dict(zip(names, np.sqrt(np.diag(covariance)).tolist(), strict=True))
        unflown = () if aided.can_be_flown else (NO_FLIGHT,)
        return (*self.remarks, *unflown, *remarks_on_delays(aided.loop, aided.places(aided.loop), means, sigmas))

    @property
    def engines(self) -> tuple[str, ...]:
        """Names of the engines."""
        if self.navigation.filter is None:
            return ("ensemble", "reference")
        if self.navigation.filter.kind != EKF:
            return ("ensemble", "reference")
        if self.navigation.filter.smoothed:
            return ("shared-gains", "ensemble", "reference")
        return ("ensemble", "shared-gains", "reference")

    @property
    def sources(self) -> tuple[Source, ...]:
        """Constant errors: initial ones, those of the instruments, those of the sensors."""
        return SOURCES + aiding_sources(self.navigation.sensors)

    @property
    def processes(self) -> tuple[Output, ...]:
        """Processes of the noise that the instruments, gravity and the sensors have."""
        sizes = process_sizes(self.navigation.imu)
        instruments = tuple(process for process in NOISE if process.name in sizes)
        return instruments + aiding_outputs(self.navigation.sensors)

    def with_filter(self, model: FilterModel, sigmas: Mapping[str, float] | None = None) -> Ins:
        """Return the same scenario with a filter, and the true root mean squares of the constant sources."""
        return Ins(replace(self.navigation, filter=model, sigmas=sigmas or {}), self.remarks)

    @property
    def filter_schema(self) -> FilterSchema | None:
        """Columns of the filters' records."""
        navigation = self.navigation
        if navigation.filter is None:
            return None
        known: list[Source | Output] = [
            *self.sources, *NOISE, *GRAVITY, *aiding_outputs(navigation.filter.beliefs.sensors),
            *flexure_rates(navigation.filter.beliefs.sensors),
        ]  # fmt: skip
        units = {source.name: (source.unit, source.shown_in) for source in known}
        return filter_schema(navigation.sensors, navigation.filter, units)

    def filter_prediction(self) -> FilterPrediction | None:
        """Compute what linear analysis says of the filter at the epochs."""
        navigation = self.navigation
        if navigation.aided is None or navigation.filter is None:
            return None
        linear = navigation.aided.linear
        return FilterPrediction(
            navigation.clock.label,
            navigation.epochs.times,
            linear.own,
            linear.own_variances,
            linear.state_partials,
            linear.state_variances,
            self._believed,
        )

    @property
    def _believed(self) -> dict[str, float]:
        """Variance that the filter believes of each cause, over its true mean square."""
        navigation = self.navigation
        if navigation.filter is None:
            return {}
        return believed_shares(navigation.imu, navigation.sensors, navigation.filter, navigation.sigmas)

    @property
    def logs(self) -> dict[str, MeasurementFile]:
        """Files of the recorded sensors, by name."""
        return {sensor.name: sensor.log for sensor in self.navigation.sensors if sensor.log is not None}

    @property
    def start_level(self) -> tuple[float, float]:
        """Roll and pitch where navigation starts, rad."""
        ((_, pitch, roll),) = self.navigation.truth.angles(np.array([self.navigation.start])).tolist()
        return roll, pitch

    def filter_recording(self, recording: Recording, mean: Array, covariance: Array) -> FilteredRecord:
        """Take the filter through a recorded flight; mean and covariance are those of the true sources."""
        from mcnav.systems.ins.recorded.navigation import (
            filter_recording,
        )  # recordings and the reference engine's parts

        processes = (*NOISE, *aiding_outputs(self.navigation.sensors))
        return filter_recording(self.navigation.aided, self.sources, processes, recording, mean, covariance)

    def simulate_recording(self, errors: Array, seed: int, index: int, interval: float) -> Recording:
        """Record one sample, shape (sources,), with readings over intervals, s."""
        from mcnav.systems.ins.recorded.navigation import record_sample

        return record_sample(self.navigation.aided, errors, seed, index, interval)

    def linear(self, times: Array | None = None) -> LinearSystem:
        """Linearize at the epochs after their updates, or at rising times of the trajectory, s.

        By the variational equations. With the epochs as times, there are readings before updates as well.
        """
        navigation = self.navigation
        if times is None:
            linear = navigation.linear
            zero = np.zeros(linear.partials.shape[:2])
            nominal = zero if navigation.aided is None else navigation.aided.linear.nominal
            epochs = navigation.epochs.times
            return LinearSystem(epochs, linear.partials, nominal, linear.processes, label=navigation.clock.label)
        self.check_within(times)
        own = tuple(range(len(OUTPUTS)))
        epochs_alone = np.array_equal(times, navigation.times)
        if navigation.aided is not None:
            updates, closed = navigation.aided.read_out(None if epochs_alone else times)
            return LinearSystem(
                closed.times,
                closed.partials,
                closed.nominal,
                closed.processes,
                updates,
                closed.own,
                own,
                TRAJECTORY_TIME,
                self._believed,
            )
        linear = navigation.linear
        if not epochs_alone:
            grid = np.union1d(navigation.times, times)
            responses = Responses(navigation.truth, navigation.platform, grid, navigation.imu)
            linear = free_errors(navigation.truth, responses, navigation.imu, np.searchsorted(grid, times))
        nominal = np.zeros(linear.partials.shape[:2])
        return LinearSystem(linear.times, linear.partials, nominal, linear.processes, label=TRAJECTORY_TIME)

    def smoothed(self, times: Array | None = None) -> LinearSystem:
        """Linearize the errors behind the smoother at the readings that `linear` has at these times."""
        navigation = self.navigation
        if navigation.aided is None:
            raise ScenarioError(
                "filter", "there is no filter that a smoother could follow; add [[aiding]] and [filter]"
            )
        own = tuple(range(len(OUTPUTS)))
        if times is None:
            errors = navigation.aided.smoothed_at_epochs
            return LinearSystem(
                navigation.epochs.times, errors.partials, errors.nominal, errors.processes, own=errors.own,
                own_outputs=own, label=navigation.clock.label, believed=self._believed,
            )  # fmt: skip
        self.check_within(times)
        updates, errors = navigation.aided.smoothed(None if np.array_equal(times, navigation.times) else times)
        return LinearSystem(
            errors.times, errors.partials, errors.nominal, errors.processes, updates, errors.own, own, TRAJECTORY_TIME,
            self._believed,
        )  # fmt: skip

    @property
    def gate_question(self) -> GateQuestion:
        """Question that is asked of the sensors' gates."""
        filtered = self.navigation.filter
        return USUAL if filtered is None else filtered.question

    def gate_laws(self, mean: Array, covariance: Array) -> tuple[GateLaw, ...]:
        """Compute the laws of the sensors' gates; none without any."""
        gated = self._gated(mean, covariance)
        return () if gated is None else gate_laws(gated, self.gate_question.ramp)

    def fault_laws(self, mean: Array, covariance: Array) -> tuple[FaultLaw, ...]:
        """Compute the laws of the sensors' faults; none without any."""
        gated = self._gated(mean, covariance)
        return () if gated is None else fault_laws(gated)

    def rejection_laws(self, mean: Array, covariance: Array, times: Array) -> RejectionLaws | None:
        """Compute the laws of good measurements that gates reject, with errors at epochs; none without any."""
        gated = self._gated(mean, covariance)
        if gated is None:
            return None
        instants = gated.timeline.instants
        return rejection_laws(gated, times, instants.after[np.searchsorted(instants.times, times - 1e-9)])

    def _gated(self, mean: Array, covariance: Array) -> GatedFilter | None:
        """Return the filter with its gates for errors of a mean and a covariance; none without aiding."""
        aided = self.navigation.aided
        if aided is None:
            return None
        sensors = tuple(
            GatedSensor(sensor.name, tuple(map(_described, sensor.components)), sensor.gate, sensor.faults)
            for sensor in aided.sensors
        )
        loop = aided.loop
        updates = loop.schedule
        return GatedFilter(loop.timeline, loop.designed, sensors, updates.order, updates.times, mean, covariance)

    def with_epochs(self, times: tuple[float, ...]) -> Self:
        """Return the same with further epochs, s."""
        return type(self)(replace(self.navigation, further=times), self.remarks)

    def with_processes_together(self) -> Self:
        """Return the same whose linear covariances over time have all processes together, where that takes less."""
        return type(self)(replace(self.navigation, together=True), self.remarks)

    def check_within(self, times: Array) -> None:
        """Refuse times outside of the navigation with `ScenarioError`."""
        navigation = self.navigation
        for time in times:
            if not navigation.start <= time <= navigation.end:
                raise ScenarioError(
                    "end",
                    f"got {time:g} s to look at; navigation lasts from {navigation.start:g} to {navigation.end:g} s",
                )

    @property
    def outages(self) -> tuple[tuple[float, float], ...]:
        """Outages of the sensors that begin or end within the navigation, s."""
        navigation = self.navigation
        outages = {outage for sensor in navigation.sensors for outage in sensor.outages}
        return tuple(
            (begin, end) for begin, end in sorted(outages) if begin <= navigation.end and end > navigation.start
        )

    @property
    def reading_times(self) -> Array:
        """The epochs, the end last, s."""
        return self.navigation.times

    def covariance_readings(self, questions: Sequence[CovarianceQuestion]) -> list[CovarianceReadings]:
        """Propagate mean and covariance of the sources to rising times of the trajectory, s, after their updates."""
        asked = []
        for question in questions:
            assert isinstance(question.scenario, Ins)
            question.scenario.check_within(question.times)
            asked.append(question.scenario.navigated(question))
        return self._tunings.answer([self.navigated(question) for question in questions], asked)

    def navigated(self, question: CovarianceQuestion) -> Navigated:
        """Return this navigation with the times and errors of a question."""
        navigation, times = self.navigation, question.times
        grid = np.union1d(navigation.times, times)
        if navigation.aided is not None:
            grid = navigation.aided.grid(1, np.concatenate([[navigation.start], times]))
        return Navigated(
            navigation.truth, navigation.platform, grid, times, navigation.imu, navigation.sensors, navigation.filter,
            question.mean, question.covariance,
        )  # fmt: skip

    def linear_over_time(self, count: int | None = None) -> LinearSystem:
        """Return the linear system at the epochs, whatever the count."""
        return self.linear()

    def check_start_axes(self, axes: str) -> None:
        """Refuse recorded sensors, and axes of another time where instruments are not on an inertial platform."""
        navigation = self.navigation
        if self.logs:
            raise ScenarioError(
                "aiding", f"got a file of measurements of {min(self.logs)}; start times need sensors without a file"
            )
        if axes != "start" and navigation.platform != "inertial":
            raise ScenarioError(
                "axes",
                f"got {axes!r} with a {navigation.platform} navigator, whose axes do not depend on the start; "
                "expected 'start'",
            )

    def started_at(self, time: float, axes: str) -> Ins:
        """Start navigation along the same trajectory at another time, s.

        With the axes ``trajectory`` an inertial platform keeps the directions that it has with this scenario's own
        start: the truth's attitude is held there.
        """
        self.check_start_axes(axes)
        navigation = self.navigation
        first, last = navigation.truth.times[0], navigation.latest_start
        if not first <= time <= last:
            raise ScenarioError("start", f"got {time:g} s; navigation starts from {first:g} s to {last:g} s")
        truth = navigation.truth if axes == "start" else navigation.truth.held(navigation.start)
        sensors = tuple(sensor.since(time) for sensor in navigation.sensors)
        model = None if navigation.filter is None else navigation.filter.since(time)
        return Ins(replace(navigation, truth=truth, start=time, sensors=sensors, filter=model), self.remarks)

    def start_times(self, count: int) -> Array:
        """Space start times from the navigation's start to that of the shortest navigation, shape (count,), s."""
        return np.linspace(self.navigation.start, self.navigation.latest_start, count)

    def partials_at(self, times: Array, axes: str = "start") -> Array:
        """Compute the partial derivatives for navigation started at each time, shape (n, 9, sources)."""
        return self._started(times, axes).partials[:, :, :-1]

    def noise_at(self, times: Array, axes: str = "start") -> Array:
        """Compute the covariance from all processes for navigation started at each time, shape (n, 9, 9).

        Each process begins with the start: a bias instability is stationary there, a random walk is zero.
        """
        return np.asarray(self._started(times, axes).covariances.sum(axis=1))

    def _started(self, times: Array, axes: str) -> Propagated:
        """Propagate all starts, or return what the last call has for the same ones."""
        self.check_start_axes(axes)
        key = (axes, times.tobytes())
        if self._last_starts is None or self._last_starts[0] != key:
            navigation = self.navigation
            linear_starts = self._propagate_starts(times, None if axes == "start" else navigation.start)
            self._last_starts = (key, linear_starts)
        return self._last_starts[1]

    def _propagate_starts(self, times: Array, aligned: float | None) -> Propagated:
        """Propagate all starts; an inertial platform may keep the directions of one time, s."""
        navigation = self.navigation
        truth = navigation.truth if aligned is None else navigation.truth.held(aligned)
        # a platform whose directions depend on the start has tables of its own for each
        turns = navigation.platform == "inertial" and aligned is None
        groups = [times[[n]] for n in range(len(times))] if turns else [times]
        aided = replace(navigation, truth=truth).aided
        read = [
            free_starts(truth, navigation.platform, group, navigation.end, navigation.imu)
            if aided is None
            else aided.started(group, navigation.end)
            for group in groups
        ]
        return Propagated(
            np.concatenate([reading.partials for reading in read]),
            np.concatenate([reading.covariances for reading in read]),
        )

    def engine(self, engine: str, probes: Array) -> Engine:
        """Prepare one of the engines; the ensemble's steps are halved until the probes, (n, sources), agree."""
        aided, schema = self.navigation.aided, self.filter_schema
        if aided is not None:
            aided.check_steps()
        smoothed = self.navigation.filter is not None and self.navigation.filter.smoothed
        if smoothed and engine != "shared-gains":
            raise ScenarioError(
                "smoother", f'got engine = "{engine}"; samples are smoothed with "shared-gains"; leave out one of them'
            )
        if engine == "reference":
            if aided is not None and schema is not None:
                return AidedReferenceEngine(aided, schema)
            return ReferenceEngine(self.navigation)
        if aided is not None and schema is not None:
            shared, error = aided.refined(probes)
            gains = "gains of each sample's own"
            if engine == "shared-gains":
                apart = aided.difference_of_gains(shared, probes)
                gains = f"gains along the truth, which change errors by at most {apart:.1e} of the filter's sigma"
            known = (
                f"Largest numerical error of {min(len(probes), PROBES)} probe samples {error:.1e} of the filter's "
                "sigma or their own size"
                if np.isfinite(error)
                else "Numerical error not measured, as there are too many steps to halve them"
            )
            accuracy = f"deviations in inertial axes, {len(shared.ensemble.durations)} steps, {gains}. {known}"
            if not smoothed:
                return AidedEngine(aided, shared, schema, engine == "ensemble", accuracy)
            kept = 8 * (shared.white.size + 10 * len(self.navigation.times))
            accuracy = f"{accuracy}; for the smoother {kept / 1000.0:,.1f} kB of a sample are kept"
            return AidedEngine(aided, shared, schema, False, accuracy, smoothing=aided.smoother_tables(shared))
        tables, error = settle(self.navigation, probes, lambda: self._search(probes), self.navigation.tables)
        accuracy = (
            f"deviations in inertial axes, {len(tables.durations)} steps; largest numerical error of {len(probes)} "
            f"probe samples {error:.1e} of an output's dispersion"
        )
        return EnsembleEngine(self.navigation, tables, accuracy)

    def _search(self, probes: Array) -> tuple[int, EnsembleTables, float]:
        """Find the steps that the probes allow, their tables and their error; the method is of second order."""
        index, navigation = np.arange(len(probes)), self.navigation

        def flown(tables: EnsembleTables) -> Array:
            simulated = simulate(tables.without_noise(), probes, 0, index)
            return np.asarray(np.where(simulated.valid[:, None, None], simulated.values, 0.0))

        steps = 1
        tables = navigation.tables(steps)
        coarse = flown(tables)
        while True:
            finer = navigation.tables(2 * steps)
            fine = flown(finer)
            scale = fine.std(axis=0) if len(probes) >= FEWEST_PROBES else np.abs(fine).max(axis=0, initial=0.0)
            shares = np.abs(coarse - fine).max(axis=0, initial=0.0)[scale > 0.0] / scale[scale > 0.0]
            error = float(shares.max(initial=0.0)) / 3.0  # of the finer one
            if 4.0 * error <= TOLERANCE:
                return steps, tables, 4.0 * error
            if error <= TOLERANCE or 2 * steps >= MOST_STEPS:
                return 2 * steps, finer, error
            wanted = 2 * steps * 2 ** max(0, int(np.ceil(0.5 * np.log2(error / TOLERANCE))) - 1)
            steps = min(wanted, MOST_STEPS // 2)
            tables = finer if wanted == 2 * steps else navigation.tables(steps)
            coarse = flown(tables)

    def nominal(self) -> History:
        """Tabulate track, altitude, speed, attitude, force and rate of the truth against time."""
        navigation, truth, clock = self.navigation, self.navigation.truth, self.navigation.clock
        times = np.linspace(navigation.start, navigation.end, HISTORY_POINTS)
        states = truth.states(times, navigation.platform, navigation.start)
        latitude, longitude, altitude = truth.geodetic(times).T
        _, velocity = truth.earth_fixed(times)
        heading, pitch, roll = np.degrees(truth.angles(times)).T
        columns = {
            clock.label: clock.read(times),
            "latitude [deg]": np.degrees(latitude),
            "longitude [deg]": np.degrees(np.unwrap(longitude)),
            "altitude [m]": altitude,
            "speed [m/s]": np.linalg.norm(velocity, axis=1),
            "heading [deg]": np.degrees(np.unwrap(np.radians(heading))),
            "pitch [deg]": pitch,
            "roll [deg]": roll,
            "specific force [g]": np.linalg.norm(states.force, axis=1) / STANDARD_GRAVITY,
            "angular rate [deg/s]": np.degrees(np.linalg.norm(states.rate, axis=1)),
        }
        outages = {
            sensor.name: tuple((clock.read(begin), clock.read(end)) for begin, end in sensor.outages)
            for sensor in navigation.sensors if sensor.outages
        }  # fmt: skip
        return History(columns, {"end": clock.read(navigation.end)}, _panels(clock.label), outages)


def _panels(time: str) -> tuple[Panel, ...]:
    """Return the diagrams of the nominal flight, over a column of times."""
    return (
        Panel("Ground track", "longitude [deg]", ("latitude [deg]",)),
        Panel("Altitude", time, ("altitude [m]",)),
        Panel("Speed over the earth", time, ("speed [m/s]",)),
        Panel("Heading", time, ("heading [deg]",)),
        Panel("Roll and pitch", time, ("roll [deg]", "pitch [deg]"), ("roll", "pitch"), "angle [deg]"),
        Panel("Specific force", time, ("specific force [g]",)),
    )
