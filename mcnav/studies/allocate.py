"""Allocation of errors: numbers of a campaign's data sheet with which its requirements are just met.

Without a filter the final covariance is a sum of the squares of the numbers, so that multiples follow from the budget.
With one, the gains change with what the filter believes, and each multiple takes a covariance of the closed loop of its
own, from all causes at once. Either way every number proposed is put into the campaign and its linear answer, by cause,
computed.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from math import comb
from pathlib import Path
from typing import Any, Final

import numpy as np

from mcnav._threads import one_thread
from mcnav.analysis.allocation import (
    LEAST,
    MOST,
    Allocation,
    Goal,
    GradeChange,
    GradeMove,
    GradeSearch,
    NumberChange,
    critical_multiple,
    nearest_multiple,
    worst_of,
)
from mcnav.analysis.linear_answer import LinearAnswer, LinearRequirement, judge_within_range
from mcnav.analysis.linear_covariance import Moments, covariance_over_time
from mcnav.analysis.linear_range import limits_of
from mcnav.analysis.rejections import OnLinear
from mcnav.config.data_sheet import (
    DataSheetNumber,
    GradedValue,
    believed_numbers,
    data_sheet_numbers,
    next_grade,
    round_down,
    round_up,
    shown,
)
from mcnav.config.overrides import Value, document_of, override
from mcnav.config.read import Campaign, parse_campaign
from mcnav.contract.linear import SharedTables
from mcnav.contract.scenario import can_have_filter, knows_covariance
from mcnav.errors import CampaignError, Problem
from mcnav.files import indented_json, to_json, write_texts
from mcnav.progress import SILENT, Phase, Progress
from mcnav.report import allocate as tables
from mcnav.report.gates import rejection_line
from mcnav.report.html import page_html
from mcnav.studies.lincov import answer_linearly
from mcnav.systems.ins.tables.imu_catalogue import INSTABILITY, NAMES

FILE: Final = "allocate.json"
PAGE: Final = "allocate.html"

TOGETHER: Final = {f"bias and instability, {instrument}": f"imu.{instrument}.bias" for instrument in NAMES} | {
    "all of imu.gyro": "imu.gyro.", "all of imu.accelerometer": "imu.accelerometer.", "all of imu": "imu.",
}  # fmt: skip
"""Beginnings of the keys of numbers that are also changed together: a bias and what it does in run grow together."""

EVERYTHING: Final = "all numbers"

MOST_GRADES: Final = 300
"""Linear answers computed in the search for the fewest changes by one grade."""

LISTED: Final = 5
"""Changes by one grade that are kept, of those that do equally."""

STEP: Final = 1e-3
"""Relative change with which the last digit of a proposed number is changed."""

CORRECTIONS: Final = 3
"""Times that this is done until its linear answer meets the goal."""


Move = tuple[DataSheetNumber, GradedValue]
"""A number and its value in another grade."""


class _Variations:
    """Linear answers of a campaign with some numbers changed; each is computed once."""

    def __init__(self, campaign: str | Path | Campaign | Mapping[str, Any], progress: Progress) -> None:
        self.content, self._file, self._stem = document_of(campaign)
        self.campaign = self.at({})
        self.base = answer_linearly(self.campaign)
        self.numbers = data_sheet_numbers(self.content, self.campaign.scenario.sources)
        self.beliefs = believed_numbers(self.content) if self.closed_loop else []
        self.computed = 1
        self._progress = progress
        self._known: dict[str, tuple[LinearRequirement, ...] | None] = {}
        self._tried: dict[str, tuple[LinearRequirement, ...] | None] = {}
        self._shared = SharedTables()
        self._scaled = _Scaled(self.base)

    def at(self, values: Mapping[str, Value]) -> Campaign:
        """Read the campaign with some keys set; `CampaignError` where it is refused."""
        return parse_campaign(override(self.content, values, self._file), self._file, self._stem)

    @property
    def closed_loop(self) -> bool:
        """Return whether a filter's gains depend on the numbers."""
        scenario = self.campaign.scenario
        return knows_covariance(scenario) and can_have_filter(scenario) and scenario.filter_schema is not None

    def judged(self, values: Mapping[str, Value]) -> tuple[LinearRequirement, ...] | None:
        """Judge the requirements by a linear answer with some keys set; none where the campaign is refused then."""
        key = json.dumps(values, sort_keys=True)
        if key not in self._known:
            self.computed += 1
            self._progress.advance(1)
            try:
                self._known[key] = answer_linearly(self.at(values)).requirements
            except CampaignError:
                self._known[key] = None
        return self._known[key]

    def tried(self, values: Mapping[str, Value]) -> tuple[LinearRequirement, ...] | None:
        """Judge the requirements with some keys set by the covariance of all causes at once, where there is one."""
        key = json.dumps(values, sort_keys=True)
        if key not in self._tried:
            try:
                campaign = self.at(values)
            except CampaignError:
                self._tried[key] = None
                return None
            scenario, errors = campaign.scenario, campaign.errors
            if not knows_covariance(scenario) or any(each.requirement.of for each in self.base.requirements):
                return self.judged(values)
            with one_thread():
                readings = scenario.covariance_readings(
                    scenario.reading_times, errors.mean, errors.covariance, self._shared
                )
            moments = Moments(readings.times, readings.mean, readings.covariance)
            required = [each.requirement for each in self.base.requirements]
            limits = limits_of(output.limit for output in self.base.outputs)
            self._tried[key] = judge_within_range(required, limits, readings.mean[-1], readings.covariance[-1], moments)
        return self._tried[key]

    def with_multiple(self, changed: Sequence[DataSheetNumber], factor: float) -> tuple[LinearRequirement, ...] | None:
        """Judge the requirements with some numbers multiplied."""
        if factor == 1.0:
            return self.base.requirements
        if self.closed_loop:
            return self.tried(values_of(changed, factor))
        return self._scaled.judged(changed, factor)


class _Scaled:
    """Requirements of a campaign without a filter whose errors are multiplied: all covariances add up."""

    def __init__(self, answer: LinearAnswer) -> None:
        self._answer = answer
        self._names = [source.name for source in answer.sources]
        self._requirements = [each.requirement for each in answer.requirements]
        self._limits = limits_of(output.limit for output in answer.outputs)
        self._over_time = any(each.epochs for each in self._requirements) or bool(np.isfinite(self._limits).any())

    def judged(self, changed: Sequence[DataSheetNumber], factor: float) -> tuple[LinearRequirement, ...]:
        model, history = self._answer.model, self._answer.history
        sizes = np.array([factor if any(each.covers(name) for each in changed) else 1.0 for name in self._names])
        mean, covariance = sizes * model.mean, model.covariance * np.outer(sizes, sizes)
        squares = {name: factor**2 if any(each.covers(name) for each in changed) else 1.0 for name in model.processes}
        processes = {name: squares[name] * each for name, each in model.processes.items()}
        scaled = replace(model, mean=mean, covariance=covariance, processes=processes)
        if history is not None and self._over_time:
            noise = {name: squares[name] * each for name, each in history.readings.processes.items()}
            readings = replace(history.readings, processes=noise)
            history = covariance_over_time(readings, tuple(self._names), mean, covariance)
        moments = None if history is None else history.moments
        return judge_within_range(
            self._requirements, self._limits, scaled.outcome_mean, scaled.outcome_covariance, moments,
            model.sizes, model.nominal, model.origin,
        )  # fmt: skip


def values_of(changed: Sequence[DataSheetNumber], factor: float) -> dict[str, Value]:
    """Return the keys to be set where some numbers are multiplied."""
    values: dict[str, Value] = {}
    for number in changed:
        values |= number.multiplied(factor)
    for number in changed:  # those that another one kept as they are
        values |= {path: value for path, value in number.multiplied(factor).items() if path == number.path}
    return values


def allocate(campaign: str | Path | Campaign | Mapping[str, Any], progress: Progress = SILENT) -> Allocation:
    """Find the numbers of a campaign's data sheet with which its requirements are just met, for normal errors.

    For each requirement that is not met, every number is changed alone and all together, and each size that a filter
    believes; where all are met, each number is loosened until one is not.

    Parameters
    ----------
    campaign : str, Path, Campaign or mapping
        Campaign file, campaign, or dictionary shaped like a campaign file.

    Raises
    ------
    CampaignError
        When the campaign has mistakes, no linear model, no requirements that linear analysis can judge, or no numbers.
    """
    progress.phase(Phase.PREPARING)
    variations = _Variations(campaign, progress)
    base, file = variations.base, variations.campaign.file
    judged = tuple(number for number, each in enumerate(base.requirements) if each.judged)
    if base.rejections is not None and base.rejections.verdict != OnLinear.HOLDS:
        line = rejection_line(base.rejections, [output.name for output in base.outputs])
        raise CampaignError([Problem(file, "filter.gate", f"{line}; leave the gates out to allocate without them")])
    if not judged:
        lacks = "has no requirement that linear analysis can judge" if base.requirements else "is missing"
        remedy = "add an [[accept.quantile]] or another requirement"
        if base.beyond is not None and any(each.requirement.kind != "sigma_ratio" for each in base.requirements):
            remedy = "errors are beyond its range, and smaller multiples of them are not looked at; see mcnav lincov"
        raise CampaignError([Problem(file, "accept", f"{lacks}; {remedy}")])
    if not variations.numbers:
        raise CampaignError([Problem(file, "errors", "has no size that could be changed")])
    progress.phase(Phase.SIMULATING, note="linear answers of changed numbers")
    unmet = [number for number in judged if not base.requirements[number].met]
    goals = [(number,) for number in unmet] + ([judged] if len(judged) > 1 and unmet else [])
    allocation = tuple(_goal(variations, goal) for goal in goals or [judged])
    grades = _search_grades(variations, judged, finer=bool(unmet))
    return Allocation(base, len(variations.numbers), allocation, grades, variations.computed)


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


def _goal(variations: _Variations, goal: tuple[int, ...]) -> Goal:
    met = worst_of(variations.base.requirements, goal).met
    numbers = variations.numbers
    alone = numbers if met else [*numbers, *variations.beliefs]
    changes = [_change(variations, goal, number.path, [number]) for number in alone]
    changes += [_change(variations, goal, name, members) for name, members in _groups(numbers).items()]

    def order(change: NumberChange) -> tuple[bool, float]:
        if not change.reached:
            return True, -change.result.margin
        return False, change.factor if met else abs(math.log(change.factor)) if change.factor > 0.0 else math.inf

    return Goal(goal, met, tuple(sorted(changes, key=order)))


def _change(
    variations: _Variations, goal: tuple[int, ...], label: str, changed: Sequence[DataSheetNumber]
) -> NumberChange:
    """Find the multiple of some numbers with which a goal is just met, and compute the linear answer with it."""

    def margin(factor: float) -> float:
        multiple = variations.with_multiple(changed, factor)
        return math.nan if multiple is None else worst_of(multiple, goal).margin

    met = worst_of(variations.base.requirements, goal).met
    if met:
        factor, closest = critical_multiple(margin), MOST
    else:
        factor, closest = nearest_multiple(margin, LEAST if math.isnan(margin(0.0)) else 0.0)
    alone = changed[0] if len(changed) == 1 else None
    now, paths = "" if alone is None else alone.text, tuple(number.path for number in changed)
    if math.isnan(factor) or math.isinf(factor):
        judged = variations.base.requirements if closest == 1.0 else variations.judged(values_of(changed, closest))
        result = worst_of(judged or variations.base.requirements, goal)
        return NumberChange(label, paths, now, "", factor, closest, result)
    grows = factor > 1.0 and not met
    rounded = _rounded(alone, factor, grows)
    for _ in range(CORRECTIONS):
        judged = variations.judged(values_of(changed, rounded))
        if judged is not None and worst_of(judged, goal).met:
            break
        rounded = _rounded(alone, rounded * (1.0 + STEP if grows else 1.0 - STEP), grows)
    result = worst_of(judged or variations.base.requirements, goal)
    needed = "" if alone is None else replace(alone, entry=alone.multiplied(rounded)[alone.path]).text
    return NumberChange(label, paths, now, needed, rounded, rounded, result)


def _rounded(alone: DataSheetNumber | None, factor: float, grows: bool) -> float:
    """Round a multiple to the side on which the goal is met: up where a number has to grow."""
    if alone is not None:
        return alone.rounded(factor, grows)
    return round_up(factor) if grows else round_down(factor)


def _search_grades(variations: _Variations, goal: tuple[int, ...], finer: bool) -> GradeSearch | None:
    """Search the fewest numbers of the unit to be moved by one grade of the catalogue; coarser ones one by one."""
    if "imu" not in variations.content:
        return None
    offered = [(number, next_grade(number, finer)) for number in variations.numbers]
    moves = [(number, graded) for number, graded in offered if graded is not None]
    if not moves:
        return GradeSearch(finer, (), None, True)

    def meets(chosen: Sequence[Move]) -> bool:
        result = variations.tried({number.path: graded.entry for number, graded in chosen})
        return result is not None and worst_of(result, goal).met

    def moved(chosen: Sequence[Move]) -> GradeChange | None:
        judged = variations.judged({number.path: graded.entry for number, graded in chosen})
        if judged is None:
            return None
        named = tuple(
            GradeMove(number.path, graded.grade, number.text, shown(graded.entry)) for number, graded in chosen
        )
        return GradeChange(named, worst_of(judged, goal))

    def best(grade_changes: Sequence[Sequence[Move]]) -> tuple[GradeChange, ...]:
        changes = [change for each in grade_changes if (change := moved(each)) is not None]
        return tuple(sorted(changes, key=lambda each: -each.worst.margin))

    whole = moved(moves)
    if not finer:
        return GradeSearch(finer, best(_with_instabilities(moves)), whole, True)
    if whole is None or not whole.met:
        return GradeSearch(finer, (), whole, True)
    tried = 0
    for size in range(1, len(moves)):
        if tried + comb(len(moves), size) > MOST_GRADES:
            return GradeSearch(finer, best([_irreducible(moves, meets)]), whole, False)
        tried += comb(len(moves), size)
        search = [each for each in combinations(moves, size) if meets(each)]
        if search:
            return GradeSearch(finer, best(search)[:LISTED], whole, True)
    return GradeSearch(finer, (whole,), whole, True)


def _with_instabilities(moves: Sequence[Move]) -> list[list[Move]]:
    """Take each move by itself, and a bias with its instability: a unit of a coarser grade has both."""
    by_path = {number.path: (number, graded) for number, graded in moves}
    instabilities = []
    for path, move in by_path.items():
        joined = by_path.get(path.replace(".bias", f".{INSTABILITY}")) if path.endswith(".bias") else None
        instabilities.append([move] if joined is None else [move, joined])
    return instabilities


def _irreducible(moves: Sequence[Move], meets: Callable[[Sequence[Move]], bool]) -> list[Move]:
    """Take moves back one by one while the requirements are met, and return what is left."""
    kept = list(moves)
    for each in moves:
        fewer = [other for other in kept if other is not each]
        if fewer and meets(fewer):
            kept = fewer
    return kept


def write_allocation(
    campaign: str | Path | Campaign | Mapping[str, Any], path: Path, progress: Progress = SILENT
) -> tuple[Allocation, list[Path]]:
    """Write the allocation of a campaign as ``allocate.json`` and a page; see `allocate`."""
    allocations = allocate(campaign, progress)
    progress.phase(Phase.REPORTING)
    files = {FILE: indented_json(to_json(tables.table(allocations))) + "\n", PAGE: page_html(tables.page(allocations))}
    return allocations, write_texts(path, files)
