"""Samples simulated one by one: each succeeds, or fails by itself."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.failure import Failure, Reason
from mcnav.contract.samples import SimulationResult
from mcnav.systems.guard import raised_by
from mcnav.systems.timeouts import SampleTimeout, within_limit

LONGEST_REASON: Final = 200
LONGEST_TRACEBACK: Final = 4_000


class SampleFailed(Exception):
    """Raised for one sample, with its `Failure`."""

    def __init__(self, failure: Failure) -> None:
        super().__init__(str(failure))
        self.failure = failure


def simulate_each(
    simulate: Callable[[int], Array],
    rows: Iterable[int],
    values: Array,
    diverged: type[Exception] | tuple[()] = (),
    file: str = "",
) -> dict[int, Failure]:
    """Simulate rows one by one into ``values``, shape (n, outputs); return the failures by row, whose values are NaN.

    Parameters
    ----------
    simulate : callable
        Row to outputs, shape (outputs,); `SampleFailed` states a failure.
    diverged : type of Exception, optional
        Raised where a trajectory cannot be continued: its message is the sample's, without a traceback.
    file : str
        Of the user's code: its line is named with other exceptions.
    """
    failures: dict[int, Failure] = {}
    for row in rows:
        values[row] = np.nan
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
        except Exception as error:
            text = "".join(traceback.format_exception(raised_by(error), limit=-12))
            text = text if len(text) <= LONGEST_TRACEBACK else "..." + text[-LONGEST_TRACEBACK:]
            failures[row] = Failure(Reason.RAISED, format_exception(error, file), text)
        else:
            if np.isfinite(outputs).all():
                values[row] = outputs
            else:
                failures[row] = Failure.of(Reason.NOT_FINITE)
    return failures


def simulate_alone(
    simulate: Callable[[int], SimulationResult], count: int, outputs: int, file: str = ""
) -> SimulationResult:
    """Simulate samples, each by itself, so that only those at fault fail; see `simulate_each`.

    ``simulate`` takes a row to the result of that sample.
    """
    values, result = np.empty((count, outputs)), [SimulationResult(np.full((1, outputs), np.nan))] * count

    def one(row: int) -> Array:
        result[row] = simulate(row)
        if result[row].failures:
            raise SampleFailed(result[row].failures[0])
        return np.asarray(result[row].values[0])

    failures = simulate_each(one, range(count), values, file=file)
    return replace(join_results(result), values=values, failures=failures)


def join_results(results: Sequence[SimulationResult]) -> SimulationResult:
    """Join the results of samples or of pieces; what one of them lacks, such as a history, is NaN."""
    begins = np.cumsum([0] + [len(result.values) for result in results])

    def joined(name: str) -> Array | None:
        each = [getattr(result, name) for result in results]
        known = next((values for values in each if values is not None), None)
        if known is None:
            return None
        return np.concatenate([np.full_like(known, np.nan) if values is None else values for values in each])

    return SimulationResult(
        np.concatenate([result.values for result in results]),
        {
            int(begin) + row: failure
            for begin, result in zip(begins, results, strict=False)
            for row, failure in result.failures.items()
        },
        sum(result.fallback_count for result in results),
        joined("linear_values"),
        joined("history"),
        joined("filter_values"),
        joined("smoothed_history"),
        joined("smoother_values"),
    )


def format_exception(failure: BaseException, file: str) -> str:
    """Format an exception in one line, with the line of the user's file where it arose.

    >>> format_exception(ValueError("no fuel"), "boost.py")
    'ValueError: no fuel'
    """
    failure, place = raised_by(failure), ""
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
    kind = "" if isinstance(failure, SampleTimeout) else f"{type(failure).__name__}: "
    text = " ".join(f"{kind}{words}".split())
    text = "".join(c if c.isprintable() else "?" for c in text)
    return (text if len(text) <= LONGEST_REASON else text[: LONGEST_REASON - 3] + "...") + place
