"""The verdict on a filter, from a run's summary: `mcnav.analysis.filter_remarks` states it, this adds the numbers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from mcnav.report.format import number
from mcnav.report.model import humanize

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


def verdict(summary: Mapping[str, Any]) -> str:
    """Return the verdict on the filter in one word; empty without a filter."""
    return str(summary["filter"]["verdict"]) if summary.get("filter") else ""


def comes_first(summary: Mapping[str, Any], tone: str) -> bool:
    """Return whether the verdict on the filter is told before that on linear analysis: where it is the worse one.

    >>> comes_first({"filter": {"verdict": "optimistic"}}, "undecided"), comes_first({"filter": None}, "agrees")
    (True, False)
    """
    word = verdict(summary)
    return bool(word) and WORSE.index(TONES[word]) > WORSE.index(tone)


def headline(summary: Mapping[str, Any]) -> str:
    """State the verdict on the filter; empty without a filter."""
    return str(summary["filter_verdict"]) if summary.get("filter") else ""


def explanation(summary: Mapping[str, Any]) -> str:
    """Name what makes the filter optimistic, and what else there is to say; empty where there is nothing."""
    result = summary.get("filter")
    if not result:
        return ""
    stated = headline(summary).lower()
    remarks = [remark for remark in result["remarks"] if remark.lower() not in stated]
    return " ".join(filter(None, [_neglected(result), *remarks]))


def _neglected(neglected: Mapping[str, Any]) -> str:
    """Name the errors that make a filter optimistic, with their shares; empty where the verdict names the only one."""
    named = [each for each in neglected["neglected"] if each["share"] >= LEAST][:NAMED]
    shares = [f"{humanize(each['name'])} {100.0 * each['share']:.0f} %" for each in named]
    return f"Neglected errors: {', '.join(shares)}." if len(shares) > 1 else ""


def worst_sigmas(name: str, when: str, true: float, stated: float, unit: str) -> str:
    """Compare the true sigma of an output at an instant with the filter's; the factor is that of the output alone.

    >>> worst_sigmas("position_north", "25 min", 24.91, 7.53, "m")
    'At 25 min the sigma of position north is 24.9 m; the filter states 7.53 m (factor of this output alone: 3.31).'
    """
    shown = f"{number(true, 3)} {unit}; the filter states {number(stated, 3)} {unit}"
    factor = max(true, stated) / min(true, stated) if true * stated > 0.0 else 0.0
    alone = f" (factor of this output alone: {factor:.3g})" if factor else ""
    return f"At {when} the sigma of {humanize(name)} is {shown}{alone}."
