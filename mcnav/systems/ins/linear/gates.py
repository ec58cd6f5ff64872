"""Innovations of an aided navigator and its errors after an update: their joint law, and what faults add to both.

At an update the innovation n and the errors e behind it are linear in the true state X of the closed loop
(`mcnav.systems.ins.linear.closed_loop.TrueLoop`), in constant errors and in the measurement's noise w::

    n = H X + D c + w        X+ = X - K n        e = M X+

so that their covariances follow from those of X by each cause. An error b of the measurement takes b from n and adds
``M K b`` to e. It is as if every measurement were accepted: up to the first one that is rejected this is exact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mcnav._types import Array, IndexArray
from mcnav.systems.ins.filter.model import NAVIGATION
from mcnav.systems.ins.linear.closed_loop import (
    ClosedLoop,
    DrivingProcess,
    TrueLoop,
    constant_disturbances,
    driving_processes,
    propagate_constants,
    propagate_processes,
    true_loop,
)
from mcnav.systems.ins.linear.covariance import output_map


@dataclass(frozen=True)
class UpdateLaw:
    """Joint normal law of an innovation of M components and of the outputs' errors after its update.

    Attributes
    ----------
    root : ndarray, shape (M, M)
        Cholesky factor of the innovation's covariance as the filter believes it.
    mean, covariance : ndarray, shapes (M,), (M, M)
        Of the innovation.
    cross : ndarray, shape (M, 9)
    mean_errors, errors : ndarray, shapes (9,), (9, 9)
        Mean and covariance of the errors.
    responses : ndarray, shape (9, M)
        Of the errors to an error of the measurement.
    """

    root: Array
    mean: Array
    covariance: Array
    cross: Array
    mean_errors: Array
    errors: Array
    responses: Array


def time_numbers(loop: ClosedLoop, updates: IndexArray) -> IndexArray:
    """Return the numbers of the times of updates."""
    return np.asarray(np.searchsorted(loop.first_updates, updates, side="right") - 1, dtype=np.int64)


def update_laws(loop: ClosedLoop, updates: IndexArray, mean: Array, sources: Array) -> list[UpdateLaw]:
    """Compute the laws of updates by their numbers, rising.

    Parameters
    ----------
    mean, sources : ndarray, shapes (s,), (s, s)
        Mean and covariance of the constant sources.
    """
    readings, places = np.unique(time_numbers(loop, updates), return_inverse=True)
    before, driving = np.zeros(len(readings)), driving_processes(loop)
    y, estimates, faulted = propagate_constants(loop, readings, before)
    _, covariances = propagate_processes(loop, readings, before, driving)
    disturbances, true, processes = constant_disturbances(loop)[1], true_loop(loop), list(driving.values())
    return [
        _law(
            loop, true, processes, int(u), int(readings[place]), np.concatenate([y[place], estimates[place]]),
            faulted[place], covariances[place], disturbances, mean, sources,
        )
        for u, place in zip(updates, places, strict=True)
    ]  # fmt: skip


def _law(
    loop: ClosedLoop, true: TrueLoop, processes: Sequence[DrivingProcess], update: int, number: int, state: Array,
    faulted: Array, covariances: Array, disturbances: Array, mean: Array, sources: Array,
) -> UpdateLaw:  # fmt: skip
    """Compute the law of an update from the state before all updates at its time.

    Parameters
    ----------
    number : int
        Of the time.
    state, faulted : ndarray, shapes (x, s), (x,)
        Responses to constant errors, and what faults add.
    covariances : ndarray, shape (x + b, x + b, processes)
        Of the state and of each process's biases.
    """
    measured = loop.measurements
    of_processes = [covariances[..., p] for p in range(covariances.shape[2])]
    size, states = int(measured.sizes[update]), len(state)
    covariance, cross = np.zeros((size, size)), np.zeros((size, states))
    for u in range(int(loop.first_updates[number]), update + 1):
        m = int(measured.sizes[u])
        rows, gain = true.updates.rows[u, :m], true.gains[u, :, :m]
        innovation = rows @ state + disturbances[u, :m]
        offset = rows @ faulted - measured.faults[u, :m]
        state, faulted = state - gain @ innovation, faulted - gain @ offset
        widened = np.concatenate([gain, np.zeros((len(covariances) - states, m))])
        for p, process in enumerate(processes):
            seen = np.concatenate([rows, process.seen[u, :m]], axis=1)
            noise, left = np.diag(process.measured[u, :m]), np.eye(len(covariances)) - widened @ seen
            projected = seen @ of_processes[p]
            if u == update:
                covariance += projected @ seen.T + noise
                cross += (projected @ left.T - noise @ widened.T)[:, :states]
            of_processes[p] = left @ of_processes[p] @ left.T + widened @ noise @ widened.T
    to_outputs = np.zeros((NAVIGATION, states))
    to_outputs[:, :NAVIGATION] = output_map(loop.truth, float(loop.times[number]))
    total = sum(of_processes, np.zeros_like(covariances[..., 0]))[:states, :states] + state @ sources @ state.T
    return UpdateLaw(
        loop.roots[update, :size, :size],
        innovation @ mean + offset,
        covariance + innovation @ sources @ innovation.T,
        (cross + innovation @ sources @ state.T) @ to_outputs.T,
        to_outputs @ (state @ mean + faulted),
        to_outputs @ total @ to_outputs.T,
        to_outputs @ gain,
    )


def innovations_by(loop: ClosedLoop, errors: Array, updates: IndexArray) -> tuple[Array, Array]:
    """Compute what errors of the measurements add to innovations, and to the outputs after the last one.

    Parameters
    ----------
    errors : ndarray, shape (U, M, r)
        In r cases, each of them zero outside of the updates.
    updates : ndarray of int, shape (u,)
        Rising numbers of updates, among them all that have errors.

    Returns
    -------
    innovations, outputs : ndarray, shapes (u, M, r), (9, r)
    """
    true, measured = true_loop(loop), loop.measurements
    numbers, wanted = time_numbers(loop, updates), {int(u): place for place, u in enumerate(updates)}
    state = np.zeros((true.updates.rows.shape[2], errors.shape[2]))
    innovations = np.zeros((len(updates), *errors.shape[1:]))
    for k in range(int(numbers[0]), int(numbers[-1]) + 1):
        if k > numbers[0]:
            state = np.concatenate(
                [true.steps.rows[k - 1] @ state, true.steps.decay[k - 1][:, None] * state[NAVIGATION:]]
            )
        for u in range(int(loop.first_updates[k]), int(loop.first_updates[k + 1])):
            m = int(measured.sizes[u])
            innovation = true.updates.rows[u, :m] @ state - errors[u, :m]
            state = state - true.gains[u, :, :m] @ innovation
            if u in wanted:
                innovations[wanted[u], :m] = innovation
    return innovations, output_map(loop.truth, float(loop.times[numbers[-1]])) @ state[:NAVIGATION]
