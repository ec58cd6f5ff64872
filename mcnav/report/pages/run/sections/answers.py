"""The foremost table of a run's report: sigma, verdict and largest causes of each output."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from markupsafe import Markup

from mcnav.report.columns.filter_tables import FilterAnswer, filter_answers
from mcnav.report.columns.output_columns import OutputEntry, entries_of, grouped
from mcnav.report.document.parts import Answers
from mcnav.report.document.table import Cell, Column, Table, five_digits, label
from mcnav.report.drawing.strip import KEY, Strip
from mcnav.report.format import rounded
from mcnav.report.pages.run.sections.joint import EllipsoidWords, ellipsoid_words
from mcnav.report.results.linear_causes import causes_at
from mcnav.report.results.model import RunAnalysis
from mcnav.report.statements import details
from mcnav.report.statements.means import large_means_of

LARGEST: Final = 2
"""Causes named beside each output; beside the sigmas of a filter one."""

LEAST: Final = 0.005
"""Smallest share of a cause that is named there."""

NOTHING: Final = Cell()

FILTERED: Final = "filtered"
"""Style of the table that has the sigmas of a filter."""

Causes = Sequence[tuple[str, float]]
"""Names with shares."""


def answers(content: RunAnalysis) -> Answers | None:
    """Return the table with the filter's sigmas where there is a filter; none without dispersion."""
    if not content.dispersed:
        return None
    entries = entries_of({"": content.summary}, "shown")
    if filtered := filter_answers(content, entries):
        return Answers([_filter_table(content, filtered)], FILTERED)
    return Answers([_table(content, entries)])


def tone(verdict: str | None) -> str | None:
    """Return the tone of a verdict on an output; none of one that has no label."""
    return None if verdict == details.NOT_DISTURBED else verdict


def largest_causes(content: RunAnalysis, output: int) -> Causes:
    """List the causes with the largest shares in the linear variance of an output."""
    shares = np.nan_to_num(content.budget.attributed[output])
    order = np.argsort(-shares, kind="stable")[:LARGEST]
    return [(content.cause_names[j], float(shares[j])) for j in order if shares[j] >= LEAST]


def listed(causes: Causes) -> str:
    """List causes with their shares, each on one line."""
    space = "\N{NO-BREAK SPACE}"
    return ", ".join(f"{name}{space}{100.0 * share:.0f}{space}%" for name, share in causes)


@dataclass(frozen=True)
class _Answer:
    """An output, or all outputs together; what is known of them in words."""

    title: Cell
    linear: str | float | None
    flown: str | float | None
    verdict: Cell
    words: str
    ratio: Cell = NOTHING
    unscented: str | float | None = ""
    higher_order: str | float | None = ""
    kind: str = ""
    nominal: str | float | None = ""
    mean: str | float | None = ""


def _table(content: RunAnalysis, entries: Sequence[OutputEntry]) -> Table[_Answer]:
    rows, joint = [_answer(content, each) for each in grouped(entries)], ellipsoid_words(content)
    several = any(row.kind for row in rows)
    if joint is not None:
        at = len(rows) if joint.verdict == "agrees" else 0
        rows.insert(at, replace(_jointly(joint), kind="All outputs together" if several else ""))
    unscented: Column[_Answer] = Column("Unscented", lambda row: row.unscented, form=five_digits, size="sigma")
    higher_order: Column[_Answer] = Column("Higher order", lambda row: row.higher_order, form=five_digits, size="sigma")
    nominal: Column[_Answer] = Column("Nominal", lambda row: row.nominal, form=five_digits, size="value")
    mean: Column[_Answer] = Column("Mean error", lambda row: row.mean, form=five_digits, size="value")
    columns: list[Column[_Answer]] = [
        Column("Output", lambda row: row.title, kind="label"),
        *([nominal] if content.summary.nominal else []),
        *([mean] if large_means_of(content.summary) else []),
        Column("Linear", lambda row: row.linear, form=five_digits, size="sigma"),
        Column("Monte Carlo", lambda row: row.flown, form=five_digits, beside="Monte Carlo", size="sigma"),
        Column("Ratio", lambda row: row.ratio, kind="label", beside="ratio"),
        *([] if entries[0].sigma_unscented is None else [unscented]),
        *([] if entries[0].sigma_higher_order is None else [higher_order]),
        Column("Verdict", lambda row: row.verdict, kind="text"),
        Column("Largest causes", lambda row: row.words, kind="words"),
    ]
    crossed = content.budget.crossed
    caption = (
        f"{content.ends.title}, one sigma. Monte Carlo: paired estimate, intervals hold "
        f"jointly at {100.0 * content.summary.confidence:g} %. Causes: share of the linear variance"
        f"{', with half of what correlations contribute' if crossed else ''}. "
        f"{KEY.format(tolerance=100.0 * content.summary.tolerance)}"
    )
    return Table(caption, columns, rows, group=lambda row: row.kind)


def _answer(content: RunAnalysis, entry: OutputEntry) -> _Answer:
    strip = Strip.of(entry.ratio_paired, entry.ratio_paired_ends, content.summary.tolerance)
    return _Answer(
        title=Cell(content.output_names[entry.place], entry.unit),
        linear=entry.sigma_linear,
        flown=entry.sigma_paired,
        verdict=Cell(entry.verdict or "", tone=tone(entry.verdict)),
        words=listed(largest_causes(content, entry.place)) or "–",
        ratio=Cell(rounded(entry.ratio_paired), strip=strip),
        unscented=entry.sigma_unscented,
        higher_order=entry.sigma_higher_order,
        kind=entry.kind,
        nominal=entry.nominal,
        mean=entry.mean_error,
    )


def _jointly(joint: EllipsoidWords) -> _Answer:
    verdict = Cell(joint.verdict, tone=joint.verdict)
    return _Answer(Cell("joint: mean squared distance"), joint.dimension, joint.mean, verdict, joint.direction)


def _filter_table(content: RunAnalysis, rows: Sequence[FilterAnswer]) -> Table[FilterAnswer]:
    def verdicts(row: FilterAnswer) -> Cell:
        verdict, known = row.entry.verdict or "", tone(row.entry.verdict)
        linear = label(f"linear {verdict}", known) if known else verdict
        return Cell(Markup("{}<br>{}").format(linear, label(f"filter {row.honesty}", row.tone)))

    def largest(row: FilterAnswer) -> Cell:
        worst = causes_at(content, row.worst.time, row.entry.place) if row.worst else []
        return Cell(listed(largest_causes(content, row.entry.place)[:1]) or "–", below=listed(worst[:1]))

    nominal: Column[FilterAnswer] = Column("Nominal", lambda row: row.entry.nominal, form=five_digits, size="value")
    mean: Column[FilterAnswer] = Column("Mean error", lambda row: row.entry.mean_error, form=five_digits, size="value")
    columns: list[Column[FilterAnswer]] = [
        Column("Output", lambda row: Cell(content.output_names[row.entry.place], row.entry.unit), kind="label"),
        *([nominal] if content.summary.nominal else []),
        *([mean] if large_means_of(content.summary) else []),
        Column("When", lambda row: Cell("end", below=row.when), kind="text", beside="when"),
        Column(
            "Monte Carlo", lambda row: row.sigmas(row.entry.sigma_paired, "flown"), beside="Monte Carlo", size="sigma"
        ),
        Column("Linear", lambda row: row.sigmas(row.entry.sigma_linear, "linear"), size="sigma"),
        Column("Filter", lambda row: row.sigmas(row.sigma, "filter"), size="sigma"),
        Column("Farthest ratio", lambda row: row.ratio, kind="label", beside="farthest ratio"),
        Column("Verdicts", verdicts, kind="text", beside="verdicts"),
        Column("Largest cause", largest, kind="words"),
    ]
    tolerance = content.filter.tolerance if content.filter else 0.0
    caption = (
        "One sigma at the end and, below it, where it is largest. Ratio: true over filter sigma where it is farthest "
        f"off. Cause: largest share of the linear mean square. {KEY.format(tolerance=100.0 * tolerance)}"
    )
    return Table(caption, columns, rows)
