"""The noise model of one axis from its record: candidates, the choice among them, estimates with intervals.

Every candidate has white noise. Quantization and slow processes, a rate random walk, a Gauss-Markov process or both,
may come with it. The candidate with the smallest ``−2 log L + 6 (number of parameters)`` is chosen, but that a walk
beside a Gauss-Markov process costs 2. Its margin over the next is stated: a margin below 4 tells little.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.identification.likelihood import Maximum, information, maximize, profile_interval
from mcnav.identification.processes import (
    GAUSS_MARKOV,
    QUANTIZATION,
    RATE_RANDOM_WALK,
    WHITE,
    Grid,
    Model,
    Process,
)
from mcnav.identification.spectrum import Bands, Record, in_bands

CANDIDATES: Final = tuple(
    Model((WHITE, *fast, *slow))
    for fast, slow in product(
        ((), (QUANTIZATION,)), ((), (RATE_RANDOM_WALK,), (GAUSS_MARKOV,), (RATE_RANDOM_WALK, GAUSS_MARKOV))
    )
)

IDENTIFIABLE: Final = 0.5
"""Largest standard deviation of a logarithm at which a parameter counts as identified."""

WANTED: Final = 0.2
"""Relative standard deviation that "T hours would do" is computed for."""

LONGEST_RECORD: Final = 10 * 365.25 * 86_400.0
"""A record longer than this (s) is not advised."""

ROUGHLY: Final = 1e-2
"""Decrement of −2 log L at which a first maximum, from which others start, is near enough."""

PENALTY: Final = 6.0
"""Price of a parameter, in −2 log L: one that is not there is taken in 0.7 of 100 records."""


BESIDE: Final = 2.0
"""Price of a rate random walk beside a Gauss-Markov process, in −2 log L."""


@dataclass(frozen=True)
class Estimate:
    """A parameter of a model.

    Attributes
    ----------
    value, low, high : float
        Estimate and the ends of its 95 % interval; an end that the record does not show is 0 or infinite.
    relative_sd : float
        Cramér-Rao bound of its relative standard deviation, at the estimates.
    duration_wanted : float
        Length of a record, s, whose bound is `WANTED`, at the upper end of an interval that begins at zero; infinite if
        none is long enough.
    """

    name: str
    value: float
    low: float
    high: float
    relative_sd: float
    duration_wanted: float

    @property
    def identified(self) -> bool:
        """True if the record shows it: its interval has two ends and its bound is below `IDENTIFIABLE`."""
        return self.low > 0.0 and np.isfinite(self.high) and self.relative_sd <= IDENTIFIABLE


@dataclass(frozen=True)
class Candidate:
    """A model at its maximum."""

    model: Model
    best: Maximum
    bands: Bands

    @property
    def criterion(self) -> float:
        """−2 log L with `PENALTY` for each parameter: the smaller, the better.

        A rate random walk beside a Gauss-Markov process costs `BESIDE`: left out, it spoils the other's interval.
        """
        both = {RATE_RANDOM_WALK, GAUSS_MARKOV} <= set(self.model.processes)
        return self.best.deviance + PENALTY * (len(self.best.logs) - both) + BESIDE * both

    def estimates(self, names: Collection[str] = ()) -> tuple[Estimate, ...]:
        """Compute parameters with their intervals: those of some names, by default every one."""
        bounds = relative_deviations(self.model, self.bands.grid, self.bands.numbers, self.best.logs)
        rows = []
        for at, name in enumerate(self.model.parameters):
            if names and name not in names:
                continue
            low, high = np.exp(profile_interval(self.model, self.bands, self.best, at))
            logs = self.best.logs.copy()
            if low <= 0.0 and np.isfinite(high):  # as large as it may be
                logs[at] = np.log(high)
            wanted = duration_wanted(self.model, logs, at, self.bands.grid, self.bands.share)
            value = float(np.exp(self.best.logs[at]))
            rows.append(Estimate(name, value, float(low), float(high), float(bounds[at]), wanted))
        return tuple(rows)


def relative_covariance(candidate: Candidate) -> Array:
    """Compute the covariance of the logarithms by the likelihood's curvature, shape (parameters, parameters)."""
    return np.asarray(np.linalg.pinv(information(candidate.model, candidate.bands, candidate.best.logs), rcond=1e-12))


def relative_deviations(model: Model, grid: Grid, numbers: Array, logs: Array) -> Array:
    """Compute the Cramér-Rao bounds of the logarithms; infinite where the record tells nothing."""
    variances, slopes = model.variances(grid, logs)
    relative = slopes / variances[:, None]
    fisher = 0.5 * (relative.T * numbers) @ relative
    scale = np.sqrt(np.diag(fisher))
    if not np.all(scale > 0.0):
        return np.where(scale > 0.0, 1.0 / np.maximum(scale, 1e-300), np.inf)
    correlation = fisher / np.outer(scale, scale)
    if np.linalg.cond(correlation) > 1e12:
        return np.full(len(scale), np.inf)
    return np.asarray(np.sqrt(np.diag(np.linalg.inv(correlation))) / scale)


def duration_wanted(model: Model, logs: Array, parameter: int, grid: Grid, share: float = 1.0) -> float:
    """Find the length of a record, s, at which the bound of a parameter's relative deviation is `WANTED`.

    Ordinates are spread evenly over the frequency, so that their number in a band grows with the record's length; the
    model is fitted to a ``share`` of them, the lowest.
    """

    def bound(duration: float) -> float:
        count = duration / grid.interval
        last = max(1.0, float(share * (count - 1.0)))
        order = np.unique(np.round(np.geomspace(1.0, last, 400)))
        edge = np.concatenate([[0.5], np.sqrt(order[1:] * order[:-1]), [last + 0.5]])
        longer = Grid(grid.interval, round(count), np.asarray(order, dtype=float))
        return float(relative_deviations(model, longer, np.diff(edge), logs)[parameter])

    low, high = grid.interval * 16.0 / share, LONGEST_RECORD
    if not bound(high) <= WANTED:
        return np.inf
    while high / low > 1.01:
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if bound(middle) <= WANTED else (middle, high)
    return high


@dataclass(frozen=True)
class AxisFit:
    """Models of one axis fitted to its record.

    Attributes
    ----------
    record : Record
    candidates : tuple of Candidate
        The best first.
    """

    record: Record
    candidates: tuple[Candidate, ...]

    @property
    def chosen(self) -> Candidate:
        """The best candidate."""
        return self.candidates[0]

    @property
    def margin(self) -> float:
        """By how much the criterion of the next candidate is larger."""
        return self.candidates[1].criterion - self.candidates[0].criterion

    @cached_property
    def estimates(self) -> tuple[Estimate, ...]:
        """Parameters of the chosen candidate."""
        return self.chosen.estimates()


def fit(record: Record) -> AxisFit:
    """Fit every candidate to a record and choose."""
    rough = in_bands(record)
    first = [_best(model, rough) for model in CANDIDATES]
    pilot = min(zip(CANDIDATES, first, strict=True), key=lambda pair: pair[1].deviance)

    def weight(grid: Grid) -> Array:
        return pilot[0].variances(grid, pilot[1].logs)[0]

    bands = in_bands(record, weight)
    candidates = [
        Candidate(model, maximize(model, bands, start.logs), bands)
        for model, start in zip(CANDIDATES, first, strict=True)
    ]
    return AxisFit(record, tuple(sorted(candidates, key=lambda candidate: candidate.criterion)))


def _best(model: Model, bands: Bands) -> Maximum:
    """Find the largest of the maxima that several starts lead to."""
    maxima = (maximize(model, bands, start, converged=ROUGHLY) for start in _starts(model, bands))
    return min(maxima, key=lambda maximum: maximum.deviance)


def _starts(model: Model, bands: Bands) -> list[Array]:
    """Guess parameters: each process as large as the spectrum allows, the slow ones at several correlation times."""
    level = bands.sums / bands.numbers
    duration = bands.grid.duration
    times = [duration / 3.0, duration / 30.0, duration / 300.0] if GAUSS_MARKOV in model.processes else [0.0]
    starts = []
    for time in times:
        logs: list[float] = []
        for process in model.processes:
            logs += _allowed(process, bands, level, time)
        starts.append(np.array(logs))
    return starts


def _allowed(process: Process, bands: Bands, level: Array, time: float) -> list[float]:
    """Return the logarithm of a process's size such that it explains the spectrum where its share is largest."""
    shape = process.spectrum(bands.grid, time) if process.timed else process.spectrum(bands.grid)
    ratio = level / shape
    smooth = np.sort(ratio)[: max(1, len(ratio) // 8)]
    size = 0.5 * float(np.log(np.median(smooth)))
    return [size, float(np.log(time))] if process.timed else [size]
