"""Several records of one instrument: noise in common, whether they agree, and the repeatability of the bias.

Records with the same interval between readings are independent given the noise, and each has a mean of its own: their
likelihoods multiply. That they have the noise in common is tested by what −2 log L loses, χ² with as many degrees of
freedom as there are parameters besides the common ones. The standard deviation s of the R means has the interval
``s √((R − 1)/χ²)``; each mean is itself known to its own accuracy, which is part of s.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from mcnav.arrays.types import Array
from mcnav.identification.estimates import Candidate
from mcnav.identification.fit import AxisFit
from mcnav.identification.likelihood import Maximum, maximize
from mcnav.identification.processes import Grid, Model
from mcnav.identification.spectrum import Bands


@dataclass(frozen=True)
class CommonNoise:
    """Noise of several records in common.

    Attributes
    ----------
    fitted : AxisFit
        Models at the maxima of the likelihood of all records, with the first of these.
    p_value : float
        Of the hypothesis that the records have the noise of the chosen one in common.
    """

    fitted: AxisFit
    p_value: float


def common_noise(fits: Sequence[AxisFit]) -> CommonNoise:
    """Fit one noise model to several records of one axis, with the same interval.

    Models are chosen as for one record: by their likelihood of all records, and their number of parameters.
    """
    joint = [_joint(fits, candidate.model) for candidate in fits[0].candidates]
    fitted = AxisFit(fits[0].record, tuple(sorted(joint, key=lambda candidate: candidate.criterion)))
    chosen = fitted.chosen
    alone = sum(_of_model(fit, chosen.model).best.deviance for fit in fits)
    freedom = (len(fits) - 1) * len(chosen.best.logs)
    return CommonNoise(fitted, float(chi2.sf(max(chosen.best.deviance - alone, 0.0), freedom)))


def _of_model(fitted: AxisFit, model: Model) -> Candidate:
    return next(candidate for candidate in fitted.candidates if candidate.model == model)


def _joint(fits: Sequence[AxisFit], model: Model) -> Candidate:
    """Maximize the product of the likelihoods, from the best of the records' own maxima."""
    each = [_of_model(fitted, model) for fitted in fits]
    bands = stacked([candidate.bands for candidate in each])
    starts: list[Maximum] = [maximize(model, bands, candidate.best.logs) for candidate in each]
    return Candidate(model, min(starts, key=lambda start: start.deviance), bands)


def stacked(bands: Sequence[Bands]) -> Bands:
    """Put bands of several records one behind the other; they have the same interval."""
    counts = np.concatenate([np.full(len(one.numbers), one.grid.count) for one in bands])
    grid = Grid(bands[0].grid.interval, counts, np.concatenate([one.grid.order for one in bands]))
    return Bands(grid, np.concatenate([one.numbers for one in bands]), np.concatenate([one.sums for one in bands]))


@dataclass(frozen=True)
class Repeatability:
    """Standard deviation of the means of R records, with its 95 % interval, in the unit of the readings."""

    means: Array
    value: float
    low: float
    high: float


def repeatability(means: Array) -> Repeatability:
    """Compute the standard deviation of means, shape (R,), R at least two, with its interval."""
    freedom = len(means) - 1
    value = float(np.std(means, ddof=1))
    low, high = (value * float(np.sqrt(freedom / chi2.ppf(level, freedom))) for level in (0.975, 0.025))
    return Repeatability(means, value, low, high)
