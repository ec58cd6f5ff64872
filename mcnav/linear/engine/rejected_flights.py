"""Flights of a filter along a timeline that begin with their first rejection of a good measurement.

A filter that accepts all measurements has whitened innovations w that are independent standard normals, and after each
update errors z that are independent of those so far. A filter of the same measurements, some of which it rejects, errs
by ``z + delta`` and has the covariance P + D (`mcnav.linear.engine.rejections`). With J = L^-1 H, V = K L and
``G = (1 + J D J')^-1`` ::

    over a step     delta' = F delta                D' = F D F'
    it rejects where (w + J delta)' G (w + J delta) is above the limit:
                    delta+ = delta + V w            D+ = D + V V'
    and else        delta+ = delta + V w - (V + D J') G (w + J delta)
                    D+ = (1 - V J) (D - D J' G J D) (1 - V J)'

A flight is delta = 0, D = 0 until its first rejection, whose update is drawn by its exact probability and whose w from
the tail beyond the limit. Nothing else is random but w: an output with the rows C has the mean square
``C P C' + E[(C delta)^2]`` exactly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from mcnav.arrays.products import transform
from mcnav.arrays.types import Array, IndexArray
from mcnav.execution.threads import one_thread
from mcnav.linear.engine.rejections import WhitenedFilter, outputs_after_updates

SEED = 1_968
"""Seed of these flights."""


@dataclass(frozen=True)
class GateOdds:
    """Gates at U updates.

    Attributes
    ----------
    chances : ndarray, shape (U,)
        Probability that a good measurement is rejected; zero without a gate.
    limits : ndarray, shape (U,)
        Normalized innovation squared up to which it is accepted; infinite without a gate.
    sizes : ndarray of int, shape (U,)
        Components.
    """

    chances: Array
    limits: Array
    sizes: IndexArray


def fly_rejections(whitened: WhitenedFilter, odds: GateOdds, positions: IndexArray, count: int) -> tuple[Array, Array]:
    """Simulate flights that begin with a first rejection.

    Parameters
    ----------
    positions : ndarray of int, shape (R,)
        Of readings, rising.

    Returns
    -------
    excess, error : ndarray, shape (R, o)
        What rejections add to the mean squares of the outputs, of all flights with and without any, and the standard
        error of that.
    """
    timeline = whitened.timeline
    generator = np.random.default_rng(SEED)
    before = np.concatenate([[1.0], np.cumprod(1.0 - odds.chances)])
    any_rejected = 1.0 - before[-1]
    levels = any_rejected * (np.arange(count) + generator.random(count)) / count
    firsts = np.minimum(np.searchsorted(1.0 - before[1:], levels), len(odds.chances) - 1)
    reached = timeline.updates_before[positions]
    rows = [outputs_after_updates(timeline, position) for position in positions.tolist()]
    flights = _Flights.none(count, whitened.gains.shape[1])
    squares = np.zeros((len(positions), count, len(rows[0])))
    with one_thread(), np.errstate(invalid="ignore"):
        for u in range(int(reached.max(initial=0))):
            begun = int(np.searchsorted(firsts, u, side="right"))
            if begun:
                w = generator.standard_normal((begun, whitened.gains.shape[2]))
                w[:, odds.sizes[u] :] = 0.0
                new = firsts[:begun] == u
                w[new] *= _tail(generator.random(int(new.sum())), odds, u, w[new])
                flights.pass_update(whitened, u, w, new, float(odds.limits[u]))
            for reading in np.flatnonzero(reached == u + 1).tolist():
                squares[reading] = (flights.errors @ rows[reading].T) ** 2
    spread = squares.std(axis=1, ddof=1) / np.sqrt(count)
    return any_rejected * squares.mean(axis=1), any_rejected * spread


def _tail(levels: Array, odds: GateOdds, update: int, normals: Array) -> Array:
    """Return the factors that bring normals, shape (n, M), to lengths from the tail beyond a limit, shape (n, 1)."""
    squares = special.chdtri(float(odds.sizes[update]), np.maximum(levels, 1e-16) * odds.chances[update])
    return np.asarray(np.sqrt(squares)[:, None] / np.linalg.norm(normals, axis=1, keepdims=True))


@dataclass
class _Flights:
    """What flights differ by from the filter that accepts all: delta, shape (n, f), and D, shape (n, f, f)."""

    errors: Array
    excess: Array

    @classmethod
    def none(cls, count: int, size: int) -> _Flights:
        """Return flights without a rejection so far."""
        return cls(np.zeros((count, size)), np.zeros((count, size, size)))

    def pass_update(self, whitened: WhitenedFilter, u: int, w: Array, new: NDArray[np.bool_], limit: float) -> None:
        """Pass the step to an update and the update, with the whitened innovations of the first flights."""
        begun, step, row, gain = len(w), whitened.steps[u], whitened.rows[u], whitened.gains[u]
        delta, excess = self.errors[:begun] @ step.T, _transformed(self.excess[:begun], step)
        seen = excess @ row.T
        inverse = np.linalg.inv(np.eye(len(row)) + transform(row, excess))
        innovations = w + delta @ row.T
        weighed = np.einsum("nij,nj->ni", inverse, innovations)
        rejected = new | (np.sum(innovations * weighed, axis=1) > limit)
        accepted = ~rejected
        delta += w @ gain.T
        delta[accepted] -= np.einsum("nfi,ni->nf", gain + seen[accepted], weighed[accepted])
        kept = excess[accepted] - transform(seen[accepted], inverse[accepted])
        excess[accepted] = _transformed(kept, np.eye(len(gain)) - gain @ row)
        excess[rejected] += gain @ gain.T
        self.errors[:begun], self.excess[:begun] = delta, excess


def _transformed(covariances: Array, matrix: Array) -> Array:
    """Return A C A' of symmetric covariances, shape (n, f, f)."""
    count, size, _ = covariances.shape
    once = (covariances.reshape(-1, size) @ matrix.T).reshape(count, size, size)
    return np.asarray((once.swapaxes(1, 2).reshape(-1, size) @ matrix.T).reshape(count, size, size))
