"""Samples simulated one by one: each succeeds, or fails by itself."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from mcnav._types import Array
from mcnav.scenarios.failure import Failure, Reason
from mcnav.scenarios.protocol import SimulationResult
from mcnav.scenarios.timeouts import SampleTimeout, within_limit

LONGEST_REASON: Final = 200
LONGEST_TRACEBACK: Final = 4_000


class SampleFailed(Exception):
    """Raised for one sample, with its `Failure`."""

    def __init__(self, failure: Failure) -> None:
        super().__init__(str(failure))
        self.failure = failure


@dataclass(frozen=True)
class SampleResults:
    """Results of some rows of errors.

    Attributes
    ----------
    values : mapping of int to ndarray, shape (outputs,)
        Rows that succeeded.
    failures : mapping of int to Failure
        The others.
    """

    values: Mapping[int, Array] = field(default_factory=dict)
    failures: Mapping[int, Failure] = field(default_factory=dict)

    def outcomes(self, values: Array, fallback_count: int = 0) -> SimulationResult:
        """Write the rows into values, shape (n, outputs), failed ones as NaN."""
        for row, value in self.values.items():
            values[row] = value
        values[list(self.failures)] = np.nan
        return SimulationResult(values, self.failures, fallback_count)


def simulate_each(
    simulate: Callable[[int], Array], rows: Iterable[int], diverged: type[Exception] | tuple[()] = (), file: str = ""
) -> SampleResults:
    """Simulate rows one by one.

    Parameters
    ----------
    simulate : callable
        Row to outputs, shape (outputs,); `SampleFailed` states a failure.
    rows : iterable of int
    diverged : type of Exception, optional
        Raised where a trajectory cannot be continued: its message is the sample's, without a traceback.
    file : str
        Of the user's code: its line is named with other exceptions.
    """
    values: dict[int, Array] = {}
    failures: dict[int, Failure] = {}
    for row in rows:
        try:
            outputs = within_limit(lambda row=row: simulate(row))  # type: ignore[misc]
        except SampleFailed as failed:
            failures[row] = failed.failure
        except SampleTimeout as late:
            failures[row] = Failure(Reason.TIMEOUT, str(late))
        except diverged as reason:
            failures[row] = Failure(Reason.DIVERGED, str(reason))
        except MemoryError:
            raise
        except (Exception, SystemExit) as error:
            text = "".join(traceback.format_exception(error, limit=-12))
            text = text if len(text) <= LONGEST_TRACEBACK else "..." + text[-LONGEST_TRACEBACK:]
            failures[row] = Failure(Reason.RAISED, format_exception(error, file), text)
        else:
            if np.isfinite(outputs).all():
                values[row] = outputs
            else:
                failures[row] = Failure.of(Reason.NOT_FINITE)
    return SampleResults(values, failures)


def format_exception(failure: BaseException, file: str) -> str:
    """Format an exception in one line, with the line of the user's file where it arose.

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
