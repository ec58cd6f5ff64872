"""Allocation of errors: numbers of a campaign's data sheet with which its requirements are just met.

Without a filter the final covariance is a sum of the squares of the numbers, so that multiples follow from the budget.
With one, the gains change with what the filter believes, and each multiple takes a covariance of the closed loop of its
own, from all causes at once; all numbers are searched side by side, so that these covariances are computed together.
Either way every number proposed is put into the campaign and its covariance computed.

Linear answers may be wrong. With a simulation of the campaign as it is they are scaled by what it measured
(`mcnav.analysis.simulated_requirements`), and `mcnav.studies.confirmed_changes` simulates changes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from itertools import combinations, compress
from math import comb
from pathlib import Path
from time import perf_counter
from typing import Final

from mcnav.analysis.allocation import Allocation, GradeChange, GradeMove, GradeSearch, worst_of
from mcnav.analysis.rejections import OnLinear
from mcnav.analysis.simulated_requirements import Basis
from mcnav.config.data_sheet import DataSheetNumber, GradedValue, next_grade, shown
from mcnav.config.documents import Description
from mcnav.errors import CampaignError, Problem
from mcnav.execution.progress import SILENT, Phase, Progress, note
from mcnav.files.whole import indented_json, to_json, write_texts
from mcnav.report.columns.gates import rejection_line
from mcnav.report.document.html import page_html
from mcnav.report.pages import allocate as tables
from mcnav.runner.executors import JOBS
from mcnav.statistics.demonstration import runs_to_show
from mcnav.studies.allocated_numbers import find_goals
from mcnav.studies.allocation_examination import examine_allocation
from mcnav.studies.boxed_run import at_worst
from mcnav.studies.confirmed_changes import ConfirmationPlan, confirm_goal, confirm_grades
from mcnav.studies.examined_settings import Examiner
from mcnav.studies.simulated_campaigns import samples_of
from mcnav.studies.variations import Variations
from mcnav.systems.ins.tables.imu_catalogue import INSTABILITY

FILE: Final = "allocate.json"
PAGE: Final = "allocate.html"

CONFIRMED: Final = 3
"""Changes that are simulated unless a number is asked for."""

MOST_GRADES: Final = 300
"""Linear answers computed in the search for the fewest changes by one grade."""

LISTED: Final = 5
"""Changes by one grade that are kept, of those that do equally."""

Move = tuple[DataSheetNumber, GradedValue]
"""A number and its value in another grade."""


def allocate(
    campaign: Description, progress: Progress = SILENT, confirm: int = CONFIRMED,
    basis: Basis | None = None, jobs: int = JOBS, samples: int | None = None, examine: bool | None = None,
) -> Allocation:  # fmt: skip
    """Find the numbers of a campaign's data sheet with which its requirements are just met.

    Advice is scaled by a simulation of the campaign as it is, and the smallest changes are simulated.

    For each requirement that is not met, every number is changed alone and all together, and each size that a filter
    believes; where all are met, each number is loosened until one is not.

    Parameters
    ----------
    campaign : str, Path, Campaign or mapping
        Campaign file, campaign, or dictionary shaped like a campaign file.
    confirm : int
        Changes to the last goal, the smallest first, that are simulated, and left out unless simulation confirms them.
        With none, and no basis, the answer is that of linear analysis alone, for normal errors.
    basis : Basis, optional
        Simulation of the campaign as it is that linear answers are scaled by; by default one is made where changes
        are to be confirmed.
    jobs : int
        Workers of a simulation.
    samples : int, optional
        Samples of a simulation, by default those of the campaign, at most
        `mcnav.studies.simulated_campaigns.MOST_SAMPLES`.
    examine : bool, optional
        Whether flights examine all changes that no samples confirm; by default, of linear analysis alone, the campaign
        as it is and the change that the answer states first, where that takes less than the answers.

    Raises
    ------
    CampaignError
        When the campaign has mistakes, no linear model, no requirements that linear analysis can judge, or no numbers;
        or when the simulation bounds no requirement.
    """
    began = perf_counter()
    progress.phase(Phase.PREPARING)
    document, remarks = at_worst(campaign)
    for remark in remarks:
        note(remark)
    variations = Variations(document, progress)
    answer = replace(variations.base, remarks=remarks)
    judged = _judged(variations)
    plan = ConfirmationPlan(confirm, samples or samples_of(variations.campaign), jobs, progress)
    if confirm and basis is None:
        basis = Basis.of(plan.simulate(variations.campaign))
    if basis is not None:
        _check_basis(basis, judged, variations.campaign.file)
        variations = variations.rescaled(basis.scales)
    base = variations.base
    progress.phase(Phase.SIMULATING, note="linear answers of changed numbers")
    unmet = [number for number in judged if not base.requirements[number].met]
    goals = [(number,) for number in unmet] + ([judged] if len(judged) > 1 and unmet else [])
    allocation = find_goals(variations, goals or [judged])
    grades = _search_grades(variations, judged, finer=bool(unmet))
    if confirm:
        allocation[-1] = confirm_goal(variations, allocation[-1], plan)
        grades = None if grades is None else confirm_grades(variations, grades, judged, plan)
    found = Allocation(answer, len(variations.numbers), tuple(allocation), grades, variations.computed, basis)
    asked = False if basis is not None and examine is None else examine
    return examine_allocation(variations, found, Examiner(asked, perf_counter() - began), every=bool(examine))


def _judged(variations: Variations) -> tuple[int, ...]:
    """Return the requirements that linear analysis can judge; `CampaignError` where there is nothing to allocate."""
    base, file = variations.base, variations.campaign.file
    judged = tuple(number for number, requirement in enumerate(base.requirements) if requirement.judged)
    if base.rejections is not None and base.rejections.verdict != OnLinear.HOLDS:
        line = rejection_line(base.rejections, [output.name for output in base.outputs])
        raise CampaignError([Problem(file, "filter.gate", f"{line}; leave the gates out to allocate without them")])
    if not judged:
        lacks = "has no requirement that linear analysis can judge" if base.requirements else "is missing"
        remedy = "add an [[accept.quantile]] or another requirement"
        if base.beyond is not None and any(
            requirement.requirement.kind != "sigma_ratio" for requirement in base.requirements
        ):
            remedy = "errors are beyond its range, and smaller multiples of them are not looked at; see mcnav lincov"
        raise CampaignError([Problem(file, "accept", f"{lacks}; {remedy}")])
    if not variations.numbers:
        raise CampaignError([Problem(file, "errors", "has no size that could be changed")])
    return judged


def _check_basis(basis: Basis, judged: Sequence[int], file: str) -> None:
    """Refuse a simulation that bounds none of the requirements, with the samples that would."""
    unbounded = [number for number in judged if math.isnan(basis.scales[number])]
    if not unbounded:
        return
    needed = [_samples_to_bound(basis, number) for number in unbounded]
    remedy = f"; run at least {max(needed):,}" if all(needed) else ""
    message = f"{basis.samples:,} samples do not bound requirement {unbounded[0] + 1}, so no change can be confirmed"
    raise CampaignError([Problem(file, "samples", f"{message}{remedy}")])


def _samples_to_bound(basis: Basis, number: int) -> int:
    """Return the fewest samples with which a requirement has a bound; none beyond a billion."""
    probability = basis.entries[number].probability
    return runs_to_show(0.5 if probability is None else probability, basis.confidence) or 0


def _search_grades(variations: Variations, goal: tuple[int, ...], finer: bool) -> GradeSearch | None:
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
        return GradeChange(named, variations.worst(judged, goal))

    def best(changes: Sequence[Sequence[Move]]) -> tuple[GradeChange, ...]:
        known = [change for change in variations.in_lockstep([partial(moved, each) for each in changes]) if change]
        return tuple(sorted(known, key=lambda each: -each.worst.margin))

    if not finer:
        alone = _with_instabilities(moves)
        variations.in_lockstep([partial(moved, each) for each in (moves, *alone)])  # answered in one pass
        return GradeSearch(finer, best(alone), moved(moves), True)
    whole = moved(moves)
    if whole is None or not whole.met:
        return GradeSearch(finer, (), whole, True)
    tried = 0
    for size in range(1, len(moves)):
        if tried + comb(len(moves), size) > MOST_GRADES:
            return GradeSearch(finer, best([_irreducible(moves, meets)]), whole, False)
        tried += comb(len(moves), size)
        together = list(combinations(moves, size))
        enough = variations.in_lockstep([partial(meets, each) for each in together])
        if any(enough):
            return GradeSearch(finer, best(list(compress(together, enough)))[:LISTED], whole, True)
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
    for move in moves:
        fewer = [other for other in kept if other is not move]
        if fewer and meets(fewer):
            kept = fewer
    return kept


def write_allocation(
    campaign: Description, path: Path, progress: Progress = SILENT, confirm: int = CONFIRMED,
    jobs: int = JOBS, examine: bool | None = None,
) -> tuple[Allocation, list[Path]]:  # fmt: skip
    """Write the allocation of a campaign as ``allocate.json`` and a page; see `allocate`."""
    allocations = allocate(campaign, progress, confirm, jobs=jobs, examine=examine)
    progress.phase(Phase.REPORTING)
    files = {FILE: indented_json(to_json(tables.table(allocations))) + "\n", PAGE: page_html(tables.page(allocations))}
    return allocations, write_texts(path, files)
