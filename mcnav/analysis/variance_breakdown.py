"""Breakdown of the difference between simulated and linear variances into terms that add up exactly.

With y the simulated and z = y0 + P s the linear errors of the same draws, P S P^T the linear covariance, S-hat the
covariance of the draws and P' the partial derivatives by differences,

    cov(y) - P S P^T  =   P (S-hat - S) P^T                       sampling: S-hat differs from S,
                        + [cov(y) - cov(z)]                       the paired difference, which is split further:
                              P' S P'^T - P S P^T                 partials: two methods for the derivatives,
                              1/2 tr(H_i S H_j S)                 curvature,
                              the third derivatives' term         of the same order in sigma,
                              the remainder.

The first line is also the difference between the plain and the paired estimate (`mcnav.analysis.comparison`). The
remainder holds the higher orders and the sampling error of the paired difference, whose standard error is given.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from mcnav.analysis.comparison import Comparison
from mcnav.analysis.model import Model
from mcnav.arrays.products import transformed_variances
from mcnav.arrays.types import Array

TERMS: Final = (
    "sampled_sigmas", "sampled_correlations", "sampled_noise", "partials", "second_order", "third_order", "rest"
)  # fmt: skip
"""Terms of the breakdown, in order of presentation; that of noise is there where samples have any."""


@dataclass(frozen=True)
class Predicted:
    """Further predictions computed with the campaign; NaN where they could not be computed.

    Attributes
    ----------
    partials : ndarray, shape (outputs, sources)
        P by differences.
    quadratic, third_order : ndarray, shape (outputs, outputs)
        Corrections of the covariance by second and third derivatives; see `mcnav.linear.higher_order`.
    unscented : ndarray, shape (outputs, outputs)
        Covariance by the unscented transform.
    """

    partials: Array
    quadratic: Array
    third_order: Array
    unscented: Array


def predicted_from(model: Mapping[str, Any], outputs: int) -> Predicted:
    """Read the further predictions from a manifest's model; NaN for what it does not hold."""

    def table(key: str, entry: str, columns: int) -> Array:
        result = (model.get(key) or {}).get(entry)
        return np.full((outputs, columns), np.nan) if result is None else np.array(result, dtype=float)

    return Predicted(
        partials=table("partials_differences", "partials", len(model["sources"])),
        quadratic=table("second_order", "quadratic", outputs),
        third_order=table("second_order", "third_order", outputs),
        unscented=table("unscented", "covariance", outputs),
    )


@dataclass(frozen=True)
class VarianceBreakdown:
    """Breakdown of each output's variance difference, SI.

    Attributes
    ----------
    terms : dict of str to ndarray, shape (outputs,)
        Keyed by `TERMS`; they sum to ``total``. A term that was not computed is NaN, and is then part of the rest.
    total : ndarray, shape (outputs,)
        Plain sample variance less the linear one.
    paired : ndarray, shape (outputs,)
        Paired variance less the linear one: the terms from ``partials`` on.
    standard_error : ndarray, shape (outputs,)
        Standard error of the paired difference, and so of the rest.
    unscented : ndarray, shape (outputs,)
        Unscented variance less the linear one, for comparison.
    """

    terms: dict[str, Array]
    total: Array
    paired: Array
    standard_error: Array
    unscented: Array


def split_difference(
    model: Model, drawn: Array, comparison: Comparison, predicted: Predicted
) -> VarianceBreakdown | None:
    """Split the difference between the simulated and the linear variances; none when nothing could be compared.

    ``drawn`` is the sample covariance of the start errors of the samples that were compared, shape (sources, sources).
    """
    if not comparison.outputs:
        return None
    linear = np.diag(comparison.covariance_linear)
    total = np.diag(comparison.covariance_sample) - linear
    excess = drawn - model.covariance
    of_errors = transformed_variances(model.partials, excess)
    paired = np.array([output.paired_variance.value for output in comparison.outputs]) - linear
    sampling = total - paired if model.processes else of_errors
    sigmas = np.einsum("ij,j,ij->i", model.partials, np.diag(excess), model.partials)
    by_differences, by_model = (transformed_variances(each.partials, model.covariance) for each in (predicted, model))
    terms = {
        "sampled_sigmas": sigmas,
        "sampled_correlations": of_errors - sigmas,
        **({"sampled_noise": sampling - of_errors} if model.processes else {}),
        "partials": by_differences - by_model,
        "second_order": np.diag(predicted.quadratic),
        "third_order": np.diag(predicted.third_order),
    }
    terms["rest"] = total - np.sum([np.nan_to_num(term) for term in terms.values()], axis=0)
    return VarianceBreakdown(
        terms=terms,
        total=total,
        paired=total - sampling,
        standard_error=np.array([output.paired_variance.standard_error for output in comparison.outputs]),
        unscented=np.diag(predicted.unscented) - linear,
    )
