"""Reproduction of "The Story of 84 Minutes" as an HTML page and CSV files."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

import pandas as pd

from mcnav.files import write_texts
from mcnav.report.format import number
from mcnav.report.html import filled
from mcnav.validation.reproduce.story_of_84_minutes import curves as story_curves
from mcnav.validation.reproduce.story_of_84_minutes import figures as drawn
from mcnav.validation.reproduce.story_of_84_minutes.numbers import Number, Standing, all_numbers

TITLE: Final = "The Story of 84 Minutes"

KINDS: Final = {Standing.DIGITS: "digits", Standing.SLIDE_RULE: "tolerance", Standing.MISPRINT: "inconsistent"}
"""Classes of the style sheet by agreement."""

PHRASES: Final = {
    Standing.DIGITS: "agree to the printed digits",
    Standing.SLIDE_RULE: "agree to a slide rule's accuracy",
    Standing.MISPRINT: "are misprinted or miscalculated",
}


def table(numbers: Sequence[Number]) -> pd.DataFrame:
    """Tabulate the numbers."""
    frame = pd.DataFrame([asdict(each) | {"standing": each.standing.value} for each in numbers])
    frame = frame.rename(columns={"closed": "closed form", "flown": "flown at rest", "cruising": "flown cruising"})
    return frame[[*frame.columns[:-3], "standing", "remark"]]


def _shown(each: Number) -> dict[str, Any]:
    """Format a number with one digit more than printed."""

    def text(value: float | None) -> str:
        if value is None:
            return ""
        if "e" in each.printed:
            return f"{value:,.0f}"
        decimals = len(each.printed.partition(".")[2]) + 1
        return f"{value:,.{decimals}f}".replace("-", "−") if abs(value) >= 0.5 * 10.0**-decimals else "0"

    return asdict(each) | {
        "unit": "" if each.unit == "1" else each.unit,
        "printed": number(float(each.printed), 3) if "e" in each.printed else each.printed,
        "kind": KINDS[each.standing],
        "standing": each.standing.value,
        **{name: text(getattr(each, name)) for name in ("closed", "linear", "flown", "cruising")},
    }


def write(folder: Path) -> list[Path]:
    """Write the page and its tables into a folder; return their paths, the page first."""
    numbers, curves, periods = all_numbers(), story_curves.curves(), story_curves.periods()
    climb, growth = story_curves.climb(), story_curves.hover_growth()
    departure = story_curves.hover_departure()
    tables = {
        "numbers.csv": table(numbers),
        "curves.csv": curves,
        "periods.csv": periods,
        "climb.csv": climb,
        "hover.csv": growth,
        "hover_departure.csv": departure,
    }
    counted = Counter(each.standing for each in numbers)
    across, expected = story_curves.across()
    page = filled(
        "story.html",
        title=TITLE,
        total=len(numbers),
        counts=[(PHRASES[standing], counted[standing]) for standing in Standing if counted[standing]],
        misprints=[_shown(each) for each in numbers if each.standing is Standing.MISPRINT],
        numbers=[_shown(each) for each in numbers],
        marks=[(kind, PHRASES[standing]) for standing, kind in KINDS.items()],
        errors=[drawn.error(name, curves) for name in drawn.TITLES],
        periods=[drawn.periods(periods), drawn.climb(climb)],
        cruising=number(float(periods["period along the track, flown [min]"][1]), 5),
        across=number(across, 5),
        expected_across=number(expected, 5),
        correction=f"{100.0 * periods['V^2 / g r'][1]:.2f}",
        hover=drawn.hover(growth, departure),
        tables=list(tables),
    )
    return write_texts(folder, {"story.html": page} | {name: each.to_csv(index=False) for name, each in tables.items()})
