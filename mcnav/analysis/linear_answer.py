"""Linear answer to a campaign: moments at the end and over time, error budget, requirements for normal errors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mcnav._types import Array
from mcnav.analysis.budget import ErrorBudget, error_budget
from mcnav.analysis.comparison import Model
from mcnav.analysis.linear_covariance import LinearCovariance, Moments
from mcnav.analysis.requirements import (
    Requirement,
    normal_box_probability,
    normal_quantile,
    size_probability,
)
from mcnav.analysis.requirements_over_time import largest_normal_quantile
from mcnav.scenarios.protocol import Output, Source
from mcnav.statistics.bisection import smallest_reaching


@dataclass(frozen=True)
class LinearRequirement:
    """Requirement judged for linear normal errors.

    Attributes
    ----------
    value : float
        Quantile or radius, SI, or probability of a box; NaN for a sigma ratio, which needs Monte Carlo.
    margin : float
        Multiple of all final errors at which the requirement is just met: at least one where it is met.
    time : float or None
        Where it holds at several epochs, time of the largest value, in the unit of the history.
    """

    requirement: Requirement
    value: float
    margin: float
    time: float | None = None

    @property
    def judged(self) -> bool:
        """Return whether linear analysis can tell."""
        return not math.isnan(self.value)

    @property
    def met(self) -> bool:
        """Return whether the requirement is met; false where linear analysis cannot tell."""
        if self.requirement.kind == "box":
            return self.value >= size_probability(self.requirement)
        return self.value <= self.requirement.limits[0]


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
    kind : str
        Type of its scenario.
    """

    campaign: str
    sources: tuple[Source, ...]
    outputs: tuple[Output, ...]
    model: Model
    history: LinearCovariance | None
    requirements: tuple[LinearRequirement, ...]
    asked: LinearCovariance | None = None
    kind: str = ""

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
        """Correlation coefficients of the final errors, shape (outputs, outputs); NaN for one without dispersion."""
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
        return all(each.met for each in self.requirements if each.judged)


def judge_linearly(
    requirements: Sequence[Requirement], mean: Array, covariance: Array, history: Moments | None
) -> tuple[LinearRequirement, ...]:
    """Judge requirements for normal errors.

    Parameters
    ----------
    mean, covariance : ndarray, shapes (outputs,) and (outputs, outputs)
        Of the final errors.
    history : Moments or None
        At the epochs of the campaign, for requirements over time.
    """
    return tuple(_judge(each, mean, covariance, history) for each in requirements)


def _judge(requirement: Requirement, mean: Array, covariance: Array, history: Moments | None) -> LinearRequirement:
    if requirement.kind == "sigma_ratio":
        return LinearRequirement(requirement, math.nan, math.nan)
    picked = np.array(requirement.outputs)
    mean, covariance = mean[picked], covariance[np.ix_(picked, picked)]
    if requirement.kind == "box":
        return _judge_box(requirement, mean, covariance)
    probability, time = size_probability(requirement), None
    if requirement.epochs and history is not None:
        at = np.array(requirement.epochs)
        means, covariances = history.mean[np.ix_(at, picked)], history.covariance[np.ix_(at, picked, picked)]
        value, worst = largest_normal_quantile(means, covariances, probability)
        time = float(history.times[at[worst]])
    else:
        value = normal_quantile(mean, covariance, probability)
    return LinearRequirement(requirement, value, requirement.limits[0] / value if value > 0.0 else math.inf, time)


def sizes_over_time(requirement: Requirement, history: Moments) -> Array:
    """Compute the quantile or radius of a requirement at every time, shape (m,), SI."""
    picked = np.array(requirement.outputs)
    mean, covariance = history.mean[:, picked], history.covariance[:, picked[:, None], picked]
    probability = size_probability(requirement)
    return np.array([normal_quantile(*each, probability) for each in zip(mean, covariance, strict=True)])


def _judge_box(requirement: Requirement, mean: Array, covariance: Array) -> LinearRequirement:
    """Judge the probability that several outputs lie within their limits together.

    With all errors multiplied by k it is that of limits divided by k, so that the margin is the reciprocal of the
    smallest multiple of the limits with the required probability.
    """
    limits = np.array(requirement.limits)
    value = normal_box_probability(mean, covariance, limits)
    widest = float(((np.abs(mean) + 40.0 * np.sqrt(np.diag(covariance))) / limits).max())
    if widest == 0.0:
        return LinearRequirement(requirement, value, math.inf)
    least = smallest_reaching(
        lambda multiple: normal_box_probability(mean, covariance, multiple * limits),
        size_probability(requirement), 0.0, widest,
    )  # fmt: skip
    return LinearRequirement(requirement, value, 1.0 / least)
