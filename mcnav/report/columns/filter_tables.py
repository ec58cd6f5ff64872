"""Tables of a filter's sigmas by output, and of the times when they are farthest off, in the units shown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from mcnav.analysis.filter_consistency import FilterConsistency, Finding, Honesty, SigmaConsistency
from mcnav.analysis.filter_remarks import group_words, instant
from mcnav.arrays.types import Array
from mcnav.report.columns.output_columns import OutputEntry
from mcnav.report.document.table import Cell
from mcnav.report.drawing.strip import Strip
from mcnav.report.figures.filter_errors import sigmas
from mcnav.report.format import number, rounded
from mcnav.report.names import humanize
from mcnav.report.results.model import RunAnalysis
from mcnav.report.statements.details import worst_sigmas
from mcnav.report.statements.words import TONES


@dataclass(frozen=True)
class WorstSigmas:
    """The sigmas of an output at an epoch."""

    time: float
    when: str
    linear: float | None
    flown: float
    filter: float


@dataclass(frozen=True)
class FilterAnswer:
    """Statement of a filter on an output at the end, and at the epoch of the largest true sigma if that is another."""

    entry: OutputEntry
    sigma: float
    honesty: str
    worst: WorstSigmas | None
    ratio: Cell

    @property
    def tone(self) -> str:
        """Tone of the verdict on the filter's sigma."""
        return TONES[self.honesty]

    @property
    def when(self) -> str:
        """The other epoch, on one line."""
        return self.worst.when.replace(" ", "\N{NO-BREAK SPACE}") if self.worst else ""

    def sigmas(self, end: float | None, key: Literal["flown", "linear", "filter"]) -> Cell:
        """Write a number at the end and, below it, that of the other epoch."""
        other = getattr(self.worst, key) if self.worst else None
        return Cell(number(end), below=number(other) if self.worst else "", value=end, value_below=other)


def filter_answers(content: RunAnalysis, outputs: Sequence[OutputEntry]) -> list[FilterAnswer]:
    """List what the filter says of each output; empty unless it is known of all."""
    result = content.filter
    known = {} if result is None else {output.name: output for output in result.outputs}
    if result is None or any(entry.name not in known for entry in outputs):
        return []
    return [_answer(result, entry, known[entry.name]) for entry in outputs]


def _answer(consistency: FilterConsistency, entry: OutputEntry, judged: SigmaConsistency) -> FilterAnswer:
    sigma, honesty = float(sigmas(judged)["filter"][-1]), judged.finding.verdict.value
    return FilterAnswer(entry, sigma, honesty, _worst(consistency, judged), _ratio(consistency, judged))


def _ratio(consistency: FilterConsistency, judged: SigmaConsistency) -> Cell:
    """Write the ratio by which an output is judged: where it is farthest off, with when that is."""
    finding = judged.finding
    if finding.factor is None or not np.isfinite(finding.factor):
        return Cell("–")
    when = "" if finding.worst is None else instant(float(consistency.times[finding.worst]), consistency.label)
    strip = Strip.of(finding.factor, deciding_interval(finding, judged.ratio.each), consistency.tolerance)
    return Cell(rounded(finding.factor), below=when.replace(" ", "\N{NO-BREAK SPACE}"), strip=strip)


def deciding_interval(finding: Finding, single: Array) -> tuple[float, float] | None:
    """Return the interval of a finding's factor that its verdict rests on.

    A consistent one rests on the interval of each epoch, ``single``, shape (m, 2); any other on those of all epochs
    together, which are wider.
    """
    if finding.verdict != Honesty.CONSISTENT or finding.worst is None:
        return finding.interval
    low, high = single[finding.worst].tolist()
    return low, high


def interval_at_worst(consistency: FilterConsistency) -> tuple[float, float] | None:
    """Return that interval of a consistent filter's ratio farthest from one; none where it is not known."""
    known = consistency.groups if consistency.group else consistency.outputs
    name = consistency.group or consistency.output
    found = next((judged for judged in known if judged.name == name), None)
    return None if found is None else deciding_interval(found.finding, found.ratio.each)


def _worst(consistency: FilterConsistency, judged: SigmaConsistency) -> WorstSigmas | None:
    """Return the sigmas where the true one is largest after the start, by linear analysis where that is known.

    None at the end, and where nothing is known.
    """
    values = judged.true if judged.true_linear is None else judged.true_linear
    later = np.where(np.isfinite(values[1:]), values[1:], -np.inf)
    if not np.isfinite(later).any():
        return None
    place = int(np.argmax(later)) + 1
    if place == len(consistency.times) - 1:
        return None
    whose, time = {name: float(sigma[place]) for name, sigma in sigmas(judged).items()}, float(consistency.times[place])
    return WorstSigmas(
        time=time,
        when=instant(time, consistency.label),
        linear=whose.get("linear"),
        flown=whose["Monte Carlo"],
        filter=whose["filter"],
    )


def at_worst(consistency: FilterConsistency) -> str:
    """Compare the true sigma with the filter's where they differ most; empty where nothing is known."""
    output = next((output for output in consistency.outputs if output.name == consistency.output), None)
    departure = consistency.departing_output
    if consistency.worst is None or consistency.factor is None:
        return ""
    if consistency.verdict in (Honesty.CONSISTENT, Honesty.UNDECIDED):
        where = f"{group_words(consistency.group)} as a group" if consistency.group else humanize(consistency.output)
        farthest = f"{rounded(consistency.factor)}, at {instant(consistency.worst, consistency.label)}"
        if consistency.verdict == Honesty.CONSISTENT:
            return f"The ratio farthest from one is that of {where}: {farthest}."
        return f"The most samples are needed for {where}: its ratio farthest from one is {farthest}."
    if output is None:
        return ""
    worst = consistency.worst if departure is None else departure.worst
    place, when = int(np.argmin(np.abs(consistency.times - worst))), instant(worst, consistency.label)
    whose = {name: float(values[place]) for name, values in sigmas(output).items()}
    return worst_sigmas(output.name, when, whose["Monte Carlo"], whose["filter"], output.shown_in)
