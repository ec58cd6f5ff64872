"""Fields of the sentences on a run: each returns the words that stand in place of its name."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from mcnav.analysis.filter_causes import shares_by_kind
from mcnav.analysis.filter_consistency import cause_words
from mcnav.analysis.filter_remarks import group_words, instant
from mcnav.analysis.verdict import NUMERICAL
from mcnav.physics.units import conversion
from mcnav.report.format import rounded
from mcnav.report.names import humanize, shown_units
from mcnav.report.statements.means import mean_sentence
from mcnav.report.statements.requirements import (
    confidence_words,
    requirement_in_brief,
    worst_requirement,
)
from mcnav.report.statements.words import more_samples, several

if TYPE_CHECKING:
    from mcnav.analysis.summary import Beyond, Departure, Ends, FilterSummary, Summary, Unsettled
    from mcnav.arrays.types import Array

FINEST: Final = 0.1
"""Smallest difference that a sentence states, per cent."""

TOGETHER: Final = ("all", "navigation")
"""Groups of states that need no name beside a filter's errors."""

NAMED: Final = 3
"""Unmodelled errors that are named."""

LEAST: Final = 0.02
"""Smallest share of one that is named."""


def unsettled(reason: Unsettled) -> str:
    """Explain why there is no valid linear model to compare with.

    >>> from mcnav.analysis.summary import Unsettled
    >>> unsettled(Unsettled(source="seed", output="range", disagreement=0.853, own=False))
    'Partial derivatives do not converge (range by seed: 85 %): the comparison below has no valid linear model.'
    """
    share = 100.0 * (reason.disagreement or math.inf)
    size = f"{share:,.0f} %" if share >= 10.0 else f"{share:.2g} %"
    where = f"{humanize(reason.output)} by {humanize(reason.source)}: {size}"
    if reason.noise:
        named = f"{humanize(reason.output)}: {size} of its sigma"
        causes = {
            "fly_linear": "The scenario's own linear simulations disagree with its simulations",
            "noise_covariance": "The scenario's own noise covariance disagrees with its linear simulations",
        }
        cause = f"{causes.get(reason.noise, 'The response to noise is not linear')} ({named})"
    elif reason.own:
        cause = f"The scenario's own partial derivatives disagree with finite differences ({where})"
    else:
        cause = f"Partial derivatives do not converge ({where})"
    return f"{cause}: the comparison below has no valid linear model."


def beyond_range(beyond: Beyond) -> str:
    """Say from when on linear errors have no meaning.

    >>> from mcnav.analysis.summary import Beyond
    >>> beyond_range(Beyond(outputs=["position_down"], begin=120.0, time="time [min]"))
    'No: errors are beyond the range of linear analysis from 120 min on (position down).'
    """
    since = "at the end" if beyond.begin is None else f"from {instant(beyond.begin, beyond.time or '')} on"
    names = several([humanize(name) for name in beyond.outputs])
    return f"No: errors are beyond the range of linear analysis {since} ({names})."


def no_dispersion(summary: Summary) -> str:
    """Explain why no output has a dispersion."""
    dispersed = any(row[i] > 0.0 for i, row in enumerate(summary.start_covariance))
    return "no output depends on an error source" if dispersed else "no error source varies"


def mean_alone_differs(summary: Summary) -> bool:
    """Return whether the mean of the outputs is off, and their spread is not."""
    joint = summary.joint
    return joint is not None and joint.cause == "mean" and joint.dispersion_verdict == "agrees"


def _bound(summary: Summary) -> str:
    """Bound the differences of all sigmas, per cent."""
    intervals = [interval for interval in summary.sigma_ratio_paired_interval if interval is not None]
    ends = [end for interval in intervals for end in interval if end is not None]
    return f"{difference_bound(ends)} %" if ends else f"{100.0 * summary.tolerance:g} %"


def difference_bound(ratios: list[float]) -> str:
    """Round the largest difference of ratios from one up, per cent: to a tenth, or to one from ten on.

    >>> difference_bound([0.9998, 1.0001]), difference_bound([0.9999, 1.0015]), difference_bound([0.88, 1.13])
    ('0.1', '0.2', '13')
    """
    largest = 100.0 * max(abs(ratio - 1.0) for ratio in ratios)
    step = FINEST if largest < 10.0 else 1.0
    return f"{max(step, math.ceil(largest / step - NUMERICAL) * step):.3g}"


def _wrong(summary: Summary) -> list[str]:
    """Name the outputs whose linear sigma differs."""
    pairs = zip(summary.names, summary.verdicts, strict=True)
    return [humanize(name) for name, verdict in pairs if verdict == "differs"]


def _samples_for_matrix(summary: Summary) -> str:
    needed = None if summary.joint is None else summary.joint.samples_needed
    return more_samples(needed, summary.samples) if needed else ""


def samples_for_sigmas(summary: Summary) -> str:
    """Say how many samples would decide on all sigmas; empty where no number is known to."""
    needed = [samples for samples in summary.samples_needed if samples]
    return more_samples(max(needed), summary.samples) if needed else ""


def counts(summary: Summary) -> str:
    """Count the requirements by their findings; empty without any."""
    tally = summary.counts
    if tally is None:
        return ""
    others = (tally.not_met, "not met"), (tally.undecided, "undecided"), (tally.met_as_known, "met for the known ways")
    return ", ".join([f"{tally.met} of {tally.of} met", *(f"{count} {words}" for count, words in others if count)])


def _least_margin(summary: Summary, epochs: Mapping[str, Array]) -> str:
    worst = worst_requirement(summary, _time_unit(epochs))
    return "" if worst is None else requirement_in_brief(worst, epochs)


def _time_unit(epochs: Mapping[str, Array]) -> str:
    """Return the unit of the times of stored errors; empty where none are stored."""
    label = next((name for name in epochs if name.startswith("time [")), "")
    return label.removeprefix("time [").removesuffix("]")


def margin(summary: Summary) -> str:
    """Say by how much the tightest requirement is met or missed, and with what confidence."""
    worst = worst_requirement(summary)
    return "" if worst is None else confidence_words(worst)


def cause(summary: Summary, subject: str) -> str:
    """Name the largest causes of what fails, or of the errors that the tightest requirement limits, with their shares.

    Empty where none is known.
    """
    if subject == "filter" and summary.filter is not None and summary.filter.verdict == "optimistic":
        return _unmodelled(summary.filter)
    worst = worst_requirement(summary) if subject == "requirements" else None
    if worst is None:
        return ""
    return named_causes((initial(cause.name, summary.names), cause.share) for cause in worst.entry.causes)


def initial(cause: str, outputs: Sequence[str]) -> str:
    """Return the name of a cause; of one that is named as an output that of its initial error.

    >>> initial("position_x", ["position_x"]), initial("gyro_bias_x", ["position_x"])
    ('initial_position_x', 'gyro_bias_x')
    """
    return f"initial_{cause}" if cause in outputs else cause


def faults_before(summary: Summary) -> str:
    """Name the last fault of a sensor that began until the filter was the most optimistic; empty without one."""
    result = summary.filter
    worst = None if result is None else worst_departure(result)
    if result is None or worst is None or worst.worst is None:
        return ""
    per_second = {"time [min]": 60.0, "time [h]": 3600.0}.get(result.time, 1.0)
    begun = [fault for fault in summary.faults if fault.begin <= worst.worst * per_second]
    if not begun:
        return ""
    fault = max(begun, key=lambda fault: fault.begin)
    size = f"{rounded(fault.size * conversion(fault.unit, fault.shown_in))} {fault.shown_in}".rstrip()
    times = (fault.begin,) if fault.kind == "spike" else (fault.begin, fault.end)
    first, *last = [instant(time / per_second, result.time) for time in times]
    when = f"{first.partition(' ')[0]} to {last[0]}" if last else first
    return f"{humanize(fault.sensor)} {humanize(fault.component)}: {size} {fault.kind}, {when}"


def named_causes(causes: Iterable[tuple[str, float]]) -> str:
    """Name the largest kinds of causes with their shares of a variance, and what correlations take from their sum."""
    kinds = shares_by_kind(causes)
    correlated = 1.0 - sum(kinds.values())
    more = f", correlations −{-100.0 * correlated:.0f} %" if correlated < -LEAST else ""
    return f"{_named(kinds)}{more}"


def _unmodelled(result: FilterSummary) -> str:
    return _named(shares_by_kind((source.name, source.share) for source in result.neglected))


def _named(kinds: Mapping[str, float]) -> str:
    """Name the largest kinds of causes with their shares."""
    named = [(kind, share) for kind, share in kinds.items() if share >= LEAST][:NAMED]
    return ", ".join(f"{cause_words(kind)} {100.0 * share:.0f} %" for kind, share in named)


def worst_departure(result: FilterSummary) -> Departure | None:
    """Return what departs the most in the direction of the verdict; none of a filter of which nothing does."""
    departures = [departure for departure in result.departures if departure.verdict == result.verdict]
    known = [departure for departure in departures if departure.factor]
    return max(known, key=lambda departure: abs(math.log(departure.factor or 1.0)), default=None)


def _whose(summary: Summary) -> str:
    """Say whose errors the filter is most wrong about."""
    result = summary.filter
    worst = None if result is None else worst_departure(result)
    if result is None or worst is None:
        return ""
    if result.group in TOGETHER:
        return "its"
    return group_words(result.group) if result.group else humanize(worst.name)


def factor(summary: Summary) -> str:
    """Return the ratio of true to filter sigma that the verdict rests on; empty where no departure is known."""
    result = summary.filter
    if result is None or result.factor is None or worst_departure(result) is None:
        return ""
    return rounded(result.factor, 2)


def _within(summary: Summary) -> str:
    tolerance = None if summary.filter is None else summary.filter.tolerance
    return "" if tolerance is None else f", within {100.0 * tolerance:g} %"


def _worst_output(summary: Summary, epochs: Mapping[str, Array]) -> str:
    """Compare true and filter sigma of the output that the filter is most wrong about, at its worst time."""
    result = summary.filter
    if result is None:
        return ""
    outputs = [
        departure for departure in result.departures
        if departure.of == "output" and departure.verdict == result.verdict
    ]  # fmt: skip
    worst = max(outputs, key=lambda departure: departure.factor or 0.0, default=None)
    if worst is None or worst.factor is None or worst.worst is None:
        return ""
    when = f"{humanize(worst.name)} at {instant(worst.worst, result.time)}"
    between = _ends(worst.factor_interval, 100.0 * (result.confidence or summary.confidence))
    alone = "" if result.factor is None or worst.factor >= result.factor else " single output"
    return f"Worst{alone}: {when}, {_sigmas(summary, result, worst, epochs)}{rounded(worst.factor, 2)} times{between}."


def _ends(ends: Ends | None, confidence: float) -> str:
    """Write an interval by two digits, or by three where its ends would be the same."""
    low, high = ends or (None, None)
    if low is None:
        return ""
    digits = 2 if rounded(low, 2) != rounded(high, 2) else 3
    return f" ({confidence:g} %: {rounded(low, digits)} to {rounded(high, digits)})"


def _sigmas(summary: Summary, result: FilterSummary, worst: Departure, epochs: Mapping[str, Array]) -> str:
    """Write the root mean square error and the filter sigma at that time; empty where they are not stored."""
    unit = next((output.unit for output in summary.outputs if output.name == worst.name), "")
    times = epochs.get(result.time)
    mean, sigma, stated = (epochs.get(f"{kind} {worst.name} [{unit}]") for kind in ("mean", "sigma", "filter sigma"))
    if times is None or worst.worst is None or mean is None or sigma is None or stated is None:
        return ""
    scale, shown = shown_units(summary)[worst.name]
    place = int(np.abs(times - worst.worst).argmin())
    true = math.hypot(float(mean[place]), float(sigma[place]))  # about zero, as the ratio is
    return f"true {rounded(true * scale, 2)} {shown}, filter {rounded(float(stated[place]) * scale, 2)}: "


def silent_sensor(summary: Summary) -> str:
    """Say that NIS of every sensor stays near its number of measurements, though the filter is wrong."""
    result = summary.filter
    known = [] if result is None else [sensor for sensor in result.sensors.values() if sensor.nis_mean is not None]
    if not known or any(sensor.verdict != "consistent" for sensor in known):
        return ""
    means = ", ".join(f"{sensor.nis_mean:.1f} where {sensor.size} is expected" for sensor in known)
    return f"NIS hardly shows it: {means}." if len(known) == 1 else ""


def _of(words: Callable[[Summary], str]) -> Callable[[Summary, Mapping[str, Array]], str]:
    return lambda summary, epochs: words(summary)


MAY_BE_EMPTY: Final = ("within",)
"""Fields without which a sentence can do."""

FIELDS: Final[Mapping[str, Callable[[Summary, Mapping[str, Array]], str]]] = {
    "means": _of(mean_sentence),
    "counts": _of(counts),
    "least_margin": _least_margin,
    "within": _of(_within),
    "whose": _of(_whose),
    "factor": _of(factor),
    "worst_output": _worst_output,
    "filter_verdict": _of(lambda summary: summary.filter_verdict),
    "smoother_verdict": _of(lambda summary: summary.smoother_verdict),
    "unsettled": _of(lambda summary: "" if summary.unsettled is None else unsettled(summary.unsettled)),
    "beyond_range": _of(lambda summary: "" if not summary.beyond_range else beyond_range(summary.beyond_range)),
    "no_dispersion": _of(no_dispersion),
    "samples_for_matrix": _of(_samples_for_matrix),
    "samples_for_sigmas": _of(samples_for_sigmas),
    "sigma_is": _of(lambda summary: "sigma is" if len(_wrong(summary)) == 1 else "sigmas are"),
    "wrong": _of(lambda summary: several(_wrong(summary))),
    "succeeded": _of(lambda summary: f"{summary.samples - summary.failed:,}"),
    "bound": _of(_bound),
}
"""Fields by name: functions of a run's summary and of its columns over time."""
