"""Schema of ``[errors]``: the sources of each type of scenario, and their distributions."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import cache

from mcnav.config.distributions import ENTRY
from mcnav.config.json_schema.models import of_model
from mcnav.config.json_schema.nodes import Node, reference, table
from mcnav.contract.quantities import Source
from mcnav.physics.units import conversion, dimension_of


@cache
def _entry(unit: str) -> Node:
    return of_model(ENTRY, unit)


class ErrorDefinitions:
    """Definitions of distributions, one for each unit of an entry of ``[errors]``.

    Attributes
    ----------
    found : dict of str to dict
        Definitions by name.
    """

    def __init__(self) -> None:
        self.found: dict[str, Node] = {}

    def node(self, unit: str, description: str) -> Node:
        """Return the schema of an entry in an SI unit, any for none."""
        name = "distribution_of_" + (re.sub(r"[^a-z]+", "_", dimension_of(unit).words) if unit else "any_dimension")
        entry = _entry(unit)
        self.found.setdefault(name, entry["then"])
        node = {**entry, "then": reference(name), "additionalProperties": True}
        return {**({"description": description} if description else {}), **node}

    def sources(self, sources: Sequence[Source], patterns: Mapping[str, str] | None = None) -> Node:
        """Return the schema of ``[errors]`` with the sources of a scenario, and patterns of others by SI unit."""
        nodes: dict[str, Node] = {}
        groups: dict[str, list[str]] = {}
        for source in sources:
            groups.setdefault(source.group, []).append(source.name)
        for source in sources:
            if source.group and source.group != source.name:
                every = f"Errors {source.group} along each axis: {_shown(source)}"
                nodes.setdefault(source.group, self._by_axis(source, groups[source.group], every))
        for source in sources:
            nodes[source.name] = self.node(source.unit, f"Error {source.name}: {_shown(source)}")
        node = table(nodes)
        if patterns:
            told = "Constant error of a sensor of [[aiding]]."
            node["patternProperties"] = {pattern: self.node(unit, told) for unit, pattern in patterns.items()}
        return node

    def _by_axis(self, source: Source, members: Sequence[str], description: str) -> Node:
        """Return the schema of the entry of a group: one for all sources, or one for each of its axes."""
        one = self.node(source.unit, "")
        each = table({name.removeprefix(f"{source.group}_"): one for name in members})
        every = {"type": "array", "items": one, "minItems": len(members), "maxItems": len(members)}
        return {"description": description, "anyOf": [one, every, each]}


def _shown(source: Source) -> str:
    words, example = dimension_of(source.unit)
    size = source.nominal / conversion(source.shown_in, source.unit)
    example = f"{size:.2g} {source.shown_in}" if source.unit != "1" else example
    return f'one sigma of a zero-mean normal distribution, {words} such as "{example}"; or a table with a distribution.'
