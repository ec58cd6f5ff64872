"""What a page of a closed loop folds: panels beside the worst component of each vector, and tables of many rows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from mcnav.report.document.parts import Answers, Folded, Part
from mcnav.report.document.table import Table
from mcnav.report.drawing.figure import Figure, MovedFigure
from mcnav.report.results.model import RunAnalysis
from mcnav.report.results.worst_components import departures, worst_components

ROWS: Final = 8
"""Rows of a table that is not folded."""

COLUMNS: Final = 12
"""Columns of one."""

SECONDARY: Final = frozenset(
    {"quantiles", "convergence", "nees", "within-history", "matrices", "scatter", "development"}
)
"""Figures that are folded whole: they examine what others of their section show."""


def with_worst_first(content: RunAnalysis, figure: Figure) -> Figure:
    """Put the panel of the worst component of each vector first, the worst of all before others; fold the rest."""
    if not content.looped or figure.shown or isinstance(figure, MovedFigure) or len(figure.panels) <= figure.beside:
        return figure
    away, names = departures(content), content.output_names
    worst = {names[place] for place in worst_components(content)}

    def rank(panel_title: str) -> tuple[bool, float]:
        return panel_title not in worst, -away.get(panel_title, 0.0)

    panels = sorted(figure.panels, key=lambda panel: rank(panel.title))
    return replace(figure, panels=panels, folded=figure.beside)


def with_folded_parts(parts: Sequence[Part]) -> list[Part]:
    """Fold tables of many rows, and secondary figures under their titles."""
    return [_folded(part) for part in parts]


def _folded(part: Part) -> Part:
    match part:
        case Answers():
            return Folded(f"Each of the {sum(len(table.rows) for table in part.tables)} outputs", [part])
        case Table() if len(part.rows) > ROWS or len(part.columns) > COLUMNS:
            return Folded(f"Table of {len(part.rows)} rows", [part])
        case Figure() if part.name in SECONDARY:
            return Folded(part.title, [part])
    return part
