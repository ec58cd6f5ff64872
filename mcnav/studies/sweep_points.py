"""Linear answers at many points: a campaign with some keys set to other values, once for each."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Final, TypeVar

import numpy as np

from mcnav.analysis.accuracy_measures import Measure, requirement_measures
from mcnav.analysis.linear_range import limits_of, outputs_beyond
from mcnav.analysis.model import Model
from mcnav.analysis.requirements import Requirement, requirements_from
from mcnav.analysis.sweep import Point, Variable
from mcnav.arrays.types import Array, IndexArray
from mcnav.config.overrides import Value, VariedCampaign
from mcnav.config.read import Campaign
from mcnav.contract.linear import CovarianceReadings, LinearModel, SharedTables
from mcnav.contract.scenario import (
    CovarianceQuestion,
    ScenarioError,
    knows_covariance,
    runs_user_code,
)
from mcnav.errors import CampaignError, Problem
from mcnav.execution.child_processes import side_threads
from mcnav.linear.refusals import scenario_errors

Item = TypeVar("Item")
Result = TypeVar("Result")

BATCH: Final = 500
"""Campaigns that are read before their answers are computed."""

PIECES: Final = 4
"""Parts of a batch that each thread computes, one after another."""


@dataclass(frozen=True)
class PointAnswer:
    """Linear answer at a point.

    Attributes
    ----------
    values, own : ndarray, shape (measures,)
        Of the true errors, and as the filter states them (NaN without one); SI. Values of errors beyond the range of
        linear analysis are infinite: they exceed any limit.
    bounds : ndarray, shape (measures,)
        At which a measure just meets its limit; NaN without a limit.
    margins : ndarray, shape (measures,)
        Logarithm of the value over its bound, of a box the other way round: above zero where the limit is exceeded.
    exceedances : ndarray, shape (measures,)
        See `mcnav.analysis.accuracy_measures.Measure.beyond`.
    means : ndarray, shape (measures,)
        Mean errors in the values; see `mcnav.analysis.accuracy_measures.Measure.mean_error`.
    """

    values: Array
    own: Array
    bounds: Array
    margins: Array
    exceedances: Array
    means: Array


class LinearPoints:
    """Linear answers of a campaign at points of some variables; those that were computed are kept.

    Parameters
    ----------
    varied : VariedCampaign
    variables : sequence of Variable
    measures : sequence of Measure
        Of final errors, of errors ``at`` a time, or of requirements, which are those of each point's own campaign.
    at : sequence of (float or None)
        Time of each measure, in the trajectory's time, s; none for the end or the epochs of a requirement.
    """

    def __init__(
        self,
        varied: VariedCampaign,
        variables: Sequence[Variable],
        measures: Sequence[Measure],
        at: Sequence[float | None],
    ) -> None:
        self._varied, self._variables, self._measures, self._at = varied, variables, measures, at
        self._shared = SharedTables()
        self._known: dict[Point, PointAnswer] = {}
        (self.present,) = self._answers([varied.campaign], self._shared)

    def values_at(self, point: Point) -> dict[str, Value]:
        """Return the values of a point by path, as a campaign file has them."""
        return {variable.path: variable.written(value) for variable, value in zip(self._variables, point, strict=True)}

    def campaign_at(self, point: Point) -> Campaign:
        """Read the campaign of a point; `CampaignError` with its first mistake."""
        try:
            return self._varied.at(self.values_at(point))
        except CampaignError as wrong:
            raise CampaignError(wrong.problems[:1]) from None

    def grid(self) -> list[Point]:
        """Return the points of the grid; the last variable changes first."""
        return list(product(*(variable.values.tolist() for variable in self._variables)))

    def beside(self, grid: Sequence[Point]) -> list[tuple[Point, Array]]:
        """Return the points whose answers were computed besides those of a grid, in order, with their values."""
        others = sorted(self._known.keys() - set(grid))
        return [(point, self._known[point].values) for point in others]

    def answers(self, points: Sequence[Point], jobs: int) -> list[PointAnswer]:
        """Compute the answers at some points by so many threads."""
        unknown = [point for point in points if point not in self._known]
        for begin in range(0, len(unknown), BATCH):
            batch = unknown[begin : begin + BATCH]
            campaigns = [self.campaign_at(point) for point in batch]
            size = max(1, -(-len(batch) // (PIECES * jobs)))
            pieces = [campaigns[first : first + size] for first in range(0, len(batch), size)]
            answers = [answer for piece in in_threads(self._piece, pieces, jobs) for answer in piece]
            self._known.update(zip(batch, answers, strict=True))
        return [self._known[point] for point in points]

    def _piece(self, campaigns: Sequence[Campaign]) -> list[PointAnswer]:
        """Compute the answers of some campaigns; each shares what it can with the one before."""
        return self._answers(campaigns, SharedTables(self._shared.tables))

    def _answers(self, campaigns: Sequence[Campaign], shared: SharedTables) -> list[PointAnswer]:
        at, base = [time for time in self._at if time is not None], self._varied.campaign.scenario
        asked, readings = dict[int, _Asked](), dict[int, tuple[int, CovarianceReadings]]()
        for number, campaign in enumerate(campaigns):
            _check_variances(campaign)
            with scenario_errors(campaign.file):
                if knows_covariance(campaign.scenario) and type(campaign.scenario) is type(base):
                    asked[number] = _Asked.of(campaign, at)
                else:
                    readings[number] = _readings(campaign, at, shared)
        if asked and knows_covariance(base):
            with scenario_errors(campaigns[0].file):
                answers = base.covariance_readings([each.question for each in asked.values()])
            for number, answer in zip(asked, answers, strict=True):
                readings[number] = asked[number].read(answer)
        return [self._judge(campaign, *readings[number]) for number, campaign in enumerate(campaigns)]

    def _judge(self, campaign: Campaign, end: int, answer: CovarianceReadings) -> PointAnswer:
        """Judge a campaign by what was read out, of which one reading is the end."""
        own = campaign_requirements(campaign)
        required = {
            requirement_measure.requirement: requirement_measure
            for requirement_measure in requirement_measures(own, campaign.scenario.outputs)
        }
        since = _beyond_since(campaign, answer)
        values, stated, bounds, margins, exceedances, means = np.full((6, len(self._measures)), np.nan)
        for number, (measure, time) in enumerate(zip(self._measures, self._at, strict=True)):
            held = measure if measure.requirement is None else required[measure.requirement]
            held = held.at_reading(end if time is None else int(np.argmin(np.abs(answer.times - time))))
            bounds[number] = np.nan if held.bound is None else held.bound
            if (answer.times[list(held.readings)] >= since).any():
                values[number], margins[number] = np.inf, np.nan if held.bound is None else np.inf
                continue
            values[number], stated[number] = held.value(answer), held.own_value(answer)
            means[number] = held.mean_error(answer)
            exceedances[number] = held.beyond(answer)
            if held.bound is not None:
                margins[number] = _margin(held, float(values[number]))
        return PointAnswer(values, stated, bounds, margins, exceedances, means)


def _beyond_since(campaign: Campaign, answer: CovarianceReadings) -> float:
    """Return the time from which errors are beyond the range of linear analysis; infinite where all are within."""
    sigma = np.sqrt(np.maximum(np.diagonal(answer.covariance, axis1=1, axis2=2), 0.0))
    limits = limits_of(output.limit for output in campaign.scenario.outputs)
    beyond = outputs_beyond(limits, answer.mean, sigma).any(axis=1)
    return float(answer.times[beyond].min(initial=np.inf))


def in_threads(compute: Callable[[Item], Result], items: Sequence[Item], jobs: int) -> list[Result]:
    """Compute results by so many threads, in the order of the items."""
    if jobs == 1 or len(items) < 2:
        return [compute(item) for item in items]
    with side_threads(jobs) as threads:
        return list(threads.map(compute, items))


def campaign_requirements(campaign: Campaign) -> tuple[Requirement, ...]:
    """Return the requirements of a campaign; `CampaignError` for one of a smoother, which points do not have."""
    if any(record.of for record in campaign.requirements):
        message = "a sweep has no requirements of a smoother; mcnav lincov judges them"
        raise CampaignError([Problem(campaign.file, "accept", message)])
    return requirements_from(campaign.requirements, [output.name for output in campaign.scenario.outputs])


def _margin(measure: Measure, value: float) -> float:
    """Return the logarithm of a value over its bound, of a box the other way round.

    A size exactly at its limit is not below it: its margin is the smallest positive number.
    """
    bound = measure.bound or 1.0
    if value == bound and not measure.falls:
        return math.nextafter(0.0, 1.0)
    if math.isnan(value):
        return math.nan
    ratio = (bound / value if value > 0.0 else math.inf) if measure.falls else value / bound
    return math.log(ratio) if ratio > 0.0 else -math.inf


@dataclass(frozen=True)
class _Asked:
    """What a campaign asks of its scenario: its epochs, the last of which is the end, and then further times.

    Attributes
    ----------
    order : ndarray of int
        Numbers of these among the times of the question.
    """

    question: CovarianceQuestion
    order: IndexArray
    end: int

    @classmethod
    def of(cls, campaign: Campaign, at: Sequence[float]) -> _Asked:
        """Ask at the scenario's epochs and at further times; `CampaignError` outside of the navigation."""
        scenario, errors, epochs = campaign.scenario, campaign.errors, campaign.scenario.reading_times
        for time in at:
            if not epochs[0] - 1e-9 <= time <= epochs[-1] + 1e-9:
                span = f"navigation is from {epochs[0]:g} s to {epochs[-1]:g} s"
                raise CampaignError([Problem(campaign.file, "--at", f"got {time:g} s; {span}")])
        apart = np.unique([time for time in at if np.abs(epochs - time).min() > 1e-9])
        times = np.union1d(epochs, apart)
        order = np.concatenate([np.searchsorted(times, epochs), np.searchsorted(times, apart)])
        return cls(CovarianceQuestion(scenario, times, errors.mean, errors.covariance), order, len(epochs) - 1)

    def read(self, answer: CovarianceReadings) -> tuple[int, CovarianceReadings]:
        """Return the number of the end, and the readings in order."""
        order, own = self.order, None if answer.own is None else answer.own[self.order]
        return self.end, CovarianceReadings(answer.times[order], answer.mean[order], answer.covariance[order], own)


def _check_variances(campaign: Campaign) -> None:
    """Refuse errors without a finite variance."""
    errors = campaign.errors
    if not np.isfinite(errors.standard_deviations).all():
        name = errors.names[int(np.argmin(np.isfinite(errors.standard_deviations)))]
        message = "has no finite variance, and a linear covariance needs that of every source"
        raise CampaignError([Problem(campaign.file, f"errors.{name}", message)])


def _readings(campaign: Campaign, at: Sequence[float], shared: SharedTables) -> tuple[int, CovarianceReadings]:
    """Read the linear system out at the scenario's epochs, and then at further times; of others at the end.

    Return the number of the end among the readings as well.
    """
    scenario, errors = campaign.scenario, campaign.errors
    if knows_covariance(scenario):
        asked = _Asked.of(campaign, at)
        return asked.read(scenario.covariance_readings([asked.question])[0])
    if at:
        end, readings = _readings(campaign, (), shared)
        return end, _with_times(campaign, readings, np.unique(at))
    if len(scenario.reading_times):
        system = scenario.linear_over_time()
        nominal = 0.0 if system.nominal is None else system.nominal
        mean = nominal + system.partials @ errors.mean
        prediction = scenario.filter_prediction()
        own = None if prediction is None else prediction.covariance
        covariance = system.covariance(errors.covariance)
        return len(mean) - 1, CovarianceReadings(
            scenario.reading_times, mean, covariance, own, system.nominal, system.origin
        )
    linear = _linear_model(campaign, shared)
    model = Model(linear.partials, linear.nominal, errors.mean, errors.covariance, linear.processes)
    prediction = scenario.filter_prediction()
    own = None if prediction is None else prediction.covariance[-1:]
    mean, covariance = model.outcome_mean[None], model.outcome_covariance[None]
    origin = None if linear.origin is None else linear.origin[None]
    return 0, CovarianceReadings(np.zeros(1), mean, covariance, own, linear.nominal[None], origin)


def _with_times(campaign: Campaign, readings: CovarianceReadings, at: Array) -> CovarianceReadings:
    """Append the linear system at further times, rising, s, after an update where one falls on them."""
    try:
        system = campaign.scenario.linear(at)
    except ScenarioError as wrong:
        raise CampaignError([Problem(campaign.file, f"--{wrong.key}", str(wrong))]) from None
    system = system.at(np.array([update != "before" for update in system.updates]))
    errors, zero = campaign.errors, np.zeros(readings.mean.shape[1])
    nominal = np.broadcast_to(zero, system.partials.shape[:2]) if system.nominal is None else system.nominal

    def joined(before: Array | None, after: Array | None) -> Array | None:
        return None if before is None or after is None else np.concatenate([before, after])

    ends = readings.times if len(campaign.scenario.reading_times) else np.full(1, np.inf)  # later than all of them
    return CovarianceReadings(
        np.concatenate([ends, at]),
        np.concatenate([readings.mean, nominal + system.partials @ errors.mean]),
        np.concatenate([readings.covariance, system.covariance(errors.covariance)]),
        joined(readings.own, system.own),
        joined(readings.nominal, nominal),
        joined(readings.origin, system.origin),
    )


def _linear_model(campaign: Campaign, shared: SharedTables) -> LinearModel:
    """Compute the linear model of a scenario, or take over that of the one before if it is the same."""
    if runs_user_code(campaign.scenario):
        return campaign.scenario.linear().end  # its differences depend on the sizes of the errors
    key = repr(campaign.resolved["scenario"])
    if isinstance(shared.tables, tuple) and shared.tables[0] == key:
        return shared.tables[1]  # type: ignore[no-any-return]
    end = campaign.scenario.linear().end
    shared.tables = (key, end)
    return end
