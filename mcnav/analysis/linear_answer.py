"""Linear answer to a campaign: moments at the end and over time, error budget, requirements for normal errors."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mcnav.analysis.box import Box
from mcnav.analysis.budget import ErrorBudget, error_budget
from mcnav.analysis.causes import Cause, causes_of
from mcnav.analysis.examination import Examination
from mcnav.analysis.filter_consistency import Honesty
from mcnav.analysis.floor import CANCELLED
from mcnav.analysis.gates import GateAnswer
from mcnav.analysis.linear_covariance import NOMINAL, LinearCovariance, Moments
from mcnav.analysis.linear_filter import LinearVerdict
from mcnav.analysis.linear_range import BeyondRange, find_beyond, limits_of, picked, readings_beyond
from mcnav.analysis.mean_errors import departures
from mcnav.analysis.model import Model
from mcnav.analysis.rejections import RejectionAnswer
from mcnav.analysis.requirement_causes import causes_of_requirement
from mcnav.analysis.requirements import (
    Requirement,
    counted,
    is_rare,
    size_members,
    size_probability,
)
from mcnav.arrays.types import Array
from mcnav.contract.quantities import Output, Source
from mcnav.statistics.bisection import root_between, smallest_reaching
from mcnav.statistics.largest_quantiles import largest_quantiles
from mcnav.statistics.normal_box import normal_box_probability, probability_beyond_box
from mcnav.statistics.normal_size import NormalSize, size_quantile, size_quantiles
from mcnav.statistics.refusals import or_withheld


class Order(StrEnum):
    """Order of the expansion in the errors by which a requirement is judged."""

    LINEAR = "linear"
    SECOND = "second order"


@dataclass(frozen=True)
class LinearRequirement:
    """Requirement judged for linear normal errors, or to second order (`mcnav.analysis.corrected_requirements`).

    Attributes
    ----------
    value : float
        Quantile or radius, SI, or probability of a box; NaN for a sigma ratio, and where errors are beyond the range of
        linear analysis: these need Monte Carlo.
    margin : float
        Multiple of all errors at which the requirement is just met: at least one where it is met. What a flight without
        errors has stays as it is; zero where that is beyond the limit already.
    time : float or None
        Where it holds at several epochs, time of the largest value, in the unit of the history.
    beyond : float
        Probability beyond its limits, then or at the end, of one that allows little
        (`mcnav.analysis.requirements.RARE`); else, and where it is not known (`mcnav.statistics.normal_box`), NaN.
    curved : float
        The same with the curvature of the outputs (`mcnav.analysis.tail_curves`); NaN where it is not computed.
    order : Order
        By which it is judged; to second order there is no margin, since corrections do not grow as errors do.
    share : float
        Uncertainty of a value of second order, as a share of it; zero of a linear one.
    doubt : str
        Reason for which an examination lets nobody judge it, a clause; empty where it is judged.
    """

    requirement: Requirement
    value: float
    margin: float
    time: float | None = None
    beyond: float = math.nan
    curved: float = math.nan
    order: Order = Order.LINEAR
    share: float = 0.0
    doubt: str = ""

    @property
    def judged(self) -> bool:
        """Return whether it can be told without samples."""
        return not math.isnan(self.value) and not self.doubt

    @property
    def met(self) -> bool:
        """Return whether the requirement is met; false where linear analysis cannot tell.

        ``below`` is strict: a size without dispersion that equals its limit does not meet it.
        """
        if self.requirement.kind == "box":
            return self.value >= size_probability(self.requirement)
        return self.value < self.requirement.limits[0]

    @property
    def tightness(self) -> float:
        """Margin by which requirements are sorted: of second order the limit over the value, which a box has not."""
        if self.order == Order.LINEAR:
            return self.margin
        return self.value / size_probability(self.requirement) if self.requirement.kind == "box" else (
            self.requirement.limits[0] / self.value
        )  # fmt: skip


@dataclass(frozen=True)
class LinearAnswer:
    """Linear covariance of a campaign.

    Attributes
    ----------
    campaign : str
        Its name.
    model : Model
        Linear model at the end, with the moments of the sources.
    history : LinearCovariance or None
        The same over time; none where the scenario is linearized at its end alone.
    requirements : tuple of LinearRequirement
        In the order of the campaign.
    asked : LinearCovariance or None
        At times that were asked for.
    filter : LinearVerdict or None
        Verdict on the filter; none without a filter whose covariance is known over time.
    smoothed, smoothed_asked : LinearCovariance or None
        Of the errors behind a smoother at the readings of `history` and of `asked`: their ``sigma_filter`` is what the
        smoother claims.
    smoother : LinearVerdict or None
        Verdict on the smoother.
    gates : tuple of GateAnswer
        What the gates of sensors stop.
    rejections : RejectionAnswer or None
        What gates make of good measurements; none without a gate.
    examination : Examination or None
        Where it holds, by simulations (`mcnav.analysis.examination`); none where that was not asked for.
    examined_in : float
        Seconds that this took; infinite without one.
    unexamined : str
        Reason why it was asked for and left out, a clause; empty elsewhere.
    kind : str
        Type of its scenario.
    remarks : tuple of str
        What the scenario notices of itself; see `mcnav.contract.scenario.PlainScenario`.
    box : Box or None
        The worst and the best over the campaign's ranges, of which all else here has the upper ends; none without any.
    card : callable or None
        Writes it as HTML, for notebooks.

    Examples
    --------
    >>> import mcnav as mc
    >>> answer = mc.linear_covariance({"scenario": {"type": "reentry", "trajectory": 1}, "errors": {"altitude": 5e3}})
    >>> answer.covariance.shape, round(float(answer.sigma[0]))
    ((4, 4), 6126)
    """

    campaign: str
    sources: tuple[Source, ...]
    outputs: tuple[Output, ...]
    model: Model
    history: LinearCovariance | None
    requirements: tuple[LinearRequirement, ...]
    asked: LinearCovariance | None = None
    filter: LinearVerdict | None = None
    smoothed: LinearCovariance | None = None
    smoothed_asked: LinearCovariance | None = None
    smoother: LinearVerdict | None = None
    gates: tuple[GateAnswer, ...] = ()
    rejections: RejectionAnswer | None = None
    examination: Examination | None = None
    examined_in: float = field(default=math.inf, repr=False, compare=False)
    unexamined: str = ""
    kind: str = ""
    remarks: tuple[str, ...] = ()
    box: Box | None = None
    card: Callable[[LinearAnswer], str] | None = field(default=None, repr=False, compare=False)

    @property
    def fails(self) -> bool:
        """Return whether a requirement is not met, or the filter is at odds with the truth."""
        departs = self.filter is not None and self.filter.verdict in (Honesty.OPTIMISTIC, Honesty.PESSIMISTIC)
        return departs or any(requirement.judged and not requirement.met for requirement in self.requirements)

    def _repr_html_(self) -> str | None:
        """Show verdict, requirements, sigmas with their causes, and errors over time, in a notebook."""
        return None if self.card is None else self.card(self)

    def __repr__(self) -> str:
        judged = [requirement for requirement in self.requirements if requirement.judged]
        met = f", {sum(judgement.met for judgement in judged)} of {len(judged)} requirements met" if judged else ""
        return f"{self.campaign}: linear covariance of {len(self.outputs)} outputs{met}"

    @cached_property
    def covariance(self) -> Array:
        """Covariance of the final errors, shape (outputs, outputs), SI."""
        return self.model.outcome_covariance

    @property
    def mean(self) -> Array:
        """Mean of the final errors, shape (outputs,), SI."""
        return self.model.outcome_mean

    @cached_property
    def sigma(self) -> Array:
        """Standard deviations of the final errors, shape (outputs,), SI."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @cached_property
    def correlation(self) -> Array:
        """Correlation of the final errors, shape (outputs, outputs), without unit; NaN for one without dispersion."""
        sizes = np.where(self.sigma > 0.0, self.sigma, np.nan)
        return np.asarray(self.covariance / np.outer(sizes, sizes))

    @cached_property
    def budget(self) -> ErrorBudget:
        """Contributions of the `causes` to the final variances."""
        return error_budget(self.model.partials, self.model.covariance, list(self.model.processes.values()))

    @property
    def causes(self) -> tuple[str, ...]:
        """Names of the sources and, after them, of the processes of noise."""
        return (*(source.name for source in self.sources), *self.model.processes)

    @property
    def met(self) -> bool:
        """Return whether all requirements that linear analysis can judge are met."""
        return all(requirement.met for requirement in self.requirements if requirement.judged)

    @cached_property
    def beyond(self) -> BeyondRange | None:
        """Exit of errors from the range of linear analysis; what it says later, and at the end, has no meaning."""
        history, over_time = self.history, None
        if history is not None:
            over_time = history.readings.times, history.mean, history.sigma
        return find_beyond(self._limits, self.mean, self.sigma, over_time)

    @property
    def _limits(self) -> Array:
        return limits_of(output.limit for output in self.outputs)

    def readings_beyond(self, covariance: LinearCovariance) -> NDArray[np.bool_]:
        """Return at which readings linear errors have no meaning, booleans, shape (r,)."""
        return readings_beyond(self._limits, covariance, None if self.beyond is None else self.beyond.time)

    @cached_property
    def meaningful(self) -> LinearCovariance | None:
        """The history within the range of linear analysis; none where there is no reading."""
        if self.history is None or self.beyond is None:
            return self.history
        within = ~self.readings_beyond(self.history)
        return picked(self.history, within) if within.any() else None

    @cached_property
    def means(self) -> Mapping[str, Array]:
        """Part of the mean of each source in the final mean error, shape (outputs,), SI; and the nominal errors."""
        means = {
            source.name: self.model.partials[:, number] * self.model.mean[number]
            for number, source in enumerate(self.sources)
            if self.model.mean[number]
        }
        return means | ({NOMINAL: self.model.nominal} if np.any(self.model.nominal) else {})

    @cached_property
    def final_variances(self) -> Mapping[str, Array]:
        """Part of each cause in the final variances, SI, with half of what its correlations add, shape (outputs,)."""
        parts = np.nan_to_num(self.budget.attributed) * np.diag(self.covariance)[:, None]
        return {name: parts[:, number] for number, name in enumerate(self.causes) if parts[:, number].any()}

    def final_causes(self, output: int) -> tuple[Cause, ...]:
        """List the causes of an output's final variance."""
        variances = {name: values[[output]] for name, values in self.final_variances.items()}
        return causes_of(variances, {}, float(self.covariance[output, output]))

    def requirement_causes(self, number: int) -> tuple[Cause, ...]:
        """List the causes of the errors that a requirement limits, at the instant at which it is tightest."""
        judged = self.requirements[number]
        if judged.time is None or self.history is None:
            mean, means = self._departures(self.mean, self.model.nominal, self.means)
            return causes_of_requirement(judged.requirement, self.final_variances, means, self.covariance, mean)
        history = self.smoothed if judged.requirement.of and self.smoothed is not None else self.history
        at = int(history.settled[np.argmin(np.abs(history.readings.times[history.settled] - judged.time))])
        variances, means = (
            {name: values[at] for name, values in parts.items()} for parts in (history.attributed, history.means)
        )
        nominal = history.readings.nominal
        mean, means = self._departures(history.mean[at], None if nominal is None else nominal[at], means)
        return causes_of_requirement(judged.requirement, variances, means, history.covariance[at], mean)

    def _departures(
        self, mean: Array, nominal: Array | None, means: Mapping[str, Array]
    ) -> tuple[Array, Mapping[str, Array]]:
        """Return a mean and its parts by cause without the nominal values of outputs that are no errors."""
        if NOMINAL in means:
            means = {**means, NOMINAL: departures(self.outputs, means[NOMINAL], nominal)}
        return departures(self.outputs, mean, nominal), means


def causes_at(covariance: LinearCovariance, reading: int, output: int) -> tuple[Cause, ...]:
    """List the causes of the variance of an output at a reading, each with half of what its correlations add."""
    variances = {name: values[reading, [output]] for name, values in covariance.attributed.items()}
    return causes_of(variances, {}, float(covariance.sigma[reading, output] ** 2))


def within_range(
    judged: Sequence[LinearRequirement], beyond: BeyondRange | None, times: Array | None
) -> tuple[LinearRequirement, ...]:
    """Withdraw the judgement on requirements that hold where errors are beyond the range of linear analysis.

    Parameters
    ----------
    times : ndarray, shape (m,), or None
        Of the epochs, where the requirements refer to some.
    """
    if beyond is None:
        return tuple(judged)

    def meaningless(requirement: LinearRequirement) -> bool:
        epochs = requirement.requirement.epochs
        if not epochs or times is None or beyond.time is None:
            return True
        return bool((times[list(epochs)] >= beyond.time).any())

    nan = math.nan
    return tuple(
        replace(judgement, value=nan, margin=nan, time=None, beyond=nan) if meaningless(judgement) else judgement
        for judgement in judged
    )


def judge_within_range(
    requirements: Sequence[Requirement],
    limits: Array,
    mean: Array,
    covariance: Array,
    history: Moments | None,
    sizes: Mapping[int, tuple[int, ...]] | None = None,
    nominal: Array | None = None,
    origin: Array | None = None,
) -> tuple[LinearRequirement, ...]:
    """Judge requirements for normal errors, and none that holds where errors are beyond the limits of the outputs.

    Parameters
    ----------
    limits : ndarray, shape (outputs,)
        See `mcnav.analysis.linear_range.limits_of`.
    mean, covariance, history, sizes, nominal, origin
        As for `judge_linearly`.
    """
    over_time = None
    if history is not None:
        variances = np.diagonal(history.covariance, axis1=1, axis2=2)
        over_time = history.times, history.mean, np.sqrt(np.maximum(variances, 0.0))
    beyond = find_beyond(limits, mean, np.sqrt(np.maximum(np.diag(covariance), 0.0)), over_time)
    judged = judge_linearly(requirements, mean, covariance, history, sizes, nominal, origin)
    return within_range(judged, beyond, None if history is None else history.times)


def judge_linearly(
    requirements: Sequence[Requirement], mean: Array, covariance: Array, history: Moments | None,
    sizes: Mapping[int, tuple[int, ...]] | None = None, nominal: Array | None = None, origin: Array | None = None,
) -> tuple[LinearRequirement, ...]:  # fmt: skip
    """Judge requirements for normal errors; not those judged by a number that its check refuses.

    Parameters
    ----------
    mean, covariance : ndarray, shapes (outputs,) and (outputs, outputs)
        Of the final errors.
    history : Moments or None
        At the epochs of the campaign, for requirements over time.
    sizes : mapping of int to tuple of int, optional
        Outputs that are the root sum of squares of others.
    nominal : ndarray, shape (outputs,), optional
        Part of the mean that a flight without errors has; by default none.
    origin : ndarray, shape (outputs,), optional
        What the outputs are measured from; see `mcnav.analysis.requirements.counted`.
    """
    fixed = np.zeros_like(mean) if nominal is None else nominal
    return tuple(
        or_withheld(
            _judge, requirement, counted(requirement, mean, origin), covariance, history, sizes or {},
            counted(requirement, fixed, origin),
            instead=LinearRequirement(requirement, math.nan, math.nan),
        )
        for requirement in requirements
    )  # fmt: skip


def _judge(
    requirement: Requirement, mean: Array, covariance: Array, history: Moments | None,
    sizes: Mapping[int, tuple[int, ...]], nominal: Array,
) -> LinearRequirement:  # fmt: skip
    if requirement.kind == "sigma_ratio":
        return LinearRequirement(requirement, math.nan, math.nan)
    members = size_members(requirement.outputs, sizes)
    picked = np.array(members or requirement.outputs)
    mean, covariance, nominal = mean[picked], covariance[np.ix_(picked, picked)], nominal[picked]
    rare = is_rare(size_probability(requirement))
    if requirement.kind == "box":
        beyond = probability_beyond_box(mean, covariance, np.array(requirement.limits)) if rare else math.nan
        return replace(_judge_box(requirement, mean, covariance, nominal), beyond=beyond)

    def quantile(mean: Array, covariance: Array) -> float:
        return size_quantile(mean, covariance, probability)

    probability, time = size_probability(requirement), None
    if requirement.epochs and history is not None:
        at = np.array(requirement.epochs)
        means = counted(requirement, history.mean, history.origin)[np.ix_(at, picked)]
        covariances = history.covariance[np.ix_(at, picked, picked)]
        values, numbers = largest_quantiles(means[None], covariances[None], probability, np.zeros(1))
        value, worst = float(values[0]), int(numbers[0])
        time, mean, covariance = float(history.times[at[worst]]), means[worst], covariances[worst]
        known = np.zeros_like(history.mean) if history.nominal is None else history.nominal
        nominal = counted(requirement, known, history.origin)[at[worst], picked]
    else:
        value = quantile(mean, covariance)
    if nominal.any():
        margin = _margin_about(requirement.limits[0], nominal, mean, covariance, quantile)
    else:
        margin = requirement.limits[0] / value if value > 0.0 else math.inf
    beyond = NormalSize.of(mean, covariance).beyond(requirement.limits[0]) if rare else math.nan
    return LinearRequirement(requirement, value, margin, time, beyond)


def _margin_about(
    limit: float, nominal: Array, mean: Array, covariance: Array, quantile: Callable[[Array, Array], float]
) -> float:
    """Return the factor k by which errors may grow about a nominal, until a quantile of its size is the limit.

    The quantile is that of ``N(nominal + k (mean - nominal), k^2 covariance)``. The probability of an interval,
    a circle or a sphere that holds the nominal falls with k, so that there is one factor.
    """
    own, errors = float(np.linalg.norm(nominal)), mean - nominal
    size = float(np.sqrt(np.trace(covariance) + errors @ errors))
    if own >= limit:
        return 0.0
    if size <= CANCELLED * own:
        return math.inf

    def excess(multiple: float) -> float:
        return quantile(nominal + multiple * errors, multiple**2 * covariance) - limit

    high = limit / size
    while excess(high) < 0.0:
        high *= 2.0
    ends = root_between(excess, (0.0, own - limit), (high, excess(high)), 1e-12 * high)
    return 0.5 * (ends[0] + ends[1])


def sizes_over_time(requirement: Requirement, history: Moments, sizes: Mapping[int, tuple[int, ...]]) -> Array:
    """Compute the quantile or radius of a requirement at every time, shape (m,), SI."""
    picked = np.array(size_members(requirement.outputs, sizes) or requirement.outputs)
    mean = counted(requirement, history.mean, history.origin)
    covariance = history.covariance[:, picked[:, None], picked]
    return size_quantiles(mean[:, picked], covariance, size_probability(requirement), instead=math.nan)


def _judge_box(requirement: Requirement, mean: Array, covariance: Array, nominal: Array) -> LinearRequirement:
    """Judge the probability that several outputs lie within their limits together.

    With all errors multiplied by k it is that of limits divided by k, so that the margin is the reciprocal of the
    smallest multiple of the limits with the required probability. Where a flight without errors has some of the mean,
    errors grow about that.
    """
    limits, wanted = np.array(requirement.limits), size_probability(requirement)
    value = normal_box_probability(mean, covariance, limits)
    if nominal.any():
        return LinearRequirement(requirement, value, _box_margin_about(nominal, mean, covariance, limits, wanted))
    # beyond what is fixed, by a little: a value at its limit is not within
    widest = (1.0 + 1e-9) * float(((np.abs(mean) + 40.0 * np.sqrt(np.diag(covariance))) / limits).max())
    if widest == 0.0:
        return LinearRequirement(requirement, value, math.inf)
    least = smallest_reaching(
        lambda multiple: normal_box_probability(mean, covariance, multiple * limits),
        wanted, 0.0, widest,
    )  # fmt: skip
    return LinearRequirement(requirement, value, 1.0 / least)


def _box_margin_about(nominal: Array, mean: Array, covariance: Array, limits: Array, wanted: float) -> float:
    """Return the factor by which errors may grow about a nominal, until the probability of a box is the wanted one."""
    errors = mean - nominal
    size = np.sqrt(np.diag(covariance) + errors**2)
    if np.any(np.abs(nominal) >= limits):
        return 0.0
    if np.all(size <= CANCELLED * np.abs(nominal)):
        return math.inf

    def outside(multiple: float) -> float:
        return 1.0 - normal_box_probability(nominal + multiple * errors, multiple**2 * covariance, limits)

    high = float((limits / np.where(size > 0.0, size, np.inf)).max())
    while outside(high) < 1.0 - wanted:
        high *= 2.0
    return smallest_reaching(outside, 1.0 - wanted, 0.0, high)
