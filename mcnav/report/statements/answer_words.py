"""The answers of a run in plain sentences, as `mcnav demo` prints them: verdict, consequence, worst number."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from mcnav.analysis.filter_causes import shares_by_kind
from mcnav.analysis.filter_consistency import cause_words
from mcnav.analysis.filter_remarks import group_words, instant
from mcnav.analysis.verdict import NUMERICAL
from mcnav.report.columns.requirements import listed
from mcnav.report.format import rounded
from mcnav.report.names import humanize, shown_units
from mcnav.report.pages.run.tiles import NAMES, requirement_in_brief, worst_departure, worst_requirement
from mcnav.report.statements import sentences
from mcnav.report.statements.filter_verdict import LEAST, NAMED
from mcnav.report.statements.joint_words import joined
from mcnav.report.statements.sentences import WORST, Statement, Subject, more_samples

if TYPE_CHECKING:
    from mcnav._types import Array
    from mcnav.analysis.summary import Departure, Ends, FilterSummary, Summary

WORDS: Final = {"agrees": "YES", "partly": "PARTLY", "differs": "NO", "undecided": "UNDECIDED"}
"""The verdict in one word, by tone."""

OF_REQUIREMENTS: Final = {"agrees": "MET", "differs": "NOT MET", "undecided": "UNDECIDED"}

LISTED: Final = 3
"""Outputs that a sentence lists."""

FINEST: Final = 0.1
"""Smallest difference that a sentence states, per cent."""

TOGETHER: Final = ("all", "navigation")
"""Groups of states that need no name beside a filter's errors."""


@dataclass(frozen=True)
class Answer:
    """An answer: its word, tone and sentence, further sentences, what to do about it, the cause, subject, warnings."""

    word: str
    tone: str
    sentence: str
    further: tuple[str, ...] = ()
    advice: str = ""
    cause: str = ""
    subject: Subject = "linear"
    warnings: tuple[str, ...] = ()


def answers(summary: Summary, epochs: Mapping[str, Array]) -> list[Answer]:
    """Answer what a run was made for, the worst answer first.

    Parameters
    ----------
    epochs : mapping
        Columns over time as `mcnav.store.run_folder.RunFolder.epochs` returns them; empty where none are stored.
    """
    unordered = [
        replace(_answer(summary, statement, epochs), subject=statement.subject)
        for statement in sentences.statements(summary)
    ]
    order = [*NAMES]
    return sorted(unordered, key=lambda answer: (
        answer.subject != "means", WORST.index(answer.tone), order.index(answer.subject)))  # fmt: skip


def _answer(summary: Summary, statement: Statement, epochs: Mapping[str, Array]) -> Answer:
    match statement.subject:
        case "linear":
            return _linear(summary, statement)
        case "filter" if summary.filter is not None:
            return _filter(summary, summary.filter, statement, epochs)
        case "requirements":
            worst = worst_requirement(summary)
            least = () if worst is None else (f"Least margin: {requirement_in_brief(worst)}.",)
            cause = "" if worst is None or not worst.causes else listed(worst.causes)
            words = statement.words.removeprefix("Requirements: ")
            return Answer(OF_REQUIREMENTS[statement.tone], statement.tone, f"Requirements: {words}", least, "", cause)
        case _:
            return Answer(WORDS[statement.tone], statement.tone, statement.words)


def _linear(summary: Summary, statement: Statement) -> Answer:
    """Say whether the linear sigmas are right, and whether the covariance matrix is."""
    tone = sentences.tone(summary)
    if summary.unsettled or summary.beyond_range or not (summary.verdicts and any(summary.sigma_linear)):
        return Answer(WORDS[tone], tone, statement.words, warnings=statement.warnings)
    said = {"agrees": _agreeing, "partly": _partly, "differs": _differing, "undecided": _undecided}
    sentence, advice = said[tone](summary)
    return Answer(WORDS[tone], tone, sentence, (), advice, warnings=statement.warnings)


def _agreeing(summary: Summary) -> tuple[str, str]:
    if summary.filter is not None:
        return f"Linear covariance predicts every sigma within {_bound(summary)}.", ""
    also = ", and so is the full covariance matrix" if summary.verdict_matrix == "agrees" else ""
    return f"Every sigma is right{also}.", "Linear covariance does here without a simulation."


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


def _partly(summary: Summary) -> tuple[str, str]:
    joint = summary.joint
    if summary.verdict_matrix != "differs":
        needed = None if joint is None else joint.samples_needed
        more = f"Run {more_samples(needed, summary.samples)} to decide." if needed else ""
        return "Every sigma is right. The samples do not decide on the full covariance matrix.", more
    if joint is not None and joint.cause == "mean" and joint.dispersion_verdict == "agrees":
        return "Every sigma is right. The mean is not.", "Use the sigmas, with the mean errors of Monte Carlo."
    advice = "Use the sigmas; do not gate or fuse with the full matrix."
    return "Every sigma is right. The full covariance matrix is not.", advice


def _differing(summary: Summary) -> tuple[str, str]:
    wrong = [humanize(name) for name, verdict in zip(summary.names, summary.verdicts, strict=True)
             if verdict == "differs"]  # fmt: skip
    listed = joined([*wrong[:LISTED], *([f"{len(wrong) - LISTED} more"] if len(wrong) > LISTED else [])])
    sigma = "sigma is" if len(wrong) == 1 else "sigmas are"
    return f"The linear {sigma} wrong for {listed}.", "Use the Monte Carlo sigmas."


def _undecided(summary: Summary) -> tuple[str, str]:
    needed = [samples for samples in summary.samples_needed if samples]
    run = f"Run {more_samples(max(needed), summary.samples)} to decide." if needed else ""
    return f"{summary.samples - summary.failed:,} samples do not decide whether every linear sigma is right.", run


def _filter(summary: Summary, result: FilterSummary, statement: Statement, epochs: Mapping[str, Array]) -> Answer:
    """Say whether the covariance that the filter computes is that of its errors."""
    word, worst = WORDS[statement.tone], worst_departure(result)
    if result.verdict == "consistent":
        within = "" if result.tolerance is None else f", within {100.0 * result.tolerance:g} %"
        sentence = f"The covariance that the filter computes is that of its errors{within}."
        return Answer(word, statement.tone, sentence, (), "Its sigmas can be used as the filter computes them.")
    if result.verdict not in ("optimistic", "pessimistic") or worst is None or result.factor is None:
        return Answer(word, statement.tone, statement.words)
    whose = "its" if result.group in TOGETHER else group_words(result.group) if result.group else humanize(worst.name)
    errors = f"{whose} errors are {rounded(result.factor, 2)} times what it computes."
    if result.verdict == "pessimistic":
        return Answer(word, statement.tone, f"This filter's covariance is larger than its errors: {errors}")
    further = (_worst_output(summary, result, epochs), _silent(result))
    sentence = f"Do not trust this filter's covariance: {errors}"
    return Answer(word, statement.tone, sentence, tuple(filter(None, further)), "", _causes(result))


def _worst_output(summary: Summary, result: FilterSummary, epochs: Mapping[str, Array]) -> str:
    """Compare true and filter sigma of the output that the filter is most wrong about, at its worst time."""
    outputs = [
        departure for departure in result.departures
        if departure.of == "output" and departure.verdict == result.verdict
    ]  # fmt: skip
    worst = max(outputs, key=lambda departure: departure.factor or 0.0, default=None)
    if worst is None or worst.factor is None or worst.worst is None:
        return ""
    when = f"{humanize(worst.name)} at {instant(worst.worst, result.time)}"
    between = _ends(worst.factor_interval, 100.0 * (result.confidence or summary.confidence))
    return f"Worst: {when}, {_sigmas(summary, result, worst, epochs)}{rounded(worst.factor, 2)} times{between}."


def _ends(ends: Ends | None, confidence: float) -> str:
    low, high = ends or (None, None)
    return f" ({confidence:g} %: {rounded(low, 2)} to {rounded(high, 2)})" if low is not None else ""


def _sigmas(summary: Summary, result: FilterSummary, worst: Departure, epochs: Mapping[str, Array]) -> str:
    """Write true and filter sigma at that time; empty where they are not stored."""
    unit = next(output.unit for output in summary.outputs if output.name == worst.name)
    times = epochs.get(result.time)
    pair = [epochs.get(f"{kind} {worst.name} [{unit}]") for kind in ("sigma", "filter sigma")]
    if times is None or worst.worst is None or pair[0] is None or pair[1] is None:
        return ""
    scale, shown = shown_units(summary)[worst.name]
    place = int(np.abs(times - worst.worst).argmin())
    true, own = (rounded(float(column[place]) * scale, 2) for column in pair if column is not None)
    return f"true {true} {shown}, filter {own}: "


def _silent(result: FilterSummary) -> str:
    """Say that NIS of every sensor stays near its number of measurements, though the filter is wrong."""
    known = [sensor for sensor in result.sensors.values() if sensor.nis_mean is not None]
    if not known or any(sensor.verdict != "consistent" for sensor in known):
        return ""
    means = ", ".join(f"{sensor.nis_mean:.1f} where {sensor.size} is expected" for sensor in known)
    return f"NIS hardly shows it: {means}." if len(known) == 1 else ""


def _causes(result: FilterSummary) -> str:
    kinds = shares_by_kind((cause.name, cause.share) for cause in result.neglected)
    named = [(kind, share) for kind, share in kinds.items() if share >= LEAST][:NAMED]
    return ", ".join(f"{cause_words(kind)} {100.0 * share:.0f} %" for kind, share in named)
