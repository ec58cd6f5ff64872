"""Times of a linear answer as people read them, those of a trajectory as reports of runs have them."""

from __future__ import annotations

from dataclasses import replace

from mcnav.analysis.linear_answer import LinearAnswer
from mcnav.analysis.linear_covariance import LinearCovariance
from mcnav.analysis.linear_filter import LinearVerdict
from mcnav.contract.linear import TRAJECTORY_TIME
from mcnav.contract.time_axis import TimeAxis, time_axis


def read_axis(answer: LinearAnswer) -> TimeAxis | None:
    """Return how the times of an answer are read; none where they are not those of a trajectory, s."""
    if answer.history is None or answer.history.readings.label != TRAJECTORY_TIME:
        return None
    times = answer.history.readings.times
    return time_axis(TRAJECTORY_TIME.removesuffix(" [s]"), float(times[-1] - times[0]))


def as_read(answer: LinearAnswer) -> LinearAnswer:
    """Return the answer with times as they are read; one with times of another kind, or none, is left as it is."""
    axis = read_axis(answer)
    if axis is None:
        return answer
    return replace(
        answer,
        history=_covariance(answer.history, axis),
        asked=_covariance(answer.asked, axis),
        smoothed=_covariance(answer.smoothed, axis),
        smoothed_asked=_covariance(answer.smoothed_asked, axis),
        filter=_verdict(answer.filter, axis),
        smoother=_verdict(answer.smoother, axis),
        requirements=tuple(
            replace(requirement, time=_time(requirement.time, axis)) for requirement in answer.requirements
        ),
    )


def _time(time: float | None, axis: TimeAxis) -> float | None:
    return None if time is None else axis.read(time)


def _covariance(covariance: LinearCovariance | None, axis: TimeAxis) -> LinearCovariance | None:
    if covariance is None:
        return None
    readings = covariance.readings
    return replace(covariance, readings=replace(readings, times=axis.read(readings.times), label=axis.label))


def _verdict(verdict: LinearVerdict | None, axis: TimeAxis) -> LinearVerdict | None:
    if verdict is None:
        return None
    return replace(
        verdict, label=axis.label, times=axis.read(verdict.times), worst=axis.read(verdict.worst),
        begin=_time(verdict.begin, axis), end=_time(verdict.end, axis),
    )  # fmt: skip
