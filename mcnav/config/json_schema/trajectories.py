"""Schema of ``trajectory``: a file, a reentry, segments or a boost."""

from __future__ import annotations

from mcnav.config.json_schema.models import of_model
from mcnav.config.json_schema.nodes import Node, by_key
from mcnav.systems.ins.tables.segments import SEGMENTS
from mcnav.systems.ins.tables.trajectory_tables import TRAJECTORIES
from mcnav.systems.ins.truth.rows import COLUMNS


def trajectory_schema(description: str) -> Node:
    """Return the schema of a trajectory's entry."""
    tables = {name: of_model(model) for name, model in TRAJECTORIES.items()}
    tables["file"]["properties"]["columns"] |= columns_schema()
    kinds = {name: _one_turn(of_model(model)) for name, (model, _) in SEGMENTS.items()}
    tables["segments"]["properties"]["segments"]["items"] = by_key(kinds, "A segment of the flight.")
    node = by_key(tables, description)
    return {**node, "type": ["string", "object"], "pattern": "^[^\\x00-\\x1f\\x7f]{1,200}$"}


def _one_turn(segment: Node) -> Node:
    """Refuse a turn with both a bank and a rate."""
    return {**segment, "not": {"required": ["bank", "rate"]}} if "bank" in segment["properties"] else segment


def columns_schema() -> Node:
    """Return the schema of the names of a file's columns."""
    return {
        "type": "object",
        "properties": {
            name: {"type": "string", "description": f"Name of the column {name} in the file, with a unit in brackets."}
            for name in COLUMNS
        },
        "additionalProperties": False,
    }
