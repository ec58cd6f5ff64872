"""Digests of what code computes: without comments, docstrings and numbers of lines.

A file is read as Python reads it, as byte code, which has no comments. Annotations are part of it.
"""

from __future__ import annotations

import dis
import hashlib
from collections.abc import Callable, Iterable
from inspect import CO_NEWLOCALS
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any, Final

import numpy as np

Content = tuple[Any, ...]
"""Instructions, constants and names of code, all of which `repr` writes alike in every process."""

_STORES_DOCSTRING: Final = dis.opmap["STORE_NAME"]


def digest_of_files(paths: Iterable[Path]) -> str:
    """Digest what files compute, in the order given."""
    contents = [_content(_read(path)) for path in paths]
    return hashlib.sha256(repr(contents).encode()).hexdigest()


def digest_of_function(function: Callable[..., Any]) -> str:
    """Digest what a function computes, with what it takes from functions that it is in: not what is global."""
    cells = () if function.__closure__ is None else function.__closure__
    values = [_value(cell.cell_contents) for cell in cells]
    return hashlib.sha256(repr((_content(function.__code__), values)).encode()).hexdigest()


def _value(value: Any) -> Any:
    """Return what a value of a function is: of another function its code, of a compiled one that of its function."""
    value = getattr(value, "py_func", value)
    if isinstance(value, np.ndarray):  # which `repr` shortens
        return str(value.dtype), value.shape, value.tobytes()
    return digest_of_function(value) if isinstance(value, FunctionType) else value


def _read(path: Path) -> CodeType:
    """Return a file's code; what Python keeps of it may be that of a second before."""
    code: CodeType = compile(path.read_bytes(), str(path), "exec", dont_inherit=True)
    return code


def _content(code: CodeType) -> Content:
    docstring = _place_of_docstring(code)
    constants = [None if number == docstring else _constant(value) for number, value in enumerate(code.co_consts)]
    return (
        code.co_name, code.co_flags, code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, code.co_code,
        code.co_exceptiontable, code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars, constants,
    )  # fmt: skip


def _constant(value: Any) -> Any:
    if isinstance(value, CodeType):
        return _content(value)
    if isinstance(value, tuple):
        return tuple(_constant(member) for member in value)
    if isinstance(value, frozenset):  # its order is another in each process
        return "set", sorted(repr(_constant(member)) for member in value)
    return value


def _place_of_docstring(code: CodeType) -> int | None:
    """Return the number of the constant that is the docstring of code; none where it has none.

    That of a function is its first constant, if that is a text: other code begins with ``<``, and may have any constant
    first. A module or a class stores its own under a name.
    """
    if code.co_flags & CO_NEWLOCALS and not code.co_name.startswith("<"):
        return 0 if code.co_consts and isinstance(code.co_consts[0], str) else None
    if "__doc__" not in code.co_names:
        return None
    storing = bytes((_STORES_DOCSTRING, code.co_names.index("__doc__")))
    at = next((at for at in range(2, len(code.co_code), 2) if code.co_code[at : at + 2] == storing), None)
    return None if at is None else code.co_code[at - 1]
