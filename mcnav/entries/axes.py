"""Sizes by axis: one for all axes, a list of all, or a table of some."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from mcnav._types import Array
from mcnav.entries.context import FileContext

LARGEST_SIZE: Final = 1e15
"""Size in SI units above which it is refused: a slip of the pen, and a risk of overflow."""

Fault = Callable[[float], str]
"""Returns what is wrong with a value, as the end of a message; nothing when it is right."""


def fault_of_size(size: float) -> str:
    """Return what is wrong with the size of an error."""
    if size < 0.0:
        return "a size must not be negative"
    return f"at most {LARGEST_SIZE:g} in SI units makes sense" if size > LARGEST_SIZE else ""


def within(least: float, most: float, unit: str, words: str = "a size must not be negative") -> Fault:
    """Return the `Fault` of values beyond two limits in an SI unit; ``words`` are about those at or below zero."""
    shown = "" if unit == "1" else f" {unit}"

    def fault(value: float) -> str:
        if value < min(least, 0.0) or (value == 0.0 < least):
            return words
        if value < least:
            return f"at least {least:.3g}{shown} makes sense"
        return f"at most {most:.3g}{shown} makes sense" if value > most else ""

    return fault


def read_axes(
    entry: object, unit: str, axes: Sequence[str], key: str, context: FileContext,
    missing: float = 0.0, fault: Fault = fault_of_size,
) -> Array:  # fmt: skip
    """Read the sizes of some axes, shape (axes,), with a value for those that are missing.

    A mistake is added to the context; a quantity without axes has one, without a name.
    """
    result = np.full(len(axes), missing)
    if isinstance(entry, dict) and len(axes) > 1:
        for axis in entry.keys() - set(axes):
            context.problem(f"{key}.{axis}", f"unknown axis; expected {', '.join(axes)}")
        given = {axis: (f"{key}.{axis}", value) for axis, value in entry.items() if axis in axes}
    elif isinstance(entry, list) and len(axes) > 1:
        if len(entry) != len(axes):
            context.problem(key, f"got a list of {len(entry)}; expected {len(axes)}, for {', '.join(axes)}")
            return result
        given = {
            axis: (f"{key} #{number}", each) for number, (axis, each) in enumerate(zip(axes, entry, strict=True), 1)
        }
    else:
        given = dict.fromkeys(axes, (key, entry))
    problems = len(context.problems)
    for number, axis in enumerate(axes):
        if axis not in given or len(context.problems) > problems:
            continue
        at, value = given[axis]
        size = context.quantity(value, unit, at)
        if size is None:
            continue
        if wrong := fault(size):
            context.problem(at, f"got {value!r}; {wrong}")
        else:
            result[number] = size or 0.0  # no negative zero
    return result
