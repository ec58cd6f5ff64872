"""Page of all keys of a campaign file, from the schema that editors use."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any, Final

from escaping import escape

from mcnav.config.json_schema.campaign import campaign_schema

Node = dict[str, Any]

AXES: Final = {"north", "east", "down"}
"""Axes that are words; those of instruments are one letter or two."""


def page() -> str:
    """Write the page."""
    schema, known = campaign_schema(), dict[frozenset[str], str]()
    list_tables(schema, "", known)
    parts = [
        "# Every key of a campaign file",
        "As the program reads them. [Campaign files](/campaigns.md) has what they are for, with examples.",
        *sections(schema, "", known),
    ]
    return "\n\n".join(parts) + "\n"


def sections(node: Node, path: str, known: dict[frozenset[str], str]) -> Iterator[str]:
    """Yield the sections of a table and of the tables in it; one for each type of a table that has several.

    Parameters
    ----------
    path : str
        Path of the table, empty for the whole file.
    known : dict of frozenset of str to str
        Paths of the tables that have a section, by their keys.
    """
    name = f"`{path}`" if path else "Top level"
    yield f"({anchor(path)})="
    for kind, properties, required in alternatives(node):
        yield f"## {name}{kind}"
        if path and not kind and "description" in node:
            yield escape(node["description"])
        rows = [row(key, each, key in required, known) for key, each in properties.items()]
        yield "\n".join(["| key | default | meaning |", "| --- | --- | --- |", *rows])
    for key, each in node["properties"].items():
        inside, place = each.get("items", each), f"{path}.{key}".strip(".")
        if has_section(inside) and known[frozenset(inside["properties"])] == place:
            yield from sections(inside, place, known)


def list_tables(node: Node, path: str, known: dict[frozenset[str], str]) -> None:
    """List the first table of those with the same keys, in ``known``."""
    for key, each in node["properties"].items():
        inside, place = each.get("items", each), f"{path}.{key}".strip(".")
        if has_section(inside) and frozenset(inside["properties"]) not in known:
            known[frozenset(inside["properties"])] = place
            list_tables(inside, place, known)


def alternatives(node: Node) -> Iterator[tuple[str, dict[str, Node], list[str]]]:
    """Yield the types of a table, if a key decides about the others: words for it, its keys, and the required ones."""
    chain = node["then"] if node.get("if") == {"type": "object"} else node
    found = False
    while "if" in chain and "properties" in chain["then"] and (kind := kind_of(chain["if"])):
        closed = chain["then"]
        properties = {
            key: node["properties"][key] if each is True else each for key, each in closed["properties"].items()
        }
        yield f", {kind}", properties, closed.get("required", [])
        chain, found = chain.get("else", {}), True
    if not found:
        yield "", node["properties"], node.get("required", [])


def kind_of(condition: Node) -> str:
    """Name the type of table that meets a condition, or nothing if it is no condition of a type."""
    (key,) = condition.get("required", ("",))
    if not key or "properties" not in condition:
        return f"with `{key}`" if key else ""
    decided = condition["properties"].get(key, {})
    if "enum" in decided:
        return f"{key} `{json.dumps(decided['enum'][0])}`"
    return f"{key} of your own" if "pattern" in decided else ""


def anchor(path: str) -> str:
    """Name the place of a table's section."""
    return f"table-{path.replace('.', '-').replace('_', '-')}"


def has_section(node: Node) -> bool:
    """Return whether a table has keys other than axes."""
    return any(len(key) > 2 and key not in AXES for key in node.get("properties", ()))


def row(key: str, node: Node, required: bool, known: dict[frozenset[str], str]) -> str:
    """Write the row of a key."""
    default = f"`{json.dumps(node['default'], ensure_ascii=False)}`" if "default" in node else ""
    words = [escape(" ".join(node.get("description", "").split()))]
    if choices := node.get("enum"):
        words.append(f"One of {', '.join(f'`{json.dumps(each)}`' for each in choices)}.")
    inside = node.get("items", node)
    if has_section(inside):
        place = known[frozenset(inside["properties"])]
        words.append(f"{'Tables' if 'items' in node else 'Table'} [`{place}`](#{anchor(place)}).")
    elif axes := list(inside.get("properties", ())):
        words.append(f"Axes: {', '.join(axes)}.")
    return f"| `{key}` | {'required' if required else default} | {' '.join(filter(None, words))} |"
