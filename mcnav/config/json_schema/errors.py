"""Schema of ``[errors]``: the sources of each type of scenario, and their distributions."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Final

from mcnav.config.empirical import SCIPY, TABLE
from mcnav.config.json_schema.nodes import Node, by_type, choice, quantity, reference, table
from mcnav.config.sources import DISTRIBUTIONS, OWN_UNIT
from mcnav.contract.quantities import Source
from mcnav.units import conversion, dimension_of

KEYS: Final = {
    "sigma": "Standard deviation.",
    "half_width": "Half of the interval, which is symmetric about zero.",
    "limit": "Largest magnitude.",
    "degrees_of_freedom": "Degrees of freedom.",
    "value": "The known error.",
    "loc": "Location, as in scipy.stats; zero unless given.",
    "scale": "Scale, as in scipy.stats.",
    "file": "CSV or parquet file with the values, relative to the campaign file.",
    "column": "Column of the file.",
    "unit": "Unit of the column.",
    "sha256": "Digest of the values, which files in run folders have.",
}
"""Meaning of each key of a distribution."""


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
        self.found.setdefault(name, _distribution(unit))
        sigma = quantity(unit, described=False)
        node = {**sigma, "type": [*sigma["type"], "object"], "if": {"type": "object"}, "then": reference(name)}
        return {**({"description": description} if description else {}), **node, "additionalProperties": True}

    def sources(self, sources: Sequence[Source], patterns: Mapping[str, str] | None = None) -> Node:
        """Return the schema of ``[errors]`` with the sources of a scenario, and patterns of others by SI unit."""
        nodes: dict[str, Node] = {}
        for source in sources:
            if source.group and source.group != source.name:
                every = f"Errors {source.group} along each axis: {_shown(source)}"
                nodes.setdefault(source.group, self.node(source.unit, every))
        for source in sources:
            nodes[source.name] = self.node(source.unit, f"Error {source.name}: {_shown(source)}")
        node = table(nodes)
        if patterns:
            told = "Constant error of a sensor of [[aiding]]."
            node["patternProperties"] = {pattern: self.node(unit, told) for unit, pattern in patterns.items()}
        return node


def _shown(source: Source) -> str:
    words, example = dimension_of(source.unit)
    size = source.nominal / conversion(source.shown_in, source.unit)
    example = f"{size:.2g} {source.shown_in}" if source.unit != "1" else example
    return f'one sigma of a zero-mean normal distribution, {words} such as "{example}"; or a table with a distribution.'


def _distribution(unit: str) -> Node:
    """Return the schema of a table with a distribution."""
    text: Node = {"type": "string"}
    tables = {
        name: table(
            {key: quantity(unit if own == OWN_UNIT else own, KEYS[key]) for key, own in keys.items()}, keys
        )
        for name, (_, keys) in DISTRIBUTIONS.items()
    }  # fmt: skip
    tables[TABLE] = table(
        {key: {**text, "description": KEYS[key]} for key in ("file", "column", "unit", "sha256")},
        ("file", "column", "unit"),
    )
    scipy = table({key: quantity(unit, KEYS[key]) for key in ("loc", "scale")}, ["scale"])
    tables[SCIPY] = {**scipy, "additionalProperties": quantity("1", "Shape parameter.")}
    conditions = {name: choice([name]) for name in (*DISTRIBUTIONS, TABLE)}
    conditions[SCIPY] = {"type": "string", "pattern": rf"^{re.escape(SCIPY)}"}
    meaning = f"Distribution; normal unless given. {SCIPY}NAME is any continuous one of scipy.stats."
    for name, each in tables.items():
        each["properties"]["distribution"] = {"description": meaning, **conditions[name]}
    return by_type("distribution", conditions, tables, "Distribution of an error.", "normal")
