"""Captions of figures over time, a sentence each; see `mcnav.report.figures.captions`."""

from __future__ import annotations

import numpy as np

from mcnav.analysis.filter_remarks import instant
from mcnav.report.columns.requirements import RequirementRow, requirement_rows
from mcnav.report.figures import filter_captions
from mcnav.report.figures.requirements import measure
from mcnav.report.figures.sources import variance_over_time
from mcnav.report.format import rounded
from mcnav.report.names import humanize
from mcnav.report.results.kinds import quantities
from mcnav.report.results.model import RunAnalysis
from mcnav.report.statements.words import joined


def development(content: RunAnalysis) -> str:
    """Say of which outputs the linear sigma, but for its start, is largest at the end, and of one that is not when."""
    known, moving = content.development, content.moving
    if known is None or not moving or len(known.times) < 2:
        return ""
    sigma = np.sqrt(variance_over_time(content))[:, moving]
    peaks = 1 + np.argmax(np.nan_to_num(sigma[1:]), axis=0)
    early = np.flatnonzero(sigma[peaks, np.arange(len(moving))] > (1.0 + 1e-9) * sigma[-1])
    later = bool((sigma[0] > sigma[1:].max(axis=0)).any())
    if not len(early):
        return f"By linear analysis every sigma {'but for its start ' if later else ''}is largest at the end."
    place = int(early[np.argmax([sigma[peaks[k], k] / max(sigma[-1, k], 1e-300) for k in early])])
    output, at = moving[place], instant(float(known.times[peaks[place]]), known.label)
    largest = float(sigma[peaks[place], place]) * content.output_scale[output]
    size = f"{rounded(largest)} {content.output_units[output]}".strip()
    verb, when = "is" if len(early) == 1 else "are", "after the start, but before" if later else "before"
    return (
        f"By linear analysis {len(early)} of {len(moving)} sigmas {verb} largest {when} the end. "
        f"1σ of {content.output_names[output]} is {size} at {at}."
    )


def envelopes(content: RunAnalysis) -> str:
    """Say where linear and Monte Carlo sigma are farthest apart."""
    if content.filter is not None:
        return filter_captions.errors(content.filter)
    known = content.envelopes
    if known is None or not content.moving:
        return ""
    linear, flown = known.linear_sigma[:, content.moving], known.sigma[:, content.moving]
    seen = linear > 1e-6 * linear.max(axis=0)
    apart = np.where(seen, np.abs(np.divide(flown, linear, out=np.ones_like(flown), where=seen) - 1.0), 0.0)
    apart = np.nan_to_num(apart)
    place, k = np.unravel_index(int(np.argmax(apart)), apart.shape)
    name, at = content.output_names[content.moving[k]], instant(float(known.times[place]), known.label)
    most = f"{100.0 * apart[place, k]:.3g} %"
    return f"Monte Carlo and linear sigma differ by at most {most}, in {name} at {at}, sampling error included."


def convergence(content: RunAnalysis) -> str:
    """Say from how many samples on all paired intervals stay within the tolerance."""
    known, tolerance = content.convergence, content.criterion.tolerance
    if known is None:
        return ""
    shown = np.isfinite(known.paired.ratio[-1])
    low, high = known.paired.low[:, shown], known.paired.high[:, shown]
    within = np.all((low >= 1.0 - tolerance) & (high <= 1.0 + tolerance), axis=1)
    beyond = np.flatnonzero(~within)
    band = f"±{100.0 * tolerance:g} %"
    if not shown.any():
        return ""
    if len(beyond) and beyond[-1] == len(known.sizes) - 1:
        return f"With all {int(known.sizes[-1]):,} samples a paired interval still reaches beyond {band}."
    first = int(known.sizes[beyond[-1] + 1 if len(beyond) else 0])
    return f"From {first:,} samples on all paired intervals stay within {band}."


def requirements(content: RunAnalysis) -> str:
    """State the least margin of the curves where their requirements hold."""
    rows = requirement_rows(content.summary, "shown", content.time_unit)
    used: list[tuple[float, RequirementRow, float, float]] = []
    for row, requirement_curve in zip(rows, content.requirement_curves, strict=False):
        known = (
            None
            if requirement_curve is None
            else np.where(
                requirement_curve.holds & np.isfinite(requirement_curve.estimate), requirement_curve.estimate, -1.0
            )
        )
        if requirement_curve is not None and known is not None and known.max(initial=-1.0) >= 0.0:
            place, limit = int(np.argmax(known)), row.entry.limits[0]
            used.append((float(known[place]) / limit, row, float(known[place]), float(requirement_curve.times[place])))
    if not used:
        return ""
    share, row, size, time = max(used, key=lambda each: each[0])
    off, side = abs(1.0 - share), "below" if share <= 1.0 else "above"
    label = content.development.label if content.development else ""
    shown = f"{rounded(size * row.scale)} {row.unit}".strip()
    return (
        f"{measure(row.entry)} of {joined([humanize(name) for name in row.entry.outputs])} is {shown} at "
        f"{instant(time, label)} by Monte Carlo, {100.0 * off:.3g} % {side} its limit"
        f"{', the least margin' if len(used) > 1 else ''}."
    )


def dispersion(content: RunAnalysis) -> str:
    """Compare truth and navigation error of the quantity in which they differ most at the end."""
    known, outputs = content.envelopes, content.manifest.model.outputs
    if known is None:
        return ""
    best: tuple[float, str] | None = None
    for quantity in quantities(outputs):
        if quantity.error is None:
            continue
        true, error = (float(known.sigma[-1, place]) for place in (quantity.true, quantity.error))
        if not (true > 0.0 and error > 0.0):
            continue
        scale, unit = content.output_scale[quantity.true], content.output_units[quantity.true]
        shown = [f"{rounded(value * scale)} {unit}".strip() for value in (true, error)]
        name = humanize(quantity.name)
        words = f"At the end the true dispersion of {name} is {shown[0]}, its navigation error {shown[1]}."
        off = abs(float(np.log(true / error)))
        best = max(filter(None, (best, (off, words))), key=lambda pair: pair[0])
    return "" if best is None else best[1]
