"""Requirements where flights have examined linear analysis: judged linearly, to second order, or not at all.

At the end, where linear analysis is not shown to hold and a corrected sigma is known well enough
(`CorrectedMoments.improves`):

- The size of one output has the law of its polynomial of second degree, which is skewed as the output is.
- Circles, spheres and boxes have the normal law with corrected moments. They are withheld where an output is skewed:
  where its own quantile departs from the normal one by more than `SKEWED`.
- A requirement that allows one in a thousand or less is withheld: derivatives at the mean errors do not know its tail.

The uncertainty of a value q of probability P is, with z the quantile of the size of a standard normal,

    |mean error| + q (sigma error / sigma + c |z^2 / 3 - 1| + s / 2).

c is what third derivatives change of sigma: a cubic term changes the quantile at z by so much more or less. s is what
skewness changes of the quantile, of which half may be wrong, as of a correction. A requirement is judged where its
limit lies outside of q and its uncertainty.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np
from scipy import special

from mcnav.analysis.corrected_moments import CorrectedMoments
from mcnav.analysis.examination import Examination, Linearity
from mcnav.analysis.linear_answer import LinearRequirement, Order, judge_linearly
from mcnav.analysis.model import Model
from mcnav.analysis.requirements import Requirement, counted, is_rare, size_members, size_probability
from mcnav.errors import NumericalError
from mcnav.statistics.bisection import root_between
from mcnav.statistics.normal_size import size_quantile
from mcnav.statistics.quadratic_tail import QuadraticForm

SKEWED: Final = 0.05
"""Departure of an output's quantile from the normal one beyond which outputs together have no known law."""

WIDTH: Final = 1e-6
"""Width of the last bracket of a quantile, as a share of it."""

NOT_LINEAR: Final = "linear analysis does not hold"
OPEN: Final = "its limit is within the uncertainty"
SKEW: Final = "its outputs are skewed"
"""Reasons for which a requirement is not judged, clauses."""


def judge_by_order(
    judged: tuple[LinearRequirement, ...], model: Model, examined: Examination
) -> tuple[LinearRequirement, ...]:
    """Judge requirements that linear analysis has judged by what an examination of its end knows."""
    return tuple(_judge(row, model, examined) if row.judged else row for row in judged)


def _judge(row: LinearRequirement, model: Model, examined: Examination) -> LinearRequirement:
    required, corrected = row.requirement, examined.corrected
    outputs = size_members(required.outputs, model.sizes) or required.outputs
    verdicts = [examined.outputs[output].verdict for output in outputs]
    at_end = not required.epochs and not required.of
    if corrected is not None and at_end and not is_rare(size_probability(required)):
        improves = corrected.improves(np.sqrt(np.diag(model.outcome_covariance)))[list(outputs)]
        known = [better or verdict != Linearity.FAILS for better, verdict in zip(improves, verdicts, strict=True)]
        needed = any(verdict != Linearity.HOLDS for verdict in verdicts)
        if needed and improves.any() and all(known):
            return _to_second_order(row, outputs, model, corrected)
    if Linearity.FAILS in verdicts:
        return withheld(row, NOT_LINEAR)
    if at_end and Linearity.UNKNOWN in verdicts:
        return _within_bounds(row, examined, outputs)
    return row


def withheld(row: LinearRequirement, doubt: str) -> LinearRequirement:
    """Withdraw the judgement on a requirement, for a reason in a clause."""
    nan = math.nan
    return replace(row, value=nan, margin=nan, time=None, beyond=nan, curved=nan, doubt=doubt)


def _within_bounds(row: LinearRequirement, examined: Examination, outputs: tuple[int, ...]) -> LinearRequirement:
    """Keep a linear judgement that sigmas at the bounds of the examination do not change."""
    low, high = (
        np.array([getattr(examined.outputs[output], end) for output in outputs]) for end in ("low", "high")
    )  # fmt: skip
    if not np.isfinite(low).all():  # no bounds: of a failed simulation, or without a sigma
        return row
    factor = 1.0 / high.max(initial=1.0) if row.met else 1.0 / low.min(initial=1.0)
    kept = row.margin * factor >= 1.0 if row.met else row.margin * factor < 1.0
    return row if kept else withheld(row, OPEN)


def _to_second_order(
    row: LinearRequirement, outputs: tuple[int, ...], model: Model, corrected: CorrectedMoments
) -> LinearRequirement:
    """Judge a requirement at the end to second order."""
    required, nan = row.requirement, math.nan
    probability = size_probability(required)
    (normal,) = judge_linearly(
        [required], corrected.mean, corrected.covariance, None, model.sizes, model.nominal, model.origin
    )
    try:
        own = {output: _quantiles(required, output, model, corrected, probability) for output in outputs}
    except NumericalError:
        return withheld(row, NOT_LINEAR)
    skew = max(abs(exact / gaussian - 1.0) for exact, gaussian in own.values())
    alone = required.kind == "quantile" and len(outputs) == 1
    if not alone and skew > SKEWED:
        return withheld(row, SKEW)
    chosen = list(outputs)
    z = float(special.ndtri(0.5 + 0.5 * probability))
    size = max(gaussian for _, gaussian in own.values())
    share = (
        float(np.linalg.norm(corrected.mean_error[chosen])) / size
        + float(np.max(corrected.error[chosen] / corrected.sigma[chosen]))
        + float(corrected.cubic[chosen].max()) * abs(z**2 / 3.0 - 1.0)
        + 0.5 * skew
    )
    value = own[outputs[0]][0] if alone else normal.value
    second = replace(row, value=value, margin=nan, time=None, beyond=nan, curved=nan, order=Order.SECOND, share=share)
    if required.kind == "box":
        least, most = (_box_with_errors(normal, model, corrected, factor) for factor in (1.0 + share, 1.0 - share))
        decided = least >= probability or most < probability
    else:
        decided = value * (1.0 + share) < required.limits[0] or value * (1.0 - share) >= required.limits[0]
    return second if decided else replace(second, doubt=OPEN)


def _quantiles(
    required: Requirement, output: int, model: Model, corrected: CorrectedMoments, probability: float
) -> tuple[float, float]:
    """Return a quantile of an output's size by its law of second order, and by the normal law with its moments."""
    law, mean = corrected.laws[output], counted(required, corrected.mean, model.origin)[output]
    added = mean - corrected.mean[output]
    law = replace(law, mean=law.mean + float(added))
    gaussian = size_quantile(np.array([mean]), corrected.covariance[[output]][:, [output]], probability)
    return _quantile(law, probability, gaussian), gaussian


def _quantile(law: QuadraticForm, probability: float, near: float) -> float:
    """Return the size that a law exceeds with the probability left; `NumericalError` where it is not known."""

    def excess(size: float) -> float:
        beyond = law.beyond(size)
        if math.isnan(beyond):
            raise NumericalError("the law of second order is not known there")
        return beyond - (1.0 - probability)

    low, high = 0.5 * near, 2.0 * near
    while excess(low) <= 0.0:
        low *= 0.5
    while excess(high) > 0.0:
        high *= 2.0
    return 0.5 * sum(root_between(excess, (low, excess(low)), (high, excess(high)), WIDTH * near))


def _box_with_errors(row: LinearRequirement, model: Model, corrected: CorrectedMoments, factor: float) -> float:
    """Return the probability of a box whose limits are divided by a factor."""
    narrowed = replace(row.requirement, limits=tuple(limit / factor for limit in row.requirement.limits))
    return judge_linearly(
        [narrowed], corrected.mean, corrected.covariance, None, model.sizes, model.nominal, model.origin
    )[0].value
