"""Linear analysis beside a run over time: causes of each requirement, and the range in which it has a meaning."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from mcnav.analysis.linear_covariance import NOMINAL
from mcnav.analysis.linear_range import BeyondRange, find_beyond
from mcnav.analysis.mean_errors import departures
from mcnav.analysis.requirement_causes import causes_of_requirement
from mcnav.analysis.requirements import Requirement, RequirementResult
from mcnav.report.results.summary import named_range
from mcnav.report.statements.fields import beyond_range as range_words
from mcnav.store.manifest import PartialsRecord
from mcnav.workflow.recorded_model import RecordedModel


def beyond_range(model: RecordedModel) -> BeyondRange | None:
    """Find where the linear errors of a run leave the range in which they have a meaning; none where they do not."""
    linear, over_time = model.over_time, None
    if linear is not None and len(linear.record.times):
        sigma = np.sqrt(np.maximum(np.diagonal(linear.covariance, axis1=1, axis2=2), 0.0))
        over_time = linear.record.times, linear.mean, sigma
    return find_beyond(model.limits, model.end.outcome_mean, np.sqrt(np.diag(model.end.outcome_covariance)), over_time)


def range_note(model: RecordedModel) -> str:
    """Say before samples are simulated from when on they are not compared; empty where they are throughout."""
    beyond = beyond_range(model)
    if beyond is None:
        return ""
    words = range_words(named_range(beyond, model.record)).removeprefix("No: ").removesuffix(".")
    return f"{words}; samples from then on are not compared with it"


def _meaningless(requirement: Requirement, development: PartialsRecord | None, beyond: BeyondRange) -> bool:
    """Return whether one of the instants at which a requirement holds is beyond the range of linear analysis."""
    last = max(requirement.epochs, default=None)
    if last is None or development is None or beyond.time is None or last >= len(development.times):
        return True
    return bool(development.times[last] >= beyond.time)


def explain(result: RequirementResult, linear: RecordedModel, beyond: BeyondRange | None) -> RequirementResult:
    """Add to a requirement the linear causes of the errors that it limits; withdraw linear values beyond their range.

    Over time they are those at the epoch of its largest estimate.
    """
    record, model = linear.record, linear.end
    if beyond is not None and _meaningless(result.requirement, record.development, beyond):
        return replace(result, linear=math.nan, linear_meets=False, largest_sigmas=None)
    if result.requirement.epochs:
        over_time = (linear.smoothed if result.requirement.of else None) or linear.over_time
        if over_time is None or result.time is None:
            return result
        development = over_time.record
        at = int(np.argmin(np.abs(development.times - result.time)))
        if not np.isclose(development.times[at], result.time, rtol=1e-9):
            return result
        mean, covariance = over_time.mean[at], over_time.covariance[at]
        nominal = np.zeros_like(mean) if development.nominal is None else development.nominal[at]
        partials, added = (
            development.partials[at],
            {name: process[at] for name, process in development.processes.items()},
        )
    else:
        mean, covariance, partials = model.outcome_mean, model.outcome_covariance, model.partials
        nominal = model.nominal
        added = {name: np.diag(process) for name, process in model.processes.items()}
    names = [source.name for source in record.sources]
    parts = partials * (partials @ model.covariance)  # with half of what correlations add, as in `mcnav lincov`
    variances = {name: parts[:, k] for k, name in enumerate(names) if parts[:, k].any()} | added
    means = {name: partials[:, k] * model.mean[k] for k, name in enumerate(names) if model.mean[k]}
    means[NOMINAL] = departures(record.outputs, nominal, nominal)
    mean = departures(record.outputs, mean, nominal)
    return replace(result, causes=causes_of_requirement(result.requirement, variances, means, covariance, mean))
