"""Compilation of a function as a part of its callers, without machine code of its own, and of a loop over parts.

numba brings every function that it compiles to machine code, with a copy of all that it calls. Where a function is
only called by other compiled functions, which contain a copy of it again, that work is lost: a fifth of the time that
the kernels of aided navigation take to compile. A part is typed, lowered and optimised once; its callers contain it.
Left unoptimised until then, parts make code that is 5 % slower.

numba optimises the body of a function twice, before and after the functions that it calls become a part of it. A loop
over parts has nothing to optimise before, and takes long for it, as it hands descriptions of a hundred arrays around.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler


class _PartLibrary(JITCodeLibrary):  # type: ignore[misc]
    """Code to be linked into that of callers."""

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True


class _LoopLibrary(JITCodeLibrary):  # type: ignore[misc]
    """Code that is optimised once, with all that it calls."""

    def _optimize_functions(self, module: Any) -> None:
        module.data_layout = self._codegen._data_layout


class LoopCompiler(Compiler):  # type: ignore[misc]
    """numba's compiler of loops over parts."""

    def define_pipelines(self) -> Any:
        """Return the usual passes, but for the first optimisation."""
        state = self.state
        state.library = _LoopLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return super().define_pipelines()


class PartCompiler(Compiler):  # type: ignore[misc]
    """numba's compiler of parts. They are not cached: their callers are."""

    def define_pipelines(self) -> Any:
        """Return the usual passes, after which a part is known by an object where another function has its entry."""
        state = self.state
        state.library = _PartLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.targetctx.get_executable = lambda *_: object()  # this target is that of one function
        return super().define_pipelines()


def give_entry(part: Any, entry: Callable[[], Any]) -> None:
    """Let Python, where it calls a part, call what this returns instead."""
    part._insert = lambda *_: None
    part._compile_for_args = lambda *_, **__: entry()
