"""Interface of a scenario: a system whose error propagation is studied, and what only some can do."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from typing import Protocol, TypeGuard

from mcnav._types import Array
from mcnav.contract.engine import Engine
from mcnav.contract.errors import ScenarioError as ScenarioError
from mcnav.contract.filter_record import FilterPrediction, FilterSchema
from mcnav.contract.gates import FaultLaw, GateLaw, GateQuestion, RejectionLaws
from mcnav.contract.history import History, StartClock
from mcnav.contract.linear import CovarianceReadings, LinearSystem, SharedTables
from mcnav.contract.quantities import Output, Source
from mcnav.contract.recorded import FilteredRecord, MeasurementFile, Recording


class Capability(StrEnum):
    """A capability of a scenario besides those of every one."""

    NOISE = "noise"
    """Its samples may have noise: they come with their linear outcome, and it names its processes."""

    FILTER = "filter"
    """It may have a filter, which states a covariance of its own."""

    LINEAR_OVER_TIME = "linear over time"
    """Its linear system is known throughout the flight."""

    LINEAR_AT_ANY_TIME = "linear at any time"
    """Its linear system can be read out at any time, before and after updates."""

    COVARIANCE = "covariance"
    """Its covariance is known at any time, for less than it takes by cause."""

    START_TIMES = "start times"
    """Its navigation may start at any time of its flight."""

    EPOCHS = "epochs"
    """Errors are known at epochs in time, so that a requirement may name a time."""

    UPDATES = "updates"
    """Its linear system is known before and after updates at its epochs."""

    REPLAY = "replay"
    """It can show one sample from beginning to end."""

    TRAJECTORY = "trajectory"
    """It navigates along a trajectory that can be shown by itself."""

    RECORDING = "recording"
    """Its filter can be taken through recorded readings and measurements, and its samples can be recorded."""

    REMARKS = "remarks"
    """It notices where its linear model or its samples are not to be relied on."""

    SMOOTHER = "smoother"
    """Its filter is followed by a smoother, of which linear analysis is known."""

    GATES = "gates"
    """Its filter has gates, or its sensors have faults, of which linear analysis is known."""

    USER_CODE = "user code"
    """It runs code that may end the process."""

    DIFFERENCED = "differenced"
    """Its derivatives are differences of whole simulations, and have to be examined."""


class Scenario(Protocol):
    """A system whose error propagation is studied."""

    @property
    def sources(self) -> tuple[Source, ...]:
        """Errors going in, in the order of the columns of P."""

    @property
    def outputs(self) -> tuple[Output, ...]:
        """Errors coming out, in the order of the rows of P."""

    @property
    def engines(self) -> tuple[str, ...]:
        """Names of its engines, the default first."""

    @property
    def can(self) -> frozenset[Capability]:
        """Capabilities besides."""

    def engine(self, engine: str, probes: Array) -> Engine:
        """Prepare one engine; its accuracy is settled on probe samples, shape (n, sources)."""

    def linear(self, times: Array | None = None) -> LinearSystem:
        """Linearize about the truth: at the end, which is the last of the times.

        Times, rising, s, may be given where it can be read out `LINEAR_AT_ANY_TIME`; `ScenarioError` outside of the
        flight.
        """

    def nominal(self) -> History:
        """Return the truth over time."""


class NoisyScenario(Scenario, Protocol):
    """A scenario that can have `NOISE`."""

    @property
    def processes(self) -> tuple[Output, ...]:
        """Processes of its noise, by name; none when it has none at present."""

    @property
    def noisy(self) -> bool:
        """True where it has noise at present."""


class FilterScenario(Scenario, Protocol):
    """A scenario that can have a `FILTER`."""

    @property
    def filter_schema(self) -> FilterSchema | None:
        """Columns of a record; none when there is no filter at present."""

    def filter_prediction(self) -> FilterPrediction | None:
        """Compute what linear analysis says of the filter at the epochs; none when there is no filter."""


class LinearOverTime(Scenario, Protocol):
    """A scenario that is `LINEAR_OVER_TIME`."""

    def linear_over_time(self, count: int) -> LinearSystem:
        """Linearize at so many rising times, from the start to the end."""


class EpochScenario(LinearOverTime, Protocol):
    """A scenario with `EPOCHS`."""

    @property
    def reading_times(self) -> Array:
        """The scenario's epochs, the end last, s."""

    @property
    def outages(self) -> tuple[tuple[float, float], ...]:
        """Intervals in which a sensor is silent: begin, included, and end, s."""


class ScenarioWithUpdates(EpochScenario, Protocol):
    """A scenario with `UPDATES`."""

    def linear_around_updates(self) -> LinearSystem:
        """Linearize at all epochs, before and after updates and corrections, with what a filter states."""


class LinearAtAnyTime(LinearOverTime, Protocol):
    """A scenario that is `LINEAR_AT_ANY_TIME`: at the times that `linear` is given, s by its own clock."""


class SmoothedScenario(EpochScenario, Protocol):
    """A scenario with a `SMOOTHER`."""

    def smoothed(self, times: Array | None = None) -> LinearSystem:
        """Linearize the errors behind the smoother, at the readings of `linear`; `own` is what it claims."""


class GatedScenario(EpochScenario, Protocol):
    """A scenario with `GATES`."""

    @property
    def gate_question(self) -> GateQuestion:
        """Question that is asked of the gates."""

    def gate_laws(self, mean: Array, covariance: Array) -> tuple[GateLaw, ...]:
        """Compute the laws of the gates for errors of this mean and covariance, and for ramps as they are asked for."""

    def fault_laws(self, mean: Array, covariance: Array) -> tuple[FaultLaw, ...]:
        """Compute the laws of the faults for errors of this mean and covariance."""

    def rejection_laws(self, mean: Array, covariance: Array, times: Array) -> RejectionLaws | None:
        """Compute the laws of good measurements that are rejected, with errors at epochs, s; none without a gate."""


class CovarianceScenario(EpochScenario, Protocol):
    """A scenario that knows its `COVARIANCE`."""

    def covariance_readings(
        self, times: Array, mean: Array, covariance: Array, shared: SharedTables
    ) -> CovarianceReadings:
        """Propagate mean and covariance of the sources to rising times, s; `ScenarioError` outside of the flight."""


class VariableStart(Scenario, Protocol):
    """A scenario with `START_TIMES`."""

    @property
    def start_clock(self) -> StartClock:
        """Origin and label of its start times."""

    def check_start_axes(self, axes: str) -> None:
        """Raise `ScenarioError` when the start cannot be chosen, or not with this convention of the reference axes."""

    def started_at(self, time: float, axes: str) -> Scenario:
        """Return the same scenario with navigation started at another time, or raise `ScenarioError`."""

    def start_times(self, count: int) -> Array:
        """Evenly spaced start times from the first possible one on, shape (count,), s by the scenario's own clock."""

    def partials_at(self, times: Array, axes: str) -> Array:
        """Partial derivatives for navigation started at each time, shape (n, outputs, sources)."""


class NoisyStart(VariableStart, Protocol):
    """A scenario with `START_TIMES` and `NOISE`."""

    def noise_at(self, times: Array, axes: str) -> Array:
        """Covariance of the final errors from noise, for navigation started at each time, (n, outputs, outputs)."""


class Replayable(Scenario, Protocol):
    """A scenario with `REPLAY`."""

    def simulate_one(self, errors: Array) -> History:
        """One sample, shape (sources,), by the reference engine to its end, or to where it failed."""


class RecordingScenario(FilterScenario, Protocol):
    """A scenario with `RECORDING`."""

    @property
    def logs(self) -> Mapping[str, MeasurementFile]:
        """Files of the recorded sensors, by name."""

    def filter_recording(self, recording: Recording, mean: Array, covariance: Array) -> FilteredRecord:
        """Take the filter through a recorded flight, whose errors have a mean and a covariance; or `RecordingError`."""

    def simulate_recording(self, errors: Array, seed: int, index: int, interval: float) -> Recording:
        """Record one sample, shape (sources,), with readings over intervals, s."""


class RemarkingScenario(Scenario, Protocol):
    """A scenario with `REMARKS`."""

    def remarks_on(self, mean: Array, covariance: Array) -> tuple[str, ...]:
        """Say what is to be noticed with errors of this mean and covariance, a clause each, without a full stop."""


def remarks_of(scenario: Scenario, mean: Array, covariance: Array) -> tuple[str, ...]:
    """Return what a scenario notices of itself with errors of this mean and covariance; nothing where it cannot."""
    return scenario.remarks_on(mean, covariance) if can_remark(scenario) else ()


def can_remark(scenario: Scenario) -> TypeGuard[RemarkingScenario]:
    """Return whether a scenario notices where its linear model or its samples are not to be relied on."""
    return Capability.REMARKS in scenario.can


def can_have_noise(scenario: Scenario) -> TypeGuard[NoisyScenario]:
    """Return whether the samples of a scenario may have noise."""
    return Capability.NOISE in scenario.can


def can_have_filter(scenario: Scenario) -> TypeGuard[FilterScenario]:
    """Return whether a scenario may have a filter."""
    return Capability.FILTER in scenario.can


def is_linear_over_time(scenario: Scenario) -> TypeGuard[LinearOverTime]:
    """Return whether the linear system is known throughout the flight."""
    return Capability.LINEAR_OVER_TIME in scenario.can


def is_linear_at_any_time(scenario: Scenario) -> TypeGuard[LinearAtAnyTime]:
    """Return whether the linear system can be read out at any time."""
    return Capability.LINEAR_AT_ANY_TIME in scenario.can


def knows_covariance(scenario: Scenario) -> TypeGuard[CovarianceScenario]:
    """Return whether the covariance is known at any time without that of each cause."""
    return Capability.COVARIANCE in scenario.can


def has_smoother(scenario: Scenario) -> TypeGuard[SmoothedScenario]:
    """Return whether the filter of a scenario is followed by a smoother."""
    return Capability.SMOOTHER in scenario.can


def has_gates(scenario: Scenario) -> TypeGuard[GatedScenario]:
    """Return whether linear analysis of gates and faults is known."""
    return Capability.GATES in scenario.can


def has_start_times(scenario: Scenario) -> TypeGuard[VariableStart]:
    """Return whether navigation may start at any time."""
    return Capability.START_TIMES in scenario.can


def has_noisy_start_times(scenario: Scenario) -> TypeGuard[NoisyStart]:
    """Return whether navigation with noise may start at any time."""
    return {Capability.START_TIMES, Capability.NOISE} <= scenario.can


def has_epochs(scenario: Scenario) -> TypeGuard[EpochScenario]:
    """Return whether errors are known at epochs in time."""
    return Capability.EPOCHS in scenario.can


def has_updates(scenario: Scenario) -> TypeGuard[ScenarioWithUpdates]:
    """Return whether its linear system is known before and after updates at its epochs."""
    return Capability.UPDATES in scenario.can


def can_replay(scenario: Scenario) -> TypeGuard[Replayable]:
    """Return whether one sample can be shown from beginning to end."""
    return Capability.REPLAY in scenario.can


def can_be_recorded(scenario: Scenario) -> TypeGuard[RecordingScenario]:
    """Return whether a filter can be taken through recorded flights."""
    return Capability.RECORDING in scenario.can


def runs_user_code(scenario: Scenario) -> bool:
    """Return whether a scenario runs code of the user's."""
    return Capability.USER_CODE in scenario.can


def is_differenced(scenario: Scenario) -> bool:
    """Return whether derivatives are differences of whole simulations."""
    return Capability.DIFFERENCED in scenario.can
