"""Questions that one may ask of a system, and why some systems have no answer."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Final, Literal


@dataclass(frozen=True)
class TimelineParts:
    """Parts of a system's timeline, known before the timeline is computed.

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


UNMEASURED: Final = "no known measurement updates the errors"
"""Reason against what follows from measurements."""


def reason_against(question: Question, parts: TimelineParts) -> str:
    """Say why a system of these parts has no answer to a question; empty where it has one.

    >>> reason_against(Question.SMOOTHER, TimelineParts("any time"))
    'no known measurement updates the errors'
    """
    if question == Question.OVER_TIME and parts.readings == "end":
        return "the system returns its errors at the end alone; declare epochs to have them over time"
    if question in (Question.ANY_TIME, Question.START_TIMES) and parts.readings != "any time":
        known = "the end" if parts.readings == "end" else "its epochs"
        return f"the system returns its errors at {known} alone, so its state transitions are unknown"
    if question == Question.NOISE and not parts.noise:
        return "errors are constant: no process of noise acts"
    if question == Question.FILTER:
        return "" if parts.filter else UNMEASURED
    of_updates = question in (Question.UPDATES, Question.SMOOTHER, Question.GATES, Question.FAULTS)
    return UNMEASURED if of_updates and not parts.updates else ""
