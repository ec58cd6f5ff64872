"""Verdict on linear analysis, which accepts every measurement, of a filter whose gates reject good ones.

The error after an accepted measurement is independent of all innovations so far. A flight with N measurements at gates
therefore has its first rejection at k with the probability ``p_k = alpha_k prod_{j<k} (1 - alpha_j)`` exactly, and the
mean square at a reading is ``(1 - sum p) P + sum p_k M_k``. Of M_k linear analysis has two values: with one rejection
alone, and where no sensor with a gate is accepted from k on. In both the rejected innovation, whitened, has
``E[w w^T | rejected] = c`` times one (`mcnav.statistics.gates.rejected_square`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Final

import numpy as np

from mcnav.analysis.filter_causes import NEARLY
from mcnav.arrays.types import Array
from mcnav.contract.gates import RejectedErrors, RejectionLaws, RejectionReading
from mcnav.contract.quantities import Output
from mcnav.statistics.gates import rejected_again, rejected_square

NEGLIGIBLE: Final = 1e-6
"""Share of the largest rms of outputs of one unit, below which an output is not judged."""

SAME: Final = 1e-6
"""Share by which one rejection and never another acceptance differ where nothing is accepted after a rejection."""


BOUND: Final = 2.326
"""Standard errors of bounds by flights: one is passed with a probability of 1 %."""


class OnLinear(StrEnum):
    """Verdict on linear analysis with gates that reject good measurements."""

    HOLDS = "holds"
    FAILS = "fails"
    REFUSED = "refused"


@dataclass(frozen=True)
class FirstRejection:
    """A measurement that may be the first that is rejected.

    Attributes
    ----------
    time : float
        In the scenario's own time, s.
    probability : float
        That it is the first.
    next : float or None
        Probability that the sensor's next measurement is rejected too; none where there is no further one.
    """

    sensor: str
    time: float
    probability: float
    next: float | None


@dataclass(frozen=True)
class FlownRejections:
    """Errors at the end by flights that begin with a first rejection, of all flights with and without any; SI.

    Attributes
    ----------
    flights : int
    rms, error : ndarray, shape (outputs,)
        Root mean squares and their standard errors.
    ratio_error : float
        Standard error of `RejectionAnswer.ratio`.
    """

    flights: int
    rms: Array
    error: Array
    ratio_error: float


@dataclass(frozen=True)
class RejectionAnswer:
    """Verdict of linear analysis on rejections of good measurements; SI.

    Attributes
    ----------
    verdict : OnLinear
    doubt : str
        As `mcnav.contract.gates.RejectionLaws` has it; with one, linear analysis is refused and knows nothing else.
    measurements : int
        At gates: N.
    accepted_by_all : float
        Probability of a flight without a rejection.
    expected_least : float
        Rejections of a flight as if all before were accepted: the sum of alpha.
    first : tuple of FirstRejection
    rms_once, rms_never : ndarray, shape (outputs,)
        At the end, with the first rejection alone, and with nothing accepted after it by a sensor with a gate.
    output : int
        Output whose rms departs the most from the linear one: with one rejection alone if that fails, else with nothing
        accepted after it.
    ratio, time : float
        Rms over that of linear analysis there; time of the reading, s.
    exact : bool
        Nothing is accepted after a first rejection that would matter: both rms are those of flights.
    consistent : bool
        Whether a filter that is consistent without gates is so with them.
    by_flights : FlownRejections or None
        What flights that begin with a rejection say; none where they were not simulated.
    """

    verdict: OnLinear
    doubt: str = ""
    measurements: int = 0
    accepted_by_all: float | None = None
    expected_least: float | None = None
    first: tuple[FirstRejection, ...] = ()
    rms_once: Array | None = None
    rms_never: Array | None = None
    output: int = 0
    ratio: float = 1.0
    time: float = 0.0
    exact: bool = False
    consistent: bool = False
    by_flights: FlownRejections | None = None

    @property
    def largest_next(self) -> float | None:
        """Largest probability that a rejection follows a first one; none where there is no next measurement."""
        return max((each.next for each in self.first if each.next is not None), default=None)


def judge_rejections(laws: RejectionLaws, outputs: Sequence[Output], tolerance: float) -> RejectionAnswer:
    """Judge what rejections of good measurements leave of linear analysis.

    Parameters
    ----------
    tolerance : float
        Of the ratio of an rms to that of linear analysis.
    """
    if laws.doubt:
        return RejectionAnswer(OnLinear.REFUSED, laws.doubt)
    of_first = probabilities_of_first(laws.probabilities)
    squares = np.array([rejected_square(*each) for each in zip(laws.limits, laws.sizes.tolist(), strict=True)])
    units = [output.unit for output in outputs]
    once, never = (
        np.array([
            _roots(reading.variances + of_first[: len(reached.excess)] @ _added(reached, squares))
            for reading, reached in zip(laws.readings, errors, strict=True)
        ])
        for errors in ([reading.once for reading in laws.readings], [reading.never for reading in laws.readings])
    )  # fmt: skip
    linear = np.array([_roots(reading.variances) for reading in laws.readings])
    one, all_later = (_ratios(rms, linear, units) for rms in (once, never))
    fails, holds = bool(one.max() > 1.0 + tolerance), bool(all_later.max() <= 1.0 + tolerance)
    verdict = OnLinear.FAILS if fails else OnLinear.HOLDS if holds else OnLinear.REFUSED
    departing = one if fails else all_later
    reading = int(np.argmax(departing.max(axis=1)))
    output = int(np.flatnonzero(departing[reading] >= NEARLY * departing[reading].max())[0])
    exact = bool(np.all(all_later - one <= SAME * one))
    nees = max(float(_normalized(reading, of_first, squares, units).max()) for reading in laws.readings)
    return RejectionAnswer(
        verdict,
        measurements=len(of_first),
        accepted_by_all=float(np.prod(1.0 - laws.probabilities)),
        expected_least=float(laws.probabilities.sum()),
        first=_first(laws, of_first),
        rms_once=once[-1],
        rms_never=never[-1],
        output=output,
        ratio=float(departing[reading, output]),
        time=laws.readings[reading].time,
        exact=exact,
        consistent=holds or (exact and nees <= (1.0 + tolerance) ** 2),
    )


def judge_by_flights(
    answer: RejectionAnswer, laws: RejectionLaws, outputs: Sequence[Output], tolerance: float, count: int
) -> RejectionAnswer:
    """Judge by flights that begin with a first rejection what the laws leave open; else return the answer.

    Linear analysis holds, or fails, where the bounds of every ratio say so, or those of one.
    """
    if laws.fly is None or answer.verdict != OnLinear.REFUSED:
        return answer
    excess, error = laws.fly(count)
    units = [output.unit for output in outputs]
    variances = np.array([reading.variances for reading in laws.readings])
    rms = _roots(variances + excess)
    errors = np.divide(error, 2.0 * rms, out=np.zeros_like(rms), where=rms > 0.0)
    ratios, most, least = (
        _ratios(_roots(variances + excess + bound * error), _roots(variances), units) for bound in (0.0, BOUND, -BOUND)
    )
    holds, fails = bool(most.max() <= 1.0 + tolerance), bool(least.max() > 1.0 + tolerance)
    reading, output = np.unravel_index(np.argmax(ratios), ratios.shape)
    flown = FlownRejections(
        count, rms[-1], errors[-1], float(errors[reading, output] * ratios[reading, output] / rms[reading, output])
    )
    return replace(
        answer,
        verdict=OnLinear.HOLDS if holds else OnLinear.FAILS if fails else OnLinear.REFUSED,
        output=int(output),
        ratio=float(ratios[reading, output]),
        time=laws.readings[reading].time,
        consistent=answer.consistent or holds,
        by_flights=flown,
    )


def probabilities_of_first(probabilities: Array) -> Array:
    """Return the probabilities that each measurement is the first that is rejected, from those to be rejected."""
    return np.asarray(probabilities * np.concatenate([[1.0], np.cumprod(1.0 - probabilities)[:-1]]))


def _first(laws: RejectionLaws, of_first: Array) -> tuple[FirstRejection, ...]:
    again = np.full(len(of_first), np.nan)
    kinds = np.stack([laws.limits, laws.sizes], axis=1)
    for limit, size in np.unique(kinds, axis=0):
        alike = (laws.limits == limit) & (laws.sizes == size) & np.isfinite(laws.correlations[:, 0])
        again[alike] = rejected_again(float(limit), laws.correlations[alike, : int(size)])
    return tuple(
        FirstRejection(sensor, time, probability, after if np.isfinite(after) else None)
        for sensor, time, probability, after in zip(
            laws.sensors, laws.times.tolist(), of_first.tolist(), again.tolist(), strict=True
        )
    )


def _roots(squares: Array) -> Array:
    """Return the roots of mean squares, of which rounding may have made some negative."""
    return np.sqrt(np.maximum(squares, 0.0))


def _added(errors: RejectedErrors, squares: Array) -> Array:
    """Return what a first rejection adds to the mean squares of the outputs, shape (u, s)."""
    beyond = squares[: len(errors.excess), None] - 1.0
    return np.asarray(errors.excess + beyond * np.sum(errors.responses**2, axis=2))


def _normalized(reading: RejectionReading, of_first: Array, squares: Array, units: Sequence[str]) -> Array:
    """Return the mean squared errors over the filter's own variances with one rejection, shape (s,)."""
    errors = reading.once
    mean_squares, own = reading.variances + _added(errors, squares), reading.variances + errors.excess
    shares = np.divide(mean_squares, own, out=np.ones_like(own), where=own > 0.0)
    normalized = 1.0 + of_first[: len(shares)] @ (shares - 1.0)
    return np.where(_judged(_roots(reading.variances), units), normalized, 1.0)


def _ratios(rms: Array, linear: Array, units: Sequence[str]) -> Array:
    """Divide rms by linear ones, shape (r, s): one where an output is not judged."""
    judged = np.array([_judged(row, units) for row in rms])
    return np.divide(rms, linear, out=np.ones_like(rms), where=judged & (linear > 0.0))


def _judged(rms: Array, units: Sequence[str]) -> Array:
    """Return which outputs have an rms that counts beside those of the same unit, shape (s,)."""
    largest = {unit: max(size for size, other in zip(rms, units, strict=True) if other == unit) for unit in set(units)}
    return np.array([size > NEGLIGIBLE * largest[unit] for size, unit in zip(rms, units, strict=True)])
