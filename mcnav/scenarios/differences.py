"""Partial derivatives by central differences whose steps are tried out, for scenarios that have nothing better."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav.scenarios.protocol import LinearModel, Outcomes, ScenarioError

Array = NDArray[np.float64]

SHARES: Final = (0.3, 0.1, 0.03, 0.01, 3e-3, 1e-3, 3e-4, 1e-4)
"""Steps that are tried, as shares of each source's sigma. A long one bends with the function, a short one drowns in its
rounding and its integrator's noise; where two neighbours agree best, neither does."""


@dataclass(frozen=True)
class Differences:
    """Partial derivatives and what is known of their error.

    Attributes
    ----------
    model : LinearModel
    error : float
        Largest difference between the steps chosen and their neighbours, as a share of the row's largest contribution
        of one source at its sigma.
    """

    model: LinearModel
    error: float


def differentiated(propagate: Callable[[Array], Outcomes], sizes: Array) -> Differences:
    """Central differences about no errors at all, each source with the step that its neighbour confirms best.

    Parameters
    ----------
    propagate : callable
        Errors, shape (n, sources), to `Outcomes`.
    sizes : ndarray, shape (sources,)
        One sigma of each source, SI, positive.

    Raises
    ------
    ScenarioError
        When the flight without any error fails, or too many of those to the sides.
    """
    count = len(sizes)
    steps = np.outer(SHARES, sizes)
    moved = np.concatenate([np.diag(row) for row in steps])
    outcomes = propagate(np.vstack([np.zeros((1, count)), moved, -moved]))
    if 0 in outcomes.failures:
        raise ScenarioError("type", f"its flight without any error failed: {outcomes.failures[0]}")
    values = outcomes.values
    forward, backward = (part.reshape(len(SHARES), count, -1) for part in np.split(values[1:], 2))
    slopes = (forward - backward) / (2.0 * steps[:, :, None])  # (steps, sources, outputs); NaN where a flight failed
    contributions = np.nan_to_num(np.abs(slopes)) * sizes[:, None]
    scale = contributions[1:].max(axis=1)  # of each output, by the shorter step of each two
    scale = np.where(scale > 0.0, scale, 1.0)
    gaps = (np.abs(np.diff(slopes, axis=0)) * sizes[:, None] / scale[:, None, :]).max(axis=2)  # (steps - 1, sources)
    gaps = np.where(np.isnan(gaps), np.inf, gaps)
    chosen = np.argmin(gaps, axis=0)
    for source in np.flatnonzero(np.isinf(gaps.min(axis=0))):
        reason = next(reason for row, reason in outcomes.failures.items() if row and (row - 1) % count == source)
        raise ScenarioError("type", f"no two steps of source {source + 1} could be flown to both sides: {reason}")
    every = np.arange(count)
    return Differences(LinearModel(slopes[chosen + 1, every].T, values[0]), float(gaps[chosen, every].max()))
