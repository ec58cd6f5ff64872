"""Schemas of the tables that pydantic models read."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel

from mcnav.config.json_schema.nodes import BOUNDS, Node, by_type, choice, quantity
from mcnav.entries.quantities import UNIT


def of_model(model: type[BaseModel]) -> Node:
    """Return the schema of a table that a pydantic model reads, with every table inside it."""
    raw = model.model_json_schema(ref_template="#/$defs/{model}")
    node: Node = _plain(raw, raw.get("$defs", {}))
    node.pop("$defs", None)
    node.pop("description", None)
    return node


def _plain(node: Any, inside: Mapping[str, Node]) -> Any:
    """Replace references, null and pydantic's marks of quantities by what stands in a file."""
    if isinstance(node, list):
        return [_plain(each, inside) for each in node]
    if not isinstance(node, dict):
        return node
    if "$ref" in node:
        name = node["$ref"].rpartition("/")[2]
        return {**_plain(inside[name], inside), **{key: node[key] for key in ("description",) if key in node}}
    if "anyOf" in node:
        others = [each for each in node["anyOf"] if each != {"type": "null"}]
        if len(others) == 1:
            outer = {key: value for key, value in node.items() if key != "anyOf"}
            return _plain({**others[0], **outer}, inside)
    if UNIT in node:
        return _quantity(node)
    if "discriminator" in node:
        return _discriminated(node, inside)
    kept = {key: value for key, value in node.items() if key not in ("title", "default", "$defs")}
    if isinstance(kept.get("description"), str):
        kept["description"] = kept["description"].replace("``", "`")
    if isinstance(node.get("default"), (str, int, float)):
        kept["default"] = node["default"]
    if "const" in kept:
        kept["enum"] = [kept.pop("const")]
    if isinstance(kept.get("properties"), dict):
        kept["properties"] = {name: _plain(value, inside) for name, value in kept["properties"].items()}
    return {
        key: value if key in ("properties", "enum", "examples") else _plain(value, inside)
        for key, value in kept.items()
    }


def _quantity(node: Mapping[str, Any]) -> Node:
    unit, default = node[UNIT], node.get("default")
    bounds = {key: node[key] for key in BOUNDS if key in node}
    result = quantity(unit, node.get("description", ""), bounds, *node.get("examples", ())[:1])
    if isinstance(default, (int, float)):
        result["default"] = default if unit == "1" else f"{default:.6g} {unit}"
    return result


def _discriminated(node: Mapping[str, Any], inside: Mapping[str, Node]) -> Node:
    key = node["discriminator"]["propertyName"]
    tables = {tag: _plain({"$ref": place}, inside) for tag, place in node["discriminator"]["mapping"].items()}
    for closed in tables.values():
        closed.pop("description", None)
    return by_type(key, {tag: choice([tag]) for tag in tables}, tables, node.get("description", ""))
