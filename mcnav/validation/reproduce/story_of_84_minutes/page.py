"""Reproduction of "The Story of 84 Minutes" as an HTML page and CSV files."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Final

import pandas as pd
from markupsafe import Markup

from mcnav.files import write_texts
from mcnav.report.document import (
    CODE,
    Beside,
    Cell,
    Column,
    Heading,
    MarkKey,
    Note,
    Page,
    Section,
    Sentence,
    Table,
    counts_in_words,
)
from mcnav.report.format import number
from mcnav.report.html import page_html
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


COMPARED: Final = Markup(
    "Each number is compared with its closed form, and with linear (variational) analysis and nonlinear simulation of "
    "a navigator at rest, as in the document. It is also compared with the simulation of the missile cruising at "
    "2,640 ft/s. The simulation contains no pendulum equation: it integrates the motion that the instruments "
    "indicate. For the flat earth the radius is multiplied by 10<sup>10</sup>. W. Bollay, <em>A Critical Meeting on "
    "the Development of Inertial Navigation</em>, Stanford 1966."
)

TILT: Final = Markup(
    'The statement that the error due to a tilt about the track is "exactly similar" to that about the cross axis '
    "holds only at rest. A tilt keeps its direction in inertial space, so that it becomes an azimuth error as the "
    "missile moves around the earth (last figure of Problems 1 to 3). The period depends on g across the track and on "
    "g<sub>eff</sub> along it: simulated {} min across, where 2π√(r/g) is {} min, and {} min along."
)

CRUISING: Final = Markup(
    "The cruising missile differs from the closed forms by a few times V²/(g r) = {} %. Its g<sub>eff</sub> is "
    "smaller by this amount, so that its period is longer by half of it."
)
"""Notes on the numbers."""


def _text(value: float | None, each: Number) -> str:
    """Format a computed number with one digit more than printed."""
    if value is None:
        return ""
    if "e" in each.printed:
        return f"{value:,.0f}"
    decimals = len(each.printed.partition(".")[2]) + 1
    return f"{value:,.{decimals}f}".replace("-", "−") if abs(value) >= 0.5 * 10.0**-decimals else "0"


def _printed(each: Number) -> str:
    return number(float(each.printed), 3) if "e" in each.printed else each.printed


def _quantity(each: Number, remark: str = "") -> Cell:
    return Cell(each.quantity, "" if each.unit == "1" else each.unit, below=remark)


def _misprint_table(numbers: Sequence[Number]) -> Table[Number]:
    """Tabulate the wrong printed numbers."""
    columns: list[Column[Number]] = [
        Column("Where", lambda each: each.place, kind="label"),
        Column("Quantity", _quantity, kind="words"),
        Column("Printed", _printed),
        Column("Correct", lambda each: _text(each.closed, each)),
        Column("Cause", lambda each: each.remark, kind="words"),
    ]
    rows = [each for each in numbers if each.standing is Standing.MISPRINT]
    return Table("Wrong printed numbers, the correct values, and the causes.", columns, rows)


def _number_table(numbers: Sequence[Number]) -> Table[Number]:
    """Tabulate all numbers."""

    def remark(each: Number) -> str:
        return "" if each.standing is Standing.MISPRINT else each.remark

    def closed(each: Number) -> Cell:
        return Cell(_text(each.closed, each), mark=KINDS[each.standing], hint=each.standing.value)

    columns: list[Column[Number]] = [
        Column("Where", lambda each: each.place, kind="label"),
        Column("Quantity", lambda each: _quantity(each, remark(each)), kind="words"),
        Column("Printed", _printed),
        Column("Formula", lambda each: each.formula, kind="words"),
        Column("Closed form", closed),
        Column("Linear", lambda each: _text(each.linear, each)),
        Column("Simulated at rest", lambda each: _text(each.flown, each)),
        Column("Simulated cruising", lambda each: _text(each.cruising, each)),
    ]
    caption = "Printed, by the formula of the document, by linear analysis, and simulated."
    return Table(caption, columns, numbers, style="marked")


def _page(numbers: Sequence[Number], tables: Mapping[str, pd.DataFrame]) -> Page:
    """Return the page; tables by the names of their files."""
    counted = Counter(each.standing for each in numbers)
    counts = [(PHRASES[standing], counted[standing]) for standing in Standing if counted[standing]]
    periods, climb = tables["periods.csv"], tables["climb.csv"]
    cruising = number(float(periods["period along the track, flown [min]"][1]), 5)
    tilt = TILT.format(*(number(each, 5) for each in story_curves.across()), cruising)
    key = MarkKey([(kind, PHRASES[standing]) for standing, kind in KINDS.items()])
    errors = [drawn.error(name, tables["curves.csv"]) for name in drawn.TITLES]
    correction = Note(CRUISING.format(f"{100.0 * periods['V^2 / g r'][1]:.2f}"))
    files = Markup("{}.").format(Markup(", ").join(CODE(name) for name in tables))
    sections = [
        Section("misprints", "Misprints", [_misprint_table(numbers), Note(tilt)]),
        Section("numbers", "All numbers", [key, _number_table(numbers), correction]),
        Section("problems", "Problems 1 to 3", [part for each in errors for part in (Heading(each.title), each)]),
        Section("period", "Period", [Beside([drawn.periods(periods), drawn.climb(climb)])]),
        Section("hover", "Problem 4: hovering",
                [Beside(drawn.hover(tables["hover.csv"], tables["hover_departure.csv"]))]),
        Section("tables", "Tables", [Sentence(files)]),
    ]  # fmt: skip
    intro = Markup("{} printed numbers: {}").format(len(numbers), counts_in_words(counts))
    return Page(TITLE, "Printed and recomputed numbers", TITLE, [Sentence(intro), Note(COMPARED)], sections)


def write(folder: Path) -> list[Path]:
    """Write the page and its tables into a folder; return their paths, the page first."""
    numbers = all_numbers()
    tables = {
        "numbers.csv": table(numbers),
        "curves.csv": story_curves.curves(),
        "periods.csv": story_curves.periods(),
        "climb.csv": story_curves.climb(),
        "hover.csv": story_curves.hover_growth(),
        "hover_departure.csv": story_curves.hover_departure(),
    }
    page = page_html(_page(numbers, tables))
    return write_texts(folder, {"story.html": page} | {name: each.to_csv(index=False) for name, each in tables.items()})
