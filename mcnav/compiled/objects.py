"""Machine code of kernels: that which comes with an installation, and that which is stored where it was compiled.

An installation's objects are in one folder for each processor (`mcnav.compiled.target`) and version. Its name,
`objects_folder`, has a digest of all that machine code depends on: the processor, Python, the libraries of which some
compile it and others have constants that it contains, and what all files compute whose functions and constants it may
contain (`mcnav.compiled.code`): not their docstrings and comments. Where one differs there is no such folder, and code
is compiled.

Within it a file is one function for one set of types (`CodeFiles`), and begins with what it was compiled from: the code
of the function's file and of the function, the types of its arguments, options, and the processor. It is not read on
where one of them differs. Code that is stored where it was compiled is in such files as well.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import re
import sys
import tempfile
from collections.abc import Callable, Iterator
from functools import cache, cached_property
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

import llvmlite
import llvmlite.binding as llvm
import numba
import numpy as np

from mcnav.compiled.code import digest_of_files, digest_of_function
from mcnav.compiled.numba_private import read_code, write_code
from mcnav.compiled.target import INTO, target
from mcnav.files.whole import write_whole

OBJECTS: Final = Path(__file__).with_name("objects")
"""Folder of an installation's objects; a checkout has none."""

ROOMS: Final = ("compiled", "numerics", "systems/reentry", "systems/steady", "systems/ins")
"""Folders of the package whose constants and functions compiled code may contain."""

FILES: Final = ("physics/constants.py", "arrays/products.py", "sampler/normals.py")
"""Files besides whose constants and functions it may contain."""

UNCOMPILED: Final = {"tables", "recorded"}
"""Folders in them of which it contains nothing: campaign files, recordings."""


def _is_of_a_sensor(file: Path) -> bool:
    """Return whether a file defines a quantity or a type of sensor, whose innovation is compiled by itself."""
    return (
        file.parent.name == "sensors" and re.search(rb"^(QUANTITY|SENSOR): Final", file.read_bytes(), re.M) is not None
    )


@cache
def sources_digest() -> str:
    """Digest what the files compute whose constants and functions compiled code may contain.

    Reading them takes half a second: beside stored code there is a file with the digest, and that of the contents for
    which it is valid.
    """
    package = Path(__file__).parents[1]
    files = sorted(file for room in ROOMS for file in (package / room).rglob("*.py") if _is_in_a_room(file))
    files += [package / name for name in FILES]
    contents = hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()
    folder = place_for(Path(__file__))
    if folder is None:
        return digest_of_files(files)
    kept = folder / f"sources.{_python()}.txt"
    valid_for, _, digest = kept.read_text(encoding="ascii").partition(" ") if kept.exists() else ("", "", "")
    if valid_for != contents:
        digest = digest_of_files(files)
        write_whole(kept, f"{contents} {digest}".encode("ascii"))
    return digest


@cache
def libraries() -> tuple[str, ...]:
    """Return the versions of libraries that compile, and of those from which constants are taken: steps of DOP853."""
    return numba.__version__, llvmlite.__version__, np.__version__, version("scipy")


def _python() -> str:
    return f"{sys.implementation.cache_tag}{getattr(sys, 'abiflags', '')}"  # Windows has no such flags


@cache
def objects_folder() -> Path:
    """Return the folder of objects that this process may use, whether it exists or not."""
    needs = (target(), llvm.get_process_triple(), _python(), *libraries(), sources_digest())
    name = f"{target()}-{_python()}-{hashlib.sha256(chr(10).join(needs).encode()).hexdigest()[:32]}"
    return Path(os.environ.get(INTO, OBJECTS)) / name


def places_for(file: Path) -> Iterator[Path]:
    """Yield the folders in which the code of a file may be stored, the first one first.

    A folder that the user names, one beside the file, and one of the user's caches, unless the user has no home.
    """
    name = f"{file.parent.name}_{hashlib.sha256(str(file.parent).encode()).hexdigest()[:16]}"
    if numba.config.CACHE_DIR:
        yield Path(numba.config.CACHE_DIR, name)
    yield file.parent / "__pycache__"
    from platformdirs import user_cache_path  # which most commands do without

    of_user = user_cache_path("numba", appauthor=False)
    if of_user.is_absolute():
        yield of_user / name


def place_for(file: Path) -> Path | None:
    """Return the first of `places_for` that can be written to, and make it; none where none can."""
    return _place_in(file.parent)


@cache
def _place_in(folder: Path) -> Path | None:
    return next(filter(_is_writable, places_for(folder / "any")), None)


def _is_writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


@cache
def _digest_of_file(file: Path) -> str:
    return digest_of_files([file])


def _is_in_a_room(file: Path) -> bool:
    """Return whether a file is one of those of `sources_digest`."""
    package = Path(__file__).parents[1]
    within = any(package / room in file.parents for room in ROOMS) and not UNCOMPILED.intersection(file.parts)
    return within and not _is_of_a_sensor(file)


class CodeFiles:
    """Files of a function's code, one for each set of types of its arguments.

    A file is named after what it is compiled from and begins with it; whichever process writes it last, it is whole and
    says what it is.
    """

    def __init__(self, folder: Path, name: str, stamp: Any) -> None:
        self.folder, self._name, self._stamp = folder, name, stamp

    def save(self, key: Any, code: bytes) -> None:
        """Store the code for a key, which has types, the function's own code and processor."""
        write_whole(self._path(key), pickle.dumps((self._stamp, key)) + code)

    def load(self, key: Any) -> Any:
        """Return the unpickled code for a key, if it is stored for the same sources."""
        try:
            file = self._path(key).open("rb")
        except FileNotFoundError:
            return None
        with file:
            try:
                stored = pickle.load(file)
            except (ImportError, AttributeError):  # of a type that has moved since, hence of other sources
                return None
            return pickle.load(file) if stored == (self._stamp, key) else None

    def _path(self, key: Any) -> Path:
        return self.folder / f"{self._name}.{hashlib.sha256(repr(key).encode()).hexdigest()[:16]}.nbc"


class Code:
    """Code of a function, as numba asks for it: its objects come first, then its stored code if there is any.

    Parameters
    ----------
    options : str
        All options that the function is compiled with.
    tell : callable
        Told of the function before it is compiled and cannot be stored.
    """

    def __init__(self, function: Callable[..., Any], options: str, tell: Callable[[Callable[..., Any]], None]) -> None:
        self._function, self._options, self._tell = function, options, tell

    @cached_property
    def _objects(self) -> CodeFiles | None:
        folder = objects_folder()
        if INTO in os.environ:
            folder.mkdir(parents=True, exist_ok=True)
        elif not folder.is_dir():
            return None
        return self._files(folder, ())

    @cached_property
    def _stored(self) -> CodeFiles | None:
        folder = place_for(Path(self._function.__code__.co_filename))
        return None if folder is None else self._files(folder, (*libraries(), sources_digest()))

    def _files(self, folder: Path, needs: tuple[str, ...]) -> CodeFiles:
        name = f"{self._function.__module__}.{self._function.__qualname__}.{_python()}".translate({60: None, 62: None})
        file = Path(self._function.__code__.co_filename)
        return CodeFiles(folder, name, needs if _is_in_a_room(file) else (*needs, _digest_of_file(file)))

    @cached_property
    def _digest(self) -> str:
        return digest_of_function(self._function)

    def _key(self, signature: Any, processor: Any) -> Any:
        return signature, processor.magic_tuple(), self._digest, self._options

    @property
    def cache_path(self) -> str | None:
        """Folder of stored code."""
        return None if self._stored is None else str(self._stored.folder)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return a function for types of arguments from its objects, or else from stored code; none if in neither."""
        target_context.refresh()
        key = self._key(sig, target_context.codegen())
        code = None if self._objects is None else self._objects.load(key)
        if code is None and INTO not in os.environ:
            if self._stored is None:
                self._tell(self._function)
                return None
            code = self._stored.load(key)
        return None if code is None else read_code(target_context, code)

    def save_overload(self, sig: Any, data: Any) -> None:
        """Store a function that has been compiled, as an object where objects are made."""
        files = self._objects if INTO in os.environ else self._stored
        code = None if files is None else write_code(data)
        if files is not None and code is not None:
            files.save(self._key(sig, data.codegen), code)
