"""Samples flown one by one: each succeeds, or fails by itself with its reason."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from mcnav._types import Array
from mcnav.scenarios.protocol import SimulationResult
from mcnav.scenarios.timeouts import SampleTimeout, within_limit

LONGEST_REASON: Final = 200
LONGEST_TRACEBACK: Final = 4_000

NOT_FINITE: Final = "an output is not finite"


class SampleFailed(Exception):
    """A sample's own reason, to be told as it is."""


@dataclass(frozen=True)
class SampleResults:
    """What became of some rows of errors.

    Attributes
    ----------
    values : mapping of int to ndarray, shape (outputs,)
        Rows that were flown to the end.
    failures : mapping of int to str
        The others, and why.
    tracebacks : mapping of int to str
        Of those that raised.
    """

    values: Mapping[int, Array] = field(default_factory=dict)
    failures: Mapping[int, str] = field(default_factory=dict)
    tracebacks: Mapping[int, str] = field(default_factory=dict)

    def outcomes(self, values: Array, handed_over: int = 0) -> SimulationResult:
        """With the rows flown written into values, shape (n, outputs), and failed ones NaN."""
        for row, value in self.values.items():
            values[row] = value
        for row in self.failures:
            values[row] = np.nan
        return SimulationResult(values, self.failures, handed_over, self.tracebacks)


def simulate_each(
    fly: Callable[[int], Array], rows: Iterable[int], expected: type[Exception] = SampleFailed, file: str = ""
) -> SampleResults:
    """Fly rows one by one.

    Parameters
    ----------
    fly : callable
        Row to outputs, shape (outputs,).
    rows : iterable of int
    expected : type of Exception
        A flight's own way to fail: its message is the reason, and no traceback is kept.
    file : str
        Of the user's code: its line is named beside other exceptions.
    """
    values: dict[int, Array] = {}
    failures: dict[int, str] = {}
    tracebacks: dict[int, str] = {}
    for row in rows:
        try:
            found = within_limit(lambda row=row: fly(row))  # type: ignore[misc]
        except (expected, SampleTimeout) as reason:
            failures[row] = str(reason)
        except MemoryError:
            raise
        except (Exception, SystemExit) as failure:
            failures[row] = format_exception(failure, file)
            text = "".join(traceback.format_exception(failure, limit=-12))
            tracebacks[row] = text if len(text) <= LONGEST_TRACEBACK else "..." + text[-LONGEST_TRACEBACK:]
        else:
            if np.isfinite(found).all():
                values[row] = found
            else:
                failures[row] = NOT_FINITE
    return SampleResults(values, failures, tracebacks)


def format_exception(failure: BaseException, file: str) -> str:
    """An exception in one line, with the line of the user's file where it arose.

    >>> format_exception(ValueError("no fuel"), "boost.py")
    'ValueError: no fuel'
    """
    place = ""
    if isinstance(failure, SyntaxError):
        place = f" (line {failure.lineno})"
    trace = failure.__traceback__
    while trace is not None:
        if trace.tb_frame.f_code.co_filename == file:
            place = f" (line {trace.tb_lineno})"
        trace = trace.tb_next
    try:
        words = str(failure)
    except Exception:  # a user's exception may not even be able to say what it is
        words = "(no message)"
    text = " ".join(f"{type(failure).__name__}: {words}".split())
    text = "".join(c if c.isprintable() else "?" for c in text)
    return (text if len(text) <= LONGEST_REASON else text[: LONGEST_REASON - 3] + "...") + place
