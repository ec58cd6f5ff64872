"""The reproduction of NASA TN D-1772 as one HTML page and its CSV files."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import groupby, product
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd
from markupsafe import Markup

from mcnav.files.whole import write_texts
from mcnav.report.document import table as shown
from mcnav.report.document.html import page_html
from mcnav.report.document.parts import Fold, MarkKey, Note, Page, Part, Section, Sentence
from mcnav.report.document.table import Column, Table, counts_in_words
from mcnav.report.drawing.figure import Figure
from mcnav.report.format import number
from mcnav.validation.reproduce.findings import Finding, finding_table, verdicts_in_words
from mcnav.validation.reproduce.tn_d1772 import curves as computed
from mcnav.validation.reproduce.tn_d1772 import figures as drawn
from mcnav.validation.reproduce.tn_d1772.claims import claims, settled
from mcnav.validation.reproduce.tn_d1772.globe import RESULTS
from mcnav.validation.reproduce.tn_d1772.in_the_closed_loop import (
    FED,
    LoopComparison,
    figure_15,
    loop_comparisons,
)
from mcnav.validation.reproduce.tn_d1772.in_the_closed_loop import RESULTS as LOOP_RESULTS
from mcnav.validation.reproduce.tn_d1772.in_three_dimensions import Comparison, comparisons, figure_14
from mcnav.validation.reproduce.tn_d1772.loop_claims import loop_claims
from mcnav.validation.reproduce.tn_d1772.printed import CORRECTIONS, Correction
from mcnav.validation.reproduce.tn_d1772.relationship_claims import relationship_claims
from mcnav.validation.reproduce.tn_d1772.spatial_claims import spatial_claims
from mcnav.validation.reproduce.tn_d1772.starting import (
    COORDINATES,
    MEASURES,
    Advice,
    advice,
    figure_16,
    sentence,
    start_times,
    time_in_words,
)
from mcnav.validation.reproduce.tn_d1772.tables import Cell, Mark, all_cells, tolerance_in_words

TITLE: Final = "NASA TN D-1772, recomputed"
PAGE: Final = "tn_d1772.html"

PHRASES: Final = {
    Mark.DIGITS: "agree to the printed digits",
    Mark.TOLERANCE: "lie within the tolerance",
    Mark.SMALL: "are no larger than the tolerance, so that zero would pass as well",
    Mark.INCONSISTENT: "are contradicted by the report itself",
    Mark.DIFFERS: "differ",
}

CAPTIONS: Final = {
    "I": "Range and time are counted from 121.92 km. Trajectories 4 and 6 are solved for their printed range.",
    "III": "The absolute sums of Table II, altitude and range.",
    "IV(c)": "A hundred times the errors: far from linear, and still the same by both engines.",
    "V(a)": "Navigation from 3.58 min before reentry, in the axes of the first start.",
    "V(b)": "Navigation from 3.58 min before reentry, in axes aligned there. Runs 7 to 10 differ from part (a) because "
    "the axes do, by 89 degrees.",
    "VI": "Accelerometer outputs taken as zero above 121.92 km.",
}

REPORT: Final = Markup(
    "<em>Study of Inertial Navigation Errors During Reentry to the Earth's Atmosphere</em>, Q. M. Hansen, J. S. White "
    "and A. Y. K. Pang, 1963, recomputed from its equations."
)

COMPARED: Final = (
    "Final errors in km by the planar navigator and by the one in three dimensions. Samples have an interval of 99.9 % "
    "confidence, errors of single sources none. The departure compares root mean squares: of the samples, and of the "
    "linear outcomes of the same errors. With an update, the planar navigator starts at that time."
)

LOOPED: Final = (
    "Dispersion in km, with the lift law fed by the true altitude rate and by the indicated one. Samples have an "
    "interval of 99.9 % confidence. The departure compares root mean squares: of the samples, and of the linear "
    "outcomes of the same errors. The correlation is with the final altitude-rate error."
)

STARTED: Final = (
    "The report looks for the best start on trajectory 4 alone, by the sum of absolute final altitude errors. Here are "
    "all seven trajectories with its ten errors, for starts up to reentry."
)

BEST: Final = "Best start up to reentry, and the altitude error there, by measure and coordinates."

CORRECTED: Final = "Numbers that are not used as the scan has them. All others are used as printed."

ATMOSPHERE: Final = (
    "The atmosphere is only cited (“reference 4”): it is the ARDC Model Atmosphere of 1959, which reproduces the "
    "ranges of Table I. Range angles are not wrapped at 180 deg."
)

IN_CELLS: Final = Markup(
    "Each cell: printed number above, computed number below (reference engine, the report's polar equations). Tooltips "
    'give the agreement, as does <a href="tables.csv">tables.csv</a>.'
)

FIGURES: Final[Mapping[str, tuple[Callable[[], pd.DataFrame], Callable[[pd.DataFrame], Figure]]]] = {
    "1": (computed.figure_1, drawn.figure_1),
    "2": (computed.figure_2, drawn.figure_2),
    "3": (computed.figure_3, drawn.figure_3),
    "4": (computed.figure_4, drawn.figure_4),
    "5": (computed.figure_5, drawn.figure_5),
    **{
        str(6 + output): (partial(computed.figures_6_to_9, output=output), partial(drawn.figures_6_to_9, output=output))
        for output in range(4)
    },
    "10": (computed.figure_10, drawn.figure_10),
    "11": (computed.figure_11, drawn.figure_11),
    "12": (computed.figure_12, drawn.figure_12),
    "13": (computed.switching, drawn.figure_13),
    "14": (figure_14, drawn.figure_14),
    "15": (figure_15, drawn.figure_15),
    "16": (start_times, figure_16),
}
"""Data and drawing of each figure."""

BEYOND: Final = ("13", "14", "15", "16")
"""Figures that the report does not have; they stand with what they show."""


def table(cells: Sequence[Cell]) -> pd.DataFrame:
    """Tabulate the cells, a row for each printed number."""
    frame = pd.DataFrame(cells)
    frame["difference"] = [cell.difference for cell in cells]
    frame["mark"] = [cell.mark.value for cell in cells]
    order = ["table", "row", "column", "unit", "printed", "computed", "second", "difference", "tolerance", "mark",
             "reason"]  # fmt: skip
    return frame[order].rename(columns={"second": "ensemble engine"})


def _printed(cell: Cell) -> str:
    return cell.printed.replace("-", "−")


def _computed(cell: Cell) -> str:
    """Format the computed number with one digit more than printed."""
    decimals = len(cell.printed.partition(".")[2]) + 1
    return f"{round(cell.computed, decimals) + 0.0:.{decimals}f}".replace("-", "−")  # and no negative zero


def _between_engines(cells: Sequence[Cell]) -> str:
    """Say how far the engines differ in a table, as a share of the tolerance; empty where only one computes it."""
    shares = [abs(cell.second - cell.computed) / cell.tolerance for cell in cells if cell.second == cell.second]
    return f"The two engines differ by at most {number(max(shares), 1)} of the tolerance." if shares else ""


def render(
    title: str, cells: Sequence[Cell], figures: Mapping[str, Figure], said: Sequence[Finding],
    decided: Sequence[Finding], spatial: Sequence[Finding], compared: Sequence[Comparison], looped: Sequence[Finding],
    loops: Sequence[LoopComparison], started: Sequence[Advice],
) -> str:  # fmt: skip
    """Render the page; figures by number. Figures and tables of the report are folded, what was found stands open."""
    notable = [cell for cell in cells if cell.mark in (Mark.INCONSISTENT, Mark.DIFFERS)]
    sections = [
        Section("claims", "Claims of the report", [finding_table(said, "Claim")]),
        Section("start", "When to start", _start_parts(started, figures["16"])),
        Section("switching", "Where to switch the accelerometers off", [figures["13"]]),
        Section("three-dimensions", "In three dimensions",
                [finding_table(spatial, "Claim"), figures["14"], _comparison_table(compared)]),
        Section("closed-loop", "In the closed loop",
                [finding_table(looped, "Claim"), figures["15"], _loop_table(loops)]),
        Section("settled", "Open questions settled for the reproduction",
                [finding_table(decided, "Statement in the report"), Note(ATMOSPHERE)]),
        Section("numbers", "Numbers that do not agree", [_notable_table(notable)]),
        Section("corrections", "Corrections of the transcription", [_correction_table()]),
    ]  # fmt: skip
    drawn_again = [
        Section(f"figure-{name}", f"Figure {name}: {figure.title}", [figure])
        for name, figure in figures.items()
        if name not in BEYOND
    ]
    tables = [
        Section(f"Table-{name}", f"Table {name}", [_cell_table(name, list(members))])
        for name, members in groupby(cells, key=lambda cell: cell.table)
    ]
    key = MarkKey([(mark.name.lower(), phrase) for mark, phrase in PHRASES.items()])
    folds = [
        Fold("tables", "Tables I to VI", "every printed number above the computed one", [Note(IN_CELLS), key], tables),
        Fold("figures", "Figures 1 to 12", "drawn again from the report's equations", [], drawn_again),
    ]
    head: list[Part] = [Sentence(verdicts_in_words(said)), Sentence(_counts(cells)), Note(REPORT)]
    return page_html(Page(title, "Printed and recomputed numbers", title, head, sections, folds=folds, short=True))


def _counts(cells: Sequence[Cell]) -> str:
    """Count the printed numbers by how they agree, and the smallest ones with the wrong sign."""
    counted = Counter(cell.mark for cell in cells)
    agreeing, others = (
        counts_in_words([(PHRASES[mark], counted[mark]) for mark in marks if counted[mark]])
        for marks in ((Mark.DIGITS, Mark.TOLERANCE), (Mark.INCONSISTENT, Mark.DIFFERS))
    )
    small = counts_in_words([(PHRASES[Mark.SMALL], counted[Mark.SMALL])])
    reversed_signs = sum(cell.wrong_sign for cell in cells if cell.mark == Mark.SMALL)
    signs = f"Of these {reversed_signs} have the opposite sign. " if reversed_signs else ""
    return Markup("{:,} printed numbers: {} {} {}{}").format(len(cells), agreeing, small, signs, others)


def _start_parts(started: Sequence[Advice], figure: Figure) -> list[Part]:
    """Say for each trajectory when to start, with a table and a figure."""
    rows = [list(group) for _, group in groupby(started, key=lambda row: row.number)]
    columns: list[Column[list[Advice]]] = [Column("Trajectory", lambda row: str(row[0].number), kind="label")]
    for place, (coordinates, measure) in enumerate(product(COORDINATES, MEASURES)):

        def content(row: list[Advice], place: int = place) -> shown.Cell:
            return shown.Cell(time_in_words(row[place].best), below=f"{row[place].least:.1f} km")

        columns.append(Column(f"{measure}, {coordinates}", content, kind="text"))
    return [Note(STARTED), *(Sentence(sentence(row)) for row in rows), Table(BEST, columns, rows), figure]


def _correction_table() -> Table[Correction]:
    """List the numbers that the transcription changes."""
    columns: list[Column[Correction]] = [
        Column("Table", lambda row: row.table, kind="label"),
        Column("Row", lambda row: row.row, kind="label"),
        Column("Column", lambda row: row.column, kind="label"),
        Column("Scan", lambda row: row.scanned.replace("-", "−")),
        Column("Used", lambda row: row.used.replace("-", "−")),
        Column("Reason", lambda row: row.reason, kind="words"),
    ]
    return Table(CORRECTED, columns, CORRECTIONS)


def _comparison_table(compared: Sequence[Comparison]) -> Table[Comparison]:
    """Tabulate final errors by the planar navigator and by the one in three dimensions."""

    def simulated(each: Comparison) -> str:
        interval = "" if np.isnan(each.low) else f" ({number(each.low, 3)} to {number(each.high, 3)})"
        return f"{number(each.simulated)}{interval}"

    columns: list[Column[Comparison]] = [
        Column("Case", lambda row: row.case.replace("-", "−"), kind="words"),
        Column("Error", lambda row: row.result, kind="label"),
        Column("Planar", lambda row: row.planar),
        Column("Planar, samples", lambda row: row.planar_simulated),
        Column("Linear", lambda row: row.linear),
        Column("Samples", simulated),
        Column("Departure", lambda row: number(100.0 * row.departure, 2), unit="%"),
        Column("Filter", lambda row: row.own),
    ]
    return Table(COMPARED, columns, compared)


def _loop_table(loops: Sequence[LoopComparison]) -> Table[LoopComparison]:
    """Tabulate the dispersion with the lift law fed by the truth and by the navigator."""

    def simulated(each: LoopComparison) -> str:
        interval = f" ({number(each.low, 3)} to {number(each.high, 3)})" if each.high > 0.0 else ""
        return f"{number(each.simulated)}{interval}"

    columns: list[Column[LoopComparison]] = [
        Column("Case", lambda row: row.case.replace("-", "−"), kind="words"),
        Column("Law fed with", lambda row: f"{row.fed} rate", kind="label"),
        Column("Result", lambda row: row.result, kind="label"),
        Column("Linear", lambda row: row.linear),
        Column("Samples", simulated),
        Column("Departure", lambda row: number(100.0 * row.departure, 2), unit="%"),
        Column("Correlation", lambda row: number(row.correlation, 2)),
    ]
    return Table(LOOPED, columns, loops)


def _notable_table(cells: Sequence[Cell]) -> Table[Cell]:
    """Tabulate printed numbers that are wrong or differ."""
    columns: list[Column[Cell]] = [
        Column("Table", lambda cell: cell.table, kind="label"),
        Column("Row", lambda cell: cell.row, kind="label"),
        Column("Column", lambda cell: shown.Cell(cell.column, cell.unit), kind="label"),
        Column("Printed", _printed),
        Column("Computed", _computed),
        Column("Cause", lambda cell: cell.reason.replace(" -", " −"), kind="words"),
    ]
    caption = "Printed numbers that the report itself contradicts, and those that differ from the computed ones."
    return Table(caption, columns, cells)


def _cell_table(name: str, cells: Sequence[Cell]) -> Table[tuple[str, Sequence[Cell]]]:
    """Tabulate printed and computed numbers as the report has them."""
    rows = [(row, list(group)) for row, group in groupby(cells, key=lambda cell: cell.row)]

    def number_in(place: int) -> Column[tuple[str, Sequence[Cell]]]:
        first = rows[0][1][place]

        def content(row: tuple[str, Sequence[Cell]]) -> shown.Cell:
            cell = row[1][place]
            hint = f"{cell.mark.value}, tolerance {cell.tolerance:.3g}"
            return shown.Cell(_printed(cell), below=_computed(cell), mark=cell.mark.name.lower(), hint=hint)

        return Column(first.column, content, unit=first.unit)

    columns: list[Column[tuple[str, Sequence[Cell]]]] = [
        Column("Row", lambda row: row[0], kind="label"), *map(number_in, range(len(rows[0][1]))),
    ]  # fmt: skip
    caption = " ".join(filter(None, (CAPTIONS.get(name), tolerance_in_words(name), _between_engines(cells))))
    return Table(caption, columns, rows, style="marked")


def chapter(compared: Sequence[Comparison]) -> str:
    """Write the table of the chapter on three dimensions in ``TN_D1772.md``.

    Each cell has the planar navigator's number, where it has one, and that of the navigator in three dimensions; those
    of samples are in brackets.
    """
    lines = [f"| case | {' | '.join(RESULTS)} |", f"| --- |{' --- |' * len(RESULTS)}"]
    for case, members in groupby(compared, key=lambda each: each.case):
        cells = {member.result: _cell(member) for member in members}
        lines.append(f"| {case.replace('-', '−')} | {' | '.join(cells.get(name, '–') for name in RESULTS)} |")
    return "\n".join(lines) + "\n"


def _cell(each: Comparison) -> str:
    """Write the numbers of a comparison."""

    def pair(linear: float, sampled: float) -> str:
        return number(linear, 3) if np.isnan(sampled) else f"{number(linear, 3)} ({number(sampled, 3)})"

    spatial = pair(each.linear, each.simulated)
    return spatial if np.isnan(each.planar) else f"{pair(each.planar, each.planar_simulated)}; {spatial}"


def loop_chapter(loops: Sequence[LoopComparison]) -> str:
    """Write the table of the chapter on the closed loop in ``TN_D1772.md``.

    Each cell has the linear number with the law fed by the truth, then by the navigator; those of samples are in
    brackets.
    """
    lines = [f"| case | {' | '.join(LOOP_RESULTS)} |", f"| --- |{' --- |' * len(LOOP_RESULTS)}"]
    for case, members in groupby(loops, key=lambda each: each.case):
        cells = {(member.result, member.fed): member for member in members}
        pairs = ["; ".join(_looped(cells[result, fed]) for fed in FED) for result in LOOP_RESULTS]
        lines.append(f"| {case.replace('-', '−')} | {' | '.join(pairs)} |")
    return "\n".join(lines) + "\n"


def _looped(each: LoopComparison) -> str:
    """Write the numbers of a case."""
    return f"{number(each.linear, 3)} ({number(each.simulated, 3)})" if each.linear > 0.0 else "0"


def write_reproduction(path: Path) -> tuple[list[Cell], list[Path]]:
    """Recompute the whole report; return every number of Tables I to VI, and the files written.

    They are the page, ``tables.csv``, ``findings.csv``, ``three_dimensions.csv``, ``closed_loop.csv``, the tables of
    their chapters, ``three_dimensions.md`` and ``closed_loop.md``, and ``figure_01.csv`` to ``figure_16.csv``.
    """
    cells = all_cells()
    data = {name: tabulate() for name, (tabulate, _) in FIGURES.items()}
    figures = {name: draw(data[name]) for name, (_, draw) in FIGURES.items()}
    said, decided, compared = [*claims(data), *relationship_claims()], settled(), comparisons()
    spatial, loops = spatial_claims(compared, data["14"]), loop_comparisons()
    looped = loop_claims(loops, data["15"])
    kinds = (("claim", said), ("decision", decided), ("three dimensions", spatial), ("closed loop", looped))
    reproduction = [(kind, finding) for kind, findings in kinds for finding in findings]
    findings = pd.DataFrame([{"kind": kind} | vars(finding) for kind, finding in reproduction])
    files = {
        PAGE: render(TITLE, cells, figures, said, decided, spatial, compared, looped, loops, advice(data["16"])),
        "three_dimensions.csv": pd.DataFrame(compared).to_csv(index=False),
        "three_dimensions.md": chapter(compared),
        "closed_loop.csv": pd.DataFrame(loops).to_csv(index=False),
        "closed_loop.md": loop_chapter(loops),
        "tables.csv": table(cells).to_csv(index=False),
        "findings.csv": findings.to_csv(index=False),
        **{figure.file: data[name].to_csv(index=False) for name, figure in figures.items()},
    }
    return cells, write_texts(path, files)
