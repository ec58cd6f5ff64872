"""Published numbers beside computed ones as an HTML page, a CSV file, and the tables of ``TEXTBOOK.md``."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict
from functools import lru_cache
from itertools import groupby
from pathlib import Path
from typing import Final

import pandas as pd
from markupsafe import Markup

from mcnav.files.whole import write_texts
from mcnav.report.document.html import page_html
from mcnav.report.document.parts import Listing, MarkKey, Note, Page, Section, Sentence
from mcnav.report.document.table import Cell, Column, Table, counts_in_words
from mcnav.report.format import SUPERSCRIPTS, number
from mcnav.validation.reproduce.textbook.budgets import budget_numbers
from mcnav.validation.reproduce.textbook.filters import (
    bound_numbers,
    matched_numbers,
    mismatched_numbers,
    tutorial_numbers,
)
from mcnav.validation.reproduce.textbook.free import flat_numbers, schuler_numbers
from mcnav.validation.reproduce.textbook.numbers import CONFIDENCE, SOURCES, Agreement, Number
from mcnav.validation.reproduce.textbook.turning import alignment_numbers, error_numbers, mode_numbers

TITLE: Final = "Published numbers of inertial navigation and filters, recomputed"
PAGE: Final = "textbook.html"
TABLES: Final = "tables.md"

PARTS: Final[tuple[Callable[[], list[Number]], ...]] = (
    flat_numbers, schuler_numbers, mode_numbers, error_numbers, budget_numbers, alignment_numbers, matched_numbers,
    mismatched_numbers, tutorial_numbers, bound_numbers,
)  # fmt: skip

CAPTIONS: Final = {
    "flat earth, 10 min": "Laws of growth: a navigator at rest, or accelerating northwards, for ten minutes.",
    "Schuler pendulum": "One horizontal channel on a sphere that does not turn.",
    "turning earth": "Modes of a navigator at rest on the turning ellipsoid whose altitude an altimeter holds.",
    "turning earth, at rest": "Its position errors at 45° latitude.",
    "error budgets": "Systems whose biases are first-order Gauss-Markov processes, at rest, altitude held.",
    "alignment": "Updates of zero velocity by a filter that does not know the bias.",
    "matched filter": "Steady states of filters that believe the truth, after an update each second.",
    "mismatched filter": "Filters that believe something wrong; the random walk has q = 1, r = 4, believed q = 0.25.",
    "tutorial": "Estimates from a tutorial's measurements with the gains of this filter.",
    "consistency": "Bounds of the mean normalized estimation error squared.",
}
"""Caption of each chapter."""

KINDS: Final = {Agreement.AGREES: "digits", Agreement.DIFFERS: "inconsistent"}
"""Classes of the style sheet by agreement."""

PHRASES: Final = {Agreement.AGREES: "agree", Agreement.DIFFERS: "differ"}


COMPARED: Final = (
    "Each number is compared with linear covariance analysis, which must have its digits, and with nonlinear "
    "simulation by the navigator in three dimensions. Standard deviations and means of samples have an interval "
    f"of {100.0 * CONFIDENCE:g} % confidence, which must contain the number; single simulations have no "
    "interval and must have the digits. The paired estimate adds to the linear variance what the samples' squares "
    "differ from those of their linear outcomes: it has hardly any sampling error, and shows what nonlinearity changes."
)
"""Way in which each number is compared."""


@lru_cache
def all_numbers() -> tuple[Number, ...]:
    """Compute all numbers in the order of the page."""
    return tuple(each for part in PARTS for each in part())


def table(numbers: Sequence[Number]) -> pd.DataFrame:
    """Tabulate the numbers."""
    rows = []
    for each in numbers:
        low, high = each.interval or (None, None)
        rows.append(asdict(each) | {"low": low, "high": high, "agreement": each.agreement.value})
    frame = pd.DataFrame(rows).drop(columns="interval")
    order = ["chapter", "quantity", "unit", "source", "printed", "formula", "linear", "simulated", "low", "high",
             "paired", "agreement", "remark"]  # fmt: skip
    return frame[order]


def written(text: str) -> str:
    """Return a number as pages show it.

    >>> written("-0.5"), written("1.75e-3")
    ('−0.5', '1.75·10⁻³')
    """
    mantissa, mark, exponent = text.partition("e")
    return mantissa.replace("-", "−") + (f"·10{exponent.translate(SUPERSCRIPTS)}" if mark else "")


def with_another_digit(value: float, printed: str) -> str:
    """Format a number with one digit more than the published one has."""
    mantissa, mark, exponent = printed.partition("e")
    decimals = len(mantissa.partition(".")[2]) + 1
    return written(f"{value / 10.0 ** int(exponent or 0):.{decimals}f}{mark}{exponent}")


def _simulated(each: Number) -> str:
    """Format the simulated number: with its interval, or as the linear one."""
    if each.simulated is None:
        return "–"
    if each.interval is None:
        return with_another_digit(each.simulated, each.printed)
    low, high = (number(bound, 3) for bound in each.interval)
    return f"{number(each.simulated)} ({low} to {high})"


def _unit(each: Number) -> str:
    return "" if each.unit == "1" else each.unit


def _linear(each: Number) -> str:
    return with_another_digit(each.linear, each.printed)


def _paired(each: Number) -> str:
    return "–" if each.paired is None else with_another_digit(each.paired, each.printed)


def _source(each: Number) -> str:
    """Return the number of its source in the list of sources."""
    return str(list(SOURCES).index(each.source) + 1)


def chapters(numbers: Iterable[Number]) -> list[tuple[str, list[Number]]]:
    """Group the numbers by chapter."""
    return [(name, list(members)) for name, members in groupby(numbers, key=lambda each: each.chapter)]


def markdown(numbers: Sequence[Number]) -> str:
    """Write the tables, and what differs, as ``TEXTBOOK.md`` has them."""
    parts = []
    for name, members in chapters(numbers):
        parts += [f"### {name[0].upper()}{name[1:]}", "", CAPTIONS[name], ""]
        parts += ["| quantity | published | linear | simulated | paired | formula, source |"]
        parts.append("| --- | --- | --- | --- | --- | --- |")
        for member in members:
            unit, mark = f" [{_unit(member)}]" if _unit(member) else "", " ≠" if member.remark else ""
            parts.append(
                f"| {member.quantity}{unit} | {written(member.printed)}{mark} | {_linear(member)} | "
                f"{_simulated(member)} | {_paired(member)} | {member.formula} ({_source(member)}) |"
            )
        parts.append("")
    return "\n".join(parts)


def render(numbers: Sequence[Number]) -> str:
    """Render the page."""
    counted = Counter(number.agreement for number in numbers)
    counts = [(PHRASES[agreement], counted[agreement]) for agreement in Agreement if counted[agreement]]
    intro = Markup("{} published numbers: {}").format(len(numbers), counts_in_words(counts))
    differing = [number for number in numbers if number.agreement is Agreement.DIFFERS]
    sections = [Section("differing", "Numbers that differ", [_differing_table(differing)])]
    key = MarkKey([(kind, PHRASES[agreement]) for agreement, kind in KINDS.items()])
    for place, (name, own) in enumerate(chapters(numbers), start=1):
        title = f"{name[0].upper()}{name[1:]}"
        sections.append(Section(f"chapter-{place}", title, [key, _number_table(CAPTIONS[name], own)]))
    sections.append(Section("sources", "Sources", [Listing(list(SOURCES.values()), numbered=True)]))
    return page_html(
        Page(TITLE, "Published and recomputed numbers", TITLE, [Sentence(intro), Note(COMPARED)], sections)
    )


def _quantity(each: Number) -> Cell:
    return Cell(each.quantity, _unit(each))


def _differing_table(numbers: Sequence[Number]) -> Table[Number]:
    """Tabulate the numbers that were not reproduced."""
    columns: list[Column[Number]] = [
        Column("Quantity", _quantity, kind="words"),
        Column("Published", lambda row: written(row.printed)),
        Column("Linear", _linear),
        Column("Cause", lambda row: row.remark, kind="words"),
    ]
    return Table("Published numbers that were not reproduced, and the causes.", columns, numbers)


def _number_table(caption: str, numbers: Sequence[Number]) -> Table[Number]:
    """Tabulate the numbers of a chapter."""
    columns: list[Column[Number]] = [
        Column("Quantity", _quantity, kind="words"),
        Column("Published", lambda row: written(row.printed)),
        Column("Linear", lambda row: Cell(_linear(row), mark=KINDS[row.agreement], hint=row.agreement.value)),
        Column("Simulated", _simulated),
        Column("Paired", _paired),
        Column("Formula", lambda row: row.formula, kind="words"),
        Column("Source", _source),
    ]
    return Table(caption, columns, numbers, style="marked")


def write(folder: Path) -> tuple[tuple[Number, ...], list[Path]]:
    """Write the page and its tables into a folder; return the numbers, and the files, the page first."""
    numbers = all_numbers()
    files = {PAGE: render(numbers), "numbers.csv": table(numbers).to_csv(index=False), TABLES: markdown(numbers)}
    return numbers, write_texts(folder, files)
