"""Tables of a box of campaigns: requirements and sigmas at the best and the worst of its settings, and its ranges."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from mcnav.analysis.box import Box, Setting
from mcnav.analysis.linear_answer import LinearAnswer
from mcnav.report.document.parts import Part, Section, Sentence
from mcnav.report.document.table import Cell, Column, Table, five_digits
from mcnav.report.names import humanize, scale_of
from mcnav.report.pages.lincov import requirement_rows, units_shown
from mcnav.report.statements.box import box_words, is_met, setting_words, shown_entry


@dataclass(frozen=True)
class SpreadRow:
    """A measure over a box: best and worst value in the unit shown."""

    name: str
    unit: str
    best: float
    worst: float
    setting: Setting
    finding: str = ""
    tone: str = ""


@dataclass(frozen=True)
class RangeRow:
    """A range, and what it would gain to know it better."""

    path: str
    written: str
    known: str
    gain: str


def requirement_spreads(answer: LinearAnswer, box: Box) -> list[SpreadRow]:
    """List the requirements that can be judged, with their values over a box."""
    units = units_shown(answer.outputs)
    names, rows = list(units), list[SpreadRow]()
    named = requirement_rows(answer)
    for row, shown, spread in zip(answer.requirements, named, box.requirements, strict=True):
        if math.isnan(spread.worst.value):
            continue
        scale, unit = (100.0, "%") if row.requirement.kind == "box" else units[names[row.requirement.outputs[0]]]
        met = is_met(row.requirement, spread.worst.value)
        words, tone = ("met", "agrees") if met else ("not met", "differs")
        if not met and is_met(row.requirement, spread.best.value):
            words = "not at all settings"
        best, worst = spread.best.value * scale, spread.worst.value * scale
        rows.append(SpreadRow(shown.requirement, unit, best, worst, spread.worst.setting, words, tone))
    return _shortened(rows)


def output_spreads(answer: LinearAnswer, box: Box) -> list[SpreadRow]:
    """List the final sigmas over a box."""
    rows = [
        SpreadRow(humanize(output.name), output.shown_in, spread.best.value * scale, spread.worst.value * scale,
                  spread.worst.setting)
        for output, scale, spread in zip(answer.outputs, scale_of(answer.outputs), box.outputs, strict=True)
    ]  # fmt: skip
    return _shortened(rows)


def _shortened(rows: Sequence[SpreadRow]) -> list[SpreadRow]:
    """Leave out settings that are those of the row above."""
    above = [None, *(row.setting for row in rows)]
    return [
        replace(row, setting={}) if row.setting == before else row for row, before in zip(rows, above, strict=False)
    ]


def range_rows(box: Box) -> list[RangeRow]:
    """List the ranges, largest effect first."""
    rows = [
        RangeRow(row.path, box.ranges[row.path], f"{shown_entry(row.low)} to {shown_entry(row.high)}",
                 f"{100.0 * row.gain:.2g} %") for row in box.narrowed
    ]  # fmt: skip
    named = {row.path for row in rows}
    return [*rows, *(RangeRow(path, written, "–", "–") for path, written in box.ranges.items() if path not in named)]


def _columns(first: str) -> list[Column[SpreadRow]]:
    return [
        Column(first, lambda row: Cell(row.name, row.unit), first.lower(), "label"),
        Column("Best", lambda row: row.best, "best", form=five_digits),
        Column("Worst", lambda row: row.worst, "worst", form=five_digits),
        Column("Worst with", lambda row: setting_words(row.setting) or "as above", "worst with", "words"),
    ]


def box_tables(answer: LinearAnswer) -> list[Part]:
    """Return the tables of a box; none without ranges of several values."""
    box = answer.box
    if box is None or not box.varies:
        return []
    tables: list[Part] = []
    if required := requirement_spreads(answer, box):
        requirement, *others = _columns("Requirement")
        finding: Column[SpreadRow] = Column(
            "At the worst", lambda row: Cell(row.finding, tone=row.tone), "at the worst", "label"
        )
        caption = "Requirements over the ranges, and the setting at which each is worst."
        tables.append(Table(caption, [requirement, finding, *others], required, "Requirements over the ranges"))
    caption = "One sigma at the end over the ranges, and the setting at which each is worst."
    tables.append(Table(caption, _columns("Output"), output_spreads(answer, box), "Over the ranges, 1σ at the end"))
    ranges: list[Column[RangeRow]] = [
        Column("Range", lambda row: row.path, "range", "label"),
        Column("As written", lambda row: row.written, "as written", "words"),
        Column("If it were known to be", lambda row: row.known, "if known to be", "words"),
        Column("Gain", lambda row: row.gain, "gain", "words"),
    ]
    caption = "What it would gain at the worst setting to know one range to a factor of two, at most half of it."
    return [*tables, Table(caption, ranges, range_rows(box), "Ranges, largest effect first")]


def box_section(answer: LinearAnswer) -> Section | None:
    """Return the section of the page on the ranges; none without any."""
    if not (tables := box_tables(answer)):
        return None
    return Section("ranges", "Ranges", [*(Sentence(f"{words}.", tone) for words, tone in box_words(answer)), *tables])
