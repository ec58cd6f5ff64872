"""What numpydoc docstrings leave unsaid: parameters without a word, arrays and frames without shape or unit."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from typing import Any, Final

ARRAY: Final = re.compile(r"\b(ndarray|array_like|Array|NDArray|DataFrame|Series)\b")
SECTION: Final = re.compile(r"^(Parameters|Attributes|Returns|Raises|Examples|Notes)\n-+\n", re.MULTILINE)
SHAPE: Final = re.compile(
    r"\bshapes? \(|\b[Aa] row\b|\brow a\b|\brow, |\bone row\b|\b[Cc]olumns:|\brows? for each\b|\(row\)"
)
UNIT: Final = re.compile(
    r"\b(SI|units?|rad|rad/s|m|m/s|m/s\^2|s|Hz|rad\.|ratios?|shares?|weights?|text|booleans?)\b(?! of \w+ errors)"
)
"""A unit by its name, or that there is none."""


def functions_of(described: Any) -> Iterator[tuple[str, Any]]:
    """Yield an object, and of a class its public methods and properties, by name."""
    yield "", described
    for name in dir(described) if inspect.isclass(described) else ():
        member = inspect.getattr_static(described, name)
        function = getattr(member, "fget", None) or getattr(member, "func", None) or getattr(member, "__func__", member)
        if not name.startswith("_") and inspect.isfunction(function) and function.__module__.startswith("mcnav"):
            yield name, function


def _entries(text: str) -> Iterator[tuple[str, str]]:
    """Yield head and description of the entries of a section."""
    for entry in re.split(r"\n(?=\S)", text.strip("\n")):
        head, _, body = entry.partition("\n")
        yield head, " ".join(body.split())


def _missing(head: str, text: str) -> list[str]:
    """Say which of shape and unit a text does not state."""
    return [f"{head}: no {what}" for what, said in (("shape", SHAPE), ("unit", UNIT)) if not said.search(text)]


def unsaid(described: Any) -> list[str]:
    """List what the docstring of an object leaves unsaid, and those of its public methods."""
    found = []
    for name, function in functions_of(described):
        documentation = inspect.getdoc(function) or ""
        _, *sections = SECTION.split(documentation)
        for _, text in zip(sections[::2], sections[1::2], strict=True):
            for head, body in _entries(text):
                if ARRAY.search(head) and " : " in f" : {head}" and not head.startswith(">>>"):
                    found += [f"{name} {line}" for line in _missing(head, f"{head} {body}")]
        if not inspect.isfunction(function):
            continue
        given = {key: str(kind) for key, kind in function.__annotations__.items()}
        for key in inspect.signature(function).parameters:
            named = re.search(rf"\b{key}\b", documentation)
            if key != "self" and not named and (not name or ARRAY.search(given.get(key, ""))):
                found.append(f"{name} {key}: not a word")
        if any(ARRAY.search(kind) for kind in given.values()):
            found += [f"{name} {line}" for line in _missing("arrays", documentation)]
    return found
