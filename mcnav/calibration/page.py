"""Validation of the statistics as an HTML page with figures of measured and nominal rates."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from mcnav.calibration.filter_trials import FILTER
from mcnav.report.figures.figure import HALF, Figure
from mcnav.report.figures.marks import Axis, Mark, Panel, Points, Rule, Series
from mcnav.report.figures.palette import FLOWN, INK, LINEAR, MUTED
from mcnav.report.page import filled

if TYPE_CHECKING:
    import pandas as pd

TITLES: Final = {
    (False, "coverage"): "Coverage of intervals",
    (False, "false alarm"): "False alarms of tests",
    (False, "power"): "Power against a linear model that is 5 % wrong",
    (True, "coverage"): "Filters: coverage of intervals",
    (True, "false alarm"): "Filters: false alarms",
    (True, "power"): "Filters: power against position errors that are 20 % larger than stated, and for consistent ones",
}
"""Titles of the sections by whether they are of campaigns with a filter, and by kind of rate."""

FINDINGS: Final = {
    "as stated": ("agrees", "", "the nominal rate is within the binomial interval (99.9 %)"),
    "safe": ("agrees", "+", "outside, on the conservative side"),
    "nearly": ("undecided", "≈", "outside by less than 0.01"),
    "remarked": ("undecided", "*", "outside by more; the report of such a campaign warns of it (long tails)"),
    "off": ("differs", "≠", "outside by more, without a warning"),
    "withheld": ("", "†", "not reported by the program, because the rate is too far off"),
}
"""Tone, sign and meaning of each finding."""

MARKS: Final = {
    "as stated": Series("stated", "as stated", LINEAR, "dot"),
    "safe": Series("safe", "safe", LINEAR, "triangle"),
    "nearly": Series("nearly", "nearly", INK, "box"),
    "remarked": Series("remarked", "remarked", INK, "onward"),
    "off": Series("off", "off", FLOWN, "square"),
    "withheld": Series("withheld", "withheld", MUTED, "ring"),
    "": Series("power", "rate", LINEAR, "dot"),
}
"""Marks of each finding; a power has no finding."""


def render(table: pd.DataFrame, trials: int) -> str:
    """Render the page from a table of `mcnav.calibration.table.rates`, with ``trials`` campaigns of each kind."""
    filtered = table["system"].str.startswith(FILTER)
    sections = [
        _section(table[(filtered == of_filters) & (table["kind"] == kind)], of_filters, kind, title)
        for (of_filters, kind), title in TITLES.items()
        if ((filtered == of_filters) & (table["kind"] == kind)).any()
    ]
    counted = table[table["finding"] != ""]["finding"].value_counts()
    return filled(
        "calibration.html",
        trials=trials,
        campaigns=f"{table.groupby(['system', 'sources', 'design', 'samples'])['campaigns'].max().sum():,}",
        sections=sections,
        filters=bool(filtered.any()),
        findings=[(name, int(counted.get(name, 0)), *words) for name, words in FINDINGS.items()],
    )


def _section(table: pd.DataFrame, of_filters: bool, kind: str, title: str) -> dict[str, Any]:
    sizes, name = sorted(table["samples"].unique()), kind.replace(" ", "-")
    name = f"filter-{name}" if of_filters else name
    figure = _figure(table, name, kind, title)
    return {
        "title": title,
        "id": name,
        "rows": _rows(table, sizes),
        "figure": figure,
        "sizes": [f"{size:,}" for size in sizes],
    }


def _rows(table: pd.DataFrame, sizes: list[int]) -> list[dict[str, Any]]:
    """List one row per statement, system, distribution and design, with a cell for every size."""
    rows = []
    for (statement, system, sources, design), group in table.groupby(["statement", "system", "sources", "design"]):
        cells = {size: {"rate": "–", "interval": "", "tone": "", "sign": ""} for size in sizes}
        for row in group.to_dict("records"):
            tone, sign, _ = FINDINGS.get(row["finding"], ("", "", ""))
            rate, interval = f"{100.0 * row['measured']:.1f}", f"{100.0 * row['low']:.1f} to {100.0 * row['high']:.1f}"
            cells[row["samples"]] = {"rate": rate, "interval": interval, "tone": tone, "sign": sign}
        nominal = group["nominal"].iloc[0]
        rows.append({"statement": statement, "system": system, "sources": sources, "design": design,
                     "cells": list(cells.values()),
                     "nominal": "" if nominal != nominal else f"{100.0 * nominal:g}"})  # fmt: skip
    return rows


def _figure(own: pd.DataFrame, name: str, kind: str, title: str) -> Figure:
    """Draw rates of one kind, one row per statement, and separately those that the program reports."""
    statements = list(dict.fromkeys(own["statement"]))
    found = [finding for finding in MARKS if (own["finding"] == finding).any()]
    sizes = sorted(own["samples"].unique())

    def panel(name: str, shown: pd.DataFrame) -> Panel:
        marks: list[Mark] = [Rule(100.0 * nominal, colour=INK) for nominal in shown["nominal"].dropna().unique()]
        for finding in found:
            rates = shown[shown["finding"] == finding]
            rows = np.array([statements.index(statement) for statement in rates["statement"]])
            shifts = np.searchsorted(sizes, rates["samples"]) - 0.5 * (len(sizes) - 1)
            marks.append(Points(MARKS[finding], 100.0 * rates["measured"], rows + 0.16 * shifts, 5.3))
        return Panel(name, Axis("campaigns", "%"), Axis(names=statements), marks)

    panels = [panel("All rates", own)]
    if "withheld" in found:
        panels.append(panel("Reported by the program", own[own["finding"] != "withheld"]))
    return Figure(
        name=name,
        title=title,
        description=f"Measured rates ({kind}) for every statement, system, distribution, design and size; the line is "
        "the nominal rate.",
        panels=panels,
        key=[MARKS[finding] for finding in found] if found != [""] else (),
        columns=dict(own.drop(columns="kind").items()),
        size=(HALF[0], 82.0 + 33.0 * len(statements)),
        caption="One mark per system, distribution, design and number of samples, which increases downwards within a "
        "row.",
        file="calibration.csv",
    )
