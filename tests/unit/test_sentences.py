"""No sentence of an error, a warning, the help or a page of the documentation has more than 25 words."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.conftest import PACKAGE, ROOT
from tests.sentences import prose_of, too_long

SAYING = ("refuse", "_refuse", "fail", "warn")
"""Functions whose texts people read, besides those that make an error."""


def _text(node: ast.AST) -> str:
    """Return a text as it is written, with a word in place of each value."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    if isinstance(node, ast.JoinedStr):
        return "".join(_text(value) if isinstance(value, ast.Constant) else "value" for value in node.values)
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        return (_text(node.left) or "value") + (_text(node.right) or "value")
    return ""


def _messages(tree: ast.AST) -> Iterator[str]:
    """Yield the texts of errors and warnings."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            name = getattr(node.func, "id", getattr(node.func, "attr", ""))
            if name.endswith("Error") or name in SAYING:
                yield from map(_text, node.args)


def _help(tree: ast.AST) -> Iterator[str]:
    """Yield the texts of commands and of their options."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef) and any("command" in ast.unparse(d) for d in node.decorator_list):
            yield ast.get_docstring(node) or ""
        if isinstance(node, ast.keyword) and node.arg == "help":
            yield _text(node.value)


@pytest.mark.parametrize("room", ["", "cli"])
def test_messages_can_be_read_at_once(room: str) -> None:
    """Of the whole package the errors, of the commands the help."""
    texts = _help if room else _messages
    long = {
        (str(file.relative_to(PACKAGE)), sentence)
        for file in sorted(Path(PACKAGE / room).rglob("*.py"))
        for text in texts(ast.parse(file.read_text(encoding="utf-8")))
        for sentence in too_long(text)
    }
    assert long == set()


def test_pages_of_the_documentation_can_be_read_at_once() -> None:
    pages = [ROOT / "README.md", *sorted((PACKAGE / "docs").rglob("*.md"))]
    assert len(pages) > 35
    long = [
        (page.name, sentence)
        for page in pages
        for text in prose_of(page.read_text(encoding="utf-8"))
        for sentence in too_long(text)
    ]
    assert long == []
