"""Reproduction of "The Story of 84 Minutes" as an HTML page and CSV files."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd
from markupsafe import Markup

from mcnav.files.whole import write_texts
from mcnav.report.document.html import page_html
from mcnav.report.document.parts import Beside, Heading, MarkKey, Note, Page, Part, Section, Sentence
from mcnav.report.document.table import Cell, Column, Table, counts_in_words
from mcnav.report.format import number
from mcnav.validation.reproduce.findings import Finding, finding_table, verdicts_in_words
from mcnav.validation.reproduce.story_of_84_minutes import curves as story_curves
from mcnav.validation.reproduce.story_of_84_minutes import figures as drawn
from mcnav.validation.reproduce.story_of_84_minutes.altimeter import HEIGHTS, altimeters
from mcnav.validation.reproduce.story_of_84_minutes.claims import answer, claims
from mcnav.validation.reproduce.story_of_84_minutes.detuned import detuned_curves, detuning
from mcnav.validation.reproduce.story_of_84_minutes.numbers import SLIDE_RULE, Number, Standing, all_numbers
from mcnav.validation.reproduce.story_of_84_minutes.reduction import (
    MINUTES,
    Printed,
    at_minutes,
    printed_reductions,
    reduction_curves,
)

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
    frame = pd.DataFrame([asdict(number) | {"standing": number.standing.value} for number in numbers])
    frame = frame.rename(columns={"closed": "closed form", "flown": "flown at rest", "cruising": "flown cruising"})
    return frame[[*frame.columns[:-3], "standing", "remark"]]


COMPARED: Final = Markup(
    "W. Bollay, <em>A Critical Meeting on the Development of Inertial Navigation</em>, Stanford 1966. Each number "
    "stands beside its closed form, linear analysis and a nonlinear simulation of a navigator at rest, as in the "
    "document. The missile cruising at 2,640 ft/s is simulated as well. The simulation contains no pendulum equation: "
    "it integrates the motion that the instruments indicate."
)

TOLERANCE: Final = Markup(
    "Tolerance: half a unit of the last printed digit, or for a slide rule {} % of the number. For the flat earth the "
    "radius is multiplied by 10<sup>10</sup>."
)

TILT: Final = Markup(
    "A tilt about the track is “exactly similar” to a tilt about the cross axis only at rest. It keeps its direction "
    "in inertial space, so that it becomes an azimuth error as the missile moves around the earth. The period depends "
    "on g across the track and on g<sub>eff</sub> along it. Simulated: {} min across, where 2π√(r/g) is {} min, and {} "
    "min along."
)

CRUISING: Final = Markup(
    "The cruising missile differs from the closed forms by a few times V²/(g r) = {} %. Its g<sub>eff</sub> is "
    "smaller by this amount, so that its period is longer by half of it."
)
"""Notes on the numbers."""

REDUCED: Final = (
    "Error on a flat earth at the end of the flight, divided by the largest error so far on a spherical earth. All "
    "together: root sum of squares of the errors along the track. The last row is the flight of the document, the "
    "first one a boost."
)

SUMMARIZED: Final = "The document's own summary at 169 min: ratios of its printed numbers, and the correct ones."

DETUNED: Final = (
    "A wrong gear ratio cranks the platform too far. Errors with an accelerometer error of 10⁻⁴ g: the largest at "
    "rest, and that of the cruising missile at the end."
)

ALTIMETERS: Final = (
    "How large an altimeter's sigma may be to hold the height to a limit (one sigma): once the filter is settled, and "
    "from the start. From the start, a Kalman filter must first learn an accelerometer bias of 10⁻⁴ g. The last three "
    "columns are the height errors that an altimeter of 100 m leaves. Closed form and covariance recursion; campaign "
    "38_hover_with_an_altimeter simulates one reading a minute."
)
"""Captions of tables."""


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
        Column("Where", lambda row: row.place, kind="label"),
        Column("Quantity", _quantity, kind="words"),
        Column("Printed", _printed),
        Column("Correct", lambda row: _text(row.closed, row)),
        Column("Cause", lambda row: row.remark, kind="words"),
    ]
    rows = [number for number in numbers if number.standing is Standing.MISPRINT]
    return Table("Wrong printed numbers, the correct values, and the causes.", columns, rows)


def _number_table(numbers: Sequence[Number]) -> Table[Number]:
    """Tabulate all numbers."""

    def remark(each: Number) -> str:
        return "" if each.standing is Standing.MISPRINT else each.remark

    def closed(each: Number) -> Cell:
        return Cell(_text(each.closed, each), mark=KINDS[each.standing], hint=each.standing.value)

    columns: list[Column[Number]] = [
        Column("Where", lambda row: row.place, kind="label"),
        Column("Quantity", lambda row: _quantity(row, remark(row)), kind="words"),
        Column("Printed", _printed),
        Column("Formula", lambda row: row.formula, kind="words"),
        Column("Closed form", closed),
        Column("Linear", lambda row: _text(row.linear, row)),
        Column("Simulated at rest", lambda row: _text(row.flown, row)),
        Column("Simulated cruising", lambda row: _text(row.cruising, row)),
    ]
    return Table("", columns, numbers, style="marked")


def _reduction_tables(frame: pd.DataFrame) -> list[Part]:
    """Tabulate the reductions by flight time, and what the summary's printed numbers would make of them."""
    rows = [at_minutes(frame, minutes) for minutes in MINUTES]
    columns = [
        Column("Flight time", lambda row: f"{row.iloc[0]:.0f}", unit="min", kind="label"),
        *(_three_digits(name, name.removesuffix(" [1]").capitalize()) for name in frame.columns[1:]),
    ]
    by_source: list[Column[Printed]] = [
        Column("Error source", lambda row: row.source.capitalize(), kind="label"),
        Column("Flat, printed", lambda row: f"{row.flat:,.0f}", unit="ft"),
        Column("Spherical, printed", lambda row: f"{row.spherical:,.0f}", unit="ft"),
        Column("Ratio, printed", lambda row: f"{row.ratio:.3g}"),
        Column("Ratio, correct", _correct_ratio),
        Column("Misprint", lambda row: row.misprinted, kind="words"),
    ]
    return [
        Table(REDUCED, columns, rows),
        drawn.reduction(frame),
        Table(SUMMARIZED, by_source, printed_reductions(), style="marked"),
    ]


def _correct_ratio(row: Printed) -> Cell:
    return Cell(f"{row.right:.3g}", mark="inconsistent" if row.misprinted else "digits")


def _three_digits(name: str, heading: str, unit: str = "") -> Column[pd.Series]:
    """Show a column of a data frame; a missing number is said to be none."""

    def content(row: pd.Series) -> str:
        return number(float(row[name]), 3) if np.isfinite(row[name]) else "none"

    return Column(heading, content, unit=unit)


def _detuning_table(frame: pd.DataFrame) -> Table[pd.Series]:
    """Tabulate what wrong gear ratios do."""
    columns = [
        Column("Gear ratio wrong by", lambda row: f"{row.iloc[0]:g}", unit="%", kind="label"),
        *(
            _three_digits(name, name.partition(" [")[0].capitalize(), name.partition(" [")[2][:-1])
            for name in frame.columns[1:]
        ),
    ]
    return Table(DETUNED, columns, [row for _, row in frame.iterrows()])


def _altimeter_table(frame: pd.DataFrame) -> Table[pd.Series]:
    """Tabulate how poor an altimeter suffices."""
    names = {
        **{f"altimeter to hold {height:g} m, settled [m]": f"Sigma to hold {height:,.0f} m" for height in HEIGHTS},
        "altimeter to hold 100 m, from the start [m]": "Sigma to hold 100 m from the start",
        "100 m altimeter, largest [m]": "Largest height error",
        "100 m altimeter, before the last reading [m]": "Before a reading",
        "100 m altimeter, after the last reading [m]": "After a reading",
    }
    columns = [
        Column("A reading every", lambda row: f"{row.iloc[0]:g}", unit="s", kind="label"),
        *(_three_digits(name, heading, "m") for name, heading in names.items()),
    ]
    return Table(ALTIMETERS, columns, [row for _, row in frame.iterrows()])


def _page(numbers: Sequence[Number], tables: Mapping[str, pd.DataFrame], said: Sequence[Finding]) -> Page:
    """Return the page; tables by the names of their files."""
    counted = Counter(number.standing for number in numbers)
    counts = [(PHRASES[standing], counted[standing]) for standing in Standing if counted[standing]]
    periods, climb = tables["periods.csv"], tables["climb.csv"]
    cruising = number(float(periods["period along the track, flown [min]"][1]), 5)
    tilt = TILT.format(*(number(each, 5) for each in story_curves.across()), cruising)
    key = MarkKey([(kind, PHRASES[standing]) for standing, kind in KINDS.items()])
    errors = [drawn.error(name, tables["curves.csv"]) for name in drawn.TITLES]
    correction = Note(CRUISING.format(f"{100.0 * periods['V^2 / g r'][1]:.2f}"))
    files = Markup("{}.").format(Markup(", ").join(Markup('<a href="{0}">{0}</a>').format(name) for name in tables))
    sections = [
        Section("claims", "Claims of the document", [finding_table(said, "Claim")]),
        Section("reduction", "Is it 1/100?", _reduction_tables(tables["reduction.csv"])),
        Section("detuned", "A wrong gear ratio",
                [_detuning_table(tables["detuning.csv"]), drawn.detuned(tables["detuned.csv"])]),
        Section("misprints", "Misprints", [_misprint_table(numbers), Note(tilt)]),
        Section("numbers", "All numbers",
                [Note(TOLERANCE.format(f"{100.0 * SLIDE_RULE:g}")), key, _number_table(numbers), correction]),
        Section("problems", "Problems 1 to 3", [part for error in errors for part in (Heading(error.title), error)]),
        Section("period", "Period", [Beside([drawn.periods(periods), drawn.climb(climb)])]),
        Section("hover", "Problem 4: hovering",
                [Beside(drawn.hover(tables["hover.csv"], tables["hover_departure.csv"]))]),
        Section("altimeter", "Problem 4: hovering with an altimeter", [_altimeter_table(tables["altimeter.csv"])]),
        Section("tables", "Tables", [Sentence(files)]),
    ]  # fmt: skip
    counted_numbers = Markup("{} printed numbers: {}").format(len(numbers), counts_in_words(counts))
    head = [Sentence(answer(tables["reduction.csv"])), Sentence(verdicts_in_words(said)), Sentence(counted_numbers)]
    return Page(TITLE, "Printed and recomputed numbers", TITLE, [*head, Note(COMPARED)], sections)


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
        "reduction.csv": reduction_curves(),
        "detuning.csv": detuning(),
        "detuned.csv": detuned_curves(),
        "altimeter.csv": altimeters(),
    }
    said = claims(tables)
    tables["findings.csv"] = pd.DataFrame([vars(finding) for finding in said])
    page = page_html(_page(numbers, tables, said))
    return write_texts(
        folder, {"story.html": page} | {name: table.to_csv(index=False) for name, table in tables.items()}
    )
