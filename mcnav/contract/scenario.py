"""Interface of a scenario: a system whose error propagation is studied, and what only some can do."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol, Self, TypeGuard

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.engine import Engine
from mcnav.contract.errors import ScenarioError as ScenarioError
from mcnav.contract.filter_record import FilterPrediction, FilterSchema
from mcnav.contract.gates import FaultLaw, GateLaw, GateQuestion, RejectionLaws
from mcnav.contract.history import History, StartClock
from mcnav.contract.linear import CovarianceReadings, LinearSystem
from mcnav.contract.quantities import Output, Source
from mcnav.contract.questions import Question, TimelineParts, reason_against
from mcnav.contract.recorded import FilteredRecord, MeasurementFile, Recording


class Capability(StrEnum):
    """A capability of a scenario besides those of every one, which its timeline does not tell."""

    COVARIANCE = "covariance"
    """Its covariance is known at any time, for less than it takes by cause."""

    REPLAY = "replay"
    """It can show one sample from beginning to end by itself, and not at its engine's epochs alone."""

    TRAJECTORY = "trajectory"
    """It navigates along a trajectory, which can be shown and recorded, and its filter takes recorded readings."""

    GATES = "gates"
    """Its filter has gates, or its sensors have faults, of which linear analysis is known."""

    USER_CODE = "user code"
    """It runs code that may end the process."""

    DIFFERENCED = "differenced"
    """Its derivatives are differences of whole simulations, and have to be examined."""


class PlainScenario(Protocol):
    """Defaults of a scenario: it has no epochs, no noise, no filter and no further start.

    Attributes
    ----------
    further_epochs : tuple of float
        Those of its epochs that requirements have added, s.
    """

    further_epochs: tuple[float, ...] = ()

    @property
    def can(self) -> frozenset[Capability]:
        """Capabilities."""
        return frozenset()

    @property
    def parts(self) -> TimelineParts:
        """Parts of its timeline."""
        return TimelineParts()

    @property
    def processes(self) -> tuple[Output, ...]:
        """Processes of its noise at present, by name."""
        return ()

    @property
    def noisy(self) -> bool:
        """True where it has noise at present."""
        return bool(self.processes)

    @property
    def reading_times(self) -> Array:
        """The epochs at which errors are known, the end last, s; empty where they are known at the end alone."""
        return np.zeros(0)

    def with_epochs(self, times: tuple[float, ...]) -> Self:
        """Return the same with further epochs, s; itself where the system's own are all that can be known."""
        return self

    def with_processes_together(self) -> Self:
        """Return the same whose linear covariances over time have all processes together, where that takes less."""
        return self

    @property
    def outages(self) -> tuple[tuple[float, float], ...]:
        """Intervals in which a sensor is silent: begin, included, and end, s."""
        return ()

    @property
    def filter_schema(self) -> FilterSchema | None:
        """Columns of a record of its filter; none when there is no filter at present."""
        return None

    def filter_prediction(self) -> FilterPrediction | None:
        """Compute what linear analysis says of the filter at the epochs; none when there is no filter."""
        return None

    def remarks_on(self, mean: Array, covariance: Array) -> tuple[str, ...]:
        """Say what is to be noticed with errors of this mean and covariance, a clause each, without a full stop."""
        return ()

    def keeping(self, engine: Engine, seconds: float) -> Engine:
        """Return an engine of the scenario whose simulations are kept for other commands, where they can be.

        Others raise `TooLong` where they take more seconds.
        """
        return engine

    def smoothed(self, times: Array | None = None) -> LinearSystem:
        """Linearize the errors behind the smoother, at the readings of `linear`; `own` is what it claims."""
        raise self._unknown("filter", Question.SMOOTHER)

    @property
    def start_clock(self) -> StartClock:
        """Origin and label of its start times."""
        return StartClock("s")

    def check_start_axes(self, axes: str) -> None:
        """Raise `ScenarioError` when the start cannot be chosen, or not with this convention of the reference axes."""
        raise self._unknown("start_times", Question.START_TIMES)

    def started_at(self, time: float, axes: str) -> Scenario:
        """Return the same scenario with navigation started at another time, or raise `ScenarioError`."""
        raise self._unknown("start_times", Question.START_TIMES)

    def start_times(self, count: int) -> Array:
        """Evenly spaced start times from the first possible one on, shape (count,), s by the scenario's own clock."""
        raise self._unknown("start_times", Question.START_TIMES)

    def partials_at(self, times: Array, axes: str) -> Array:
        """Partial derivatives for navigation started at each time, shape (n, outputs, sources)."""
        raise self._unknown("start_times", Question.START_TIMES)

    def noise_at(self, times: Array, axes: str) -> Array:
        """Covariance of the final errors from noise, for navigation started at each time, (n, outputs, outputs)."""
        raise self._unknown("start_times", Question.START_TIMES)

    def _unknown(self, key: str, question: Question) -> ScenarioError:
        return ScenarioError(key, reason_against(question, self.parts))


class Scenario(PlainScenario, Protocol):
    """A system whose error propagation is studied; of `PlainScenario` it states what it has."""

    @property
    def sources(self) -> tuple[Source, ...]:
        """Errors going in, in the order of the columns of P."""

    @property
    def outputs(self) -> tuple[Output, ...]:
        """Errors coming out, in the order of the rows of P."""

    @property
    def engines(self) -> tuple[str, ...]:
        """Names of its engines, the default first."""

    def engine(self, engine: str, probes: Array) -> Engine:
        """Prepare one engine; its accuracy is settled on probe samples, shape (n, sources)."""

    def linear(self, times: Array | None = None) -> LinearSystem:
        """Linearize about the truth: at the end, which is the last of the times.

        Times, rising, s, may be given where it can be read out at any time; before and after updates that fall on
        them. `ScenarioError` outside of the flight.
        """

    def linear_over_time(self, count: int | None = None) -> LinearSystem:
        """Linearize after updates at about so many rising times, by default its epochs; or at the end alone."""

    def nominal(self) -> History:
        """Return the truth over time."""


class GatedScenario(Scenario, Protocol):
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


@dataclass(frozen=True)
class CovarianceQuestion:
    """Question about a variation of a scenario, of the same class.

    Attributes
    ----------
    times : ndarray
        Rising, s.
    mean, covariance : ndarray, shapes (sources,), (sources, sources)
        Of the sources.
    """

    scenario: Scenario
    times: Array
    mean: Array
    covariance: Array


class CovarianceScenario(Scenario, Protocol):
    """A scenario that knows its `COVARIANCE`."""

    def covariance_readings(self, questions: Sequence[CovarianceQuestion]) -> list[CovarianceReadings]:
        """Propagate mean and covariance of the sources of variations of this scenario, after updates.

        Each answer has the bits that it has beside any other questions. Variations in sizes of errors cost a fraction
        of others. `ScenarioError` outside of the flight.
        """


class Replayable(Scenario, Protocol):
    """A scenario with `REPLAY`."""

    def simulate_one(self, errors: Array) -> History:
        """One sample, shape (sources,), by the reference engine to its end, or to where it failed."""


class RecordingScenario(Scenario, Protocol):
    """A scenario with a `TRAJECTORY`."""

    @property
    def logs(self) -> Mapping[str, MeasurementFile]:
        """Files of the recorded sensors, by name."""

    @property
    def start_level(self) -> tuple[float, float]:
        """Roll and pitch where navigation starts, rad."""

    def filter_recording(self, recording: Recording, mean: Array, covariance: Array) -> FilteredRecord:
        """Take the filter through a recorded flight, whose errors have a mean and a covariance; or `RecordingError`."""

    def simulate_recording(self, errors: Array, seed: int, index: int, interval: float) -> Recording:
        """Record one sample, shape (sources,), with readings over intervals, s."""


def knows_covariance(scenario: Scenario) -> TypeGuard[CovarianceScenario]:
    """Return whether the covariance is known at any time without that of each cause."""
    return Capability.COVARIANCE in scenario.can


def has_gates(scenario: Scenario) -> TypeGuard[GatedScenario]:
    """Return whether linear analysis of gates and faults is known."""
    return Capability.GATES in scenario.can


def can_replay(scenario: Scenario) -> TypeGuard[Replayable]:
    """Return whether one sample can be shown from beginning to end."""
    return Capability.REPLAY in scenario.can


def can_be_recorded(scenario: Scenario) -> TypeGuard[RecordingScenario]:
    """Return whether a filter can be taken through recorded flights."""
    return Capability.TRAJECTORY in scenario.can


def runs_user_code(scenario: Scenario) -> bool:
    """Return whether a scenario runs code of the user's."""
    return Capability.USER_CODE in scenario.can


def is_differenced(scenario: Scenario) -> bool:
    """Return whether derivatives are differences of whole simulations."""
    return Capability.DIFFERENCED in scenario.can
