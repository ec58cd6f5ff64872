"""Descriptions are the same where all of their parts are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from mcnav.systems.ins.linear.same_content import same_content


@dataclass
class _Described:
    name: str
    values: np.ndarray


@pytest.mark.parametrize(
    "of",
    [
        _Described,
        lambda name, values: (name, values),
        lambda name, values: {"name": name, "values": values},
        lambda name, values: {"inner": (_Described(name, values), 1.0), "other": None},
    ],
)
def test_a_difference_in_any_part_is_one(of: Any) -> None:
    one = of("a", np.arange(3.0))
    assert same_content(one, of("a", np.arange(3.0)))
    assert not same_content(one, of("b", np.arange(3.0)))
    assert not same_content(one, of("a", np.arange(4.0)))
    assert not same_content(one, of("a", np.zeros(3)))
    assert not same_content(one, None)


def test_neither_more_nor_other_parts() -> None:
    assert not same_content((1.0,), (1.0, 2.0))
    assert not same_content({"a": 1.0}, {"a": 1.0, "b": 2.0})
    assert not same_content({"a": 1.0}, {"b": 1.0})
