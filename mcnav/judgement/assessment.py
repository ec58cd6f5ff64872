"""Tests of records of one campaign against simulated ones, and the candidates for the number that is wrong.

A candidate is a size of the campaign (`Cause`) or a constant error that it does not have (`Offset`). Its gain is what
the log-likelihood of the innovations gains by another size, or by such an error. Every statistic is scaled by its 95 %
point in simulated records, and the largest of all decides: how often it is as large in simulated records is the
probability of a false alarm, whatever the statistics' correlation (Westfall and Young 1993, *Resampling-Based Multiple
Testing*).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav.arrays.types import Array, IndexArray
from mcnav.contract.recorded import FilteredRecord
from mcnav.judgement.likelihood import without_mean
from mcnav.judgement.profile import DROP
from mcnav.judgement.simulation import Innovations, beside, less_mean, simulate
from mcnav.judgement.statistics import mean_nees, sensor_statistics
from mcnav.judgement.whitened_records import Tell, Together

LEVEL: Final = 0.05
"""Probability of a false alarm."""

SHARE: Final = 0.9
"""Share of records in which what is said to be noticed is noticed."""


@dataclass(frozen=True)
class Assessment:
    """Statistics of R records, of N simulated ones, and of simulated ones with one size multiplied.

    Attributes
    ----------
    names : tuple of str
        Of all statistics: those of the filter, then the candidates, causes before offsets.
    candidates : int
        Number of the last ones, which are candidates.
    scores, simulated : ndarray, shape (k, R), (k, N)
        Statistics over their 95 % points.
    direct : ndarray, shape (d, R)
        Statistics of the filter as they are: logarithms of NIS and NEES, autocorrelations.
    centres, limits : ndarray, shape (d,), (k,)
        Medians of these in simulated records, and the 95 % points.
    gains, simulated_gains : ndarray, shape (candidates, R), (candidates, N)
    freedom : ndarray, shape (candidates,)
        Degrees of freedom of the candidates.
    power : ndarray, shape (j, f, p)
        Largest score of candidates of p simulated records with the size of cause j times each of `FACTORS`.
    named : ndarray of int, shape (j, f, p)
        Candidate that is named.
    sensitivity : tuple of ndarray, shape (a,)
        Of each offset: size along each axis that is noticed in 9 of 10 records.
    """

    names: tuple[str, ...]
    candidates: int
    scores: Array
    simulated: Array
    direct: Array
    centres: Array
    limits: Array
    gains: Array
    simulated_gains: Array
    freedom: Array
    power: Array
    named: IndexArray
    sensitivity: tuple[Array, ...]

    @property
    def critical(self) -> float:
        """Largest score that is exceeded in 5 % of simulated records."""
        return float(np.quantile(self.simulated.max(axis=0), 1.0 - LEVEL))

    @property
    def drops(self) -> Array:
        """Fall of the log-likelihood at the ends of 95 % intervals of the factors, shape (j,).

        The 95 % point of its gain in simulated records, at least that of chi-square.
        """
        own = self.simulated_gains[: len(self.power)]
        return np.maximum(np.quantile(own, 0.95, axis=1), DROP)

    def probability(self, scores: Array) -> Array:
        """Return the share of simulated records whose largest score is as large, shape of the scores."""
        largest = np.sort(self.simulated.max(axis=0))
        above = len(largest) - np.searchsorted(largest, scores, side="left")
        return np.asarray((above + 1.0) / (len(largest) + 1.0))

    @property
    def foremost(self) -> IndexArray:
        """Candidate that is named for each record, shape (R,)."""
        return np.asarray(np.argmax(self.gains - self.freedom[:, None], axis=0))


def assess(
    record: FilteredRecord, given: Innovations, count: int, trials: int, seed: int, tell: Tell = lambda seconds: None
) -> Assessment:
    """Test R records of the same campaign.

    Parameters
    ----------
    given : Innovations
        Of these records, as the filter had them.
    count : int
        Simulated records, N.
    trials : int
        Simulated records by which the power is computed, p; at most N.
    tell : callable
        Told how long it will take, s, after the first of what takes longest.
    """
    generator = np.random.default_rng(seed)
    own = less_mean(record, given)
    simulated = simulate(record, count, generator)
    direct, names = _of_filter(record, beside([own, simulated]))
    together = Together.of(without_mean(record), own, simulated, trials, generator)
    gains, in_power = together.gains(tell)
    centres = np.median(direct[:, len(own) :], axis=1)
    scores = np.concatenate([np.abs(direct - centres[:, None]), np.sqrt(2.0 * gains)])
    limits = np.quantile(scores[:, len(own) :], 1.0 - LEVEL, axis=1)
    limits = np.where(limits > 0.0, limits, np.inf)
    scaled = scores / limits[:, None]
    names += [cause.name for cause in record.causes] + [offset.name for offset in record.offsets]
    freedom = np.array([1.0] * len(record.causes) + [float(len(offset.states)) for offset in record.offsets])
    of_candidates = limits[len(direct) :]
    largest = np.max(np.sqrt(2.0 * in_power) / of_candidates[:, None, None, None], axis=0)
    named = np.argmax(in_power - freedom[:, None, None, None], axis=0)
    critical = float(np.quantile(scaled[:, len(own) :].max(axis=0), 1.0 - LEVEL))
    sensitivity = tuple(
        together.noticed(number, float(limit) * critical, SHARE)
        for number, limit in enumerate(of_candidates[len(record.causes) :])
    )
    return Assessment(
        tuple(names), len(gains), scaled[:, : len(own)], scaled[:, len(own) :], direct[:, : len(own)], centres, limits,
        gains[:, : len(own)], gains[:, len(own) :], freedom, largest, named, sensitivity,
    )  # fmt: skip


def _of_filter(record: FilteredRecord, both: Innovations) -> tuple[Array, list[str]]:
    """Compute the statistics of the filter itself, shape (d, given + simulated), and their names."""
    values, names = [], []
    for sensor, statistics in zip(record.sensors, sensor_statistics(record, both), strict=True):
        values += [np.log(statistics.nis), statistics.autocorrelations[0]]
        names += [f"{sensor.name} NIS", f"{sensor.name} whiteness"]
    for group, nees in mean_nees(record, both).items():
        values.append(np.log(nees))
        names.append(f"{group} NEES")
    return np.array(values), names
