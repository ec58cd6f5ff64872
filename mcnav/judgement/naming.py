"""Which number of a campaign, or what the campaign does not have, a record is at odds with.

Every candidate has the gain of its own likelihood: a constant error (a delay, an arm, a bias), a size of the campaign,
or a process that the campaign lacks. It is named only if it stands: a constant error if it gains with each size free
besides, a size if it gains with all constant errors free. A wrong model of the gyros makes a false delay, and a delay
makes a wrong noise; neither stands. A size at the end of its search is no answer. A delay is always estimated together
with the arm of its sensor.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from scipy.stats import chi2

from mcnav.arrays.types import IndexArray
from mcnav.contract.recorded import FilteredRecord
from mcnav.judgement.scan import NOTHING, Scan

STANDS: Final = 1e-3
"""Probability with which a candidate without an error stands: twice its gain is chi-square."""

TOLD_APART: Final = float(np.log(20.0))
"""Difference of gains below which two candidates are not told apart: a ratio of likelihoods of twenty."""


DELAY: Final = "_delay"
CLOCK: Final = "_clock_rate"
"""Ends of the names of a sensor's delay, and of the rate of its clock."""

GROWS: Final = 0.5 * float(chi2.isf(0.05, 1))
"""Gain of a clock rate beside a constant delay from which the delay may be one that grows."""


def _limit(freedom: int) -> float:
    """Return the gain from which a candidate stands."""
    return 0.5 * float(chi2.isf(STANDS, freedom))


@dataclass(frozen=True)
class Candidate:
    """What may be wrong.

    Attributes
    ----------
    cause : int or None
        Number of a cause, whose size it is.
    offset : int or None
        Number of a constant error.
    free : ndarray of int
        Errors that it frees.
    gain : float
        Of the log-likelihood, less one for each degree of freedom.
    lasting : float
        The gain with what may stand for it free.
    factor : float
        Of a size, at the highest likelihood of the grid.
    at_end : bool
        Whether that is an end of the search.
    """

    name: str
    cause: int | None
    offset: int | None
    free: IndexArray
    gain: float
    lasting: float
    factor: float = 1.0
    at_end: bool = False

    @property
    def sensor(self) -> str:
        """The sensor whose stamps it moves; none where it moves none."""
        kind = next((kind for kind in (DELAY, CLOCK) if self.offset is not None and self.name.endswith(kind)), "")
        return self.name.removesuffix(kind) if kind else ""

    @property
    def freedom(self) -> int:
        """Degrees of freedom."""
        return max(len(self.free), 1)

    @property
    def stands(self) -> bool:
        """Return whether it is no image of another one."""
        limit = _limit(self.freedom)
        return not self.at_end and self.gain + self.freedom > limit and self.lasting > limit

    @property
    def certain(self) -> bool:
        """Return whether it would stand if it were twenty times less likely."""
        return self.stands and self.lasting > _limit(self.freedom) + TOLD_APART


@dataclass(frozen=True)
class Named:
    """What is named, and what the record does not tell apart from it."""

    candidate: Candidate
    rivals: tuple[Candidate, ...]


class Naming:
    """Candidates of a record, beside constant errors that are named already."""

    def __init__(self, record: FilteredRecord, settled: tuple[str, ...] = ()) -> None:
        self.record, self.scan = record, Scan(record, settled)

    @cached_property
    def candidates(self) -> tuple[Candidate, ...]:
        """All candidates, the one of the largest gain first."""
        return tuple(sorted([*self._constants(), *self._sizes()], key=lambda candidate: -candidate.gain))

    def foremost(self) -> Named | None:
        """Return what is named, a certain constant error before a likelier size; none where no candidate stands.

        Both are wrong then: the constant error gains with each size free, and the size with all constant errors free.
        """
        standing = [candidate for candidate in self.candidates if candidate.stands]
        if not standing:
            return None
        first = standing[0]
        certain = [candidate for candidate in standing if candidate.offset is not None and candidate.certain]
        if first.offset is None and certain and first.gain - certain[0].gain >= TOLD_APART:
            first = certain[0]
        rivals = tuple(
            candidate for candidate in standing
            if candidate is not first and abs(first.gain - candidate.gain) < TOLD_APART
        )  # fmt: skip
        return Named(first, rivals)

    def _constants(self) -> Iterator[Candidate]:
        scan = self.scan
        for number, offset in enumerate(self.record.offsets):
            if offset.name in scan.settled:
                continue
            free = self.freed(offset.name)
            gain = scan.highest(free) - scan.highest(NOTHING)
            yield Candidate(offset.name, None, number, free, gain - len(free), self._lasting_beside(offset.name))

    def freed(self, name: str) -> IndexArray:
        """Return the errors that a constant one frees: a clock rate frees the delay at the start as well."""
        free = self.scan.columns[name]
        if not name.endswith(CLOCK):
            return free
        return np.concatenate([free, self.scan.columns.get(name.removesuffix(CLOCK) + DELAY, NOTHING)])

    def beside(self, name: str) -> IndexArray:
        """Return the errors that are free beside a constant one: a sensor's arm beside its delay, and the reverse."""
        for kind, other in ((DELAY, "_lever_arm"), ("_lever_arm", DELAY)):
            if name.endswith(kind):
                partner = name.removesuffix(kind) + other
                return NOTHING if partner in self.scan.settled else self.scan.columns.get(partner, NOTHING)
        return NOTHING

    def _lasting_beside(self, name: str) -> float:
        """Return what a constant error gains with any one size free, and its partner where that gains beside it.

        At constant speed a delay and an arm are one: neither gains beside the other, and both stand. A clock rate that
        gains nothing beside a constant delay is none.
        """
        free, partner = self.freed(name), self.beside(name)
        alone = self._lasting(free, NOTHING)
        if name.endswith(CLOCK) and self._lasting(free[:1], free[1:]) <= GROWS:
            return 0.0
        if not len(partner) or self._lasting(partner, free) <= _limit(len(partner)):
            return alone
        return min(alone, self._lasting(free, partner))

    def stands_beside(self, errors: IndexArray, others: IndexArray) -> bool:
        """Return whether constant errors gain with others free."""
        gain = self.scan.highest(np.concatenate([errors, others])) - self.scan.highest(others)
        return gain > _limit(len(errors))

    def _lasting(self, free: IndexArray, others: IndexArray) -> float:
        """Return the gain of constant errors with others, and any one size, free besides."""
        both = np.concatenate([free, others])
        with_them, without = (
            max([self.scan.highest(errors), *(self.scan.highest_with(size, errors)[1] for size in self.scan.sizes)])
            for errors in (both, others)
        )
        return with_them - without

    def _sizes(self) -> Iterator[Candidate]:
        scan = self.scan
        for number in scan.sizes:
            factor, value = scan.highest_with(number, NOTHING)
            lasting = scan.highest_with(number, scan.everything)[1] - scan.highest(scan.everything)
            yield Candidate(
                self.record.causes[number].name, number, None, NOTHING, value - scan.highest(NOTHING) - 1.0, lasting,
                factor, scan.at_end(number),
            )  # fmt: skip
