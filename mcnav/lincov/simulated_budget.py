"""Error budget by simulation: each source alone, and all but one, on the same draws.

A source alone has the paired variance ``var(y_j) - var(z_j) + P_ij^2 S_jj`` with z the linear errors of the same draws
(see `mcnav.analysis.comparison`); so, with the linear variance of the others, have all sources but one. The others are
held at their means.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final

import numpy as np

from mcnav._types import Array, IndexArray
from mcnav.lincov.covariance import propagated_covariance
from mcnav.lincov.partials import Propagate, simulate_or_raise
from mcnav.sampling.designs import SamplingDesign
from mcnav.sampling.error_model import ErrorModel
from mcnav.statistics.estimates import Estimate, blocked_mean

DRAWS: Final = 2_000
"""Draws that are simulated twice for each source."""


def simulate_each_source_alone(
    propagate: Propagate, partials: Array, errors: ErrorModel, design: str, seed: int, count: int
) -> dict[str, Any]:
    """Estimate the variance of each output from each source alone and from all others, SI.

    Parameters
    ----------
    partials : ndarray, shape (outputs, sources)
    seed : int
        Seed of the campaign, so that a random or antithetic campaign's own first draws are used.

    Returns
    -------
    dict
        ``samples``, ``degrees_of_freedom``, and for ``alone`` and ``without`` each ``variance`` and ``standard_error``,
        shape (outputs, sources); a source without dispersion adds nothing and takes nothing away.

    Raises
    ------
    SimulationFailed
        When a sample fails.
    """
    drawn = errors.draw(design, seed, count, 0, count)
    sampling = SamplingDesign.of(design, count)
    blocks, fewest = sampling.blocks(np.arange(count)), sampling.fewest_blocks
    shape = partials.shape
    tables = {key: (np.zeros(shape), np.zeros(shape)) for key in ("alone", "without")}
    linear = np.diag(propagated_covariance(partials, errors.covariance))
    tables["without"][0][:] = linear[:, None]
    freedom = 0.0
    for j in np.flatnonzero(errors.standard_deviations > 0.0):
        only = np.zeros(shape[1], dtype=bool)
        only[j] = True
        for key, kept in (("alone", only), ("without", ~only)):
            some = np.where(kept, drawn, errors.mean)
            covariance = np.where(np.outer(kept, kept), errors.covariance, 0.0)
            expected = np.diag(propagated_covariance(partials, covariance))
            simulated, predicted = simulate_or_raise(propagate, some), some @ partials.T
            for i in range(shape[0]):
                found = _paired_variance(simulated[:, i], predicted[:, i], float(expected[i]), blocks, fewest)
                tables[key][0][i, j], tables[key][1][i, j] = found.value, found.standard_error
                freedom = found.degrees_of_freedom
    return {
        "samples": count,
        "degrees_of_freedom": freedom,
        **{key: {"variance": variance, "standard_error": error} for key, (variance, error) in tables.items()},
    }


def _paired_variance(
    simulated: Array, predicted: Array, expected: float, blocks: IndexArray, fewest: float
) -> Estimate:
    unbiased = len(simulated) / (len(simulated) - 1.0)
    squares = (simulated - simulated.mean()) ** 2 - (predicted - predicted.mean()) ** 2
    difference = blocked_mean(unbiased * squares, blocks, fewest)
    return replace(difference, value=expected + difference.value)
