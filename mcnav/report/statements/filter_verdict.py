"""The verdict on a filter, from a run's summary: `mcnav.analysis.filter_remarks` states it, this adds the numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from mcnav.analysis.filter_consistency import cause_words
from mcnav.analysis.filter_remarks import three_digits
from mcnav.report.format import number
from mcnav.report.names import humanize

if TYPE_CHECKING:
    from mcnav.analysis.summary import FilterSummary, Summary

TONES: Final = {
    "consistent": "agrees", "optimistic": "differs", "pessimistic": "partly", "undecided": "undecided",
}  # fmt: skip
"""Colours of the verdicts, by those of linear analysis."""

WORSE: Final = ("agrees", "undecided", "partly", "differs")
"""These colours, the worst last."""

NAMED: Final = 3
"""Neglected errors that are named."""

LEAST: Final = 0.01
"""Smallest share of one that is named."""


def verdict(summary: Summary) -> str:
    """Return the verdict on the filter in one word; empty without a filter."""
    return summary.filter.verdict if summary.filter else ""


def headline(summary: Summary) -> str:
    """State the verdict on the filter; empty without a filter."""
    return summary.filter_verdict if summary.filter else ""


def explanation(summary: Summary) -> str:
    """Name what makes the filter optimistic, and what else there is to say; empty where there is nothing."""
    result = summary.filter
    if not result:
        return ""
    stated = headline(summary).lower()
    remarks = [remark for remark in result.remarks if remark.lower() not in stated]
    return " ".join(filter(None, [_neglected(result), *remarks]))


def _neglected(result: FilterSummary) -> str:
    """Name the errors that make a filter optimistic, with their shares; empty where the verdict names the only one."""
    named = [each for each in result.neglected if each.share >= LEAST][:NAMED]
    shares = [f"{cause_words(each.name)} {100.0 * each.share:.0f} %" for each in named]
    return f"Neglected errors: {', '.join(shares)}." if len(shares) > 1 else ""


def worst_sigmas(name: str, when: str, true: float, stated: float, unit: str) -> str:
    """Compare the true sigma of an output at an instant with the filter's; the factor is that of the output alone.

    >>> worst_sigmas("position_north", "25 min", 24.91, 7.53, "m")
    'At 25 min 1σ of position north is 24.9 m; the filter states 7.53 m (factor of this output alone: 3.31).'
    """
    shown = f"{number(true, 3)} {unit}; the filter states {number(stated, 3)} {unit}"
    factor = max(true, stated) / min(true, stated) if true * stated > 0.0 else 0.0
    alone = f" (factor of this output alone: {three_digits(factor)})" if factor else ""
    return f"At {when} 1σ of {humanize(name)} is {shown}{alone}."
