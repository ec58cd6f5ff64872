"""Schema of a whole campaign file."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from itertools import chain
from typing import Any, Final

from mcnav.config.json_schema.errors import ErrorDefinitions
from mcnav.config.json_schema.models import of_model
from mcnav.config.json_schema.nodes import Node, by_type, choice, first_of, narrowed, suggested
from mcnav.config.schema import CampaignFile
from mcnav.entries.quantities import NAME_OF
from mcnav.systems.registry import FURTHER_NAMES, SCENARIO_TYPES, ScenarioType, further_tables, user_type

DRAFT: Final = "http://json-schema.org/draft-07/schema#"
"""Version of JSON schema that TOML language servers know."""

TITLE: Final = "Campaign of mcnav"

USERS: Final = "of your own"
"""Name of the scenarios whose type is a file and class."""

SHARED_TABLES: Final = [
    name
    for name, types in Counter(chain(user_type().tables, *(kind.tables for kind in SCENARIO_TYPES.values()))).items()
    if types > 1
]
"""Further tables whose form depends on the type of scenario."""


def campaign_schema() -> Node:
    """Build the schema of campaign files.

    It knows keys, types and names, and not what a unit measures, what another table or a file must contain, or what a
    scenario of the user's own declares.
    """
    errors = ErrorDefinitions()
    node = of_model(CampaignFile)
    properties: dict[str, Node] = node["properties"]
    told = {key: each["description"] for key, each in properties.items() if "description" in each}
    properties["scenario"] = _scenario_schema(told["scenario"])
    for name, further in further_tables().items():
        form = {} if name in SHARED_TABLES else of_model(further.form)
        properties[name] = {**form, "description": further.description}
    sources = {name: kind.sources or () for name, kind in SCENARIO_TYPES.items()}
    every = {source.name: source for each in sources.values() for source in each}
    known = errors.sources(list(every.values()))
    properties["errors"] = {**known, "additionalProperties": errors.node("", ""), "description": told["errors"]}
    outputs = dict.fromkeys(name for kind in SCENARIO_TYPES.values() for name in _output_names(kind))
    marked = node
    node = _named(marked, {"source": suggested(every), "output": suggested(outputs)})
    restricted = {name: _of_type(kind, errors, known["properties"], marked) for name, kind in SCENARIO_TYPES.items()}
    conditions = {name: _has_type(choice([name])) for name in sources} | {USERS: _has_type(_user_type())}
    users: Node = {"propertyNames": choice(_keys(user_type())), "properties": _shared_tables(user_type())}
    node |= first_of(conditions, {**restricted, USERS: users})
    return {
        "$schema": DRAFT,
        "title": TITLE,
        "description": "Campaign file of mcnav; mcnav docs campaigns is the reference.",
        **{key: value for key, value in node.items() if key != "title"},
        "definitions": errors.found,
    }


def _scenario_schema(description: str) -> Node:
    tables = {name: of_model(kind.table) for name, kind in SCENARIO_TYPES.items()}
    own = of_model(user_type().table)
    own["additionalProperties"] = True
    conditions = {**{name: choice([name]) for name in SCENARIO_TYPES}, USERS: _user_type()}
    node = by_type("type", conditions, {**tables, USERS: own}, description)
    node["properties"]["type"]["description"] = "Type of scenario, or file and class of one of your own."
    return node


def _shared_tables(kind: ScenarioType) -> Node:
    tables = {name: table for name, table in kind.tables.items() if name in SHARED_TABLES}
    return {name: {**of_model(table.form), "description": table.description} for name, table in tables.items()}


def _user_type() -> Node:
    return {"type": "string", "pattern": r"^[^\x00-\x1f\x7f:]{1,200}\.py:[A-Za-z_][A-Za-z0-9_]{0,100}$"}


def _has_type(condition: Node) -> Node:
    inside = {"required": ["type"], "properties": {"type": condition}}
    return {"required": ["scenario"], "properties": {"scenario": inside}}


def _output_names(kind: ScenarioType) -> list[str]:
    return [output.name for output in kind.outputs]


def _keys(kind: ScenarioType) -> list[str]:
    """Return the keys of a file with a type of scenario."""
    other = set(FURTHER_NAMES) - kind.tables.keys()
    return [key for key in CampaignFile.model_fields if key not in other]


def _of_type(kind: ScenarioType, errors: ErrorDefinitions, every: Mapping[str, Node], marked: Node) -> Node:
    """Restrict a file with a type of scenario to its keys, sources and outputs."""
    sources = kind.sources or ()
    known = narrowed(errors.sources(sources, kind.source_patterns), every)
    names, outputs = [source.name for source in sources], choice(_output_names(kind))
    named = suggested(names, "|".join(kind.source_patterns.values())) if kind.source_patterns else choice(names)
    restricted = _names_alone(marked, {"source": named, "output": outputs}) or {}
    restricted["properties"] |= {"errors": known, **_shared_tables(kind)}
    return {"propertyNames": choice(_keys(kind)), **restricted, **_dependencies(kind)}


def _dependencies(kind: ScenarioType) -> Node:
    """Require the tables without which others have no use."""
    needs: Node = {}
    for name, table in kind.tables.items():
        if table.needs:
            needed = {**_not_empty(kind, table.needs), "required": [table.needs]}
            needs[name] = {"if": given, "then": needed} if (given := _not_empty(kind, name)) else needed
    return {"dependencies": needs} if needs else {}


def _not_empty(kind: ScenarioType, name: str) -> Node:
    """Return the schema of a file whose further table is not an empty list; nothing for a table that is no list."""
    return {"properties": {name: {"minItems": 1}}} if kind.tables[name].is_list else {}


def _named(node: Any, names: Mapping[str, Node]) -> Any:
    """Put names of sources and outputs where a file has such names."""
    if isinstance(node, list):
        return [_named(child, names) for child in node]
    if not isinstance(node, dict):
        return node
    inside = {key: _named(child, names) for key, child in node.items() if key != NAME_OF}
    return {**inside, **names[node[NAME_OF]]} if NAME_OF in node else inside


def _names_alone(node: Any, names: Mapping[str, Node]) -> Node | None:
    """Return the schema of nothing but the names of sources and outputs; none where there are none."""
    if not isinstance(node, dict):
        return None
    if NAME_OF in node:
        return names[node[NAME_OF]]
    inside = {key: part for key, child in node.items() if (part := _names_alone(child, names)) is not None}
    return inside or None
