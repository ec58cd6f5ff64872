"""Interface of a scenario: a system whose error propagation is studied."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from mcnav._types import Array
from mcnav.contract.engine import Engine
from mcnav.contract.filter_record import FilterPrediction, FilterSchema
from mcnav.contract.history import History, StartClock
from mcnav.contract.linear import CovarianceReadings, LinearModel, LinearReadings, PartialsHistory, SharedTables
from mcnav.contract.quantities import Output, Source


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
        """Names of the ways to fly, the default first."""

    def engine(self, engine: str, probes: Array) -> Engine:
        """Prepare one engine; its accuracy is settled on probe samples, shape (n, sources)."""

    def linear_model(self) -> LinearModel:
        """Partial derivatives by the scenario's best method."""

    def history(self) -> History:
        """Return the truth over time."""


@runtime_checkable
class VariableStart(Scenario, Protocol):
    """A scenario whose navigation may start at any time of its flight."""

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


@runtime_checkable
class NoisyStart(VariableStart, Protocol):
    """A scenario with noise whose navigation may start at any time of its flight."""

    def noise_at(self, times: Array, axes: str) -> Array:
        """Covariance of the final errors from noise, for navigation started at each time, (n, outputs, outputs)."""


@runtime_checkable
class HasPartialsHistory(Protocol):
    """A scenario that knows its partial derivatives not at the end alone, but throughout the flight."""

    def partials_history(self, count: int) -> PartialsHistory:
        """Partial derivatives at so many rising times, from the start to the end."""


@runtime_checkable
class HasLinearReadings(Protocol):
    """A scenario whose linear system can be read out at any time."""

    def linear_readings(self, times: Array | None) -> LinearReadings:
        """Read the linear system out at rising times, s, or at the scenario's epochs; `ScenarioError` outside."""


@runtime_checkable
class HasCovarianceReadings(Protocol):
    """A scenario whose covariance is known at any time, for less than it takes by cause."""

    @property
    def reading_times(self) -> Array:
        """The scenario's epochs, the end last, s."""

    def covariance_readings(
        self, times: Array, mean: Array, covariance: Array, shared: SharedTables
    ) -> CovarianceReadings:
        """Propagate mean and covariance of the sources to rising times, s; `ScenarioError` outside of the flight."""


@runtime_checkable
class Replayable(Protocol):
    """A scenario that can show one flight from beginning to end."""

    def simulate_one(self, errors: Array) -> History:
        """One sample, shape (sources,), flown by the reference engine to its end, or to where it failed."""


@runtime_checkable
class FilterScenario(Scenario, Protocol):
    """A scenario that may have a filter."""

    @property
    def filter_schema(self) -> FilterSchema | None:
        """Columns of a record; none when there is no filter."""

    def filter_prediction(self) -> FilterPrediction | None:
        """Compute what linear analysis says of the filter at the epochs; none when there is no filter."""


@runtime_checkable
class StochasticScenario(Scenario, Protocol):
    """A scenario with noise."""

    @property
    def processes(self) -> tuple[Output, ...]:
        """Processes of its noise, by name."""


class ScenarioError(ValueError):
    """A scenario that cannot be flown as described; `key` names the entry that would have to change."""

    def __init__(self, key: str, message: str) -> None:
        super().__init__(message)
        self.key = key
