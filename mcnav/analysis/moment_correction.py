"""Correction of the moments of linear analysis by derivatives, beside an examination of it.

With the derivatives g, H and T of `mcnav.linear.higher_order` and the linear covariance C, which has the noise,

    mean = y_0 + 1/2 tr H        covariance = C + 1/2 tr(H H) + sym(g T_.kk)
    mean NEES = rank + 1/2 tr(C^-1 tr(H H)) + m' C^-1 m,        m = mean - linear mean.

The law of one output is that of its Hermite polynomial of second degree: slopes ``g + 1/2 T_.kk``, curvatures H. The
uncertainty of a moment is its difference from that of the examination, and the half width of the latter's bounds.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mcnav.analysis.corrected_moments import CorrectedMoments
from mcnav.analysis.examination import Examination
from mcnav.analysis.model import Model
from mcnav.arrays.products import transform
from mcnav.linear.higher_order import SecondOrder
from mcnav.statistics.quadratic_tail import QuadraticForm


def correct_moments(model: Model, order: SecondOrder, examined: Examination) -> CorrectedMoments:
    """Correct the moments of a linear model by derivatives, and compare them with those of an examination."""
    linear, given = model.outcome_covariance, model.whitened
    curved = linear + order.quadratic
    covariance = curved + order.third_order
    sigma, without = (np.sqrt(np.maximum(np.diag(matrix), 0.0)) for matrix in (covariance, curved))
    ratios = np.array([(output.ratio, output.low, output.high) for output in examined.outputs]).T
    seen, low, high = ratios * np.sqrt(np.diag(linear))
    mean, about = order.centre + order.mean_shift, model.outcome_mean
    shift, shift_half = examined.mean_departure
    nees, nees_error = np.nan, np.nan
    if examined.joint is not None:
        added = np.trace(transform(given.matrix.T, order.quadratic)) + np.sum(((mean - about) @ given.matrix) ** 2)
        nees = given.rank + float(added)
        nees_seen, least, most = (
            given.rank * ratio**2 for ratio in (examined.joint.ratio, examined.joint.low, examined.joint.high)
        )
        nees_error = abs(nees - nees_seen) + 0.5 * (most - least)
    noise = np.sqrt(np.maximum(sum((np.diag(added) for added in model.processes.values()), np.zeros(len(sigma))), 0.0))
    slopes, curvatures = replace(order, gradients=order.gradients + 0.5 * order.cubic).along_axes
    laws = tuple(
        QuadraticForm(float(centre), own, bends, float(of_noise))
        for centre, own, bends, of_noise in zip(order.centre, slopes, curvatures, noise, strict=True)
    )
    return CorrectedMoments(
        mean, np.abs(mean - about - shift) + shift_half, sigma, np.abs(sigma - seen) + 0.5 * (high - low), covariance,
        np.divide(np.abs(sigma - without), without, out=np.zeros_like(sigma), where=without > 0.0),
        nees, nees_error, laws, order.added_by_pairs,
    )  # fmt: skip
