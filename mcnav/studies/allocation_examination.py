"""Proposals of an allocation that rest on linear analysis alone, examined by flights; no samples have shown them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from mcnav.analysis.allocation import Allocation, Goal, GradeChange, GradeSearch, NumberChange
from mcnav.config.data_sheet import next_grade
from mcnav.config.overrides import Value
from mcnav.errors import CampaignError
from mcnav.studies.examined_settings import Examiner
from mcnav.studies.variations import Variations, values_of


def examine_allocation(variations: Variations, allocation: Allocation, examiner: Examiner) -> Allocation:
    """Examine the campaign as it is, then each change that meets a goal, the smallest first, then changes of grades."""
    every = tuple(range(len(variations.base.requirements)))
    now = _verdict(variations, {}, every, examiner)
    goals = tuple(_examined_goal(variations, goal, examiner) for goal in allocation.goals)
    grades = allocation.grades
    if grades is not None:
        changes = tuple(_examined_grade(variations, grades, change, every, examiner) for change in grades.changes)
        grades = replace(grades, changes=changes)
    return replace(allocation, goals=goals, grades=grades, linearity=now, unexamined=examiner.reason)


def _examined_goal(variations: Variations, goal: Goal, examiner: Examiner) -> Goal:
    known = {number.path: number for number in (*variations.numbers, *variations.beliefs)}

    def examined(change: NumberChange) -> NumberChange:
        if not change.reached or change.simulated is not None:
            return change
        multiple = change.factor if math.isfinite(change.factor) else change.closest
        values = values_of([known[path] for path in change.paths], multiple)
        return replace(change, linearity=_verdict(variations, values, goal.requirements, examiner))

    return replace(goal, changes=tuple(examined(change) for change in goal.changes))


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
        examined = examiner.examine(variations.read(values))
    except CampaignError:
        return ""
    outputs = {output for number in goal for output in variations.base.requirements[number].requirement.outputs}
    return "" if examined is None else examined.verdict_on(sorted(outputs)).value
