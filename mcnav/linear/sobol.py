"""Sobol indices: each source's share of the simulated variance, alone and with all its interactions."""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.special import ndtri

from mcnav.arrays.types import Array, IndexArray
from mcnav.linear.corrections import SobolIndices
from mcnav.linear.partials import AT_ONCE, Propagate, SimulationFailed, simulate_or_raise
from mcnav.sampler.error_model import ErrorModel
from mcnav.sampler.sobol_net import scrambled_net

REPLICATES: Final = 8
"""Independent scrambled nets: their spread gives the indices' errors."""

POINTS: Final = 512
"""Points of each net; a power of two."""

_BITS: Final = 64
"""Binary digits of a coordinate."""


def count_sobol_flights(sources: int, points: int) -> int:
    """Return how many flights the indices of a number of sources with dispersions take."""
    return REPLICATES * points * (sources + 2)


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
        sobol_indices.append(_indices(_exchanged(propagate, a, b, active)))
    stacked: Array = np.array(sobol_indices)  # (replicates, 2, outputs, active)
    mean, error = stacked.mean(axis=0), stacked.std(axis=0, ddof=1) / np.sqrt(REPLICATES)

    def of_all(values: Array) -> Array:
        table = np.zeros((len(values), len(errors.names)))
        table[:, active] = values
        return table

    return SobolIndices(REPLICATES, points, of_all(mean[0]), of_all(error[0]), of_all(mean[1]), of_all(error[1]))


def _exchanged(propagate: Propagate, a: Array, b: Array, active: IndexArray) -> Array:
    """Simulate both sets, shape (points, sources), and the first with each active source of the second."""

    def with_source(j: int) -> Array:
        errors = a.copy()
        errors[:, j] = b[:, j]
        return errors

    sets, together = [*active.tolist()], max(AT_ONCE // len(a), 2)
    simulated = simulate_or_raise(propagate, np.concatenate([a, b, *map(with_source, sets[: together - 2])]))
    outcomes = np.empty((len(sets) + 2, len(a), simulated.shape[1]))
    outcomes[:together] = simulated.reshape(-1, *outcomes.shape[1:])
    for begin in range(together, len(outcomes), together):
        errors = np.concatenate([*map(with_source, sets[begin - 2 : begin - 2 + together])])
        outcomes[begin : begin + together] = simulate_or_raise(propagate, errors).reshape(-1, *outcomes.shape[1:])
    return outcomes


def _indices(simulated: Array) -> tuple[Array, Array]:
    """Estimate first-order and total indices, shape (outputs, sources), zero for a constant output.

    With the outputs f_A and f_B of two independent sets of errors, and f_j of the first with source j of the second,
    ``S_j = mean(f_B (f_j - f_A)) / var`` and ``T_j = mean((f_A - f_j)^2) / (2 var)``, where var is that of both sets.

    Parameters
    ----------
    simulated : ndarray, shape (2 + sources, points, outputs)
        f_A, f_B and each f_j.
    """
    mean = simulated[:2].mean(axis=(0, 1))
    first, second = simulated[:2] - mean
    variance = (simulated[:2] - mean).var(axis=(0, 1))
    shares, totals = np.empty((2, len(simulated) - 2, len(variance)))
    for j, outcomes in enumerate(simulated[2:]):
        moved = outcomes - mean - first
        shares[j], totals[j] = (second * moved).mean(axis=0), 0.5 * (moved**2).mean(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):  # an output that is constant has no shares
        shares, totals = shares / variance, totals / variance
    return np.nan_to_num(shares, posinf=0.0, neginf=0.0).T, np.nan_to_num(totals, posinf=0.0, neginf=0.0).T
