"""Sobol indices: each source's share of the simulated variance, alone and with all its interactions."""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.special import ndtri

from mcnav.arrays.types import Array
from mcnav.linear.corrections import SobolIndices
from mcnav.linear.partials import Propagate, SimulationFailed, simulate_or_raise
from mcnav.sampler.error_model import ErrorModel
from mcnav.sampler.sobol_net import scrambled_net

REPLICATES: Final = 8
"""Independent scrambled nets: their spread gives the indices' errors."""

POINTS: Final = 512
"""Points of each net; a power of two."""

_BITS: Final = 64
"""Binary digits of a coordinate."""


def estimate_sobol_indices(propagate: Propagate, errors: ErrorModel, seed: int, points: int = POINTS) -> SobolIndices:
    """Estimate first-order and total Sobol indices of every output (Saltelli et al., 2010; Jansen's total index).

    Parameters
    ----------
    points : int
        Of each net; a power of two.

    They are zero for a source without dispersion. Raises `SimulationFailed` when the sources are correlated, so that
    the shares are undefined, or a sample fails.
    """
    active = np.flatnonzero(errors.standard_deviations > 0.0)
    if not errors.independent:
        raise SimulationFailed("the sources depend on one another: their shares of the variance are not defined")
    if active.size == 0:
        raise SimulationFailed("no source has a dispersion")

    sobol_indices = []
    for replicate in range(REPLICATES):
        generator = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(replicate,)))
        uniforms = scrambled_net(generator, 2 * active.size, 0, points, _BITS)
        normals = ndtri(np.clip(uniforms, 2.0**-54, 1.0 - 2.0**-53))
        a, b = np.tile(errors.mean, (2, points, 1))
        for place, j in enumerate(active):
            a[:, j] = errors.distributions[j].transform(normals[:, place])
            b[:, j] = errors.distributions[j].transform(normals[:, active.size + place])
        exchanged = np.tile(a, (active.size, 1, 1))
        exchanged[np.arange(active.size), :, active] = b[:, active].T
        simulated = simulate_or_raise(propagate, np.concatenate([a, b, exchanged.reshape(-1, a.shape[1])]))
        sobol_indices.append(_indices(simulated.reshape(active.size + 2, points, -1)))
    stacked: Array = np.array(sobol_indices)  # (replicates, 2, outputs, active)
    mean, error = stacked.mean(axis=0), stacked.std(axis=0, ddof=1) / np.sqrt(REPLICATES)

    def of_all(values: Array) -> Array:
        table = np.zeros((len(values), len(errors.names)))
        table[:, active] = values
        return table

    return SobolIndices(REPLICATES, points, of_all(mean[0]), of_all(error[0]), of_all(mean[1]), of_all(error[1]))


def _indices(simulated: Array) -> tuple[Array, Array]:
    """Estimate first-order and total indices, shape (outputs, sources), zero for a constant output.

    With the outputs f_A and f_B of two independent sets of errors, and f_j of the first with source j of the second,
    ``S_j = mean(f_B (f_j - f_A)) / var`` and ``T_j = mean((f_A - f_j)^2) / (2 var)``, where var is that of both sets.

    Parameters
    ----------
    simulated : ndarray, shape (2 + sources, points, outputs)
        f_A, f_B and each f_j.
    """
    simulated = simulated - simulated[:2].mean(axis=(0, 1))
    first, second, exchanged = simulated[0], simulated[1], simulated[2:]
    variance = simulated[:2].var(axis=(0, 1))
    with np.errstate(invalid="ignore", divide="ignore"):  # an output that is constant has no shares
        shares = (second * (exchanged - first)).mean(axis=1) / variance
        totals = 0.5 * ((first - exchanged) ** 2).mean(axis=1) / variance
    return np.nan_to_num(shares, posinf=0.0, neginf=0.0).T, np.nan_to_num(totals, posinf=0.0, neginf=0.0).T
