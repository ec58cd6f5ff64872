"""One way of compiling: kept on disk, free of the interpreter lock, contracted but never reassociated.

A function comes from the objects of an installation (`mcnav.compiled.objects`), or from where it was stored when it was
compiled, or is compiled. Compiled code has constants and inlined functions of other files. Stored code is therefore
valid for what all files of this package compute; comments and docstrings change nothing.

Where no folder can be written to, as in an installation for reading alone, functions that are not among the objects
are compiled in every process.

The code of a function contains a copy of each compiled function that it calls, optimised once more. A process that
compiles both calls the original, and a process that loads the caller from disk calls the copy, which may fuse other
multiplications with additions. `tests/cross/test_compiled.py` checks that both give the same bits. Where they do not,
the function that is called must be `inlined`.

An array assigned to a part of another takes numba two seconds in each of its kinds, for the message where shapes
differ; elements are assigned one by one.
"""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any, Final, TypeVar, cast

import numba

from mcnav.compiled.numba_private import (
    give_entry,
    ignore_literals,
    keep_call_types,
    keep_inlined,
    keep_values,
    known_options,
    listen_to_compiling,
    loop_options,
    number_at_random,
    part_options,
    use_store,
)
from mcnav.compiled.objects import Code, places_for
from mcnav.compiled.target import choose_target
from mcnav.execution.progress import COMPILATION, NotCompiled

Function = TypeVar("Function", bound=Callable[..., Any])


class _Watch:
    """Counts what is compiled, and lets no memory be collected meanwhile: most of it lasts.

    Looking through it would take a twentieth of the time. One function is compiled at a time, in whichever thread,
    with others that it calls within it. Where numba tells nothing, nothing is counted or refused.
    """

    _collects = True

    def on_start(self, event: Any) -> None:
        """Begin a function; it ends even where it is refused."""
        if COMPILATION.begun == 0:
            self._collects = gc.isenabled()
            gc.disable()
        COMPILATION.begun += 1
        if COMPILATION.refused:
            raise NotCompiled

    def on_end(self, event: Any) -> None:
        """End a function."""
        COMPILATION.begun -= 1
        COMPILATION.functions += not COMPILATION.refused
        if COMPILATION.begun == 0 and self._collects:
            gc.enable()


listen_to_compiling(_Watch)
choose_target()
number_at_random()
keep_call_types()
keep_values()
keep_inlined()

TOLD: Final = "MCNAV_TOLD_THAT_CODE_CANNOT_BE_STORED"
"""Variable of the environment that a command's worker processes have from it: they do not say it again."""


def _tell_that_code_cannot_be_stored(function: Callable[..., Any]) -> None:
    """Print one line for a command and its workers, which names the folders that numba has tried."""
    COMPILATION.stored = False
    if os.environ.get(TOLD):
        return
    os.environ[TOLD] = "1"
    places = " nor ".join(map(str, places_for(Path(function.__code__.co_filename))))
    remedy = "set NUMBA_CACHE_DIR to a folder that is, or every command compiles again"
    print(f"note: compiled code cannot be stored: neither {places} is writable; {remedy}", file=sys.stderr)


def _compile(function: Function, stored: bool = True, **options: Any) -> Function:
    """Compile a function once for a type.

    It has no second entry for callers written in C, whom there are none: that takes a tenth of the time.
    """
    options = known_options(error_model="numpy", nogil=True, no_cfunc_wrapper=True, **options)
    dispatcher = numba.njit(**options)(function)
    if stored:
        use_store(dispatcher, Code(function, _describe(options), _tell_that_code_cannot_be_stored))
    ignore_literals(dispatcher)
    return cast(Function, dispatcher)


def _describe(options: Mapping[str, Any]) -> str:
    """Return options as a text that is the same in each process."""
    shown = {name: sorted(value) if isinstance(value, set) else value for name, value in options.items()}
    return ", ".join(f"{name}={getattr(value, '__name__', value)}" for name, value in sorted(shown.items()))


def compiled(function: Function) -> Function:
    """Compile a numerical function with numba.

    ``contract`` lets the compiler fuse multiply and add. Nothing that would change the order of a sum is allowed, so
    a function gives the same bits for a sample wherever in a chunk it stands.
    """
    return _compile(function, fastmath={"contract"})


def allocation_free(function: Function) -> Function:
    """Compile a numerical function that allocates nothing.

    References to arrays are not counted in it, which would cost more than the arithmetic of short vectors.
    """
    return _compile(function, fastmath={"contract"}, _nrt=False)


def allocation_free_loop(function: Function) -> Function:
    """Compile a function that is `allocation_free`, and calls parts for all that it computes.

    Without arithmetic of its own, it has the same bits as one that is optimised twice.
    """
    return _compile(function, fastmath={"contract"}, _nrt=False, **loop_options())


def allocation_free_by_address(function: Function) -> Function:
    """Compile a function that is `allocation_free`, to be called by its address: callers do not contain it."""
    return _compile(function, fastmath={"contract"}, _nrt=False, no_cpython_wrapper=True)


def _compile_part(function: Function, **options: Any) -> Function:
    """Compile a function without an entry for Python and machine code of its own."""
    part = _compile(function, stored=False, **options, **part_options())
    give_entry(part, cache(lambda: _compile(function, **options)))
    return part


def allocation_free_part(function: Function) -> Function:
    """Compile a function that is `allocation_free` as a part of its callers, in the place of each call.

    A call would copy the descriptions of all arrays that it is given, a hundred numbers and more.
    Unlike `inlined`, its body is typed and lowered once, not wherever it is called.
    """
    return _compile_part(function, fastmath={"contract"}, _nrt=False, forceinline=True)


def allocation_free_subroutine(function: Function) -> Function:
    """Compile a function that is `allocation_free` as a part of its callers, which call it."""
    return _compile_part(function, fastmath={"contract"}, _nrt=False)


def uncontracted_subroutine(function: Function) -> Function:
    """Compile a function that is `uncontracted` and `allocation_free` as a part of its callers, which call it."""
    return _compile_part(function, fastmath=False, _nrt=False)


def allocation_free_uncontracted(function: Function) -> Function:
    """Compile a function that is `allocation_free` and `uncontracted`."""
    return _compile(function, fastmath=False, _nrt=False)


def uncontracted(function: Function) -> Function:
    """Compile a function whose results are the same bits wherever the compiler inlines it.

    Without a value of its own, numba would give it the caller's ``fastmath``.
    """
    return _compile(function, fastmath=False)


def compiled_with_caller(function: Function) -> Function:
    """Compile a function that is given functions, anew for each that calls it: numba cannot store it by itself.

    Its results are the same bits wherever it is, as those of an `uncontracted` function.
    """
    return _compile(function, stored=False, fastmath=False, forceinline=True)


def reduced_math(function: Function) -> Function:
    """Compile a sum over lanes, which may be taken in any order: the same one for the same lanes on one machine."""
    return _compile(function, fastmath={"contract", "reassoc"})


def inlined(function: Function) -> Function:
    """Compile a function so that its body stands wherever it is called: a call would break a vector loop."""
    return _compile(function, fastmath={"contract"}, inline="always")
