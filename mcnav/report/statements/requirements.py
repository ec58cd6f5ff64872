"""The requirement that matters most, in words, and requirements in one short row each."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from mcnav.analysis.filter_remarks import instant
from mcnav.report.columns.requirements import RADII, RequirementRow, nominal_of, requirement_rows
from mcnav.report.format import number, rounded
from mcnav.report.names import humanize

if TYPE_CHECKING:
    from mcnav.analysis.summary import RequirementEntry, Summary
    from mcnav.arrays.types import Array
    from mcnav.report.columns.requirements import NamedRequirement

DIGITS: Final = 3
"""Significant digits of estimates."""

FINDINGS: Final = ("not met", "undecided", "met for the known ways", "met")
"""Findings on requirements, the worst first."""

NAMED: Final = 2
"""Outputs of a requirement that its short form names."""

CLEARLY: Final = 1.1
"""Multiple of a limit from which the size of a normal error is said to exceed it: errors may not be normal."""

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


def requirement_in_brief(row: RequirementRow, epochs: Mapping[str, Array] | None = None) -> str:
    """Write a requirement in one short row: what it limits, the estimate, the limit, and when errors exceed it before.

    ``epochs``: columns over time, where they are stored.
    """
    entry = row.entry
    limit = f"at least {100.0 * (entry.probability or 0.0):g} %" if entry.kind == "box" else limit_words(row)
    value = "–" if entry.estimate is None else three_digits(row, entry.estimate)
    stated = f"{value}{_with_nominal(row)}{_largest_at(row)}, {limit}{_exceeded_before(row, epochs)}"
    return f"{limited_in_brief(entry)}{_at_the_end(row, epochs)}: {stated}"


def _at_the_end(row: RequirementRow, epochs: Mapping[str, Array] | None) -> str:
    """Say that a value is of the end, where navigation errors before it are known too."""
    entry = row.entry
    names = {output.name for output in row.summary.outputs if output.of == "navigation"}
    if not row.time_unit or entry.epochs or entry.when or not entry.outputs or not set(entry.outputs) <= names:
        return ""
    label = f"time [{row.time_unit}]"
    known = label in (epochs or {})
    return f", at {instant(float((epochs or {})[label][-1]), label)}" if known else ", at the end"


def _exceeded_before(row: RequirementRow, epochs: Mapping[str, Array] | None) -> str:
    """Say when errors before the end are the largest, if a limit that holds at the end is exceeded there."""
    known = None if epochs is None else larger_before_the_end(row, epochs)
    if known is None:
        return ""
    time, size = known
    return f"; ≈ {three_digits(row, size)} at {instant(time, f'time [{row.time_unit}]')}"


def _largest_at(row: RequirementRow) -> str:
    """Say when a value over time is the largest."""
    time = row.entry.time
    return "" if time is None else f" at {instant(time, f'time [{row.time_unit}]')}"


def _with_nominal(row: RequirementRow) -> str:
    """Give the nominal that is a part of a value, and by what its errors may be multiplied; else nothing."""
    multiple = margin(row)
    if multiple is None or row.entry.about or len(row.entry.outputs) != 1:
        return ""
    nominal = abs(float(nominal_of(row.summary, row.entry.outputs)[0]))
    if nominal <= NEGLIGIBLE * (row.entry.estimate or 0.0):
        return ""
    return f" (nominal {number(nominal * row.scale, DIGITS)}, × {rounded(multiple)})"


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
    words = "; ".join(filter(None, (f"errors may be × {rounded(multiple)}" if multiple else "", bounded)))
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


def larger_before_the_end(row: RequirementRow, epochs: Mapping[str, Array]) -> tuple[float, float] | None:
    """Return when errors before the end are the largest, and the size that a requirement at the end limits then, SI.

    The size is that of a normal error with the mean and sigma of the samples. Of a radius it is the quantile of its
    largest component: the radius is at least as large. None where it is not above the limit by `CLEARLY`, where the
    requirement holds at epochs, or of outputs other than navigation errors.
    """
    entry, limit = row.entry, row.entry.limits[0]
    names = {output.name: output.unit for output in row.summary.outputs if output.of == "navigation"}
    times = next((values for name, values in epochs.items() if name.startswith("time [")), None)
    held = entry.epochs or entry.when or entry.about or entry.kind in ("box", "sigma_ratio")
    if (
        times is None
        or held
        or not set(entry.outputs) <= set(names)
        or (len(entry.outputs) > 1 and entry.kind not in RADII)
    ):
        return None
    from mcnav.statistics.normal_size import size_quantiles  # which other pages do not need

    probability = {"cep": 0.5, "sep": 0.5, "r95": 0.95}.get(entry.kind, entry.probability or 0.0)
    sizes = []
    for name in entry.outputs:
        mean, sigma = (epochs.get(f"{kind} {name} [{names[name]}]") for kind in ("mean", "sigma"))
        if mean is None or sigma is None or not np.isfinite(mean + sigma).all():
            return None
        sizes.append(size_quantiles(mean[:, None], (sigma**2)[:, None, None], probability, instead=0.0))
    largest = np.max(sizes, axis=0)
    worst = int(largest[:-1].argmax()) if len(largest) > 1 else 0
    return (float(times[worst]), float(largest[worst])) if largest[worst] > CLEARLY * limit else None


def capitalized(words: str) -> str:
    """Begin with a capital letter."""
    return f"{words[:1].upper()}{words[1:]}"
