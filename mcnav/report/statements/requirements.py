"""The requirement that matters most, in words, and requirements in one short row each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from mcnav.report.columns.requirements import RADII, RequirementRow, nominal_of, requirement_rows
from mcnav.report.format import number, rounded
from mcnav.report.names import humanize

if TYPE_CHECKING:
    from mcnav.analysis.summary import RequirementEntry, Summary
    from mcnav.report.columns.requirements import NamedRequirement

DIGITS: Final = 3
"""Significant digits of estimates."""

FINDINGS: Final = ("not met", "undecided", "met for the known ways", "met")
"""Findings on requirements, the worst first."""

NAMED: Final = 2
"""Outputs of a requirement that its short form names."""

NEGLIGIBLE: Final = 0.01
"""Largest size of nominal outputs, as a share of a size, that is left out of a margin."""


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
        multiple = margin(row)
        used = estimate / limit if limit else math.inf
        return used if multiple is None else 1.0 / multiple if multiple else math.inf
    allowed = 1.0 - (entry.probability or 0.0)
    return (1.0 - estimate) / allowed if allowed else math.inf


def requirement_in_brief(row: RequirementRow) -> str:
    """Write a requirement in one short row: what it limits, the estimate, and the limit."""
    entry = row.entry
    limit = f"at least {100.0 * (entry.probability or 0.0):g} %" if entry.kind == "box" else limit_words(row)
    value = "–" if entry.estimate is None else three_digits(row, entry.estimate)
    return f"{limited_in_brief(entry)}: {value}, {limit}"


def limited_in_brief(entry: NamedRequirement | RequirementEntry) -> str:
    """Say in a few words what a requirement limits, and when."""
    names = _together(entry.outputs) if entry.outputs else ""
    percent = f"{100.0 * (entry.probability or 0.0):g} %"
    measure = percent if entry.kind == "quantile" else measure_words(entry)
    what = f"{names}, {measure}" if entry.kind == "quantile" else f"{measure} of {names}" if names else measure
    return f"{what}, {entry.when}" if entry.when else what


def _together(outputs: Sequence[str]) -> str:
    """Name outputs, what their names begin with alike once.

    >>> _together(["position_north", "position_east"]), _together(["altitude", "range"]), _together(["x", "y", "z"])
    ('position north, east', 'altitude, range', 'x, y and 1 more')
    """
    more = f" and {len(outputs) - NAMED} more" if len(outputs) > NAMED else ""
    return ", ".join(named_together(outputs[:NAMED])) + more


def named_together(outputs: Sequence[str]) -> list[str]:
    """Name outputs, each without what the name of the first begins with."""
    first, *others = map(humanize, outputs)
    start = f"{first.rpartition(' ')[0]} "
    return [first, *(name.removeprefix(start) for name in others)]


def measure_words(entry: NamedRequirement | RequirementEntry) -> str:
    """Name what a requirement limits in a word or two."""
    if entry.kind in RADII:
        return entry.kind.upper()
    return {"sigma_ratio": "sigma ratio", "box": "within the limits"}.get(
        entry.kind, f"{100.0 * (entry.probability or 0.0):g} % quantile"
    )


def limit_words(row: RequirementRow) -> str:
    """Write the limit of a requirement."""
    limit = row.entry.limits[0]
    return f"limit ±{100.0 * limit:g} %" if row.entry.kind == "sigma_ratio" else f"limit {_plain(row, limit)}"


def _plain(row: RequirementRow, value: float) -> str:
    return row.with_unit(f"{value * row.scale:g}")


def three_digits(row: RequirementRow, value: float | None) -> str:
    """Write a number of a requirement with three digits, or with as many as tell it from its bounds."""
    if value is None or not math.isfinite(value):
        return "∞"
    if row.entry.kind == "box":
        return f"{100.0 * value:.3g} %" if value < 0.999 else f"{100.0 * value:.4g} %"
    return row.with_unit(number(value * row.scale, _digits(row)))


def _digits(row: RequirementRow) -> int:
    """Return the digits with which the estimate and its bounds differ: three, or one more."""
    values = [value for value in (row.entry.estimate, *row.entry.interval) if value is not None]
    alike = len({number(value * row.scale, DIGITS) for value in values}) < len(set(values))
    return DIGITS + alike


def confidence_words(row: RequirementRow) -> str:
    """Say by how much a requirement is met or missed, and what the samples bound it by.

    A bound is one-sided, of the confidence of the run.
    """
    entry, (low, high) = row.entry, row.entry.interval
    confidence = f"{100.0 * row.summary.confidence:g} % confidence"
    if entry.kind == "box":
        return f"With {confidence} at least {three_digits(row, low)}." if low is not None else ""
    if entry.kind == "sigma_ratio":  # an interval is what it is decided by
        return ""
    multiple, bound = margin(row), low if entry.finding == "not met" else high
    side = "at least" if entry.finding == "not met" else "at most"
    bounded = "" if bound is None else f"with {confidence} {side} {three_digits(row, bound)}"
    words = "; ".join(filter(None, (f"Margin × {rounded(multiple)}" if multiple else "", bounded)))
    return f"{capitalized(words)}." if words else ""


def margin(row: RequirementRow, value: float | None = None) -> float | None:
    """Return the multiple of all errors at which a size would be the limit; none where it is not known.

    ``value`` is the size, SI; by default the estimate.

    The size of an output is that of its nominal `n` and of its error. Where the limit is beyond `n` by less than `n`,
    one tail of the errors decides, and the multiple is `(limit - |n|) / (value - |n|)`. It is the margin of
    `mcnav lincov`, with samples in place of a normal distribution.
    """
    entry, limit = row.entry, row.entry.limits[0]
    value = entry.estimate if value is None else value
    if entry.kind in ("box", "sigma_ratio") or not value or not math.isfinite(value):
        return None
    size = 0.0 if entry.about else math.hypot(*nominal_of(row.summary, entry.outputs))
    if size <= NEGLIGIBLE * value:
        return limit / value
    alone = entry.kind == "quantile" and len(entry.outputs) == 1 and entry.time is None
    if alone and limit - size <= size < min(limit, value):
        return (limit - size) / (value - size)
    return None


def capitalized(words: str) -> str:
    """Begin with a capital letter."""
    return f"{words[:1].upper()}{words[1:]}"
