"""Scenarios of one's own: a class in a Python file becomes a scenario like any other.

The class says what goes in and what comes out, and flies:

    class Boost:
        sources = (Source("bias", "m/s^2", "ug", 1e-3), ...)       # name, SI unit, unit shown, usual size in SI
        outputs = (Output("range", "m", "km"), ...)                # name, SI unit, unit shown

        def propagate(self, errors): ...                           # (n, sources) -> (n, outputs), or
        def fly(self, errors): ...                                 # (sources,)   -> (outputs,)

``propagate`` flies many samples at once, in threads, and must not change ``self``; ``fly`` flies one, in worker
processes. Both take and give SI units. A sample fails when ``fly`` raises, or when an output is not finite;
`SimulationResult` may be returned by ``propagate`` to give reasons. Besides these the class may have

    settings = {"burn_time": "s", "label": str, "trajectory": Path}   # further keys of [scenario], given to __init__
    def partials(self): ...            # (outputs, sources); else central differences with steps that are tried out
    def history(self): ...             # a `History`: what the report shows as flown
    chunk = 1000                       # samples a worker takes at a time

What a setting may be is in `mcnav.scenarios.settings`. The file stands by itself: it may import installed packages, and
no file beside it. Its text is part of the run's identity, travels to the workers as text, and is kept in the run
folder. Files that it reads are part of the identity, too: those that settings name, and those that it is seen to open
while it is made, linearised and asked for its history (`mcnav.scenarios.inputs`).
"""

from __future__ import annotations

import hashlib
import linecache
import re
import sys
import types
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final, TypeVar

import numpy as np

from mcnav._types import Array
from mcnav.scenarios.failure import Failure, Reason
from mcnav.scenarios.finite_differences import DifferencedModel, differentiate
from mcnav.scenarios.histories import check_history
from mcnav.scenarios.inputs import InputFile, inputs_of, named_apart, watched
from mcnav.scenarios.protocol import Engine, History, LinearModel, Output, ScenarioError, SimulationResult, Source
from mcnav.scenarios.sample_loop import SampleFailed, format_exception, simulate_each
from mcnav.scenarios.settings import Value, check_unit, given
from mcnav.scenarios.timeouts import SampleTimeout, within_limit

VECTORISED_CHUNK: Final = 8_192
SINGLE_CHUNK: Final = 128

SETTLED: Final = 1e-3
"""Partial derivatives whose best two steps differ by more, as a share of the largest contribution, are not to be
trusted: the function has a kink or a jump, or is noisy."""

_NAME: Final = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,63}")


@dataclass(frozen=True)
class SourceFile:
    """A Python file of the user's.

    Attributes
    ----------
    file : str
        Its name.
    text : str
        Its content.
    """

    file: str
    text: str

    @property
    def digest(self) -> str:
        """SHA-256 of the content."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    def class_named(self, name: str) -> type:
        """Execute the file and return a class of it.

        Raises
        ------
        ScenarioError
            When the file cannot be executed, or has no such class.
        """
        return _class_of(self, name).kind


@dataclass(frozen=True)
class Loaded:
    """A class of the user's, and the files that were read when its file was executed."""

    kind: type
    inputs: Mapping[str, InputFile]


@dataclass(frozen=True)
class Made:
    """An object of a user's class, and the files that it has read so far, by path."""

    instance: Any
    inputs: dict[str, InputFile]

    @contextmanager
    def watched(self, code: str) -> Iterator[None]:
        """Note what the object reads.

        Raises
        ------
        ScenarioError
            When a file changes while it is being read, or is a pipe or the like.
        """
        with watched() as found:
            try:
                yield
            finally:
                for path, file in inputs_of(found, code).items():
                    if self.inputs.setdefault(path, file).digest != file.digest:
                        raise ScenarioError("type", f"{path} changed while {code} was reading it; start again")


KEPT: Final = 32
"""Classes, and objects, that a process keeps."""

Key = TypeVar("Key")
Entry = TypeVar("Entry")

_classes: dict[tuple[SourceFile, str], Loaded] = {}
_objects: dict[UserScenarioSpec, Made] = {}


def _keep(entries: dict[Key, Entry], key: Key, entry: Entry) -> Entry:
    """Keep an entry in place of the oldest."""
    while len(entries) >= KEPT and key not in entries:
        entries.pop(next(iter(entries)), None)
    entries[key] = entry
    return entry


def _valid(inputs: Mapping[str, InputFile]) -> bool:
    return all(file.unchanged for file in tuple(inputs.values()))


def _class_of(code: SourceFile, name: str) -> Loaded:
    known = _classes.get((code, name))
    if known is not None and _valid(known.inputs):
        return known
    module = types.ModuleType(f"mcnav_own_{code.digest[:16]}")
    module.__file__ = code.file
    sys.modules[module.__name__] = module  # dataclasses and pickles look a class's module up there
    linecache.cache[code.file] = (len(code.text), None, code.text.splitlines(keepends=True), code.file)
    try:
        with watched() as read:
            exec(compile(code.text, code.file, "exec"), module.__dict__)
    except (Exception, SystemExit) as failure:
        del sys.modules[module.__name__]
        raise ScenarioError(
            "type", f"{code.file} cannot be executed: {format_exception(failure, code.file)}"
        ) from failure
    found = getattr(module, name, None)
    if not isinstance(found, type):
        own = (value for value in vars(module).values() if isinstance(value, type))
        classes = [value.__name__ for value in own if value.__module__ == module.__name__]
        there = f"; it has {', '.join(classes)}" if classes else ""
        raise ScenarioError("type", f"{code.file} has no class {name}{there}")
    return _keep(_classes, (code, name), Loaded(found, inputs_of(read, code.file)))


@dataclass(frozen=True)
class UserScenarioSpec:
    """How to make the user's object, in this process or another: text, never a pickle of it.

    Attributes
    ----------
    code : Code
    name : str
        Of the class.
    settings : tuple of (str, Value)
        For its ``__init__``; see `mcnav.scenarios.settings.given`.
    read : tuple of (str, str)
        Path and digest of every file that the object is known to read beside those of its settings. Objects that
        read other contents are other objects.
    """

    code: SourceFile
    name: str
    settings: tuple[tuple[str, Value], ...]
    read: tuple[tuple[str, str], ...] = ()

    def made(self) -> Made:
        """The object; one for each process.

        Raises
        ------
        ScenarioError
            When it cannot be made.
        """
        return _objects.get(self) or self.made_anew()

    def made_anew(self) -> Made:
        """As `made`, but made again when a file that it read has changed since.

        Raises
        ------
        ScenarioError
            When it cannot be made.
        """
        known = _objects.get(self)
        if known is not None and _valid(known.inputs) and all(file.unchanged for file in self.declared):
            return known
        loaded = _class_of(self.code, self.name)
        made = Made(None, dict(loaded.inputs))
        with made.watched(self.code.file):
            try:
                instance = loaded.kind(**{name: given(value) for name, value in self.settings})
            except (Exception, SystemExit) as failure:
                message = f"{self.name} cannot be made: {format_exception(failure, self.code.file)}"
                raise ScenarioError("type", message) from failure
        return _keep(_objects, self, replace(made, instance=instance))

    @property
    def declared(self) -> tuple[InputFile, ...]:
        """Files that settings name."""
        return tuple(value for _, value in self.settings if isinstance(value, InputFile))


def _checked(recipe: UserScenarioSpec, instance: Any) -> tuple[tuple[Source, ...], tuple[Output, ...]]:
    """Sources and outputs as the object declares them."""
    declared = []
    for attribute, kind in (("sources", Source), ("outputs", Output)):
        where = f"{recipe.name}.{attribute}"
        entries = getattr(instance, attribute, None)
        if not isinstance(entries, Sequence) or not entries or not all(isinstance(entry, kind) for entry in entries):
            raise ScenarioError("type", f"{where} must be one or more {kind.__name__} of mcnav; got {entries!r:.80}")
        names = [entry.name for entry in entries]
        for entry in entries:
            if not isinstance(entry.name, str) or not _NAME.fullmatch(entry.name):
                raise ScenarioError("type", f"{where}: {entry.name!r} is no name: letters, digits and _ make one")
            check_unit(where, entry.unit, entry.shown_in)
            if isinstance(entry, Source) and not (np.isfinite(entry.nominal) and entry.nominal > 0.0):
                raise ScenarioError(
                    "type", f"{where}: {entry.name} needs a usual size above zero; got {entry.nominal!r}"
                )
        if len(set(names)) < len(names):
            raise ScenarioError("type", f"{where} lists a name twice")
        declared.append(tuple(entries))
    if not (hasattr(instance, "propagate") or hasattr(instance, "fly")):
        raise ScenarioError("type", f"{recipe.name} has neither propagate, for many samples, nor fly, for one")
    return declared[0], declared[1]


@dataclass(frozen=True)
class UserEngine:
    """A flyer made of the user's class; it travels as the file's text."""

    recipe: UserScenarioSpec
    outputs: int
    parallel: str
    chunk: int
    accuracy: str

    def propagate(self, errors: Array) -> SimulationResult:
        """Fly samples, shape (n, sources)."""
        instance = self.recipe.made().instance
        if hasattr(instance, "propagate"):
            try:
                return self._told(within_limit(lambda: instance.propagate(errors.copy())), len(errors))
            except MemoryError:
                raise
            except (Exception, SystemExit, SampleTimeout):  # who causes it is found by flying each alone
                return self._one_by_one(lambda row: self._alone(instance, row), errors)
        return self._one_by_one(lambda row: _row(instance.fly(row), self.outputs), errors)

    def _alone(self, instance: Any, row: Array) -> Array:
        outcomes = self._told(instance.propagate(row[None, :]), 1)
        if outcomes.failures:
            raise SampleFailed(outcomes.failures[0])
        return np.asarray(outcomes.values[0])

    def _one_by_one(self, fly: Callable[[Array], Array], errors: Array) -> SimulationResult:
        found = simulate_each(lambda row: fly(errors[row].copy()), range(len(errors)), file=self.recipe.code.file)
        return found.outcomes(np.full((len(errors), self.outputs), np.nan))

    def _told(self, result: Any, count: int) -> SimulationResult:
        """What ``propagate`` gave back, with a reason in every row that has no finite outcome."""
        given: Mapping[int, Failure] = {}
        handed_over = 0
        if isinstance(result, SimulationResult):
            result, given, handed_over = result.values, result.failures, result.fallback_count
        values = np.array(result, dtype=float)
        if values.shape != (count, self.outputs):
            raise ValueError(f"propagate must return shape {(count, self.outputs)}; got {values.shape}")
        lost = ~np.isfinite(values).all(axis=1)
        lost[list(given)] = True
        values[lost] = np.nan
        failures = {int(row): Failure.of(given.get(int(row), Reason.NOT_FINITE)) for row in np.flatnonzero(lost)}
        return SimulationResult(values, failures, handed_over)


def _row(result: Any, outputs: int) -> Array:
    values = np.array(result, dtype=float)
    if values.shape != (outputs,):
        raise ValueError(f"fly must return shape {(outputs,)}; got {values.shape}")
    return values


class UserScenario:
    """A user's class as a scenario.

    Parameters
    ----------
    recipe : UserScenarioSpec
    sizes : ndarray, shape (sources,), optional
        One sigma of each source, SI, for the steps of differences; the usual sizes where it is zero or left out.

    Raises
    ------
    ScenarioError
        When the class does not keep the protocol.
    """

    def __init__(self, recipe: UserScenarioSpec, sizes: Array | None = None) -> None:
        self.recipe = recipe
        self._made = recipe.made_anew()
        self._instance = self._made.instance
        self.sources, self.outputs = _checked(recipe, self._instance)
        self.engines = ("vectorised",) if hasattr(self._instance, "propagate") else ("single",)
        nominal = np.array([source.nominal for source in self.sources])
        self.sizes = nominal if sizes is None else np.where(sizes > 0.0, sizes, nominal)

    def with_sigmas(self, sizes: Array) -> UserScenario:
        """The same scenario with the sigmas of a campaign's errors."""
        return UserScenario(self.recipe, sizes)

    def _pinned(self) -> UserScenarioSpec:
        """The recipe with the content of what was read so far: no other object is taken for this scenario's."""
        read = tuple((path, file.digest) for path, file in sorted(self._made.inputs.items()))
        recipe = replace(self.recipe, read=read)
        _keep(_objects, recipe, self._made)
        return recipe

    @cached_property
    def _engine(self) -> UserEngine:
        vectorised = self.engines[0] == "vectorised"
        chunk = getattr(self._instance, "chunk", VECTORISED_CHUNK if vectorised else SINGLE_CHUNK)
        if not isinstance(chunk, int) or isinstance(chunk, bool) or not 1 <= chunk <= 1_000_000:
            raise ScenarioError(
                "type", f"{self.recipe.name}.chunk must be a whole number from 1 to 1,000,000; got {chunk!r}"
            )
        how = "many at once" if vectorised else "one by one"
        accuracy = f"{self.recipe.code.file}, class {self.recipe.name}, {how}"
        return UserEngine(self._pinned(), len(self.outputs), "threads" if vectorised else "processes", chunk, accuracy)

    def inputs(self) -> tuple[InputFile, ...]:
        """Files that the scenario reads: those of its settings, and those noticed up to its nominal flight.

        Raises
        ------
        ScenarioError
            When it cannot be linearised, or a file changes meanwhile.
        """
        self.linear_model()
        self.history()
        declared = self.recipe.declared
        return declared + named_apart(self._made.inputs.values(), declared)

    @property
    def own_partials(self) -> bool:
        """Whether the class gives its partial derivatives itself."""
        return hasattr(self._instance, "partials")

    @cached_property
    def differences(self) -> DifferencedModel:
        """Partial derivatives by flights, each with steps that are tried out.

        Raises
        ------
        ScenarioError
            When a flight that they need fails.
        """
        with self._made.watched(self.recipe.code.file):
            return differentiate(self._engine.propagate, self.sizes)

    def linear_model(self) -> LinearModel:
        """The class's own partial derivatives, or central differences; both fly it without any error.

        Raises
        ------
        ScenarioError
            When a flight that they need fails, or the class's own are not of their shape.
        """
        return self._linear if self.own_partials else self.differences.model

    @cached_property
    def _linear(self) -> LinearModel:
        """The class's own partial derivatives."""
        shape = (len(self.outputs), len(self.sources))
        with self._made.watched(self.recipe.code.file):
            try:
                partials = np.array(self._instance.partials(), dtype=float)
            except (Exception, SystemExit) as failure:
                raise ScenarioError(
                    "type", f"partials: {format_exception(failure, self.recipe.code.file)}"
                ) from failure
            if partials.shape != shape or not np.isfinite(partials).all():
                came = f"partials must return finite numbers of shape {shape}; got {partials.shape}"
                raise ScenarioError("type", came)
            nominal = self._engine.propagate(np.zeros((1, shape[1])))
        if nominal.failures:
            raise ScenarioError("type", f"its flight without any error failed: {nominal.failures[0]}")
        return LinearModel(partials, nominal.values[0])

    def engine(self, engine: str, probes: Array) -> Engine:
        """The one engine. Probes are not flown: a sample that ends its process may do so in a worker, not here.

        Raises
        ------
        ScenarioError
            When it cannot be flown without any error.
        """
        self.linear_model()
        if self.own_partials:
            derivatives = "partial derivatives are the class's own"
        else:
            error = self.differences.error
            trust = "" if error <= SETTLED else ": not settled, so that linear results are doubtful"
            derivatives = f"partial derivatives by central differences, steps agree to {error:.1e}{trust}"
        return replace(self._engine, recipe=self._pinned(), accuracy=f"{self._engine.accuracy}; {derivatives}")

    def history(self) -> History:
        """What the class shows of its flight, if anything.

        Raises
        ------
        ScenarioError
            When it is no history.
        """
        return self._history if hasattr(self._instance, "history") else History()

    @cached_property
    def _history(self) -> History:
        with self._made.watched(self.recipe.code.file):
            try:
                found = self._instance.history()
                if not isinstance(found, History):
                    raise TypeError(f"history must return a History of mcnav; got {type(found).__name__}")
                return check_history(found)
            except (Exception, SystemExit) as failure:
                raise ScenarioError("type", f"history: {format_exception(failure, self.recipe.code.file)}") from failure
