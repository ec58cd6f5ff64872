"""Handling of readings by a logger or an instrument before they were stored: held values, and a low-pass filter.

A value that stands in r rows makes neighbouring rows equal with the probability 1 − 1/r, and rows further apart than r
only as often as chance does. Readings that are coarse against slow noise repeat over longer and longer distances
instead, and change by single steps.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.identification.estimates import Candidate
from mcnav.identification.processes import CORRELATION_TIME, GAUSS_MARKOV, WHITE
from mcnav.identification.spectrum import Record, in_bands

HELD: Final = 1.2
"""Rows a value from which on readings are held; below, some repeat."""

REPEATED: Final = 0.01
"""Share of repeated readings from which on it is said."""

FADING: Final = 0.2
"""Share of the repetitions of neighbours that may be left beyond a hold."""

SINGLE_STEPS: Final = 0.9
"""Share of changes by the smallest step from which on readings are coarse, not held."""

REGULAR: Final = 0.01
"""Distance of the rows a value from a whole number, as a share, within which values are held for that many."""

OCTAVE_PART: Final = 4
"""Parts of an octave in which a spectrum is compared with its model."""

SHORT: Final = 30.0
"""Correlation time, in intervals, below which a process that towers over the white noise is a filter's work."""

UPPER: Final = 10.0
"""A process whose corner is above this part of the frequencies that a model was fitted to is a filter's work, too."""

TOWERS: Final = 30.0
"""Ratio of densities from which on a Gauss-Markov process towers over white noise."""


@dataclass(frozen=True)
class Hold:
    """Repetition of readings.

    Attributes
    ----------
    rows : float
        Rows in which a value stands, in the mean.
    readings : ndarray
        The new values where they are held at least `HELD` rows; all readings otherwise.
    """

    rows: float
    readings: Array

    def words(self, interval: float) -> str:
        """Say how readings repeat, which come each ``interval`` seconds."""
        if self.rows < HELD:
            return f"{100.0 * (1.0 - 1.0 / self.rows):.2g} % of the readings repeat the one before: some were missed"
        return f"each reading is held for {self.rows:.3g} rows; a new one comes each {interval * self.rows:.4g} s"


def find_hold(readings: Array) -> Hold | None:
    """Find repeated readings, shape (n,); none where neighbours are equal no more often than by chance.

    >>> find_hold(np.repeat(np.random.default_rng(1).standard_normal(1_000), 4)).rows
    4.0
    """
    changes = np.flatnonzero(np.diff(readings)) + 1
    if len(changes) < 2:
        return None
    neighbours = 1.0 - len(changes) / (len(readings) - 1.0)
    chance = _equal(readings, len(readings) // 3)
    share = (neighbours - chance) / (1.0 - chance) if chance < 1.0 else 0.0
    if share < REPEATED:
        return None
    rows = 1.0 / (1.0 - share)
    beyond = _equal(readings, int(np.ceil(rows)) + 1) - chance
    steps = np.abs(np.diff(readings)[changes - 1])
    single = np.mean(steps < 1.5 * steps.min())
    if beyond > FADING * (neighbours - chance) or single > SINGLE_STEPS:
        return None
    if rows < HELD:
        return Hold(rows, readings)
    whole = round(rows)
    if abs(rows / whole - 1.0) > REGULAR:
        return Hold(rows, readings[changes])
    first = int(np.argmax(np.bincount(changes % whole, minlength=whole)))
    return Hold(float(whole), readings[first::whole])


def _equal(readings: Array, lag: int) -> float:
    return float(np.mean(readings[lag:] == readings[:-lag]))


def filters_show(candidate: Candidate) -> bool:
    """Tell whether a model's Gauss-Markov process is the work of a low-pass filter on white noise.

    It is where it is fast and towers over the white noise, or its corner ``1/(2π τ)`` is near the end of the bands.
    """
    if GAUSS_MARKOV not in candidate.model.processes:
        return False
    values = dict(zip(candidate.model.parameters, np.exp(candidate.best.logs), strict=True))
    time = values[CORRELATION_TIME]
    if 2.0 * np.pi * time * candidate.bands.grid.frequency[-1] < UPPER:
        return True
    towers = 2.0 * values[GAUSS_MARKOV.size] ** 2 * time > TOWERS * values[WHITE.size] ** 2
    return bool(towers and time < SHORT * candidate.bands.grid.interval)


def half_power(whole: Record, candidate: Candidate) -> float | None:
    """Find the frequency, Hz, above which readings have less than half the density of a model of the lower ones.

    None where the highest frequencies have more than half.
    """
    bands = in_bands(whole)
    ratio = bands.sums / bands.numbers / candidate.model.variances(bands.grid, candidate.best.logs)[0]
    place = np.floor(OCTAVE_PART * np.log2(bands.grid.order)).astype(int)
    first = np.flatnonzero(np.diff(place, prepend=-1))
    # a median is not moved by lines
    level = np.array([np.median(part) for part in np.split(ratio, first[1:])])
    most = np.flatnonzero(level >= 0.5)
    last = int(most[-1]) if len(most) else 0
    if last + 1 >= len(level):
        return None
    return float(bands.grid.frequency[first[last + 1]])
