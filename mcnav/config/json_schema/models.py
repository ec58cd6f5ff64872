"""Schemas of the tables that pydantic models read."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any, Final

from pydantic import TypeAdapter

from mcnav.config.json_schema.axes import by_axes
from mcnav.config.json_schema.nodes import BOUNDS, Node, any_of, by_key, by_type, quantity
from mcnav.entries.axes import ONE_BY_ONE, SIZED_AXES
from mcnav.entries.quantities import UNIT
from mcnav.entries.unions import BY_FORM, BY_KEY, BY_TYPE, EITHER, OR_FIRST, TEXT

MARKS: Final = (UNIT, SIZED_AXES, ONE_BY_ONE, BY_KEY, BY_TYPE, BY_FORM, EITHER, TEXT)
"""Keys that stand for what TOML files have and Python has not; see `mcnav.entries`."""


def of_model(model: Any, unit: str = "") -> Node:
    """Return the schema of an entry that a pydantic model or another type reads, with every table inside it.

    ``unit`` is the SI unit of quantities that have that of an error source.
    """
    form: TypeAdapter[Any] = model if isinstance(model, TypeAdapter) else TypeAdapter(model)
    raw = _in_unit(_raw(form), unit)
    node: Node = _plain(raw, raw.get("$defs", {}))
    node.pop("$defs", None)
    node.pop("description", None)
    return node


@lru_cache(maxsize=32)
def _raw(form: TypeAdapter[Any]) -> Node:
    """Return pydantic's schema of a form, which is not to be changed."""
    return form.json_schema(ref_template="#/$defs/{model}")


def _in_unit(node: Any, unit: str) -> Any:
    """Give quantities without a unit one."""
    if isinstance(node, list):
        return [_in_unit(child, unit) for child in node]
    if not isinstance(node, dict):
        return node
    return {key: unit if key == UNIT and not value else _in_unit(value, unit) for key, value in node.items()}


def _plain(node: Any, inside: Mapping[str, Node]) -> Any:
    """Replace references, null and the marks of `mcnav.entries` by what stands in a file."""
    if isinstance(node, list):
        return [_plain(child, inside) for child in node]
    if not isinstance(node, dict):
        return node
    if "$ref" in node:
        name = node["$ref"].rpartition("/")[2]
        outer = {key: value for key, value in node.items() if key in (*MARKS, "description")}
        return _plain({**inside[name], **outer}, inside)
    if "anyOf" in node and not {BY_KEY, BY_TYPE, EITHER} & node.keys():
        others = [alternative for alternative in node["anyOf"] if alternative != {"type": "null"}]
        if len(others) == 1:
            outer = {key: value for key, value in node.items() if key != "anyOf"}
            return _plain({**others[0], **outer}, inside)
    if SIZED_AXES in node:
        return _axes(node, inside)
    if OR_FIRST in node:
        return _or_first(node, inside)
    if UNIT in node:
        return _quantity(node)
    if {BY_KEY, BY_TYPE, EITHER} & node.keys():
        return _union(node, inside)
    if BY_FORM in node:
        return _by_form(node, inside)
    return _table(node, inside)


def _table(node: Mapping[str, Any], inside: Mapping[str, Node]) -> Node:
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


def _axes(node: Mapping[str, Any], inside: Mapping[str, Node]) -> Node:
    """Describe sizes by axis, and where they stand for a table, this table as well."""
    example = next(iter(node.get("examples") or ()), None)
    sizes = by_axes(node[UNIT], node[SIZED_AXES], node.get("description", ""), example, ONE_BY_ONE not in node)
    if "properties" not in node:
        return sizes | {key: node[key] for key in ("required",) if key in node}
    table = _table({key: value for key, value in node.items() if key not in MARKS}, inside)
    keys = list(table["properties"])
    *first, last = keys
    return {
        **sizes,
        "description": f"{sizes['description']} Or a table with {' or '.join(first)}, and {last}.",
        "properties": {**table["properties"], **sizes["properties"]},
        "if": {"type": "object", "anyOf": [{"required": [key]} for key in keys]},
        "then": {"oneOf": table["oneOf"], "not": {"anyOf": [{"required": [axis]} for axis in node[SIZED_AXES]]}},
    }


def _union(node: Mapping[str, Any], inside: Mapping[str, Node]) -> Node:
    """Describe tables of several forms, and the text that may stand for one of them."""
    tables = [_plain(form, inside) for form in node["anyOf"]]
    for table in tables:
        table.pop("description", None)
    description = node.get("description", "")
    if EITHER in node:
        return any_of(tables, description)
    if BY_TYPE in node:
        key = node[BY_TYPE]
        kinds = {str(_condition(table, key)): table for table in tables}
        usual = next((kind for kind, table in kinds.items() if key not in table["required"]), "")
        conditions = {kind: _condition(table, key) for kind, table in kinds.items()}
        return by_type(key, conditions, kinds, description, usual)
    union = by_key({next(iter(table["properties"])): table for table in tables}, description)
    return {**union, "type": ["string", "object"], "pattern": f"^{node[TEXT]}$"} if TEXT in node else union


def _condition(table: Node, key: str) -> Node:
    """Return the schema of the texts by which a table is told from others: one, or those of a pattern."""
    text = table["properties"][key]
    return {"enum": text["enum"]} if "enum" in text else {"type": "string", "pattern": text["pattern"]}


def _or_first(node: Mapping[str, Any], inside: Mapping[str, Node]) -> Node:
    """Describe tables, and a quantity that may stand for one of them."""
    size = quantity(node[UNIT], described=False)
    tables = _plain(node[OR_FIRST], inside)
    return {**size, "type": [*size["type"], "object"], "if": {"type": "object"}, "then": tables}


def _by_form(node: Mapping[str, Any], inside: Mapping[str, Node]) -> Node:
    """Describe a table and a value in one: editors look for keys in ``properties``; other types are alternatives."""
    forms = [_plain(form, inside) for form in node["anyOf"]]
    outer = {key: value for key, value in _table(node, inside).items() if key not in ("anyOf", BY_FORM)}
    if not any("properties" in form for form in forms):
        return {**outer, "anyOf": forms}
    merged = {key: value for form in forms for key, value in form.items()}
    if "enum" in merged:
        merged["anyOf"] = [{"type": "object"}, {"enum": merged.pop("enum")}]
    return {**merged, **outer, "type": [form["type"] for form in reversed(forms)]}
