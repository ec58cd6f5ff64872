"""User-defined scenarios: a class in a Python file, which `mcnav/docs/SCENARIOS.md` describes.

The class declares ``sources`` and ``outputs``. ``propagate`` simulates many samples at once, in threads, and must not
change ``self``; ``fly`` simulates one, in worker processes. Both take and return SI units. Optional attributes are
``settings``, ``partials``, ``history`` and ``chunk``. Noise, errors over time and filters are in
`mcnav.systems.user.stochastic_scenario`.

The file may import installed packages, but no file in its folder. Its text is part of the run's identity, and so are
the files that it reads: those that settings name, and those that it opens while it is built, linearized and asked for
its history (`mcnav.entries.inputs`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, Final, TypeGuard, TypeVar, get_args

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.engine import Engine, without_noise
from mcnav.contract.history import History
from mcnav.contract.linear import LinearModel, LinearSystem
from mcnav.contract.quantities import Of, Output, Source
from mcnav.contract.questions import Question, reason_against
from mcnav.contract.samples import SimulationResult
from mcnav.contract.scenario import Capability, PlainScenario, Scenario, ScenarioError, is_differenced
from mcnav.entries.inputs import InputFile, with_unique_names
from mcnav.systems.finite_differences import DifferencedModel, differentiate
from mcnav.systems.guard import LINEARIZING
from mcnav.systems.histories import check_history
from mcnav.systems.user.code import UserScenarioSpec
from mcnav.systems.user.engine import UserEngine
from mcnav.systems.user.returned import numbers_of
from mcnav.systems.user.settings import NAME, check_unit
from mcnav.systems.user.stochastic_engine import StochasticUserEngine

Entry = TypeVar("Entry", Source, Output)

VECTORISED_CHUNK: Final = 8_192
SINGLE_CHUNK: Final = 128
MOST_SAMPLES: Final = 1_000_000
MOST_NUMBERS: Final = 60_000_000
"""Samples of a chunk, and numbers: the reading of a chunk's file refuses more than half a gigabyte."""

SETTLED: Final = 1e-3
"""Largest difference of the best two steps of a settled derivative, as a share of the largest contribution.

A larger difference means that the function has a kink or a jump, or is noisy.
"""


def _check_entries(where: str, entries: Any, kind: type[Source] | type[Output]) -> None:
    """Raise `ScenarioError` when sources or outputs are not declared as they must be."""
    if not isinstance(entries, Sequence) or not entries or not all(isinstance(entry, kind) for entry in entries):
        raise ScenarioError("type", f"{where} must be one or more {kind.__name__} of mcnav; got {entries!r:.80}")
    for entry in entries:
        if not isinstance(entry.name, str) or not NAME.fullmatch(entry.name):
            raise ScenarioError("type", f"{where}: {entry.name!r} is not a name of letters, digits and _")
        check_unit(where, entry.unit, entry.shown_in)
        if entry.of not in get_args(Of):
            raise ScenarioError("type", f"{where}: {entry.name} is of {entry.of!r}; expected {', '.join(get_args(Of))}")
        if isinstance(entry, Source) and not (np.isfinite(entry.nominal) and entry.nominal > 0.0):
            raise ScenarioError("type", f"{where}: {entry.name} needs a usual size above zero; got {entry.nominal!r}")
    if len({entry.name for entry in entries}) < len(entries):
        raise ScenarioError("type", f"{where} lists a name twice")


class UserScenario(PlainScenario):
    """A scenario made of the user's class.

    Parameters
    ----------
    sizes : ndarray, shape (sources,), optional
        One sigma of each source, SI, for the steps of finite differences; where zero or omitted, the usual sizes.

    Raises
    ------
    ScenarioError
        When the class does not follow the protocol.
    """

    can = frozenset({Capability.USER_CODE, Capability.DIFFERENCED})

    def __init__(self, spec: UserScenarioSpec, sizes: Array | None = None) -> None:
        self.spec = spec
        self._object = spec.build_current()
        self._instance = self._object.value
        self.sources: tuple[Source, ...] = self._declared("sources", Source)
        self.outputs: tuple[Output, ...] = self._declared("outputs", Output)
        vectorised = spec.gives("propagate")
        if not vectorised and not spec.gives("fly"):
            raise ScenarioError("type", f"{spec.name} has neither propagate, for many samples, nor fly, for one")
        self.engines = ("vectorised",) if vectorised else ("single",)
        nominal = np.array([source.nominal for source in self.sources])
        self.sizes = nominal if sizes is None else np.where(sizes > 0.0, sizes, nominal)

    def _declared(self, attribute: str, kind: type[Entry]) -> tuple[Entry, ...]:
        """Read the sources or outputs of the class; `ScenarioError` when they are not declared as they must be."""
        entries: Any = self.spec.member(attribute)
        _check_entries(f"{self.spec.name}.{attribute}", entries, kind)
        return tuple(entries)

    def with_sigmas(self, sizes: Array) -> UserScenario:
        """Return the scenario with the sigmas of a campaign's errors, shape (sources,), SI."""
        return type(self)(self.spec, sizes)

    @cached_property
    def _engine(self) -> UserEngine | StochasticUserEngine:
        vectorised = self._together
        chunk = self.chunk(VECTORISED_CHUNK if vectorised else SINGLE_CHUNK)
        accuracy = f"{self.spec.code.file}, class {self.spec.name}, {'many at once' if vectorised else 'one by one'}"
        parallel = "threads" if vectorised else "processes"
        return UserEngine(self.spec.pinned(self._object), len(self.outputs), parallel, chunk, accuracy)

    def chunk(self, default: int) -> int:
        """Return the samples of a chunk that the class declares; `ScenarioError` when it is no such number."""
        chunk = self.spec.member("chunk", default)
        # index, status, errors, outputs and the linear ones
        most = min(MOST_SAMPLES, MOST_NUMBERS // (2 + len(self.sources) + 2 * len(self.outputs)))
        if not isinstance(chunk, int) or isinstance(chunk, bool) or not 1 <= chunk <= most:
            message = f"{self.spec.name}.chunk must be a whole number from 1 to {most:,}; got {chunk!r}"
            raise ScenarioError("type", message)
        return chunk

    def inputs(self) -> tuple[InputFile, ...]:
        """Return the files that the scenario reads: those of its settings, and those noticed so far.

        Raises `ScenarioError` when it cannot be linearized, or a file changes meanwhile.
        """
        self.linear()
        self.nominal()
        declared = self.spec.declared
        return declared + with_unique_names(self._object.inputs.values(), declared)

    @property
    def leading_shape(self) -> tuple[int, ...]:
        """Return the axes that partial derivatives have before outputs and sources."""
        return ()

    @property
    def own_partials(self) -> bool:
        """Return whether the class provides its partial derivatives."""
        return self.spec.gives("partials")

    @cached_property
    def differences(self) -> DifferencedModel:
        """Partial derivatives by finite differences with automatic steps.

        Raises `ScenarioError` when a simulation that they need fails.
        """
        from mcnav.systems.user.kept_simulations import simulate_for_differences  # with llvmlite, to know the processor

        simulate = without_noise(self._engine)

        def final(errors: Array) -> tuple[SimulationResult, Array]:
            return simulate(errors), np.empty((len(errors), 0))

        def propagate(errors: Array) -> SimulationResult:
            return simulate_for_differences(self._object, self.spec, final, errors, self._together)[0]

        return differentiate(propagate, self.sizes)

    def linear(self, times: Array | None = None) -> LinearSystem:
        """Return the partial derivatives that the class provides, or finite differences; both include the nominal run.

        Raises `ScenarioError` when a simulation that they need fails, or the partial derivatives of the class have the
        wrong shape.
        """
        if times is not None:
            raise ScenarioError("at", reason_against(Question.ANY_TIME, self.parts))
        model = self._model if self.own_partials else self.differences.model
        return LinearSystem.at_end(model.partials, model.nominal)

    def linear_over_time(self, count: int | None = None) -> LinearSystem:
        """Return the linear system at the end."""
        return self.linear()

    @cached_property
    def given_partials(self) -> Array:
        """Partial derivatives that the class provides, shape (*leading_shape, outputs, sources)."""
        shape = (*self.leading_shape, len(self.outputs), len(self.sources))
        file = self.spec.code.file
        with self._object.recording(file, LINEARIZING):
            partials = self.spec.ask(LINEARIZING, "partials", lambda: numbers_of(self._instance.partials(), "partials"))
        if partials.shape != shape or not np.isfinite(partials).all():
            message = f"partials must return finite numbers of shape {shape}; got {partials.shape}"
            raise ScenarioError("type", message)
        return partials

    @cached_property
    def _model(self) -> LinearModel:
        """Linear model from the partial derivatives that the class provides."""
        partials = self.given_partials.reshape(-1, len(self.outputs), len(self.sources))[-1]
        with self._object.recording(self.spec.code.file, LINEARIZING):
            nominal = without_noise(self._engine)(np.zeros((1, len(self.sources))))
        if nominal.failures:
            raise ScenarioError("type", f"its flight without any error failed: {nominal.failures[0]}")
        return LinearModel(partials, nominal.values[0])

    def engine(self, engine: str, probes: Array) -> Engine:
        """Return the only engine. Probes are not simulated here: only a worker may be ended by a sample.

        Raises `ScenarioError` when the nominal run fails.
        """
        self.linear()
        return replace(self._engine, spec=self.spec.pinned(self._object), accuracy=self.accuracy)

    def keeping(self, engine: Engine, seconds: float) -> Engine:
        """Return an engine of the scenario whose simulations are kept; `TooLong` where others take more seconds."""
        from mcnav.systems.user.kept_simulations import keep_flights

        return keep_flights(engine, self._object, self.spec, seconds, self._together)

    @property
    def _together(self) -> bool:
        return self.engines[0] == "vectorised"

    @property
    def accuracy(self) -> str:
        """Describe how samples are simulated and linearized."""
        if self.own_partials:
            derivatives = "partial derivatives are the class's own"
        else:
            error = self.differences.error
            trust = "" if error <= SETTLED else ": not converged, so that linear results are not reliable"
            derivatives = f"partial derivatives by central differences, steps agree to {error:.1e}{trust}"
        return f"{self._engine.accuracy}; {derivatives}"

    def nominal(self) -> History:
        """Return the history that the class provides, or an empty one.

        Raises `ScenarioError` when it is not a valid history.
        """
        return self._history if self.spec.gives("history") else History()

    @cached_property
    def _history(self) -> History:
        def checked() -> History:
            history = self._instance.history()
            if not isinstance(history, History):
                raise TypeError(f"history must return a History of mcnav; got {type(history).__name__}")
            return check_history(history)

        with self._object.recording(self.spec.code.file, LINEARIZING):
            return self.spec.ask(LINEARIZING, "history", checked)


def is_users(scenario: Scenario) -> TypeGuard[UserScenario]:
    """Return whether a scenario is made of a user's class that propagates errors."""
    return is_differenced(scenario)
