"""Bias that leaving out failed samples may cause."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mcnav.analysis.block_moments import ErrorSums, ReducedSamples
from mcnav.analysis.model import Model
from mcnav.arrays.products import transformed_variances
from mcnav.arrays.types import Array


@dataclass(frozen=True)
class FailureBias:
    """Effect of the failed samples by the linear model, which predicts their final errors from their start errors.

    ``sigma_ratio`` is the sigma of the linear final errors of the successful samples over that of all samples, shape
    (outputs,); NaN without dispersion. Below one, the failed samples had the larger errors, and the sampled dispersion
    is too small by about as much.
    """

    samples: int
    sigma_ratio: Array


def failure_bias(model: Model, samples: ReducedSamples) -> FailureBias | None:
    """Estimate the effect of leaving out the failed samples; none when none failed."""
    if samples.failed == 0:
        return None
    ratio = np.full(len(model.partials), np.nan)
    if samples.successful.samples >= 2:
        successful, drawn = (_linear_sigma(model, sums) for sums in (samples.successful, samples.drawn))
        ratio = np.divide(successful, drawn, out=ratio, where=drawn > 0.0)
    return FailureBias(samples.failed, ratio)


def _linear_sigma(model: Model, sums: ErrorSums) -> Array:
    """Compute the sigma of the linear final errors, shape (outputs,)."""
    about = transformed_variances(model.partials, sums.products / sums.samples)
    about = about + sum((np.diag(covariance) for covariance in model.processes.values()), np.zeros(len(about)))
    return np.asarray(np.sqrt(np.maximum(about - (model.partials @ (sums.total / sums.samples)) ** 2, 0.0)))
