"""Sweep: measures of accuracy over values of one or two keys of a campaign, and where requirements are just met.

The answers are linear. Monte Carlo confirms them at chosen points.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from time import perf_counter
from typing import Final

import numpy as np

from mcnav.analysis.accuracy_measures import (
    Measure,
    MeasureError,
    read_measure,
    requirement_measures,
    usual_measures,
)
from mcnav.analysis.crossings import find_crossings, words_that_meet
from mcnav.analysis.sweep import JustMet, Point, Sweep, Variable
from mcnav.arrays.types import Array
from mcnav.config.documents import Description
from mcnav.config.overrides import VariedCampaign
from mcnav.config.read import Campaign
from mcnav.config.sweep_values import POINTS, read_variables
from mcnav.contract.quantities import Output
from mcnav.contract.scenario import runs_user_code
from mcnav.errors import CampaignError, Problem
from mcnav.execution.progress import SILENT, Phase, Progress
from mcnav.execution.threads import one_thread
from mcnav.files.whole import indented_json, write_texts
from mcnav.report.document.html import page_html
from mcnav.report.pages import sweep as report
from mcnav.report.pages.sweep_page import page
from mcnav.studies.boxed_run import at_worst
from mcnav.studies.confirmation import check_count, choose_points, confirm
from mcnav.studies.examined_settings import Examiner
from mcnav.studies.linear_answers import answer_linearly
from mcnav.studies.sweep_examination import examine_sweep
from mcnav.studies.sweep_points import LinearPoints, campaign_requirements, in_threads
from mcnav.workflow.rejections import doubt_about_gates, rejections_of

JOBS: Final = 2

NEAR: Final = 0.01
"""Share to which the least value is found at which something is to be noticed."""

ROWS: Final = 5
"""Values of the first of two variables at which the second one is solved for."""

CSV, JSON, PAGE = "sweep.csv", "sweep.json", "sweep.html"


@dataclass(frozen=True)
class SweepPlan:
    """Variables that are varied, and measures that are looked at.

    Attributes
    ----------
    varied : mapping of str to (str or sequence)
        Values by path; see `mcnav.config.sweep_values.read_variables`.
    against : sequence of str
        Measures; by default those of the requirements, or the usual ones of the scenario.
    points : int
        Values of each range.
    at : sequence of float
        Times in the trajectory's time at which ``against`` is looked at, s; by default the end.
    jobs : int
        Threads.
    examine : bool or None
        Whether flights examine linear analysis at some points; with none where that takes less than the answers.
    """

    varied: Mapping[str, str | Sequence[object]]
    against: Sequence[str] = ()
    points: int = POINTS
    at: Sequence[float] = ()
    jobs: int = JOBS
    examine: bool | None = None


def run_sweep(campaign: Description, plan: SweepPlan) -> Sweep:
    """Compute the linear answers of a sweep, and the values at which its limits are just met.

    Raises
    ------
    CampaignError
        When the campaign cannot be read, or has no linear model, at one of the points; the first mistake alone.
    """
    with one_thread():
        return _Study(campaign, plan, SILENT).sweep()


def write_sweep(
    campaign: Description, plan: SweepPlan, path: Path, confirmed: int | None = None,
    progress: Progress = SILENT,
) -> tuple[Sweep, list[Path]]:  # fmt: skip
    """Write a sweep as ``sweep.csv``, ``sweep.json`` and, last, a page.

    Parameters
    ----------
    confirmed : int, optional
        Points at which Monte Carlo runs, in folders of their own below the path.
    """
    with one_thread():
        study = _Study(campaign, plan, progress)
        if confirmed is not None:
            check_count(confirmed, study.shape)
        sweep = study.sweep()
    if confirmed is not None:
        sweep = study.confirmed(sweep, confirmed, path)
    progress.phase(Phase.REPORTING)
    texts = {
        CSV: report.frame(sweep).to_csv(index=False, float_format="%.10g"),
        JSON: indented_json(report.table(sweep)) + "\n",
        PAGE: page_html(page(sweep)),
    }
    return sweep, write_texts(path, texts)


class _Study:
    """A sweep in the making: its variables, measures and linear answers."""

    def __init__(self, campaign: object, plan: SweepPlan, progress: Progress) -> None:
        self._plan, self._progress = plan, progress
        progress.phase(Phase.PREPARING)
        self.variables = read_variables(plan.varied, plan.points)
        document, remarks = at_worst(campaign, list(plan.varied))  # type: ignore[arg-type]
        self._settled = [f"{remark[:1].upper()}{remark[1:]}." for remark in remarks]
        self._varied = VariedCampaign(document)
        described = self._varied.campaign
        self.outputs = described.scenario.outputs
        self.measures, self.times = _measures(described, plan)
        self.points = LinearPoints(self._varied, self.variables, self.measures, self.times)
        self._jobs = 1 if runs_user_code(described.scenario) else plan.jobs  # a user's code may need it

    @property
    def shape(self) -> tuple[int, ...]:
        return tuple(len(variable.values) for variable in self.variables)

    def sweep(self) -> Sweep:
        """Compute the answers of the grid, then those at which limits are just met, and examine some."""
        began = perf_counter()
        self._check_corners()
        self._progress.phase(Phase.PREPARING, note=f"{int(np.prod(self.shape)):,} linear answers")
        answers = self.points.answers(self.points.grid(), self._jobs)
        shape = (*self.shape, len(self.measures))
        arrays = {
            name: np.array([getattr(answer, name) for answer in answers]).reshape(shape)
            for name in ("values", "own", "bounds", "margins", "exceedances", "means")
        }
        if gates := self._gates():
            arrays["margins"][:] = np.nan
        just_met = self._just_met(arrays["margins"])
        sweep = Sweep(
            self._varied.campaign.name, self.outputs, self.variables, self.measures, self.times,
            arrays["values"], arrays["own"], arrays["bounds"], arrays["margins"], self.points.present.values, just_met,
            added=tuple(self.points.beside(self.points.grid())), exceedances=arrays["exceedances"],
            means=arrays["means"],
            gates=gates,
            remarks=(*self._settled, *self._remarks()),
        )  # fmt: skip
        examiner = Examiner(self._plan.examine, perf_counter() - began)
        return examine_sweep(sweep, self.points.campaign_at, examiner)

    def _gates(self) -> str:
        """Say of the campaign, or of the first corner, what rejections of good measurements do to linear analysis."""
        for campaign in (self._varied.campaign, *self._corners()):
            epochs = sorted({epoch for record in campaign.requirements for epoch in record.epochs or ()})
            _, rejections = rejections_of(campaign.scenario, campaign.errors, campaign.tolerance, epochs)
            if doubt := doubt_about_gates(rejections, campaign.scenario):
                return doubt
        return ""

    def _remarks(self) -> tuple[str, ...]:
        """Return what linear analysis remarks on delays, at the least values of a sweep of them at which it does."""
        if not any(word in variable.path for variable in self.variables for word in ("delay", "jitter")):
            return ()
        *first, last = (variable.values.tolist() for variable in self.variables)
        corner = tuple(values[-1] for values in first)
        place = next((number for number, value in enumerate(last) if self._remarks_at((*corner, value))), None)
        if place is None:
            return ()
        least = last[place]
        if place and not self.variables[-1].words:
            below = last[place - 1]
            while least - below > NEAR * least:
                middle = 0.5 * (below + least)
                below, least = (below, middle) if self._remarks_at((*corner, middle)) else (middle, least)
        point = (*corner, least)
        at = " and ".join(
            f"{variable.path} = {variable.words[int(value)] if variable.words else f'{value:.3g} {variable.unit}'}"
            for variable, value in zip(self.variables, point, strict=True)
        )
        return tuple(f"From {at} on, {remark}." for remark in self._remarks_at(point))

    def _remarks_at(self, point: Point) -> tuple[str, ...]:
        campaign = self.points.campaign_at(point)
        return campaign.scenario.remarks_on(campaign.errors.mean, campaign.errors.covariance)

    def _corners(self) -> Iterator[Campaign]:
        """Read the campaigns of the corners."""
        for point in product(*((float(variable.values[0]), float(variable.values[-1])) for variable in self.variables)):
            yield self.points.campaign_at(point)

    def _check_corners(self) -> None:
        """Read the campaigns of the corners, and check the linear model of a user's own scenario there."""
        for campaign in self._corners():
            if runs_user_code(campaign.scenario):
                answer_linearly(campaign)

    def _just_met(self, margins: Array) -> tuple[JustMet, ...]:
        """Solve for the values at which each limit is just met: of the second variable at some values of the first.

        Of limits that are asked for, else of those of the requirements.
        """
        *first, last = self.variables
        rows: list[tuple[float | None, Array]] = [(None, margins)]
        if first:
            rows_of = len(first[0].words) or ROWS
            chosen = np.unique(np.linspace(0, len(first[0].values) - 1, rows_of).round().astype(int))
            rows = [(float(first[0].values[number]), margins[number]) for number in chosen]

        limited = [number for number in range(len(self.measures)) if not np.isnan(margins[..., number]).all()]
        asked = [number for number in limited if self.measures[number].requirement is None]

        def solve(task: tuple[int, tuple[float | None, Array]]) -> JustMet:
            number, (fixed, row) = task

            def margin_at(value: float) -> float:
                point = (value,) if fixed is None else (fixed, value)
                return float(self.points.answers([point], 1)[0].margins[number])

            if last.words:
                return words_that_meet(row[:, number], number, fixed)
            return find_crossings(last, row[:, number], margin_at, number, fixed)

        return tuple(in_threads(solve, list(product(asked or limited, rows)), self._jobs))

    def confirmed(self, sweep: Sweep, count: int, path: Path) -> Sweep:
        """Run Monte Carlo at so many points of the grid."""
        chosen = choose_points(
            self.shape, [_place(sweep, allocation) for allocation in sweep.just_met if allocation.values], count
        )
        points = [(place, _point(self.variables, place)) for place in chosen]
        final = [
            measure.requirement is not None or time is None
            for measure, time in zip(self.measures, self.times, strict=True)
        ]
        confirmed = confirm(self.points, self.measures, final, points, path, self._plan.jobs, self._progress)
        return replace(sweep, confirmations=tuple(confirmed))


def _measures(campaign: Campaign, plan: SweepPlan) -> tuple[tuple[Measure, ...], tuple[float | None, ...]]:
    """Return the measures of a sweep and their times: those asked for, then those of the requirements."""
    outputs: tuple[Output, ...] = campaign.scenario.outputs
    required = requirement_measures(campaign_requirements(campaign), outputs)
    try:
        asked = [read_measure(each, outputs) for each in plan.against]
    except MeasureError as wrong:
        raise CampaignError([Problem("--against", "", str(wrong))]) from None
    if not asked and (plan.at or not required):
        asked = usual_measures(outputs)
    times: list[float | None] = [*sorted(set(plan.at))] or [None]
    measures = [
        (measure if time is None else replace(measure, name=f"{measure.name} at {time:g} s"), time)
        for measure in asked
        for time in times
    ]
    measures += [(measure, None) for measure in required]
    names = [measure.name for measure, _ in measures]
    for name in names:
        if names.count(name) > 1:
            raise CampaignError([Problem("--against", "", f"got {name!r} twice; keep one")])
    return tuple(measure for measure, _ in measures), tuple(time for _, time in measures)


def _place(sweep: Sweep, just_met: JustMet) -> tuple[float, ...]:
    """Return the place in the grid at which a limit is just met first, counted in points."""
    *first, last = sweep.variables
    values = [variable.along(float(value)) for variable in (last,) for value in variable.values]
    place = float(np.interp(last.along(just_met.values[0]), values, np.arange(len(values))))
    if not first or just_met.fixed is None:
        return (place,)
    return float(np.searchsorted(first[0].values, just_met.fixed)), place


def _point(variables: Sequence[Variable], place: Sequence[int]) -> Point:
    return tuple(float(variable.values[number]) for variable, number in zip(variables, place, strict=True))
