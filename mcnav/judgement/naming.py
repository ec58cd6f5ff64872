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
    def freedom(self) -> int:
        """Degrees of freedom."""
        return max(len(self.free), 1)

    @property
    def stands(self) -> bool:
        """Return whether it is no image of another one."""
        limit = 0.5 * float(chi2.isf(STANDS, self.freedom))
        return not self.at_end and self.gain + self.freedom > limit and self.lasting > limit


@dataclass(frozen=True)
class Named:
    """What is named, and what the record does not tell apart from it."""

    candidate: Candidate
    rivals: tuple[Candidate, ...]


class Naming:
    """Candidates of a record."""

    def __init__(self, record: FilteredRecord) -> None:
        self.record, self.scan = record, Scan(record)

    @cached_property
    def candidates(self) -> tuple[Candidate, ...]:
        """All candidates, the one of the largest gain first."""
        found = [*self._constants(), *self._sizes()]
        return tuple(sorted(found, key=lambda each: -each.gain))

    def foremost(self) -> Named | None:
        """Return what is named; none where no candidate stands, or the largest gain is at the end of its search."""
        standing = [each for each in self.candidates if each.stands]
        if not standing:
            return None
        first = standing[0]
        rivals = tuple(each for each in standing[1:] if first.gain - each.gain < TOLD_APART)
        return Named(first, rivals)

    def _constants(self) -> Iterator[Candidate]:
        base = self.scan.base
        for number, (offset, free) in enumerate(zip(self.record.offsets, self.scan.columns, strict=True)):
            gain = base.value(free) - base.value(NOTHING)
            lasting = min(self._lasting(free, NOTHING), self._lasting(free, self.beside(number)))
            yield Candidate(offset.name, None, number, free, gain - len(free), lasting)

    def beside(self, number: int) -> IndexArray:
        """Return the errors that are free beside a constant one: a sensor's arm beside its delay, and the reverse."""
        name = self.record.offsets[number].name
        for kind, other in (("_delay", "_lever_arm"), ("_lever_arm", "_delay")):
            partner = name.removesuffix(kind) + other
            for offset, columns in zip(self.record.offsets, self.scan.columns, strict=True):
                if name.endswith(kind) and offset.name == partner:
                    return columns
        return NOTHING

    def stands_beside(self, errors: IndexArray, others: IndexArray) -> bool:
        """Return whether constant errors gain with others free."""
        gain = self.scan.base.value(np.concatenate([errors, others])) - self.scan.base.value(others)
        return gain > 0.5 * float(chi2.isf(STANDS, len(errors)))

    def _lasting(self, free: IndexArray, others: IndexArray) -> float:
        """Return the gain of constant errors with others, and any one size, free besides."""
        both = np.concatenate([free, others])
        with_them, without = (
            max([self.scan.base.value(errors), *(profile.highest(errors)[1] for profile in self.scan.sizes.values())])
            for errors in (both, others)
        )
        return with_them - without

    def _sizes(self) -> Iterator[Candidate]:
        base, everything = self.scan.base, self.scan.everything
        for number, profile in self.scan.sizes.items():
            factor, value = profile.highest(NOTHING)
            lasting = profile.highest(everything)[1] - base.value(everything)
            yield Candidate(
                self.record.causes[number].name, number, None, NOTHING, value - base.value(NOTHING) - 1.0, lasting,
                factor, profile.at_end,
            )  # fmt: skip
