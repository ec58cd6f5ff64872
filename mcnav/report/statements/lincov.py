"""Linear covariance of a campaign in sentences: range, filter, requirements, mean errors; the worst first."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav.analysis.causes import Cause, causes_of
from mcnav.analysis.filter_causes import NEARLY
from mcnav.analysis.filter_consistency import MEAN, Honesty
from mcnav.analysis.filter_remarks import group_words, instant
from mcnav.analysis.linear_answer import LinearAnswer
from mcnav.analysis.linear_covariance import NOMINAL
from mcnav.analysis.linear_filter import LinearVerdict
from mcnav.analysis.mean_errors import (
    LargeMean,
    departures,
    in_sigmas,
    large_means,
    mean_errors,
    nominal_values,
    rounding_of_means,
)
from mcnav.analysis.vector_sizes import linear_sizes
from mcnav.arrays.types import Array
from mcnav.report.columns.requirements import NAMED
from mcnav.report.columns.vector_sizes import size_sentence
from mcnav.report.figures.lincov import cause_labels
from mcnav.report.format import number, signed
from mcnav.report.names import humanize, scale_of
from mcnav.report.statements.fields import LEAST
from mcnav.report.statements.means import against, sentence_on
from mcnav.report.statements.words import TONES as FILTER_TONES
from mcnav.report.statements.words import listed

WORSE: Final = 1e-6
"""Share by which a smoothed sigma exceeds that of its filter where it is worse, and not rounded."""

ORDER: Final = ("differs", "partly", "undecided", "", "agrees")
"""Tones of sentences, the worst first."""


def worst_first(sentences: Sequence[tuple[str, str]]) -> list[tuple[str, str]]:
    """Sort sentences with their tones; those of one tone keep their order.

    >>> worst_first([("met", "agrees"), ("optimistic", "differs")])
    [('optimistic', 'differs'), ('met', 'agrees')]
    """
    return sorted(sentences, key=lambda sentence: ORDER.index(sentence[1]))


def label_of(answer: LinearAnswer, cause: str) -> str:
    """Name a cause for people.

    Parameters
    ----------
    cause : str
        Name of a source or process, or of a source's mean.
    """
    labels = dict(zip(answer.causes, cause_labels(answer), strict=True))
    name = cause.removeprefix(MEAN)
    if name == NOMINAL:
        return "faults of sensors" if answer.kind == "ins" else "the nominal flight itself"
    return f"{'mean of ' if cause != name else ''}{labels.get(name, humanize(name))}"


def cause_words(answer: LinearAnswer, causes: Sequence[Cause]) -> list[tuple[str, float]]:
    """Return the largest causes by the names that people read, with their shares."""
    return [(label_of(answer, cause.name), cause.share) for cause in causes[:NAMED]]


def range_words(answer: LinearAnswer) -> Iterator[tuple[str, str]]:
    """Say from when on linear errors have no meaning; nothing where all are within their range."""
    if answer.beyond is None:
        return
    scale = scale_of(answer.outputs)
    limits = []
    for output in answer.beyond.outputs:
        described = answer.outputs[output]
        size = "" if described.limit is None else f" exceeds {number(described.limit * scale[output])} "
        limits.append(f"{humanize(described.name)}{size}{described.shown_in if size else ''}")
    time, history = answer.beyond.time, answer.history
    since = "at the end" if time is None or history is None else f"from {instant(time, history.readings.label)} on"
    yield f"Errors are beyond the range of linear analysis {since}: {' and '.join(limits)}", "differs"


def size_words(answer: LinearAnswer) -> Iterator[tuple[str, str]]:
    """Say what the sizes of corrections are by their exact law; nothing without any, or beyond the linear range."""
    if answer.beyond is not None:
        return
    scale = scale_of(answer.outputs)
    for law in linear_sizes(answer.model.sizes, answer.mean, answer.covariance):
        output = answer.outputs[law.output]
        numbers = (law.median, law.mean, law.most)
        words = size_sentence(
            output.name, numbers, law.three_sigma, law.wrong, float(scale[law.output]), output.shown_in
        )
        yield words.removesuffix("."), ""


def filter_words(answer: LinearAnswer) -> Iterator[tuple[str, str]]:
    """Put the verdict on the filter in a sentence; nothing without a filter."""
    yield from _verdict_words(answer, answer.filter, "filter")
    yield from _verdict_words(answer, answer.smoother, "smoother")
    if (smoothed := answer.smoothed) is not None and (filtered := answer.history) is not None:
        worse = np.any(smoothed.sigma > filtered.sigma * (1.0 + WORSE), axis=1)
        if worse.any():
            yield (
                f"In some output the smoother is worse than its filter at {worse.sum()} of {len(worse)} epochs",
                "undecided",
            )


def _verdict_words(answer: LinearAnswer, judged: LinearVerdict | None, name: str) -> Iterator[tuple[str, str]]:
    """Put the verdict on a filter or a smoother in a sentence; nothing without one."""
    if judged is None:
        return
    within = f"±{100.0 * judged.tolerance:g} %"
    tone = FILTER_TONES[judged.verdict.value]
    if judged.verdict == Honesty.CONSISTENT:
        times = len(np.unique(judged.times))
        yield (
            f"The {name} is consistent: every output and every group is within {within} of the {name} sigma at all "
            f"{times} times{_floors(answer, judged)}",
            tone,
        )
        return
    if judged.verdict == Honesty.UNDECIDED:
        yield f"Whether the {name} is consistent is undecided: it is if its gates reject nothing", tone
        return
    departure = _departure(judged)
    yield f"The {name} is {judged.verdict.value}{departure}{_together(judged)}{_unmodelled(answer, judged)}", tone


def _floors(answer: LinearAnswer, judged: LinearVerdict) -> str:
    """Name the errors that are too small to count, with the largest floor of each unit; empty without any."""
    scale, of_units = dict(zip(answer.outputs, scale_of(answer.outputs), strict=True)), dict[str, list[float]]()
    for output in answer.outputs:
        if output.name in judged.floors:
            of_units.setdefault(output.shown_in, []).append(judged.floors[output.name] * scale[output])
    sizes = [f"{number(max(floors), 2)} {unit}" for unit, floors in of_units.items()]
    return f". Errors up to {' or '.join(sizes)} count as none" if sizes else ""


def _period(judged: LinearVerdict) -> str:
    """Say when a filter's sigmas depart: all the time between two epochs, or at some of them."""
    assert judged.begin is not None
    assert judged.end is not None
    begin, end = instant(judged.begin, judged.label), instant(judged.end, judged.label)
    if begin == end:
        return f"at {begin}"
    if not judged.throughout:
        return f"at {len(judged.departing)} of {len(judged.times)} epochs from {begin} to {end}"
    return f"from {begin} on" if judged.end >= judged.times[-1] else f"from {begin} to {end}"


def _departure(judged: LinearVerdict) -> str:
    """Say by how much the filter departs, in what, when, and when the most."""
    when, worst = _period(judged), instant(judged.worst, judged.label)
    if judged.group:
        words = f"by a factor of {judged.factor:.3g} in {group_words(judged.group)} as a group"
        alone = "optimistic" if judged.verdict == Honesty.OPTIMISTIC else "pessimistic"
        return f" {words} {when}. It is worst at {worst}. No output alone is {alone}"
    name = humanize(judged.output)
    if math.isinf(judged.factor):
        return f" {when}: at {worst} it computes no error of {name}, and there is one"
    return f" by a factor of {judged.factor:.3g} {when}. It is worst in {name}, at {worst}"


def _together(judged: LinearVerdict) -> str:
    """Say which errors are farther off as a group than each alone; empty where none are."""
    if judged.together is None:
        return ""
    group, factor = judged.together
    return f". In {group_words(group)} as a group the factor is {factor:.3g}"


def _unmodelled(answer: LinearAnswer, judged: LinearVerdict) -> str:
    """Name the largest errors that the filter neglects; empty without any."""
    named = [cause for cause in judged.neglected if cause.share >= LEAST][:NAMED]
    if not named:
        return ""
    return f". Largest unmodelled errors: {listed([(label_of(answer, cause.name), cause.share) for cause in named])}"


@dataclass(frozen=True)
class _Means:
    """Mean errors and sigmas at the readings of a linear answer, shape (r, outputs), SI, and their parts by cause.

    ``times`` is none where the end alone is known.
    """

    errors: Array
    sigmas: Array
    parts: Mapping[str, Array]
    times: Array | None

    def when(self, at: int, answer: LinearAnswer) -> str:
        """Say when a reading is."""
        return "at the end" if self.times is None else f"at {_reading(self.times[at], answer)}"


def _mean_errors(answer: LinearAnswer) -> _Means | None:
    """Return the mean errors over time where they are known, else at the end; none beyond the linear range.

    What is rounding is zero, and so are commands, sizes and times, which are no errors.
    """
    history, model = answer.meaningful, answer.model
    of_errors = np.array([output.of == "navigation" for output in answer.outputs])
    known = history is not None and history.readings.nominal is not None
    if history is not None and (known or not np.any(np.where(of_errors, model.nominal, 0.0))):
        means, sigmas, parts, times = history.mean, history.sigma, dict(history.means), history.readings.times
        nominal = history.readings.nominal
    elif answer.beyond is None:
        means, sigmas, times, nominal = answer.mean[None], answer.sigma[None], None, model.nominal
        parts = {name: values[None] for name, values in answer.means.items()}
    else:
        return None
    if NOMINAL in parts:  # a time or an effort that a flight without errors has is no error
        parts[NOMINAL] = np.where(of_errors, parts[NOMINAL], 0.0)
    errors = np.nan_to_num(mean_errors(answer.outputs, means, nominal))
    return _Means(np.where(np.abs(errors) > _rounding(answer), errors, 0.0), sigmas, parts, times)


def large_mean_words(answer: LinearAnswer) -> Iterator[tuple[str, str]]:
    """Say which mean errors exceed one sigma at the end, and where one exceeds it by more; nothing without any."""
    known = _mean_errors(answer)
    if known is None:
        return
    floor, scale = np.zeros(len(answer.outputs)), scale_of(answer.outputs)
    named = [
        (output.name, output.of, float(factor), output.shown_in)
        for output, factor in zip(answer.outputs, scale, strict=True)
    ]
    largest = in_sigmas(np.abs(known.errors), known.sigmas).max(axis=1)
    last, worst = len(largest) - 1, int(np.argmax(largest))
    for at in (last, worst) if largest[worst] > largest[last] / NEARLY else (last,):
        if large := large_means(known.errors[at], known.sigmas[at], floor):
            causes = _causes_of_mean(answer, known, at, large[0].output)
            words = sentence_on(large, named).removesuffix(".")
            yield f"{words}. This is {known.when(at, answer)}. Causes: {causes}", "partly"


def mean_words(answer: LinearAnswer) -> Iterator[tuple[str, str]]:
    """Say where a mean error is largest against its sigma, and what causes it; nothing where all means are zero."""
    known = _mean_errors(answer)
    if known is None or not known.errors.any():
        return
    ratios = in_sigmas(np.abs(known.errors), known.sigmas)
    largest = ratios.max(axis=1)
    at = int(np.flatnonzero(largest >= NEARLY * largest.max())[-1])
    output = int(np.argmax(ratios[at]))
    described, scale = answer.outputs[output], scale_of(answer.outputs)[output]
    large = LargeMean(output, float(known.errors[at, output]), float(known.sigmas[at, output]))
    when, causes = known.when(at, answer), _causes_of_mean(answer, known, at, output)
    filtered = ". The filter computes no mean" if answer.filter is not None else ""
    yield (
        f"Mean errors are not zero: that of {humanize(described.name)} {when} is {signed(large.mean * scale)} "
        f"{described.shown_in}, {against(large, scale, described.shown_in)}. Causes: {causes}{filtered}",
        "",
    )


def _causes_of_mean(answer: LinearAnswer, known: _Means, at: int, output: int) -> str:
    """Name the largest causes of a mean error, with their shares."""
    parts = {name: values[at, [output]] for name, values in known.parts.items()}
    causes = causes_of({}, parts, float(known.errors[at, output]) ** 2)
    return listed([(label_of(answer, cause.name), cause.share) for cause in causes[:NAMED]])


def final_means(answer: LinearAnswer) -> Array:
    """Return the mean of the final errors, and of others off the nominal, shape (outputs,), SI; rounding is zero."""
    means = departures(answer.outputs, answer.mean, answer.model.nominal)
    return np.where(np.abs(means) > _rounding(answer), means, 0.0)


def final_nominal(answer: LinearAnswer) -> Array:
    """Return the values on the nominal flight, shape (outputs,), SI; NaN of navigation errors."""
    return nominal_values(answer.outputs, answer.model.nominal, answer.model.origin, answer.sigma)


def _rounding(answer: LinearAnswer) -> Array:
    """Return below which size a mean is rounding, shape (outputs,), SI."""
    largest = answer.sigma if answer.history is None else answer.history.sigma.max(axis=0, initial=0.0)
    return rounding_of_means(answer.outputs, answer.sources, answer.model.partials, answer.mean, largest)


def _reading(time: float, answer: LinearAnswer) -> str:
    assert answer.history is not None
    return instant(float(time), answer.history.readings.label)
