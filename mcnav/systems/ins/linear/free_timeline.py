"""Timeline of an unaided navigator: psi, v, x, and the biases of the processes of its instruments and of gravity.

Its sources are the constant ones (`mcnav.systems.ins.imu.instruments.CONSTANTS`): initial errors, then those of the
instruments, which act in every step.
"""

from __future__ import annotations

import numpy as np

from mcnav.arrays.types import Array, IndexArray
from mcnav.contract.timeline import Instants, Start, Timeline
from mcnav.linear.engine.propagate import Propagated, propagate
from mcnav.linear.engine.starts import start_times
from mcnav.systems.ins.filter.model import NAVIGATION
from mcnav.systems.ins.imu.gravity import add_by_cause
from mcnav.systems.ins.imu.instruments import CONSTANTS, Imu, process_variances
from mcnav.systems.ins.linear.covariance import (
    LinearErrors,
    output_map,
)
from mcnav.systems.ins.linear.inertial_steps import InertialSteps
from mcnav.systems.ins.linear.response_blocks import Responses
from mcnav.systems.ins.truth.trajectory import Platform, Truth


def free_timeline(truth: Truth, responses: Responses, imu: Imu) -> Timeline:
    """Return the timeline of an unaided navigator on the grid of its responses; it may start at any of their times."""
    inertial = InertialSteps.of(responses, imu, len(CONSTANTS), NAVIGATION)
    started, times = inertial.started, responses.times

    def begin(position: int) -> Start:
        partials = np.zeros((inertial.states, len(CONSTANTS) + 1))
        partials[:NAVIGATION, :NAVIGATION] = np.linalg.inv(output_map(truth, float(times[position])))
        return Start(partials, started)

    def readout(_: int, time: float) -> Array:
        return np.pad(output_map(truth, time), ((0, 0), (0, inertial.states - NAVIGATION)))

    places = np.arange(len(times))
    return Timeline(
        begin(0), np.zeros(len(times) - 1, dtype=np.bool_), inertial.between, Instants(times, places, places), readout,
        tuple(inertial.variances), inertial.biases, begin=begin, sizes=process_variances(imu),
    )  # fmt: skip


def free_errors(truth: Truth, responses: Responses, imu: Imu, epochs: IndexArray) -> LinearErrors:
    """Compute the linear system of an unaided navigator at times of the grid, by their numbers, shape (m,)."""
    timeline = free_timeline(truth, responses, imu)
    read = propagate(timeline, None, epochs)
    named = {name: read.covariances[:, number] for number, name in enumerate(timeline.processes)}
    return LinearErrors(responses.times[epochs], read.partials[:, :, :-1], add_by_cause(named))


def free_starts(truth: Truth, platform: Platform, starts: Array, end: float, imu: Imu) -> Propagated:
    """Compute the linear system at the end for navigation from each start, with the directions of the first.

    Parameters
    ----------
    starts : ndarray, shape (n,)
        In the trajectory's time, s; all before the end.
    """
    grid = np.append(np.unique(starts), end)
    timeline = free_timeline(truth, Responses(truth, platform, grid, imu), imu)
    return start_times(timeline, timeline.end, timeline.readout(timeline.end, end), timeline.positions(starts))
