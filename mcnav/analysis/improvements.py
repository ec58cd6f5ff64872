"""Effect of a better number of the data sheet, each alone, on what fails, or else on what comes closest to failing.

By linear covariance with the gains of the campaign's filter: see `mcnav.analysis.what_if`. What a simulation measured
of a requirement scales its share of the limit (`mcnav.analysis.simulated_requirements`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy import special

from mcnav.analysis.changeable_campaign import Slider
from mcnav.analysis.requirements import size_probability
from mcnav.analysis.what_if import LimitedErrors, ScaledCovariance, WhatIf
from mcnav.arrays.types import Array
from mcnav.statistics.normal_size import size_quantile
from mcnav.statistics.refusals import or_withheld

HALF: Final = 0.5
"""Factor of a number of which the catalogue has no finer grade."""

SAME: Final = 0.999
"""Factor from which on a grade is the number itself."""

BOUND: Final = 1.05
"""Allowance on the largest quantile over rms of a normal vector's length: that with equal sigmas along some axes."""


@dataclass(frozen=True)
class Departing:
    """An output of which the filter departs from the truth, by number, and the time of the worst departure."""

    output: int
    time: float


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
    departing : float
        The true sigma of the output of which the filter departs, over that of the campaign; NaN without one.
    share : float
        Share of the number in the square of what improvements are ranked by; NaN without such a thing.
    """

    slider: Slider
    grade: str
    factor: float
    used: float | None
    sigmas: Array
    departing: float = math.nan
    share: float = math.nan


@dataclass(frozen=True)
class Improvements:
    """All improvements, the best first.

    Attributes
    ----------
    used : float, optional
        Share of its limit that the tightest requirement uses now.
    listed : sequence of Improvement
    unsized : float
        Share of causes that no number sizes in what improvements are ranked by; NaN without such a thing.
    """

    used: float | None
    listed: Sequence[Improvement]
    unsized: float


def improvements(what_if: WhatIf, departing: Departing | None = None) -> Improvements:
    """Find what each number does to what the filter gets wrong, to the tightest requirement, or to all sigmas.

    Parameters
    ----------
    departing : Departing, optional
        What the filter gets wrong: improvements are ranked by their effect on it, and not by requirements.
    """
    sliders, covariance = what_if.campaign.sliders, what_if.covariance
    pairs = zip(what_if.requirements, what_if.known_scales, strict=True)
    sizes = [(errors, scale) for errors, scale in pairs if errors.requirement.kind != "box"]
    limited, known = [errors for errors, _ in sizes], [scale for _, scale in sizes]
    at = None if departing is None else (_reading(covariance, departing.time), departing.output)
    before, ones = covariance.sigma([1.0] * len(sliders)), [1.0] * len(sliders)
    used_now = largest_share(covariance, limited, ones, known)

    def remaining(factors: Sequence[float]) -> float:
        """Return what is left of the square that improvements are ranked by."""
        if at is not None:
            return float((covariance.sigma(factors)[at] / before[at]) ** 2) if before[at] > 0.0 else math.nan
        used = largest_share(covariance, limited, factors, known)
        return (used / used_now) ** 2 if used is not None and used_now else math.nan

    def improvement(number: int, grade: str, factor: float) -> Improvement:
        changed, without = ([*ones[:number], each, *ones[number + 1 :]] for each in (factor, 0.0))
        after = covariance.sigma(changed)
        sigmas = np.divide(after, before, out=np.ones_like(after), where=before > 0.0)
        ratio = math.nan if at is None else float(sigmas[at])
        used = largest_share(covariance, limited, changed, known)
        return Improvement(sliders[number], grade, factor, used, sigmas[-1], ratio, 1.0 - remaining(without))

    offered = [(number, next_finer(slider)) for number, slider in enumerate(sliders)]
    listed = [improvement(number, *finer) for number, finer in offered if finer is not None]
    return Improvements(used_now, sorted(listed, key=_rank), remaining([0.0] * len(sliders)))


def _rank(improvement: Improvement) -> tuple[float, float, float]:
    used = math.inf if improvement.used is None else improvement.used
    departing = 0.0 if math.isnan(improvement.departing) else improvement.departing
    return departing, used, float(improvement.sigmas.min())


def _reading(covariance: ScaledCovariance, time: float) -> int:
    """Return the reading at a time, the last one where no time is known."""
    if np.isnan(covariance.times).all():
        return len(covariance.times) - 1
    return int(np.nanargmin(np.abs(covariance.times - time)))


def next_finer(slider: Slider) -> tuple[str, float] | None:
    """Return the next finer grade and its factor, half where there is none; none of a number that is zero."""
    if slider.sizes[slider.shown].value == 0.0:
        return None
    finer = [(name, factor) for name, factor in slider.grades if 0.0 < factor < SAME]
    return max(finer, key=lambda each: each[1]) if finer else ("", HALF)


def largest_share(
    covariance: ScaledCovariance, limited: Sequence[LimitedErrors], factors: Sequence[float],
    scales: Sequence[float] = (),
) -> float | None:  # fmt: skip
    """Compute the largest share of its limit that a requirement uses for linear normal errors; none without any.

    ``scales`` multiply the errors that each requirement limits.
    """
    if not limited:
        return None
    values, means, largest = covariance.covariance(factors), covariance.mean(factors), 0.0
    for errors, scale in zip(limited, scales or [1.0] * len(limited), strict=True):
        largest = max(largest, scale * _share(covariance, errors, values, means, largest / scale))
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
        quantile = or_withheld(size_quantile, centres[k], matrices[k], probability, instead=math.inf)
        largest = max(largest, quantile)
    return float(largest / required.limits[0])
