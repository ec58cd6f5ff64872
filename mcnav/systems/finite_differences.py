"""Partial derivatives by central differences whose steps are tried out, for scenarios that have nothing better."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array
from mcnav.contract.linear import LinearModel
from mcnav.contract.samples import SimulationResult
from mcnav.contract.scenario import ScenarioError

SHARES: Final = (0.3, 0.1, 0.03, 0.01, 3e-3, 1e-3, 3e-4, 1e-4)
"""Steps that are tried, as shares of each source's sigma. A long one bends with the function, a short one drowns in its
rounding and its integrator's noise; where two neighbours agree best, neither does."""


BY_CHANCE: Final = 1e-3
"""Two steps that agree while neither of their neighbours comes nearer than this agree by chance."""

SHORT: Final = 1e-3
"""Steps up to this share of sigma must not move an output to the same side both ways: curvature does so by 1e-6 of its
own effect at sigma, a kink by 1e-3, noise and jumps by their whole size. Central differences see none of it."""

ROUNDING: Final = 100.0 * np.finfo(float).eps
"""Share of an output's own size within which samples agree that differ by rounding alone."""


@dataclass(frozen=True)
class DifferencedModel:
    """Partial derivatives and what is known of their error.

    Attributes
    ----------
    error : float
        Largest difference between the steps chosen and their neighbours, as a share of the row's largest contribution
        of one source at its sigma.
    contributions : ndarray, shape (steps, sources, outputs)
        Effect of one sigma of each source as each step has it, SI; NaN where a flight failed.
    chosen : ndarray of int, shape (sources,)
        The longer of the two steps that agree best; the model has the derivatives of the shorter.
    moved : ndarray, shape (sources, outputs)
        Least scale of an output, SI: how far the source's steps moved it, and what rounding does.
    uneven : ndarray, shape (sources, outputs)
        How far the short steps moved an output to the same side both ways at most, SI.
    """

    model: LinearModel
    error: float
    contributions: Array
    chosen: NDArray[np.intp]
    moved: Array
    uneven: Array

    def disagreement(self, sources: NDArray[np.bool_]) -> Array:
        """Compare the chosen derivatives with those of neighbouring steps, three together, and short steps both ways.

        Two steps of a noisy function agree by chance at one time in a few hundred, three at one in many thousands.

        Parameters
        ----------
        sources : ndarray of bool, shape (sources,)
            Those whose errors differ from zero; a row's largest contribution is taken over them.

        Returns
        -------
        ndarray, shape (outputs, sources)
            The larger difference as a share of the row's largest contribution of one sigma; zero for the other sources.
        """
        every = np.arange(len(sources))
        gaps = np.abs(np.diff(self.contributions, axis=0))
        gaps = np.where(np.isnan(gaps), np.inf, gaps)
        disagreement = _of_three(gaps)[self.chosen, every]  # (sources, outputs)
        largest = np.maximum(np.abs(self.contributions[self.chosen + 1, every]), self.moved)[sources]
        scale = largest.max(axis=0, initial=0.0)
        shares = np.maximum(disagreement, self.uneven) / np.where(scale > 0.0, scale, 1.0)
        return np.asarray(np.where(sources[:, None], shares, 0.0).T)


def differentiate(propagate: Callable[[Array], SimulationResult], sizes: Array) -> DifferencedModel:
    """Differentiate centrally about no errors, each source with the step that its neighbour confirms best.

    Parameters
    ----------
    propagate : callable
        Errors, shape (n, sources), to `SimulationResult`.
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
    forward, backward = (piece.reshape(len(SHARES), count, -1) for piece in np.split(values[1:], 2))
    slopes = (forward - backward) / (2.0 * steps[:, :, None])  # (steps, sources, outputs); NaN where a flight failed
    moved = _moved(values[0], forward, backward)
    contributions = np.nan_to_num(np.abs(slopes)) * sizes[:, None]
    scale = contributions[1:].max(axis=1)  # of each output, by the shorter step of each two
    scale = np.maximum(scale, moved.max(axis=0))
    scale = np.where(scale > 0.0, scale, 1.0)
    gaps = (np.abs(np.diff(slopes, axis=0)) * sizes[:, None] / scale[:, None, :]).max(axis=2)  # (steps - 1, sources)
    gaps = np.where(np.isnan(gaps), np.inf, gaps)
    chosen, every = np.argmin(gaps, axis=0), np.arange(count)
    three = _of_three(gaps)
    chosen = np.where(three[chosen, every] <= BY_CHANCE, chosen, np.argmin(three, axis=0))
    for source in np.flatnonzero(np.isinf(gaps.min(axis=0))):
        reason = next(reason for row, reason in outcomes.failures.items() if row and (row - 1) % count == source)
        raise ScenarioError("type", f"no two steps of source {source + 1} could be flown to both sides: {reason}")
    model = LinearModel(slopes[chosen + 1, every].T, values[0])
    return DifferencedModel(
        model,
        float(gaps[chosen, every].max()),
        slopes * sizes[:, None],
        chosen,
        moved,
        _uneven(values[0], forward, backward),
    )


def _of_three(gaps: Array) -> Array:
    """Find the largest gap of each pair of steps and the better of its neighbours; its own where it has none.

    Parameters
    ----------
    gaps : ndarray, shape (steps - 1, ...)
        Infinite where a flight failed.
    """
    edge = np.full_like(gaps[:1], np.inf)
    third = np.minimum(np.concatenate([edge, gaps[:-1]]), np.concatenate([gaps[1:], edge]))
    return np.where(np.isinf(third), gaps, np.maximum(gaps, third))


def _uneven(nominal: Array, forward: Array, backward: Array) -> Array:
    """Compute the largest part of a short step's effect that is the same to both sides, shape (sources, outputs)."""
    short = np.array(SHARES) <= SHORT
    both = 0.5 * (forward[short] + backward[short]) - nominal
    return np.asarray(np.nan_to_num(np.abs(both)).max(axis=0))


def _moved(nominal: Array, forward: Array, backward: Array) -> Array:
    """Scale an output where it has no slope: how far it moved, and rounding as the shortest step magnifies it.

    A linear function moves by less than one sigma's effect, since all steps are shorter than sigma: then this is no
    scale. A quadratic one has differences of zero to rounding, which must not be measured by rounding.

    Returns
    -------
    ndarray, shape (sources, outputs)
    """
    both = np.concatenate([forward, backward])
    moved = np.nan_to_num(np.abs(both - nominal)).max(axis=0)
    size = np.nan_to_num(np.abs(both)).max(axis=(0, 1))
    return np.asarray(np.maximum(moved, ROUNDING / min(SHARES) * size))
