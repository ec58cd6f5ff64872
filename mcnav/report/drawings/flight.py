"""What was flown: the diagrams that the scenario asks for."""

from __future__ import annotations

from functools import partial

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from mcnav.report.drawings.drawing import HALF, Drawing, Plot, axis_label
from mcnav.report.svg import FLOWN, LINEAR, SOURCE_COLOURS
from mcnav.scenarios.protocol import History, Panel

LEGEND = 3
"""Entries of a plot's own key side by side, below it."""


def flight(history: History) -> Drawing | None:
    """Every panel of the history; none where it has none."""
    if not history.panels:
        return None
    lines = max((len(panel.y) for panel in history.panels if len(panel.y) > 1), default=0)
    titles = [panel.title for panel in history.panels]
    return Drawing(
        key="flight",
        title="What was flown",
        description="The nominal flight: " + "; ".join(titles),
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
    legend = panel.legend or panel.y if len(panel.y) > 1 else (None,)
    for number, (name, label) in enumerate(zip(panel.y, legend, strict=True)):
        colour = LINEAR if len(panel.y) == 1 else SOURCE_COLOURS[number % len(SOURCE_COLOURS)]
        axes.plot(history.columns[panel.x][shown], history.columns[name][shown], color=colour, label=label)
    if panel.log:
        axes.set_yscale("log")
        axes.yaxis.set_major_formatter(lambda value, _: f"{value:,.10g}")  # the default one writes mathematics
    axes.set(xlabel=axis_label(panel.x), ylabel=axis_label(panel.y_label or panel.y[0]))
    if panel.from_zero:
        axes.set_ylim(bottom=0.0)
    axes.margins(x=0.02)
    for mark in panel.marks:
        place = history.events[mark]
        axes.axvline(place, color=FLOWN, linewidth=1.0, linestyle="--")
        axes.annotate(f" {mark}", (place, 0.02), xycoords=("data", "axes fraction"), color=FLOWN, fontsize=8)
    if len(panel.y) > 1:
        axes.legend(fontsize=8, ncols=LEGEND, loc="upper center", bbox_to_anchor=(0.5, -0.22), handlelength=1.2)
