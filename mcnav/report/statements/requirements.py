"""The requirement that matters most, in words, and requirements in one short row each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from mcnav.report.columns.requirements import RADII, RequirementRow, requirement_rows
from mcnav.report.format import number, rounded
from mcnav.report.names import humanize

if TYPE_CHECKING:
    from mcnav.analysis.summary import Summary

DIGITS: Final = 3
"""Significant digits of estimates."""

FINDINGS: Final = ("not met", "undecided", "met for the known ways", "met")
"""Findings on requirements, the worst first."""

NAMED: Final = 2
"""Outputs of a requirement that its short form names."""


def worst_requirement(summary: Summary, time_unit: str = "") -> RequirementRow | None:
    """Return the requirement with the worst finding; among equals, the one closest to its limit."""
    return min(requirement_rows(summary, "shown", time_unit), key=worst_first, default=None)


def worst_first(row: RequirementRow) -> tuple[int, float]:
    """Return by what requirements are sorted, the worst first."""
    return FINDINGS.index(row.entry.finding), -_used(row)


def _used(row: RequirementRow) -> float:
    """Return the share of what is allowed that an estimate uses; infinity where it is not known."""
    entry = row.entry
    estimate, limit = entry.estimate, entry.limits[0]
    if estimate is None or not math.isfinite(estimate):
        return math.inf
    if entry.kind == "sigma_ratio":
        return abs(estimate - 1.0) / limit if limit else math.inf
    if entry.kind != "box":
        return estimate / limit if limit else math.inf
    allowed = 1.0 - (entry.probability or 0.0)
    return (1.0 - estimate) / allowed if allowed else math.inf


def requirement_in_brief(row: RequirementRow) -> str:
    """Write a requirement in one short row: what it limits, the estimate, and the limit."""
    entry = row.entry
    names = _together(entry.outputs) if entry.outputs else ""
    limit = f"at least {100.0 * (entry.probability or 0.0):g} %" if entry.kind == "box" else limit_words(row)
    value = "–" if entry.estimate is None else three_digits(row, entry.estimate)
    measure = f"{100.0 * (entry.probability or 0.0):g} %" if entry.kind == "quantile" else measure_words(row)
    what = f"{names}, {measure}" if entry.kind == "quantile" else f"{measure} of {names}" if names else measure
    when = f", {entry.when}" if entry.when else ""
    return f"{what}{when}: {value}, {limit}"


def _together(outputs: Sequence[str]) -> str:
    """Name outputs, what their names begin with alike once.

    >>> _together(["position_north", "position_east"]), _together(["altitude", "range"]), _together(["x", "y", "z"])
    ('position north, east', 'altitude, range', 'x, y and 1 more')
    """
    first, *others = (humanize(name) for name in outputs[:NAMED])
    start = f"{first.rpartition(' ')[0]} "
    more = f" and {len(outputs) - NAMED} more" if len(outputs) > NAMED else ""
    return ", ".join([first, *(name.removeprefix(start) for name in others)]) + more


def measure_words(row: RequirementRow) -> str:
    """Name what a requirement limits in a word or two."""
    kind = row.entry.kind
    if kind in RADII:
        return kind.upper()
    return {"sigma_ratio": "sigma ratio", "box": "within the limits"}.get(
        kind, f"{100.0 * (row.entry.probability or 0.0):g} % quantile"
    )


def limit_words(row: RequirementRow) -> str:
    """Write the limit of a requirement."""
    limit = row.entry.limits[0]
    return f"limit ±{100.0 * limit:g} %" if row.entry.kind == "sigma_ratio" else f"limit {_plain(row, limit)}"


def _plain(row: RequirementRow, value: float) -> str:
    return row.with_unit(f"{value * row.scale:g}")


def three_digits(row: RequirementRow, value: float | None) -> str:
    """Write a number of a requirement with three digits; a probability with as many as it needs."""
    if value is None or not math.isfinite(value):
        return "∞"
    if row.entry.kind == "box":
        return f"{100.0 * value:.3g} %" if value < 0.999 else f"{100.0 * value:.4g} %"
    return row.with_unit(number(value * row.scale, DIGITS))


def confidence_words(row: RequirementRow) -> str:
    """Say by how much a requirement is met or missed, and what the samples bound it by.

    A bound is one-sided, of the confidence of the run.
    """
    entry, (low, high) = row.entry, row.entry.interval
    confidence = f"{100.0 * row.summary.confidence:g} % confidence"
    if entry.kind == "box":
        return f"With {confidence} at least {three_digits(row, low)}." if low is not None else ""
    margin = f"Margin × {rounded(entry.limits[0] / entry.estimate)}; " if entry.estimate else ""
    bound = low if entry.finding == "not met" else high
    side = "at least" if entry.finding == "not met" else "at most"
    words = f"{margin}with {confidence} {side} {three_digits(row, bound)}." if bound is not None else margin
    return capitalized(words)


def capitalized(words: str) -> str:
    """Begin with a capital letter."""
    return f"{words[:1].upper()}{words[1:]}"
