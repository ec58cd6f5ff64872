"""Interface of an engine, which simulates samples."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from mcnav._types import Array
from mcnav.contract.filter_record import FilterSchema
from mcnav.contract.history import Epochs
from mcnav.contract.power_sums import PowerSums
from mcnav.contract.samples import Batch, SimulationResult


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
