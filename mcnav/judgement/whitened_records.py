"""Records that are whitened together: those that are given, simulated ones, and simulated ones of one cause alone."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate, pairwise
from typing import Final

import numpy as np

from mcnav.arrays.types import Array, IndexArray
from mcnav.contract.recorded import FilteredRecord
from mcnav.judgement.likelihood import respond_freely, whiten_many, without_corrections
from mcnav.judgement.simulation import Innovations, simulate_alone
from mcnav.judgement.start_apart import StartApart, start_alone

GRID: Final = (1.0 / 30.0, 0.1, 0.3, 0.6, 0.9, 1.0, 1.1, 1.7, 3.0, 10.0, 30.0)
"""Factors of a size that are tried, between the ends of those for which an interval is looked for."""

FACTORS: Final = (1.2, 1.5, 2.0, 3.0, 5.0, 10.0)
"""Factors of a size for which the power is computed."""

TOGETHER: Final = 15
"""Sets of sizes with which records are whitened together."""

Tell = Callable[[float], None]
"""Receiver of the time that a computation will take, s."""


@dataclass(frozen=True)
class Squares:
    """Sums over the whitened innovations of records with one set of sizes.

    Attributes
    ----------
    own : ndarray, shape (n,)
        Squares of the n given and simulated records.
    pairs, added : ndarray, shape (j, p)
        Products of the first p simulated records with p records of one cause alone, and the squares of these; for j
        causes.
    log_determinant : float
    """

    own: Array
    pairs: Array
    added: Array
    log_determinant: float


@dataclass(frozen=True)
class Together:
    """Records that are whitened together.

    Attributes
    ----------
    record : FilteredRecord
        Of mean zero.
    apart : StartApart
        Responses to constant errors, given and simulated records, and those of one cause alone.
    given, simulated, trials : int
        Numbers of records; the last one of each cause alone.
    shifts : ndarray, shape (m, n + j p + o)
        Errors at the start alone by which all records and responses are shifted.
    """

    record: FilteredRecord
    apart: StartApart
    given: int
    simulated: int
    trials: int
    shifts: Array

    @classmethod
    def of(
        cls, record: FilteredRecord, given: Innovations, simulated: Innovations, trials: int,
        generator: np.random.Generator,
    ) -> Together:  # fmt: skip
        """Take errors at the start alone out of all of them."""
        sources = start_alone(record)
        causes, alone, drawn = record.initial_causes[sources], list[Innovations](), list[Array]()
        for cause in range(len(record.causes)):
            if cause in causes:  # a linear function of the start, which needs no column
                units = generator.standard_normal((len(record.initial), trials))[sources]
                drawn.append(np.where((causes == cause)[:, None], units, 0.0))
            else:
                alone.append(simulate_alone(record, trials, generator, cause))
                drawn.append(np.zeros((len(sources), 0)))
        states = np.concatenate([np.zeros(0, dtype=np.int64), *(offset.states for offset in record.offsets)])
        responses = respond_freely(record, np.eye(len(record.mean))[:, states])
        records = [without_corrections(record, given), without_corrections(record, simulated), *alone]
        apart = StartApart.of(record, [responses, *records], sources)
        offsets, first = len(responses), len(given) + len(simulated)
        shifts, at = [apart.shifts[:, offsets : offsets + first]], offsets + first
        for units in drawn:
            shifts.append(units if units.shape[1] else apart.shifts[:, at : at + trials])
            at += 0 if units.shape[1] else trials
        shifts.append(apart.shifts[:, :offsets])
        return cls(record, apart, len(given), len(simulated), trials, np.concatenate(shifts, axis=1))

    @cached_property
    def base(self) -> Squares:
        """Squares with the campaign's own sizes."""
        return self._closed(self._start, {})

    @cached_property
    def _start(self) -> _Summed:
        """Sums with the campaign's own sizes, the responses to constant errors among them."""
        (sums,) = self._summed([{}], self._places[-1])
        return sums

    @cached_property
    def _of_offsets(self) -> tuple[Array, Array]:
        """Products of the responses to constant errors with all records, and their own, shapes (o, n + j p), (o, o)."""
        sums, sources = self._start, len(self.shifts)
        estimates, misfits, _ = self._solved(sums, {})
        records = self._spread(sums.products[sources:, : len(sums.squares)])
        count = records.shape[1]
        both = np.concatenate([records, sums.information[sources:, sources:]], axis=1)
        both += estimates[:, count:].T @ estimates - misfits[:, count:].T @ misfits
        return both[:, :count], both[:, count:]

    @cached_property
    def _places(self) -> list[int]:
        """Ends of the offsets among the responses."""
        return list(accumulate((len(offset.states) for offset in self.record.offsets), initial=0))

    @cached_property
    def _passing(self) -> list[int]:
        """Causes whose sizes need a pass."""
        return [cause for cause in range(len(self.record.causes)) if cause not in self.apart.causes]

    def gains(self, tell: Tell) -> tuple[Array, Array]:
        """Compute the gains of all candidates: of records, (k, given + N), and with one size multiplied, (k, j, f, p).

        Parameters
        ----------
        tell : callable
            Told how long it will take, s, after the first of what takes longest.
        """
        causes = len(self.record.causes)
        values = np.zeros((causes, len(GRID), self.given + self.simulated))
        powers = np.zeros((causes, len(GRID), causes, len(FACTORS), self.trials))
        at_one = self._multiplied(self.base)

        def compare(cause: int, place: int, sums: Squares) -> None:
            grown = self.base.log_determinant - sums.log_determinant
            values[cause, place] = 0.5 * (self.base.own - sums.own + grown)
            powers[cause, place] = 0.5 * (at_one - self._multiplied(sums) + grown)

        places = [(cause, place) for cause in range(causes) for place, factor in enumerate(GRID) if factor != 1.0]
        for cause, place in places:
            if cause in self.apart.causes:
                compare(cause, place, self._closed(self._start, {cause: GRID[place]}))
        places = [(cause, place) for cause, place in places if cause not in self.apart.causes]
        began = time.perf_counter()
        for begin in range(0, len(places), TOGETHER):
            if begin == TOGETHER:
                tell((time.perf_counter() - began) * len(places) / TOGETHER)
            some = places[begin : begin + TOGETHER]
            passed = self._summed([{cause: GRID[place]} for cause, place in some])
            for at, sums in zip(some, passed, strict=True):
                compare(*at, self._closed(sums, {}))
        offsets = [self._of_offset(np.arange(*ends)) for ends in pairwise(self._places)]
        return (
            np.concatenate([_highest(values), *(gains[None] for gains, _ in offsets)]),
            np.concatenate([_highest(powers), *(gains[None] for _, gains in offsets)]),
        )

    def noticed(self, offset: int, limit: float, share: float) -> Array:
        """Return the size along each axis at which an offset's own score is above a limit in a share of records."""
        places = np.arange(self._places[offset], self._places[offset + 1])
        all_products, all_information = self._of_offsets
        information = all_information[np.ix_(places, places)]
        inverse = np.linalg.pinv(information, rcond=1e-9, hermitian=True)
        products = all_products[places, self.given : self.given + self.simulated]
        sizes = np.full(len(inverse), np.inf)
        for axis, column in enumerate(information.T):
            if not column[axis] > 0.0:
                continue
            for step in np.geomspace(0.5, 50.0, 60) / np.sqrt(column[axis]):
                moved = products + step * column[:, None]
                gains = 0.5 * np.einsum("ar,ab,br->r", moved, inverse, moved)
                if np.mean(np.sqrt(2.0 * gains) > limit) >= share:
                    sizes[axis] = step
                    break
        return sizes

    def _multiplied(self, sums: Squares) -> Array:
        """Return squares of the first simulated records with each size multiplied by each factor, shape (j, f, p)."""
        extra = np.sqrt(np.array(FACTORS) ** 2 - 1.0)[:, None]
        own = sums.own[self.given : self.given + self.trials]
        return np.asarray(own + 2.0 * extra * sums.pairs[:, None] + extra**2 * sums.added[:, None])

    def _summed(self, factors: list[dict[int, float]], offsets: int = 0) -> list[_Summed]:
        """Whiten records with sets of sizes, and sum; so many responses to constant errors as well, all or none."""
        first, causes, left_out = self.given + self.simulated, len(self._passing), self._places[-1] - offsets
        values = tuple(each[:, left_out:] for each in self.apart.columns.values)
        responses = offsets + len(self.shifts)
        result = [_Summed.empty(first, causes, self.trials, responses) for _ in factors]
        columns = Innovations(values, self.apart.columns.errors)
        for number, whitened, log_determinant in whiten_many(self.apart.moving, columns, factors):
            behind = np.roll(whitened, -offsets, axis=1) if offsets else whitened
            result[number].add(behind, log_determinant, self.given)
        return result

    def _spread(self, columns: Array) -> Array:
        """Return columns of records that are whitened with zeros of the others between, the last axis n + j p."""
        first, causes, front = self.given + self.simulated, len(self.record.causes), columns.shape[:-1]
        alone = np.zeros((*front, causes, self.trials))
        alone[..., self._passing, :] = columns[..., first:].reshape(*front, len(self._passing), self.trials)
        return np.concatenate([columns[..., :first], alone.reshape(*front, causes * self.trials)], axis=-1)

    def _solved(self, sums: _Summed, sizes: Mapping[int, float]) -> tuple[Array, Array, float]:
        """Return u0 / d and h of all records and responses, and what log det S grows by (`StartApart`)."""
        sources, count = len(self.shifts), len(sums.squares)
        records, information = self._spread(sums.products[:sources, :count]), sums.information[:sources]
        products = np.concatenate([records, information[:, sources:]], axis=1)
        (estimates,), (misfits,), (grown,) = StartApart.closed(
            information[:, :sources], products, self.shifts[:, : products.shape[1]], self.apart.scales([sizes])
        )
        return estimates, misfits, float(grown)

    def _closed(self, sums: _Summed, sizes: Mapping[int, float]) -> Squares:
        """Return the sums with sizes of errors at the start besides those of the pass."""
        estimates, misfits, grown = self._solved(sums, sizes)
        first, count = self.given + self.simulated, len(self.record.causes) * self.trials
        tried = np.s_[:, None, self.given : self.given + self.trials]
        squares = self._spread(sums.squares)
        squares += np.sum((estimates**2 - misfits**2)[:, : first + count], axis=0)
        alone = np.zeros((len(self.record.causes), self.trials))
        alone[self._passing] = sums.pairs
        for part, sign in ((estimates, 1.0), (misfits, -1.0)):
            of_causes = part[:, first : first + count].reshape(len(part), len(alone), self.trials)
            alone += sign * np.sum(part[tried] * of_causes, axis=0)
        return Squares(
            squares[:first], alone, squares[first:].reshape(-1, self.trials), sums.log_determinant[0] + grown
        )  # fmt: skip

    def _of_offset(self, places: IndexArray) -> tuple[Array, Array]:
        """Return the gains of an offset, shape (given + N,), and with one size multiplied, shape (j, f, p)."""
        products, information = self._of_offsets
        inverse = np.linalg.pinv(information[np.ix_(places, places)], rcond=1e-9, hermitian=True)
        first = self.given + self.simulated
        own, here = products[places, :first], products[places, self.given : self.given + self.trials]
        alone = products[places, first:].reshape(len(places), len(self.record.causes), self.trials)
        extra = np.sqrt(np.array(FACTORS) ** 2 - 1.0)[:, None]
        moved = here[:, None, None] + extra * alone[:, :, None]
        return (
            np.asarray(0.5 * np.einsum("ar,ab,br->r", own, inverse, own)),
            np.asarray(0.5 * np.einsum("ajfp,ab,bjfp->jfp", moved, inverse, moved, optimize=True)),
        )


@dataclass(frozen=True)
class _Summed:
    """Sums that grow from measurement to measurement, of the records that are whitened.

    Attributes
    ----------
    products : ndarray, shape (r, n + q p + r)
        Of r responses with all records, and with each other.
    """

    squares: Array
    pairs: Array
    products: Array
    log_determinant: Array

    @property
    def information(self) -> Array:
        """Products of the responses with each other, shape (r, r)."""
        return self.products[:, len(self.squares) :]

    @classmethod
    def empty(cls, own: int, causes: int, trials: int, responses: int) -> _Summed:
        count = own + causes * trials
        return cls(
            np.zeros(count), np.zeros((causes, trials)), np.zeros((responses, count + responses)), np.zeros(1)
        )  # fmt: skip

    def add(self, whitened: Array, log_determinant: float, given: int) -> None:
        """Add whitened innovations, shape (c, records)."""
        causes, trials = self.pairs.shape
        count = len(self.squares)
        records, responses = whitened[:, :count], whitened[:, count:]
        alone = records[:, count - causes * trials :].reshape(len(whitened), causes, trials)
        self.log_determinant[...] += log_determinant
        self.squares[...] += np.einsum("cr,cr->r", records, records)
        self.pairs[...] += np.einsum("cp,cjp->jp", records[:, given : given + trials], alone)
        self.products[...] += responses.T @ whitened


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
