"""The first screen of a run's report: a tile for each verdict, the worst first, with its worst number."""

from __future__ import annotations

import math
from collections.abc import Container, Sequence
from dataclasses import dataclass
from typing import Final

from mcnav.analysis.filter_consistency import Honesty
from mcnav.analysis.filter_remarks import group_words, instant
from mcnav.analysis.summary import Ends, FilterSummary, Summary
from mcnav.report.columns.requirements import RequirementRow
from mcnav.report.document.parts import Tile
from mcnav.report.drawing.strip import Strip
from mcnav.report.format import number, rounded, signed
from mcnav.report.names import humanize, shown_units
from mcnav.report.statements import verdicts
from mcnav.report.statements.fields import worst_departure
from mcnav.report.statements.joint import BRIEFLY, combination_words
from mcnav.report.statements.means import against, large_means_of
from mcnav.report.statements.requirements import limit_words, measure_words, three_digits, worst_requirement
from mcnav.report.statements.verdicts import Statement, Subject
from mcnav.report.statements.words import WORST

DIGITS: Final = 3
"""Significant digits of a tile's numbers."""

NAMES: Final[dict[Subject, str]] = {
    "means": "Mean errors",
    "requirements": "Requirements", "filter": "Filter", "smoother": "Smoother", "linear": "Linear analysis",
}  # fmt: skip
"""Subjects for people, in the order of tiles of one tone."""

SECTIONS: Final[dict[Subject, tuple[str, ...]]] = {
    "means": ("throughout", "dispersion"),
    "requirements": ("requirements",), "filter": ("filter",), "smoother": ("smoother",),
    "linear": ("combination", "linear", "joint", "truth", "provenance"),
}  # fmt: skip
"""Sections on each subject, the foremost first: that on the combination of outputs is only where they differ."""

FURTHER: Final[dict[Subject, tuple[tuple[str, str], ...]]] = {
    "means": (),
    "requirements": (("Causes", "budget"), ("What would help", "remedies"), ("What would change it", "what-if")),
    "filter": (("What would change it", "what-if"),), "smoother": (),
    "linear": (("Causes of the errors", "budget"), ("What would help", "remedies")),
}  # fmt: skip
"""Questions after each verdict, and the sections that answer them."""


@dataclass(frozen=True)
class Worst:
    """The number farthest off: in three digits, what it is of, and its interval; of a ratio its mark."""

    value: str = ""
    of: str = ""
    strip: Strip | None = None


NOTHING: Final = Worst()


def tiles(
    summary: Summary,
    stated: Sequence[Statement],
    sections: Container[str],
    time_unit: str = "",
    consistent: Ends | None = None,
) -> list[Tile]:
    """Return a tile for each of some statements, the worst first; each links to one of the page's sections.

    ``consistent`` is the interval of a consistent filter's ratio at its epoch alone, on which that verdict rests.
    """
    if summary.filter and summary.filter.verdict == Honesty.CONSISTENT:
        judged = summary.filter.model_copy(update={"factor_interval": consistent})
        summary = summary.model_copy(update={"filter": judged})
    made = [_tile(summary, each, sections, time_unit) for each in stated]
    order = [*NAMES.values()]
    return sorted(made, key=lambda tile: (WORST.index(tile.tone), order.index(tile.subject)))


def _tile(summary: Summary, statement: Statement, sections: Container[str], time_unit: str) -> Tile:
    subject = statement.subject
    worst_of = {
        "means": _mean, "requirements": _requirement, "filter": _filter, "smoother": _smoother, "linear": _linear,
    }  # fmt: skip
    worst = worst_of[subject](summary, time_unit)
    link = next((name for name in SECTIONS[subject] if name in sections), "")
    return Tile(
        subject=NAMES[subject],
        status=status(summary, subject),
        tone=statement.tone,
        sentence=" ".join((statement.sentence, *statement.consequences)),
        value=worst.value,
        of=worst.of,
        strip=worst.strip,
        link=link,
        details=statement.details,
        warnings=statement.warnings,
        further=[(words, name) for words, name in FURTHER[subject] if name in sections],
    )


def status(summary: Summary, subject: Subject) -> str:
    """Return the verdict on a subject in a word or two."""
    if subject == "means":
        return "above one sigma"
    if subject == "filter":
        return summary.filter.verdict if summary.filter else ""
    if subject == "smoother":
        return summary.smoother.verdict if summary.smoother else ""
    if subject == "requirements":
        counts = summary.counts
        if counts is None:
            return ""
        worst = ("not met", counts.not_met), ("undecided", counts.undecided), ("as known", counts.met_as_known)
        return next((words for words, count in worst if count), "met")
    if summary.unsettled:
        return "no valid model"
    if summary.beyond_range:
        return "beyond its range"
    tone = verdicts.tone(summary)
    if tone != "differs" and not any(summary.sigma_linear):
        return "nothing to compare"
    return {
        "agrees": "holds", "differs": "does not hold", "undecided": "undecided",
        "partly": "holds output by output",
    }[tone]  # fmt: skip


def _mean(summary: Summary, _: str) -> Worst:
    """Return the mean error that is the largest in sigmas."""
    large = large_means_of(summary)
    if not large:
        return NOTHING
    name = summary.names[large[0].output]
    scale, unit = shown_units(summary)[name]
    return Worst(f"{signed(large[0].mean * scale, DIGITS)} {unit}".strip(),
                 f"mean error of {humanize(name)}, {against(large[0], scale, unit)}")  # fmt: skip


def _requirement(summary: Summary, time_unit: str) -> Worst:
    row = worst_requirement(summary, time_unit)
    if row is None:
        return NOTHING
    entry, known = row.entry, row.entry.exceedance
    if known and not known.refusal and None not in (known.estimate, known.low, known.high):
        allowed = f"allowed {_power(1.0 - (entry.probability or 0.5))}"
        estimate, low, high = map(_power, (known.estimate, known.low, known.high))
        return Worst(estimate, f"beyond the limit ({low} to {high}); {allowed}")
    if entry.estimate is None or not math.isfinite(entry.estimate):
        return Worst("–", row.exceedance) if known and known.refusal else NOTHING
    limit = f"at least {100.0 * (entry.probability or 0.0):g} %" if entry.kind == "box" else limit_words(row)
    when = f" at {instant(entry.time, f'time [{row.time_unit}]')}" if entry.time is not None else ""
    return Worst(three_digits(row, entry.estimate), f"{measure_words(entry)}{when}{_between(row)}; {limit}")


def _between(row: RequirementRow) -> str:
    """Write the bounds that are known."""
    low, high = row.entry.interval
    if high is None or not math.isfinite(high):
        return f" (above {three_digits(row, low)})" if low else ""
    return f" ({three_digits(row, low).removesuffix(row.unit).rstrip()} to {three_digits(row, high)})"


def _power(value: float | None) -> str:
    """Write a small probability with three digits."""
    return number(value, DIGITS)


def _filter(summary: Summary, _: str) -> Worst:
    """Return the ratio of true to filter sigma that is farthest off: of what is certain, else of all."""
    return _farthest(summary.filter, "filter")


def _smoother(summary: Summary, _: str) -> Worst:
    """Return the ratio of true to smoother sigma that is farthest off, as that of a filter."""
    return _farthest(summary.smoother, "smoother")


def _farthest(result: FilterSummary | None, whose: str) -> Worst:
    """Return a ratio of true sigma to that of a filter or a smoother."""
    if result is None:
        return NOTHING
    worst = worst_departure(result)
    if worst is not None:
        name = group_words(worst.name) if worst.of == "group" else humanize(worst.name)
        when = _at(worst.worst, result.time)
        return _ratio(worst.factor, worst.factor_interval, f"true σ / {whose} σ of {name}{when}", result.tolerance)
    if result.factor is None or not math.isfinite(result.factor) or result.factor <= 0.0:
        return NOTHING
    name = group_words(result.group) if result.group else humanize(result.output)
    when = _at(result.worst, result.time)
    return _ratio(result.factor, result.factor_interval, f"true σ / {whose} σ of {name}{when}", result.tolerance)


def _at(time: float | None, label: str) -> str:
    return "" if time is None else f" at {instant(time, label)}"


def _ratio(value: float | None, ends: Ends | None, of: str, tolerance: float | None) -> Worst:
    """Return a ratio with its interval below it."""
    return Worst(rounded(value), f"{of}{_ends(ends)}", Strip.of(value, ends, tolerance))


def _ends(ends: Ends | None) -> str:
    """Write an interval in brackets; nothing of one that is not known."""
    low, high = ends or (None, None)
    if low is None or high is None or not (math.isfinite(low) and math.isfinite(high)):
        return ""
    return f" ({rounded(low)} to {rounded(high)})"


def _linear(summary: Summary, _: str) -> Worst:
    """Return the sigma ratio farthest from one, or what the joint distribution differs in."""
    if summary.unsettled or summary.beyond_range:
        return NOTHING
    if verdicts.tone(summary) == "partly":
        return _jointly(summary)
    verdict, ratios = summary.verdict, summary.sigma_ratio_paired
    known = [i for i, ratio in enumerate(ratios) if ratio is not None and math.isfinite(ratio)]
    if any(verdict == "differs" and i not in known for i, verdict in enumerate(summary.verdicts)):
        return NOTHING  # the sentence names outputs of which there is no ratio
    picked = [i for i in known if summary.verdicts[i] == verdict] or known
    if not picked:
        return NOTHING
    worst = max(picked, key=lambda i: abs((ratios[i] or 1.0) - 1.0))
    intervals = summary.sigma_ratio_paired_interval
    of = f"Monte Carlo σ / linear σ of {humanize(summary.names[worst])}"
    return _ratio(ratios[worst], intervals[worst] if worst < len(intervals) else None, of, summary.tolerance)


def _jointly(summary: Summary) -> Worst:
    """Return the number that shows why all outputs together are not as linear analysis says."""
    joint = summary.joint
    foremost = None if joint is None else joint.foremost
    if joint is None or foremost is None:
        return NOTHING
    words = combination_words(foremost, summary, BRIEFLY)
    if joint.cause == "mean":
        return Worst(f"{number(joint.mean_error, DIGITS)} σ", f"mean error of {words}")
    if joint.cause == "unpredicted":
        scale, unit = shown_units(summary)[foremost.lead]
        simulated, linear = (number(each * scale, DIGITS) for each in (foremost.sigma_paired, foremost.sigma_linear))
        return Worst(f"{simulated} {unit}".strip(), f"σ of {words}; linear σ {linear} {unit}".strip())
    if summary.direction_ratio is None:
        return NOTHING
    return _ratio(summary.direction_ratio, None, f"Monte Carlo σ / linear σ of {words}", summary.tolerance)


def headline(tile: Tile) -> str:
    """Put a verdict in the few words that a page's title has room for.

    >>> headline(Tile("Filter", "optimistic", "differs", "The filter is optimistic by a factor of 10."))
    'Filter optimistic'
    """
    return f"{tile.subject} {tile.status}"
