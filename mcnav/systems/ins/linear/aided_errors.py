"""Linear errors of an aided navigator by cause, also behind a smoother."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from mcnav.arrays.products import map_covariances, transform
from mcnav.arrays.types import Array, IndexArray
from mcnav.linear.engine.propagate import propagate
from mcnav.linear.engine.smoother import smooth
from mcnav.linear.engine.transitions import TOGETHER
from mcnav.systems.ins.filter.model import NAVIGATION
from mcnav.systems.ins.imu.gravity import add_by_cause
from mcnav.systems.ins.linear.closed_loop import ClosedLoop, ShownPairs
from mcnav.systems.ins.linear.covariance import output_map


@dataclass(frozen=True)
class ClosedLoopErrors:
    """Errors of an aided navigator at m readings.

    Attributes
    ----------
    times : ndarray, shape (m,)
    partials : ndarray, shape (m, 9, sources)
        Of the outputs to the constant sources: those of the instruments, then those of aiding.
    processes : mapping of str to ndarray, shape (m, 9, 9)
        Covariance of the outputs from each process, by name.
    own : ndarray, shape (m, 9, 9)
        Covariance of the outputs that the filter computes.
    nominal : ndarray, shape (m, 9)
        Errors of the outputs by faults of the sensors.
    state_partials, state_variances, own_variances : ndarray, shapes (m, q, sources), name to (m, q), (m, q)
        The same of the true errors of the other states' estimates.
    """

    times: Array
    partials: Array
    processes: dict[str, Array]
    own: Array
    nominal: Array
    state_partials: Array
    state_variances: Mapping[str, Array]
    own_variances: Array


@dataclass(frozen=True)
class SmoothedErrors:
    """Errors behind the smoother at m readings, as `ClosedLoopErrors` has those of the filter."""

    times: Array
    partials: Array
    processes: dict[str, Array]
    own: Array
    nominal: Array


def propagate_closed_loop(
    loop: ClosedLoop, readings: IndexArray, after: Array, by_cause: bool = True
) -> ClosedLoopErrors:
    """Propagate the true errors and the filter's covariance.

    Parameters
    ----------
    readings : ndarray of int, shape (m,)
        Numbers of the times at which errors are read out, in order.
    after : ndarray of bool, shape (m,)
        Whether after the updates at that time, or before.
    by_cause : bool
        Each process by itself; else all together, which takes less time.
    """
    timeline, positions = loop.timeline, loop.positions(readings, after)
    if timeline.filter is None:
        raise ValueError("loop: has no filter")
    designed, pairs = loop.designed(positions), ShownPairs.of(loop, readings)
    number_at = dict(zip(positions.tolist(), range(len(positions)), strict=True))
    maps, true_errors = _output_maps(loop, readings), timeline.filter.true_errors
    states = [true_errors(position) for position in positions.tolist()]
    of_state, of_constants = (np.stack(tables)[:, NAVIGATION:] for tables in zip(*states, strict=True))
    if pairs is not None:
        of_state, of_constants = pairs.of_values(of_state), pairs.of_values(of_constants)
    outputs = np.pad(maps, ((0, 0), (0, 0), (0, timeline.states - NAVIGATION)))
    rows = np.concatenate([outputs, of_state], axis=1)
    read = propagate(timeline, designed.gains, positions, by_cause, maps=lambda position: rows[number_at[position]])
    processes = timeline.processes if by_cause else (TOGETHER,)[: len(timeline.processes)]
    named = {name: read.covariances[:, number] for number, name in enumerate(processes)}
    of_others = np.diagonal(read.covariances, axis1=2, axis2=3)[:, :, NAVIGATION:]
    own = designed.covariances
    return ClosedLoopErrors(
        loop.times[readings],
        read.partials[:, :NAVIGATION, :-1],
        add_by_cause({name: covariance[:, :NAVIGATION, :NAVIGATION] for name, covariance in named.items()}),
        map_covariances(maps, own[:, :NAVIGATION, :NAVIGATION]),
        read.partials[:, :NAVIGATION, -1],
        (read.partials[:, NAVIGATION:] + of_constants)[:, :, :-1],
        add_by_cause({name: of_others[:, number] for number, name in enumerate(processes)}),
        (
            np.diagonal(own, axis1=1, axis2=2)[:, NAVIGATION:].copy()
            if pairs is None
            else pairs.of_covariances(own[:, NAVIGATION:, NAVIGATION:])
        ),
    )


def stated_covariances(loop: ClosedLoop, readings: IndexArray, after: Array) -> Array:
    """Compute the covariance of the outputs that the filter states at readings, shape (m, 9, 9).

    Parameters
    ----------
    readings, after : ndarray, shape (m,)
        As for `propagate_closed_loop`.
    """
    own = loop.designed(loop.positions(readings, after)).covariances
    return map_covariances(_output_maps(loop, readings), own[:, :NAVIGATION, :NAVIGATION])


def smooth_closed_loop(loop: ClosedLoop, readings: IndexArray, after: Array, lag: float = np.inf) -> SmoothedErrors:
    """Compute what is left of the errors at readings, given the measurements up to a lag after each.

    Parameters
    ----------
    readings, after : ndarray, shape (m,)
        As for `propagate_closed_loop`; before and after updates the smoothed errors are the same.
    lag : float
        s; with an infinite one all measurements of the navigation are given: a fixed interval.
    """
    timeline, positions = loop.timeline, loop.positions(readings, after)
    smoothed = smooth(timeline, loop.designed(positions), positions, lag)
    maps = _output_maps(loop, readings)
    partials = maps @ smoothed.partials[:, :NAVIGATION]
    covariances = transform(maps[:, None], smoothed.covariances[:, :, :NAVIGATION, :NAVIGATION])
    return SmoothedErrors(
        loop.times[readings], partials[:, :, :-1],
        add_by_cause({name: covariances[:, number] for number, name in enumerate(timeline.processes)}),
        map_covariances(maps, smoothed.claimed[:, :NAVIGATION, :NAVIGATION]), partials[:, :, -1],
    )  # fmt: skip


def _output_maps(loop: ClosedLoop, readings: IndexArray) -> Array:
    """Return the matrices from psi, v, x to the outputs at readings, shape (m, 9, 9)."""
    return np.stack([output_map(loop.truth, float(time)) for time in loop.times[readings]])
