"""Simulations for differences of a user's class that are kept (`mcnav.systems.user.kept`): sixteen for each source."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.caches.stored import Cache
from mcnav.contract.samples import SimulationResult
from mcnav.systems.user.code import Loaded, UserScenarioSpec
from mcnav.systems.user.kept import KeptNumbers, Kind, keep

CACHE: Final = Cache("differences")

Simulate = Callable[[Array], tuple[SimulationResult, Array]]
"""Simulation of errors, shape (n, sources), without noise: final errors, and those over time, shape (n, ...)."""


class _SomeFailed(Exception):
    """Raised with simulations of which some failed: they are not kept."""

    def __init__(self, result: SimulationResult, over_time: Array) -> None:
        self.simulated = result, over_time


def simulate_for_differences(
    loaded: Loaded, spec: UserScenarioSpec, simulate: Simulate, errors: Array
) -> tuple[SimulationResult, Array]:
    """Simulate errors, or return what an earlier command simulated of them.

    One more sample has each error at its largest. It is simulated alone, and repeated when the others are read.

    Raises
    ------
    ScenarioError
        When a file changes that the class reads.
    """
    largest = np.abs(errors).max(axis=0, keepdims=True)
    kind = Kind(
        CACHE, (hashlib.sha256(errors.tobytes()).hexdigest(),), "simulating differences for partial derivatives",
        "these simulations were kept", "partial derivatives are computed anew",
    )  # fmt: skip

    def alone() -> Array:
        result, over_time = simulate(largest)
        return np.concatenate([result.values.ravel(), over_time.ravel()])

    def compute() -> KeptNumbers:
        began = time.perf_counter()
        repeated = alone()
        kind.tell(len(errors) * (time.perf_counter() - began))
        result, over_time = simulate(errors)
        if result.failures or result.fallback_count:
            raise _SomeFailed(result, over_time)
        return KeptNumbers((result.values, over_time, repeated))

    def repeats(kept: KeptNumbers) -> bool:
        return kept.arrays[2].tobytes() == alone().tobytes()

    try:
        values, over_time, _ = keep(loaded, spec, kind, repeats, compute).arrays
    except _SomeFailed as failed:
        return failed.simulated
    return SimulationResult(values), over_time
