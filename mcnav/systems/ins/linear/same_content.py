"""Comparison of descriptions that hold arrays, to find out what tables may be shared."""

from __future__ import annotations

from dataclasses import fields, is_dataclass

import numpy as np


def same_content(one: object, other: object) -> bool:
    """Compare values of any kind, arrays by their elements and dataclasses by their fields.

    >>> same_content((1.0, np.zeros(2)), (1.0, np.zeros(2))), same_content({"a": np.ones(1)}, {"a": np.zeros(1)})
    (True, False)
    """
    if type(one) is not type(other):
        return False
    if isinstance(one, np.ndarray):
        return np.array_equal(one, np.asarray(other))
    if is_dataclass(one):
        return all(
            same_content(getattr(one, attribute.name), getattr(other, attribute.name)) for attribute in fields(one)
        )
    if isinstance(one, tuple) and isinstance(other, tuple):
        return len(one) == len(other) and all(map(same_content, one, other))
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(same_content(value, other[key]) for key, value in one.items())
    return bool(one == other)
