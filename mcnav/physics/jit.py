"""One way of compiling: cached on disk, free of the interpreter lock, contracted but never reassociated."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(function: Function) -> Function:
    """Compile a numerical function with numba.

    ``contract`` lets the compiler fuse multiply and add. Nothing that would change the order of a sum is allowed, so
    a function gives the same bits for a sample wherever in a chunk it stands.
    """
    decorate = numba.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
    return cast(Function, decorate(function))


def reduced_math(function: Function) -> Function:
    """Compile a sum over lanes, which may be taken in any order: the same one for the same lanes on one machine."""
    decorate = numba.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "reassoc"})
    return cast(Function, decorate(function))


def inlined(function: Function) -> Function:
    """Compile a function so that its body stands wherever it is called: a call would break a vector loop."""
    decorate = numba.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"}, inline="always")
    return cast(Function, decorate(function))
