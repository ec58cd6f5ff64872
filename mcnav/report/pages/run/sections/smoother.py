"""The section on the smoother behind the filter: its verdict, and its errors beside those of the filter."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from markupsafe import Markup

from mcnav.analysis.filter_consistency import FilterConsistency, SigmaConsistency
from mcnav.analysis.filter_remarks import instant
from mcnav.report.columns.result_table import in_units
from mcnav.report.document.parts import Note, Part, Section, Sentence, joined
from mcnav.report.document.table import Cell, Column, Table, label
from mcnav.report.drawing.strip import Strip
from mcnav.report.format import rounded
from mcnav.report.names import humanize
from mcnav.report.results.model import RunAnalysis
from mcnav.report.statements.words import TONES

WORSE: Final = "The errors behind the smoother are larger than the filter's at {} of {} epochs in some output."


@dataclass(frozen=True)
class SmoothedRow:
    """An output at the epoch at which its error behind the smoother is largest, in the unit shown."""

    output: Cell
    when: str
    filter: float | None
    true: float
    linear: float | None
    claimed: float
    ratio: Cell


def smoother_section(content: RunAnalysis) -> Section | None:
    """Arrange what is known of the smoother; none without one."""
    result = content.smoother
    if result is None:
        return None
    verdict = result.verdict.value
    stated = Sentence(Markup("{} {}").format(label(verdict, TONES[verdict]), content.summary.smoother_verdict))
    parts: tuple[Part, ...] = joined(stated, _worse(result, content.filter), _table(result, content.filter))
    return Section("smoother", "Errors behind the smoother", parts)


def _table(result: FilterConsistency, filtered: FilterConsistency | None) -> Table[SmoothedRow] | None:
    by_name = {} if filtered is None else {output.name: output for output in filtered.outputs}
    rows = [_row(result, output, by_name.get(output.name)) for output in result.outputs]
    columns: list[Column[SmoothedRow]] = [
        Column("Output", lambda row: row.output, kind="label"),
        Column("Filter, true σ", lambda row: row.filter),
        Column("Smoother, true σ", lambda row: row.true),
        Column("Linear analysis", lambda row: row.linear),
        Column("Smoother claims", lambda row: row.claimed),
        Column("True over claimed", lambda row: row.ratio),
        Column("At", lambda row: row.when),
    ]
    caption = (
        "Each output at the epoch of its largest error behind the smoother: root mean squares of the samples before "
        "and behind it, by linear analysis, and what the smoother claims. The interval of a ratio is that of its epoch."
    )
    return Table(caption, columns, rows) if rows else None


def _row(result: FilterConsistency, consistency: SigmaConsistency, filtered: SigmaConsistency | None) -> SmoothedRow:
    scale, unit = in_units(consistency.unit, consistency.shown_in, "shown")
    at = int(np.nanargmax(consistency.true))
    low, high = consistency.ratio.each[at].tolist()
    ratio = float(consistency.ratio.value[at])
    return SmoothedRow(
        Cell(humanize(consistency.name), unit),
        instant(float(result.times[at]), result.label),
        None if filtered is None else float(filtered.true[at]) * scale,
        float(consistency.true[at]) * scale,
        None if consistency.true_linear is None else float(consistency.true_linear[at]) * scale,
        float(consistency.filter[at]) * scale,
        Cell(rounded(ratio), strip=Strip.of(ratio, (low, high), result.tolerance)),
    )


def _worse(result: FilterConsistency, filtered: FilterConsistency | None) -> Note | None:
    """Say where linear analysis has the smoother worse than its filter; none where it never is."""
    if filtered is None:
        return None
    by_name, worse = {output.name: output for output in filtered.outputs}, np.zeros(len(result.times), dtype=bool)
    for output in result.outputs:
        before = by_name.get(output.name)
        if output.true_linear is not None and before is not None and before.true_linear is not None:
            worse |= output.true_linear > 1.01 * before.true_linear
    return Note(WORSE.format(int(worse.sum()), len(worse))) if worse.any() else None
