"""Effect of a better number of the data sheet, each alone: sigmas at the end, and the tightest requirement.

By linear covariance with the gains of the campaign's filter: see `mcnav.analysis.what_if`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from scipy import special

from mcnav._dataclasses import dataclass
from mcnav._types import Array
from mcnav.analysis.changeable_campaign import Slider
from mcnav.analysis.requirements import size_probability
from mcnav.analysis.what_if import LimitedErrors, ScaledCovariance, WhatIf
from mcnav.statistics.normal_size import size_quantile

HALF: Final = 0.5
"""Factor of a number that the catalogue has no grades of."""

SAME: Final = 0.999
"""Factor from which on a grade is the number itself."""

BOUND: Final = 1.05
"""Allowance on the largest quantile over rms of a normal vector's length: that with equal sigmas along some axes."""


@dataclass(frozen=True)
class Improvement:
    """A number by one grade of the catalogue finer, or half as large.

    Attributes
    ----------
    slider : Slider
    grade : str
        Name of that grade; empty for half.
    factor : float
    used : float, optional
        Largest share of its limit that a requirement uses then; none without requirements on sizes.
    sigmas : ndarray, shape (outputs,)
        Sigmas at the end over those of the campaign; one where there is none.
    """

    slider: Slider
    grade: str
    factor: float
    used: float | None
    sigmas: Array


def improvements(what_if: WhatIf) -> tuple[float | None, list[Improvement]]:
    """Return the share of its limit that the tightest requirement uses now, and all improvements, the best first."""
    sliders, covariance = what_if.campaign.sliders, what_if.covariance
    limited = [each for each in what_if.requirements if each.requirement.kind != "box"]
    factors = [1.0] * len(sliders)
    before, listed = covariance.sigma(factors)[-1], []
    for number, slider in enumerate(sliders):
        finer = next_finer(slider)
        if finer is None:
            continue
        grade, factor = finer
        changed = [*factors[:number], factor, *factors[number + 1 :]]
        after = covariance.sigma(changed)[-1]
        sigmas = np.divide(after, before, out=np.ones_like(after), where=before > 0.0)
        listed.append(Improvement(slider, grade, factor, largest_share(covariance, limited, changed), sigmas))
    ranked = sorted(listed, key=lambda each: (math.inf if each.used is None else each.used, float(each.sigmas.min())))
    return largest_share(covariance, limited, factors), ranked


def next_finer(slider: Slider) -> tuple[str, float] | None:
    """Return the next finer grade and its factor, half without grades; none of the finest grade, and of zero."""
    if slider.sizes[slider.shown].value == 0.0:
        return None
    if not slider.grades:
        return "", HALF
    finer = [(name, factor) for name, factor in slider.grades if 0.0 < factor < SAME]
    return max(finer, key=lambda each: each[1]) if finer else None


def largest_share(
    covariance: ScaledCovariance, limited: Sequence[LimitedErrors], factors: Sequence[float]
) -> float | None:
    """Compute the largest share of its limit that a requirement uses for linear normal errors; none without any."""
    if not limited:
        return None
    values, means, largest = covariance.covariance(factors), covariance.mean(factors), 0.0
    for each in limited:
        largest = max(largest, _share(covariance, each, values, means, largest))
    return largest


def _share(covariance: ScaledCovariance, limited: LimitedErrors, values: Array, means: Array, known: float) -> float:
    """Compute the largest share over the readings, or ``known`` if none is larger; most cannot be, and are left out."""
    members, required = limited.members, limited.requirement
    places = [[covariance.entries.index((min(i, j), max(i, j))) for j in members] for i in members]
    readings = np.array(limited.readings)
    matrices, centres = values[readings][:, places], means[readings][:, list(members)] + limited.origin
    squares = np.trace(matrices, axis1=1, axis2=2) + (centres**2).sum(axis=1)
    probability, largest = size_probability(required), known * required.limits[0]
    axes = np.arange(1, len(members) + 1)
    most = BOUND * float(np.sqrt(special.chdtri(axes, 1.0 - probability) / axes).max())
    most = math.hypot(1.0, most) if centres.any() else most  # the mean beside the largest quantile about it
    for k in np.argsort(-squares, kind="stable"):
        if most * math.sqrt(squares[k]) <= largest:
            break
        largest = max(largest, size_quantile(centres[k], matrices[k], probability))
    return float(largest / required.limits[0])
