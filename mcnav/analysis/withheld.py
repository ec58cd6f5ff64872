"""Requirements of linear analysis where gates reject good measurements: exact where they can be, else withheld."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from scipy import special

from mcnav.analysis.linear_answer import LinearRequirement
from mcnav.analysis.rejections import OnLinear, RejectionAnswer, probabilities_of_first
from mcnav.analysis.requirements import size_probability
from mcnav.arrays.types import Array
from mcnav.contract.gates import RejectionLaws
from mcnav.statistics.bisection import root_between
from mcnav.statistics.gates import GatedError
from mcnav.statistics.refusals import or_withheld

WIDTH: Final = 1e-9
"""Width of the last bracket of a quantile, as a share of it."""


def with_rejections(
    judged: Sequence[LinearRequirement], laws: RejectionLaws | None, rejections: RejectionAnswer | None, mean: Array
) -> tuple[LinearRequirement, ...]:
    """Judge requirements as gates let them be judged.

    Where linear analysis does not hold, the size of one output at the end is judged by its exact law if that is known.
    All else that is met needs Monte Carlo, and with faults what is not met does too: rejected good measurements make
    errors larger, rejected faults make them smaller.

    Parameters
    ----------
    laws, rejections
        None without a gate.
    mean : ndarray, shape (outputs,)
        Of the final errors.
    """
    if laws is None or rejections is None or rejections.verdict == OnLinear.HOLDS:
        return tuple(judged)
    return tuple(
        or_withheld(_by_exact_law, judgement, laws, instead=_withheld(judgement))
        if rejections.exact and _has_exact_law(judgement, mean)
        else _withheld(judgement) if judgement.met or rejections.doubt == "faults"
        else judgement
        for judgement in judged
    )  # fmt: skip


def _has_exact_law(judged: LinearRequirement, mean: Array) -> bool:
    required = judged.requirement
    alone = required.kind == "quantile" and len(required.outputs) == 1 and not required.epochs and not required.of
    return judged.judged and alone and mean[required.outputs[0]] == 0.0


def _withheld(judged: LinearRequirement) -> LinearRequirement:
    nan = math.nan
    return replace(judged, value=nan, margin=nan, time=None, beyond=nan, curved=nan)


def _by_exact_law(judged: LinearRequirement, laws: RejectionLaws) -> LinearRequirement:
    """Replace the linear quantile of an output by that of all flights, with and without rejections."""
    required, probability = judged.requirement, size_probability(judged.requirement)
    limit = required.limits[0]

    def excess(size: float) -> float:
        return probability_beyond(laws, required.outputs[0], size) - (1.0 - probability)

    low = judged.value
    if low <= 0.0 or excess(low) <= 0.0:
        return judged
    high = 2.0 * low
    while excess(high) > 0.0:
        low, high = high, 2.0 * high
    value = 0.5 * sum(root_between(excess, (low, excess(low)), (high, excess(high)), WIDTH * high))
    beyond = probability_beyond(laws, required.outputs[0], limit)
    return replace(judged, value=value, margin=limit / value, beyond=beyond, curved=math.nan)


def probability_beyond(laws: RejectionLaws, output: int, size: float) -> float:
    """Compute the probability that an output at the end is larger than a size, where rejections end with the first.

    With the whitened innovation w of a measurement and the error e, jointly normal, it is ``P(|e| > size)`` without
    ``P(|w|^2 <= T, |e| > size)`` of flights with that first rejection, and that of flights without one.
    """
    reading, of_first = laws.readings[-1], probabilities_of_first(laws.probabilities)
    total = (1.0 - of_first.sum()) * _beyond(size, float(reading.variances[output]))
    for number, m in enumerate(laws.sizes[: len(reading.once.excess)].tolist()):
        sigma = math.sqrt(float(reading.variances[output] + reading.once.excess[number, output]))
        cross, of_update = reading.once.responses[number, output, :m], of_first[number] / laws.probabilities[number]
        law = GatedError(float(laws.limits[number]), np.zeros((1, m)), np.eye(m), cross, np.zeros(1), sigma)
        total += of_update * (_beyond(size, sigma**2) - law.unnoticed_beyond(size)[0])
    return float(total)


def _beyond(size: float, variance: float) -> float:
    """Return the probability that a normal error without a mean is larger than a size."""
    return 2.0 * float(special.ndtr(-size / math.sqrt(variance))) if variance > 0.0 else 0.0
