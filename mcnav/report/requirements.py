"""Requirements and their results as rows of tables."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, Final

from mcnav.analysis.filter_causes import MEAN
from mcnav.report import sentences
from mcnav.report.format import number
from mcnav.report.model import RunAnalysis, humanize, labels_in, shown_units

RADII: Final = {
    "cep": "circular error probable",
    "r95": "radius of 95 % of the errors",
    "sep": "spherical error probable",
}
"""Radii about zero that requirements limit, by kind."""

NAMED: Final = 3
"""Causes that are named beside a number."""

TONES: Final = {"met": "agrees", "not met": "differs", "undecided": "undecided"}


def tone_of(counts: Mapping[str, int]) -> str:
    """Return ``agrees`` when all requirements are met, ``differs`` when one is not met, else ``undecided``."""
    return "differs" if counts["not_met"] else "undecided" if counts["undecided"] else "agrees"


def stated(entry: Mapping[str, Any], shown_in: Mapping[str, tuple[float, str]]) -> str:
    """Put one of a summary's ``requirements`` in words; ``shown_in`` is that of `shown_units`."""
    names, limits = entry["outputs"], entry["limits"]
    if entry["kind"] == "sigma_ratio":
        return f"every sigma within ±{100.0 * limits[0]:g} % of the linear one"
    when = f", {entry['when']}" if entry.get("when") else ""
    if entry["kind"] in RADII:
        scale, unit = shown_in[names[0]]
        together = f"{', '.join(map(humanize, names[:-1]))} and {humanize(names[-1])}"
        return f"{RADII[entry['kind']]} of {together} below {limits[0] * scale:g} {unit}{when}"
    sides = []
    for name, limit in zip(names, limits, strict=True):
        scale, unit = shown_in[name]
        sides.append(f"|{humanize(name)}| below {limit * scale:g} {unit}")
    return f"{' and '.join(sides)} in {100.0 * entry['probability']:g} % of samples{when}"


def requirement_causes(summary: Mapping[str, Any], entry: Mapping[str, Any]) -> list[tuple[str, float]]:
    """List the largest causes of the errors that a requirement of a summary limits, for people, with their shares."""
    sources = [source["name"] for source in summary["sources"]]
    labels = dict(zip(sources, labels_in(summary), strict=True))
    causes = []
    for cause in list(entry.get("causes") or ())[:NAMED]:
        name = str(cause["name"]).removeprefix(MEAN)
        of_mean = "mean of " if name != cause["name"] else ""
        causes.append((f"{of_mean}{labels.get(name, humanize(name))}", float(cause["share"])))
    return causes


def listed(causes: Sequence[tuple[str, float]]) -> str:
    """List causes with their shares in one line.

    >>> listed([("gyro bias z", 0.2113), ("heading", 0.05)])
    'gyro bias z 21.1 %, heading 5 %'
    """
    return ", ".join(f"{name} {100.0 * share:.3g} %" for name, share in causes) or "–"


def requirement_rows(summary: Mapping[str, Any]) -> list[dict[str, Any]]:
    """List the requirements with their findings, one per row."""
    units = shown_units(summary)
    keys = ("finding", "samples_needed", "remark")
    return [
        {
            "requirement": stated(entry, units),
            **{key: entry[key] for key in keys},
            "causes": requirement_causes(summary, entry),
        }
        for entry in summary["requirements"]
    ]


def detailed_rows(content: RunAnalysis) -> list[dict[str, Any]]:
    """Add to `requirement_rows` the estimates in the units shown, the linear values and the largest source sigmas."""
    summary, rows = content.summary, []
    units = shown_units(summary)
    for row, entry in zip(requirement_rows(summary), summary["requirements"], strict=True):
        low, high = entry["interval"]
        shown = partial(_shown, entry["kind"], *units[entry["outputs"][0]])
        needed = row["samples_needed"]
        rows.append(
            row
            | {"estimate": shown(entry["estimate"], "–"), "low": shown(low), "high": shown(high)}
            | {
                "tone": TONES[row["finding"]],
                "largest_at": _largest_at(content, entry),
                "linear": shown(entry["linear"], "–"),
                "gaussian": "–"
                if entry["kind"] == "sigma_ratio" or entry["linear"] is None
                else "met"
                if entry["linear_meets"]
                else "not met",
                "needed": needed and sentences.more_samples(needed, summary["samples"]),
                "largest": [] if entry["largest_sigmas"] is None else _largest(content, entry["largest_sigmas"]),
            }
        )
    return rows


def _largest_at(content: RunAnalysis, entry: Mapping[str, Any]) -> str:
    """Return when a requirement over time has its largest estimate, and of how many samples; else empty."""
    if entry.get("time") is None or content.development is None:
        return ""
    unit = content.development.label.partition(" [")[2].removesuffix("]")
    return f"largest at {entry['time']:.4g} {unit}, of {entry['samples']:,} samples"


def _shown(kind: str, scale: float, unit: str, value: float | None, missing: str = "∞") -> str:
    """Format a value of a requirement: a ratio, a probability, or an error in the unit shown."""
    if kind == "sigma_ratio":
        return number(value, 5)
    if value is None or not math.isfinite(value):
        return "–" if kind == "box" else missing
    return f"{100.0 * value:.3f} %" if kind == "box" else f"{number(value * scale, 4)} {unit}"


def _largest(content: RunAnalysis, sigmas: Any) -> list[tuple[str, str, str]]:
    """List each source with its sigma and the largest one that meets the requirement."""
    rows = []
    for j, now in enumerate(content.model.covariance.diagonal() ** 0.5):
        if now > 0.0:
            scale, unit, largest = content.source_scale[j], content.source_units[j], float(sigmas[j])
            words = "none" if math.isnan(largest) else "any" if math.isinf(largest) else ""
            rows.append((content.source_names[j], f"{number(now * scale)} {unit}",
                         words or f"{number(largest * scale)} {unit}"))  # fmt: skip
    return rows
