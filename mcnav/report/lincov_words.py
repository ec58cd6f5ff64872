"""Linear covariance of a campaign in sentences: range, filter, requirements, mean errors; the worst first."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from mcnav._types import Array
from mcnav.analysis.causes import Cause, causes_of
from mcnav.analysis.filter_causes import NEARLY
from mcnav.analysis.filter_consistency import MEAN, Honesty
from mcnav.analysis.filter_remarks import group_words, instant
from mcnav.analysis.linear_answer import LinearAnswer
from mcnav.analysis.linear_covariance import NOMINAL
from mcnav.analysis.linear_filter import LinearVerdict
from mcnav.analysis.vector_sizes import linear_sizes
from mcnav.report.figures.lincov import cause_labels
from mcnav.report.filter_verdict import LEAST
from mcnav.report.filter_verdict import TONES as FILTER_TONES
from mcnav.report.format import number, signed
from mcnav.report.names import humanize, scale_of
from mcnav.report.requirements import NAMED, listed
from mcnav.report.vector_sizes import size_sentence

WORSE: Final = 1e-6
"""Share by which a smoothed sigma exceeds that of its filter where it is worse, and not rounded."""

ROUNDING: Final = 1e-9
"""Share of an output's sigma and of what errors of usual size cause, below which its mean is rounding."""

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
        return "faults of sensors" if answer.kind == "ins" else "nominal value"
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
                f"In some output the smoother is worse than its filter at {worse.sum()} of {len(worse)} readings",
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
            f"The {name} is consistent: the true sigma of every output and of every group of them is within {within} "
            f"of its own at all {times} times",
            tone,
        )
        return
    if judged.verdict == Honesty.UNDECIDED:
        yield f"Whether the {name} is consistent is undecided: it is if its gates reject nothing", tone
        return
    worst = instant(judged.worst, judged.label)
    departure = _departure(answer, judged)
    yield f"The {name} is {judged.verdict.value} {_period(judged)}: at worst, at {worst}, {departure}", tone


def _period(judged: LinearVerdict) -> str:
    """Say when a filter's sigmas depart: all the time between two readings, or at some of them."""
    assert judged.begin is not None
    assert judged.end is not None
    begin, end = instant(judged.begin, judged.label), instant(judged.end, judged.label)
    if begin == end:
        return f"at {begin}"
    if not judged.throughout:
        return f"at {len(judged.departing)} of {len(judged.times)} readings from {begin} to {end}"
    return f"from {begin} on" if judged.end >= judged.times[-1] else f"from {begin} to {end}"


def _departure(answer: LinearAnswer, judged: LinearVerdict) -> str:
    """Say what departs the most, by how much, and because of which neglected errors."""
    if judged.group:
        return (
            f"the errors of {group_words(judged.group)} together are {judged.factor:.3g} times what it states (root of "
            "the expected NEES over the number of outputs), though each alone is within the tolerance"
        )
    name = humanize(judged.output)
    if math.isinf(judged.factor):
        words = f"it states no error of {name}, and there is one"
    else:
        words = f"the error of {name} is {judged.factor:.3g} times its own sigma"
    named = [cause for cause in judged.neglected if cause.share >= LEAST][:NAMED]
    if not named:
        return words
    return f"{words}, because of {listed([(label_of(answer, cause.name), cause.share) for cause in named])}"


def mean_words(answer: LinearAnswer) -> Iterator[tuple[str, str]]:
    """Say where a mean error is largest against its sigma, and what causes it; nothing where all means are zero.

    Commands, corrections and times are no errors; of what is of the truth, means count by which errors move it.
    """
    history = answer.meaningful
    if history is not None and not np.any(_without_rounding(answer, answer.model.nominal)):
        means, sigmas, parts = history.mean, history.sigma, dict(history.means)
    elif answer.beyond is None:
        means, sigmas = answer.mean[None], answer.sigma[None]
        parts = {name: values[None] for name, values in answer.means.items()}
    else:
        return
    if NOMINAL in parts:  # a time or an effort that a flight without errors has is no error
        of_errors = np.array([output.of == "navigation" for output in answer.outputs])
        means = means - np.where(of_errors, 0.0, parts[NOMINAL])
        parts[NOMINAL] = np.where(of_errors, parts[NOMINAL], 0.0)
    are_errors = np.array([output.of in ("navigation", "truth") for output in answer.outputs])
    sizes = np.abs(_without_rounding(answer, means)) * are_errors
    if not sizes.any():
        return
    ratios = _ratios(sizes, sigmas)
    largest = ratios.max(axis=1)
    at = int(np.flatnonzero(largest >= NEARLY * largest.max())[-1])
    output = int(np.argmax(ratios[at]))
    described, scale = answer.outputs[output], scale_of(answer.outputs)[output]
    mean, ratio = float(means[at, output]), float(ratios[at, output])
    when = "at the end" if history is None or len(means) == 1 else f"at {_reading(history.readings.times[at], answer)}"
    against = "where its sigma is zero" if math.isinf(ratio) else f"{ratio:.3g} times its sigma"
    causes = causes_of({}, {name: values[at, [output]] for name, values in parts.items()}, mean**2)
    words = listed([(label_of(answer, cause.name), cause.share) for cause in causes[:NAMED]])
    name = humanize(described.name)
    known = "; the filter knows of no mean" if answer.filter is not None else ""
    yield (
        f"Mean errors are not zero: that of {name} is {signed(mean * scale)} {described.shown_in} {when}, {against}, "
        f"because of {words}{known}",
        "",
    )


def final_means(answer: LinearAnswer) -> Array:
    """Return the mean of the final errors, shape (outputs,), SI; what is rounding is zero."""
    return _without_rounding(answer, answer.mean)


def _without_rounding(answer: LinearAnswer, means: Array) -> Array:
    """Set means that are rounding to zero; shape (..., outputs)."""
    usual = np.abs(answer.model.partials) @ [abs(source.nominal) for source in answer.sources]
    largest = answer.sigma if answer.history is None else answer.history.sigma.max(axis=0, initial=0.0)
    return np.where(np.abs(means) > ROUNDING * (usual + largest), means, 0.0)


def _reading(time: float, answer: LinearAnswer) -> str:
    assert answer.history is not None
    return instant(float(time), answer.history.readings.label)


def _ratios(sizes: Array, sigmas: Array) -> Array:
    """Divide means by sigmas: zero over zero is zero."""
    ratios = np.divide(sizes, sigmas, out=np.zeros_like(sizes), where=sigmas > 0.0)
    return np.where((sigmas <= 0.0) & (sizes > 0.0), np.inf, ratios)
