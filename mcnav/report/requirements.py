"""Requirements and what was found of them, in words and as rows of a table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from mcnav.report import sentences
from mcnav.report.format import number
from mcnav.report.model import RunAnalysis, humanize
from mcnav.units import conversion

TONES: Final = {"met": "agrees", "not met": "differs", "undecided": "undecided"}


def tone_of(counts: Mapping[str, int]) -> str:
    """``agrees`` when all requirements are met, ``differs`` when one is not, else ``undecided``."""
    return "differs" if counts["not_met"] else "undecided" if counts["undecided"] else "agrees"


def stated(entry: Mapping[str, Any], shown_in: Mapping[str, tuple[float, str]]) -> str:
    """A requirement of a summary in words.

    Parameters
    ----------
    entry : mapping
        Of the summary's ``requirements``.
    shown_in : mapping of str to (float, str)
        For each output what SI values are multiplied by to be shown, and the unit.
    """
    names, limits = entry["outputs"], entry["limits"]
    if entry["kind"] == "sigma_ratio":
        return f"every sigma within ±{100.0 * limits[0]:g} % of the linear one"
    scale, unit = shown_in[names[0]]
    if entry["kind"] == "cep":
        pair = f"{humanize(names[0])} and {humanize(names[1])}"
        return f"circular error probable of {pair} below {limits[0] * scale:g} {unit}"
    chance = f"{100.0 * entry['probability']:g} %"
    if entry["kind"] == "quantile":
        return f"|{humanize(names[0])}| below {limits[0] * scale:g} {unit} in {chance} of flights"
    sides = [
        f"|{humanize(name)}| below {limit * shown_in[name][0]:g} {shown_in[name][1]}"
        for name, limit in zip(names, limits, strict=True)
    ]
    return f"{' and '.join(sides)} in {chance} of flights"


def shown_units(summary: Mapping[str, Any]) -> dict[str, tuple[float, str]]:
    """For each output of a summary the factor from SI and the unit that it is shown in."""
    outputs = summary["outputs"]
    shown = summary["shown_in"]["outputs"] if "shown_in" in summary else [entry["unit"] for entry in outputs]
    return {entry["name"]: (conversion(entry["unit"], unit), unit) for entry, unit in zip(outputs, shown, strict=True)}


def _cells(entry: Mapping[str, Any], scale: float, unit: str) -> dict[str, str]:
    """Estimate, bounds and the linear value, in the unit of the requirement."""

    def size(value: float | None) -> str:
        if entry["kind"] == "box":
            return "–" if value is None or not np.isfinite(value) else f"{100.0 * value:.3f} %"
        if entry["kind"] == "sigma_ratio":
            return number(value, 5)
        return "∞" if value is None or not np.isfinite(value) else f"{number(value * scale, 4)} {unit}"

    low, high = entry["interval"]
    estimate = entry["estimate"]
    flown = "–" if estimate is None or not np.isfinite(estimate) else size(estimate)
    return {"estimate": flown, "low": size(low), "high": size(high), "linear": size(entry["linear"])}


def requirement_rows(content: RunAnalysis) -> list[dict[str, Any]]:
    """One row for each requirement."""
    units = {
        output.name: (float(scale), output.shown_in)
        for output, scale in zip(content.manifest.model.outputs, content.output_scale, strict=True)
    }
    rows = []
    for entry in content.summary["requirements"]:
        scale, unit = units[entry["outputs"][0]]
        largest = entry["largest_sigmas"]
        rows.append(
            {
                "stated": stated(entry, units),
                "finding": entry["finding"],
                "tone": TONES[entry["finding"]],
                **_cells(entry, scale, unit),
                "gaussian": "–" if entry["kind"] == "sigma_ratio" else ("met" if entry["linear_meets"] else "not met"),
                "remark": entry["remark"],
                "needed": (needed := entry["samples_needed"])
                and sentences.more_samples(needed, content.summary["samples"]),
                "largest": [] if largest is None else _largest(content, np.array(largest, dtype=float)),
            }
        )
    return rows


def _largest(content: RunAnalysis, sigmas: Any) -> list[dict[str, str]]:
    """How large each source's sigma may be, beside what it is."""
    now = np.sqrt(np.diag(content.model.covariance))
    return [
        {
            "name": content.source_names[j],
            "now": f"{number(float(now[j] * content.source_scale[j]))} {content.source_units[j]}",
            "largest": "none" if np.isnan(sigmas[j]) else "any" if np.isinf(sigmas[j])
            else f"{number(float(sigmas[j] * content.source_scale[j]))} {content.source_units[j]}",
        }
        for j in np.flatnonzero(now > 0.0)
    ]  # fmt: skip
