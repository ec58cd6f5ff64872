"""Figures of measured and nominal rates."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Final

import numpy as np
from matplotlib.axes import Axes

from mcnav.report.figures.figure import HALF, Figure, Plot, Series
from mcnav.report.svg import FLOWN, INK, LINEAR, MUTED

if TYPE_CHECKING:
    import pandas as pd

FINDINGS: Final = {
    "as stated": Series("stated", "as stated", LINEAR, "dot"),
    "safe": Series("safe", "safe", LINEAR, "triangle"),
    "nearly": Series("nearly", "nearly", INK, "box"),
    "remarked": Series("remarked", "remarked", INK, "onward"),
    "off": Series("off", "off", FLOWN, "square"),
    "withheld": Series("withheld", "withheld", MUTED, "ring"),
    "": Series("power", "rate", LINEAR, "dot"),
}


def measured(table: pd.DataFrame, kind: str, title: str) -> Figure:
    """Draw all rates of one kind, one row per statement, and separately those that the program reports."""
    own = table[table["kind"] == kind]
    statements = list(dict.fromkeys(own["statement"]))
    found = [finding for finding in FINDINGS if (own["finding"] == finding).any()]
    sizes = sorted(own["samples"].unique())

    def draw(axes: Axes, shown: pd.DataFrame) -> None:
        for finding in found:
            rates = shown[shown["finding"] == finding]
            rows = np.array([statements.index(statement) for statement in rates["statement"]])
            shifts = np.searchsorted(sizes, rates["samples"]) - 0.5 * (len(sizes) - 1)
            FINDINGS[finding].on(axes, 100.0 * rates["measured"], rows + 0.16 * shifts, markersize=4.0)
        for nominal in shown["nominal"].dropna().unique():
            axes.axvline(100.0 * nominal, color=INK, linewidth=1.0, zorder=0)
        axes.set_yticks(range(len(statements)), statements)
        axes.set_ylim(len(statements) - 0.5, -0.5)
        axes.grid(axis="y", visible=False)
        axes.set_xlabel("campaigns (%)")

    plots = [Plot("All rates", partial(draw, shown=own))]
    if "withheld" in found:
        plots.append(Plot("Reported by the program", partial(draw, shown=own[own["finding"] != "withheld"])))
    return Figure(
        key=kind.replace(" ", "-"),
        title=title,
        description=f"Measured rates ({kind}) for every statement, system, distribution, design and size; the line is "
        "the nominal rate.",
        plots=plots,
        series=[FINDINGS[finding] for finding in found] if found != [""] else (),
        data=own.drop(columns="kind"),
        size=(HALF[0], 1.0 + 0.34 * len(statements)),
        caption="One mark per system, distribution, design and number of samples, which increases downwards within a "
        "row.",
        file="calibration.csv",
    )
