"""Linear analysis beside a run over time: causes of each requirement, and the range in which it has a meaning."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from mcnav.analysis.budget import error_budget
from mcnav.analysis.comparison import Model
from mcnav.analysis.linear_covariance import NOMINAL
from mcnav.analysis.linear_range import BeyondRange, find_beyond, limits_of
from mcnav.analysis.mean_errors import departures
from mcnav.analysis.requirement_causes import causes_of_requirement
from mcnav.analysis.requirements import Requirement, RequirementResult
from mcnav.report.results.summary import named_range
from mcnav.report.statements.fields import beyond_range as range_words
from mcnav.store.manifest import ModelRecord, PartialsRecord
from mcnav.workflow.recorded_model import linear_moments


def beyond_range(record: ModelRecord, model: Model) -> BeyondRange | None:
    """Find where the linear errors of a run leave the range in which they have a meaning; none where they do not."""
    development, over_time = record.development, None
    if development is not None and len(development.times):
        mean, covariance = linear_moments(record, development)
        sigma = np.sqrt(np.maximum(np.diagonal(covariance, axis1=1, axis2=2), 0.0))
        over_time = development.times, mean, sigma
    limits = limits_of(output.limit for output in record.outputs)
    return find_beyond(limits, model.outcome_mean, np.sqrt(np.diag(model.outcome_covariance)), over_time)


def range_note(record: ModelRecord, model: Model) -> str:
    """Say before samples are simulated from when on they are not compared; empty where they are throughout."""
    beyond = beyond_range(record, model)
    if beyond is None:
        return ""
    words = range_words(named_range(beyond, record)).removeprefix("No: ").removesuffix(".")
    return f"{words}; samples from then on are not compared with it"


def _meaningless(requirement: Requirement, development: PartialsRecord | None, beyond: BeyondRange) -> bool:
    """Return whether one of the instants at which a requirement holds is beyond the range of linear analysis."""
    last = max(requirement.epochs, default=None)
    if last is None or development is None or beyond.time is None or last >= len(development.times):
        return True
    return bool(development.times[last] >= beyond.time)


def explain(
    result: RequirementResult, record: ModelRecord, model: Model, beyond: BeyondRange | None
) -> RequirementResult:
    """Add to a requirement the linear causes of the errors that it limits; withdraw linear values beyond their range.

    Over time they are those at the epoch of its largest estimate.
    """
    if beyond is not None and _meaningless(result.requirement, record.development, beyond):
        return replace(result, linear=math.nan, linear_meets=False, largest_sigmas=None)
    if result.requirement.epochs:
        behind = record.smoother if result.requirement.of else None
        development = record.development if behind is None else behind.errors
        if development is None or result.time is None:
            return result
        at = int(np.argmin(np.abs(development.times - result.time)))
        if not np.isclose(development.times[at], result.time, rtol=1e-9):
            return result
        mean, covariance = (moments[at] for moments in linear_moments(record, development))
        nominal = np.zeros_like(mean) if development.nominal is None else development.nominal[at]
        partials, added = development.partials[at], {name: part[at] for name, part in development.processes.items()}
    else:
        mean, covariance, partials = model.outcome_mean, model.outcome_covariance, model.partials
        nominal = model.nominal
        added = {name: np.diag(part) for name, part in model.processes.items()}
    names = [source.name for source in record.sources]
    squares = error_budget(partials, model.covariance).contributions ** 2
    variances = {name: squares[:, k] for k, name in enumerate(names) if squares[:, k].any()} | added
    means = {name: partials[:, k] * model.mean[k] for k, name in enumerate(names) if model.mean[k]}
    means[NOMINAL] = departures(record.outputs, nominal, nominal)
    mean = departures(record.outputs, mean, nominal)
    return replace(result, causes=causes_of_requirement(result.requirement, variances, means, covariance, mean))
