"""All that is used of numba without being part of its public interface, and what takes its place where it is missing.

Another version of numba may have another name, or none. `PRIVATE` lists the names by what they serve; where one of
them is missing, all that it serves is done in a public way: slower, with the same results.
"""

from __future__ import annotations

import secrets
from collections import Counter, defaultdict
from collections.abc import Callable, Mapping
from functools import cache
from importlib import import_module
from typing import Any, Final

import numba
from numba import types
from numba.extending import intrinsic

NUMBERS: Final = "numbers"
CALLS: Final = "calls"
VALUES: Final = "values"
INLINED: Final = "inlined"
PARTS: Final = "parts"
STORED: Final = "stored"
LITERALS: Final = "literals"
ADDRESSES: Final = "addresses"
EVENTS: Final = "events"

PRIVATE: Final[Mapping[str, tuple[str, ...]]] = {
    NUMBERS: ("numba.core.bytecode.FunctionIdentity._unique_ids",),
    CALLS: (
        "numba.core.targetconfig.ConfigStack.top_or_none",
        "numba.core.types.functions.BaseFunction.get_call_type",
        "numba.core.types.functions.BaseFunction.get_impl_key",
    ),
    VALUES: (
        "numba.core.analysis.compute_cfg_from_blocks",
        "numba.core.analysis.compute_use_defs",
        "numba.core.analysis.must_use_alloca",
        "numba.core.controlflow.CFGraph.dominators",
        "numba.core.ir.Assign",
        "numba.core.ir.Block.find_insts",
        "numba.core.lowering.Lower._find_singly_assigned_variable",
    ),
    INLINED: ("numba.core.inline_closurecall.InlineWorker.run_untyped_passes",),
    PARTS: (
        "numba.core.codegen.JITCodeLibrary._finalize_dynamic_globals",
        "numba.core.codegen.JITCodeLibrary._finalize_final_module",
        "numba.core.codegen.JITCodeLibrary._optimize_functions",
        "numba.core.codegen.JITCodeLibrary._verify_declare_only_symbols",
        "numba.core.codegen.JITCodeLibrary.enable_object_caching",
        "numba.core.compiler.Compiler.define_pipelines",
        "numba.core.dispatcher.Dispatcher._compile_for_args",
        "numba.core.dispatcher.Dispatcher._insert",
        "numba.core.cpu.CPUTargetOptions.no_cpython_wrapper",
    ),
    STORED: (
        "numba.core.codegen.JITCodeLibrary.has_dynamic_globals",
        "numba.core.compiler.CompileResult._rebuild",
        "numba.core.compiler.CompileResult._reduce",
        "numba.core.dispatcher.Dispatcher.enable_caching",
        "numba.core.serialize.dumps",
    ),
    LITERALS: ("numba.core.dispatcher.Dispatcher.get_call_template", "numba.core.types.unliteral"),
    ADDRESSES: (
        "numba.core.callconv.CPUCallConv.call_function",
        "numba.core.callconv.CPUCallConv.get_function_type",
        "numba.core.cgutils.unpack_tuple",
        "numba.core.codegen.JITCodeLibrary.get_pointer_to_function",
        "numba.core.compiler.CompileResult.fndesc",
        "numba.core.funcdesc.FunctionDescriptor.llvm_func_name",
    ),
    EVENTS: ("numba.core.event.Listener", "numba.core.event.register"),
}
"""Names by what they serve."""

OPTIONS: Final = ("_nrt", "forceinline", "no_cfunc_wrapper", "no_cpython_wrapper")
"""Options of `numba.njit` that are not documented: without them code is compiled that nothing uses."""


def find_name(name: str) -> Any:
    """Return what numba has under a name; none where it has nothing.

    >>> find_name("numba.core.serialize.no_such_name") is None
    True
    """
    module, _, path = name.partition(".")
    value: Any = import_module(module)
    for attribute in path.split("."):
        try:
            value = getattr(value, attribute, None) or import_module(f"{value.__name__}.{attribute}")
        except (AttributeError, ImportError):
            return None
    return value


def has(purpose: str) -> bool:
    """Return whether numba has all private names that serve a purpose."""
    return all(find_name(name) is not None for name in PRIVATE[purpose])


def known_options(**options: Any) -> dict[str, Any]:
    """Return options of `numba.njit` without those private ones that it has not."""
    private = {name for name in OPTIONS if find_name(f"numba.core.cpu.CPUTargetOptions.{name}") is None}
    return {name: value for name, value in options.items() if name not in private}


def number_at_random() -> None:
    """Let numba name what it compiles, and its constants, by numbers at random; its own begin with one in each process.

    A function that is compiled beside a caller loaded from disk could then have the name of the copy that the caller
    contains, and be stored with constants that it shares with that copy: later processes that load both could not call
    it. Without this no code should be stored (`can_store`).
    """
    if has(NUMBERS):
        identity = find_name("numba.core.bytecode.FunctionIdentity")
        identity._unique_ids = iter(lambda: secrets.randbits(48), None)


class _Options:
    """Numbers of the options that functions are compiled with: equal ones have the same number."""

    def __init__(self) -> None:
        self._last: Any = None
        self._number = 0
        self._known: list[dict[str, Any]] = []

    def number(self, options: Any) -> int:
        """Return the number of the options of the function that is being compiled; none are a kind of their own.

        numba makes an object of them for each function, and compares all of them at each comparison of such objects.
        """
        if options is not self._last or options is None:
            values = {} if options is None else options.values()
            if values not in self._known:
                self._known.append(values)
            self._last, self._number = options, self._known.index(values)
        return self._number


def keep_call_types() -> None:
    """Let numba resolve a call of a function once for types of arguments and options of callers, not wherever it is.

    An operator has some twenty definitions, which are tried in turn: a quarter of the time of compiling.
    """
    if not has(CALLS):
        return
    base, current = find_name("numba.core.types.functions.BaseFunction"), find_name(PRIVATE[CALLS][0])
    resolve, options = base.get_call_type, _Options()

    def call_type(function: Any, context: Any, arguments: Any, keywords: Any) -> Any:
        """Return the signature of a call, and let the function know how it is implemented."""
        if keywords or not hasattr(function, "_impl_keys"):
            return resolve(function, context, arguments, keywords)
        call = context, arguments, options.number(current())
        resolved = function.__dict__.setdefault("_resolved", {})
        if call not in resolved:
            signature = resolve(function, context, arguments, keywords)
            resolved[call] = signature, function.get_impl_key(signature)
        signature, function._impl_keys[signature.args] = resolved[call]
        return signature

    base.get_call_type = call_type


def keep_values() -> None:
    """Let numba keep what is assigned once as a value wherever it is used, not in memory.

    By itself it does so within one block of code. A tuple of a hundred arrays is otherwise written to memory, and read
    whole in each block that uses one of them: the loop of aided samples then has 125,000 lines of LLVM, of which 74,000
    are such reads, taken apart. Only functions that count no references are compiled so.
    """
    if not has(VALUES):
        return
    lower = find_name("numba.core.lowering.Lower")
    find = lower._find_singly_assigned_variable

    def find_values(self: Any) -> None:
        find(self)
        if not (getattr(self.context, "enable_nrt", True) or self.func_ir.func_id.is_generator):
            values: set[str] = getattr(self, "_singly_assigned_vars", set())
            values |= _values_beyond_blocks(self.func_ir.blocks)

    lower._find_singly_assigned_variable = find_values


def _values_beyond_blocks(blocks: Mapping[int, Any]) -> set[str]:
    """Return variables that are assigned once, in a block that each block that uses them comes after on every way."""
    graph, of_blocks, in_memory = (find_name(name)(blocks) for name in PRIVATE[VALUES][:3])
    assign = find_name("numba.core.ir.Assign")
    ways, assigned = graph.dominators(), Counter(
        statement.target.name for block in blocks.values() for statement in block.find_insts(assign)
    )  # fmt: skip
    used = defaultdict(list)
    for label, names in of_blocks.usemap.items():
        for name in names:
            used[name].append(label)
    return {
        name
        for label, names in of_blocks.defmap.items()
        for name in names - in_memory
        # code of blocks is made in the order of their labels
        if assigned[name] == 1 and all(user > label and label in ways[user] for user in used[name])
    }


def keep_inlined() -> None:
    """Let numba read a function once that is inlined wherever it is called: its callers copy what was read."""
    if not has(INLINED):
        return
    worker, options = find_name("numba.core.inline_closurecall.InlineWorker"), _Options()
    read, kept = worker.run_untyped_passes, dict[Any, Any]()

    def read_once(self: Any, function: Any, enable_ssa: bool = False) -> Any:
        self.flags.enable_ssa = enable_ssa  # as numba does, also for the caller
        key = function, options.number(self.flags)
        if key not in kept:
            kept[key] = read(self, function, enable_ssa)
        return kept[key]

    worker.run_untyped_passes = read_once


@cache
def _pipelines() -> tuple[type, type]:
    """Return numba's compilers of parts and of loops over parts.

    numba brings every function that it compiles to machine code, with a copy of all that it calls. Where a function is
    only called by other compiled functions, which contain a copy of it again, that work is lost: a fifth of the time
    that the kernels of aided navigation take to compile. A part is typed, lowered and optimised once; its callers
    contain it. Left unoptimised until then, parts make code that is 5 % slower.

    numba optimises the body of a function twice, before and after the functions that it calls become a part of it. A
    loop over parts has nothing to optimise before, and takes long for it, as it hands descriptions of a hundred arrays
    around.
    """
    library, compiler = find_name("numba.core.codegen.JITCodeLibrary"), find_name("numba.core.compiler.Compiler")

    class PartLibrary(library):  # type: ignore[misc, valid-type]
        """Code to be linked into that of callers."""

        def _finalize_final_module(self) -> None:
            self._finalize_dynamic_globals()
            self._verify_declare_only_symbols()
            self._finalized = True

    class LoopLibrary(library):  # type: ignore[misc, valid-type]
        """Code that is optimised once, with all that it calls."""

        def _optimize_functions(self, module: Any) -> None:
            layout = getattr(self.codegen, "_data_layout", None)
            if layout is None:  # of another numba
                super()._optimize_functions(module)
            else:
                module.data_layout = layout

    class PartCompiler(compiler):  # type: ignore[misc, valid-type]
        """Compiler of parts. They are not stored: their callers are."""

        def define_pipelines(self) -> Any:
            """Return the usual passes, after which a part is known by an object where others have their entry."""
            state = self.state
            state.library = PartLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
            state.targetctx.get_executable = lambda *_: object()  # this target is that of one function
            return super().define_pipelines()

    class LoopCompiler(compiler):  # type: ignore[misc, valid-type]
        """Compiler of loops over parts."""

        def define_pipelines(self) -> Any:
            """Return the usual passes, but for the first optimisation."""
            state = self.state
            state.library = LoopLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
            state.library.enable_object_caching()
            return super().define_pipelines()

    return PartCompiler, LoopCompiler


def part_options() -> dict[str, Any]:
    """Return options by which a function is a part of its callers, without an entry for Python; else none."""
    return {"pipeline_class": _pipelines()[0], "no_cpython_wrapper": True} if has(PARTS) else {}


def loop_options() -> dict[str, Any]:
    """Return options by which a function is a loop over parts; else none."""
    return {"pipeline_class": _pipelines()[1]} if has(PARTS) else {}


def give_entry(part: Any, entry: Callable[[], Any]) -> None:
    """Let Python, where it calls a part, call what this returns instead; a function with an entry keeps its own."""
    if has(PARTS):
        part._insert = lambda *_: None
        part._compile_for_args = lambda *_, **__: entry()


def ignore_literals(dispatcher: Any) -> None:
    """Let a function be compiled once for a type; numba would compile it again for each constant that is passed."""
    if has(LITERALS):
        template, unliteral = dispatcher.get_call_template, numba.types.unliteral
        dispatcher.get_call_template = lambda arguments, keywords: template(
            tuple(map(unliteral, arguments)), {name: unliteral(of) for name, of in keywords.items()}
        )


def can_store() -> bool:
    """Return whether code can be stored: otherwise each process compiles what it needs."""
    return has(STORED) and has(NUMBERS)


def use_store(dispatcher: Any, store: Any) -> None:
    """Let a function look for its code in a store (`mcnav.compiled.objects.Code`), if code can be stored."""
    if can_store():
        dispatcher._cache = store


def write_code(compiled: Any) -> bytes | None:
    """Return a compiled function as bytes; none where it contains addresses of this process."""
    if compiled.library.has_dynamic_globals:
        return None
    written: bytes = find_name("numba.core.serialize.dumps")(compiled._reduce())
    return written


def read_code(context: Any, content: Any) -> Any:
    """Return the compiled function of what `write_code` has written, unpickled."""
    return find_name("numba.core.compiler.CompileResult")._rebuild(context, *content)


def address_of(dispatcher: Any, arguments: tuple[Any, ...]) -> int:
    """Return the address in this process of a function's machine code for types of arguments."""
    dispatcher.compile(arguments)
    compiled = dispatcher.overloads[arguments]
    address: int = compiled.library.get_pointer_to_function(compiled.fndesc.llvm_func_name)
    return address


def call_by_address(arguments: tuple[Any, ...] = ()) -> Any:
    """Return a compiled function of an address and arguments of these types, which calls what is there.

    Without types they are those of each call. It returns what has the type of the first argument. What is called must
    have been compiled for these types, and raises nothing.
    """

    @intrinsic  # type: ignore[untyped-decorator]
    def call(_: Any, address: Any, *given: Any) -> Any:
        taken = arguments or tuple(map(types.unliteral, given))

        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            convention, returned = context.call_conv, taken[0]
            function = convention.get_function_type(returned, taken).as_pointer()
            pointer = builder.inttoptr(values[0], function)
            passed = find_name("numba.core.cgutils.unpack_tuple")(builder, values[1])
            return convention.call_function(builder, pointer, returned, taken, passed)[1]

        return taken[0](address, types.StarArgTuple(taken)), generate

    return call


def listen_to_compiling(listener: type) -> None:
    """Tell an object of a class when a function begins and ends to be compiled; nobody where numba tells nothing."""
    if has(EVENTS):
        base, register = map(find_name, PRIVATE[EVENTS])
        register("numba:compile", type(listener.__name__, (listener, base), {})())
