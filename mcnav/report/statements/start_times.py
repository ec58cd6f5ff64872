"""The best start of navigation in a sentence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mcnav.analysis.linear_range import limits_of, outputs_beyond
from mcnav.analysis.mean_errors import LargeMean
from mcnav.analysis.verdict import combine_verdicts
from mcnav.contract.quantities import Output, kind_of
from mcnav.physics.units import conversion
from mcnav.report.format import number, signed
from mcnav.report.names import humanize
from mcnav.report.statements.means import DIGITS, against

if TYPE_CHECKING:
    from mcnav.analysis.comparison import Comparison
    from mcnav.linear.start_times import StartTimeStudy


def minutes(seconds: float) -> str:
    """Format a time from the event in minutes."""
    return f"{seconds / 60.0:.1f}".replace("-", "−")


def answer(study: StartTimeStudy, checks: Mapping[float, Comparison], outputs: Sequence[Output]) -> str:
    """Say when to start for all outputs together, and whether Monte Carlo agrees there.

    ``checks`` are Monte Carlo comparisons by start time, s.
    """
    means = np.zeros(len(outputs)) if study.means is None else study.means
    beyond = outputs_beyond(limits_of(output.limit for output in outputs), means, study.sigma)
    candidates, place = beyond[: study.before_event], study.best_weighted
    if candidates.any(axis=1).all():
        exceeding = _exceeding(np.asarray(candidates.any(axis=0)), outputs)
        return (
            f"At every start errors are beyond the range of linear analysis ({exceeding}): it does not say when to "
            "start."
        )
    gain = study.weighted[place] / study.weighted[0] if study.weighted[0] > 0.0 else 1.0
    what = f"Of the starts compared it has the smallest {_weighted(study, outputs)}"
    words = [_of_means(study, outputs)] if study.means_matter else []
    if place == 0:
        words.append(
            f"Start at the first point, {minutes(study.times[0])} {study.clock.label}. {what}. An earlier start was "
            "not compared."
        )
    else:
        words.append(
            f"Start at {minutes(study.times[place])} {study.clock.label}. {what}: {gain:.3g} times that of the "
            "earliest start."
        )
    if place > 0 and place == study.before_event - 1:
        event = study.clock.event
        words.append(f"It is the latest compared{f'; starts after {event} do not count' if event else ''}.")
    if (differing := _of_single_outputs(study, outputs)) and len(outputs) > 1:
        words.append(differing)
    if beyond[place].any():
        exceeding = _exceeding(beyond[place], outputs)
        words.append(f"Errors of that start are beyond the range of linear analysis ({exceeding}): do not rely on it.")
        return " ".join(words)
    return " ".join([*words, _confirmed(study, checks)]).strip()


def _of_means(study: StartTimeStudy, outputs: Sequence[Output]) -> str:
    """Say where a mean error exceeds its sigma the most, and that start times rank by root mean square."""
    assert study.means is not None
    sigma, means = study.sigma[: study.before_event], study.means[: study.before_event]
    large = np.abs(means) > sigma
    ratios = np.divide(np.abs(means), sigma, out=np.where(large, np.inf, 0.0), where=sigma > 0.0)
    place, index = np.unravel_index(int(np.argmax(ratios)), ratios.shape)
    output = outputs[int(index)]
    scale = conversion(output.unit, output.shown_in)
    large_mean = LargeMean(int(index), float(means[place, index]), float(sigma[place, index]))
    return (
        f"At {int(large.any(axis=1).sum())} of {len(large)} start times a mean error exceeds its sigma. Worst: the "
        f"mean error of {humanize(output.name)} for a start at {minutes(study.times[place])} {study.clock.label}. "
        f"It is {signed(large_mean.mean * scale, DIGITS)} {output.shown_in}, "
        f"{against(large_mean, scale, output.shown_in)}. Start times rank by root mean square."
    )


def _weighted(study: StartTimeStudy, outputs: Sequence[Output]) -> str:
    """Name what is weighted."""
    if study.means_matter:
        return "weighted root mean square"
    counted = {kind_of(output) for output, weight in zip(outputs, study.weights, strict=True) if weight > 0.0}
    if counted == {study.clock.weighs}:
        return f"weighted {study.clock.weighs.lower()}"
    return "weighted sigma of all outputs"


def _exceeding(beyond: NDArray[np.bool_], outputs: Sequence[Output]) -> str:
    """Name the outputs that are beyond their limits, shape (outputs,), with these."""
    named = []
    for output, far in zip(outputs, beyond, strict=True):
        if far and output.limit is not None:
            limit = number(output.limit * conversion(output.unit, output.shown_in))
            named.append(f"{humanize(output.name)} exceeds {limit} {output.shown_in}")
    return " and ".join(named)


def _of_single_outputs(study: StartTimeStudy, outputs: Sequence[Output]) -> str:
    """Say between which times the best starts of single outputs lie; empty where they are the same."""
    counted = np.flatnonzero(study.weights > 0.0) if study.clock.weighs else np.arange(len(outputs))
    best = study.times[study.best[counted]]
    first, last = (int(place(best)) for place in (np.argmin, np.argmax))
    if minutes(best[first]) == minutes(best[last]):
        return ""
    ends = [f"{minutes(best[place])} ({humanize(outputs[counted[place]].name)})" for place in (first, last)]
    return f"Single outputs have their best starts from {ends[0]} to {ends[1]}."


def _confirmed(study: StartTimeStudy, checks: Mapping[float, Comparison]) -> str:
    """Say whether Monte Carlo agrees at the best start; empty where it was not run there."""
    time = float(study.times[study.best_weighted])
    confirmed = next((check for when, check in checks.items() if np.isclose(when, time, rtol=0.0, atol=1e-6)), None)
    if confirmed is None or not confirmed.outputs:
        return ""
    weighted = [
        output.paired.verdict for output, weight in zip(confirmed.outputs, study.weights, strict=True) if weight > 0.0
    ]
    words = {
        "agrees": "Monte Carlo agrees with linear analysis there.",
        "differs": "Monte Carlo differs from linear analysis there: do not rely on it.",
    }
    return words.get(combine_verdicts(weighted).value, "Monte Carlo does not decide there.")
