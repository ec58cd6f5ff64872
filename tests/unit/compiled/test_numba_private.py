"""Names of numba that are not public: each is there, and without it the same is computed in a public way."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest
from numba.core.lowering import Lower
from numba.core.types.functions import BaseFunction
from numba.extending import overload

from mcnav.compiled import jit, numba_private
from mcnav.compiled.numba_private import OPTIONS, PRIVATE, find_name, has
from tests.conftest import PACKAGE

NAMES = [(purpose, name) for purpose, names in PRIVATE.items() for name in names]


@pytest.mark.parametrize(("purpose", "name"), NAMES)
def test_numba_has_a_private_name(purpose: str, name: str) -> None:
    assert find_name(name) is not None, f"numba {numba.__version__} has no {name}: {purpose} are slower without it"


@pytest.mark.parametrize("option", OPTIONS)
def test_numba_has_an_option(option: str) -> None:
    assert find_name(f"numba.core.cpu.CPUTargetOptions.{option}") is not None


def test_objects_have_what_is_used_of_them() -> None:
    dispatcher = numba.njit(lambda number: number + 1)
    dispatcher(1)
    (overloaded,) = dispatcher.overloads.values()
    assert all(hasattr(dispatcher, name) for name in ("_cache", "overloads"))
    assert all(hasattr(overloaded.library, name) for name in ("codegen", "_finalized"))
    assert hasattr(overloaded.library.codegen, "_data_layout")
    assert hasattr(overloaded.library.codegen, "magic_tuple")
    assert hasattr(numba.core.registry.cpu_target.target_context, "enable_nrt")
    assert hasattr(numba.core.registry.cpu_target.typing_context.resolve_value_type(np.sqrt), "_impl_keys")


def test_no_other_module_imports_what_is_private() -> None:
    """What is not public has a name in `PRIVATE`, and hence something that takes its place."""
    importing = re.compile(r"(?m)^\s*(?:from|import) (?:numba\.core|llvmlite\.(?!binding))\S*")
    found = {str(path): importing.findall(path.read_text(encoding="utf-8")) for path in PACKAGE.rglob("*.py")}
    assert not {path: lines for path, lines in found.items() if lines}


@pytest.fixture
def without(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> str:
    """Remove a name."""
    removed: str = request.param
    monkeypatch.setattr(numba_private, "find_name", lambda name: None if name == removed else find_name(name))
    return removed


@pytest.mark.parametrize("without", [name for _, name in NAMES], indirect=True)
def test_without_a_name_its_purpose_is_served_otherwise(without: str) -> None:
    """Functions of all kinds are compiled and called; where numba has all names, they are parts, and stored."""
    (purpose,) = (purpose for purpose, name in NAMES if name == without)
    assert not has(purpose)
    resolve, numbers = BaseFunction.get_call_type, numba.core.bytecode.FunctionIdentity._unique_ids

    @jit.allocation_free_part
    def treble(number: float) -> float:
        return 3.0 * number

    @jit.allocation_free_loop
    def add_treble(number: float) -> float:
        return number + treble(number)

    if purpose == numba_private.CALLS:
        numba_private.keep_call_types()
        assert BaseFunction.get_call_type is resolve
    worker = numba.core.inline_closurecall.InlineWorker
    if purpose == numba_private.VALUES:
        find = Lower._find_singly_assigned_variable
        numba_private.keep_values()
        assert Lower._find_singly_assigned_variable is find
    if purpose == numba_private.INLINED:
        read = worker.run_untyped_passes
        numba_private.keep_inlined()
        assert worker.run_untyped_passes is read
    if purpose == numba_private.EVENTS:
        numba_private.listen_to_compiling(object)  # numba refuses an object of this class
    if purpose == numba_private.NUMBERS:
        numba_private.number_at_random()
        assert numba.core.bytecode.FunctionIdentity._unique_ids is numbers
    stored = type(add_treble._cache).__name__ == "Code"  # type: ignore[attr-defined]
    assert stored == (purpose not in {numba_private.STORED, numba_private.NUMBERS})
    assert treble(2.0) == 6.0
    if purpose in {numba_private.PARTS, numba_private.LITERALS}:
        assert add_treble(2.0) == 8.0


@pytest.mark.parametrize("without", [f"numba.core.cpu.CPUTargetOptions.{option}" for option in OPTIONS], indirect=True)
def test_without_an_option_others_are_left(without: str) -> None:
    removed = without.rpartition(".")[2]
    left = numba_private.known_options(error_model="numpy", **dict.fromkeys(OPTIONS, True))
    assert left.keys() == {"error_model", *OPTIONS} - {removed}


def divide(one: float, other: float) -> float:
    """Return a quotient, in Python; compiled functions call the overload."""
    return one / other


@overload(divide, strict=False)
def _divide(one: Any, other: Any) -> Any:
    return divide


@pytest.mark.parametrize("first", ["numpy", "python"])
def test_what_a_caller_s_options_decide_is_resolved_for_each(first: str) -> None:
    def quotient(one: float, other: float) -> float:
        return divide(one, other)

    for model in (first, {"numpy": "python", "python": "numpy"}[first]) * 2:
        call = numba.njit(error_model=model)(quotient)
        assert call(3.0, 2.0) == 1.5
        if model == "numpy":
            assert call(1.0, 0.0) == math.inf
        else:
            with pytest.raises(ZeroDivisionError):
                call(1.0, 0.0)


def test_equal_options_have_one_number() -> None:
    options, flags = numba_private._Options(), [numba.core.compiler.Flags() for _ in range(3)]
    flags[2].nrt = True
    first, equal, other, again, none, last = (options.number(of) for of in (*flags, flags[0], None, flags[2]))
    assert first == equal == again
    assert len({first, other, none}) == 3
    assert last == other


@pytest.fixture
def unstored(monkeypatch: pytest.MonkeyPatch) -> None:
    """Compile, also what an earlier run of the tests has stored."""
    monkeypatch.setattr(jit, "use_store", lambda *_: None)


@pytest.fixture
def resolved_calls() -> Iterator[list[str]]:
    """Count what numba resolves."""
    resolved: list[str] = []
    kept = BaseFunction.get_call_type.__closure__  # type: ignore[attr-defined]
    (cell,) = (cell for cell in kept if getattr(cell.cell_contents, "__name__", "") == "get_call_type")
    resolve = cell.cell_contents

    def count(function: BaseFunction, context: object, arguments: object, keywords: object) -> object:
        resolved.append(f"{function} of {arguments}")
        return resolve(function, context, arguments, keywords)

    cell.cell_contents = count
    yield resolved
    cell.cell_contents = resolve


@pytest.mark.usefixtures("unstored")
def test_a_call_is_resolved_once(resolved_calls: list[str]) -> None:
    @jit.compiled
    def polynomial(x: np.float32, y: np.int16) -> np.float32:
        return x * y + x * y * x + x * y

    assert polynomial(np.float32(2.0), np.int16(3)) == 24.0
    assert len(resolved_calls) == len(set(resolved_calls)) > 0


class _Pair(NamedTuple):
    one: np.ndarray
    other: np.ndarray


@pytest.mark.usefixtures("unstored")
def test_what_is_assigned_once_is_not_in_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    """A tuple that other blocks use is a value there; what changes on the way stays what Python makes of it."""
    places: list[str] = []
    alloca = Lower.alloca

    def note(lower: Lower, name: str, kind: object) -> object:
        places.append(name)
        return alloca(lower, name, kind)

    monkeypatch.setattr(Lower, "alloca", note)

    @jit.allocation_free
    def add_some(pair: _Pair, count: int) -> float:
        same, total, last = pair, 0.0, -1.0
        for i in range(count):
            step = same.one[i]
            if step > 1.0:
                step = 2.0 * step
                last = same.other[i]
            total += step + last
        return total + last

    pair = _Pair(np.array([0.5, 1.5, 1.0, 4.0]), np.array([7.0, 3.0, 5.0, 2.0]))
    for count in range(5):
        assert add_some(pair, count) == add_some.py_func(pair, count)  # type: ignore[attr-defined]
    assert {name.partition(".")[0] for name in places} & {"pair", "same", "last"} == {"last"}


@pytest.mark.usefixtures("unstored")
def test_an_inlined_function_is_read_once() -> None:
    """For callers of the same options, whose copies are their own."""
    read: list[str] = []

    @jit.inlined
    def double(x: float) -> float:
        y = x
        return y + y

    @jit.compiled
    def quadruple(x: float) -> float:
        y = double(x)
        return double(y) - 0.0 * y

    @jit.compiled
    def sextuple(x: float) -> float:
        return double(x) + double(double(x))

    passes = numba.core.untyped_passes.ExtractByteCode
    run = passes.run_pass
    try:
        passes.run_pass = lambda self, state: (read.append(state.func_id.func_name), run(self, state))[1]
        assert (quadruple(1.5), sextuple(1.5)) == (6.0, 9.0)
    finally:
        passes.run_pass = run
    assert read.count("double") == 1
