"""Printed numbers of ukfm beside our own runs, as an HTML page, CSV files, and the tables of ``UKFM.md``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd
from markupsafe import Markup

from mcnav.arrays.types import Array
from mcnav.files.whole import write_texts
from mcnav.report.document.html import page_html
from mcnav.report.document.parts import MarkKey, Note, Page, Part, Section, Sentence
from mcnav.report.document.table import Cell, Column, Table, counts_in_words
from mcnav.report.drawing.figure import Figure
from mcnav.report.drawing.marks import Axis, Line, Panel, Rule, numbered
from mcnav.report.format import number
from mcnav.validation.reproduce.ukfm import flight
from mcnav.validation.reproduce.ukfm.printed import AS_PRINTED, MEANT, PRINTED, PRINTINGS, QUANTITIES, RUNS
from mcnav.validation.reproduce.ukfm.simulation import ALL, SAMPLES, Runs, run

TITLE: Final = "The benchmark of ukfm, simulated again"
PAGE: Final = "ukfm.html"
TABLES: Final = "tables.md"

RANGE: Final = 0.95
"""Probability with which a mean of 100 runs is within the range of such means."""

TWO_SIDED: Final = 1.959964
"""Standard errors of an interval of 95 % confidence."""

EVERY: Final = 10
"""Instants from one row of the table over time to the next."""

INSIDE, OUTSIDE = "within the range", "outside"
KINDS: Final = {INSIDE: "digits", OUTSIDE: "tolerance"}
"""Classes of the style sheet."""


@dataclass(frozen=True)
class Number:
    """A printed number and the same of our runs.

    Attributes
    ----------
    printing, filter, quantity, unit, printed : str
    ours : float
        Of all runs.
    low, high : float
        Range of the values of 100 runs.
    below : float
        Share of those that are less than the printed one.
    """

    printing: str
    filter: str
    quantity: str
    unit: str
    printed: str
    ours: float
    low: float
    high: float
    below: float

    @property
    def agreement(self) -> str:
        """True where the range contains the printed number, which is rounded."""
        half = 0.5 * 10.0 ** -len(self.printed.partition(".")[2])
        return INSIDE if self.low - half <= float(self.printed) <= self.high + half else OUTSIDE


@dataclass(frozen=True)
class Consistency:
    """NEES of a filter as it was meant, divided by the number of components, and intervals of 95 % confidence.

    Attributes
    ----------
    filter : str
    attitude_error, position_error : float
        RMS over time and runs: deg, m.
    attitude, position : tuple of (float, float, float)
        Mean NEES over time and runs, and its interval.
    """

    filter: str
    attitude_error: float
    position_error: float
    attitude: tuple[float, float, float]
    position: tuple[float, float, float]

    @property
    def verdict(self) -> str:
        """Verdict on what the filter says of its errors."""
        lows, highs = (self.attitude[1], self.position[1]), (self.attitude[2], self.position[2])
        if min(highs) >= 1.0 >= max(lows):
            return "consistent"
        return "optimistic" if max(lows) > 1.0 else "pessimistic"


def compare(runs: Runs) -> list[Number]:
    """Compare all printed numbers with runs."""
    values, hundred = runs.values(), runs.of_hundred
    low, high = _range(runs)
    numbers = []
    for printing, filters in AS_PRINTED.items():
        for each in filters:
            row = ALL.index(each)
            for place, (quantity, unit) in enumerate(QUANTITIES.items()):
                printed = PRINTED[printing][each.name][place]
                below = float(np.mean(hundred[:, row, place] < float(printed)))
                ours, least, most = (float(part[row, place]) for part in (values, low, high))
                numbers.append(Number(printing, each.name, quantity, unit, printed, ours, least, most, below))
    return numbers


def _range(runs: Runs) -> tuple[Array, Array]:
    low, high = np.quantile(runs.of_hundred, [0.5 - 0.5 * RANGE, 0.5 + 0.5 * RANGE], axis=0)
    return low, high


def as_many_outside(runs: Runs, numbers: Sequence[Number]) -> dict[str, tuple[int, float]]:
    """Count, by printing, the numbers outside, and return in which share of sets of 100 of our runs are as many."""
    low, high = _range(runs)
    rows = {printing: [ALL.index(each) for each in filters] for printing, filters in AS_PRINTED.items()}
    outside = ((runs.of_hundred < low) | (runs.of_hundred > high))[..., : len(QUANTITIES)]
    result = {}
    for printing, places in rows.items():
        count = sum(number.agreement == OUTSIDE for number in numbers if number.printing == printing)
        result[printing] = count, float(np.mean(outside[:, places].sum(axis=(1, 2)) >= count))
    return result


def judge(runs: Runs) -> list[Consistency]:
    """Judge the filters as they were meant, by the NEES of their own errors."""
    values, errors, result = runs.values(), runs.errors(), []
    for kind in MEANT:
        row = ALL.index(kind)
        intervals = []
        for place in (2, 4):
            mean, margin = float(values[row, place]), TWO_SIDED * float(errors[row, place - 2])
            intervals.append((mean, mean - margin, mean + margin))
        result.append(Consistency(kind.name, float(values[row, 0]), float(values[row, 1]), *intervals))
    return result


def cheaper(runs: Runs) -> float:
    """Compute how many times less a run of the five filters takes than that of the first printing."""
    ours = sum(float(runs.seconds[ALL.index(kind)]) for kind in MEANT)
    return next(iter(PRINTINGS.values())) / RUNS / ours


def over_time(runs: Runs) -> pd.DataFrame:
    """Tabulate the mean NEES of the filters as they were meant over time."""
    rows = slice(EVERY, None, EVERY)
    columns = {"time [s]": flight.STEP * np.arange(flight.INSTANTS)[rows]}
    for quantity, place in (("orientation", 2), ("position", 4)):
        for kind in MEANT:
            columns[f"{quantity}, {kind.name}"] = runs.by_time[ALL.index(kind), rows, place]
    return pd.DataFrame(columns)


def _three(mean: float, low: float, high: float) -> str:
    return f"{number(mean, 3)} ({number(low, 3)} to {number(high, 3)})"


def _percent(share: float) -> str:
    return f"{100.0 * share:.1f} %"


def _printed_table(printing: str, numbers: Sequence[Number]) -> Table[Number]:
    """Tabulate the numbers of a printing."""
    columns: list[Column[Number]] = [
        Column("Filter", lambda row: row.filter, kind="label"),
        Column("Quantity", lambda row: Cell(row.quantity, row.unit), kind="words"),
        Column("Printed", lambda row: Cell(row.printed, mark=KINDS[row.agreement], hint=row.agreement)),
        Column("Ours", lambda row: number(row.ours, 3)),
        Column("Range of 100 runs", lambda row: f"{number(row.low, 3)} to {number(row.high, 3)}"),
        Column("Less than printed", lambda row: _percent(row.below)),
    ]
    return Table(f"Printed in {printing}.", columns, numbers, style="marked")


def _consistency_table(rows: Sequence[Consistency]) -> Table[Consistency]:
    """Tabulate the filters as they were meant."""
    columns: list[Column[Consistency]] = [
        Column("Filter", lambda row: row.filter, kind="label"),
        Column("Orientation, RMS", lambda row: Cell(number(row.attitude_error, 3), "deg")),
        Column("Position, RMS", lambda row: Cell(number(row.position_error, 3), "m")),
        Column("Orientation, NEES", lambda row: _three(*row.attitude)),
        Column("Position, NEES", lambda row: _three(*row.position)),
        Column("Verdict", lambda row: row.verdict, kind="words"),
    ]
    return Table("NEES by component, 1 of a consistent filter, with 95 % intervals.", columns, rows)


def _figure(table: pd.DataFrame) -> Figure:
    """Draw the NEES over time."""
    key = tuple(numbered(2 * place, kind.name) for place, kind in enumerate(MEANT))
    time = Axis("time", "s", link="time")
    panels = []
    for quantity in ("orientation", "position"):
        lines = [Line(series, table["time [s]"], table[f"{quantity}, {series.label}"]) for series in key]
        panels.append(Panel(f"Of {quantity}", time, Axis("NEES", log=True), [Rule(1.0, level=True), *lines]))
    return Figure(
        name="nees",
        title="NEES over time",
        description="Mean NEES by component of five filters, of orientation and of position.",
        panels=panels,
        key=key,
        columns=dict(table.items()),
        caption="A consistent filter has 1. Landmarks are seen every second.",
        file="nees.csv",
    )


BENCHMARK: Final = Markup(
    "A vehicle goes once around a circle of 5 m in 30 s, without turning, and sees three landmarks each second. Its "
    "attitude at the start is known to 15°/√3 and its position to 1 m/√3 by axis. Five filters have the same readings. "
    "M. Brossard, A. Barrau, S. Bonnabel, <em>A code for unscented Kalman filtering on manifolds (UKF-M)</em>, 2020; "
    "documentation of its library ukfm, printed twice with 100 runs each, which are “an indication but not a proof”."
)

DIFFERENCES: Final = (
    "The pages of both printings show their scripts. In September the covariance at the start of the right UKF and the "
    "IEKF has the cross term with the wrong sign. In October the right UKF has none, and the EKF has that of the IEKF. "
    "Both compute the NEES of position of right-invariant filters from the covariance of c + r × a, where the error of "
    "position is c − r × a. All this is simulated here as it was printed; the table of consistency has the filters as "
    "they were meant, which no printing has."
)


def _share(numbers: Sequence[Number]) -> Markup:
    counts = [(kind, sum(number.agreement == kind for number in numbers)) for kind in KINDS]
    shown = counts_in_words([(name, count) for name, count in counts if count])
    text = Markup("{} printed numbers, beside the range that contains 95 % of the means of 100 of our runs: {}")
    return text.format(len(numbers), shown)


def _together(runs: Runs, numbers: Sequence[Number]) -> str:
    """Say what numbers outside mean, which belong together."""
    return " ".join(
        f"Of the {len(QUANTITIES) * len(MEANT)} numbers of {printing} {count or 'none'} "
        f"{'is' if count == 1 else 'are'} outside"
        + (f"; as many or more are in {_percent(share)} of our own sets of 100 runs." if count else ".")
        for printing, (count, share) in as_many_outside(runs, numbers).items()
    )


def _cost(runs: Runs) -> str:
    ours = 1000.0 * sum(float(runs.seconds[ALL.index(kind)]) for kind in MEANT)
    theirs = next(iter(PRINTINGS.values())) / RUNS
    return (
        f"Cost of a run of five filters: {number(theirs, 3)} s printed, {number(ours, 2)} ms here on one thread, "
        f"{number(cheaper(runs), 2)} times less."
    )


def render(runs: Runs) -> str:
    """Render the page."""
    numbers, key = compare(runs), MarkKey([(kind, name) for name, kind in KINDS.items()])
    together = Note(_together(runs, numbers))
    printings = [
        _printed_table(printing, [number for number in numbers if number.printing == printing])
        for printing in PRINTINGS
    ]
    sections = [
        Section("printed", "Printed and simulated", [key, *printings, together, Note(DIFFERENCES)]),
        Section("consistency", "The filters as they were meant", [_consistency_table(judge(runs))]),
        Section("time", "Over time", [_figure(over_time(runs))]),
    ]
    intro: list[Part] = [Sentence(_share(numbers)), Note(BENCHMARK), Note(f"{runs.count:,} runs. {_cost(runs)}")]
    return page_html(Page(TITLE, "Printed and simulated numbers", TITLE, intro, sections))


def markdown(runs: Runs) -> str:
    """Write the tables as ``UKFM.md`` has them."""
    numbers, lines = compare(runs), []
    for printing in PRINTINGS:
        lines += [f"### Printed in {printing}", ""]
        lines += ["| filter | quantity | printed | ours | range of 100 runs | less than printed |"]
        lines += ["| --- | --- | --- | --- | --- | --- |"]
        for each in numbers:
            if each.printing == printing:
                unit = f" [{each.unit}]" if each.unit else ""
                mark = " ≠" if each.agreement == OUTSIDE else ""
                lines.append(
                    f"| {each.filter} | {each.quantity}{unit} | {each.printed}{mark} | {number(each.ours, 3)} | "
                    f"{number(each.low, 3)} to {number(each.high, 3)} | {_percent(each.below)} |"
                )
        lines.append("")
    lines += [_together(runs, numbers), "", "### As they were meant", ""]
    lines += ["| filter | orientation [deg] | position [m] | NEES of orientation | NEES of position | verdict |"]
    lines += ["| --- | --- | --- | --- | --- | --- |"]
    for row in judge(runs):
        lines.append(
            f"| {row.filter} | {number(row.attitude_error, 3)} | {number(row.position_error, 3)} | "
            f"{_three(*row.attitude)} | {_three(*row.position)} | {row.verdict} |"
        )
    return "\n".join([*lines, ""])


def _frame(numbers: Sequence[Number]) -> pd.DataFrame:
    return pd.DataFrame([vars(number) | {"agreement": number.agreement} for number in numbers])


def write(folder: Path, samples: int | None = None) -> tuple[str, list[Path]]:
    """Simulate, and write the page and its tables into a folder; return a summary, and the files, the page first."""
    runs = run(samples or SAMPLES)
    numbers = compare(runs)
    files = {
        PAGE: render(runs),
        "numbers.csv": _frame(numbers).to_csv(index=False),
        "nees.csv": over_time(runs).to_csv(index=False),
        TABLES: markdown(runs),
    }
    inside = sum(number.agreement == INSIDE for number in numbers)
    summary = (
        f"{len(numbers)} printed numbers\n{inside:6} within the range of 100 runs\n{len(numbers) - inside:6} outside"
    )
    return f"{summary}\n{_together(runs, numbers)}\n{_cost(runs)}", write_texts(folder, files)
