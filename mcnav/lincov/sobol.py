"""Sobol indices: each source's share of the simulated variance, alone and with all its interactions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from scipy.special import ndtri

from mcnav._types import Array
from mcnav.lincov.partials import Propagate, SimulationFailed, simulate_or_raise
from mcnav.sampling.distributions import Distribution
from mcnav.sampling.error_model import ErrorModel

REPLICATES: Final = 8
"""Independent scrambled nets: their spread gives the indices' errors."""

POINTS: Final = 512
"""Points of each net; a power of two."""


@dataclass(frozen=True)
class _Quantile:
    """Distribution in the form that `scipy.stats.sobol_indices` requires."""

    distribution: Distribution

    def ppf(self, probability: Array) -> Array:
        """Return the quantiles of some probabilities."""
        return self.distribution.transform(ndtri(np.clip(probability, 2.0**-54, 1.0 - 2.0**-53)))


def estimate_sobol_indices(propagate: Propagate, errors: ErrorModel, seed: int) -> dict[str, Any]:
    """Estimate first-order and total Sobol indices of every output (Saltelli et al., 2010; Jansen's total index).

    Raises `SimulationFailed` when the sources are correlated, so that the shares are undefined, or a sample fails.

    Returns
    -------
    dict
        ``replicates``, ``points``, and ``first_order``, ``total`` with their ``..._standard_error``, shape (outputs,
        sources); zero for a source without dispersion.
    """
    from scipy.stats import sobol_indices  # slow to import: half a second

    active = np.flatnonzero(errors.standard_deviations > 0.0)
    if not errors.independent:
        raise SimulationFailed("the sources depend on one another: their shares of the variance are not defined")
    if active.size == 0:
        raise SimulationFailed("no source has a dispersion")

    count = simulate_or_raise(propagate, errors.mean[None, :]).shape[1]

    def outputs(values: Array) -> Array:
        some = np.tile(errors.mean, (values.shape[1], 1))
        some[:, active] = values.T
        simulated = simulate_or_raise(propagate, some).T
        return np.repeat(simulated, 2, axis=0) if count == 1 else simulated  # scipy fails for a single constant output

    quantiles = [_Quantile(errors.distributions[j]) for j in active]
    found: list[list[Array]] = []
    for replicate in range(REPLICATES):
        generator = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(replicate,)))
        with np.errstate(invalid="ignore", divide="ignore"):  # an output that is constant has no shares
            one = sobol_indices(func=outputs, n=POINTS, dists=quantiles, rng=generator)
        found.append([np.reshape(order, (-1, active.size))[:count] for order in (one.first_order, one.total_order)])
    stacked: Array = np.array(found)  # (replicates, 2, outputs, active)
    mean, error = stacked.mean(axis=0), stacked.std(axis=0, ddof=1) / np.sqrt(REPLICATES)
    tables: dict[str, Any] = {"replicates": REPLICATES, "points": POINTS}
    for number, key in enumerate(("first_order", "total")):
        for name, values in ((key, mean[number]), (f"{key}_standard_error", error[number])):
            tables[name] = np.zeros((values.shape[0], len(errors.names)))
            tables[name][:, active] = values
    return tables
