"""Execution of user code: a Python file becomes a class, the class an object, and every file that they read is noted.

Code travels to worker processes as text. A process keeps the classes and objects that it has built, and builds them
again when a file that they read has changed.
"""

from __future__ import annotations

import linecache
import sys
import types
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Final, TypeVar

from mcnav.contract.scenario import ScenarioError
from mcnav.entries.inputs import InputFile, OpenedFiles, SourceFile, find_inputs, record_opened_files
from mcnav.systems.guard import call_user, in_user_code, raised_by
from mcnav.systems.sample_loop import format_exception
from mcnav.systems.timeouts import SampleTimeout, time_limit, within_reading_limit
from mcnav.systems.user.measured_noise import MeasuredNoise
from mcnav.systems.user.settings import Value, to_argument

CACHE_SIZE: Final = 32
"""Classes, and objects, that a process keeps."""

METHODS: Final = ("propagate", "fly", "rates")
"""Methods of which a scenario has one: for many samples, for one, of a closed loop."""

Key = TypeVar("Key")
Result = TypeVar("Result")

_MISSING: Final = object()


def _ask(file: str, doing: str, what: str, function: Callable[..., Result], *values: Any) -> Result:
    """Call a function of the user's besides samples, such as what gives partial derivatives.

    Parameters
    ----------
    doing : str
        What it does, such as ``while it was read``.
    what : str
        What cannot be had when it fails, for the message.

    Raises
    ------
    ScenarioError
        When it raises an exception, misbehaves (`in_user_code`), or exceeds its time limit (`within_reading_limit`).
    """
    with in_user_code(file, doing):
        try:
            return within_reading_limit(lambda: call_user(function, *values))
        except ScenarioError:
            raise
        except (Exception, SampleTimeout) as failure:
            raise ScenarioError("type", f"{what}: {format_exception(failure, file)}") from failure


@dataclass
class Loaded:
    """A user's class or an object of it, and the files that it has read so far, by path.

    ``noise`` is the measured covariance of its noise, where that is known.
    """

    value: Any
    inputs: dict[str, InputFile]
    noise: MeasuredNoise | None = None

    @contextmanager
    def recording(self, code: str, doing: str) -> Iterator[None]:
        """Record the files that the object reads; see `in_user_code`.

        Raises `ScenarioError` when a file changes while it is being read, or is not a regular file.
        """
        with in_user_code(code, doing), record_opened_files() as opened:
            try:
                yield
            finally:
                for path, file in find_inputs(opened, code).items():
                    if self.inputs.setdefault(path, file).digest != file.digest:
                        raise ScenarioError("type", f"{path} changed while {code} was reading it; start again")


@dataclass(frozen=True)
class UserScenarioSpec:
    """Instructions to build the user's object in any process: text and settings, never a pickle of the object.

    Attributes
    ----------
    name : str
        Name of the class.
    settings : tuple of (str, Value)
        Arguments of its ``__init__``; see `mcnav.systems.user.settings.to_argument`.
    read : tuple of (str, str)
        Path and digest of every file that the object is known to read, besides those of its settings. Objects that
        read different contents are different objects.
    limit : float, optional
        Time limit of one sample, s: it holds for whatever any command lets the object do.
    """

    code: SourceFile
    name: str
    settings: tuple[tuple[str, Value], ...]
    read: tuple[tuple[str, str], ...] = ()
    limit: float | None = field(default=None, compare=False)

    @contextmanager
    def running(self, doing: str) -> Iterator[None]:
        """Run the object's code within its time limit; see `in_user_code`."""
        with time_limit(self.limit), in_user_code(self.code.file, doing):
            yield

    def ask(self, doing: str, what: str, function: Callable[..., Result], *values: Any) -> Result:
        """Call a function of the object besides samples; see `_ask`."""
        with time_limit(self.limit):
            return _ask(self.code.file, doing, what, function, *values)

    def build(self) -> Loaded:
        """Return the object, built once in each process; `ScenarioError` when it cannot be built."""
        return _objects.get(self) or self.build_current()

    def build_current(self) -> Loaded:
        """Return the object, built again when a file that it read has changed.

        Raises `ScenarioError` when it cannot be built.
        """
        known = _objects.get(self)
        if known is not None and _unchanged(known.inputs) and all(file.unchanged for file in self.declared):
            return known
        with time_limit(self.limit):
            loaded = _load_class(self.code, self.name)
        built = Loaded(None, dict(loaded.inputs))
        doing = f"while {self.name} was made"
        with built.recording(self.code.file, doing):
            make = partial(loaded.value, **{name: to_argument(value) for name, value in self.settings})
            instance = self.ask(doing, f"{self.name} cannot be made", make)
        return _cache(_objects, self, replace(built, value=instance))

    def member(self, name: str, default: Any = None) -> Any:
        """Return what the object gives by a name, or the default; `ScenarioError` when its code fails."""
        instance, where = self.build().value, f"{self.name}.{name}"
        return self.ask(f"while it gave {where}", where, getattr, instance, name, default)

    def gives(self, name: str) -> bool:
        """Return whether the object has a member; `ScenarioError` when its code fails."""
        return self.member(name, _MISSING) is not _MISSING

    def pinned(self, built: Loaded) -> UserScenarioSpec:
        """Add the contents that an object has read, so that this process takes no other object for it."""
        read = tuple((path, file.digest) for path, file in sorted(built.inputs.items()))
        spec = replace(self, read=read)
        _cache(_objects, spec, built)
        return spec

    @property
    def declared(self) -> tuple[InputFile, ...]:
        """Files that settings name."""
        return tuple(value for _, value in self.settings if isinstance(value, InputFile))


def load_class(code: SourceFile, name: str) -> type:
    """Execute a file and return one of its classes.

    Raises `ScenarioError` when the file cannot be executed, or has no such class.
    """
    kind: type = _load_class(code, name).value
    return kind


_classes: dict[tuple[SourceFile, str], Loaded] = {}
_objects: dict[UserScenarioSpec, Loaded] = {}


def _cache(entries: dict[Key, Loaded], key: Key, entry: Loaded) -> Loaded:
    """Store an entry; the oldest is dropped when there are `CACHE_SIZE`."""
    while len(entries) >= CACHE_SIZE and key not in entries:
        entries.pop(next(iter(entries)), None)
    entries[key] = entry
    return entry


def _unchanged(inputs: Mapping[str, InputFile]) -> bool:
    return all(file.unchanged for file in tuple(inputs.values()))


def classes_in(code: SourceFile) -> list[str]:
    """Execute a file, and list its classes that may be scenarios: those with one of `METHODS`.

    Raises `ScenarioError` when the file cannot be executed.
    """
    module, _ = _execute(code)
    classes = (value for value in _own_classes(module) if not value.__name__.startswith("_"))
    with in_user_code(code.file, "while it was read"):
        return [value.__name__ for value in classes if any(hasattr(value, method) for method in METHODS)]


def file_that_raised(failure: BaseException) -> str | None:
    """Return the user's file in whose code an exception was raised; none for other exceptions."""
    files, trace = {code.file for code, _ in _classes}, raised_by(failure).__traceback__
    while trace is not None:
        if (file := trace.tb_frame.f_code.co_filename) in files:
            return file
        trace = trace.tb_next
    return None


def _own_classes(module: types.ModuleType) -> list[type]:
    defined = (value for value in vars(module).values() if isinstance(value, type))
    return [value for value in defined if value.__module__ == module.__name__]


@contextmanager
def _former_names_shown() -> Iterator[None]:
    """Show that a user's file uses a former name of mcnav, which Python hides outside of the main module."""
    with warnings.catch_warnings():
        warnings.filterwarnings("default", r"mcnav\.\w+ is now mcnav\.", DeprecationWarning)
        yield


def _execute(code: SourceFile) -> tuple[types.ModuleType, OpenedFiles]:
    """Execute a file as a module, and note what it reads."""
    module = types.ModuleType(f"mcnav_own_{code.digest[:16]}")
    module.__file__ = code.file
    sys.modules[module.__name__] = module  # dataclasses and pickles look up the module of a class there
    linecache.cache[code.file] = (len(code.text), None, code.text.splitlines(keepends=True), code.file)

    def execute() -> None:
        exec(compile(code.text, code.file, "exec"), module.__dict__)

    try:
        with record_opened_files() as opened, _former_names_shown():
            _ask(code.file, "while it was read", f"{code.file} cannot be executed", execute)
    except ScenarioError:
        sys.modules.pop(module.__name__, None)
        raise
    return module, opened


def _load_class(code: SourceFile, name: str) -> Loaded:
    known = _classes.get((code, name))
    if known is not None and _unchanged(known.inputs):
        return known
    module, opened = _execute(code)
    loaded = getattr(module, name, None)
    if not isinstance(loaded, type):
        classes = [value.__name__ for value in _own_classes(module)]
        listed = f"; it has {', '.join(classes)}" if classes else ""
        raise ScenarioError("type", f"{code.file} has no class {name}{listed}")
    return _cache(_classes, (code, name), Loaded(loaded, find_inputs(opened, code.file)))
