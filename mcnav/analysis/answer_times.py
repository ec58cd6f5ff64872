"""Times of a linear answer as people read them: those of a trajectory in minutes, as reports of runs have them."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from mcnav.analysis.linear_answer import LinearAnswer
from mcnav.analysis.linear_covariance import LinearCovariance
from mcnav.analysis.linear_filter import LinearVerdict
from mcnav.contract.linear import TRAJECTORY_TIME

MINUTE: Final = 60.0
MINUTES: Final = TRAJECTORY_TIME.replace("[s]", "[min]")


def in_minutes(answer: LinearAnswer) -> LinearAnswer:
    """Return the answer with times of a trajectory in minutes; one with other times, or none, is left as it is."""
    if not is_of_trajectory(answer):
        return answer
    return replace(
        answer,
        history=_covariance(answer.history),
        asked=_covariance(answer.asked),
        smoothed=_covariance(answer.smoothed),
        smoothed_asked=_covariance(answer.smoothed_asked),
        filter=_verdict(answer.filter),
        smoother=_verdict(answer.smoother),
        requirements=tuple(replace(each, time=_minutes(each.time)) for each in answer.requirements),
    )


def is_of_trajectory(answer: LinearAnswer) -> bool:
    """Return whether the times are those of a trajectory, s."""
    return answer.history is not None and answer.history.readings.label == TRAJECTORY_TIME


def _minutes(time: float | None) -> float | None:
    return None if time is None else time / MINUTE


def _covariance(covariance: LinearCovariance | None) -> LinearCovariance | None:
    if covariance is None:
        return None
    readings = covariance.readings
    return replace(covariance, readings=replace(readings, times=readings.times / MINUTE, label=MINUTES))


def _verdict(verdict: LinearVerdict | None) -> LinearVerdict | None:
    if verdict is None:
        return None
    return replace(
        verdict, label=MINUTES, times=verdict.times / MINUTE, worst=verdict.worst / MINUTE,
        begin=_minutes(verdict.begin), end=_minutes(verdict.end),
    )  # fmt: skip
