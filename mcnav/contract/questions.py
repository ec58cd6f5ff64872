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
    """

    readings: Literal["end", "epochs", "any time"] = "end"
    noise: bool = False
    updates: bool = False
    filter: bool = False
    smoother: bool = False


class Question(StrEnum):
    """A question about a system that not every system can answer."""

    OVER_TIME = "over time"
    ANY_TIME = "at any time"
    UPDATES = "before and after updates"
    START_TIMES = "start times"
    NOISE = "noise"
    FILTER = "filter"
    SMOOTHER = "smoother"
    GATES = "gates"
    FAULTS = "faults"


OF_TRANSITIONS: Final = frozenset(Question) - {Question.OVER_TIME, Question.NOISE, Question.FILTER}
"""Questions that transitions between the readings answer."""

OF_UPDATES: Final = frozenset({Question.UPDATES, Question.SMOOTHER, Question.GATES, Question.FAULTS})


def reason_against(question: Question, parts: TimelineParts) -> str:
    """Say why a system of these parts has no answer to a question; empty where it has one.

    >>> reason_against(Question.SMOOTHER, TimelineParts("any time"))
    'no measurement updates the errors'
    """
    if question == Question.OVER_TIME and parts.readings == "end":
        return "the system returns its errors at the end alone; declare epochs to have them over time"
    if question in OF_TRANSITIONS and parts.readings != "any time":
        known = "the end" if parts.readings == "end" else "its epochs"
        return f"the system returns its errors at {known} alone, so its transitions are unknown"
    if question == Question.NOISE and not parts.noise:
        return "errors are constant: no process of noise acts"
    if (question in OF_UPDATES and not parts.updates) or (question == Question.FILTER and not parts.filter):
        return "no measurement updates the errors"
    return ""
