"""Results of simulations of a user's class that are kept: one command simulates, the others read.

A file is named after the digest of what a result depends on and is known beforehand: text, class and settings, with
the content of files that settings name; how is computed; versions of Python, mcnav, and packages that the text
imports; the processor. It is read on where all that was noticed while it was computed is unchanged: files that the
class opened, and modules outside of installed packages. Then a few of the simulations are repeated, and must have the
same bits as before. Whatever else the class depends on, such as variables of the environment, so shows itself: what is
repeated has all variates of the noise, or all errors.
"""

from __future__ import annotations

import ast
import hashlib
import json
import platform
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from math import prod
from pathlib import Path
from typing import Final

import numpy as np
from pydantic import ValidationError

from mcnav.arrays.types import Array
from mcnav.caches.stored import VARIABLE, Cache, DamagedError
from mcnav.compiled.target import target
from mcnav.entries.inputs import InputFile, content_of, own_modules
from mcnav.execution.progress import duration, note
from mcnav.files.records import Record
from mcnav.systems.guard import LINEARIZING
from mcnav.systems.user.code import Loaded, UserScenarioSpec

FORMAT: Final = 2
"""Version of the content of a file."""

KEPT_FROM: Final = 1.0
"""Seconds of computing from which on a result is kept."""

TOLD_FROM: Final = 10.0
"""Seconds of computing from which on they are told beforehand."""

NUMBERS: Final = np.dtype("<f8")


@dataclass(frozen=True)
class Kind:
    """A kind of results.

    Attributes
    ----------
    cache : Cache
        Where they are kept.
    computed : tuple
        How they are computed: numbers and texts on which they depend besides the class.
    doing, kept, anew : str
        What computing is, "… was kept", and what is done where a kept result is not valid, for messages.
    """

    cache: Cache
    computed: tuple[object, ...]
    doing: str
    kept: str
    anew: str

    def tell(self, seconds: float) -> None:
        """Print how long computing will take, where that is long."""
        if seconds < TOLD_FROM:
            return
        kept = "kept for the next commands" if self.cache.writable else f"not kept: {self._nowhere()}"
        note(f"{self.doing}: about {duration(seconds)} on this machine, {kept}")

    def _nowhere(self) -> str:
        folder = self.cache.folder
        place = "there is no home folder" if folder is None else f"{folder} is not writable"
        return f"{place}; set {VARIABLE} to a folder that is"


@dataclass(frozen=True)
class KeptNumbers:
    """Numbers that were simulated, and how many variates of noise a simulation had, where that counts."""

    arrays: tuple[Array, ...]
    variates: int | None = None


class _Header(Record):
    """First line of a file; the numbers of `KeptNumbers` follow it.

    Attributes
    ----------
    key : dict
        What the name of the file is a digest of.
    read : dict
        SHA-256 of the files that the class opened, and of modules, by path.
    """

    key: dict[str, object]
    read: dict[str, str]
    shapes: list[list[int]]
    variates: int | None


def keep(
    loaded: Loaded,
    spec: UserScenarioSpec,
    kind: Kind,
    repeats: Callable[[KeptNumbers], bool],
    simulate: Callable[[], KeptNumbers],
) -> KeptNumbers:
    """Return a result of a user's class: that of an earlier command, or simulated now.

    Parameters
    ----------
    repeats : callable
        Whether the class still simulates what it did for a result.

    Raises
    ------
    ScenarioError
        When a file changes that the class reads; and what ``simulate`` raises.
    """
    key = _key(spec, kind)
    name = hashlib.sha256(json.dumps(key, sort_keys=True).encode()).hexdigest()
    known = _read(kind, name, key, loaded.inputs)
    began = time.perf_counter()
    with loaded.recording(spec.code.file, LINEARIZING):
        if known is not None:
            if repeats(known):
                return known
            note(f"{spec.code.file} no longer simulates what it did when {kind.kept}; {kind.anew}")
        result = simulate()
    if time.perf_counter() - began >= KEPT_FROM:
        read = {path: file.digest for path, file in loaded.inputs.items()} | _digests_of_modules()
        shapes = [list(array.shape) for array in result.arrays]
        described = _Header(key=key, read=read, shapes=shapes, variates=result.variates)
        header = json.dumps(described.to_json() | {"variates": result.variates}).encode()
        kind.cache.write(name, b"".join([header, b"\n", *(array.astype(NUMBERS).tobytes() for array in result.arrays)]))
    return result


def _read(kind: Kind, name: str, key: Mapping[str, object], inputs: Mapping[str, InputFile]) -> KeptNumbers | None:
    """Read a kept result; none where there is none, or what was noticed meanwhile has changed."""
    try:
        content = kind.cache.read(name)
        if content is None:
            return None
        header, _, numbers = content.partition(b"\n")
        described = _Header.model_validate_json(header)
        if described.key != key or not _unchanged(described.read, inputs):
            return None
        values = np.frombuffer(numbers, NUMBERS).astype(float)
        ends = np.cumsum([prod(shape) for shape in described.shapes])
        if len(values) != (ends[-1] if len(ends) else 0):
            return None
        parts = np.split(values, ends[:-1])
        arrays = tuple(part.reshape(shape) for part, shape in zip(parts, described.shapes, strict=True))
        return KeptNumbers(arrays, described.variates)
    except DamagedError as damaged:
        note(f"{damaged}; {kind.anew}")
    except (ValidationError, ValueError):  # of another version
        pass
    return None


def _unchanged(read: Mapping[str, str], inputs: Mapping[str, InputFile]) -> bool:
    """Return whether files have these digests, and those noticed in this process are among them."""
    try:
        return all(content_of(path)[0] == digest for path, digest in read.items()) and all(
            read.get(path) == file.digest for path, file in inputs.items()
        )
    except OSError:
        return False


def _digests_of_modules() -> dict[str, str]:
    digests = {}
    for path in own_modules():
        try:
            digests[path] = content_of(path)[0]
        except OSError:
            continue
    return digests


def _key(spec: UserScenarioSpec, kind: Kind) -> dict[str, object]:
    """Collect what a result depends on and is known before it, as JSON."""
    settings = {name: _described(value) for name, value in spec.settings}
    packages = {name: _version(name) for name in _imported(spec.code.text)}
    return {
        "format": FORMAT,
        "code": spec.code.digest,
        "file": spec.code.file,
        "class": spec.name,
        "settings": settings,
        "computed": list(kind.computed),
        "program": [version("mcnav"), _program()],
        "python": [
            platform.python_implementation(),
            platform.python_version(),
            platform.system(),
            platform.machine(),
            target(),
        ],
        "packages": {name: _version(name) for name in ("numpy", "scipy")} | packages,
    }


def _described(value: object) -> str:
    """Describe a setting: a file by its place and content, others as they are."""
    return f"{value.path} {value.digest}" if isinstance(value, InputFile) else repr(value)


@cache
def _program() -> str:
    """Digest the files by which a class is called."""
    room = Path(__file__).parent
    files = [*sorted(room.glob("*.py")), room.parent / "sample_loop.py"]
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()


@cache
def _imported(text: str) -> tuple[str, ...]:
    """Return the packages that a text imports, wherever in it."""
    names = set[str]()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            names |= {name.name.partition(".")[0] for name in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module.partition(".")[0])
    return tuple(sorted(names))


def _version(package: str) -> str:
    """Return the version of an installed package; empty for modules of Python, and what is named differently."""
    try:
        return version(package)
    except PackageNotFoundError:
        return ""
