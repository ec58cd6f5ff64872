"""Questions that one may ask of a system, and why some systems have no answer."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Final, Literal


@dataclass(frozen=True)
class TimelineParts:
    """What the timeline of a system has; known before the timeline is computed.

    Attributes
    ----------
    readings : str
        When errors are known: at the ``end`` alone, at ``epochs`` of the system's own, or at ``any time``.
    noise : bool
        Whether it may have processes of noise.
    updates : bool
        Whether measurements update it.
    filter : bool
        Whether a filter may compute a covariance of its own.
    smoother : bool
        Whether a smoother follows the filter.
    begins : bool
        Whether a navigator may start at later positions.
    """

    readings: Literal["end", "epochs", "any time"] = "end"
    noise: bool = False
    updates: bool = False
    filter: bool = False
    smoother: bool = False
    begins: bool = False


class Question(StrEnum):
    """A question about a system that not every system can answer."""

    OVER_TIME = "over time"
    ANY_TIME = "at any time"
    UPDATES = "before and after updates"
    START_TIMES = "start times"
    FILTER = "filter and NEES"
    SMOOTHER = "smoother"
    GATES = "gates"
    FAULTS = "faults"


_NO_MEASUREMENT: Final = "no measurement updates the errors"

_REASONS: Final = {
    Question.OVER_TIME: "the system returns its errors at the end alone; declare epochs to have them over time",
    Question.ANY_TIME: "the system returns its errors at {}; its transitions between these times are unknown",
    Question.UPDATES: _NO_MEASUREMENT,
    Question.START_TIMES: "the system returns its errors for its own start alone; its transitions are unknown",
    Question.FILTER: f"{_NO_MEASUREMENT}, so there is no filter",
    Question.SMOOTHER: f"{_NO_MEASUREMENT}, so there is no filter that a smoother could follow",
    Question.GATES: f"{_NO_MEASUREMENT}, so there is none that a gate could reject",
    Question.FAULTS: f"{_NO_MEASUREMENT}, so there is no sensor that could fail",
}


def reason_against(question: Question, parts: TimelineParts) -> str:
    """Say why a system of these parts has no answer to a question; empty where it has one.

    >>> reason_against(Question.SMOOTHER, TimelineParts("any time"))
    'no measurement updates the errors, so there is no filter that a smoother could follow'
    """
    answered = {
        Question.OVER_TIME: parts.readings != "end",
        Question.ANY_TIME: parts.readings == "any time",
        Question.UPDATES: parts.updates,
        Question.START_TIMES: parts.begins,
        Question.FILTER: parts.filter,
        Question.SMOOTHER: parts.smoother or (parts.updates and parts.filter),
        Question.GATES: parts.updates,
        Question.FAULTS: parts.updates,
    }
    known = "the end alone" if parts.readings == "end" else "its epochs alone"
    return "" if answered[question] else _REASONS[question].format(known)
