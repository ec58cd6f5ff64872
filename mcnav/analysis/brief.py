"""Advice of linear analysis on a campaign: other numbers of its data sheet, and filters that know more."""

from __future__ import annotations

from collections.abc import Sequence

from mcnav._dataclasses import dataclass
from mcnav.analysis.allocation import Allocation
from mcnav.analysis.linear_filter import LinearVerdict


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
    """

    words: str
    verdict: LinearVerdict
    sigma: float


@dataclass(frozen=True)
class Advice:
    """Advice of linear analysis.

    Attributes
    ----------
    allocation : Allocation or None
        Numbers with which the requirements are just met; none without requirements that linear analysis can judge.
    now : FilterRemedy or None
        The filter as it is; none without a filter, or where linear analysis finds it consistent.
    remedies : tuple of FilterRemedy
    lacks : str
        Why there is no advice; empty where there is.
    """

    allocation: Allocation | None = None
    now: FilterRemedy | None = None
    remedies: Sequence[FilterRemedy] = ()
    lacks: str = ""
