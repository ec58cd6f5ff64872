"""A run on one screen of a terminal: its answers, one table that shows them, and what to do next."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Final

from rich.console import Group, RenderableType
from rich.text import Text

from mcnav.arrays.types import Array
from mcnav.contract.quantities import AT_END
from mcnav.report.columns.output_columns import OutputEntry, entries_of
from mcnav.report.document.fitted_table import FittedTable, numbers, texts
from mcnav.report.document.terminal_parts import COLOURS
from mcnav.report.format import number, rounded
from mcnav.report.names import humanize, shown_units
from mcnav.report.statements import verdicts
from mcnav.report.statements.fields import difference_bound
from mcnav.report.statements.joint import direction_words
from mcnav.report.statements.verdicts import Statement, statements
from mcnav.report.statements.words import TONES

if TYPE_CHECKING:
    from mcnav.analysis.summary import FilterRatio, Summary

WIDTH: Final = 80
"""Columns that the screen is written for."""

LONGEST: Final = 10
"""Outputs that the table lists; of more, those farthest off."""

DIGITS: Final = 4
"""Significant digits of its sigmas."""

INDENT: Final = "  "


def screen(
    summary: Summary, epochs: Mapping[str, Array], seconds: float | None, closing: Sequence[str]
) -> RenderableType:
    """Lay out a run.

    Parameters
    ----------
    epochs : mapping
        As for `mcnav.report.statements.verdicts.statements`.
    seconds : float, optional
        What its simulation took; none where all samples were stored.
    closing : sequence of str
        Last lines.
    """
    shown = statements(summary, epochs)
    effort = f"{summary.samples:,} samples, " + ("stored" if seconds is None else f"{rounded(seconds, 2)} s")
    *above, title = textwrap.wrap(summary.campaign, WIDTH - len(effort) - 2)
    lines: list[RenderableType] = [Text(line, style="bold") for line in above]
    lines.append(Text(f"{title:<{WIDTH - len(effort)}}{effort}", style="bold"))
    indent = 2 + max(len(answer.word) for answer in shown)
    for answer in shown:
        lines += _paragraph(answer, indent)
    lines += ["", _table(summary)]
    advice = [answer.next_step for answer in shown if answer.next_step]
    return Group(*lines, "", *advice, *closing)


def _paragraph(answer: Statement, indent: int) -> list[Text]:
    """Write an answer, and its further sentences below it."""
    word, *rest = textwrap.wrap(answer.sentence, WIDTH - indent)
    style, margin = f"bold {COLOURS[answer.tone]}", " " * indent
    lines = [Text(f"{answer.word:<{indent}}{word}", style=style), *(Text(margin + line, style=style) for line in rest)]
    of_causes = "Driven by" if answer.tone == "agrees" else "Cause"
    causes = [f"{of_causes}: {answer.cause}."] if answer.cause else []
    sentences_below = [*answer.consequences, *answer.warnings, *causes]
    further = [line for sentence in sentences_below for line in textwrap.wrap(sentence, WIDTH - indent)]
    return [*lines, *(Text(margin + line) for line in further)]


def _table(summary: Summary) -> FittedTable:
    """Tabulate sigmas: those of the filter where it is what is wrong, else those of linear analysis."""
    result = summary.filter
    if result is not None and TONES[result.verdict] == "differs":
        return _filter_table(summary, result.outputs)
    return _linear_table(summary)


def _linear_table(summary: Summary) -> FittedTable:
    confidence = f"difference ({100.0 * summary.confidence:g} %)"
    columns = [*texts(f"{INDENT}1 sigma at the end", ""), *numbers("P S P'", "Monte Carlo", confidence), *texts("")]
    table = FittedTable("", columns, keys=2)
    entries = entries_of({"": summary}, "shown")
    farthest = sorted(entries, key=lambda output: -abs((output.ratio_paired or 1.0) - 1.0))[:LONGEST]
    for output in filter(farthest.__contains__, entries):
        sigmas = (number(output.sigma_linear, DIGITS), number(output.sigma_paired, DIGITS))
        table.add(f"{INDENT}{humanize(output.name)}", f"[{output.unit}]", *sigmas, *_difference(output))
    joint = summary.joint
    if joint is not None and joint.foremost is not None and verdicts.tone(summary) == "partly":
        scale, unit = shown_units(summary)[joint.foremost.lead]
        if joint.cause == "mean":
            sigmas = ("0", number(joint.foremost.mean_error * scale, 3))
            table.add(
                f"{INDENT}mean of {direction_words(joint.foremost, summary)}", f"[{unit}]", *sigmas, "", _wrong(summary)
            )
        else:
            linear, simulated = joint.foremost.sigma_linear, joint.foremost.sigma_paired
            sigmas = (number(linear * scale, 3), number(simulated * scale, 3))
            off = _signed(simulated / linear) if linear > 0.0 else ""
            table.add(f"{INDENT}{direction_words(joint.foremost, summary)}", f"[{unit}]", *sigmas, off, _wrong(summary))
    return _shortened(table, summary, len(entries))


def _wrong(summary: Summary) -> Text:
    """Return the verdict on all outputs together, which is not that they agree."""
    differs = summary.verdict_matrix == "differs"
    return Text("DIFFERS", style=COLOURS["differs"]) if differs else Text("undecided", style=COLOURS["undecided"])


def _signed(ratio: float) -> str:
    """Write the difference of a ratio from one, per cent, with two digits or all before the point.

    >>> _signed(1.143), _signed(2.54), _signed(0.969)
    ('+14 %', '+154 %', '−3.1 %')
    """
    off = 100.0 * (ratio - 1.0)
    return f"{off:+.{0 if abs(off) >= 10.0 else 1}f} %".replace("-", "−")


def _difference(output: OutputEntry) -> tuple[str, Text]:
    """Return the difference of an output's sigmas, and the verdict on it."""
    ends = [end for end in output.ratio_paired_ends if end is not None]
    verdict, ratio = output.verdict, output.ratio_paired
    if verdict == "agrees":
        return f"< {difference_bound(ends)} %" if ends else "", Text("ok", style=COLOURS["agrees"])
    words = "DIFFERS" if verdict == "differs" else verdict or ""
    return _signed(ratio) if ratio is not None else "", Text(words, style=COLOURS.get(verdict or "", ""))


def _filter_table(summary: Summary, outputs: Mapping[str, FilterRatio]) -> FittedTable:
    confidence = f"true/filter ({100.0 * summary.confidence:g} %)"
    columns = [*texts(f"{INDENT}{AT_END.heading}", ""), *numbers("filter", "true", confidence, "most"), *texts("")]
    table, units = FittedTable("", columns, keys=2), shown_units(summary)
    farthest = sorted(outputs, key=lambda name: -(outputs[name].factor or 0.0))[:LONGEST]
    for name in (name for name in outputs if name in farthest):
        departure, (scale, unit) = outputs[name], units[name]
        sigmas = [number(None if s is None else s * scale, 3) for s in (departure.sigma_filter, departure.sigma_true)]
        low, high = (rounded(end, 2) for end in departure.ratio_interval)
        right = departure.verdict == "consistent"
        word = Text("ok" if right else departure.verdict.upper(), style=COLOURS[TONES[departure.verdict]])
        ratio = f"{rounded(departure.ratio, 2)} ({low} to {high})"
        table.add(f"{INDENT}{humanize(name)}", f"[{unit}]", *sigmas, ratio, rounded(departure.factor, 2), word)
    return _shortened(table, summary, len(outputs))


def _shortened(table: FittedTable, summary: Summary, count: int) -> FittedTable:
    """Say how many outputs are not listed."""
    if count > LONGEST:
        table.add(f"{INDENT}and {count - LONGEST} outputs closer to one", *[""] * (len(table.columns) - 1))
    return table
