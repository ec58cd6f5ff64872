"""Values by axis: one for all axes, a list of all, or a table of some."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from mcnav.config.json_schema.nodes import Node, quantity
from mcnav.physics.units import dimension_of


def by_axes(unit: str, axes: Sequence[str], description: str, example: Any = None, whole: bool = True) -> Node:
    """Return the schema of a key with values by axis.

    Parameters
    ----------
    unit : str
        SI unit.
    example : object, optional
        Quantity to show in place of the dimension's usual one.
    whole : bool
        Whether one value may hold for all axes.
    """
    if len(axes) == 1:
        return quantity(unit, description, example=example)
    words, usual = dimension_of(unit)
    shown = usual if example is None else example
    size = quantity(unit, described=False)
    every = f'"{shown}" for all axes, ' if whole else ""
    one = size if whole else {"type": []}
    return {
        **one,
        "type": [*one["type"], "array", "object"],
        "description": f"{description} {words.capitalize()}: {every}a list for {', '.join(axes)}, or a table of some.",
        "items": size,
        "minItems": len(axes),
        "maxItems": len(axes),
        "properties": dict.fromkeys(axes, size),
        "additionalProperties": False,
    }
