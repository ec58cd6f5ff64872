"""The cosine transform of a record, in bands of frequency.

Sums over bands are enough for a likelihood whose variances are smooth: ordinates of low order stand alone, since there
are few and they decide on slow processes; the others are taken together in bands of 2 %. Within a band ordinates are
weighted with the variances of a model near the truth, so that the slope of the spectrum within it does no harm.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.fft import dct

from mcnav.arrays.types import Array
from mcnav.identification.processes import Grid

ALONE: Final = 128
"""Ordinates of low order that have a band of their own."""

WIDTH: Final = 1.02
"""Ratio of the ends of a band."""

WEIGHED_AT_ONCE: Final = 1 << 18
"""Ordinates whose weights are computed at once, which limits memory."""


@dataclass(frozen=True)
class Record:
    """A record's mean and cosine transform.

    Attributes
    ----------
    interval : float
        Between readings, s.
    count : int
        n readings.
    mean : float
    ordinates : ndarray, shape (m,)
        Squares of the coefficients c_1 … c_m: all n - 1, or those below a frequency.
    lowest : ndarray, shape (min(`ALONE`, n - 1),)
        The first coefficients, with their signs.
    """

    interval: float
    count: int
    mean: float
    ordinates: Array
    lowest: Array

    @property
    def below(self) -> float:
        """Upper end of the frequencies, Hz."""
        return 0.5 * (len(self.ordinates) + 1) / self.duration

    def up_to(self, part: int) -> Record:
        """Return the lowest ordinates: 1 of so many of all."""
        return replace(self, ordinates=self.ordinates[: (self.count - 1) // part])

    @property
    def duration(self) -> float:
        """S."""
        return self.count * self.interval


@dataclass(frozen=True)
class Bands:
    """Sums of ordinates by band.

    Attributes
    ----------
    grid : Grid
        Middle of each band.
    numbers : ndarray, shape (m,)
        Ordinates in each.
    sums : ndarray, shape (m,)
        Of the ordinates, each times the weight at the middle over its own.
    """

    grid: Grid
    numbers: Array
    sums: Array

    @property
    def share(self) -> float:
        """Share of all frequencies that the bands reach up to, from the middle of the last one."""
        return float(min(1.0, np.max(self.grid.order / self.grid.count) * np.sqrt(WIDTH)))


def transform(readings: Array, interval: float) -> Record:
    """Transform equally spaced readings, shape (n,), of a rate or an acceleration."""
    mean = float(readings.mean())
    coefficients = np.asarray(dct(readings - mean, type=2, norm="ortho", overwrite_x=True))[1:]
    lowest = coefficients[:ALONE].copy()
    return Record(interval, len(readings), mean, np.square(coefficients, out=coefficients), lowest)


def edges(ordinates: int) -> Array:
    """Return the first order of each band and one past the last, for a number of ordinates."""
    single = min(ALONE, ordinates)
    edge = [float(single + 1)]
    while edge[-1] <= ordinates:
        edge.append(max(edge[-1] + 1.0, np.floor(edge[-1] * WIDTH)))
    edge[-1] = float(ordinates + 1)
    return np.concatenate([np.arange(1.0, single + 1.0), edge])


def middles(count: int, interval: float, ordinates: int | None = None) -> tuple[Grid, Array]:
    """Return the middles of the bands of a record, of all its ordinates or the lowest, and how many each band has."""
    edge = edges(count - 1 if ordinates is None else ordinates)
    return Grid(interval, count, 0.5 * (edge[:-1] + edge[1:] - 1.0)), np.diff(edge)


def in_bands(record: Record, weight: Callable[[Grid], Array] | None = None) -> Bands:
    """Take ordinates together in bands.

    Parameters
    ----------
    weight : callable, optional
        Returns variances near the true ones on a `Grid`; equal ones by default.
    """
    grid, numbers = middles(record.count, record.interval, len(record.ordinates))
    begins = (edges(len(record.ordinates))[:-1] - 1.0).astype(np.intp)
    if weight is None:
        return Bands(grid, numbers, np.add.reduceat(record.ordinates, begins))
    weighed = np.empty_like(record.ordinates)
    for begin in range(0, len(weighed), WEIGHED_AT_ONCE):
        part = slice(begin, min(begin + WEIGHED_AT_ONCE, len(weighed)))
        own = Grid(record.interval, record.count, np.arange(part.start + 1.0, part.stop + 1.0))
        weighed[part] = record.ordinates[part] / weight(own)
    return Bands(grid, numbers, np.add.reduceat(weighed, begins) * weight(grid))
