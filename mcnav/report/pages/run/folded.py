"""What a page of a closed loop folds: panels beside the worst component of each vector, and tables of many rows."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import zip_longest
from typing import TYPE_CHECKING, Any, Final

from mcnav.report.document.parts import Answers, Folded, Heading, Part
from mcnav.report.document.table import Table
from mcnav.report.drawing.figure import Figure, MovedFigure
from mcnav.report.results.worst_components import departures, filter_departures, worst_of_vectors

if TYPE_CHECKING:
    from mcnav.report.results.model import RunAnalysis

ROWS: Final = 5
"""Rows of a table that is not folded."""

OF_FILTER: Final = "sigma-history"
"""Figure whose panels depart by the ratio to the filter's sigma."""

COLUMNS: Final = 12
"""Columns of one."""

SECONDARY: Final = frozenset(
    {
        "quantiles",
        "convergence",
        "nees",
        "within-history",
        "matrices",
        "scatter",
        "development",
        "nees-history",
        "nis-history",
        "combination",
        "correlations",
    }
)
"""Figures that are folded whole: they examine what others of their section show."""


def with_worst_first(content: RunAnalysis, figure: Figure) -> Figure:
    """Put the panel of the worst component of each vector first, the worst of all before others; fold the rest."""
    if not content.looped or figure.shown or isinstance(figure, MovedFigure) or len(figure.panels) <= figure.beside:
        return figure
    away = filter_departures(content) if figure.name == OF_FILTER else departures(content)
    return with_rest_folded(figure, away)


def with_rest_folded(figure: Figure, away: Mapping[str, float]) -> Figure:
    """Put the panel of the worst component of each vector first, by how much each output departs; fold beyond a row."""
    worst = set(worst_of_vectors(list(away), away))

    def rank(panel_title: str) -> tuple[bool, float]:
        return panel_title not in worst, -away.get(panel_title, 0.0)

    panels = sorted(figure.panels, key=lambda panel: rank(panel.title))
    return replace(figure, panels=panels, folded=figure.beside)


def with_folded_parts(parts: Sequence[Part]) -> list[Part]:
    """Fold tables of many rows, and secondary figures under their titles; a heading of one of them is its title."""
    kept: list[Part] = []
    pieces = [_folded(part) for part in parts]
    for part, piece, following in zip_longest(parts, pieces, pieces[1:], fillvalue=Heading("")):
        heading = kept[-1] if kept else None
        if piece is not part and isinstance(heading, Heading) and isinstance(following, (Heading, Folded)):
            kept[-1] = replace(piece, summary=heading.text) if isinstance(piece, Folded) else piece
        else:
            kept.append(piece)
    return kept


def _folded(part: Part) -> Part:
    match part:
        case Answers():
            return Folded(f"Each of the {sum(len(table.rows) for table in part.tables)} outputs", [part])
        case Table() if len(part.rows) > ROWS or len(part.columns) > COLUMNS:
            return Folded(_title(part), [part])
        case Figure() if part.name in SECONDARY:
            return Folded(part.title, [part])
    return part


def _title(table: Table[Any]) -> str:
    """Return the first words of a table's caption: what it has."""
    return re.split(r"[.:;,]", str(table.caption))[0] or f"Table of {len(table.rows)} rows"
