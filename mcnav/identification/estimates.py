"""Parameters of a noise model: estimates, intervals that hold whatever else the record allows, and lengths wanted.

Several models may fit a record. With the smallest ``D_m(θ) = −2 log L`` of each over its other parameters, and the
price p_m of the model, a 95 % interval holds the values with

    min_m [D_m(θ) + p_m] ≤ min_m [D_m + p_m] + 3.84

over the models with the parameter, and with the same fast noise or less. A model that the record does not tell from the
best, within `CLOSE`, may be the true one: the interval holds its own as well, ``D_m(θ) ≤ min D_m + 3.84``. Where a
second process is nearly taken in, it thereby widens the intervals of the first.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.stats import chi2

from mcnav.arrays.types import Array
from mcnav.identification.choice import CLOSE, price
from mcnav.identification.likelihood import Maximum, information, profile_end
from mcnav.identification.processes import Grid, Model
from mcnav.identification.spectrum import Bands

IDENTIFIABLE: Final = 10.0
"""Largest ratio of the ends of an interval at which a parameter counts as identified."""

WANTED: Final = 0.2
"""Relative standard deviation to be reached by a longer record, whose length is stated."""

LONGEST_RECORD: Final = 10 * 365.25 * 86_400.0
"""A record longer than this (s) is not advised."""

LIMIT: Final = float(chi2.ppf(0.95, 1))
"""Rise of −2 log L at the ends of an interval."""


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
    certain : bool
        False where a model without the parameter's process fits the record nearly as well.
    """

    name: str
    value: float
    low: float
    high: float
    relative_sd: float
    duration_wanted: float
    certain: bool = True

    @property
    def identified(self) -> bool:
        """True if the record shows it: its interval has two ends, which are at most `IDENTIFIABLE` times apart."""
        return self.low > 0.0 and self.high <= IDENTIFIABLE * self.low


@dataclass(frozen=True)
class Candidate:
    """A model at its maximum.

    Attributes
    ----------
    bands : Bands
        Ordinates that it was fitted to.
    """

    model: Model
    best: Maximum
    bands: Bands

    @property
    def criterion(self) -> float:
        """−2 log L with the price of the model: the smaller, the better."""
        return self.best.deviance + price(self.model)

    def estimates(self, others: Sequence[Candidate] = (), names: Collection[str] = ()) -> tuple[Estimate, ...]:
        """Compute parameters with their intervals: those of some names, by default every one.

        Parameters
        ----------
        others : sequence of Candidate
            Further models of the same record that the intervals hold under.
        """
        bounds = relative_deviations(self.model, self.bands.grid, self.bands.numbers, self.best.logs)
        rows = []
        for place, name in enumerate(self.model.parameters):
            if names and name not in names:
                continue
            low, high = np.exp(self.interval(name, others))
            logs = self.best.logs.copy()
            if low <= 0.0 and np.isfinite(high):  # as large as it may be
                logs[place] = np.log(high)
            wanted = duration_wanted(self.model, logs, place, self.bands.grid, self.bands.share)
            value = float(np.exp(self.best.logs[place]))
            rows.append(Estimate(name, value, float(low), float(high), float(bounds[place]), wanted))
        return tuple(rows)

    def interval(self, name: str, others: Sequence[Candidate] = ()) -> tuple[float, float]:
        """Find the 95 % interval of a parameter's logarithm; an end that the record does not show is infinite."""
        ends = []
        for sign in (-1.0, 1.0):
            end = -sign * np.inf
            for other in (self, *(other for other in others if name in other.model.parameters)):
                behind = other.criterion - self.criterion
                rise = LIMIT - behind if behind >= CLOSE else LIMIT
                if rise > 0.0:
                    place = other.model.parameters.index(name)
                    end = profile_end(other.model, other.bands, other.best, place, sign, rise, end)
            ends.append(end)
        return ends[0], ends[1]


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
