"""Changes of an allocation that simulation confirms; what it does not confirm is not proposed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

from mcnav.analysis.allocation import LEAST, Goal, GradeChange, GradeSearch, NumberChange
from mcnav.analysis.requirements import Finding
from mcnav.analysis.simulated_requirements import least_margin, measured_scale
from mcnav.analysis.summary import RequirementEntry, Summary
from mcnav.config.overrides import Value
from mcnav.config.read import Campaign
from mcnav.errors import CampaignError
from mcnav.execution.progress import Progress
from mcnav.studies.allocated_numbers import find_change
from mcnav.studies.allocation_examination import grade_values
from mcnav.studies.simulated_campaigns import simulated
from mcnav.studies.variations import Variations, values_of

ATTEMPTS: Final = 4
"""Sizes of a change that are simulated until one is confirmed, each scaled by what the one before measured."""

USED: Final = 0.97
"""Share of the scale that a change was sized by from which on what the samples measure leaves nothing to gain."""

SPARE: Final = 1.002
"""Factor on the scale of a further attempt, so that proposed numbers, which have three digits, do not repeat."""


@dataclass(frozen=True)
class ConfirmationPlan:
    """So many changes of each goal are simulated, with so many samples and workers."""

    changes: int
    samples: int
    jobs: int
    progress: Progress

    def simulate(self, campaign: Campaign) -> Summary:
        """Simulate a campaign."""
        return simulated(campaign, self.samples, self.jobs, self.progress)


def confirm_goal(variations: Variations, goal: Goal, plan: ConfirmationPlan) -> Goal:
    """Simulate the smallest changes that reach a goal; keep those that are met, and name those that are not."""
    proposed = [change for change in goal.changes if change.reached][: plan.changes]
    results = {change.label: _confirmed(variations, goal, change, plan) for change in proposed}
    changes = tuple(results.get(change.label, change) for change in goal.changes)
    kept = tuple(change for change in changes if change is not None)
    return replace(goal, changes=kept, unconfirmed=tuple(name for name, change in results.items() if change is None))


def _confirmed(variations: Variations, goal: Goal, change: NumberChange, plan: ConfirmationPlan) -> NumberChange | None:
    """Simulate a change, and others as the samples ask for them; the mildest that is met, none where no attempt is."""
    known = {number.path: number for number in (*variations.numbers, *variations.beliefs)}
    numbers, best = [known[path] for path in change.paths], None
    for _ in range(ATTEMPTS):
        multiple = change.factor if math.isfinite(change.factor) else change.closest
        entries = _simulate(variations, values_of(numbers, multiple), plan)
        if entries is None:
            return best
        limited = [entries[number] for number in goal.requirements]
        met = all(entry.finding == Finding.MET for entry in limited)
        if met and (best is None or _is_milder(change, best, goal.met)):
            best = replace(change, simulated=least_margin(limited))
        scales = _measured(variations.scales, entries, goal.requirements)
        spare = max(scales[number] / variations.scales[number] for number in goal.requirements)
        if math.isinf(change.factor) or (met and spare > USED):
            return best
        variations = variations.rescaled(scales)
        before, change = change, find_change(variations, goal.requirements, change.label, numbers)
        loosened = change.reached and change.factor > 1.0
        if not change.reached or change.factor == before.factor or (goal.met and not loosened):
            return best
    return best


def _is_milder(change: NumberChange, other: NumberChange, loosened: bool) -> bool:
    """Return whether a change asks for less than another one, or allows more where numbers are loosened."""
    if loosened:
        return change.factor > other.factor
    return abs(math.log(max(change.factor, LEAST))) < abs(math.log(max(other.factor, LEAST)))


def _simulate(
    variations: Variations, values: Mapping[str, Value], plan: ConfirmationPlan
) -> Sequence[RequirementEntry] | None:
    """Simulate the campaign with some keys set; none where it is refused."""
    try:
        return plan.simulate(variations.read(values)).requirements
    except CampaignError:
        return None


def _measured(scales: Sequence[float], entries: Sequence[RequirementEntry], goal: Sequence[int]) -> tuple[float, ...]:
    """Return the scales of a goal's requirements as the changed campaign's samples have them; of unmet ones no less."""
    measured = list(scales)
    for number in goal:
        scale, met = measured_scale(entries[number]), entries[number].finding == Finding.MET
        known = scale if scale > 0.0 else scales[number]
        measured[number] = SPARE * (known if met else max(known, scales[number]))
    return tuple(measured)


def confirm_grades(
    variations: Variations, search: GradeSearch, goal: Sequence[int], plan: ConfirmationPlan
) -> GradeSearch:
    """Simulate the first changes by one grade, and leave out the others."""

    def confirmed(change: GradeChange) -> GradeChange | None:
        entries = _simulate(variations, grade_values(variations, search, change), plan)
        if entries is None:
            return None
        return replace(change, simulated=least_margin([entries[number] for number in goal]))

    changes = [confirmed(change) for change in search.changes[: plan.changes]]
    return replace(search, changes=tuple(change for change in changes if change is not None))
