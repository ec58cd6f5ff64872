"""Advice on a campaign: other numbers of its data sheet, and filters that know more."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from mcnav.analysis.allocation import Allocation
from mcnav.analysis.filter_consistency import Honesty
from mcnav.analysis.linear_filter import LinearVerdict
from mcnav.analysis.summary import FilterSummary


@dataclass(frozen=True)
class FilterRemedy:
    """A change of the filter, and the verdict of linear analysis on the filter then.

    Attributes
    ----------
    words : str
        What is changed, such as ``estimates gyro_misalignment too``.
    verdict : LinearVerdict
    sigma : float
        True sigma, SI, then: of the output that departs most now, where its ratio is worst now.
    entries : mapping of str to sequence of str
        Entries of ``[filter]`` that are changed; one that is empty is taken out.
    simulated : FilterSummary or None
        Verdict by simulation; none where the filter was not simulated.
    samples : int
        Of that simulation.
    """

    words: str
    verdict: LinearVerdict
    sigma: float
    entries: Mapping[str, Sequence[str]] = field(default_factory=dict)
    simulated: FilterSummary | None = None
    samples: int = 0

    @property
    def rank(self) -> tuple[bool, bool, float, float]:
        """Key that sorts remedies, the best first: consistent, by simulation where there is one, then the sigma."""
        consistent = self.verdict.verdict == Honesty.CONSISTENT
        refuted = self.simulated is not None and self.simulated.verdict in (Honesty.OPTIMISTIC, Honesty.PESSIMISTIC)
        departure = 0.0 if consistent or not self.verdict.factor > 0.0 else abs(math.log(self.verdict.factor))
        return refuted, not consistent, departure, self.sigma


@dataclass(frozen=True)
class Advice:
    """Advice, found by linear analysis and confirmed by simulation.

    Attributes
    ----------
    allocation : Allocation or None
        Numbers with which the requirements are just met; none without requirements that linear analysis can judge.
    now : FilterRemedy or None
        The filter as it is; none without a filter, or where linear analysis finds it consistent.
    remedies : tuple of FilterRemedy
        The best first.
    lacks : str
        Why there is no advice; empty where there is.
    """

    allocation: Allocation | None = None
    now: FilterRemedy | None = None
    remedies: Sequence[FilterRemedy] = ()
    lacks: str = ""
