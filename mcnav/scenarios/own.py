"""Scenarios of one's own: a class in a Python file becomes a scenario like any other.

The class says what goes in and what comes out, and flies:

    class Boost:
        sources = (Source("bias", "m/s^2", "ug", 1e-3), ...)       # name, SI unit, unit shown, usual size in SI
        outputs = (Output("range", "m", "km"), ...)                # name, SI unit, unit shown

        def propagate(self, errors): ...                           # (n, sources) -> (n, outputs), or
        def fly(self, errors): ...                                 # (sources,)   -> (outputs,)

``propagate`` flies many samples at once, in threads, and must not change ``self``; ``fly`` flies one, in worker
processes. Both take and give SI units. A sample fails when ``fly`` raises, or when an output is not finite; `Outcomes`
may be returned by ``propagate`` to give reasons. Besides these the class may have

    settings = {"burn_time": "s"}      # further keys of [scenario] with their SI units, given to __init__ by name
    def partials(self): ...            # (outputs, sources); else central differences with steps that are tried out
    def history(self): ...             # a `History`: what the report shows as flown
    chunk = 1000                       # samples a worker takes at a time

The file stands by itself: it may import installed packages, and no file beside it. Its text is part of the run's
identity, travels to the workers as text, and is kept in the run folder.
"""

from __future__ import annotations

import hashlib
import linecache
import re
import sys
import types
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from mcnav.scenarios.differences import Differences, differentiated
from mcnav.scenarios.histories import checked
from mcnav.scenarios.limits import TookTooLong, within_limit
from mcnav.scenarios.one_by_one import NOT_FINITE, Failed, fly_each, told
from mcnav.scenarios.protocol import (
    History,
    LinearModel,
    Outcomes,
    Output,
    Prepared,
    ScenarioError,
    Source,
)
from mcnav.units import UnitError, conversion

Array = NDArray[np.float64]

VECTORISED_CHUNK: Final = 8_192
SINGLE_CHUNK: Final = 128

SETTLED: Final = 1e-3
"""Partial derivatives whose best two steps differ by more, as a share of the largest contribution, are not to be
trusted: the function has a kink or a jump, or is noisy."""

_NAME: Final = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,63}")


@dataclass(frozen=True)
class Code:
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
        return _class_of(self, name)


@lru_cache(maxsize=16)
def _class_of(code: Code, name: str) -> type:
    module = types.ModuleType(f"mcnav_own_{code.digest[:16]}")
    module.__file__ = code.file
    sys.modules[module.__name__] = module  # dataclasses and pickles look a class's module up there
    linecache.cache[code.file] = (len(code.text), None, code.text.splitlines(keepends=True), code.file)
    try:
        exec(compile(code.text, code.file, "exec"), module.__dict__)
    except (Exception, SystemExit) as failure:
        del sys.modules[module.__name__]
        raise ScenarioError("type", f"{code.file} cannot be executed: {told(failure, code.file)}") from failure
    found = getattr(module, name, None)
    if not isinstance(found, type):
        own = (value for value in vars(module).values() if isinstance(value, type))
        classes = [value.__name__ for value in own if value.__module__ == module.__name__]
        there = f"; it has {', '.join(classes)}" if classes else ""
        raise ScenarioError("type", f"{code.file} has no class {name}{there}")
    return found


@dataclass(frozen=True)
class Recipe:
    """How to make the user's object, in this process or another: text, never a pickle of it.

    Attributes
    ----------
    code : Code
    name : str
        Of the class.
    settings : tuple of (str, float)
        For its ``__init__``, SI.
    """

    code: Code
    name: str
    settings: tuple[tuple[str, float], ...]

    def made(self) -> Any:
        """The object; one for each process.

        Raises
        ------
        ScenarioError
            When it cannot be made.
        """
        return _made(self)


@lru_cache(maxsize=16)
def _made(recipe: Recipe) -> Any:
    kind = recipe.code.class_named(recipe.name)
    try:
        return kind(**dict(recipe.settings))
    except (Exception, SystemExit) as failure:
        raise ScenarioError("type", f"{recipe.name} cannot be made: {told(failure, recipe.code.file)}") from failure


def settings_of(kind: type) -> Mapping[str, str]:
    """Further keys of ``[scenario]`` that a class takes, with their SI units.

    Raises
    ------
    ScenarioError
        When what the class says of them is not of that form.
    """
    found = getattr(kind, "settings", {})
    if not isinstance(found, Mapping) or not all(isinstance(entry, str) for pair in found.items() for entry in pair):
        raise ScenarioError("type", f"{kind.__name__}.settings must give a unit for each name, such as {{'time': 's'}}")
    for unit in found.values():
        _check_unit(f"{kind.__name__}.settings", unit, unit)
    return found


def _check_unit(where: str, unit: object, shown_in: object) -> None:
    try:
        factor = conversion(str(unit), str(shown_in))
        alone = conversion(str(unit), str(unit))
    except (UnitError, Exception) as wrong:  # pint has kinds of its own for units that do not convert
        raise ScenarioError("type", f"{where}: {unit!r} shown in {shown_in!r}: {told(wrong, '')}") from None
    if not (factor > 0.0 and alone == 1.0):
        raise ScenarioError("type", f"{where}: {unit!r} cannot be shown in {shown_in!r}")


def _checked(recipe: Recipe, instance: Any) -> tuple[tuple[Source, ...], tuple[Output, ...]]:
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
            _check_unit(where, entry.unit, entry.shown_in)
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
class OwnEngine:
    """A flyer made of the user's class; it travels as the file's text."""

    recipe: Recipe
    outputs: int
    parallel: str
    chunk: int
    accuracy: str

    def propagate(self, errors: Array) -> Outcomes:
        """Fly samples, shape (n, sources)."""
        instance = self.recipe.made()
        if hasattr(instance, "propagate"):
            try:
                return self._told(within_limit(lambda: instance.propagate(errors.copy())), len(errors))
            except MemoryError:
                raise
            except (Exception, SystemExit, TookTooLong):  # who causes it is found by flying each alone
                return self._one_by_one(lambda row: self._alone(instance, row), errors)
        return self._one_by_one(lambda row: _row(instance.fly(row), self.outputs), errors)

    def _alone(self, instance: Any, row: Array) -> Array:
        outcomes = self._told(instance.propagate(row[None, :]), 1)
        if outcomes.failures:
            raise Failed(outcomes.failures[0])
        return np.asarray(outcomes.values[0])

    def _one_by_one(self, fly: Callable[[Array], Array], errors: Array) -> Outcomes:
        found = fly_each(lambda row: fly(errors[row].copy()), range(len(errors)), file=self.recipe.code.file)
        return found.outcomes(np.full((len(errors), self.outputs), np.nan))

    def _told(self, result: Any, count: int) -> Outcomes:
        """What ``propagate`` gave back, with a reason in every row that has no finite outcome."""
        given: Mapping[int, str] = {}
        handed_over = 0
        if isinstance(result, Outcomes):
            result, given, handed_over = result.values, result.failures, result.handed_over
        values = np.array(result, dtype=float)
        if values.shape != (count, self.outputs):
            raise ValueError(f"propagate must return shape {(count, self.outputs)}; got {values.shape}")
        lost = ~np.isfinite(values).all(axis=1)
        lost[list(given)] = True
        values[lost] = np.nan
        failures = {int(row): str(given.get(int(row), NOT_FINITE)) for row in np.flatnonzero(lost)}
        return Outcomes(values, failures, handed_over)


def _row(result: Any, outputs: int) -> Array:
    values = np.array(result, dtype=float)
    if values.shape != (outputs,):
        raise ValueError(f"fly must return shape {(outputs,)}; got {values.shape}")
    return values


class Own:
    """A user's class as a scenario.

    Parameters
    ----------
    recipe : Recipe
    sizes : ndarray, shape (sources,), optional
        One sigma of each source, SI, for the steps of differences; the usual sizes where it is zero or left out.

    Raises
    ------
    ScenarioError
        When the class does not keep the protocol.
    """

    def __init__(self, recipe: Recipe, sizes: Array | None = None) -> None:
        self.recipe = recipe
        self._instance = recipe.made()
        self.sources, self.outputs = _checked(recipe, self._instance)
        self.engines = ("vectorised",) if hasattr(self._instance, "propagate") else ("single",)
        nominal = np.array([source.nominal for source in self.sources])
        self.sizes = nominal if sizes is None else np.where(sizes > 0.0, sizes, nominal)

    def sized(self, sizes: Array) -> Own:
        """The same scenario with the sigmas of a campaign's errors."""
        return Own(self.recipe, sizes)

    @cached_property
    def _engine(self) -> OwnEngine:
        vectorised = self.engines[0] == "vectorised"
        chunk = getattr(self._instance, "chunk", VECTORISED_CHUNK if vectorised else SINGLE_CHUNK)
        if not isinstance(chunk, int) or isinstance(chunk, bool) or not 1 <= chunk <= 1_000_000:
            raise ScenarioError(
                "type", f"{self.recipe.name}.chunk must be a whole number from 1 to 1,000,000; got {chunk!r}"
            )
        how = "many at once" if vectorised else "one by one"
        accuracy = f"{self.recipe.code.file}, class {self.recipe.name}, {how}"
        return OwnEngine(self.recipe, len(self.outputs), "threads" if vectorised else "processes", chunk, accuracy)

    @property
    def own_partials(self) -> bool:
        """Whether the class gives its partial derivatives itself."""
        return hasattr(self._instance, "partials")

    @cached_property
    def differences(self) -> Differences:
        """Partial derivatives by flights, each with steps that are tried out.

        Raises
        ------
        ScenarioError
            When a flight that they need fails.
        """
        return differentiated(self._engine.propagate, self.sizes)

    def linearised(self) -> LinearModel:
        """The class's own partial derivatives, or central differences; both fly it without any error.

        Raises
        ------
        ScenarioError
            When a flight that they need fails, or the class's own are not of their shape.
        """
        if not self.own_partials:
            return self.differences.model
        shape = (len(self.outputs), len(self.sources))
        try:
            partials = np.array(self._instance.partials(), dtype=float)
        except (Exception, SystemExit) as failure:
            raise ScenarioError("type", f"partials: {told(failure, self.recipe.code.file)}") from failure
        if partials.shape != shape or not np.isfinite(partials).all():
            raise ScenarioError("type", f"partials must return finite numbers of shape {shape}; got {partials.shape}")
        nominal = self._engine.propagate(np.zeros((1, shape[1])))
        if nominal.failures:
            raise ScenarioError("type", f"its flight without any error failed: {nominal.failures[0]}")
        return LinearModel(partials, nominal.values[0])

    def prepared(self, engine: str, probes: Array) -> Prepared:
        """The one engine. Probes are not flown: a sample that ends its process may do so in a worker, not here.

        Raises
        ------
        ScenarioError
            When it cannot be flown without any error.
        """
        self.linearised()
        if self.own_partials:
            derivatives = "partial derivatives are the class's own"
        else:
            error = self.differences.error
            trust = "" if error <= SETTLED else ": not settled, so that linear results are doubtful"
            derivatives = f"partial derivatives by central differences, steps agree to {error:.1e}{trust}"
        return replace(self._engine, accuracy=f"{self._engine.accuracy}; {derivatives}")

    def history(self) -> History:
        """What the class shows of its flight, if anything.

        Raises
        ------
        ScenarioError
            When it is no history.
        """
        if not hasattr(self._instance, "history"):
            return History()
        try:
            found = self._instance.history()
            if not isinstance(found, History):
                raise TypeError(f"history must return a History of mcnav; got {type(found).__name__}")
            return checked(found)
        except (Exception, SystemExit) as failure:
            raise ScenarioError("type", f"history: {told(failure, self.recipe.code.file)}") from failure
