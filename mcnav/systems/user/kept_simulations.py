"""Simulations of a user's class that are kept (`mcnav.systems.user.kept`).

They are those for differences, sixteen for each source, and those that examine linear analysis.
"""

from __future__ import annotations

import hashlib
import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.caches.stored import Cache
from mcnav.contract.engine import Engine
from mcnav.contract.filter_record import FilterSchema
from mcnav.contract.history import Epochs
from mcnav.contract.samples import Batch, SimulationResult
from mcnav.execution.pace import measure_pace
from mcnav.execution.progress import TOGETHER, TooLong
from mcnav.systems.user.code import Loaded, UserScenarioSpec
from mcnav.systems.user.kept import KEPT_FROM, TOLD_FROM, KeptNumbers, Kind, keep

DIFFERENCES: Final = Kind(
    Cache("differences"), (), "simulating differences for partial derivatives",
    "these simulations were kept", "partial derivatives are computed anew",
)  # fmt: skip

FLIGHTS: Final = Kind(
    Cache("flights"), (), "simulating flights to examine linear analysis",
    "these flights were kept", "they are simulated again",
)  # fmt: skip

Simulate = Callable[[Array], tuple[SimulationResult, Array]]
"""Simulation of errors, shape (n, sources): final errors, and further numbers of them, shape (n, ...)."""


class _SomeFailed(Exception):
    """Raised with simulations of which some failed: they are not kept."""

    def __init__(self, result: SimulationResult, further: Array) -> None:
        self.simulated = result, further


def simulate_for_differences(
    loaded: Loaded, spec: UserScenarioSpec, simulate: Simulate, errors: Array, together: bool
) -> tuple[SimulationResult, Array]:
    """Simulate errors without noise, or return what an earlier command simulated of them.

    One more sample has each error at its largest. It is simulated alone, and repeated when the others are read.

    Parameters
    ----------
    together : bool
        Whether samples are simulated in one call.

    Raises
    ------
    ScenarioError
        When a file changes that the class reads.
    """
    largest = np.abs(errors).max(axis=0, keepdims=True)
    return _simulate_once(loaded, spec, DIFFERENCES, simulate, errors, largest, together)


def _simulate_once(
    loaded: Loaded,
    spec: UserScenarioSpec,
    kind: Kind,
    simulate: Simulate,
    errors: Array,
    repeated: Array,
    together: bool,
    allowed: float = math.inf,
) -> tuple[SimulationResult, Array]:
    """Simulate errors, or return what an earlier command simulated of them.

    Parameters
    ----------
    repeated : ndarray, shape (1, sources)
        Errors that are simulated alone, and again when the others are read.
    together : bool
        Whether samples are simulated in one call.
    allowed : float
        Seconds that simulations may take, by that one and a few others; more raise `TooLong`.
    """
    named = replace(kind, computed=(*kind.computed, hashlib.sha256(errors.tobytes()).hexdigest()))

    def alone() -> Array:
        result, further = simulate(repeated)
        return np.concatenate([result.values.ravel(), further.ravel()])

    def expected(first: float) -> float:
        """Return the time of all, s: by the first alone where that is short, or where a few would take as long."""
        if len(errors) * first < min(TOLD_FROM, allowed):
            return len(errors) * first
        if together and TOGETHER * first > KEPT_FROM:
            return TOGETHER * first
        return measure_pace(lambda count: simulate(errors[:count]), len(errors), together).seconds(len(errors))

    def compute() -> KeptNumbers:
        began = time.perf_counter()
        first = alone()
        seconds = expected(time.perf_counter() - began)
        if seconds > allowed:
            raise TooLong(seconds)
        named.tell(seconds)
        result, further = simulate(errors)
        if result.failures or result.fallback_count:
            raise _SomeFailed(result, further)
        return KeptNumbers((result.values, further, first))

    def repeats(kept: KeptNumbers) -> bool:
        return kept.arrays[2].tobytes() == alone().tobytes()

    try:
        values, further, _ = keep(loaded, spec, named, repeats, compute).arrays
    except _SomeFailed as failed:
        return failed.simulated
    return SimulationResult(values), further


@dataclass(frozen=True)
class KeptEngine:
    """An engine of a user's class whose simulations are kept.

    Attributes
    ----------
    seconds : float
        That simulations may take which are not kept; more raise `TooLong`.
    together : bool
        Whether samples are simulated in one call.
    """

    engine: Engine
    loaded: Loaded
    spec: UserScenarioSpec
    seconds: float
    together: bool
    parallel: str
    chunk: int
    accuracy: str
    noisy: bool
    epochs: Epochs | None = None
    filter: FilterSchema | None = None

    def simulate(self, batch: Batch, noise: bool = True) -> SimulationResult:
        """Simulate samples, numbered from 0, with their noise or without; of histories and records there are none."""

        def simulate(errors: Array) -> tuple[SimulationResult, Array]:
            result = self.engine.simulate(Batch(np.arange(len(errors)), errors, batch.seed), noise)
            linear = result.linear_values
            return result, np.empty((len(errors), 0)) if linear is None else linear

        kind = replace(FLIGHTS, computed=(batch.seed if noise else -1,))
        result, linear = _simulate_once(
            self.loaded, self.spec, kind, simulate, batch.errors, batch.errors[-1:], self.together, self.seconds
        )
        return SimulationResult(result.values, result.failures, linear_values=linear if linear.size else None)


def keep_flights(engine: Engine, loaded: Loaded, spec: UserScenarioSpec, seconds: float, together: bool) -> KeptEngine:
    """Return an engine whose simulations are kept; those that are not may take so many seconds."""
    return KeptEngine(
        engine, loaded, spec, seconds, together, engine.parallel, engine.chunk, engine.accuracy, engine.noisy
    )
