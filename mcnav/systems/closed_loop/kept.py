"""Samples of a loop that are kept (`mcnav.systems.user.kept`): those tried beside its nominal, and check simulations.

They depend on code and settings, on sizes and gates, on variables of the environment that the code names, and on the
nominal flight, with the values of all maps along it and beside it: with all errors and all noise. Every command
computes these, and their digest is part of the key: what else a class depends on shows itself without another sample.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import re
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.caches.stored import Cache
from mcnav.contract.engine import Engine
from mcnav.contract.failure import Failure, Reason
from mcnav.contract.filter_record import FilterSchema
from mcnav.contract.history import Epochs
from mcnav.contract.samples import Batch, SimulationResult
from mcnav.execution.progress import TOGETHER, TooLong
from mcnav.systems.closed_loop.engine import ClosedLoopEngine
from mcnav.systems.closed_loop.gates import LoopGates
from mcnav.systems.closed_loop.sizes import LoopSizes
from mcnav.systems.closed_loop.transitions import Innovation, Linearization
from mcnav.systems.user.code import Loaded, UserScenarioSpec
from mcnav.systems.user.kept import KeptNumbers, Kind, keep

SAMPLES: Final = Kind(
    Cache("loops"), (), "simulating samples of the loop", "these samples were kept", "they are simulated again"
)

_QUOTED: Final = re.compile(r"""["'](\w+)["']""")

LASTING: Final = (Reason.STATED, Reason.DIVERGED, Reason.NOT_FINITE)
"""Failures that a sample has whenever it is simulated."""


class _Fleeting(Exception):
    """Raised with simulations that may fail otherwise another time: they are not kept."""

    def __init__(self, result: SimulationResult) -> None:
        self.result = result


@dataclass(frozen=True)
class KeptLoop:
    """Where the samples of a loop are kept.

    Attributes
    ----------
    loaded : Loaded
    spec : UserScenarioSpec
    identity : str
        See `identity_of`.
    """

    loaded: Loaded
    spec: UserScenarioSpec
    identity: str

    def keep(self, computed: tuple[object, ...], simulate: Callable[[], KeptNumbers]) -> tuple[Array, ...]:
        """Return numbers that an earlier command simulated, or simulate them; ``computed`` tells them from others."""
        kind = replace(SAMPLES, computed=(self.identity, environment(self.spec.code.text), *computed))
        return keep(self.loaded, self.spec, kind, lambda _: True, simulate).arrays


@dataclass(frozen=True)
class KeptLoopEngine:
    """An engine of a loop whose simulations are kept: final errors, and their linear values.

    Attributes
    ----------
    seconds : float
        That simulations may take which are not kept; more raise `TooLong`.
    """

    engine: Engine
    kept: KeptLoop
    seconds: float
    parallel: str
    chunk: int
    accuracy: str
    noisy: bool
    epochs: Epochs | None = None
    filter: FilterSchema | None = None

    @classmethod
    def of(cls, engine: Engine, kept: KeptLoop, seconds: float) -> KeptLoopEngine:
        """Return that of an engine."""
        return cls(engine, kept, seconds, engine.parallel, engine.chunk, engine.accuracy, engine.noisy)

    def simulate(self, batch: Batch, noise: bool = True) -> SimulationResult:
        """Simulate samples with their noise or without; of histories and records there are none."""

        def simulate() -> KeptNumbers:
            if self._expected > self.seconds:
                raise TooLong(self._expected)
            result = self.engine.simulate(batch, noise)
            if not all(failure.reason in LASTING for failure in result.failures.values()):
                raise _Fleeting(result)
            linear = np.empty((len(batch.errors), 0)) if result.linear_values is None else result.linear_values
            return KeptNumbers((result.values, linear, _as_numbers(result.failures)))

        of_batch = hashlib.sha256(batch.errors.tobytes() + np.asarray(batch.index).tobytes()).hexdigest()
        try:
            computed = ("batch", of_batch, batch.seed if noise else -1)
            values, linear, failures = self.kept.keep(computed, simulate)
        except _Fleeting as fleeting:
            return fleeting.result
        return SimulationResult(values, _as_failures(failures), linear_values=linear if linear.size else None)

    @cached_property
    def _expected(self) -> float:
        """Seconds that simulations will take, by one sample without errors; none where they may take any time."""
        if math.isinf(self.seconds):
            return 0.0
        engine = self.engine
        assert isinstance(engine, ClosedLoopEngine)

        def measure() -> KeptNumbers:
            began, sources = time.perf_counter(), len(engine.sizes.true.start)
            engine.simulate(Batch(np.arange(1), np.zeros((1, sources)), 0), noise=False)
            return KeptNumbers((np.array([time.perf_counter() - began]),))

        (seconds,) = self.kept.keep(("seconds",), measure)
        return TOGETHER * (2.0 if self.noisy else 1.0) * float(seconds[0])


def _as_numbers(failures: Mapping[int, Failure]) -> Array:
    """Return failures as the numbers of the bytes of a text."""
    told = [(row, failure.reason.value, failure.message) for row, failure in failures.items()]
    return np.frombuffer(json.dumps(told).encode(), np.uint8).astype(float)


def _as_failures(numbers: Array) -> dict[int, Failure]:
    told = json.loads(numbers.astype(np.uint8).tobytes())
    return {row: Failure(Reason(reason), message) for row, reason, message in told}


def identity_of(linear: Linearization, sizes: LoopSizes, gates: LoopGates) -> str:
    """Return the digest of what the samples of a loop depend on besides code and settings."""
    digest = hashlib.sha256(f"{program()} {gates!r} {linear.event_times!r} {linear.beside}".encode())
    for array in _arrays_of(linear, sizes):
        digest.update(f"{array.shape}".encode())
        digest.update(np.ascontiguousarray(array).data)
    return digest.hexdigest()


def _arrays_of(linear: Linearization, sizes: LoopSizes) -> Iterator[Array]:
    yield from (*arrays_of_sizes(sizes), linear.steps)
    for planned in linear.instants:
        yield from (planned.nominal, planned.before)
        for event in (*planned.steps, *planned.updates):
            if isinstance(event, Innovation):
                yield from (event.response, event.value)
            else:
                yield from (event.state, event.inputs, *event.of_filter, *event.corrections.values())


def arrays_of_sizes(sizes: LoopSizes) -> Iterator[Array]:
    """Return the numbers of all sizes."""
    for given in (sizes.true, sizes.believed):
        yield from (given.start, given.white, given.markov, given.decay, given.markov_at_start)
        yield from (*given.measurements, *given.corrections)


def environment(text: str) -> list[list[str]]:
    """Return the variables of the environment that a text names between quotes."""
    return [[name, os.environ[name]] for name in sorted(set(_QUOTED.findall(text))) if name in os.environ]


@cache
def program() -> str:
    """Digest the files of all systems, by which loops are simulated."""
    digest = hashlib.sha256()
    for file in sorted(Path(__file__).parents[1].rglob("*.py")):
        digest.update(file.read_bytes())
    return digest.hexdigest()
