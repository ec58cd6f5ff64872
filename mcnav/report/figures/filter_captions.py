"""Captions of the figures of a filter, a sentence each, from the numbers that it draws."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from mcnav.analysis.filter_consistency import FilterConsistency, SigmaConsistency
from mcnav.analysis.filter_remarks import group_words, instant
from mcnav.arrays.types import Array
from mcnav.report.figures.filter_errors import sigmas
from mcnav.report.format import rounded
from mcnav.report.names import humanize


def sigma_history(result: FilterConsistency) -> str:
    """Say which ratio is certain to leave the band first; without any, whether all ratios stay within it."""
    band = f"the band of ±{100.0 * result.tolerance:g} %"
    known = [output for output in result.outputs if output.ratio.known.any()]
    certain = [judged for judged in known if judged.finding.begin is not None]
    if certain:
        first = min(certain, key=lambda judged: judged.finding.begin or 0)
        count = f"{len(certain)} of {len(known)} outputs do" if len(certain) > 1 else "it alone does"
        at = instant(float(result.times[first.finding.begin or 0]), result.label)
        return f"{_begun(humanize(first.name))} certainly leaves {band} at {at}; {count}."
    outside = [
        (_outside(judged.ratio.value, 1.0 - result.tolerance, 1.0 + result.tolerance), judged) for judged in known
    ]
    left = [(place, judged) for place, judged in outside if place is not None]
    if not left:
        return f"All ratios stay within {band}." if known else ""
    place, first = min(left, key=lambda judged: judged[0])
    at = instant(float(result.times[place]), result.label)
    return f"The estimate of {humanize(first.name)} leaves {band} at {at}; no ratio is certain to do so."


def nees_history(result: FilterConsistency) -> str:
    """Say which group's mean NEES leaves its bounds first."""
    groups = [(group_words(group.name), group.nees.value, *group.bounds_together) for group in result.groups]
    return _bounded("The mean NEES of", "every group", groups, result)


def nis_history(result: FilterConsistency) -> str:
    """Say which sensor's mean NIS leaves its bounds first."""
    sensors = [
        (humanize(sensor.name), sensor.nis.value, sensor.bounds[:, 0], sensor.bounds[:, 1]) for sensor in result.sensors
    ]
    return _bounded("The mean NIS of", "every sensor", sensors, result)


def within_history(result: FilterConsistency) -> str:
    """Say which share of samples within the filter's sigmas leaves its bounds first."""
    shares = [
        (f"{humanize(output.name)} within ±{multiple}σ", band.value, *bounds)
        for output in result.outputs
        for multiple, band, bounds in ((1, output.within_1, output.bounds_1), (3, output.within_3, output.bounds_3))
        if band is not None
    ]
    return _bounded("The share of", "every output within ±1σ and ±3σ", shares, result)


def _bounded(
    what: str, every: str, curves: Sequence[tuple[str, Array, Array | float, Array | float]], result: FilterConsistency
) -> str:
    """Name the curve that leaves its bounds first, and count those that do."""
    known = [curve for curve in curves if np.isfinite(curve[1]).any()]
    left = [(place, curve[0]) for curve in known if (place := _outside(*curve[1:])) is not None]
    if not known:
        return ""
    if not left:
        return f"{what} {every if len(known) > 1 else known[0][0]} stays within its bounds."
    place, name = min(left)
    count = f" ({len(left)} of {len(known)} leave them)" if len(known) > 1 else ""
    return f"{what} {name} leaves its bounds at {instant(float(result.times[place]), result.label)}{count}."


def _outside(values: Array, low: Array | float, high: Array | float) -> int | None:
    """Return the first epoch at which values are beyond their bounds; none where they stay within, or are unknown."""
    with np.errstate(invalid="ignore"):
        places = np.flatnonzero((values < low) | (values > high))
    return int(places[0]) if len(places) else None


def errors(result: FilterConsistency) -> str:
    """Compare true and filter sigma of the output for which they differ most where the true one is largest.

    The first epoch counts only where nothing is known later: its sigmas are those of the campaign file.
    """
    best: tuple[float, str] | None = None
    for output in result.outputs:
        own = sigmas(output)
        true, stated = own["Monte Carlo"], own["filter"]
        if not np.isfinite(true).any():
            continue
        place = 1 + int(np.nanargmax(true[1:])) if np.isfinite(true[1:]).any() else 0
        if not (true[place] > 0.0 and stated[place] > 0.0):
            continue
        unit, at = output.shown_in, instant(float(result.times[place]), result.label)
        later = " after the start" if true[0] > true[place] else ""
        words = (
            f"1σ of {humanize(output.name)} is largest{later} at {at}: {rounded(float(true[place]))} {unit} by Monte "
            f"Carlo; the filter states {rounded(float(stated[place]))} {unit}."
        )
        off = abs(float(np.log(true[place] / stated[place])))
        if best is None or off > best[0]:
            best = off, words
    return "" if best is None else best[1]


def estimation(result: FilterConsistency) -> str:
    """Say which estimate of an instrument's error gains most over the flight."""
    gains = dict(_gains(result.states))
    if not gains:
        return ""
    name, left = min(gains.items(), key=lambda gain: gain[1])
    if left >= 1.0:
        return "No sigma by Monte Carlo is smaller at the end than at the start."
    return f"From start to end the sigma of {humanize(name)} falls most, to {100.0 * left:.3g} % by Monte Carlo."


def _gains(states: Iterable[SigmaConsistency]) -> Iterable[tuple[str, float]]:
    for state in states:
        if state.true[0] > 0.0 and np.isfinite(state.true[[0, -1]]).all():
            yield state.name, float(state.true[-1] / state.true[0])


def _begun(text: str) -> str:
    return text[:1].upper() + text[1:]
