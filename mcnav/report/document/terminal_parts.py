"""Parts of a page in the terminal: sentences and tables. Figures are on the page alone."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from markupsafe import Markup
from rich.console import Group, RenderableType
from rich.text import Text

from mcnav.report.document.fitted_table import Column, FittedTable
from mcnav.report.document.parts import Lines, Note, Part, Sentence, Verdict
from mcnav.report.document.table import Cell, Table

COLOURS: Final = {"agrees": "green", "differs": "red", "partly": "yellow", "undecided": "yellow"}
"""By tone."""


def printed(parts: Sequence[Part]) -> RenderableType:
    """Arrange parts below each other, tables after an empty line."""
    lines = list[RenderableType]()
    for part in parts:
        match part:
            case Verdict():
                lines.append(Text(plain(part.headline), style=f"bold {COLOURS.get(part.tone, '')}"))
                lines += [Text(plain(sentence)) for sentence in part.sentences]
            case Sentence():
                lines.append(Text(plain(part.text), style=COLOURS.get(part.tone, "")))
            case Note():
                lines.append(Text(plain(part.text)))
            case Table():
                lines += ["", fitted(part)] if lines else [fitted(part)]
            case Lines():
                lines += ["", Text(part.text.rstrip(), no_wrap=True, overflow="ignore")]
            case _:
                pass
    return Group(*lines)


def fitted(table: Table[Any]) -> FittedTable:
    """Lay a table out for the width of a terminal."""
    columns = [
        Column(column.terminal_heading, column.kind != "number", column.spare)
        for column in table.columns_in("terminal")
    ]
    laid = FittedTable(table.title, columns, table.keys, table.elsewhere)
    for heading, row, cells in zip(table.headings, table.rows, table.cells_in("terminal"), strict=True):
        if heading:
            laid.add(Text(heading, style="bold"), *[""] * (len(columns) - 1))
        faint = table.faint is not None and table.faint(row)
        laid.add(*(_text(cell, faint) for cell in cells))
    return laid


def _text(cell: Cell, faint: bool) -> Text:
    """Write a cell in one line: a label in its colour, a unit in brackets."""
    words = plain(cell.text) + (f" {plain(cell.behind)}" if cell.behind else "")
    style = "dim" if faint else COLOURS.get(cell.tone or "", "")
    return Text(f"{words} [{cell.unit}]" if cell.unit else words, style=style)


def plain(text: str) -> str:
    """Remove the tags of a text.

    >>> plain(Markup("<em>a</em> &lt; b"))
    'a < b'
    """
    return (text.striptags() if isinstance(text, Markup) else text).replace("\N{NO-BREAK SPACE}", " ")
