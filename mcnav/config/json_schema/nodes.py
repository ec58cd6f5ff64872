"""Parts of a JSON schema: quantities, tables, and tables of several types."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

from mcnav.physics.units import dimension_of

Node = dict[str, Any]
"""Part of a JSON schema."""

NUMBER: Final = r"^\s*[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?"
"""Beginning of every quantity; draft 7 of JSON schema has no way to check the unit itself."""

QUANTITY: Final = NUMBER + r"\s*([A-Za-zµμ%°º˚′″'’”\"√(]|\s1\s*/|\.\.)"
"""Beginning of a quantity with a unit, or of a range."""

BOUNDS: Final = {"gt": "above", "ge": "at least", "lt": "below", "le": "at most"}
KEYWORDS: Final = {"gt": "exclusiveMinimum", "ge": "minimum", "lt": "exclusiveMaximum", "le": "maximum"}


def quantity(
    unit: str, description: str = "", bounds: Mapping[str, float] | None = None, example: Any = None,
    described: bool = True,
) -> Node:  # fmt: skip
    """Return the schema of a quantity.

    Parameters
    ----------
    unit : str
        SI unit; empty where another part of the file decides the unit.
    bounds : mapping of str to float, optional
        Any of `BOUNDS`, SI. Only those of pure numbers are checked; others become part of the description.
    example : object, optional
        Quantity to show in place of the dimension's usual one.
    described : bool
        Whether it has a description.
    """
    bounds = bounds or {}
    node: Node = {"type": ["string"], "pattern": QUANTITY}
    if unit in ("", "1"):
        limits = {KEYWORDS[key]: value for key, value in bounds.items()}
        node = {"type": ["number", "integer", "string"], "pattern": NUMBER, **limits}
    if not described:
        return node
    if not unit:
        return {"description": description, **node}
    words, usual = dimension_of(unit)
    shown = usual if example is None else example
    shown_unit = "" if unit == "1" else f" {unit}"
    limit = "".join(f", {word} {bounds[key]:.6g}{shown_unit}" for key, word in BOUNDS.items() if key in bounds)
    written = f'"{shown}"' if isinstance(shown, str) else shown
    told = f"{description} {words.capitalize()}, such as {written}{limit}.".strip()
    return {"description": told, "examples": [shown], **node}


def table(properties: Mapping[str, Node], required: Iterable[str] = (), description: str = "") -> Node:
    """Return the schema of a table that has no other keys."""
    node: Node = {"type": "object", "properties": dict(properties), "additionalProperties": False}
    if needed := list(required):
        node["required"] = needed
    return {**node, **({"description": description} if description else {})}


def reference(name: str) -> Node:
    """Refer to a definition."""
    return {"$ref": f"#/definitions/{name}"}


def choice(texts: Iterable[str], description: str = "") -> Node:
    """Return the schema of one of several texts."""
    return {"enum": list(texts), **({"description": description} if description else {})}


def suggested(texts: Iterable[str], pattern: str = "") -> Node:
    """Return the schema of a text for which editors suggest some, and which may be another of a pattern."""
    other = {"type": "string", **({"pattern": pattern} if pattern else {})}
    return {"anyOf": [{"enum": list(texts)}, other]}


def by_type(
    key: str, conditions: Mapping[str, Node], tables: Mapping[str, Node], description: str = "", default: str = ""
) -> Node:
    """Return the schema of a table whose ``key`` decides about the other keys.

    Parameters
    ----------
    conditions : mapping of str to dict
        Schema of the key's value in each type of table.
    tables : mapping of str to dict
        Schema of each type, closed.
    default : str, optional
        Type of a table without the key, which is required otherwise.
    """
    node = _union(list(tables.values()), description)
    node["properties"][key] = suggested_of(list(conditions.values()), node["properties"][key].get("description", ""))
    if not default:
        node["required"] = [key]
    return node | first_of(
        {
            name: {"properties": {key: condition}, **({} if name == default else {"required": [key]})}
            for name, condition in conditions.items()
        },
        {name: narrowed(tables[name], node["properties"]) for name in conditions},
    )


def first_of(conditions: Mapping[str, Node], consequences: Mapping[str, Node]) -> Node:
    """Return the keywords by which the first condition that is met has its consequence.

    They are a chain and no ``allOf``: taplo neither completes nor describes a table that has one.
    """
    chain: Node = {}
    for name, condition in reversed(list(conditions.items())):
        chain = {"if": condition, "then": consequences[name], **({"else": chain} if chain else {})}
    return chain


def suggested_of(conditions: Sequence[Node], description: str) -> Node:
    """Return the schema of the text that decides about a table: any of those of its types."""
    texts = [text for condition in conditions for text in condition.get("enum", ())]
    patterns = [condition for condition in conditions if "enum" not in condition]
    node: Node = {"anyOf": [{"enum": texts}, *patterns]} if patterns else {"enum": texts}
    return {"description": description, **node}


def by_key(tables: Mapping[str, Node], description: str = "") -> Node:
    """Return the schema of a table that has exactly one of several keys, which decides about the others."""
    node = _union(list(tables.values()), description)
    chain = first_of(
        {key: {"required": [key]} for key in tables},
        {key: narrowed(closed, node["properties"]) for key, closed in tables.items()},
    )
    return node | {"if": {"type": "object"}, "then": {"oneOf": [{"required": [key]} for key in tables], **chain}}


def any_of(tables: Sequence[Node], description: str = "") -> Node:
    """Return the schema of a table that is one of several, whichever it is."""
    return {**_union(tables, description), "additionalProperties": False}


def narrowed(closed: Node, known: Mapping[str, Node]) -> Node:
    """Return a closed table beside an open one: values that the open one describes need no second description."""
    properties = {key: True if known.get(key) == node else node for key, node in closed["properties"].items()}
    return {**closed, "properties": properties}


def _union(tables: Sequence[Node], description: str = "") -> Node:
    """Return an open table with the keys of all tables; of values that differ, the type is left open."""
    union: dict[str, list[Node]] = {}
    for each in tables:
        for key, node in each["properties"].items():
            union.setdefault(key, []).append(node)
    properties = {
        key: nodes[0] if all(node == nodes[0] for node in nodes) else _either(nodes) for key, nodes in union.items()
    }
    node = {"type": "object", "properties": properties, "additionalProperties": True}
    return {**({"description": description} if description else {}), **node}


def _either(nodes: Sequence[Node]) -> Node:
    """Describe a key that has other values in other tables: any of their types, texts and keys."""
    result: Node = {}
    if descriptions := dict.fromkeys(node["description"] for node in nodes if "description" in node):
        result["description"] = "\n\n".join(descriptions)
    if all("type" in node for node in nodes):
        kinds = [[node["type"]] if isinstance(node["type"], str) else node["type"] for node in nodes]
        result["type"] = list(dict.fromkeys(kind for each in kinds for kind in each))
    if all("enum" in node for node in nodes):
        result["enum"] = list(dict.fromkeys(text for node in nodes for text in node["enum"]))
    if any("properties" in node for node in nodes):
        inside = _union([node for node in nodes if "properties" in node])
        result |= {"properties": inside["properties"], "additionalProperties": True}
    return result
