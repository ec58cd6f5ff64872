"""Machine code of kernels: that which comes with an installation, and that which is stored where it was compiled.

An installation's objects are in one folder for each processor (`mcnav.compiled.target`) and version. Its name,
`objects_folder`, has a digest of all that machine code depends on: the processor, Python, the libraries of which some
compile it and others have constants that it contains, and the content of all files whose functions and constants it may
contain. Where one differs there is no such folder, and code is compiled.

Within it a file is one function for one set of types (`CodeFiles`), and begins with what it was compiled from: the
content of the function's file, the types of its arguments, its byte code, and the processor. It is not read on where
one of them differs. Code that is stored where it was compiled is in such files as well.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import re
import sys
from collections.abc import Callable
from functools import cache, cached_property
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

import llvmlite
import llvmlite.binding as llvm
import numba
import numpy as np
from numba.core.caching import Cache, FunctionCache, IndexDataCacheFile
from numba.core.compiler import CompileResult

from mcnav.compiled.target import INTO, target

OBJECTS: Final = Path(__file__).with_name("objects")
"""Folder of an installation's objects; a checkout has none."""

ROOMS: Final = ("compiled", "numerics", "systems/reentry", "systems/steady", "systems/ins")
"""Folders of the package whose constants and functions compiled code may contain."""

UNCOMPILED: Final = {"tables", "recorded"}
"""Folders in them of which it contains nothing: campaign files, recordings."""


@cache
def sources_digest() -> str:
    """Digest the files whose constants and functions compiled code may contain."""
    package = Path(__file__).parents[1]
    files = sorted(
        file for room in ROOMS for file in (package / room).rglob("*.py") if not UNCOMPILED.intersection(file.parts)
    )
    files.append(package / "constants.py")
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()


@cache
def libraries() -> tuple[str, ...]:
    """Return the versions of libraries that compile, and of those from which constants are taken: steps of DOP853."""
    return numba.__version__, llvmlite.__version__, np.__version__, version("scipy")


@cache
def objects_folder() -> Path:
    """Return the folder of objects that this process may use, whether it exists or not."""
    python = f"{sys.implementation.cache_tag}{sys.abiflags}"
    needs = (target(), llvm.get_process_triple(), python, *libraries(), sources_digest())
    name = f"{target()}-{python}-{hashlib.sha256(chr(10).join(needs).encode()).hexdigest()[:32]}"
    return Path(os.environ.get(INTO, OBJECTS)) / name


@cache
def _digest_of_file(path: str) -> str:
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()


class CodeFiles(IndexDataCacheFile):  # type: ignore[misc]
    """Files of a function's code, one for each set of types of its arguments.

    numba lists its files in an index and numbers them. Processes that store code at the same time would take the same
    number, and one of them could load the code of the other. Here a file is named after what it is compiled from and
    begins with it; whichever process writes it last, it is whole and says what it is.
    """

    def save(self, key: Any, data: Any) -> None:
        """Store the code for a key, which has types, byte code and processor."""
        with self._open_for_write(str(self._path(key))) as file:
            for part in (self._version, (self._source_stamp, key), data):
                file.write(self._dump(part))

    def load(self, key: Any) -> Any:
        """Return the code for a key, if it is stored for the same version of numba and the same sources."""
        try:
            file = self._path(key).open("rb")
        except FileNotFoundError:
            return None
        with file:
            for part in (self._version, (self._source_stamp, key)):
                if pickle.load(file) != part:
                    return None
            return pickle.load(file)

    def _path(self, key: Any) -> Path:
        name = self._data_name_pattern.format(number=0).removesuffix("0.nbc")
        return Path(self._cache_path, f"{name}{hashlib.sha256(repr(key).encode()).hexdigest()[:16]}.nbc")


class Code(Cache):  # type: ignore[misc]
    """Cache of a function, as numba sees it: its objects come first, then its stored code if there is any.

    Parameters
    ----------
    stored : callable
        Returns numba's own cache, or none where it cannot write; called where there is no object.
    tell : callable
        Told of the function before it is compiled and cannot be stored.
    """

    def __init__(
        self,
        function: Callable[..., Any],
        stored: Callable[[], FunctionCache | None],
        tell: Callable[[Callable[..., Any]], None],
    ) -> None:
        self._py_func, self._find_stored, self._tell = function, stored, tell

    @cached_property
    def _objects(self) -> CodeFiles | None:
        folder, code = objects_folder(), self._py_func.__code__
        if INTO in os.environ:
            folder.mkdir(parents=True, exist_ok=True)
        elif not folder.is_dir():
            return None
        name = f"{self._py_func.__module__}.{self._py_func.__qualname__}-{code.co_firstlineno}"
        return CodeFiles(str(folder), re.sub("[<>]", "", name), _digest_of_file(code.co_filename))

    @cached_property
    def _stored(self) -> FunctionCache | None:
        return self._find_stored()

    @property
    def cache_path(self) -> Any:
        """Folder of stored code."""
        return None if self._stored is None else self._stored.cache_path

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return a function for types of arguments from its objects, or else from stored code; none if in neither."""
        target_context.refresh()
        if self._objects is not None:
            payload = self._objects.load(self._index_key(sig, target_context.codegen()))
            if payload is not None:
                return CompileResult._rebuild(target_context, *payload)
        if INTO in os.environ:
            return None
        if self._stored is None:
            self._tell(self._py_func)
            return None
        return self._stored.load_overload(sig, target_context)

    def save_overload(self, sig: Any, data: Any) -> None:
        """Store a function that has been compiled, as an object where objects are made."""
        if INTO not in os.environ:
            if self._stored is not None:
                self._stored.save_overload(sig, data)
        elif self._objects is not None and not data.library.has_dynamic_globals:
            self._objects.save(self._index_key(sig, data.codegen), data._reduce())
