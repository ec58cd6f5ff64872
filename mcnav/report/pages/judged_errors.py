"""Results of a table of errors and sigmas: sentences, a table, a page, and ``judge.json``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any, Final

import numpy as np

from mcnav.judgement.error_table import FEWEST_INDEPENDENT, ErrorTable, ErrorVerdict
from mcnav.report.document.parts import Note, Page, Part, Section, Verdict
from mcnav.report.document.table import Cell, Column, Table
from mcnav.report.drawing.figure import Figure, side_by_side
from mcnav.report.drawing.marks import Axis, Line, Mark, Panel, Series
from mcnav.report.drawing.palette import FILTER, POINT
from mcnav.report.format import number
from mcnav.report.names import humanize
from mcnav.report.pages.screen import RESULTS, answered

LEVEL: Final = 0.05
"""Probability of a false alarm of all tests together, shared equally (Bonferroni)."""

ASSUMED: Final = (
    "Each interval counts the independent values of the record by an autoregression of the normalized errors. It "
    "assumes normal errors of mean zero, stationary once they are normalized, and says nothing of a record with fewer "
    f"than {FEWEST_INDEPENDENT:g} independent values. Without the filter's model, which number is wrong cannot be said."
)

ERROR, SIGMA = Series("error", "error", POINT), Series("filter", "stated, ±3σ", FILTER)


def level(verdicts: Sequence[ErrorVerdict]) -> float:
    """Return the probability of a false alarm of each test."""
    tests = sum((verdict.size is not None) + (verdict.whiteness is not None) for verdict in verdicts)
    return LEVEL / max(tests, 1)


def wrong(verdicts: Sequence[ErrorVerdict]) -> list[str]:
    """List what is at odds, a clause each, without a full stop."""
    limit, clauses = level(verdicts), []
    for verdict in verdicts:
        what = humanize(verdict.name)
        if verdict.size is not None and verdict.size.p_value < limit:
            value, low, high = verdict.size.factor
            if value < 1.0:
                value, low, high = 1.0 / value, 1.0 / high, 1.0 / low
                side = "large"
            else:
                side = "small"
            kind = "sigma" if verdict.kind == "NEES" else "sigma of the innovation"
            clauses.append(
                f"the {kind} of {what} is {number(value, 3)} times too {side}: {number(low, 3)} to {number(high, 3)}"
            )
        if verdict.whiteness is not None and verdict.whiteness.p_value < limit:
            correlation = number(verdict.whiteness.autocorrelation, 2)
            clauses.append(f"innovations of {what} are correlated: {correlation} from one to the next")
    return clauses


def verdict(verdicts: Sequence[ErrorVerdict]) -> Verdict:
    """Return the verdict in large type."""
    clauses = wrong(verdicts)
    silent = [humanize(verdict.name) for verdict in verdicts if verdict.size is None]
    further = (f"Too few independent values to say anything: {', '.join(silent)}.",) if silent else ()
    if clauses:
        return Verdict(f"{clauses[0][:1].upper()}{clauses[0][1:]}.", "differs",
                       (*(f"Besides, {clause}." for clause in clauses[1:]), *further))  # fmt: skip
    if len(silent) == len(verdicts):
        return Verdict("This record is too short, for its correlation, to say anything.", "undecided", further)
    return Verdict("Errors and innovations are as large as stated, as far as this record tells.", "agrees", further)


def error_table(verdicts: Sequence[ErrorVerdict]) -> Table[ErrorVerdict]:
    """Tabulate the tests."""
    limit = level(verdicts)

    def ratio(verdict: ErrorVerdict) -> Cell | str:
        if verdict.size is None:
            return "–"
        return Cell(number(verdict.size.ratio, 3), tone="differs" if verdict.size.p_value < limit else None)

    def factor(verdict: ErrorVerdict) -> str:
        if verdict.size is None:
            return "–"
        value, low, high = verdict.size.factor
        return f"{number(value, 3)} ({number(low, 3)} to {number(high, 3)})"

    def white(verdict: ErrorVerdict) -> Cell | str:
        if verdict.whiteness is None:
            return "–"
        tone = "differs" if verdict.whiteness.p_value < limit else None
        return Cell(number(verdict.whiteness.autocorrelation, 2), tone=tone)

    columns: list[Column[ErrorVerdict]] = [
        Column("Quantity", lambda row: humanize(row.name), "quantity", "label", of_user=True),
        Column("test", lambda row: row.kind, kind="label"),
        Column("mean square", ratio),
        Column("factor of the sigma (95 %)", factor, "factor (95 %)"),
        Column("values", lambda row: "–" if row.size is None else f"{row.size.values:,}"),
        Column("independent", lambda row: "–" if row.size is None else number(row.size.effective, 3)),
        Column("autocorrelation", white),
    ]
    return Table("Normalized squares, over the number of components.", columns, verdicts, "Errors and innovations")


def terminal(verdicts: Sequence[ErrorVerdict]) -> list[Part]:
    """List what the terminal shows."""
    return [verdict(verdicts), Note(ASSUMED), error_table(verdicts)]


def page(title: str, table: ErrorTable, verdicts: Sequence[ErrorVerdict]) -> Page:
    """Return the page."""
    parts: list[Part] = [error_table(verdicts), figure(table)]
    section = Section("errors", "Errors and innovations", parts)
    return answered(
        Page(title, "A table of errors judged", title, [verdict(verdicts)], [section], [Note(ASSUMED)]), rest=RESULTS
    )


def figure(table: ErrorTable) -> Figure:
    """Draw all errors and innovations with their sigmas."""
    panels, columns = [], {"time": table.times}
    for name, (values, sigmas) in (*table.errors.items(), *table.innovations.items()):
        marks: list[Mark] = [Line(ERROR, table.times, values, 1.2)]
        marks += [Line(SIGMA, table.times, sign * 3.0 * sigmas, 1.7) for sign in (-1.0, 1.0)]
        panels.append(Panel(humanize(name), Axis("time", margin=0.02, link="time"), Axis("error"), marks))
        columns |= {name: values, f"{name}, sigma": np.asarray(sigmas)}
    return Figure(
        "errors", "Errors over time", "Errors and innovations over time with the sigmas that are stated.", panels,
        [ERROR, SIGMA], columns, side_by_side(len(panels)),
    )  # fmt: skip


def content(verdicts: Sequence[ErrorVerdict]) -> Mapping[str, Any]:
    """Return the content of ``judge.json``."""
    clauses = wrong(verdicts)
    return {
        "alarm": bool(clauses),
        "sentence": verdict(verdicts).headline,
        "level": level(verdicts),
        "tests": [asdict(verdict) for verdict in verdicts],
    }
