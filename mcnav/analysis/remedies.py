"""Changes of a campaign that would help where its filter or a requirement fails; the best first.

Each is computed: the filter and the requirements of the changed campaign by linear covariance, or by samples of it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final, Literal

from mcnav.analysis.examination import Linearity
from mcnav.analysis.filter_consistency import Honesty
from mcnav.files.records import Number, Record

if TYPE_CHECKING:
    from mcnav.analysis.summary import Summary

Failing = Literal["filter", "requirement"]
"""Subject by which remedies are ranked: a requirement that is not met, else a filter at odds with the truth."""

CONFIRMING: Final = (Honesty.CONSISTENT.value, "met")
"""Findings of samples that confirm a remedy."""

DEPARTING: Final = (Honesty.OPTIMISTIC.value, Honesty.PESSIMISTIC.value)
"""Verdicts on a filter that fails."""

REFUTING: Final = (*DEPARTING, "not met")
"""Findings of samples that refute a remedy; of an undecided one linear covariance is what is known."""

DOUBTED: Final = (Linearity.FAILS.value, Linearity.UNKNOWN.value)
"""Verdicts of an examination by which linear analysis is not shown to hold."""

LEAST: Final = 5e-4
"""Change of a ratio, sigma or share of a limit below which a remedy does not help."""


NOWHERE_LINEAR: Final = "linear analysis does not hold of anything that it proposes"


class Standing(Record):
    """Linear answer to a campaign or to a remedy.

    Attributes
    ----------
    verdict : str
        On the filter; empty where it is not known.
    ratio : float
        True over filter sigma where the filter departs the most; NaN where it is not known.
    sigma : float
        True sigma, SI, of the output that departs the most now, where its ratio is worst now; NaN without one.
    used : float
        Largest share of its limit that a requirement uses; NaN without requirements on sizes.
    """

    verdict: str = ""
    ratio: Number = math.nan
    sigma: Number = math.nan
    used: Number = math.nan

    @property
    def departure(self) -> float:
        """Return the departure of the filter from the truth: zero for a consistent filter."""
        if self.verdict == Honesty.CONSISTENT or not self.ratio > 0.0:
            return 0.0
        return abs(math.log(self.ratio))


class Remedy(Record):
    """A change of a campaign.

    Attributes
    ----------
    words : str
        What to do, such as ``estimate gyro misalignment``.
    lines : str
        Entries of the campaign file that change, as it has them.
    campaign : str
        The whole campaign file with the change.
    then : Standing
    held : bool
        Whether the filter's gains were held; a filter that believes the changed number is re-tuned by a run.
    simulated : str
        Finding of samples of the changed campaign on what fails; empty where it was not simulated.
    samples : int
        Of that simulation; they have the draws of the run.
    linearity : str
        Whether linear analysis holds of the changed campaign: ``holds``, ``does not hold``, ``cannot say``; empty where
        no flight has examined it.
    """

    words: str
    lines: str
    campaign: str
    then: Standing
    held: bool = False
    simulated: str = ""
    samples: int = 0
    linearity: str = ""

    @property
    def doubted(self) -> bool:
        """Return whether it rests on linear analysis that is not shown to hold, and on no samples."""
        return self.linearity in DOUBTED and not self.confirmed

    @property
    def confirmed(self) -> bool:
        """Return whether samples show that nothing fails any more."""
        return self.simulated in CONFIRMING

    @property
    def mends(self) -> bool:
        """Return whether nothing fails any more, by samples where there are any."""
        if self.simulated in (*CONFIRMING, *REFUTING):
            return self.confirmed
        return self.then.verdict in ("", Honesty.CONSISTENT) and not self.then.used >= 1.0


class Remedies(Record):
    """Remedies of a campaign.

    Attributes
    ----------
    failing : str
        Requirement or filter.
    output : str
        Output that departs the most; empty where a requirement fails, or a group of outputs departs.
    at : str
        When it does, in words.
    now : Standing
    listed : tuple of Remedy
        The best first.
    withheld : tuple of str
        Remedies by linear covariance that samples do not confirm, or that no sample was asked about although linear
        analysis fails in the run.
    reason : str
        Why none is listed; empty where one is.
    unexamined : str
        Why flights have not examined all that are listed, a clause; empty where they have, or nobody asked.
    left : int
        Remedies that were not computed, because a run does not wait for them.
    missed : tuple of str
        Kinds of errors that a filter in code misses most: no entry of the campaign file changes what it models.
    beside : str
        Where the file of a remedy is to be saved, as the end of a sentence.
    """

    failing: Failing
    output: str = ""
    at: str = ""
    now: Standing = Standing()
    listed: tuple[Remedy, ...] = ()
    withheld: tuple[str, ...] = ()
    reason: str = ""
    left: int = 0
    unexamined: str = ""
    missed: tuple[str, ...] = ()
    beside: str = ""

    @property
    def best(self) -> Remedy | None:
        """The first remedy; none where none helps."""
        return self.listed[0] if self.listed else None

    @property
    def advisable(self) -> Remedies:
        """These without remedies where linear analysis does not hold and no samples confirm them."""
        kept = [remedy for remedy in self.listed if remedy.linearity != Linearity.FAILS or remedy.confirmed]
        left_out = [remedy.words for remedy in self.listed if remedy not in kept]
        reason = self.reason if kept or not left_out else NOWHERE_LINEAR
        return self.completed(
            {"listed": tuple(kept), "withheld": (*self.withheld, *left_out), "reason": reason or None}
        )


def something_fails(summary: Summary) -> bool:
    """Return whether a run finds a requirement not met, or its filter at odds with the truth."""
    departs = summary.filter is not None and summary.filter.verdict in DEPARTING
    return departs or any(entry.finding == "not met" for entry in summary.requirements)


def helps(remedy: Remedy, of: Remedies) -> bool:
    """Return whether a remedy changes what fails for the better, by more than rounding."""
    then, now = remedy.then, of.now
    if of.failing == "requirement":
        return then.used < now.used * (1.0 - LEAST)
    nearer = then.departure < now.departure - LEAST
    return nearer or (remedy.held and then.sigma < now.sigma * (1.0 - LEAST))


def ranked(remedies: Sequence[Remedy], failing: Failing) -> tuple[Remedy, ...]:
    """Sort remedies, the best first: what samples refute is last.

    A failing requirement ranks by the share of its limit that is used then; a filter by whether it is consistent then,
    by its departure, and by the true sigma.
    """

    def key(remedy: Remedy) -> tuple[bool, float, bool, float, float]:
        then = remedy.then
        refuted = remedy.simulated in REFUTING
        used = then.used if failing == "requirement" and not math.isnan(then.used) else 0.0
        sigma = math.inf if math.isnan(then.sigma) else then.sigma
        return refuted, used, then.verdict != Honesty.CONSISTENT, then.departure, sigma

    return tuple(sorted(remedies, key=key))


def doubted_last(remedies: Sequence[Remedy]) -> tuple[Remedy, ...]:
    """Put remedies of which linear analysis does not hold behind the others."""
    return tuple(sorted(remedies, key=lambda remedy: remedy.linearity == Linearity.FAILS and not remedy.confirmed))
