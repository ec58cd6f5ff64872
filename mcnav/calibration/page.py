"""The calibration study as one HTML page."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from mcnav.calibration.drawing import measured
from mcnav.report.page import filled

if TYPE_CHECKING:
    import pandas as pd

TITLES: Final = {
    "coverage": "Do intervals cover the truth as often as they say?",
    "false alarm": "Do tests reject what is true as seldom as they say?",
    "power": "Is a linear model that is 5 % wrong found out?",
}
FINDINGS: Final = {
    "as stated": ("agrees", "", "the nominal rate lies within the rate's binomial error (99.9 %)"),
    "safe": ("agrees", "+", "on the careful side of it"),
    "nearly": ("undecided", "≈", "within a hundredth of it"),
    "remarked": ("undecided", "*", "further, and the report of such a campaign says so (long tails)"),
    "off": ("differs", "≠", "further, unsaid"),
    "withheld": ("", "†", "the program does not give this statement, and the rate shows why"),
}
"""Of each finding its tone, the sign that a rate carries, and what it says."""


def render(table: pd.DataFrame, trials: int) -> str:
    """The page.

    Parameters
    ----------
    table : DataFrame
        Of `mcnav.calibration.table.rates`.
    trials : int
        Campaigns for each system, distribution, design and size.
    """
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
        findings=[(name, int(counted.get(name, 0)), *told) for name, told in FINDINGS.items()],
    )


def _campaigns(table: pd.DataFrame) -> int:
    """Synthetic campaigns behind the table."""
    cells = table.groupby(["system", "sources", "design", "samples"])["campaigns"].max()
    return int(cells.sum())


def _rows(table: pd.DataFrame, sizes: list[int]) -> list[dict[str, Any]]:
    """One row for each statement, system, distribution and design, with a cell for every size."""
    rows = []
    for (statement, system, sources, design), group in table.groupby(["statement", "system", "sources", "design"]):
        at = {int(row["samples"]): row for _, row in group.iterrows()}
        cells = []
        for size in sizes:
            if size not in at:
                cells.append({"rate": "–", "interval": "", "tone": "", "sign": ""})
                continue
            row = at[size]
            tone, sign, _ = FINDINGS.get(row["finding"], ("", "", ""))
            cells.append(
                {
                    "rate": f"{100.0 * row['measured']:.1f}",
                    "interval": f"{100.0 * row['low']:.1f} to {100.0 * row['high']:.1f}",
                    "tone": tone,
                    "sign": sign,
                }
            )
        nominal = group["nominal"].iloc[0]
        rows.append(
            {
                "statement": statement, "system": system, "sources": sources, "design": design, "cells": cells,
                "nominal": "" if nominal != nominal else f"{100.0 * nominal:g}",
            }
        )  # fmt: skip
    return rows
