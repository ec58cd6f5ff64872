"""The likelihood of one record with every constant error free or not, for many sets of sizes.

Constant errors enter innovations linearly. With the whitened innovations z and their responses W to the errors b, the
log-likelihood is highest at the b of least squares, so that one pass over the record with the sums z.z, W^T z and W^T W
gives it for every choice of errors that are free ::

    log L = -1/2 (z.z - (W^T z)^T (W^T W)^-1 W^T z + sum log det S)

Sizes of errors at the start alone need no pass of their own (`StartApart`).
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Final

import numpy as np

from mcnav.arrays.types import Array, IndexArray
from mcnav.contract.recorded import FilteredRecord
from mcnav.judgement.likelihood import respond_freely, whiten, without_corrections, without_mean
from mcnav.judgement.profile import Factor, Profile, Sums, merged
from mcnav.judgement.reduction import present, with_causes
from mcnav.judgement.simulation import Innovations, recorded
from mcnav.judgement.start_apart import StartApart, start_alone, without_start

PRESENT: Final = np.geomspace(1.0 / 30.0, 30.0, 9)
"""Factors of a size that the campaign has."""

ABSENT: Final = np.geomspace(0.1, 30.0, 8)
"""Factors of the size from which one is looked for that the campaign does not have."""

BEYOND: Final = np.geomspace(30.0, 300.0, 4)[1:]
"""Factors that are tried besides where the largest of these is the likeliest."""

REFINEMENTS: Final = 6
"""Times, at most, that the grid is refined about its highest value, and about the ends of an interval."""

NOTHING: Final = np.zeros(0, dtype=np.int64)
"""No free error."""

BATCH: Final = 60
"""Sets of sizes that are whitened together."""


@dataclass(frozen=True)
class Scan:
    """Sums of a record for each size alone, multiplied by each of its factors.

    Attributes
    ----------
    record : FilteredRecord
        With the processes that the campaign does not have.
    settled : tuple of str
        Constant errors that are named already: they are free in everything.
    """

    record: FilteredRecord
    settled: tuple[str, ...] = ()
    _known: dict[int, Profile] = field(default_factory=dict, repr=False, compare=False)

    @cached_property
    def columns(self) -> Mapping[str, IndexArray]:
        """Places of each offset's errors among the free ones."""
        ends = np.cumsum([len(offset.states) for offset in self.record.offsets]).tolist()
        return {
            offset.name: np.arange(end - len(offset.states), end)
            for end, offset in zip(ends, self.record.offsets, strict=True)
        }

    @cached_property
    def always(self) -> IndexArray:
        """Errors that are free in everything."""
        return np.concatenate([NOTHING, *(self.columns[name] for name in self.settled)])

    @cached_property
    def everything(self) -> IndexArray:
        """All constant errors but those."""
        return np.setdiff1d(np.concatenate([NOTHING, *self.columns.values()]), self.always)

    def with_settled(self, free: IndexArray) -> IndexArray:
        """Return some errors, and those that are free in everything."""
        return np.concatenate([free, np.setdiff1d(self.always, free)])

    def highest(self, free: IndexArray) -> float:
        """Return the log-likelihood with the campaign's sizes and some errors free."""
        return float(self.base.values(self.with_settled(free))[0])

    def highest_with(self, number: int, free: IndexArray) -> tuple[float, float]:
        """Return the factor of one size with the highest log-likelihood, and it, some errors free besides."""
        return self.sizes[number].highest(self.with_settled(free))

    def at_end(self, number: int) -> bool:
        """Return whether the highest log-likelihood is at an end of a size's factors."""
        return self.sizes[number].at_end(self.always)

    @cached_property
    def sizes(self) -> Mapping[int, Profile]:
        """Profiles of all causes."""
        return self._searched(range(len(self.record.causes)))

    def factors(self, drops: Mapping[int, float]) -> dict[int, Factor]:
        """Estimate sizes, with the ends of intervals where the log-likelihood has fallen by a drop."""
        profiles = self._searched(drops)
        for _ in range(REFINEMENTS):
            ends = {number: profile.near_ends(self.always, drops[number]) for number, profile in profiles.items()}
            profiles = self._refined(profiles, ends)
        return {number: profile.factor(self.always, drops[number]) for number, profile in profiles.items()}

    def _searched(self, numbers: Collection[int]) -> dict[int, Profile]:
        """Compute profiles, each once: a grid of factors, refined about its highest value."""
        new = [number for number in numbers if number not in self._known]
        result = self._profiles({n: ABSENT if self.record.causes[n].absent else PRESENT for n in new})
        larger = [n for n in new if self.record.causes[n].absent and result[n].highest(self.always)[0] == ABSENT[-1]]
        result = self._refined(result, dict.fromkeys(larger, BEYOND))
        for _ in range(REFINEMENTS):
            result = self._refined(result, {number: profile.between(self.always) for number, profile in result.items()})
        self._known.update(result)
        return {number: self._known[number] for number in numbers}

    @cached_property
    def base(self) -> Sums:
        """With the campaign's sizes."""
        return self._closed(self._start, [{}])

    @cached_property
    def _errors(self) -> IndexArray:
        """States of the free errors."""
        return np.concatenate([NOTHING, *(offset.states for offset in self.record.offsets)])

    @cached_property
    def _apart(self) -> StartApart:
        """The record of the campaign alone without errors at the start alone."""
        own = without_mean(with_causes(self.record, present(self.record)))
        return StartApart.of(own, [self._measured], start_alone(own))

    @cached_property
    def _missing(self) -> Mapping[int, tuple[int, FilteredRecord]]:
        """Each process that the campaign does not have: its number in the record of the campaign with it, and this."""
        numbers = [number for number, cause in enumerate(self.record.causes) if cause.absent]
        records = {number: sorted({*present(self.record), number}) for number in numbers}
        plain, result = without_mean(self.record), {}
        for number, kept in records.items():
            record = with_causes(plain, kept)
            result[number] = kept.index(number), without_start(record, start_alone(record))
        return result

    @cached_property
    def _measured(self) -> Innovations:
        """The record less its mean, and the responses to free errors, without the filter's corrections."""
        record = self.record
        start = np.concatenate([record.mean[:, None], np.eye(len(record.mean))[:, self._errors]], axis=1)
        responses = respond_freely(record, start)
        own = without_corrections(record, recorded(record))
        values = tuple(
            np.concatenate([value - response[:, :1], response[:, 1:]], axis=1)
            for value, response in zip(own.values, responses.values, strict=True)
        )
        return Innovations(values, responses.errors)

    @cached_property
    def _start(self) -> tuple[Array, Array]:
        """Sums of all columns with the campaign's sizes, and log det S."""
        return self._summed(self._apart.moving, [{}])

    def _profiles(self, factors: Mapping[int, Array]) -> dict[int, Profile]:
        """Compute the sums with one size multiplied by factors, of each of some causes."""
        kept, apart = list(present(self.record)), self._apart
        at_start = {number for number in factors if number in kept and kept.index(number) in apart.causes}
        passing = [number for number in factors if number in kept and number not in at_start]
        result = self._whitened(apart.moving, {kept.index(number): factors[number] for number in passing}, passing)
        for number in at_start:
            sets = [{kept.index(number): float(factor)} for factor in factors[number]]
            result[number] = Profile(factors[number], self._closed(self._start, sets))
        for number in factors.keys() - {*kept}:
            cause, record = self._missing[number]
            result |= self._whitened(record, {cause: factors[number]}, [number])
        return {number: result[number] for number in factors}

    def _whitened(
        self, record: FilteredRecord, factors: Mapping[int, Array], numbers: Iterable[int]
    ) -> dict[int, Profile]:
        """Compute profiles by passes over the record, under the numbers of causes."""
        sets = [{cause: float(factor)} for cause, values in factors.items() for factor in values]
        if not sets:
            return {}
        sums, at, result = self._closed(self._summed(record, sets), [{} for _ in sets]), 0, {}
        for number, values in zip(numbers, factors.values(), strict=True):
            result[number] = Profile(np.asarray(values, dtype=float), sums.chosen(np.arange(at, at + len(values))))
            at += len(values)
        return result

    def _closed(self, sums: tuple[Array, Array], sets: Sequence[Mapping[int, float]]) -> Sums:
        """Return sums with sizes of errors at the start besides those of the pass."""
        (products, log_determinants), shifts = sums, self._apart.shifts
        count = shifts.shape[1]
        estimates, misfits, grown = StartApart.closed(
            products[:, count:, count:], products[:, count:, :count], shifts, self._apart.scales(sets)
        )
        whole = products[:, :count, :count] + np.swapaxes(estimates, -1, -2) @ estimates
        whole = whole - np.swapaxes(misfits, -1, -2) @ misfits
        return Sums(log_determinants + grown + whole[:, 0, 0], whole[:, 1:, 0], whole[:, 1:, 1:])

    def _refined(self, profiles: Mapping[int, Profile], factors: Mapping[int, Array]) -> dict[int, Profile]:
        finer = self._profiles({number: values for number, values in factors.items() if len(values)})
        return {number: merged(profile, finer.get(number)) for number, profile in profiles.items()}

    def _summed(self, record: FilteredRecord, sets: Sequence[Mapping[int, float]]) -> tuple[Array, Array]:
        """Whiten all columns with each set of sizes; return their products, (f, k, k), and log det S, (f,)."""
        columns = self._apart.columns
        matrices, determinants = np.zeros((len(sets), len(columns), len(columns))), np.zeros(len(sets))
        for begin in range(0, len(sets), BATCH):
            some = slice(begin, begin + BATCH)
            for whitened, log_determinants in whiten(record, columns, sets[some]):
                determinants[some] += log_determinants
                matrices[some] += np.swapaxes(whitened, -1, -2) @ whitened
        return matrices, determinants
