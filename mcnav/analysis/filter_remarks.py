"""Sentences on a filter: its verdict in one, and what else there is to say."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from mcnav.analysis.filter_consistency import (
    FilterConsistency,
    GroupConsistency,
    Honesty,
    SensorConsistency,
    SigmaConsistency,
)
from mcnav.scenarios.filter_sums import FilterMeans


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
    if sensors and all(sensor.nis_whole is None for sensor in sensors):
        found.append("The filter was never updated.")
    else:
        found += _on_sensors(sensors)
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
        wrong = (each.filter <= 0.0) & (each.true > 0.0)
        if wrong.any():
            yield f"The filter has no variance of {_spoken(each.name)} where its error is not zero."


def _on_sensors(sensors: Sequence[SensorConsistency]) -> Iterator[str]:
    for sensor in sensors:
        name, white, nis = _spoken(sensor.name), sensor.whiteness, sensor.nis_whole
        if nis is None:
            yield f"{name[:1].upper()}{name[1:]} never updated the filter."
            continue
        if sensor.finding.remark and not sensor.updates[0] > 0.0:
            yield f"Every measurement of {name} was rejected."
        if sensor.beyond:
            low, high = sensor.bounds_whole
            yield (
                f"The mean NIS of {name} is {nis:.4g}; that of a consistent filter lies between {low:.4g} and "
                f"{high:.4g}."
            )
        if white.beyond and white.correlation is not None:
            yield (
                f"Innovations of {name} are not white: the correlation of consecutive ones is {white.correlation:.2g}, "
                f"beyond ±{white.bound:.2g}."
            )


def sentence(found: FilterConsistency) -> str:
    """Put the verdict in a sentence.

    A filter is optimistic when its sigmas are smaller than those of its errors.
    """
    if found.verdict == Honesty.UNDECIDED or found.factor is None:
        if found.remarks and found.factor is None:
            return f"Undecided: {found.remarks[0][:1].lower()}{found.remarks[0][1:]}"
        needed = "" if found.samples_needed is None else f"; about {found.samples_needed:,} samples would decide"
        return f"Undecided: {found.samples:,} samples do not tell whether the filter is consistent{needed}."
    within = f"±{100.0 * found.tolerance:g} %"
    if found.verdict == Honesty.CONSISTENT:
        return f"The filter is consistent: the true sigmas are within {within} of its own at every epoch."
    unit = found.label.rpartition(" ")[2].strip("[]")
    place = f"{_spoken(found.group)} ({_spoken(found.output)})" if found.output else _spoken(found.group)
    last = found.times[np.isfinite(found.times)][-1]
    span = f"from {_number(found.begin)} {unit} on"
    if found.end is not None and found.end < last:
        span = f"between {_number(found.begin)} and {_number(found.end)} {unit}"
    if found.begin == found.end:
        span = f"at {_number(found.begin)} {unit}"
    by = f"by a factor of {found.factor:.3g}" if found.factor >= 1.0 else f"by a factor of {_inverse(found.factor)}"
    largest = ""
    if found.neglected:
        cause = found.neglected[0]
        largest = f"; {100.0 * cause.share:.0f} % of what it neglects is {_spoken(cause.name)}"
    return f"The filter is {found.verdict.value} {by} in {place}, {span}{largest}."


def _inverse(factor: float) -> str:
    return f"{1.0 / factor:.3g}" if factor > 0.0 else "infinity: the errors are zero"


def _number(value: float | None) -> str:
    return "?" if value is None else f"{value:.6g}"


def _spoken(name: str) -> str:
    return name.replace("_", " ")
