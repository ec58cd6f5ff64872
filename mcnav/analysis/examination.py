"""Examination of linear analysis by a few dozen simulations: where it holds, where it does not, where they cannot say.

The variance of an output is ``V = C + E[2 z d + d^2]``, with z its linear value and d its departure from that value,
both about their means. A polynomial of d (`mcnav.linear.departure_model`), whose expectation is known, is a control
variate: V is its variance plus the mean over check simulations of what the polynomial misses. Where there is noise, the
same errors are simulated with noise besides. With e what noise adds to the departure, and the linear part of the noise
in z, the mean of ``2 (z + d) e + e^2`` is added. Bounds are Student's, of the independent pairs of check simulations.

All outputs together are judged by the mean NEES about the linear mean, and by combinations of outputs that linear
analysis holds fixed (`mcnav.analysis.combinations`).

What check simulations do not meet is not seen: an error rarer than about one in thirty.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Final

import numpy as np
from scipy import special

from mcnav.analysis.combinations import FixedCombination, fixed_combinations
from mcnav.analysis.corrected_moments import CorrectedMoments
from mcnav.analysis.model import Model
from mcnav.arrays.products import transform
from mcnav.arrays.types import Array
from mcnav.linear.departure_model import DepartureModel
from mcnav.statistics.whitening import Whitening

HOLDS: Final = 0.8
"""Share of the tolerance on sigma ratios within which linear analysis holds."""

FAILS: Final = 1.2
"""Share of it beyond which linear analysis does not hold."""

CONFIDENCE: Final = 0.99
"""Probability that a bound is not passed, if pairs of check simulations are normal: they are few and skewed."""


class Linearity(StrEnum):
    """Answer to whether linear analysis holds."""

    HOLDS = "holds"
    FAILS = "does not hold"
    UNKNOWN = "cannot say"


@dataclass(frozen=True)
class ExaminedSigma:
    """True over linear sigma of an output, with its bounds; NaN without a linear sigma, or where a simulation failed.

    Attributes
    ----------
    noise_share : float
        Share of the output's linear variance that is noise.
    """

    ratio: float
    low: float
    high: float
    noise_share: float
    verdict: Linearity


@dataclass(frozen=True)
class ExaminedMatrix:
    """All outputs together: the root of mean NEES over its dimension, and the mean error in the linear ellipsoid."""

    ratio: float
    low: float
    high: float
    mean_error: float
    verdict: Linearity


@dataclass(frozen=True)
class Examination:
    """Examination of linear analysis.

    Attributes
    ----------
    flights, failed : int
        Simulations, and those that failed.
    tolerance : float
        On ratios of sigmas.
    outputs : tuple of ExaminedSigma
        In the order of the scenario.
    joint : ExaminedMatrix or None
        None where no output varies.
    mean_departure : tuple of two ndarrays, shape (outputs,)
        Mean of the outputs less the linear one, SI, and the half width of its bounds; NaN where a simulation failed.
    corrected : CorrectedMoments or None
        Moments of second order; none where they are not computed.
    """

    flights: int
    failed: int
    tolerance: float
    outputs: tuple[ExaminedSigma, ...]
    joint: ExaminedMatrix | None
    mean_departure: tuple[Array, Array]
    corrected: CorrectedMoments | None = None

    @property
    def decided(self) -> bool:
        """Return whether every verdict says something."""
        return Linearity.UNKNOWN not in self.verdicts

    @property
    def holds(self) -> bool:
        """Return whether linear analysis holds for each output and for all together."""
        return set(self.verdicts) <= {Linearity.HOLDS}

    @property
    def verdicts(self) -> list[Linearity]:
        """The verdicts on the outputs, and on all together."""
        return [output.verdict for output in self.outputs] + ([self.joint.verdict] if self.joint else [])

    def verdict_on(self, outputs: Sequence[int]) -> Linearity:
        """Return the verdict on some outputs, each alone."""
        return combine([self.outputs[output].verdict for output in outputs])

    def completed_by(self, other: Examination) -> Examination:
        """Return this examination with the other's answers where this one cannot say; those of failures say nothing."""
        outputs = tuple(
            later if own.verdict == Linearity.UNKNOWN and not other.failed else own
            for own, later in zip(self.outputs, other.outputs, strict=True)
        )
        joint = self.joint
        if joint is not None and joint.verdict == Linearity.UNKNOWN and not other.failed:
            joint = other.joint
        return replace(
            self, flights=self.flights + other.flights, failed=other.failed, outputs=outputs, joint=joint,
            mean_departure=self.mean_departure if other.failed else other.mean_departure,
        )  # fmt: skip


@dataclass(frozen=True)
class CheckFlights:
    """Pairs of check simulations, the second of each with mirrored errors; n of both.

    Attributes
    ----------
    normals : ndarray, shape (n, r)
        Along the axes.
    linear : ndarray, shape (n, outputs)
        Linear outcomes of the errors, about those of the mean errors.
    departures : ndarray, shape (n, outputs)
        Without noise.
    noise : tuple of two ndarrays, shape (k, n, outputs), or None
        Linear outcomes of the noise alone, and what it adds to the departures; k times for each errors.
    """

    normals: Array
    linear: Array
    departures: Array
    noise: tuple[Array, Array] | None


@dataclass(frozen=True)
class _Squares:
    """Terms of the departures in the outputs' variances and in the mean NEES."""

    mean: Array
    given: Whitening

    def of(self, linear: Array, departures: Array) -> Array:
        """Return ``2 z d + d^2``, shape (n, outputs + 1); the last is of NEES."""
        about = departures - self.mean
        white, away = linear @ self.given.matrix, departures @ self.given.matrix
        return np.column_stack([2.0 * linear * about + about**2, np.sum(2.0 * white * away + away**2, axis=1)])

    def of_noise(self, linear: Array, departures: Array, added: Array) -> Array:
        """Return ``2 (z + d) e + e^2``, shape (n, outputs + 1)."""
        before = linear + departures
        white, away = before @ self.given.matrix, added @ self.given.matrix
        return np.column_stack([
            2.0 * (before - self.mean) * added + added**2, np.sum(2.0 * white * away + away**2, axis=1),
        ])  # fmt: skip


@dataclass(frozen=True)
class _Bounded:
    """Estimates of second moments with the half widths of their bounds, shape (k,)."""

    value: Array
    half: Array

    @classmethod
    def of_pairs(cls, squares: Array) -> _Bounded:
        """Average over pairs of rows, shape (n, k); rows 2 j and 2 j + 1 are a pair."""
        pairs = 0.5 * (squares[0::2] + squares[1::2])
        count = len(pairs)
        half = special.stdtrit(count - 1, CONFIDENCE) * pairs.std(axis=0, ddof=1) / math.sqrt(count)
        return cls(pairs.mean(axis=0), half)

    def __add__(self, other: _Bounded) -> _Bounded:
        return _Bounded(self.value + other.value, np.hypot(self.half, other.half))


def examine(
    model: Model,
    departure: DepartureModel,
    flights: CheckFlights,
    tolerance: float,
    simulated: int,
    drawn: Array | None,
) -> Examination:
    """Judge linear analysis by check simulations.

    Parameters
    ----------
    simulated : int
        Simulations of all kinds.
    drawn : ndarray, shape (n, r), optional
        Normals along the axes over which the polynomial is averaged, where the errors are not normal.
    """
    linear, given = model.outcome_covariance, model.whitened
    squares = _Squares(departure.mean, given)
    missed = squares.of(flights.linear, flights.departures) - squares.of(flights.linear, departure.at(flights.normals))
    added = _Bounded.of_pairs(missed) + _expected(squares, departure, drawn)
    if flights.noise is not None:
        by_noise = [
            squares.of_noise(flights.linear + linearly, flights.departures, more)
            for linearly, more in zip(*flights.noise, strict=True)
        ]
        added += _Bounded.of_pairs(np.mean(by_noise, axis=0))
    constant = transform(departure.axes.slopes, np.eye(departure.axes.rank))
    outputs = [
        _judge_sigma(
            float(linear[i, i]), float(added.value[i]), float(added.half[i]), float(model.floor[i]) ** 2,
            1.0 - float(constant[i, i]) / float(linear[i, i]) if linear[i, i] > 0.0 else 0.0, tolerance,
        )
        for i in range(len(linear))
    ]  # fmt: skip
    for size, members in model.sizes.items():
        if linear[size, size] <= 0.0:  # linear analysis knows the law of the size by those of its members
            verdict = combine([outputs[member].verdict for member in members])
            outputs[size] = replace(outputs[size], verdict=verdict)
    joint = None
    if given.rank:
        known = _judge(float(given.rank), float(added.value[-1]), float(added.half[-1]), 0.0, tolerance)
        fixed = _judge_fixed(model, flights, tolerance)
        ratio, low, high = _ratios(float(given.rank), float(added.value[-1]), float(added.half[-1]))
        mean_error = float(np.linalg.norm(departure.mean @ given.matrix))
        joint = ExaminedMatrix(ratio, low, high, mean_error, combine([known, *fixed]))
    return Examination(simulated, 0, tolerance, tuple(outputs), joint, _mean_departure(departure, flights))


def _mean_departure(departure: DepartureModel, flights: CheckFlights) -> tuple[Array, Array]:
    """Return the mean departure with the half width of its bounds, of normal errors: the polynomial's is known."""
    missed = flights.departures - departure.at(flights.normals)
    mean = _Bounded.of_pairs(missed if flights.noise is None else missed + flights.noise[1].mean(axis=0))
    return departure.mean + mean.value, mean.half


def refuse(simulated: int, failed: int, tolerance: float, outputs: int) -> Examination:
    """Return the examination of which simulations failed: it cannot say anything."""
    unknown = ExaminedSigma(math.nan, math.nan, math.nan, math.nan, Linearity.UNKNOWN)
    joint = ExaminedMatrix(math.nan, math.nan, math.nan, math.nan, Linearity.UNKNOWN)
    nowhere = np.full(outputs, np.nan)
    return Examination(simulated, failed, tolerance, (unknown,) * outputs, joint, (nowhere, nowhere))


def combine(verdicts: Sequence[Linearity]) -> Linearity:
    """Combine verdicts: one that does not hold outweighs one that cannot be said, which outweighs one that holds.

    >>> combine([Linearity.HOLDS, Linearity.UNKNOWN]).value
    'cannot say'
    """
    for verdict in (Linearity.FAILS, Linearity.UNKNOWN):
        if verdict in verdicts:
            return verdict
    return Linearity.HOLDS


def _expected(squares: _Squares, departure: DepartureModel, drawn: Array | None) -> _Bounded:
    """Return the mean of the polynomial's terms: in closed form for normal errors, else over draws."""
    if drawn is not None:
        return _Bounded.of_pairs(squares.of(drawn @ departure.axes.slopes.T, departure.at(drawn)))
    added, mean = departure.added_covariance, departure.mean
    white = float(np.trace(transform(squares.given.matrix.T, added)))
    value = np.append(np.diag(added), white + float(np.sum((mean @ squares.given.matrix) ** 2)))
    return _Bounded(value, np.zeros_like(value))


def _ratios(variance: float, added: float, half: float) -> tuple[float, float, float]:
    """Return the sigma ratio and its bounds; NaN without a linear variance."""
    if variance <= 0.0:
        return math.nan, math.nan, math.nan
    ratio, low, high = (math.sqrt(max(1.0 + more / variance, 0.0)) for more in (added, added - half, added + half))
    return ratio, low, high


def _judge_sigma(
    variance: float, added: float, half: float, floor: float, noise_share: float, tolerance: float
) -> ExaminedSigma:
    ratio, low, high = _ratios(variance, added, half)
    return ExaminedSigma(ratio, low, high, max(noise_share, 0.0), _judge(variance, added, half, floor, tolerance))


def _judge(variance: float, added: float, half: float, floor: float, tolerance: float) -> Linearity:
    """Judge a variance by bounds on what is added to it; up to a floor nothing is said of that."""
    least, most = added - half, added + half
    grown, shrunk = ((1.0 + HOLDS * tolerance) ** 2 - 1.0) * variance, (1.0 - (1.0 - HOLDS * tolerance) ** 2) * variance
    if -shrunk - floor <= least and most <= grown + floor:
        return Linearity.HOLDS
    grown, shrunk = ((1.0 + FAILS * tolerance) ** 2 - 1.0) * variance, (1.0 - (1.0 - FAILS * tolerance) ** 2) * variance
    if least > grown + floor or most < -shrunk - floor:
        return Linearity.FAILS
    return Linearity.UNKNOWN


def _judge_fixed(model: Model, flights: CheckFlights, tolerance: float) -> list[Linearity]:
    """Judge the combinations of outputs that linear analysis holds fixed."""
    sigma = np.sqrt(np.diag(model.judged_covariance))
    fixed = fixed_combinations(
        model.partials, model.covariance, list(model.processes.values()), sigma, model.whitened.rank, model.floor
    )
    departures = flights.departures if flights.noise is None else flights.departures + flights.noise[1][0]
    return [_judge_combination(combination, sigma, departures, tolerance) for combination in fixed]


def _judge_combination(combination: FixedCombination, sigma: Array, departures: Array, tolerance: float) -> Linearity:
    weights = np.divide(combination.terms, sigma, out=np.zeros_like(sigma), where=sigma > 0.0)
    values = departures @ weights
    spread = _Bounded.of_pairs(((values - values.mean()) ** 2)[:, None])
    known = max(combination.variance, combination.floor)
    return (
        _judge(known, float(spread.value[0]) - known, float(spread.half[0]), 0.0, tolerance)
        if (spread.value[0] > known)
        else Linearity.HOLDS
    )
