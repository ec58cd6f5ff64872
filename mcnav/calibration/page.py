"""The calibration study as one HTML page."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from mcnav.report.page import filled

if TYPE_CHECKING:
    import pandas as pd

TITLES: Final = {
    "coverage": "Do intervals cover the truth as often as they say?",
    "false alarm": "Do tests reject what is true as seldom as they say?",
    "power": "Is a linear model that is 5 % wrong found out?",
}
TONES: Final = {
    "as stated": "agrees",
    "safe": "agrees",
    "nearly": "undecided",
    "remarked": "undecided",
    "off": "differs",
    "withheld": "",
    "": "",
}


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
        {"title": title, "kind": kind, "rows": _rows(table[table["kind"] == kind], sizes)}
        for kind, title in TITLES.items()
    ]
    counted = table[table["finding"] != ""]["finding"].value_counts()
    return filled(
        "calibration.html",
        trials=trials,
        campaigns=f"{_campaigns(table):,}",
        sizes=[f"{size:,}" for size in sizes],
        sections=sections,
        counted=[
            (name, int(counted.get(name, 0))) for name in ("as stated", "safe", "nearly", "remarked", "off", "withheld")
        ],
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
                cells.append({"rate": "–", "interval": "", "tone": ""})
                continue
            row = at[size]
            cells.append(
                {
                    "rate": f"{100.0 * row['measured']:.1f}",
                    "interval": f"{100.0 * row['low']:.1f} … {100.0 * row['high']:.1f}",
                    "tone": TONES[row["finding"]],
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
