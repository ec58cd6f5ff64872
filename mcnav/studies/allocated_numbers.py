"""Goals of an allocation: for each number of a data sheet, the change with which requirements are just met."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Final

from mcnav.analysis.allocation import LEAST, MOST, Goal, NumberChange, critical_multiple, nearest_multiple, worst_of
from mcnav.config.data_sheet import DataSheetNumber, round_down, round_up
from mcnav.config.overrides import override
from mcnav.studies.variations import Variations, values_of
from mcnav.systems.ins.tables.imu_catalogue import NAMES

TOGETHER: Final = {f"bias and instability, {instrument}": f"imu.{instrument}.bias" for instrument in NAMES} | {
    "all of imu.gyro": "imu.gyro.", "all of imu.accelerometer": "imu.accelerometer.", "all of imu": "imu.",
}  # fmt: skip
"""Beginnings of the keys of numbers that are also changed together: a bias and what it does in run grow together."""

EVERYTHING: Final = "all numbers"

STEP: Final = 1e-3
"""Relative change with which the last digit of a proposed number is changed."""

CORRECTIONS: Final = 3
"""Times that this is done until its linear answer meets the goal."""


def _groups(numbers: Sequence[DataSheetNumber]) -> dict[str, list[DataSheetNumber]]:
    """Return the numbers that are changed together, by name: those of instruments, and all."""
    sheet_numbers = {
        name: [number for number in numbers if number.path.startswith(prefix)] for name, prefix in TOGETHER.items()
    } | {EVERYTHING: list(numbers)}
    kept: dict[str, list[DataSheetNumber]] = {}
    for name, members in sheet_numbers.items():
        if len(members) > 1 and members not in kept.values():
            kept[name] = members
    return kept


def find_goals(variations: Variations, goals: Sequence[tuple[int, ...]]) -> list[Goal]:
    """Find the change of each number, and of each group, with which the requirements of each goal are just met."""
    named = [(number.path, [number]) for number in variations.numbers]
    believed = [(number.path, [number]) for number in variations.beliefs]
    groups = list(_groups(variations.numbers).items())
    met = [worst_of(variations.base.requirements, goal).met for goal in goals]
    asked = [
        (goal, label, members)
        for goal, is_met in zip(goals, met, strict=True)
        for label, members in (*named, *([] if is_met else believed), *groups)
    ]
    changes = variations.in_lockstep([partial(find_change, variations, *each) for each in asked])

    def order(change: NumberChange, is_met: bool) -> tuple[bool, float]:
        if not change.reached:
            return True, -change.result.margin
        return False, change.factor if is_met else abs(math.log(change.factor)) if change.factor > 0.0 else math.inf

    found = list[Goal]()
    for goal, is_met in zip(goals, met, strict=True):
        own = [change for (of, _, _), change in zip(asked, changes, strict=True) if of == goal]
        found.append(Goal(goal, is_met, tuple(sorted(own, key=lambda change: order(change, is_met)))))
    return found


def find_change(
    variations: Variations, goal: tuple[int, ...], label: str, changed: Sequence[DataSheetNumber]
) -> NumberChange:
    """Find the multiple of some numbers with which a goal is just met, and compute the linear answer with it."""

    def margin(factor: float) -> float:
        multiple = variations.with_multiple(changed, factor)
        return math.nan if multiple is None else worst_of(multiple, goal).margin

    met = worst_of(variations.base.requirements, goal).met
    alone = changed[0] if len(changed) == 1 else None
    if met:
        factor, closest = critical_multiple(margin, rounded=partial(_rounded, alone, grows=False)), MOST
    else:
        factor, closest = nearest_multiple(margin, LEAST if math.isnan(margin(0.0)) else 0.0)
    now, paths = "" if alone is None else alone.text, tuple(number.path for number in changed)
    if math.isnan(factor) or math.isinf(factor):
        judged = variations.base.requirements if closest == 1.0 else variations.judged(values_of(changed, closest))
        result = variations.worst(judged or variations.base.requirements, goal)
        return NumberChange(label, paths, now, "", factor, closest, result)
    grows = factor > 1.0 and not met
    rounded = _rounded(alone, factor, grows)
    for _ in range(CORRECTIONS):
        judged = variations.judged(values_of(changed, rounded))
        if judged is not None and worst_of(judged, goal).met:
            break
        rounded = _rounded(alone, rounded * (1.0 + STEP if grows else 1.0 - STEP), grows)
    result = variations.worst(judged or variations.base.requirements, goal)
    if alone is None:
        return NumberChange(label, paths, now, "", rounded, rounded, result)
    values = alone.multiplied(rounded)
    needed = replace(alone, entry=values[alone.path]).text
    alike = override(variations.content, {alone.path: needed}) == override(variations.content, values)
    swept = f"{now}, {needed}" if alike and needed != now else ""
    return NumberChange(label, paths, now, needed, rounded, rounded, result, swept=swept)


def _rounded(alone: DataSheetNumber | None, factor: float, grows: bool) -> float:
    """Round a multiple to the side on which the goal is met: up where a number has to grow."""
    if alone is not None:
        return alone.rounded(factor, grows)
    return round_up(factor) if grows else round_down(factor)
