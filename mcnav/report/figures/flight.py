"""Nominal flight: the diagrams that the scenario asks for."""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav.contract.history import History, Panel
from mcnav.report.drawing.figure import Figure
from mcnav.report.drawing.marks import Axis, Line, Rule, Series, axis, numbered
from mcnav.report.drawing.marks import Panel as Diagram
from mcnav.report.drawing.palette import LINEAR

ONLY: Final = Series("flown", "flown", LINEAR)


def flight(history: History) -> Figure | None:
    """Draw every panel of the history; none where it has none."""
    if not history.panels:
        return None
    titles = [panel.title for panel in history.panels]
    return Figure(
        name="flight",
        title=history.title,
        description=f"{history.title}: " + "; ".join(titles),
        panels=[_panel(number, history, panel) for number, panel in enumerate(history.panels)],
        key=(),
        columns=history.columns,
    )


def _panel(place: int, history: History, panel: Panel) -> Diagram:
    first, time = next(iter(history.columns.items()))
    shown = np.ones(len(time), dtype=bool)
    if panel.begin is not None:
        shown = time >= min(panel.begin, time[-1])
    several = len(panel.y) > 1
    labels = panel.legend or panel.y
    lines = [
        Line(
            _numbered(place, number, label) if several else ONLY,
            history.columns[panel.x][shown],
            history.columns[name][shown],
        )
        for number, (name, label) in enumerate(zip(panel.y, labels, strict=True))
    ]
    upward = axis(panel.y_label or panel.y[0], log=panel.log, low=0.0 if panel.from_zero else None)
    events = [Rule(history.events[event], name=event) for event in panel.marks]
    across: Axis = axis(panel.x, margin=0.02, link=panel.x == first)
    return Diagram(panel.title, across, upward, [*lines, *events], [line.series for line in lines] if several else ())


def _numbered(place: int, number: int, label: str) -> Series:
    """Return the series of one curve of a panel, with a name of its own in the figure."""
    series = numbered(number, label)
    return Series(f"panel-{place}-{number}", label, series.colour, series.kind)
