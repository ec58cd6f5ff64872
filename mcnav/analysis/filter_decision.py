"""The verdict on a filter, from the findings on its groups of errors and on each of its outputs.

A *claim* is what one finding is of: the mean NEES of a group of errors, or the sigma of an output, over all epochs.

- The filter is *optimistic*, or else *pessimistic*, when one claim is certainly so. The intervals of all epochs of all
  claims share one error rate equally (Bonferroni): whatever their dependence, all of them hold at the stated
  confidence, so that a filter within the tolerance is blamed at most at the stated rate.
- It is *consistent* only when every claim is: groups and single outputs. A filter that is wrong in one of them is
  called consistent only if the interval of that one misses, so that no correction is needed (intersection-union test;
  Berger, 1982).
- Else it is *undecided*, also where all groups are consistent: in a mean NEES single errors average out, and two sigmas
  that are wrong in opposite directions cancel.

An output without error of which the filter believes that it has none makes no claim.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav.analysis.filter_consistency import CertainDeparture, Finding, GroupConsistency, Honesty, SigmaConsistency
from mcnav.arrays.types import Array

WHOLE: Final = ("navigation", "all")
"""Groups that hold every output."""

NOT_NAVIGATION: Final = ("all", "sensors")
"""Groups that do not decide, where there are others."""

OUTPUTS_OF: Final[Mapping[str, tuple[str, ...]]] = {"attitude": ("tilt", "heading")}
"""Beginnings of the names of a group's outputs, where they are not the group's name."""

DIRECTIONS: Final = (Honesty.OPTIMISTIC, Honesty.PESSIMISTIC)


@dataclass(frozen=True)
class Claim:
    """Subject of a finding.

    Attributes
    ----------
    name : str
        Of the group or of the output.
    size : int
        States of the group; zero of an output.
    finding : Finding
    """

    name: str
    size: int
    finding: Finding


@dataclass(frozen=True)
class Decision:
    """Verdict on a filter.

    Attributes
    ----------
    verdict : Honesty
    groups, outputs : Honesty
        Verdict on the groups of errors by themselves, and on the single outputs by themselves.
    decides : Claim
        The claim that decides: of a certain departure the largest, of a group where one departs; of an undecided filter
        that which needs the most samples; of a consistent one that farthest from one.
    departures : tuple of (Honesty, Claim)
        The largest certain departures: the optimistic ones first, and of each direction that of a group before that of
        an output.
    """

    verdict: Honesty
    groups: Honesty
    outputs: Honesty
    decides: Claim
    departures: tuple[tuple[Honesty, Claim], ...]


def decide(groups: Sequence[GroupConsistency], outputs: Sequence[SigmaConsistency]) -> Decision:
    """Decide on a filter by its deciding groups, one at least, and by all outputs that it may be wrong about.

    A group whose covariance is singular at every epoch makes no claim beside outputs that make one.
    """
    of_outputs = [Claim(output.name, 0, output.finding) for output in outputs if output.claims]
    known = [group for group in groups if group.ratio.known.any()]
    judged = known or ([] if of_outputs else groups)
    of_groups = [Claim(group.name, group.size, group.finding) for group in judged]
    departures = tuple(_departures(of_groups, of_outputs))
    whole = _together(of_groups) if of_groups else Honesty.UNDECIDED
    single = _together(of_outputs)
    if departures:
        return Decision(departures[0][0], whole, single, departures[0][1], departures)
    claims = [*of_groups, *of_outputs]
    decides = claims[combine([claim.finding for claim in claims]) or 0]
    return Decision(decides.finding.verdict, whole, single, decides, ())


def _departures(*kinds: Sequence[Claim]) -> Iterator[tuple[Honesty, Claim]]:
    for direction in DIRECTIONS:
        for claims in kinds:
            departing = [claim for claim in claims if claim.finding.verdict == direction]
            place = combine([claim.finding for claim in departing])
            if place is not None:
                yield direction, departing[place]


def _together(claims: Sequence[Claim]) -> Honesty:
    """Return the verdict on some claims by themselves; none of them is consistent."""
    place = combine([claim.finding for claim in claims])
    return Honesty.CONSISTENT if place is None else claims[place].finding.verdict


def certain_departures(decision: Decision, times: Array) -> tuple[CertainDeparture, ...]:
    """Return the departures of a decision with the times, shape (m,), at which they are certain."""
    departures = []
    for direction, claim in decision.departures:
        finding = claim.finding
        assert finding.factor is not None
        assert finding.interval is not None
        begin, end, worst = (float(times[each or 0]) for each in (finding.begin, finding.end, finding.worst))
        departures.append(
            CertainDeparture(direction, claim.name, claim.size, finding.factor, finding.interval, begin, end, worst)
        )
    return tuple(departures)


def combine(findings: Sequence[Finding]) -> int | None:
    """Return which of several findings decides; none when there is none.

    The most optimistic one outweighs the most pessimistic one, and this one that is undecided.
    """
    order = (Honesty.OPTIMISTIC, Honesty.PESSIMISTIC, Honesty.UNDECIDED, Honesty.CONSISTENT)

    def rank(number: int) -> tuple[int, float]:
        finding = findings[number]
        factor = 1.0 if finding.factor is None else finding.factor
        needed = math.inf if finding.samples_needed is None else finding.samples_needed
        away = {Honesty.OPTIMISTIC: -factor, Honesty.PESSIMISTIC: factor, Honesty.UNDECIDED: -needed}
        return order.index(finding.verdict), away.get(finding.verdict, -abs(factor - 1.0))

    return min(range(len(findings)), key=rank, default=None)


def deciding_names(groups: Iterable[str]) -> tuple[str, ...]:
    """Return the groups on which the verdict is: those of navigation errors; all, where navigation is no group.

    >>> deciding_names(["all", "navigation", "position", "sensors"]), deciding_names(["all", "sensors"])
    (('navigation', 'position'), ('all',))
    """
    names = tuple(groups)
    left_out = NOT_NAVIGATION if "navigation" in names else ("sensors",)
    picked = tuple(name for name in names if name not in left_out) or names
    return tuple(sorted(picked, key=lambda name: name == "all"))


def outputs_of(group: str, names: Sequence[str]) -> tuple[int, ...]:
    """Return the outputs of a group, all of them where none is named after it.

    >>> outputs_of("attitude", ["position_north", "tilt_east", "heading"])
    (1, 2)
    """
    beginnings = OUTPUTS_OF.get(group, (group,))
    members = tuple(number for number, name in enumerate(names) if name.startswith(beginnings))
    return members if members and group not in WHOLE else tuple(range(len(names)))


def worst_output(outputs: Sequence[SigmaConsistency], decision: Decision) -> int | None:
    """Return the output to name: that which certainly departs, else that of the group which is farthest from one.

    It is the farthest in the direction of the verdict, at the worst epoch of the group that decides.
    """
    names = [output.name for output in outputs]
    for direction, claim in decision.departures:
        if direction == decision.verdict and not claim.size:
            return names.index(claim.name)
    decides = decision.decides
    if decides.finding.worst is None or not outputs:
        return None
    if not decides.size:
        return names.index(decides.name)
    picked = outputs_of(decides.name, names)
    ratios = np.array([outputs[i].ratio.value[decides.finding.worst] for i in picked])
    if not np.isfinite(ratios).any():
        return None
    away = {Honesty.OPTIMISTIC: ratios, Honesty.PESSIMISTIC: -ratios}.get(decision.verdict, np.abs(ratios - 1.0))
    return int(picked[int(np.nanargmax(np.where(np.isfinite(ratios), away, np.nan)))])
