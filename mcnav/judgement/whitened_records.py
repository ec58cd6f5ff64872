"""Records that are whitened together: those that are given, simulated ones, and simulated ones of one cause alone."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from mcnav.arrays.types import Array, IndexArray
from mcnav.contract.recorded import FilteredRecord
from mcnav.judgement.likelihood import (
    at_start_alone,
    rescale_start,
    respond_freely,
    sources_at_start,
    whiten,
    without_corrections,
)
from mcnav.judgement.reduction import without_idle
from mcnav.judgement.simulation import Innovations, beside

GRID: Final = (1.0 / 30.0, 0.1, 0.3, 0.6, 0.9, 1.0, 1.1, 1.7, 3.0, 10.0, 30.0)
"""Factors of a size that are tried, between the ends of those for which an interval is looked for."""

FACTORS: Final = (1.2, 1.5, 2.0, 3.0, 5.0, 10.0)
"""Factors of a size for which the power is computed."""

TOGETHER: Final = 4_000
"""Records, over all sets of sizes, that are whitened together: few of them take as long as these."""

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
    moving : FilteredRecord
        Without the errors that stay zero.
    columns : Innovations
        Without the filter's corrections: given and simulated records, those of one cause alone, and the responses to
        constant errors and to sources at the start.
    given, simulated, trials : int
        Numbers of records; the last one of each cause alone.
    """

    record: FilteredRecord
    moving: FilteredRecord
    columns: Innovations
    given: int
    simulated: int
    trials: int
    base: Squares
    products: Array
    information: Array

    @classmethod
    def of(
        cls, record: FilteredRecord, given: Innovations, simulated: Innovations, alone: Sequence[Innovations]
    ) -> Together:
        """Whiten all of them with the campaign's own sizes."""
        states = [offset.states for offset in record.offsets]
        units = np.eye(len(record.mean))[:, np.concatenate([np.zeros(0, dtype=np.int64), *states])]
        responses = respond_freely(record, np.concatenate([units, sources_at_start(record)[0]], axis=1))
        columns = without_corrections(record, beside([given, simulated, *alone]))
        first, p = len(given) + len(simulated), len(alone[0])
        both = Innovations(
            tuple(np.concatenate(pair, axis=1) for pair in zip(columns.values, responses.values, strict=True)),
            responses.errors,
        )
        sums = _Summed.empty(1, first, len(alone), p, len(responses))
        moving = without_idle(record)
        for whitened, log_determinants in whiten(moving, both, [{}]):
            sums.add(whitened, log_determinants, len(given))
        return cls(
            record, moving, columns, len(given), len(simulated), p, sums.squares[0], sums.products, sums.information
        )  # fmt: skip

    @property
    def _places(self) -> list[IndexArray]:
        """Places of the offsets among the responses, and of the sources at the start behind them."""
        ends = np.cumsum([0, *(len(offset.states) for offset in self.record.offsets)])
        offsets = [np.arange(begin, end) for begin, end in pairwise(ends.tolist())]
        return [*offsets, np.arange(ends[-1], len(self.information))]

    def gains(self, tell: Tell) -> tuple[Array, Array]:
        """Compute the gains of all candidates: of records, (k, given + N), and with one size multiplied, (k, j, f, p).

        Parameters
        ----------
        tell : callable
            Told how long it will take, s, after the first of what takes longest.
        """
        causes, at_start = len(self.record.causes), at_start_alone(self.record)
        values = np.zeros((causes, len(GRID), self.given + self.simulated))
        powers = np.zeros((causes, len(GRID), causes, len(FACTORS), self.trials))
        at_one = self._multiplied(self.base)

        def compare(cause: int, place: int, sums: Squares) -> None:
            grown = self.base.log_determinant - sums.log_determinant
            values[cause, place] = 0.5 * (self.base.own - sums.own + grown)
            powers[cause, place] = 0.5 * (at_one - self._multiplied(sums) + grown)

        places = [(cause, place) for cause in range(causes) for place, factor in enumerate(GRID) if factor != 1.0]
        for cause, place in places:
            if cause in at_start:
                compare(cause, place, self._of_start(cause, GRID[place]))
        places = [(cause, place) for cause, place in places if cause not in at_start]
        together = max(1, TOGETHER // len(self.columns))
        began = time.perf_counter()
        for begin in range(0, len(places), together):
            if begin == together:
                tell((time.perf_counter() - began) * len(places) / together)
            some = places[begin : begin + together]
            for at, sums in zip(some, self._summed([{cause: GRID[place]} for cause, place in some]), strict=True):
                compare(*at, sums)
        offsets = [self._of_offset(places) for places in self._places[:-1]]
        return (
            np.concatenate([_highest(values), *(gains[None] for gains, _ in offsets)]),
            np.concatenate([_highest(powers), *(gains[None] for _, gains in offsets)]),
        )

    def noticed(self, offset: int, limit: float, share: float) -> Array:
        """Return the size along each axis at which an offset's own score is above a limit in a share of records."""
        places = self._places[offset]
        information = self.information[np.ix_(places, places)]
        inverse = np.linalg.pinv(information, rcond=1e-9, hermitian=True)
        products = self.products[places, self.given : self.given + self.simulated]
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

    def _split(self, products: Array) -> tuple[Array, Array, Array]:
        """Split products with all records into those with own ones, with the first simulated, and of causes alone."""
        first = self.given + self.simulated
        alone = products[:, first:].reshape(len(products), len(self.record.causes), self.trials)
        return products[:, :first], products[:, self.given : self.given + self.trials], alone

    def _summed(self, factors: Sequence[Mapping[int, float]]) -> list[Squares]:
        """Whiten all but the responses with each set of sizes, and sum."""
        sums = _Summed.empty(len(factors), self.given + self.simulated, len(self.record.causes), self.trials, 0)
        for whitened, log_determinants in whiten(self.moving, self.columns, factors):
            sums.add(whitened, log_determinants, self.given)
        return sums.squares

    def _of_start(self, cause: int, factor: float) -> Squares:
        """Return the sums with another size of errors at the start, from those with the campaign's sizes."""
        _, correlations, causes = sources_at_start(self.record)
        places = self._places[-1]
        scales = np.where(causes == cause, factor, 1.0)[None]
        (kernel,), (grown,) = rescale_start(self.information[np.ix_(places, places)], correlations, scales)
        own, here, alone = self._split(self.products[places])
        return Squares(
            self.base.own - np.einsum("ar,ab,br->r", own, kernel, own),
            self.base.pairs - np.einsum("ap,ab,bjp->jp", here, kernel, alone, optimize=True),
            self.base.added - np.einsum("ajp,ab,bjp->jp", alone, kernel, alone, optimize=True),
            self.base.log_determinant + float(grown),
        )

    def _of_offset(self, places: IndexArray) -> tuple[Array, Array]:
        """Return the gains of an offset, shape (given + N,), and with one size multiplied, shape (j, f, p)."""
        inverse = np.linalg.pinv(self.information[np.ix_(places, places)], rcond=1e-9, hermitian=True)
        own, here, alone = self._split(self.products[places])
        extra = np.sqrt(np.array(FACTORS) ** 2 - 1.0)[:, None]
        moved = here[:, None, None] + extra * alone[:, :, None]
        return (
            np.asarray(0.5 * np.einsum("ar,ab,br->r", own, inverse, own)),
            np.asarray(0.5 * np.einsum("ajfp,ab,bjfp->jfp", moved, inverse, moved, optimize=True)),
        )


@dataclass(frozen=True)
class _Summed:
    """Sums that grow from measurement to measurement, of f sets of sizes; those of responses are of the first set."""

    own: Array
    pairs: Array
    added: Array
    log_determinants: Array
    products: Array
    information: Array

    @classmethod
    def empty(cls, sets: int, own: int, causes: int, trials: int, responses: int) -> _Summed:
        alone = np.zeros((sets, causes, trials))
        return cls(
            np.zeros((sets, own)), alone, alone.copy(), np.zeros(sets), np.zeros((responses, own + causes * trials)),
            np.zeros((responses, responses)),
        )  # fmt: skip

    def add(self, whitened: Array, log_determinants: Array, given: int) -> None:
        """Add whitened innovations, shape (f, c, records)."""
        first, records = self.own.shape[1], self.products.shape[1]
        own, trials = whitened[:, :, :first], self.pairs.shape[2]
        alone = whitened[:, :, first:records].reshape(*whitened.shape[:2], *self.pairs.shape[1:])
        self.log_determinants[...] += log_determinants
        self.own[...] += np.einsum("fcr,fcr->fr", own, own)
        self.pairs[...] += np.einsum("fcp,fcjp->fjp", own[:, :, given : given + trials], alone)
        self.added[...] += np.einsum("fcjp,fcjp->fjp", alone, alone)
        if len(self.information):
            responses = whitened[0, :, records:]
            self.products[...] += responses.T @ whitened[0, :, :records]
            self.information[...] += responses.T @ responses

    @property
    def squares(self) -> list[Squares]:
        """The sums of each set."""
        return [
            Squares(*rows)
            for rows in zip(self.own, self.pairs, self.added, self.log_determinants.tolist(), strict=True)
        ]


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
