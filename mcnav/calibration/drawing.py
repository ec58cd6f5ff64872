"""Figures of measured and nominal rates."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from mcnav.report.figures.figure import HALF, Figure
from mcnav.report.figures.marks import Axis, Mark, Panel, Points, Rule, Series
from mcnav.report.figures.palette import FLOWN, INK, LINEAR, MUTED

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

    def panel(name: str, shown: pd.DataFrame) -> Panel:
        marks: list[Mark] = [Rule(100.0 * nominal, colour=INK) for nominal in shown["nominal"].dropna().unique()]
        for finding in found:
            rates = shown[shown["finding"] == finding]
            rows = np.array([statements.index(statement) for statement in rates["statement"]])
            shifts = np.searchsorted(sizes, rates["samples"]) - 0.5 * (len(sizes) - 1)
            marks.append(Points(FINDINGS[finding], 100.0 * rates["measured"], rows + 0.16 * shifts, 5.3))
        return Panel(name, Axis("campaigns", "%"), Axis(names=statements), marks)

    panels = [panel("All rates", own)]
    if "withheld" in found:
        panels.append(panel("Reported by the program", own[own["finding"] != "withheld"]))
    return Figure(
        name=kind.replace(" ", "-"),
        title=title,
        description=f"Measured rates ({kind}) for every statement, system, distribution, design and size; the line is "
        "the nominal rate.",
        panels=panels,
        key=[FINDINGS[finding] for finding in found] if found != [""] else (),
        columns=dict(own.drop(columns="kind").items()),
        size=(HALF[0], 82.0 + 33.0 * len(statements)),
        caption="One mark per system, distribution, design and number of samples, which increases downwards within a "
        "row.",
        file="calibration.csv",
    )
