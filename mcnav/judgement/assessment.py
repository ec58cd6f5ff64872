"""Tests of records of one campaign against simulated ones, and the candidates for the number that is wrong.

A candidate is a size of the campaign (`Cause`) or a constant error that it does not have (`Offset`). Its gain is what
the log-likelihood of the innovations gains by another size, or by such an error. Every statistic is scaled by its 95 %
point in simulated records, and the largest of all decides: how often it is as large in simulated records is the
probability of a false alarm, whatever the statistics' correlation (Westfall and Young 1993, *Resampling-Based Multiple
Testing*).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mcnav.arrays.types import Array, IndexArray
from mcnav.contract.recorded import FilteredRecord
from mcnav.judgement.likelihood import DROP, whiten, without_corrections
from mcnav.judgement.simulation import Innovations, beside, less_mean, respond, simulate
from mcnav.judgement.statistics import mean_nees, sensor_statistics

GRID: Final = (0.1, 0.3, 0.6, 0.9, 1.0, 1.1, 1.7, 3.0, 10.0)
"""Factors of a size that are tried."""

TOGETHER: Final = 4_000
"""Records, over all sets of sizes, that are whitened together: few of them take as long as these."""

LEVEL: Final = 0.05
"""Probability of a false alarm."""

FACTORS: Final = (1.2, 1.5, 2.0, 3.0, 5.0, 10.0)
"""Factors of a size for which the power is computed."""

Tell = Callable[[float], None]
"""Receiver of the time that a computation will take, s."""

SHARE: Final = 0.9
"""Share of records in which what is said to be noticed is noticed."""


@dataclass(frozen=True)
class Sums:
    """Sums over the whitened innovations of records with one set of sizes.

    Attributes
    ----------
    squares : ndarray, shape (R,)
    pairs, added : ndarray, shape (j, p)
        Products of the first p simulated records with p records of one cause alone, and the squares of these; for j
        causes.
    log_determinant : float
    """

    squares: Array
    pairs: Array
    added: Array
    log_determinant: float


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
    offsets : tuple of (ndarray, ndarray)
        Of each offset: estimates, shape (a, R), and their covariance.
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
    offsets: tuple[tuple[Array, Array], ...]
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
        own = self.simulated_gains[: self.candidates - len(self.offsets)]
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

    @property
    def freedom(self) -> Array:
        """Degrees of freedom of the candidates."""
        sizes = [len(estimates) for estimates, _ in self.offsets]
        return np.array([1.0] * (self.candidates - len(sizes)) + [float(each) for each in sizes])


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
    causes = range(len(record.causes))
    alone = [simulate(record, trials, generator, cause) for cause in causes]
    plain = replace(record, mean=np.zeros_like(record.mean))
    everything = _Everything(plain, own, simulated, alone, trials)
    return everything.assess(tell)


class _Everything:
    """All records whose innovations are whitened together: given, simulated, of one cause alone, of offsets."""

    def __init__(
        self, record: FilteredRecord, own: Innovations, simulated: Innovations, alone: Sequence[Innovations],
        trials: int,
    ) -> None:  # fmt: skip
        self.record, self.own, self.simulated, self.trials = record, own, simulated, trials
        self.given, self.count, self.causes = len(own), len(simulated), len(record.causes)
        units = [np.eye(len(record.mean))[:, offset.states] for offset in record.offsets]
        responses = [respond(record, unit) for unit in units]
        self.columns = without_corrections(record, beside([own, simulated, *alone, *responses]))

    def assess(self, tell: Tell) -> Assessment:
        """Compute everything."""
        base, offsets = self._base()
        gains, in_power = self._gains_of_causes(base, tell)
        direct, names = self._of_filter()
        centres = np.median(direct[:, self.given :], axis=1)
        estimates = [self._offset_gains(offset) for offset in offsets]
        all_gains = np.concatenate([gains, *(each[0][None] for each in estimates)])
        roots = np.sqrt(2.0 * all_gains)
        scores = np.concatenate([np.abs(direct - centres[:, None]), roots])
        limits = np.quantile(scores[:, self.given :], 1.0 - LEVEL, axis=1)
        limits = np.where(limits > 0.0, limits, np.inf)
        scaled = scores / limits[:, None]
        names += [cause.name for cause in self.record.causes] + [offset.name for offset in self.record.offsets]
        freedom = np.array([1.0] * self.causes + [float(len(each.states)) for each in self.record.offsets])
        power_gains = np.concatenate([in_power, self._offsets_in_power(offsets)])
        of_candidates = limits[len(limits) - len(all_gains) :]
        largest = np.max(np.sqrt(2.0 * power_gains) / of_candidates[:, None, None, None], axis=0)
        named = np.argmax(power_gains - freedom[:, None, None, None], axis=0)
        critical = float(np.quantile(scaled[:, self.given :].max(axis=0), 1.0 - LEVEL))
        own_limits = of_candidates[self.causes :]
        sensitivity = tuple(
            self._noticed(offset, limit * critical) for offset, limit in zip(offsets, own_limits, strict=True)
        )
        known = tuple((each[1][:, : self.given], each[2]) for each in estimates)
        return Assessment(
            tuple(names), len(all_gains), scaled[:, : self.given], scaled[:, self.given :], direct[:, : self.given],
            centres, limits,
            all_gains[:, : self.given], all_gains[:, self.given :], known, largest, named, sensitivity,
        )  # fmt: skip

    def _of_filter(self) -> tuple[Array, list[str]]:
        """Compute the statistics of the filter itself, shape (d, given + simulated), and their names."""
        both = beside([self.own, self.simulated])
        values, names = [], []
        for sensor, each in zip(self.record.sensors, sensor_statistics(self.record, both), strict=True):
            values += [np.log(each.nis), each.autocorrelations[0]]
            names += [f"{sensor.name} NIS", f"{sensor.name} whiteness"]
        for group, nees in mean_nees(self.record, both).items():
            values.append(np.log(nees))
            names.append(f"{group} NEES")
        return np.array(values), names

    def _sums(self, factors: Sequence[dict[int, float]]) -> list[Sums]:
        """Whiten all but the offsets' records with each set of sizes, and sum."""
        p, first, f = self.trials, self.given + self.count, len(factors)
        wanted = slice(0, first + self.causes * p)
        squares = np.zeros((f, first))
        pairs, added, total = np.zeros((f, self.causes, p)), np.zeros((f, self.causes, p)), np.zeros(f)
        for whitened, log_determinants in whiten(self.record, self.columns.chosen(wanted), factors):
            total += log_determinants
            squares += np.einsum("fcr,fcr->fr", whitened[:, :, :first], whitened[:, :, :first])
            alone = whitened[:, :, first:].reshape(f, whitened.shape[1], self.causes, p)
            pairs += np.einsum("fcp,fcjp->fjp", whitened[:, :, self.given : self.given + p], alone)
            added += np.einsum("fcjp,fcjp->fjp", alone, alone)
        return [Sums(*each) for each in zip(squares, pairs, added, total.tolist(), strict=True)]

    def _gains_of_causes(self, base: Sums, tell: Tell) -> tuple[Array, Array]:
        """Compute the gains of all causes: of records, (j, given + N), and with one size multiplied, (j, j, f, p)."""
        extra = np.sqrt(np.array(FACTORS) ** 2 - 1.0)
        values = np.zeros((self.causes, len(GRID), self.given + self.count))
        powers = np.zeros((self.causes, len(GRID), self.causes, len(FACTORS), self.trials))
        here = slice(self.given, self.given + self.trials)

        def changed(sums: Sums) -> Array:
            """Squares of the simulated records with each size multiplied by each factor, shape (j, f, p)."""
            pairs, added = sums.pairs[:, None], sums.added[:, None]
            return np.asarray(sums.squares[here] + 2.0 * extra[:, None] * pairs + extra[:, None] ** 2 * added)

        at_one = changed(base)
        places = [(cause, place) for cause in range(self.causes) for place, factor in enumerate(GRID) if factor != 1.0]
        together = max(1, TOGETHER // (self.given + self.count + self.causes * self.trials))
        began = time.perf_counter()
        for begin in range(0, len(places), together):
            if begin == together:
                tell((time.perf_counter() - began) * len(places) / together)
            some = places[begin : begin + together]
            for at, sums in zip(some, self._sums([{cause: GRID[place]} for cause, place in some]), strict=True):
                grown = base.log_determinant - sums.log_determinant
                values[at] = 0.5 * (base.squares - sums.squares + grown)
                powers[at] = 0.5 * (at_one - changed(sums) + grown)
        return _highest(values), _highest(powers)

    def _base(self) -> tuple[Sums, list[_OffsetSums]]:
        """Whiten all with the campaign's own sizes."""
        p, first = self.trials, self.given + self.count
        last = first + self.causes * p
        sizes = [len(offset.states) for offset in self.record.offsets]
        offsets = [_OffsetSums.empty(size, first, self.causes, p) for size in sizes]
        squares, pairs, added, total = np.zeros(first), np.zeros((self.causes, p)), np.zeros((self.causes, p)), 0.0
        for (whitened,), (log_determinant,) in whiten(self.record, self.columns, [{}]):
            total += float(log_determinant)
            squares += np.einsum("cr,cr->r", whitened[:, :first], whitened[:, :first])
            alone = whitened[:, first:last].reshape(len(whitened), self.causes, p)
            pairs += np.einsum("cp,cjp->jp", whitened[:, self.given : self.given + p], alone)
            added += np.einsum("cjp,cjp->jp", alone, alone)
            at = last
            for offset, size in zip(offsets, sizes, strict=True):
                response = whitened[:, at : at + size]
                offset.information[...] += response.T @ response
                offset.products[...] += response.T @ whitened[:, :first]
                offset.alone[...] += np.einsum("ca,cjp->ajp", response, alone)
                at += size
        return Sums(squares, pairs, added, total), offsets

    def _offset_gains(self, offset: _OffsetSums) -> tuple[Array, Array, Array]:
        """Return the gains of an offset, shape (given + N,), its estimates and their covariance."""
        inverse = np.linalg.pinv(offset.information, rcond=1e-9, hermitian=True)
        estimates = inverse @ offset.products
        gains = np.asarray(0.5 * np.einsum("ar,ar->r", offset.products, estimates))
        return gains, np.asarray(estimates), np.asarray(inverse)

    def _offsets_in_power(self, offsets: Sequence[_OffsetSums]) -> Array:
        """Compute the gains of offsets with one size multiplied, shape (offsets, j, f, p)."""
        extra = np.sqrt(np.array(FACTORS) ** 2 - 1.0)[:, None]
        result = np.zeros((len(offsets), self.causes, len(FACTORS), self.trials))
        here = slice(self.given, self.given + self.trials)
        for number, offset in enumerate(offsets):
            inverse = np.linalg.pinv(offset.information, rcond=1e-9, hermitian=True)
            products = offset.products[:, here][:, None, None] + extra * offset.alone[:, :, None]
            result[number] = 0.5 * np.einsum("ajfp,ab,bjfp->jfp", products, inverse, products)
        return result

    def _noticed(self, offset: _OffsetSums, limit: float) -> Array:
        """Return the size along each axis at which the offset's own score is above a limit in 9 of 10 records."""
        inverse = np.linalg.pinv(offset.information, rcond=1e-9, hermitian=True)
        products = offset.products[:, self.given :]
        sizes = np.full(len(inverse), np.inf)
        for axis, column in enumerate(offset.information.T):
            if not column[axis] > 0.0:
                continue
            steps = np.geomspace(0.5, 50.0, 60) / np.sqrt(column[axis])
            for step in steps:
                moved = products + step * column[:, None]
                gains = 0.5 * np.einsum("ar,ab,br->r", moved, inverse, moved)
                if np.mean(np.sqrt(2.0 * gains) > limit) >= SHARE:
                    sizes[axis] = step
                    break
        return sizes


@dataclass(frozen=True)
class _OffsetSums:
    """Sums of the whitened response of an offset: with itself, (a, a), with records, (a, R), with causes, (a, j, p)."""

    information: Array
    products: Array
    alone: Array

    @classmethod
    def empty(cls, size: int, records: int, causes: int, trials: int) -> _OffsetSums:
        return cls(np.zeros((size, size)), np.zeros((size, records)), np.zeros((size, causes, trials)))


def _highest(values: Array) -> Array:
    """Return the highest gain over the grid, shape of ``values`` without its second axis, the grid's.

    It is that of the parabola over log factors through the highest value and its neighbours.
    """
    logarithms = np.log(GRID)
    best = np.clip(np.argmax(values, axis=1), 1, len(GRID) - 2)[:, None]
    low, here, high = (np.take_along_axis(values, best + step, axis=1)[:, 0] for step in (-1, 0, 1))
    best = best[:, 0]
    left, right = logarithms[best - 1] - logarithms[best], logarithms[best + 1] - logarithms[best]
    bend = ((high - here) / right - (low - here) / left) / (right - left)
    slope = (high - here) / right - bend * right
    top = np.clip(np.divide(-0.5 * slope, bend, out=np.zeros_like(bend), where=bend < 0.0), left, right)
    return np.asarray(np.maximum(values.max(axis=1), here + slope * top + bend * top**2))
