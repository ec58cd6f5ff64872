"""Interface of a scenario to the rest of the program."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, Literal, Protocol, runtime_checkable

from mcnav._types import Array, IndexArray
from mcnav.physics.power_sums import PowerSums
from mcnav.scenarios.failure import Failure
from mcnav.scenarios.filter_record import FilterPrediction, FilterSchema


@dataclass(frozen=True)
class Source:
    """An error that goes in.

    Attributes
    ----------
    name : str
    unit : str
        SI unit of its values.
    shown_in : str
        Unit in which tables and reports show it.
    nominal : float
        A usual size, in the SI unit: the scale of the steps that differences take.
    later : bool
        Whether the scenario had other sources before this one: see `mcnav.sampling.error_model.ErrorModel`.
    group : str
        Sources that belong together; an entry of ``[errors]`` with this name holds for each.
    """

    name: str
    unit: str
    shown_in: str
    nominal: float
    later: bool = False
    group: str = ""


@dataclass(frozen=True)
class Output:
    """An error that comes out; name and units as those of `Source`.

    Attributes
    ----------
    limit : float, optional
        Size of the error, SI, beyond which the linear system that it belongs to has lost its meaning.
    """

    name: str
    unit: str
    shown_in: str
    limit: float | None = None


def source_labels(sources: Sequence[str], outputs: Sequence[str]) -> list[str]:
    """Name error sources for people.

    A source that shares its name with an output is an initial error of it; it is called so, to tell them apart.

    Parameters
    ----------
    sources, outputs : sequence of str
        Names, as files have them.

    >>> source_labels(["altitude", "gyro_drift"], ["altitude", "range"])
    ['initial altitude', 'gyro drift']
    """
    taken = {*sources, *outputs}

    def label(name: str) -> str:
        if name not in outputs:
            return name
        return f"initial_{name}" if f"initial_{name}" not in taken else f"{name}_(error source)"

    return [label(name).replace("_", " ") for name in sources]


@dataclass(frozen=True)
class Batch:
    """Samples to be simulated.

    Attributes
    ----------
    index : ndarray of int, shape (n,)
        Of each sample in its campaign: with the seed it is the key of the sample's noise.
    errors : ndarray, shape (n, sources)
        Constant errors, SI.
    seed : int
        Of the campaign.
    """

    index: IndexArray
    errors: Array
    seed: int

    def __getitem__(self, rows: slice | IndexArray) -> Batch:
        return Batch(self.index[rows], self.errors[rows], self.seed)


@dataclass(frozen=True)
class SimulationResult:
    """Final errors of some samples.

    Attributes
    ----------
    values : ndarray, shape (n, outputs)
        SI; a row that failed is NaN throughout.
    failures : mapping of int to Failure
        By row. A scenario of the user's own may give text in place of `Failure`.
    fallback_count : int
        Samples that left the fast engine's validity and were simulated on the reference path instead.
    linear_values : ndarray, shape (n, outputs), optional
        The same samples by the linear system, with the same noise; from an engine with noise alone.
    history : ndarray, shape (n, m, outputs), optional
        Errors at every epoch, from an engine with noise alone.
    filter_values : ndarray, shape (n, m, width), optional
        Records of the samples' filters at every epoch, from an engine with a filter alone; see `FilterSchema`.
    """

    values: Array
    failures: Mapping[int, Failure] = field(default_factory=dict)
    fallback_count: int = 0
    linear_values: Array | None = None
    history: Array | None = None
    filter_values: Array | None = None


@dataclass(frozen=True)
class LinearModel:
    """Final errors as a linear function of the errors going in, ``nominal + partials @ errors``, and of noise.

    Attributes
    ----------
    partials : ndarray, shape (outputs, sources)
        SI units: the matrix P of NASA TN D-1772, eq. (13).
    nominal : ndarray, shape (outputs,)
        Final errors of a system without errors.
    processes : mapping of str to ndarray, shape (outputs, outputs)
        Covariance that each process of noise adds, by name.
    """

    partials: Array
    nominal: Array
    processes: Mapping[str, Array] = field(default_factory=dict)


@dataclass(frozen=True)
class Panel:
    """One diagram of what was flown.

    Attributes
    ----------
    title : str
    x : str
        Column of the history along the axis.
    y : tuple of str
        Columns drawn; several share an axis.
    legend : tuple of str
        What each of several columns is called; by default its name.
    y_label : str
        Of that axis, as ``name [unit]``; by default the first column's.
    log : bool
        Whether the upward axis is logarithmic.
    from_zero : bool
        Whether the upward axis begins at zero.
    begin : float, optional
        Where in the first column (time) the diagram begins.
    marks : tuple of str
        Events shown as lines, where x is the first column.
    """

    title: str
    x: str
    y: tuple[str, ...]
    legend: tuple[str, ...] = ()
    y_label: str = ""
    log: bool = False
    from_zero: bool = False
    begin: float | None = None
    marks: tuple[str, ...] = ()


NOMINAL_FLIGHT: Final = "Nominal flight"


@dataclass(frozen=True)
class History:
    """Flight data for figures: named columns over time, and the diagrams that show them.

    Attributes
    ----------
    columns : mapping of str to ndarray
        Keyed ``name [unit]``; all of one length, the first being time.
    events : mapping of str to float
        Named instants, in the unit of the first column.
    panels : tuple of Panel
        None when there is nothing to show.
    outages : mapping of str to tuple of (float, float)
        Begin and end of the intervals in which an aiding sensor is silent, by its name, in the unit of the first
        column.
    title : str
        What the diagrams show.
    """

    columns: Mapping[str, Array] = field(default_factory=dict)
    events: Mapping[str, float] = field(default_factory=dict)
    panels: tuple[Panel, ...] = ()
    outages: Mapping[str, tuple[tuple[float, float], ...]] = field(default_factory=dict)
    title: str = NOMINAL_FLIGHT


@dataclass(frozen=True)
class PartialsHistory:
    """Partial derivatives of the errors at many times of one flight.

    Attributes
    ----------
    label : str
        What the times are, as ``name [unit]``.
    times : ndarray, shape (n,)
    partials : ndarray, shape (n, outputs, sources)
        SI.
    processes : mapping of str to ndarray, shape (n, outputs, outputs)
        Covariance that each process of noise has added, by name.
    """

    label: str
    times: Array
    partials: Array
    processes: Mapping[str, Array] = field(default_factory=dict)


@dataclass(frozen=True)
class LinearReadings:
    """The linear system read out at some times, r of them, before or after updates of aiding.

    Attributes
    ----------
    times : ndarray, shape (r,)
        In the scenario's own time.
    updates : tuple of str or None
        ``before`` or ``after`` where an update falls on the time.
    partials : ndarray, shape (r, outputs, sources)
    processes : mapping of str to ndarray, shape (r, outputs, outputs)
        Covariance that each process of noise has added, by name.
    own : ndarray, shape (r, outputs, outputs), optional
        Covariance that the navigator's filter states.
    label : str
        What the times are, as ``name [unit]``.
    believed : mapping of str to float
        As in `FilterPrediction`.
    """

    times: Array
    updates: tuple[Literal["before", "after"] | None, ...]
    partials: Array
    processes: Mapping[str, Array] = field(default_factory=dict)
    own: Array | None = None
    label: str = "time [s]"
    believed: Mapping[str, float] = field(default_factory=dict)


@dataclass
class SharedTables:
    """Tables of the last scenario that was read out, for the next one along the same truth; not for several threads."""

    tables: object = None


@dataclass(frozen=True)
class CovarianceReadings:
    """Mean and covariance of the errors by the linear system at some times, r of them, after updates of aiding.

    Attributes
    ----------
    times : ndarray, shape (r,)
        In the scenario's own time, s.
    mean : ndarray, shape (r, outputs)
    covariance : ndarray, shape (r, outputs, outputs)
    own : ndarray, shape (r, outputs, outputs), optional
        As the navigator's filter states it.
    """

    times: Array
    mean: Array
    covariance: Array
    own: Array | None = None


@dataclass(frozen=True)
class Epochs:
    """Instants of the flight at which errors are read out.

    Attributes
    ----------
    label : str
        What the times are, as ``name [unit]``.
    times : ndarray, shape (m,)
        Rising.
    events : mapping of str to float
        Named instants, in the same unit.
    """

    label: str
    times: Array
    events: Mapping[str, float] = field(default_factory=dict)


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


@dataclass(frozen=True)
class StartClock:
    """Origin and label of start times.

    Attributes
    ----------
    label : str
        Unit in which they are shown, such as ``min from reentry``.
    event : str
        What happens at time zero, up to which starts are compared; without an event all are.
    aligned : str
        Where reference axes that all starts share are aligned.
    """

    label: str
    event: str = ""
    aligned: str = "at the first point of the trajectory"


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


class Engine(Protocol):
    """One engine, ready to fly; it is sent to the workers and must survive pickling."""

    @property
    def parallel(self) -> str:
        """``threads`` when propagation runs free of the interpreter lock, else ``processes``."""

    @property
    def chunk(self) -> int:
        """Samples per chunk: part of the engine, never of the number of workers."""

    @property
    def accuracy(self) -> str:
        """Numerical error, in words for the report."""

    def propagate(self, errors: Array) -> SimulationResult:
        """Fly samples, shape (n, sources), SI."""


@runtime_checkable
class TimeHistoryEngine(Engine, Protocol):
    """An engine that knows the errors of its samples not at the end alone, but throughout the flight."""

    @property
    def epochs(self) -> Epochs:
        """When."""

    def histories(self, errors: Array) -> Array:
        """Errors at every epoch, shape (n, m, outputs), SI; NaN for a sample that cannot be followed."""

    def history_sums(self, errors: Array) -> PowerSums:
        """Power sums over the samples that can be followed, at every epoch; nothing is kept of a single sample."""


@runtime_checkable
class StochasticEngine(Engine, Protocol):
    """An engine whose samples have noise besides constant errors; `propagate` simulates without noise."""

    @property
    def epochs(self) -> Epochs:
        """Instants of the histories."""

    def simulate(self, batch: Batch) -> SimulationResult:
        """Simulate samples with noise of their own: final errors, linear ones, and histories."""


@runtime_checkable
class FilterEngine(StochasticEngine, Protocol):
    """An engine whose samples have a filter each; `SimulationResult.filter_values` are its records."""

    @property
    def filter_schema(self) -> FilterSchema | None:
        """Columns of the records; none when there is no filter."""


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
