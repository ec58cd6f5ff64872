"""Values by axis: one for all axes, a list of all, or a table of some."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from mcnav.config.json_schema.nodes import Node, named, quantity, table
from mcnav.units import dimension_of


class AxesDefinitions:
    """Definitions of values by axis, one for each unit and set of axes that is asked for.

    Attributes
    ----------
    found : dict of str to dict
        Definitions by name.
    """

    def __init__(self) -> None:
        self.found: dict[str, Node] = {}

    def node(self, unit: str, axes: Sequence[str], description: str, example: Any = None, whole: bool = True) -> Node:
        """Return the schema of a key with values by axis.

        Parameters
        ----------
        whole : bool
            Whether one value may hold for all axes.
        """
        if len(axes) == 1:
            return quantity(unit, description, example=example)
        words, usual = dimension_of(unit)
        shown = usual if example is None else example
        name = re.sub(r"[^a-z]+", "_", f"{words} by {' '.join(axes)}" + ("" if whole else " alone"))
        size = quantity(unit)
        size.pop("description")
        size.pop("examples")
        kinds: list[Node] = [size] if whole else []
        kinds += [
            {"type": "array", "items": size, "minItems": len(axes), "maxItems": len(axes)},
            table(dict.fromkeys(axes, size)),
        ]
        self.found[name] = {"anyOf": kinds}
        every = f'"{shown}" for all axes, ' if whole else ""
        told = f"{description} {words.capitalize()}: {every}a list for {', '.join(axes)}, or a table of some axes."
        return named(name, told.strip())
