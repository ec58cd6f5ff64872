"""Validation of the statistics as an HTML page."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from mcnav.calibration.drawing import measured
from mcnav.report.page import filled

if TYPE_CHECKING:
    import pandas as pd

TITLES: Final = {
    "coverage": "Coverage of intervals",
    "false alarm": "False alarms of tests",
    "power": "Power against a linear model that is 5 % wrong",
}
FINDINGS: Final = {
    "as stated": ("agrees", "", "the nominal rate is within the binomial interval (99.9 %)"),
    "safe": ("agrees", "+", "outside, on the conservative side"),
    "nearly": ("undecided", "≈", "outside by less than 0.01"),
    "remarked": ("undecided", "*", "outside by more; the report of such a campaign warns of it (long tails)"),
    "off": ("differs", "≠", "outside by more, without a warning"),
    "withheld": ("", "†", "not reported by the program, because the rate is too far off"),
}
"""Tone, sign and meaning of each finding."""


def render(table: pd.DataFrame, trials: int) -> str:
    """Render the page from a table of `mcnav.calibration.table.rates`, with ``trials`` campaigns of each kind."""
    sizes = sorted(table["samples"].unique())
    sections = [
        {"title": title, "id": kind.replace(" ", "-"), "rows": _rows(table[table["kind"] == kind], sizes),
         "figure": measured(table, kind, title)}
        for kind, title in TITLES.items()
        if (table["kind"] == kind).any()
    ]  # fmt: skip
    counted = table[table["finding"] != ""]["finding"].value_counts()
    return filled(
        "calibration.html",
        trials=trials,
        campaigns=f"{_campaigns(table):,}",
        sizes=[f"{size:,}" for size in sizes],
        sections=sections,
        findings=[(name, int(counted.get(name, 0)), *words) for name, words in FINDINGS.items()],
    )


def _campaigns(table: pd.DataFrame) -> int:
    """Count the synthetic campaigns of a table."""
    cells = table.groupby(["system", "sources", "design", "samples"])["campaigns"].max()
    return int(cells.sum())


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
        rows.append(
            {
                "statement": statement, "system": system, "sources": sources, "design": design,
                "cells": list(cells.values()), "nominal": "" if nominal != nominal else f"{100.0 * nominal:g}",
            }
        )  # fmt: skip
    return rows
