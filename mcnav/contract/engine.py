"""Interface of an engine, which simulates samples."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, TypeGuard

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.filter_record import FilterSchema
from mcnav.contract.history import Epochs
from mcnav.contract.power_sums import PowerSums
from mcnav.contract.samples import Batch, SimulationResult


class Engine(Protocol):
    """One engine, prepared; it is sent to the workers and must survive pickling."""

    @property
    def parallel(self) -> str:
        """``threads`` when it runs free of the interpreter lock, else ``processes``."""

    @property
    def chunk(self) -> int:
        """Samples per chunk: part of the engine, never of the number of workers."""

    @property
    def accuracy(self) -> str:
        """Numerical error, in words for the report."""

    @property
    def epochs(self) -> Epochs | None:
        """Instants at which it knows the errors of its samples; none when it knows them at the end alone."""

    @property
    def noisy(self) -> bool:
        """True where samples have noise besides constant errors."""

    @property
    def filter(self) -> FilterSchema | None:
        """Columns of the records of its samples' filters (`SimulationResult.filter_values`); none without a filter."""

    def simulate(self, batch: Batch, noise: bool = True) -> SimulationResult:
        """Simulate samples, with their noise or without."""


class HistoryEngine(Engine, Protocol):
    """An engine that computes the errors at its epochs in a pass of their own, apart from the final ones."""

    def histories(self, errors: Array) -> Array:
        """Errors at every epoch, shape (n, m, outputs), SI; NaN for a sample that cannot be followed."""

    def history_sums(self, errors: Array) -> PowerSums:
        """Power sums over the samples that can be followed, at every epoch; nothing is kept of a single sample."""


class ScalableEngine(Engine, Protocol):
    """An engine whose noise can be multiplied."""

    def with_noise(self, multiple: float) -> Engine:
        """Return that of the final errors with so many times the noise.

        What a filter believes of errors and noise is multiplied alike, so that its gains are the same.
        """


class ConditionalNoise(Protocol):
    """Samples whose noise is given what it adds to m linear outcomes, and is random otherwise."""

    @property
    def factor(self) -> Array:
        """Additions of r standard normals of the noise to the outcomes, shape (m, r), SI."""

    def simulate(self, batch: Batch, normals: Array) -> SimulationResult:
        """Simulate samples with these normals, shape (n, r); with histories where outcomes are those of epochs."""


class ConditionalEngine(Engine, Protocol):
    """An engine that simulates samples under conditions on their noise."""

    def conditional_noise(self, outputs: tuple[int, ...], epochs: tuple[int, ...] | None = None) -> ConditionalNoise:
        """Return the samples with conditions on what noise adds to outputs, by number, at the end or at epochs.

        Each output has its epoch, by number, and those of an epoch follow each other; without epochs all are those of
        the end, and there are no histories. `ScenarioError` where what noise adds cannot be computed.
        """


def conditions_noise(engine: Engine) -> TypeGuard[ConditionalEngine]:
    """Return whether an engine simulates samples under conditions on their noise."""
    return engine.noisy and hasattr(engine, "conditional_noise")


def smoother_of(engine: Engine) -> FilterSchema | None:
    """Return the columns of the records of an engine's smoothers; none without smoothers."""
    return getattr(engine, "smoother", None)


def scales_noise(engine: Engine) -> TypeGuard[ScalableEngine]:
    """Return whether the noise of an engine can be multiplied."""
    return engine.noisy and hasattr(engine, "with_noise")


def has_histories(engine: Engine) -> TypeGuard[HistoryEngine]:
    """Return whether an engine computes the errors at its epochs in a pass of their own."""
    return engine.epochs is not None and hasattr(engine, "histories")


def without_noise(engine: Engine) -> Callable[[Array], SimulationResult]:
    """Return the simulation of errors alone, shape (n, sources), SI."""

    def simulate(errors: Array) -> SimulationResult:
        return engine.simulate(Batch(np.arange(len(errors)), errors, 0), noise=False)

    return simulate
