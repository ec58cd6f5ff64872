"""Sentences on a filter: its verdict in one, and what else there is to say."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from mcnav.analysis.filter_consistency import (
    CertainDeparture,
    FilterConsistency,
    GroupConsistency,
    Honesty,
    SensorConsistency,
    SigmaConsistency,
    cause_words,
)
from mcnav.analysis.filter_decision import Decision
from mcnav.physics.units import conversion
from mcnav.statistics.power import sensible_step

if TYPE_CHECKING:
    from mcnav.statistics.filter_sums import FilterMeans


GROUPS: Final[Mapping[str, str]] = {"all": "all states", "sensors": "errors of instruments and sensors"}
"""Groups of states in a sentence, where their names do not say it."""


LEAST_MINUTES: Final = 0.995
"""Minutes below which an instant is in seconds: from there on, three digits are a minute."""


def remarks_on(
    reason: str,
    means: FilterMeans,
    decision: Decision,
    groups: Sequence[GroupConsistency],
    outputs: Sequence[SigmaConsistency],
    states: Sequence[SigmaConsistency],
    sensors: Sequence[SensorConsistency],
) -> tuple[str, ...]:
    """List what the verdict does not say, a sentence each; ``reason`` is why there is none."""
    result = [f"{reason[:1].upper()}{reason[1:]}."] if reason else []
    result += _on_records(means)
    result += _on_zero_variances([*outputs, *states])
    result += _on_negligible([*outputs, *states])
    if decision.groups == Honesty.CONSISTENT and decision.outputs != Honesty.CONSISTENT:
        result += _on_single_outputs(decision, [output for output in outputs if output.claims])
    if decision.verdict == Honesty.CONSISTENT:
        result += _on_other_states(groups, states)
    if sensors and all(sensor.nis_whole is None for sensor in sensors):
        result.append("The filter was never updated.")
    else:
        result += _on_sensors(sensors, means.schema.considered)
    return tuple(result)


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
    for sigma in sigmas:
        if sigma.overlooked.any():
            yield f"The filter has no variance of {_spoken(sigma.name)} where its error is not zero."


def _on_negligible(sigmas: Sequence[SigmaConsistency]) -> Iterator[str]:
    """Yield the errors of which neither truth nor filter has more than the floor, with the largest floor of a unit."""
    units: dict[str, list[SigmaConsistency]] = {}
    for sigma in sigmas:
        if sigma.negligible.any() and (sigma.true > 0.0).any():
            units.setdefault(sigma.shown_in, []).append(sigma)
    for shown_in, members in units.items():
        size = max(member.floor for member in members) * conversion(members[0].unit, shown_in)
        names = ", ".join(_spoken(member.name) for member in members)
        yield f"Errors up to {size:.2g} {shown_in} count as none: {names}."


def _on_single_outputs(decision: Decision, outputs: Sequence[SigmaConsistency]) -> Iterator[str]:
    """Say what it means that groups are consistent and single outputs are not, or not known to be."""
    if decision.departures:
        yield "No group of errors shows it: in a mean NEES single errors average out."
        return
    whole = "As a whole: the mean NEES of each group of errors is within the tolerance at every epoch"
    undecided = [output for output in outputs if output.finding.verdict == Honesty.UNDECIDED]
    of = "no single output" if len(undecided) == len(outputs) else f"{len(outputs) - len(undecided)} of {len(outputs)}"
    within = "outputs by themselves are" if len(undecided) < len(outputs) else "is known to be"
    yield f"{whole}; {of} {within}."


def _on_other_states(groups: Sequence[GroupConsistency], states: Sequence[SigmaConsistency]) -> Iterator[str]:
    """Name what does not decide and is not consistent, where what decides is."""
    for verdict in (Honesty.OPTIMISTIC, Honesty.PESSIMISTIC):
        departing = [f"{_size(state.finding.factor)} in {_spoken(state.name)}" for state in states
                     if state.finding.verdict == verdict and state.finding.factor is not None]  # fmt: skip
        if departing:
            of = f"Of other states, which do not decide, the filter is {verdict.value} by a factor of"
            yield f"{of} {' and '.join(departing)}."
    undecided = [state for state in states if state.claims and state.finding.verdict == Honesty.UNDECIDED]
    if undecided:
        yield f"Of other states, which do not decide, {len(undecided)} of {len(states)} are undecided."
    for group in groups:
        if group.finding.verdict in (Honesty.OPTIMISTIC, Honesty.PESSIMISTIC):
            size = _size(group.finding.factor or 1.0)
            words = f"{group_words(group.name)} as a group, which does not decide"
            single = all(state.finding.verdict == Honesty.CONSISTENT for state in states if state.claims)
            why = "; it is so in combinations of states, since each by itself is consistent" if single else ""
            yield f"Of {words}, the filter is {group.finding.verdict.value} by a factor of {size}{why}."


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


def sentence(consistency: FilterConsistency) -> str:
    """Put the verdict in a sentence.

    A filter is optimistic when its sigmas are smaller than those of its errors.
    """
    subject = consistency.subject
    told = [_departed(consistency)] if consistency.departures else []
    if consistency.overlooked:
        name = _spoken(consistency.overlooked)
        told.insert(0, f"The {subject} is optimistic: it computes no variance of {name}, whose error is not zero.")
    if told:
        return " ".join(told)
    within = f"±{100.0 * consistency.tolerance:g} %"
    if consistency.verdict == Honesty.CONSISTENT:
        every = "every output and every group" if consistency.outputs else "every group of errors"
        return (
            f"The {subject} is consistent: {every} is within {within} of the {subject} sigma at every epoch "
            f"({100.0 * consistency.confidence:g} % confidence)."
        )
    reason = consistency.doubt or (
        consistency.remarks[0] if consistency.remarks and consistency.factor is None else ""
    ).rstrip(".")
    if reason:
        return f"Undecided: {reason[:1].lower()}{reason[1:]}."
    needed = consistency.samples_needed and f"about {sensible_step(consistency.samples_needed, consistency.samples):,}"
    if consistency.on_groups == Honesty.CONSISTENT:
        single = f"single errors need {needed} samples" if needed else "single errors are undecided"
        return f"Undecided: the {subject} is consistent as a whole; {single}."
    would = f"; {needed} would decide" if needed else ""
    return f"Undecided: {consistency.samples:,} samples do not tell whether the {subject} is consistent{would}."


def _departed(consistency: FilterConsistency) -> str:
    """Say by how much, of what and when a filter is optimistic and pessimistic, a sentence for each departure."""
    parts = []
    for verdict in (Honesty.OPTIMISTIC, Honesty.PESSIMISTIC):
        departures = [departure for departure in consistency.departures if departure.verdict == verdict]
        single = [departure for departure in departures if not departure.size]
        departures = [  # a group of one is its output
            departure for departure in departures if departure.size != 1 or not single
        ]
        before = ""
        for departure in departures:
            when = _when(departure, consistency)
            subject = f"In {_where(departure)} the factor is" if before else (
                f"The {consistency.subject} is {verdict.value} by a factor of"
            )  # fmt: skip
            named = "" if before else f" in {_where(departure)}"
            parts.append(f"{subject} {_by(departure)}{named}{'' if when == before else when}.")
            before = when
    if consistency.neglected:
        largest = consistency.neglected[0]
        parts.append(f"Largest unmodelled error: {cause_words(largest.name)} ({100.0 * largest.share:.0f} %).")
    return " ".join(parts)


def _where(departure: CertainDeparture) -> str:
    """Name what departs: an output, or a group of them."""
    if not departure.size:
        return _spoken(departure.name)
    return f"{group_words(departure.name)}{' as a group' if departure.size > 1 else ''}"


def _by(departure: CertainDeparture) -> str:
    """State a factor, of an output with its interval."""
    if departure.size:
        return _size(departure.factor)
    low, high = departure.interval if departure.factor >= 1.0 else departure.interval[::-1]
    between = f" ({_size(low)} to {_size(high)})" if departure.factor > 0.0 else ""
    return f"{_size(departure.factor)}{between}"


def group_words(group: str) -> str:
    """Name a group of states in a sentence."""
    return GROUPS.get(group, _spoken(group))


def _size(factor: float) -> str:
    """Return a factor, or its inverse where it is below one, to three digits."""
    if factor >= 1.0:
        return three_digits(factor)
    return three_digits(1.0 / factor) if factor > 0.0 else "infinity: the errors are zero"


def three_digits(factor: float) -> str:
    """Format a factor to three digits, zeros included.

    >>> three_digits(13.0), three_digits(1.1), three_digits(209.3)
    ('13.0', '1.10', '209')
    """
    return f"{factor:#.3g}".removesuffix(".")


def _when(departure: CertainDeparture, consistency: FilterConsistency) -> str:
    """Say from when to when the departure is certain."""
    begin, end = instant(departure.begin, consistency.label), instant(departure.end, consistency.label)
    if departure.end >= consistency.times[np.isfinite(consistency.times)][-1]:
        return f" from {begin} on"
    return f" at {begin}" if begin == end else f" from {period(departure.begin, departure.end, consistency.label)}"


def instant(time: float, label: str) -> str:
    """Format an instant to three digits, in the unit of a label ``name [unit]``.

    Less than a minute is in seconds.

    >>> instant(1503.2, "time [s]"), instant(24.0926, "time [min]"), instant(59.98, "")
    ('1,503 s', '24.1 min', '60')
    >>> instant(0.00833, "time [min]"), instant(0.0, "time [min]")
    ('0.5 s', '0 min')
    """
    unit = label.partition(" [")[2].removesuffix("]")
    if unit == "min" and 0.0 < abs(time) < LEAST_MINUTES:
        time, unit = 60.0 * time, "s"
    size = abs(time)
    decimals = max(0, 2 - math.floor(math.log10(size))) if size > 0.0 else 0
    digits = f"{time:,.{decimals}f}".replace("-", "−")
    return f"{digits.rstrip('0').rstrip('.') if '.' in digits else digits} {unit}".rstrip()


def period(begin: float, end: float, label: str) -> str:
    """Format a period, with its unit once where both ends have the same.

    >>> period(20.0, 25.0, "time [min]"), period(0.5, 25.0, "time [min]"), period(0.1, 0.5, "time [min]")
    ('20 to 25 min', '30 s to 25 min', '6 to 30 s')
    """
    first, last = instant(begin, label), instant(end, label)
    unit = last.rpartition(" ")[2]
    return f"{first.removesuffix(f' {unit}')} to {last}"


def _spoken(name: str) -> str:
    return name.replace("_", " ")
