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

from mcnav.analysis.changeable_campaign import Slider
from mcnav.analysis.requirements import size_probability
from mcnav.analysis.what_if import LimitedErrors, ScaledCovariance, WhatIf
from mcnav.arrays.types import Array
from mcnav.statistics.largest_quantiles import largest_quantiles

HALF: Final = 0.5
"""Factor of a number of which the catalogue has no finer grade."""

SAME: Final = 0.999
"""Factor from which on a grade is the number itself."""


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
    """

    slider: Slider
    grade: str
    factor: float
    used: float | None
    sigmas: Array
    departing: float = math.nan


def improvements(what_if: WhatIf, departing: Departing | None = None) -> list[Improvement]:
    """Find what each number does to what the filter gets wrong, to the tightest requirement, or to all sigmas.

    Parameters
    ----------
    departing : Departing, optional
        What the filter gets wrong: improvements are ranked by their effect on it, and not by requirements.

    Returns
    -------
    list of Improvement
        The best first.
    """
    sliders, covariance = what_if.campaign.sliders, what_if.covariance
    at = None if departing is None else (reading_at(covariance, departing.time), departing.output)
    ones = [1.0] * len(sliders)
    offered = [(number, *finer) for number, slider in enumerate(sliders) if (finer := next_finer(slider)) is not None]
    changed = [[*ones[:number], factor, *ones[number + 1 :]] for number, _, factor in offered]
    used, before, listed = shares_used(what_if, changed), covariance.sigma(ones), []
    for place, (number, grade, factor) in enumerate(offered):
        after = covariance.sigma(changed[place])
        sigmas = np.divide(after, before, out=np.ones_like(after), where=before > 0.0)
        listed.append(
            Improvement(
                sliders[number], grade, factor, None if used is None else used[place], sigmas[-1],
                math.nan if at is None else float(sigmas[at]),
            )
        )  # fmt: skip
    return sorted(listed, key=_rank)


def shares_used(what_if: WhatIf, factors: Sequence[Sequence[float]]) -> list[float] | None:
    """Compute the largest share of its limit that a requirement on sizes uses with numbers multiplied; or none."""
    pairs = zip(what_if.requirements, what_if.known_scales, strict=True)
    sizes = [(errors, scale) for errors, scale in pairs if errors.requirement.kind != "box"]
    limited, known = [errors for errors, _ in sizes], [scale for _, scale in sizes]
    return largest_shares(what_if.covariance, limited, factors, known)


def _rank(improvement: Improvement) -> tuple[float, float, float]:
    used = math.inf if improvement.used is None else improvement.used
    departing = 0.0 if math.isnan(improvement.departing) else improvement.departing
    return departing, used, float(improvement.sigmas.min())


def reading_at(covariance: ScaledCovariance, time: float) -> int:
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


def largest_shares(
    covariance: ScaledCovariance, limited: Sequence[LimitedErrors], factors: Sequence[Sequence[float]],
    scales: Sequence[float] = (),
) -> list[float] | None:  # fmt: skip
    """Compute the largest share of its limit that a requirement uses for linear normal errors; none without any.

    Parameters
    ----------
    factors : sequence of sequences of float
        Of the numbers, for each result.
    scales : sequence of float, optional
        Factors of the errors that each requirement limits.
    """
    if not limited:
        return None
    shares = np.zeros(len(factors))
    for errors, scale in zip(limited, scales or [1.0] * len(limited), strict=True):
        laws = [_laws(covariance, errors, factor) for factor in factors]
        means, covariances = (np.array(moments) for moments in zip(*laws, strict=True))
        limit = errors.requirement.limits[0] / scale
        probability = size_probability(errors.requirement)
        shares = largest_quantiles(means, covariances, probability, shares * limit, instead=math.inf)[0] / limit
    return list(map(float, shares))


def _laws(covariance: ScaledCovariance, limited: LimitedErrors, factors: Sequence[float]) -> tuple[Array, Array]:
    """Return means and covariances, at the readings of a requirement, of the errors that it limits."""
    members, readings = list(limited.members), np.array(limited.readings)
    places = [[covariance.entries.index((min(i, j), max(i, j))) for j in members] for i in members]
    means, values = covariance.mean(factors), covariance.covariance(factors)
    return means[readings][:, members] + limited.origin, values[readings][:, places]
