"""A linear answer with other sizes of its errors: with the same gains all covariances add up.

C(t) = P S P' + sum_j f_j Q_j        S, f_j: covariance of the sources, and relative variances of processes
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from mcnav.analysis.accuracy_measures import requirement_measures
from mcnav.analysis.linear_answer import LinearAnswer, LinearRequirement, judge_within_range
from mcnav.analysis.linear_covariance import LinearCovariance, Moments, covariance_over_time
from mcnav.analysis.linear_range import limits_of
from mcnav.analysis.requirements import Requirement
from mcnav.arrays.types import Array
from mcnav.contract.linear import CovarianceReadings


def resize(
    answer: LinearAnswer, mean: Array, covariance: Array, squares: Mapping[str, float], over_time: bool = True
) -> LinearAnswer:
    """Return the model and the history of an answer for other errors; no requirement is judged.

    Parameters
    ----------
    mean, covariance : ndarray, shapes (sources,) and (sources, sources)
        Of the sources.
    squares : mapping of str to float
        What the variance of a process is multiplied by; one for those missing.
    over_time : bool
        Whether the history is needed; without it the answer keeps its own.
    """
    model, names = answer.model, tuple(source.name for source in answer.sources)
    processes = {name: squares.get(name, 1.0) * process for name, process in model.processes.items()}

    def again(history: LinearCovariance | None) -> LinearCovariance | None:
        if history is None or not over_time:
            return history
        noise = {name: squares.get(name, 1.0) * process for name, process in history.readings.processes.items()}
        return covariance_over_time(replace(history.readings, processes=noise), names, mean, covariance)

    nan = math.nan
    return replace(
        answer,
        model=replace(model, mean=mean, covariance=covariance, processes=processes),
        history=again(answer.history),
        smoothed=again(answer.smoothed),
        requirements=tuple(LinearRequirement(row.requirement, nan, nan) for row in answer.requirements),
    )


def judged(answer: LinearAnswer) -> tuple[LinearRequirement, ...]:
    """Judge the requirements of a resized answer; those of another one are as they were judged."""
    model, limits = answer.model, limits_of(output.limit for output in answer.outputs)
    return tuple(
        row if row.judged else judge_within_range(
            [row.requirement], limits, model.outcome_mean, model.outcome_covariance,
            _moments(answer, row.requirement), model.sizes, model.nominal, model.origin,
        )[0]
        for row in answer.requirements
    )  # fmt: skip


def requirement_value(answer: LinearAnswer, number: int) -> float:
    """Compute the value of a requirement, SI, without its margin, which takes the most of a judgement."""
    row, model = answer.requirements[number], answer.model
    if row.judged:
        return row.value
    (measure,) = requirement_measures([row.requirement], answer.outputs)
    known = _moments(answer, row.requirement)
    if measure.readings and known is not None:
        return measure.value(
            CovarianceReadings(known.times, known.mean, known.covariance, None, known.nominal, known.origin)
        )
    nominal, origin = model.nominal[None], None if model.origin is None else model.origin[None]
    mean, covariance = model.outcome_mean[None], model.outcome_covariance[None]
    return replace(measure, readings=(0,)).value(
        CovarianceReadings(np.zeros(1), mean, covariance, None, nominal, origin)
    )


def _moments(answer: LinearAnswer, requirement: Requirement) -> Moments | None:
    known = answer.smoothed if requirement.of else answer.history
    return None if known is None else known.moments
