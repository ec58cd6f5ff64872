"""Linear answers to a campaign with numbers of its data sheet changed, scaled by what a simulation measured."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TypeVar

import numpy as np

from mcnav.analysis.allocation import worst_of
from mcnav.analysis.linear_answer import LinearAnswer, LinearRequirement, judge_within_range
from mcnav.analysis.linear_covariance import Moments
from mcnav.analysis.linear_range import limits_of
from mcnav.analysis.resized_answers import judged, resize
from mcnav.config.data_sheet import DataSheetNumber, believed_numbers, data_sheet_numbers
from mcnav.config.documents import Document
from mcnav.config.overrides import Value, parse_document
from mcnav.config.read import Campaign
from mcnav.contract.linear import CovarianceReadings
from mcnav.contract.scenario import CovarianceQuestion, knows_covariance
from mcnav.errors import CampaignError
from mcnav.execution.progress import Progress
from mcnav.studies.linear_answers import answer_linearly
from mcnav.studies.lockstep import Unanswered, Values, in_lockstep
from mcnav.studies.shared_derivatives import SharedDerivatives, loop_of

Requirements = tuple[LinearRequirement, ...]
Result = TypeVar("Result")


class Variations:
    """Linear answers of a campaign with some numbers changed; each is computed once.

    Parameters
    ----------
    document : Document
        The campaign.
    scales : sequence of float
        By requirement, what linear errors are multiplied by (`mcnav.analysis.simulated_requirements`); empty: by one.
    """

    def __init__(self, document: Document, progress: Progress, scales: Sequence[float] = ()) -> None:
        self._document, self.content = document, document.content
        self.scales = tuple(scales)
        self._limits = [record.limits for record in self.read({}).requirements]
        self.campaign = self.at({})
        self._shared = SharedDerivatives(self.campaign, near=False)  # derivatives are those of the campaign as it is
        self.base = answer_linearly(self.campaign)
        self.numbers = data_sheet_numbers(self.content, self.campaign.scenario.sources)
        self.beliefs = believed_numbers(self.content) if self.closed_loop else []
        self._progress, self._searching = progress, False
        self._known: dict[str, Requirements | None] = {}
        self._counted: set[str] = set()
        self._scaled = _Scaled(self.base)

    def read(self, values: Mapping[str, Value]) -> Campaign:
        """Read the campaign with some keys set; `CampaignError` where it is refused."""
        return parse_document(self._document, values)

    def at(self, values: Mapping[str, Value]) -> Campaign:
        """Read the campaign with some keys set and limits over their scales; `CampaignError` where it is refused."""
        campaign = self.read(values)
        if not self.scales:
            return campaign
        scaled = tuple(
            record.model_copy(update={"limits": tuple(limit / scale for limit in record.limits)}) if scale > 0.0
            else record for record, scale in zip(campaign.requirements, self.scales, strict=True)
        )  # fmt: skip
        return replace(campaign, requirements=scaled)

    def rescaled(self, scales: Sequence[float]) -> Variations:
        """Return the same with other scales."""
        return Variations(self._document, self._progress, scales)

    def as_measured(self, result: LinearRequirement, place: int) -> LinearRequirement:
        """Return a requirement whose limit was divided by a scale with its own limit, and the value times the scale."""
        scale = self.scales[place] if self.scales else 1.0
        if not scale > 0.0 or scale == 1.0:
            return result
        limits = self._limits[place]
        value = result.value if result.requirement.kind == "box" else result.value * scale
        return replace(result, requirement=replace(result.requirement, limits=limits), value=value)

    def worst(self, requirements: Sequence[LinearRequirement], goal: Sequence[int]) -> LinearRequirement:
        """Return the requirement of a goal with the least margin, as it is measured."""
        least = worst_of(requirements, goal)
        return self.as_measured(least, next(number for number in goal if requirements[number] is least))

    @property
    def closed_loop(self) -> bool:
        """Return whether a filter's gains depend on the numbers; that of a user's class knows none of them."""
        scenario = self.campaign.scenario
        tuned = knows_covariance(scenario) or loop_of(scenario) is not None
        return tuned and scenario.filter_schema is not None

    def judged(self, values: Values) -> Requirements | None:
        """Judge the requirements with some keys set; none where the campaign is refused then."""
        result = self.tried(values)
        self._counted.add(_key(values))
        return result

    def tried(self, values: Values) -> Requirements | None:
        """Judge the requirements as `judged` does, in the course of a search.

        Raises `Unanswered` within `in_lockstep`, where the answer is not known.
        """
        key = _key(values)
        if key not in self._known:
            if self._searching:
                raise Unanswered(values)
            self._answer([values])
        return self._known[key]

    def in_lockstep(self, searches: Sequence[Callable[[], Result]]) -> list[Result]:
        """Run searches side by side, whose answers are computed together."""
        self._searching = True
        try:
            return in_lockstep(searches, self._answer)
        finally:
            self._searching = False

    @property
    def computed(self) -> int:
        """Answers that what is proposed rests on, that of the campaign as it is among them."""
        return 1 + len(self._counted)

    def _answer(self, asked: Sequence[Values]) -> None:
        """Answer for keys: by the covariance of all causes at once where there is one, else by cause."""
        base, questions = self.campaign.scenario, dict[str, CovarianceQuestion]()
        for values in {_key(values): values for values in asked}.values():
            key = _key(values)
            try:
                campaign = self.at(values)
                scenario, errors = campaign.scenario, campaign.errors
                if self._has_covariance and knows_covariance(scenario):
                    times = scenario.reading_times
                    questions[key] = CovarianceQuestion(scenario, times, errors.mean, errors.covariance)
                else:
                    answer = answer_linearly(self._shared.along(campaign), by_cause=loop_of(scenario) is None)
                    self._known[key] = answer.requirements
            except CampaignError:
                self._known[key] = None
        self._progress.advance(len(asked))
        if questions and knows_covariance(base):
            for key, readings in zip(questions, base.covariance_readings(list(questions.values())), strict=True):
                self._known[key] = self._judge(readings)

    @cached_property
    def _has_covariance(self) -> bool:
        """Whether requirements are judged by covariances alone: none is of a smoother, and nothing has a gate."""
        smoothed = any(requirement.requirement.of for requirement in self.base.requirements)
        return knows_covariance(self.campaign.scenario) and self.base.rejections is None and not smoothed

    def _judge(self, readings: CovarianceReadings) -> Requirements:
        moments = Moments(readings.times, readings.mean, readings.covariance)
        required = [requirement.requirement for requirement in self.base.requirements]
        limits = limits_of(output.limit for output in self.base.outputs)
        return judge_within_range(required, limits, readings.mean[-1], readings.covariance[-1], moments)

    def with_multiple(self, changed: Sequence[DataSheetNumber], factor: float) -> Requirements | None:
        """Judge the requirements with some numbers multiplied."""
        if factor == 1.0:
            return self.base.requirements
        if self.closed_loop:
            return self.tried(values_of(changed, factor))
        return self._scaled.judged(changed, factor)


def _key(values: Values) -> str:
    return json.dumps(values, sort_keys=True)


class _Scaled:
    """Requirements of a campaign without a filter whose errors are multiplied: all covariances add up."""

    def __init__(self, answer: LinearAnswer) -> None:
        self._answer = answer
        self._names = [source.name for source in answer.sources]
        limits = limits_of(output.limit for output in answer.outputs)
        self._over_time = any(row.requirement.epochs for row in answer.requirements) or bool(np.isfinite(limits).any())

    def judged(self, changed: Sequence[DataSheetNumber], factor: float) -> Requirements:
        model = self._answer.model
        sizes = np.array([factor if any(each.covers(name) for each in changed) else 1.0 for name in self._names])
        squares = {name: factor**2 for name in model.processes if any(each.covers(name) for each in changed)}
        mean, covariance = sizes * model.mean, model.covariance * np.outer(sizes, sizes)
        return judged(resize(self._answer, mean, covariance, squares, self._over_time))


def values_of(changed: Sequence[DataSheetNumber], factor: float) -> dict[str, Value]:
    """Return the keys to be set where some numbers are multiplied."""
    values: dict[str, Value] = {}
    for number in changed:
        values |= number.multiplied(factor)
    for number in changed:  # those that another one kept as they are
        values |= {path: value for path, value in number.multiplied(factor).items() if path == number.path}
    return values
