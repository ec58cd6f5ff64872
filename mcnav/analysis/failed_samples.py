"""What samples that failed, and are left out, may hide."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcnav._types import Array
from mcnav.analysis.comparison import Model


@dataclass(frozen=True)
class FailureBias:
    """The failed samples as the linear model sees them: it knows their errors, and so where they would have ended.

    Attributes
    ----------
    samples : int
    sigma_ratio : ndarray, shape (outputs,)
        Sigma of the linear final errors of the samples that were flown, over that of all samples; NaN where there is
        none. Below one, those left out were the larger errors, and the flown dispersion is too small by about as much.
    """

    samples: int
    sigma_ratio: Array


def failure_bias(model: Model, errors: Array, flown: NDArray[np.bool_]) -> FailureBias | None:
    """What leaving out the failed of all samples, errors of shape (n, sources), does; none when none failed."""
    failed = len(flown) - int(np.count_nonzero(flown))
    if failed == 0:
        return None
    ratio = np.full(len(model.partials), np.nan)
    if len(flown) - failed >= 2:
        linear = errors @ model.partials.T
        whole, kept = linear.std(axis=0), linear[flown].std(axis=0)
        ratio = np.divide(kept, whole, out=ratio, where=whole > 0.0)
    return FailureBias(failed, ratio)


Sums = tuple[int, Array, Array]
"""Number of samples, sum of their errors about the mean, shape (sources,), and of the products of these."""


def failure_bias_of_sums(model: Model, whole: Sums, kept: Sums) -> FailureBias | None:
    """As `failure_bias`, from the sums of all samples and of those that were flown."""
    failed = whole[0] - kept[0]
    if failed == 0:
        return None
    ratio = np.full(len(model.partials), np.nan)
    if kept[0] >= 2:
        left, all_of_them = (_linear_sigma(model, *each) for each in (kept, whole))
        ratio = np.divide(left, all_of_them, out=ratio, where=all_of_them > 0.0)
    return FailureBias(failed, ratio)


def _linear_sigma(model: Model, count: int, total: Array, squares: Array) -> Array:
    """Of the linear final errors, shape (outputs,)."""
    about = np.einsum("ij,jk,ik->i", model.partials, squares / count, model.partials)
    return np.asarray(np.sqrt(np.maximum(about - (model.partials @ (total / count)) ** 2, 0.0)))
