"""Errors that a gate leaves when it rejects good measurements, of a filter along a timeline.

Where a filter believes the truth and estimates all that it believes in, the errors z of its states after an update are
independent of the innovation ``n = L w`` (S = L L', w of covariance one). Rejected, the measurement leaves the errors
``z + V w`` with V = K L, and the filter the covariance P + D with ``D = V V'``. With J = L^-1 H and the gains of a
filter that accepts all, D goes on by ::

    over a step     D' = F D F'
    accepted        D+ = (1 - V J) (1 + D J'J)^-1 D (1 - V J)'
    rejected        D+ = D + V V'

(differences of two solutions of one Riccati equation). The outputs at a later position have the excess of variance
``C + A (1 + D B)^-1 D A'`` and respond to the errors by ``A (1 + D B)^-1``, where A, B and C run backwards::

    over a step     A F                     F' B F
    accepted        A (1 - V J)             J'J + (1 - V J)' B (1 - V J)
    rejected        A - E (B V)'            B - B V G (B V)'                C + E V' A'

with ``G = (1 + V' B V)^-1`` and ``E = A V G``. A first rejection has D = V V': the response E to w, and the excess
``C + E V' A'``. One pass therefore has the first rejections at all updates, each with the gains of its own filter, and
all readings are passed at the same time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.products import innovation_covariance, transform
from mcnav.arrays.types import Array, IndexArray
from mcnav.contract.timeline import Timeline
from mcnav.execution.threads import one_thread
from mcnav.linear.engine.checks import check_positions
from mcnav.linear.engine.design import Design, filter_of
from mcnav.linear.engine.innovations import positions_of
from mcnav.linear.engine.propagate import readout_maps
from mcnav.linear.engine.transitions import bounds


@dataclass(frozen=True)
class WhitenedFilter:
    """A filter with whitened innovations at U updates.

    Attributes
    ----------
    rows, gains : ndarray, shapes (U, M, f), (U, f, M)
        ``J = L^-1 H`` and ``V = K L``, zero beyond the components of an update.
    steps : ndarray, shape (U, f, f)
        F from the update before, or from the start, to each.
    """

    timeline: Timeline
    rows: Array
    gains: Array
    steps: Array

    @classmethod
    def of(cls, timeline: Timeline, designed: Design) -> WhitenedFilter:
        """Whiten the filter of a timeline.

        Raises
        ------
        ValueError
            Without a filter or updates; with considered states, whose innovations are not independent.
        """
        filtered, updates = filter_of(timeline), timeline.updates
        if updates is None:
            raise ValueError("timeline: has no updates")
        if not filtered.corrected.all():
            raise ValueError("rejections: expected a filter without considered states")
        most = filtered.responses.shape[1]
        unused = np.arange(most) >= updates.sizes[:, None]
        # a root of one where there is no component, whose rows and gains are zero
        roots = np.where(unused[:, :, None] | unused[:, None, :], np.eye(most), designed.roots[:])
        rows = np.where(unused[:, :, None], 0.0, filtered.responses[:])
        with one_thread():
            return cls(timeline, np.linalg.solve(roots, rows), designed.gains[:] @ roots, _between_updates(timeline))


def _between_updates(timeline: Timeline) -> Array:
    """Return the products of F up to each update from the one before."""
    filtered = filter_of(timeline)
    size = len(filtered.covariance)
    products, product, u = np.empty((filtered.responses.shape[0], size, size)), np.eye(size), 0
    for first, last in bounds(0, timeline.end):
        number, steps = 0, filtered.steps(*timeline.steps_before[[first, last]].tolist()).transitions
        for is_update in timeline.is_update[first:last].tolist():
            if is_update:
                products[u], product, u = product, np.eye(size), u + 1
            else:
                product, number = steps[number] @ product, number + 1
    return products


@dataclass(frozen=True)
class Rejected:
    """Errors of o outputs at R readings, of flights whose first rejection is at an update.

    Attributes
    ----------
    excess : ndarray, shape (R, U, o)
        Of variance; zero for updates after a reading.
    responses : ndarray, shape (R, U, o, M)
        To the whitened innovation.
    """

    excess: Array
    responses: Array


def rejected_errors(whitened: WhitenedFilter, positions: IndexArray, later: NDArray[np.bool_]) -> Rejected:
    """Compute the errors of the outputs at positions, of flights whose first rejection is at each of the updates.

    Parameters
    ----------
    positions : ndarray of int, shape (R,)
        Of readings, rising.
    later : ndarray of bool, shape (U,)
        Updates that are rejected after the first rejection as well.
    """
    timeline, gains = whitened.timeline, whitened.gains
    number, size, most = gains.shape
    check_positions(timeline, positions)
    to_outputs = [outputs_after_updates(timeline, position) for position in positions.tolist()]
    outputs = len(readout_maps(timeline)(0))
    excess = np.zeros((len(positions), number, outputs))
    responses = np.zeros((len(positions), number, outputs, most))
    reached = timeline.updates_before[positions]
    seen = whitened.rows @ whitened.steps  # J F
    accepted = whitened.steps - gains @ seen  # (1 - V J) F
    # of the readings after an update, which are the last ones
    a, b, c = np.zeros((0, outputs, size)), np.zeros((0, size, size)), np.zeros((0, outputs))
    one = np.eye(most)
    with one_thread():
        for u in range(int(reached.max(initial=0)) - 1, -1, -1):
            begun = int(np.searchsorted(reached, u, side="right"))
            if (added := len(positions) - begun - len(a)) > 0:
                a = np.concatenate([np.array(to_outputs[begun : begun + added]), a])
                b, c = (np.concatenate([np.zeros((added, *table.shape[1:])), table]) for table in (b, c))
            vb, inner = innovation_covariance(b, gains[u].T)
            av, inverse = a @ gains[u], np.asarray(np.linalg.inv(one + inner), dtype=np.float64)  # A V, G
            of_update = av @ inverse
            responses[begun:, u] = of_update
            excess[begun:, u] = c + np.einsum("roe,roe->ro", of_update, av)
            if later[u]:
                a, c = (a - of_update @ vb) @ whitened.steps[u], excess[begun:, u]
                if vb.any():  # B is zero where all measurements are rejected
                    b = b - transform(vb.swapaxes(1, 2), inverse)
                if b.any():
                    b = transform(whitened.steps[u].T, b)
            else:
                a, b = a @ accepted[u], transform(accepted[u].T, b) + seen[u].T @ seen[u]
    return Rejected(excess, responses)


def outputs_after_updates(timeline: Timeline, position: int) -> Array:
    """Return the outputs at a position by the filter's states after the last update before it, shape (o, f)."""
    filtered = filter_of(timeline)
    rows = readout_maps(timeline)(position) @ filtered.place
    last = timeline.updates_before[position]
    first = int(positions_of(timeline, np.array([last - 1]))[0]) + 1 if last else 0
    steps = filtered.steps(*timeline.steps_before[[first, position]].tolist()).transitions
    for transition in steps[::-1]:
        rows = rows @ transition
    return np.asarray(rows)


def next_correlations(whitened: WhitenedFilter, updates: IndexArray, following: IndexArray) -> Array:
    """Compute the canonical correlations of innovations with a later one each after a rejection.

    The later innovation, whitened by the S of the filter that accepts all, responds to w by ``A = J T`` where T is
    carried on from V. With Y, the sum of what the measurements between say of w, it is ``A (1 + Y)^-1 w`` plus what is
    independent of w, and the filter that rejected believes in the covariance ``1 + A (1 + Y)^-1 A'``.

    Parameters
    ----------
    updates, following : ndarray of int, shape (u,)
        Numbers of updates that are rejected, and of later ones.

    Returns
    -------
    ndarray, shape (u, M)
        The largest first.
    """
    gains, steps, rows = whitened.gains, whitened.steps, whitened.rows
    most = gains.shape[2]
    carried, told, seen = gains[updates], np.zeros((len(updates), most, most)), np.zeros((len(updates), most, most))
    left, reached = np.arange(len(updates)), updates
    with one_thread():
        while len(left):
            reached = reached + 1
            carried = steps[reached] @ carried
            innovations = rows[reached] @ carried
            ended = reached == following[left]
            seen[left[ended]] = innovations[ended]
            told[left] += np.where(ended[:, None, None], 0.0, innovations.swapaxes(1, 2) @ innovations)
            carried = (carried - gains[reached] @ innovations)[~ended]
            left, reached = left[~ended], reached[~ended]
        weighed = np.linalg.solve(np.eye(most) + told, seen.swapaxes(1, 2)).swapaxes(1, 2)
        roots = np.linalg.cholesky(np.eye(most) + weighed @ seen.swapaxes(1, 2))
        correlations = np.linalg.svd(np.linalg.solve(roots, weighed), compute_uv=False)
    return np.asarray(np.minimum(correlations, 1.0))
