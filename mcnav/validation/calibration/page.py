"""Validation of the statistics as an HTML page with figures of measured and nominal rates."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from mcnav.files import write_texts
from mcnav.report.figures.figure import HALF, Figure
from mcnav.report.figures.marks import Axis, Mark, Panel, Points, Rule, Series
from mcnav.report.figures.palette import FLOWN, INK, LINEAR, MUTED
from mcnav.report.html import filled
from mcnav.sampling.designs import DESIGNS
from mcnav.validation.calibration.filter_trials import FILTER, run_filter_trials
from mcnav.validation.calibration.kalman_trials import KALMAN, run_kalman_trials
from mcnav.validation.calibration.navigation_trials import AIDED, NAVIGATION, SHARE, run_navigation_trials
from mcnav.validation.calibration.noise_trials import NOISE, run_noise_trials
from mcnav.validation.calibration.table import rates
from mcnav.validation.calibration.tail_trials import TAILS, run_tail_trials
from mcnav.validation.calibration.trials import run_trials

if TYPE_CHECKING:
    import pandas as pd

TITLES: Final = {
    ("", "coverage"): "Coverage of intervals",
    ("", "false alarm"): "False alarms of tests",
    ("", "power"): "Power against a linear model that is 5 % wrong",
    ("noise", "coverage"): "Noise: coverage of intervals",
    ("noise", "false alarm"): "Noise: false alarms",
    ("noise", "power"): "Noise: power",
    ("tails", "coverage"): "Requirements: coverage of bounds",
    ("tails", "power"): "Requirements: power over twelve epochs",
    ("filter", "coverage"): "Filters: coverage of intervals",
    ("filter", "false alarm"): "Filters: false alarms",
    ("filter", "power"): "Filters: power, and naming of the largest neglected error",
}
"""Titles of the sections by group of systems and kind of rate."""

GROUPS: Final = {
    NOISE: "noise", NAVIGATION: "noise", TAILS: "tails", FILTER: "filter", KALMAN: "filter", AIDED: "filter",
}  # fmt: skip
"""Groups of systems by the beginnings of their names."""

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
    """Render the page from a table of rates, with ``trials`` campaigns of each kind."""
    groups = table["system"].map(_group)
    picked = {key: table[(groups == key[0]) & (table["kind"] == key[1])] for key in TITLES}
    sections = [_section(own, *key, TITLES[key]) for key, own in picked.items() if len(own)]
    counted = table[table["finding"] != ""]["finding"].value_counts()
    return filled(
        "calibration.html",
        trials=trials,
        campaigns=f"{table.groupby(['system', 'sources', 'design', 'samples'])['campaigns'].max().sum():,}",
        sections=sections,
        groups=set(groups),
        findings=[(name, int(counted.get(name, 0)), *words) for name, words in FINDINGS.items()],
    )


def write_calibration(folder: Path, trials: int, jobs: int) -> tuple[pd.DataFrame, list[Path]]:
    """Measure all rates, write the page and its CSV file, and return the table of rates and the files."""
    counted = run_trials(trials, jobs, DESIGNS)
    for others in (
        run_noise_trials(trials, jobs), run_tail_trials(trials, jobs),
        run_filter_trials(trials, jobs), run_kalman_trials(trials, jobs),
        run_navigation_trials(max(trials // SHARE, 2), jobs),
    ):  # fmt: skip
        counted += others
    table = rates(counted)
    texts = {"calibration.html": render(table, trials)}
    texts["calibration.csv"] = table.to_csv(index=False, float_format="%.4f")
    return table, write_texts(folder, texts)


def _group(system: str) -> str:
    return next((group for beginning, group in GROUPS.items() if system.startswith(beginning)), "")


def _section(table: pd.DataFrame, group: str, kind: str, title: str) -> dict[str, Any]:
    sizes, name = sorted(table["samples"].unique()), kind.replace(" ", "-")
    name = f"{group}-{name}" if group else name
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
    figure = [finding for finding in MARKS if (own["finding"] == finding).any()]
    sizes = sorted(own["samples"].unique())

    def panel(name: str, shown: pd.DataFrame) -> Panel:
        marks: list[Mark] = [Rule(100.0 * nominal, colour=INK) for nominal in shown["nominal"].dropna().unique()]
        for finding in figure:
            rates = shown[shown["finding"] == finding]
            rows = np.array([statements.index(statement) for statement in rates["statement"]])
            shifts = np.searchsorted(sizes, rates["samples"]) - 0.5 * (len(sizes) - 1)
            marks.append(Points(MARKS[finding], 100.0 * rates["measured"], rows + 0.16 * shifts, 5.3))
        return Panel(name, Axis("campaigns", "%"), Axis(names=statements), marks)

    panels = [panel("All rates", own)]
    if "withheld" in figure:
        panels.append(panel("Reported by the program", own[own["finding"] != "withheld"]))
    return Figure(
        name=name,
        title=title,
        description=f"Measured rates ({kind}) for every statement, system, distribution, design and size; the line is "
        "the nominal rate.",
        panels=panels,
        key=[MARKS[finding] for finding in figure] if figure != [""] else (),
        columns=dict(own.drop(columns="kind").items()),
        size=(HALF[0], 82.0 + 33.0 * len(statements)),
        caption="One mark per system, distribution, design and number of samples, which increases downwards within a "
        "row.",
        file="calibration.csv",
    )
