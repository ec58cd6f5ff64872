"""Published numbers beside computed ones as an HTML page, a CSV file, and the tables of ``TEXTBOOK.md``."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict
from functools import lru_cache
from itertools import groupby
from pathlib import Path
from typing import Any, Final

import pandas as pd

from mcnav.files import write_texts
from mcnav.report.format import SUPERSCRIPTS, number
from mcnav.report.html import filled
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


def _shown(each: Number) -> dict[str, Any]:
    return {
        "quantity": each.quantity,
        "unit": "" if each.unit == "1" else each.unit,
        "printed": written(each.printed),
        "formula": each.formula,
        "source": list(SOURCES).index(each.source) + 1,
        "linear": with_another_digit(each.linear, each.printed),
        "simulated": _simulated(each),
        "paired": "–" if each.paired is None else with_another_digit(each.paired, each.printed),
        "kind": KINDS[each.agreement],
        "agreement": each.agreement.value,
        "remark": each.remark,
    }


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
        for each in members:
            row = _shown(each)
            unit, mark = f" [{row['unit']}]" if row["unit"] else "", " ≠" if row["remark"] else ""
            parts.append(
                f"| {row['quantity']}{unit} | {row['printed']}{mark} | {row['linear']} | {row['simulated']} | "
                f"{row['paired']} | "
                f"{row['formula']} ({row['source']}) |"
            )
        parts.append("")
    return "\n".join(parts)


def render(numbers: Sequence[Number]) -> str:
    """Render the page."""
    counted = Counter(each.agreement for each in numbers)
    return filled(
        "textbook.html",
        title=TITLE,
        total=len(numbers),
        counts=[(PHRASES[agreement], counted[agreement]) for agreement in Agreement if counted[agreement]],
        chapters=[(name, CAPTIONS[name], [_shown(each) for each in own]) for name, own in chapters(numbers)],
        differing=[_shown(each) for each in numbers if each.agreement is Agreement.DIFFERS],
        sources=list(SOURCES.values()),
        confidence=f"{100.0 * CONFIDENCE:g}",
        marks=[(kind, PHRASES[agreement]) for agreement, kind in KINDS.items()],
    )


def write(folder: Path) -> tuple[tuple[Number, ...], list[Path]]:
    """Write the page and its tables into a folder; return the numbers, and the files, the page first."""
    numbers = all_numbers()
    files = {PAGE: render(numbers), "numbers.csv": table(numbers).to_csv(index=False), TABLES: markdown(numbers)}
    return numbers, write_texts(folder, files)
