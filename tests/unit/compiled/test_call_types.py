"""Calls that are resolved once: the same types, and for each set of options a function of its own."""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np
import pytest
from numba.core.types.functions import BaseFunction
from numba.extending import overload

from mcnav.compiled import call_types
from mcnav.compiled.jit import compiled


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


def test_equal_options_have_one_number(monkeypatch: pytest.MonkeyPatch) -> None:
    options, top = call_types._Options(), [numba.core.compiler.Flags() for _ in range(3)]
    top[2].nrt = True
    current = iter((*top, top[0], None, top[2]))
    monkeypatch.setattr(call_types.ConfigStack, "top_or_none", classmethod(lambda _: next(current)))
    first, equal, other, again, none, last = (options.number() for _ in range(6))
    assert first == equal == again
    assert len({first, other, none}) == 3
    assert last == other


def test_a_call_is_resolved_once(monkeypatch: pytest.MonkeyPatch) -> None:
    tried: list[str] = []

    def count(function: BaseFunction, context: object, arguments: object, keywords: object) -> object:
        tried.append(f"{function} of {arguments}")
        return resolve(function, context, arguments, keywords)

    resolve = call_types._resolve
    monkeypatch.setattr(call_types, "_resolve", count)

    @compiled
    def polynomial(x: np.float32, y: np.int16) -> np.float32:
        return x * y + x * y * x + x * y

    assert polynomial(np.float32(2.0), np.int16(3)) == 24.0
    assert len(tried) == len(set(tried)) > 0
