"""Sentences on a filter: its verdict in one, and what else there is to say."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Final

import numpy as np

from mcnav.analysis.filter_consistency import (
    FilterConsistency,
    GroupConsistency,
    Honesty,
    SensorConsistency,
    SigmaConsistency,
)
from mcnav.scenarios.filter_sums import FilterMeans
from mcnav.statistics.power import sensible_step

GROUPS: Final[Mapping[str, str]] = {"all": "all states", "sensors": "errors of instruments and sensors"}
"""Groups of states in a sentence, where their names do not say it."""


def remarks_on(
    reason: str,
    means: FilterMeans,
    groups: Sequence[GroupConsistency],
    deciding: Sequence[GroupConsistency],
    outputs: Sequence[SigmaConsistency],
    states: Sequence[SigmaConsistency],
    sensors: Sequence[SensorConsistency],
) -> tuple[str, ...]:
    """List what the verdict does not say, a sentence each; ``reason`` is why there is none."""
    found = [f"{reason[:1].upper()}{reason[1:]}."] if reason else []
    found += _on_records(means)
    found += _on_zero_variances([*outputs, *states])
    verdicts = {group.finding.verdict for group in deciding}
    if {Honesty.OPTIMISTIC, Honesty.PESSIMISTIC} <= verdicts:
        names = [group.name for group in deciding if group.finding.verdict == Honesty.PESSIMISTIC]
        found.append(f"Of {' and '.join(names)} the filter is pessimistic.")
    if verdicts == {Honesty.CONSISTENT}:
        found += _on_single_outputs(outputs, means.samples)
    if sensors and all(sensor.nis_whole is None for sensor in sensors):
        found.append("The filter was never updated.")
    else:
        found += _on_sensors(sensors, means.schema.considered)
    return tuple(found)


def _on_records(means: FilterMeans) -> Iterator[str]:
    """Yield what numbers are missing."""
    counts = means.at("nees").count[:-1]
    missing = means.samples - counts
    for number, group in enumerate(means.schema.groups):
        most = int(missing[:, number].max(initial=0))
        if most:
            of = "all samples" if most == means.samples else f"{most:,} of {means.samples:,} samples"
            epochs = int(np.count_nonzero(missing[:, number]))
            at = "one epoch" if epochs == 1 else f"{epochs} epochs"
            yield f"The NEES of {group} is not a number in {of} at {at}: the filter's covariance is singular there."


def _on_zero_variances(sigmas: Sequence[SigmaConsistency]) -> Iterator[str]:
    """Yield which errors the filter believes to be zero."""
    for each in sigmas:
        if each.overlooked.any():
            yield f"The filter has no variance of {_spoken(each.name)} where its error is not zero."


def _on_single_outputs(outputs: Sequence[SigmaConsistency], samples: int) -> Iterator[str]:
    """Say what a consistent filter's verdict rests on where samples do not decide it for each output."""
    undecided = [each.finding for each in outputs if each.finding.verdict == Honesty.UNDECIDED]
    if undecided:
        of = "single outputs" if len(undecided) == len(outputs) else f"{len(undecided)} of {len(outputs)} outputs alone"
        needed = [finding.samples_needed for finding in undecided]
        most = max((each for each in needed if each is not None), default=None)
        would = f"; about {sensible_step(most, samples):,} would" if most and None not in needed else ""
        yield f"The verdict is on groups of errors together. For {of} {samples:,} samples do not decide it{would}."


def _on_sensors(sensors: Sequence[SensorConsistency], considered: Sequence[str]) -> Iterator[str]:
    for sensor in sensors:
        name = _spoken(sensor.name)
        if sensor.nis_whole is None:
            yield f"{name[:1].upper()}{name[1:]} never updated the filter."
        elif sensor.finding.remark and not sensor.updates[0] > 0.0:
            yield f"Every measurement of {name} was rejected."
    beyond = [
        f"{_spoken(sensor.name)} {sensor.nis_whole:.4g} for {sensor.size}"
        for sensor in sensors
        if sensor.beyond and sensor.nis_whole is not None
    ]
    if beyond:
        yield f"The mean NIS is beyond the bounds of a consistent filter: {', '.join(beyond)}."
    coloured = [_spoken(sensor.name) for sensor in sensors if sensor.whiteness.beyond]
    if coloured:
        yield f"Innovations of {' and '.join(coloured)} are not white{_expected(considered)}."
    shares = {_spoken(sensor.name): sensor.updates for sensor in sensors if min(sensor.updates) > 0.0}
    if shares:
        rejected = ", ".join(f"{name} {100.0 * no / (yes + no):.3g} %" for name, (yes, no) in shares.items())
        yield f"Measurements were rejected ({rejected}); linear analysis accepts all."


def _expected(considered: Sequence[str]) -> str:
    """Name the considered errors, which correlate the innovations of a matched filter as well; empty without any."""
    if not considered:
        return ""
    names = " and ".join(map(_spoken, considered))
    return f", as expected of a filter that considers errors without estimating them ({names})"


def sentence(found: FilterConsistency) -> str:
    """Put the verdict in a sentence.

    A filter is optimistic when its sigmas are smaller than those of its errors.
    """
    if found.verdict == Honesty.UNDECIDED or found.factor is None:
        if found.remarks and found.factor is None:
            return f"Undecided: {found.remarks[0][:1].lower()}{found.remarks[0][1:]}"
        needed = found.samples_needed and f"; about {sensible_step(found.samples_needed, found.samples):,} would decide"
        return f"Undecided: {found.samples:,} samples do not tell whether the filter is consistent{needed or ''}."
    within = f"±{100.0 * found.tolerance:g} %"
    if found.verdict == Honesty.CONSISTENT:
        return f"The filter is consistent: the true sigmas are within {within} of its own at every epoch."
    size = f"{found.factor:.3g}" if found.factor >= 1.0 else _inverse(found.factor)
    largest = ""
    if found.neglected:
        cause = found.neglected[0]
        largest = f"; the largest error that it neglects is {_spoken(cause.name)} ({100.0 * cause.share:.0f} %)"
    where = group_words(found.group)
    return f"The filter is {found.verdict.value} by a factor of {size} in {where}{_when(found)}{largest}."


def group_words(group: str) -> str:
    """Name a group of states in a sentence."""
    return GROUPS.get(group, _spoken(group))


def _inverse(factor: float) -> str:
    return f"{1.0 / factor:.3g}" if factor > 0.0 else "infinity: the errors are zero"


def _when(found: FilterConsistency) -> str:
    """Say from when to when the departure is certain; empty where nothing is."""
    if found.begin is None or found.end is None:
        return ""
    begin, end = instant(found.begin, found.label), instant(found.end, found.label)
    if found.end >= found.times[np.isfinite(found.times)][-1]:
        return f" from {begin} on"
    return f" at {begin}" if begin == end else f" from {instant(found.begin, '')} to {end}"


def instant(time: float, label: str) -> str:
    """Format an instant to three digits, in the unit of a label ``name [unit]``.

    >>> instant(1503.2, "time [s]"), instant(24.0926, "time [min]"), instant(59.98, "")
    ('1,503 s', '24.1 min', '60')
    """
    size = abs(time)
    decimals = max(0, 2 - math.floor(math.log10(size))) if size > 0.0 else 0
    digits = f"{time:,.{decimals}f}".replace("-", "−")
    unit = label.partition(" [")[2].removesuffix("]")
    return f"{digits.rstrip('0').rstrip('.') if '.' in digits else digits} {unit}".rstrip()


def _spoken(name: str) -> str:
    return name.replace("_", " ")
