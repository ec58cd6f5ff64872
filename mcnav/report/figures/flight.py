"""What was flown: the diagrams that the scenario asks for."""

from __future__ import annotations

from functools import partial
from typing import Final

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from mcnav.report.figures.figure import HALF, Figure, Plot, Series, axis_label, mark, numbered, plainly
from mcnav.report.svg import LINEAR
from mcnav.scenarios.protocol import History, Panel

ONLY: Final = Series("flown", "flown", LINEAR)
LEGEND: Final = 3
"""Entries of a plot's own key side by side, below it."""


def flight(history: History) -> Figure | None:
    """Every panel of the history; none where it has none."""
    if not history.panels:
        return None
    lines = max((len(panel.y) for panel in history.panels if len(panel.y) > 1), default=0)
    titles = [panel.title for panel in history.panels]
    return Figure(
        key="flight",
        title="Nominal flight",
        description="Nominal flight: " + "; ".join(titles),
        plots=[Plot(panel.title, partial(_panel, history=history, panel=panel)) for panel in history.panels],
        series=(),
        data=pd.DataFrame(dict(history.columns)),
        size=(HALF[0], HALF[1] + 0.17 * -(-lines // LEGEND)),
    )


def _panel(axes: Axes, history: History, panel: Panel) -> None:
    time = next(iter(history.columns.values()))
    shown = np.ones(len(time), dtype=bool)
    if panel.begin is not None:
        shown = time >= min(panel.begin, time[-1])
    labels = panel.legend or panel.y
    for number, (name, label) in enumerate(zip(panel.y, labels, strict=True)):
        series = numbered(number, label) if len(panel.y) > 1 else ONLY
        series.on(axes, history.columns[panel.x][shown], history.columns[name][shown], label=label)
    if panel.log:
        axes.set_yscale("log")
        plainly(axes.yaxis)
    axes.set(xlabel=axis_label(panel.x), ylabel=axis_label(panel.y_label or panel.y[0]))
    if panel.from_zero:
        axes.set_ylim(bottom=0.0)
    axes.margins(x=0.02)
    for event in panel.marks:
        mark(axes, history.events[event], event)
    if len(panel.y) > 1:
        axes.legend(fontsize=8, ncols=LEGEND, loc="upper center", bbox_to_anchor=(0.5, -0.22), handlelength=1.9)
