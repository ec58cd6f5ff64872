"""Proposals of an allocation that rest on linear analysis alone, examined by flights; no samples have shown them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from mcnav.analysis.allocation import OTHERS, Allocation, Goal, GradeChange, GradeSearch, NumberChange
from mcnav.config.data_sheet import next_grade
from mcnav.config.overrides import Value
from mcnav.errors import CampaignError
from mcnav.studies.examined_settings import Examiner
from mcnav.studies.variations import Variations, values_of


def examine_allocation(variations: Variations, allocation: Allocation, examiner: Examiner, every: bool) -> Allocation:
    """Examine the campaign as it is and the change that the answer states first; or every change and those of grades.

    A change that samples have shown is left as it is.
    """
    known = {number.path: number for number in (*variations.numbers, *variations.beliefs)}
    all_requirements = tuple(range(len(variations.base.requirements)))
    last, grades = allocation.goals[-1], allocation.grades
    stated = last.stated([change for change in last.changes if change.simulated is None])

    def examined(goal: Goal, change: NumberChange) -> NumberChange:
        if change.simulated is not None or not change.reached or not (every or change is stated):
            return change
        multiple = change.factor if math.isfinite(change.factor) else change.closest
        values = values_of([known[path] for path in change.paths], multiple)
        return replace(change, linearity=_verdict(variations, values, goal.requirements, examiner))

    now = _verdict(variations, {}, all_requirements, examiner)
    goals = tuple(
        replace(goal, changes=tuple(examined(goal, change) for change in goal.changes)) for goal in allocation.goals
    )
    if grades is not None and every:
        changes = tuple(
            _examined_grade(variations, grades, change, all_requirements, examiner) for change in grades.changes
        )
        grades = replace(grades, changes=changes)
    unexamined = examiner.reason or (OTHERS if now and not every else "")
    return replace(allocation, goals=goals, grades=grades, linearity=now, unexamined=unexamined)


def _examined_grade(
    variations: Variations, search: GradeSearch, change: GradeChange, goal: Sequence[int], examiner: Examiner
) -> GradeChange:
    if change.simulated is not None:
        return change
    values = grade_values(variations, search, change)
    return replace(change, linearity=_verdict(variations, values, goal, examiner))


def grade_values(variations: Variations, search: GradeSearch, change: GradeChange) -> dict[str, Value]:
    """Return the keys to be set for a change by one grade."""
    known = {number.path: number for number in variations.numbers}
    return {move.path: graded.entry for move in change.moves
            if (graded := next_grade(known[move.path], search.finer)) is not None}  # fmt: skip


def _verdict(
    variations: Variations, values: Mapping[str, Value], goal: Sequence[int], examiner: Examiner
) -> str:  # fmt: skip
    """Return whether linear analysis holds for the outputs of some requirements; empty where it was not examined."""
    if not examiner.open:
        return ""
    try:
        as_it_is = not values and not variations.scales
        campaign, model = (variations.campaign, variations.base.model) if as_it_is else (variations.read(values), None)
        examined = examiner.examine(campaign, model)
    except CampaignError:
        return ""
    outputs = {output for number in goal for output in variations.base.requirements[number].requirement.outputs}
    return "" if examined is None else examined.verdict_on(sorted(outputs)).value
