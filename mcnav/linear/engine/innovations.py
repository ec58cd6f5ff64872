"""Joint law of an innovation and of the outputs' errors after its update.

    n = H X + D c + v        X+ = X - M K n        y = C X+

An error b of the measurement takes b from n and adds ``C M K b`` to y. The law is that of a navigator that takes every
measurement: it is exact up to the first one that is rejected.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mcnav.arrays.products import transform
from mcnav.arrays.rows import Table, rows_at
from mcnav.arrays.types import Array, IndexArray
from mcnav.contract.timeline import Start, Steps, Timeline, Updates
from mcnav.linear.engine.checks import check_updates
from mcnav.linear.engine.design import filter_of
from mcnav.linear.engine.propagate import Propagated, propagate, readout_maps


@dataclass(frozen=True)
class InnovationLaw:
    """Joint law of an innovation with m components and of o outputs after its update.

    Attributes
    ----------
    size : int
        m.
    partials : ndarray, shape (m + o, s + 1)
        Of both, the innovation first, to the error sources and to what is deterministic.
    noise : ndarray, shape (m + o, m + o)
        Covariance of both by all processes of noise.
    responses : ndarray, shape (o, m)
        Of the outputs to an error of the measurement.
    """

    size: int
    partials: Array
    noise: Array
    responses: Array


def positions_of(timeline: Timeline, updates: IndexArray) -> IndexArray:
    """Return the positions before updates, by their numbers."""
    return np.asarray(np.flatnonzero(timeline.is_update)[updates], dtype=np.int64)


def states_at(timeline: Timeline, gains: Table, positions: IndexArray) -> Propagated:
    """Propagate X itself to positions, in any order, all processes of noise together."""
    whole = np.eye(timeline.states)
    return propagate(timeline, gains, positions, by_cause=False, maps=lambda _: whole)


def innovation_laws(
    timeline: Timeline, gains: Table, updates: IndexArray, before: Propagated | None = None
) -> list[InnovationLaw]:
    """Compute the laws of updates by their numbers, in any order.

    Parameters
    ----------
    gains : ndarray or Rows, shape (U, f, M)
        K.
    before : Propagated, optional
        `states_at` the positions of the updates, where it is known.
    """
    if timeline.updates is None:
        raise ValueError("timeline: has no updates")
    positions = positions_of(timeline, check_updates(timeline, updates))
    before = states_at(timeline, gains, positions) if before is None else before
    return [
        _law(timeline, timeline.updates, gains, u, position, partials, covariances.sum(axis=0))
        for u, position, partials, covariances in zip(
            updates.tolist(), positions.tolist(), before.partials, before.covariances, strict=True
        )
    ]


def _law(
    timeline: Timeline, updates: Updates, gains: Table, u: int, position: int, state: Array, covariance: Array
) -> InnovationLaw:
    """Compute the law of an update from X before it."""
    m, outputs = int(updates.sizes[u]), readout_maps(timeline)(position + 1)
    responses = outputs @ filter_of(timeline).place @ gains[u][:, :m]
    # both as what X, c and the measurement's noise make of them
    of_noise = np.concatenate([np.eye(m), -responses])
    rows = of_noise @ updates.responses[u][:m]
    rows[m:] += outputs
    variances = sum((of[u][:m] for of in updates.variances.values()), np.zeros(m))
    return InnovationLaw(
        m, rows @ state + of_noise @ updates.disturbances[u][:m],
        transform(rows, covariance) + transform(of_noise, np.diag(variances)), responses,
    )  # fmt: skip


def measurement_errors(
    timeline: Timeline, gains: Table, errors: Array, updates: IndexArray, end: int
) -> tuple[Array, Array]:
    """Compute what errors of measurements add to innovations, and to the outputs at a position.

    Parameters
    ----------
    gains : ndarray or Rows, shape (U, f, M)
        K.
    errors : ndarray, shape (U, M, r)
        In r cases.
    updates : ndarray of int, shape (u,)
        Numbers of updates, none after the position.
    end : int
        Position of the outputs.

    Returns
    -------
    innovations, outputs : ndarray, shapes (u, M, r), (o, r)
    """
    if timeline.updates is None:
        raise ValueError("timeline: has no updates")
    cases, states = errors.shape[2], timeline.states

    def steps(first: int, last: int) -> Steps:
        transitions = timeline.steps(first, last).transitions
        return Steps(transitions, np.zeros((len(transitions), states, cases)))

    disturbed = replace(
        timeline, start=Start(np.zeros((states, cases))), steps=steps, processes=(), biases={}, sizes={},
        updates=replace(timeline.updates, disturbances=-errors, variances={}),
    )  # fmt: skip
    check_updates(timeline, updates)
    disturbing = np.flatnonzero(errors.any(axis=(1, 2)))
    begin = int(positions_of(timeline, np.append(disturbing, updates)).min(initial=end))
    read_at, whole = np.append(positions_of(timeline, updates), end), np.eye(states)
    read = propagate(disturbed, gains, read_at, begin=begin, maps=lambda _: whole).partials
    innovations = rows_at(timeline.updates.responses, updates) @ read[:-1] - errors[updates]
    return innovations, readout_maps(timeline)(end) @ read[-1]
