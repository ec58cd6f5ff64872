"""Kinds of filters compared: the verdict on each by Monte Carlo, of the same samples, over values of a key."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from mcnav.analysis.filter_consistency import Honesty
from mcnav.analysis.summary import FilterRatio, Summary
from mcnav.analysis.sweep import Variable

HORIZONTAL: Final = ("position_north", "position_east")
HEADING: Final = "heading"


@dataclass(frozen=True)
class KindResult:
    """Verdict of Monte Carlo on one kind of filter.

    Attributes
    ----------
    kind : str
    value : float or None
        Of the varied key, in its unit.
    folder : str
        Of the run, relative to that of the study.
    summary : Summary
    milliseconds : float
        Computing time of a sample on one thread.
    """

    kind: str
    value: float | None
    folder: str
    summary: Summary
    milliseconds: float

    @property
    def verdict(self) -> str:
        """Verdict on the filter over the whole flight."""
        return "" if self.summary.filter is None else self.summary.filter.verdict

    @property
    def factor(self) -> tuple[float, float, float] | None:
        """True over filter sigma where the verdict is decided, and its interval; none where nothing is known."""
        known = self.summary.filter
        if known is None or known.factor is None or known.factor_interval is None:
            return None
        low, high = known.factor_interval
        return known.factor, _finite(low), _finite(high)

    @property
    def decided_by(self) -> str:
        """Group or output that decides."""
        known = self.summary.filter
        return "" if known is None else known.output or known.group

    def group(self, name: str) -> FilterRatio | None:
        """Return the consistency of a group of errors at the end."""
        return None if self.summary.filter is None else self.summary.filter.groups.get(name)

    def sigmas(self, names: Sequence[str]) -> tuple[float, float]:
        """Return true and filter sigma of outputs at the end, SI; of several the DRMS, the root sum square."""
        known = {} if self.summary.filter is None else self.summary.filter.outputs
        true, own = ([getattr(known[name], key) for name in names if name in known] for key in
                     ("sigma_true", "sigma_filter"))  # fmt: skip
        return _root_sum_square(true), _root_sum_square(own)


def _finite(bound: float | None) -> float:
    return math.nan if bound is None else float(bound)


def _root_sum_square(sizes: Sequence[float | None]) -> float:
    known = [size for size in sizes if size is not None]
    return math.hypot(*known) if known else math.nan


@dataclass(frozen=True)
class KindComparison:
    """Kinds of filters of one campaign.

    Attributes
    ----------
    campaign : str
    kinds : tuple of str
    variable : Variable or None
        The varied key.
    results : tuple of KindResult
        By value, then by kind.
    """

    campaign: str
    kinds: tuple[str, ...]
    variable: Variable | None
    results: tuple[KindResult, ...]

    def of(self, kind: str) -> tuple[KindResult, ...]:
        """Return the results of a kind, by rising values."""
        return tuple(result for result in self.results if result.kind == kind)

    @property
    def optimistic_from(self) -> Mapping[str, float | None]:
        """By kind, the smallest value from which on it is certainly optimistic at every value; none where at none."""
        begins: dict[str, float | None] = {}
        for kind in self.kinds:
            begins[kind] = None
            for each in reversed(self.of(kind)):
                if each.verdict != Honesty.OPTIMISTIC:
                    break
                begins[kind] = each.value
        return begins
