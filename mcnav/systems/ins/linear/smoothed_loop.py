"""Errors of an aided navigator behind a smoother: the closed loop as `run_smoother` takes it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mcnav._types import Array, IndexArray
from mcnav.systems.ins.filter.model import NAVIGATION
from mcnav.systems.ins.imu.gravity import add_by_cause
from mcnav.systems.ins.linear.closed_loop import (
    ClosedLoop,
    constant_disturbances,
    count_biases,
    driving_processes,
    own_covariances,
    propagate_constants,
    propagate_processes,
    true_loop,
    with_faults,
)
from mcnav.systems.ins.linear.covariance import map_covariances, output_map
from mcnav.systems.ins.linear.recursions import Steps
from mcnav.systems.ins.linear.smoother import SmoothedLoop, SmoothedProcesses, last_times, run_smoother


@dataclass(frozen=True)
class SmoothedErrors:
    """Errors behind the smoother at m readings, as `ClosedLoopErrors` has those of the filter.

    Attributes
    ----------
    times : ndarray, shape (m,)
    partials : ndarray, shape (m, 9, sources)
    processes : mapping of str to ndarray, shape (m, 9, 9)
    own : ndarray, shape (m, 9, 9)
        Covariance that the smoother claims.
    nominal : ndarray, shape (m, 9)
        Errors by faults of the sensors.
    """

    times: Array
    partials: Array
    processes: dict[str, Array]
    own: Array
    nominal: Array


def smooth_closed_loop(loop: ClosedLoop, readings: IndexArray, after: Array, lag: float = np.inf) -> SmoothedErrors:
    """Compute what is left of the errors at readings, given the measurements up to a lag after each.

    Parameters
    ----------
    readings : ndarray of int, shape (m,)
        Numbers of the times at which errors are read out, in order.
    after : ndarray of bool, shape (m,)
        Whether after the updates at that time, or before: the smoothed errors are the same.
    lag : float
        s; with an infinite one all measurements of the navigation are given: a fixed interval.
    """
    tables = loop.filter
    processes = driving_processes(loop)
    backward = run_smoother(
        _smoothed_loop(loop), _smoothed_processes(loop), readings, after, last_times(loop.times, readings, lag)
    )
    covariance = own_covariances(loop, readings, after)
    claimed = covariance - covariance @ backward.own @ covariance
    # z = (y, x - e^) of X = (y, e^), of constant errors, and of a process's bias
    states = len(tables.constants)
    of_state = np.diag(np.concatenate([np.ones(NAVIGATION), -np.ones(states)]))
    y, estimates, faulted = propagate_constants(loop, readings, after)
    sources = y.shape[2]
    of_constants = np.zeros((NAVIGATION + states, sources))
    for place, number in enumerate(tables.constants):
        if number >= 0:
            of_constants[NAVIGATION + place, number] = 1.0
    state = np.concatenate([y, estimates], axis=1)
    left = of_state - covariance @ backward.state
    partials = left @ state + of_constants - covariance @ backward.constants[:, :, :sources]
    nominal = np.einsum("mij,mj->mi", left, faulted)
    if backward.constants.shape[2] > sources:
        nominal -= np.einsum("mij,mj->mi", covariance, backward.constants[:, :, sources])
    maps = np.stack([output_map(loop.truth, float(time)) for time in loop.times[readings]])
    named = {}
    _, covariances = propagate_processes(loop, readings, after)
    for number, name in enumerate(processes):
        of_biases = np.zeros((NAVIGATION + states, backward.biases.shape[3]))
        for place, modelled in enumerate(tables.processes):
            of_biases[NAVIGATION + place, tables.parts[place]] = float(name in modelled)
        columns = of_biases - covariance @ backward.biases[:, number]
        joint = np.concatenate([left, columns], axis=2)
        total = joint @ covariances[..., number] @ joint.swapaxes(1, 2)
        total += covariance @ backward.noise[:, number] @ covariance
        named[name] = maps @ total[:, :NAVIGATION, :NAVIGATION] @ maps.swapaxes(1, 2)
    return SmoothedErrors(
        loop.times[readings], maps @ partials[:, :NAVIGATION], add_by_cause(named),
        map_covariances(maps, claimed[:, :NAVIGATION, :NAVIGATION]),
        np.einsum("mij,mj->mi", maps, nominal[:, :NAVIGATION]),
    )  # fmt: skip


def _smoothed_loop(loop: ClosedLoop) -> SmoothedLoop:
    tables, measurements, true = loop.filter, loop.measurements, true_loop(loop)
    inputs, disturbances = with_faults(loop, *constant_disturbances(loop))
    padded = np.zeros((len(inputs), true.updates.rows.shape[2], inputs.shape[2]))
    padded[:, :NAVIGATION] = inputs
    return SmoothedLoop(
        loop.first_updates, measurements.sizes, square_transitions(loop),
        np.concatenate([measurements.rows, tables.rows], axis=2), loop.gains, loop.roots, _square(true.steps),
        true.updates.rows, true.gains, padded, disturbances,
    )  # fmt: skip


def square_transitions(loop: ClosedLoop) -> Array:
    """Return F of the filter's states over the steps, shape (K, f, f)."""
    tables = loop.filter
    return _square(Steps(np.concatenate([loop.transition, tables.coupling], axis=2), tables.decay))


def _square(steps: Steps) -> Array:
    """Return whole transitions, shape (K, n, n)."""
    others = steps.decay.shape[1]
    square = np.zeros((len(steps.decay), NAVIGATION + others, NAVIGATION + others))
    square[:, :NAVIGATION] = steps.rows
    places = NAVIGATION + np.arange(others)
    square[:, places, places] = steps.decay
    return square


def _smoothed_processes(loop: ClosedLoop) -> SmoothedProcesses:
    processes, biases = driving_processes(loop).values(), count_biases(loop)
    noise, last = [], np.arange(NAVIGATION, NAVIGATION + biases)
    for process in processes:
        covariance = np.zeros((len(process.decay), NAVIGATION + biases, NAVIGATION + biases))
        covariance[:, :NAVIGATION, :NAVIGATION] = process.noise.white
        cross = process.noise.cross[:, :, -biases:]
        covariance[:, :NAVIGATION, NAVIGATION:], covariance[:, NAVIGATION:, :NAVIGATION] = cross, cross.swapaxes(1, 2)
        covariance[:, last, last] = process.noise.driven[:, -biases:]
        paired = process.noise.paired[:, -biases + 1 :] if biases > 1 else np.zeros((len(covariance), 0))
        covariance[:, last[1:], last[:-1]] = covariance[:, last[:-1], last[1:]] = paired
        noise.append(covariance)
    return SmoothedProcesses(
        tuple(process.response for process in processes), tuple(process.decay for process in processes), tuple(noise),
        np.stack([process.seen for process in processes], axis=2),
        np.stack([process.measured for process in processes], axis=2),
    )  # fmt: skip
