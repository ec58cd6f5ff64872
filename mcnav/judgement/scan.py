"""The likelihood of one record with every constant error free or not, for many sets of sizes.

Constant errors enter innovations linearly. With the whitened innovations z and their responses W to the errors b, the
log-likelihood is highest at the b of least squares, so that one pass over the record with the sums z.z, W^T z and W^T W
gives it for every choice of errors that are free ::

    log L = -1/2 (z.z - (W^T z)^T (W^T W)^-1 W^T z + sum log det S)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from mcnav.arrays.types import Array, IndexArray
from mcnav.contract.recorded import FilteredRecord
from mcnav.judgement.likelihood import whiten, without_corrections
from mcnav.judgement.reduction import present, with_causes
from mcnav.judgement.simulation import beside, less_mean, recorded, respond

PRESENT: Final = np.geomspace(1.0 / 30.0, 30.0, 15)
"""Factors of a size that the campaign has."""

ABSENT: Final = np.geomspace(0.1, 30.0, 14)
"""Factors of the size from which one is looked for that the campaign does not have."""

REFINEMENTS: Final = 2
"""Times that the grid is refined about its highest value."""

NOTHING: Final = np.zeros(0, dtype=np.int64)
"""No free error."""

BATCH: Final = 60
"""Sets of sizes that are whitened together."""


@dataclass(frozen=True)
class Sums:
    """Sums of one set of sizes: z.z + sum log det S, W^T z, shape (b,), and W^T W, shape (b, b)."""

    total: float
    products: Array
    information: Array

    def value(self, free: IndexArray) -> float:
        """Return the log-likelihood with some errors free."""
        if not len(free):
            return -0.5 * self.total
        products = self.products[free]
        return -0.5 * (self.total - float(products @ self.inverse(free) @ products))

    def inverse(self, free: IndexArray) -> Array:
        """Return the covariance of the estimates of some errors."""
        matrix = self.information[np.ix_(free, free)]
        scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
        scales = np.outer(scale, scale)
        return np.asarray(np.linalg.pinv(matrix / scales, rcond=1e-9, hermitian=True) / scales)

    def estimate(self, free: IndexArray) -> Array:
        """Return the estimates of some errors, all free."""
        return np.asarray(self.inverse(free) @ self.products[free])


@dataclass(frozen=True)
class Profile:
    """Sums of a record with one size multiplied by rising factors."""

    factors: Array
    sums: tuple[Sums, ...]

    def values(self, free: IndexArray) -> Array:
        """Return the log-likelihoods with some errors free."""
        return np.array([sums.value(free) for sums in self.sums])

    def highest(self, free: IndexArray) -> tuple[float, float]:
        """Return the factor of the highest log-likelihood, and it: of the parabola through its neighbours."""
        values = self.values(free)
        best = int(np.argmax(values))
        if best in (0, len(values) - 1):
            return float(self.factors[best]), float(values[best])
        logs = np.log(self.factors[best - 1 : best + 2])
        left, right = logs[0] - logs[1], logs[2] - logs[1]
        low, here, high = values[best - 1 : best + 2]
        bend = ((high - here) / right - (low - here) / left) / (right - left)
        slope = (high - here) / right - bend * right
        step = -0.5 * slope / bend if bend < 0.0 else 0.0
        return float(np.exp(logs[1] + step)), float(here + slope * step + bend * step**2)

    @property
    def at_end(self) -> bool:
        """Whether the highest value is at an end of the factors."""
        return int(np.argmax(self.values(NOTHING))) in (0, len(self.factors) - 1)

    @property
    def between(self) -> Array:
        """Factors between the highest value and its neighbours; none at an end."""
        best = int(np.argmax(self.values(NOTHING)))
        if best in (0, len(self.factors) - 1):
            return np.zeros(0)
        below = np.geomspace(self.factors[best - 1], self.factors[best], 4)[1:-1]
        return np.concatenate([below, np.geomspace(self.factors[best], self.factors[best + 1], 4)[1:-1]])


def _merged(profile: Profile, other: Profile | None) -> Profile:
    if other is None:
        return profile
    factors = np.concatenate([profile.factors, other.factors])
    order = np.argsort(factors)
    sums = (*profile.sums, *other.sums)
    return Profile(factors[order], tuple(sums[place] for place in order))


@dataclass(frozen=True)
class Scan:
    """Sums of a record for each size alone, multiplied by each of its factors.

    Attributes
    ----------
    record : FilteredRecord
        With the processes that the campaign does not have.
    """

    record: FilteredRecord

    @cached_property
    def columns(self) -> tuple[IndexArray, ...]:
        """Places of each offset's errors among the free ones."""
        ends = np.cumsum([len(offset.states) for offset in self.record.offsets])
        return tuple(
            np.arange(end - len(offset.states), end) for end, offset in zip(ends, self.record.offsets, strict=True)
        )

    @cached_property
    def everything(self) -> IndexArray:
        """All free errors."""
        return np.arange(sum(len(offset.states) for offset in self.record.offsets))

    @cached_property
    def base(self) -> Sums:
        """With the campaign's sizes."""
        return self._sums(with_causes(self.record, present(self.record)), [{}])[0]

    @cached_property
    def sizes(self) -> Mapping[int, Profile]:
        """Profiles of all causes: a grid of factors, refined twice about its highest value."""
        of_campaign = present(self.record)
        result = self._profiles(dict.fromkeys(of_campaign, PRESENT))
        for number, cause in enumerate(self.record.causes):
            if cause.absent:
                result |= self._profiles({number: ABSENT})
        for _ in range(REFINEMENTS):
            between = {number: profile.between for number, profile in result.items() if len(profile.between)}
            finer = self._profiles({number: between[number] for number in of_campaign if number in between})
            for number in between:
                if number not in finer:
                    finer |= self._profiles({number: between[number]})
            result = {number: _merged(profile, finer.get(number)) for number, profile in result.items()}
        return result

    def _profiles(self, factors: Mapping[int, Array]) -> dict[int, Profile]:
        """Compute the sums with one size multiplied by factors, of each of some causes."""
        kept = sorted({*present(self.record), *factors})
        sets = [{kept.index(number): float(factor)} for number, values in factors.items() for factor in values]
        sums = self._sums(with_causes(self.record, kept), sets)
        result, at = {}, 0
        for number, values in factors.items():
            result[number] = Profile(np.asarray(values, dtype=float), tuple(sums[at : at + len(values)]))
            at += len(values)
        return result

    def _sums(self, record: FilteredRecord, sets: Sequence[Mapping[int, float]]) -> list[Sums]:
        units = [np.eye(len(record.mean))[:, offset.states] for offset in record.offsets]
        columns = beside([less_mean(record, recorded(record)), *(respond(record, unit) for unit in units)])
        columns, plain = without_corrections(record, columns), replace(record, mean=np.zeros_like(record.mean))
        result = []
        for begin in range(0, len(sets), BATCH):
            some = sets[begin : begin + BATCH]
            total, matrix = np.zeros(len(some)), np.zeros((len(some), len(columns), len(columns)))
            for whitened, log_determinants in whiten(plain, columns, some):
                total += log_determinants
                matrix += np.swapaxes(whitened, -1, -2) @ whitened
            result += [
                Sums(float(logarithm + grid[0, 0]), grid[1:, 0], grid[1:, 1:])
                for logarithm, grid in zip(total, matrix, strict=True)
            ]
        return result
