"""The verdict on a filter in sentences, from the entry ``filter`` of a run's summary."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from mcnav.report.format import number
from mcnav.report.model import humanize
from mcnav.statistics.power import sensible_step

TONES: Final = {
    "consistent": "agrees", "optimistic": "differs", "pessimistic": "partly", "undecided": "undecided",
}  # fmt: skip
"""Colours of the verdicts, as those of linear analysis have them."""

GROUPS: Final[Mapping[str, str]] = {
    "all": "all estimated states", "navigation": "the navigation errors",
    "sensors": "the errors of instruments and sensors",
}  # fmt: skip
"""Groups of states in sentences, where their names do not say it."""

NAMED: Final = 3
"""Neglected errors that are named."""

LEAST: Final = 0.01
"""Smallest share of one that is named."""


def verdict_of(summary: Mapping[str, Any]) -> str:
    """Return the verdict on the filter of a summary in one word; empty without a filter."""
    found = summary.get("filter")
    return str(found["verdict"]) if found else ""


def headline(summary: Mapping[str, Any]) -> str:
    """Summarize the verdict on the filter; empty without a filter."""
    found = summary.get("filter")
    if not found:
        return ""
    verdict, factor = found["verdict"], found["factor"]
    if verdict == "consistent":
        return "Filter: consistent."
    if verdict == "undecided" or factor is None:
        return f"Filter: {verdict}."
    size = factor if verdict == "optimistic" else 1.0 / factor
    return f"Filter: {verdict} by a factor of {size:.3g} in {group_words(found['group'])}{_when(found)}."


def group_words(group: str) -> str:
    """Name a group of states in a sentence."""
    return GROUPS.get(group, humanize(group))


def _when(found: Mapping[str, Any]) -> str:
    """Say from when to when the departure is certain."""
    begin, end = found["begin"], found["end"]
    if begin is None or end is None:
        return ""
    if end >= found["last"]:
        return f" from {instant(begin, found['label'])} on"
    if begin == end:
        return f" at {instant(begin, found['label'])}"
    return f" from {instant(begin, '')} to {instant(end, found['label'])}"


def instant(time: float, label: str) -> str:
    """Format an instant in the unit of a label ``name [unit]``.

    >>> instant(1500.0, "time [s]"), instant(24.5, "time [min]")
    ('1,500 s', '24.5 min')
    """
    unit = label.partition(" [")[2].removesuffix("]")
    return f"{time:,.5g} {unit}".rstrip().replace("-", "−")


def explanation(summary: Mapping[str, Any]) -> str:
    """Explain the verdict on the filter with numbers; empty without a filter."""
    found = summary.get("filter")
    if not found:
        return ""
    confidence, limit = f"{100.0 * found['confidence']:g} % confidence", f"±{100.0 * found['tolerance']:g} %"
    samples = f"{found['samples']:,} samples"
    if found["verdict"] == "consistent":
        sentences = [
            f"In position, velocity and attitude the true sigmas of {samples} are within {limit} of the filter's at "
            f"every epoch ({confidence})."
            if {"position", "velocity", "attitude"} <= set(found["groups"])
            else f"The true sigmas of {samples} are within {limit} of the filter's at every epoch ({confidence})."
        ]
    elif found["verdict"] == "undecided":
        needed = found["samples_needed"]
        reason = f"about {sensible_step(needed, found['samples']):,} samples would decide" if needed else ""
        sentences = [f"With {samples}, {confidence} and a tolerance of {limit}: {reason}." if reason else ""]
    else:
        sentences = [_worst(found)]
    return " ".join(filter(None, [*sentences, neglected(summary), *found["remarks"]]))


def _worst(found: Mapping[str, Any]) -> str:
    """Give the true sigma and the filter's where they differ most."""
    if found["worst"] is None or not found["output"]:
        return ""
    name, unit = humanize(found["output"]), found["unit"]
    true, stated = (f"{number(found[key], 3)} {unit}" for key in ("sigma_true", "sigma_filter"))
    return f"At {instant(found['worst'], found['label'])} the sigma of {name} is {true}; the filter states {stated}."


def neglected(summary: Mapping[str, Any]) -> str:
    """Name the errors that make a filter optimistic, with their shares; empty where they are not known."""
    found = summary.get("filter")
    named = [each for each in (found or {}).get("neglected") or () if each["share"] >= LEAST][:NAMED]
    if not named:
        return ""
    shares = [f"{humanize(each['name'])} {100.0 * each['share']:.0f} %" for each in named]
    return f"Neglected: {', '.join(shares)}."
