"""Error budgets by simulation: each source alone, all but one, and Sobol indices.

A source alone has the paired variance ``var(y_j) - var(z_j) + P_ij^2 S_jj`` with z the linear errors of the same draws
(see `mcnav.analysis.comparison`); so, with the linear variance of the others, have all sources but one. The others are
held at their means.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.engine import Engine, without_noise
from mcnav.linear.corrections import SimulatedBudget, SobolIndices, SourceBudget, VarianceTable, computed_or_reason
from mcnav.linear.covariance import propagated_covariance
from mcnav.linear.partials import QUICK, Propagate, affordable, require_fast, simulate_or_raise
from mcnav.linear.sobol import POINTS, count_sobol_flights, estimate_sobol_indices
from mcnav.sampler.designs import SamplingDesign
from mcnav.sampler.error_model import ErrorModel
from mcnav.statistics.estimates import blocked_means, paired_squares

DRAWS: Final = 2_000
"""Draws that are simulated twice for each source."""

PROBES: Final = 64
"""Draws from which the engine's accuracy is set."""


def simulated_budgets(
    prepare: Callable[[Array], Engine], errors: ErrorModel, partials: Array, design: str, seed: int, samples: int
) -> SimulatedBudget:
    """Simulate the error budgets of single sources, of all sources but one, and by Sobol indices.

    Parameters
    ----------
    prepare : callable
        Function from probes, shape (n, sources), to an engine.
    partials : ndarray, shape (outputs, sources)
    samples : int
        Samples of the campaign, an upper limit of the draws.
    """
    count = min(DRAWS, samples)
    engine = prepare(errors.draw(design, seed, count, 0, min(PROBES, count)))
    count = min(affordable(DRAWS, engine), samples)

    def alone() -> SourceBudget:
        require_fast(engine)
        return simulate_each_source_alone(without_noise(engine), partials, errors, design, seed, count)

    def sobol() -> SobolIndices:
        require_fast(engine)
        return estimate_sobol_indices(without_noise(engine), errors, seed, affordable(POINTS, engine))

    return SimulatedBudget(computed_or_reason(alone), computed_or_reason(sobol))


def count_flights(engine: Engine, sources: int, samples: int) -> tuple[int, int]:
    """Return how many flights `simulated_budgets` takes of an engine, and in how many calls; none of a slow one."""
    if engine.chunk < QUICK:
        return 0, 0
    count, calls = min(affordable(DRAWS, engine), samples), 2 * sources
    return calls * count + count_sobol_flights(sources, affordable(POINTS, engine)), calls


def simulate_each_source_alone(
    propagate: Propagate, partials: Array, errors: ErrorModel, design: str, seed: int, count: int
) -> SourceBudget:
    """Estimate the variance of each output from each source alone and from all others, SI.

    With the seed of the campaign, a random or antithetic campaign's own first draws are used. Raises `SimulationFailed`
    when a sample fails. A source without dispersion adds nothing and takes nothing away.
    """
    drawn = errors.draw(design, seed, count, 0, count)
    sampling = SamplingDesign.of(design, count)
    blocks = sampling.blocks(np.arange(count))
    alone = VarianceTable(np.zeros(partials.shape), np.zeros(partials.shape))
    without = VarianceTable(np.zeros(partials.shape), np.zeros(partials.shape))
    without.variance[:] = np.diag(propagated_covariance(partials, errors.covariance))[:, None]
    freedom = 0.0
    linear_mean, linear = partials @ errors.mean, drawn @ partials.T
    for j in np.flatnonzero(errors.standard_deviations > 0.0):
        by_source = np.multiply.outer(drawn[:, j] - errors.mean[j], partials[:, j])
        only = np.arange(partials.shape[1]) == j
        for table, varied, known in ((alone, only, linear_mean + by_source), (without, ~only, linear - by_source)):
            some = np.where(varied, drawn, errors.mean)
            covariance = np.where(np.outer(varied, varied), errors.covariance, 0.0)
            expected = np.diag(propagated_covariance(partials, covariance))
            squares = paired_squares(simulate_or_raise(propagate, some), known)
            mean = blocked_means(squares, blocks, sampling.fewest_blocks)
            table.variance[:, j] = expected + mean.values
            table.standard_error[:, j], freedom = mean.standard_errors, mean.degrees_of_freedom
    return SourceBudget(count, freedom, alone, without)
