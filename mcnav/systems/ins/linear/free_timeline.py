"""Timeline of an unaided navigator: psi, v, x, and the biases of the processes of its instruments and of gravity.

Its sources are the constant ones (`mcnav.systems.ins.imu.instruments.CONSTANTS`): initial errors, then those of the
instruments, which act in every step.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from mcnav._types import Array, IndexArray
from mcnav.contract.timeline import Instants, Start, StepNoise, Steps, Timeline
from mcnav.linear.engine.propagate import Propagated, propagate
from mcnav.linear.engine.starts import start_times
from mcnav.systems.ins.imu.gravity import add_by_cause
from mcnav.systems.ins.imu.instruments import CONSTANTS, OUTPUTS, Imu
from mcnav.systems.ins.linear.covariance import (
    LinearErrors,
    constant_inputs,
    output_map,
    process_systems,
    transitions,
)
from mcnav.systems.ins.linear.response import StepResponses, respond, responses_between
from mcnav.systems.ins.truth.trajectory import Platform, Truth

NAVIGATION: Final = len(OUTPUTS)
"""Number of the states psi, v, x."""


@dataclass(frozen=True)
class InertialSteps:
    """Steps of psi, v, x with constant errors of the instruments, and with a bias of each process that has one.

    Attributes
    ----------
    states, sources : int
        n and s of the timeline.
    first_bias : int
        State that is the first bias.
    """

    responses: StepResponses
    imu: Imu
    states: int
    sources: int
    first_bias: int

    @cached_property
    def variances(self) -> dict[str, float | None]:
        """Variance of each process's bias at the start; none of a process without one."""
        systems = process_systems(responses_between(self.responses, 0, 1), self.imu)
        return {name: float(variance) if response.any() else None for name, (response, _, variance) in systems.items()}

    @cached_property
    def biases(self) -> dict[str, IndexArray]:
        """State that is the bias of each process that has one."""
        names = [name for name, variance in self.variances.items() if variance is not None]
        return {name: np.array([place]) for place, name in enumerate(names, self.first_bias)}

    @property
    def started(self) -> dict[str, Array]:
        """Covariance of X by process where navigation starts: a bias instability is stationary, a random walk zero."""
        started = {}
        for name, place in self.biases.items():
            started[name] = np.zeros((self.states, self.states))
            started[name][place, place] = self.variances[name]
        return started

    def between(self, first: int, last: int) -> Steps:
        """Return steps by their numbers."""
        responses, count = responses_between(self.responses, first, last), last - first
        over, inputs = np.zeros((count, self.states, self.states)), np.zeros((count, self.states, self.sources + 1))
        places = np.arange(NAVIGATION, self.states)
        over[:, :NAVIGATION, :NAVIGATION], over[:, places, places] = transitions(responses), 1.0
        inputs[:, :NAVIGATION, NAVIGATION : len(CONSTANTS)] = constant_inputs(responses)
        noise = {}
        for name, (response, covariance, _) in process_systems(responses, self.imu).items():
            rows, used = np.arange(NAVIGATION + 1), covariance.any(axis=(0, 1))
            if name in self.biases:
                rows[NAVIGATION] = bias = int(self.biases[name][0])
                over[:, :NAVIGATION, bias], over[:, bias, bias] = response[:, :NAVIGATION], response[:, NAVIGATION]
            noise[name] = StepNoise(rows[used], covariance[:, used][:, :, used])
        return Steps(over, inputs, noise)


def free_timeline(truth: Truth, responses: StepResponses, imu: Imu) -> Timeline:
    """Return the timeline of an unaided navigator on the grid of its responses; it may start at any of their times."""
    named = InertialSteps(responses, imu, 0, len(CONSTANTS), NAVIGATION)
    inertial = InertialSteps(responses, imu, NAVIGATION + len(named.biases), len(CONSTANTS), NAVIGATION)
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
        tuple(inertial.variances), inertial.biases, begin=begin,
    )  # fmt: skip


def free_errors(truth: Truth, responses: StepResponses, imu: Imu, epochs: IndexArray) -> LinearErrors:
    """Compute the linear system of an unaided navigator at times of the grid, by their numbers, shape (m,)."""
    timeline = free_timeline(truth, responses, imu)
    read = propagate(timeline, None, epochs)
    named = {name: read.covariances[:, number] for number, name in enumerate(timeline.processes)}
    return LinearErrors(responses.times[epochs], read.partials[:, :, :-1], add_by_cause(named))


def free_starts(
    truth: Truth, platform: Platform, starts: Array, end: float, imu: Imu, aligned: float | None = None
) -> Propagated:
    """Compute the linear system at the end for navigation from each start.

    Parameters
    ----------
    starts : ndarray, shape (n,)
        In the trajectory's time, s; all before the end.
    aligned : float, optional
        Time whose directions an inertial platform keeps, whatever the start, s; by default those at each start, for
        which each start has responses of its own.
    """
    truth = truth if aligned is None else truth.held(aligned)
    if platform == "inertial" and aligned is None:
        alone = [_starts(truth, platform, np.array([start]), end, imu) for start in starts.tolist()]
        return Propagated(
            np.concatenate([read.partials for read in alone]), np.concatenate([read.covariances for read in alone])
        )
    return _starts(truth, platform, starts, end, imu)


def _starts(truth: Truth, platform: Platform, starts: Array, end: float, imu: Imu) -> Propagated:
    """Compute the same with directions that all starts share."""
    grid = np.append(np.unique(starts), end)
    timeline = free_timeline(truth, respond(truth, platform, grid, imu), imu)
    return start_times(
        timeline, timeline.end, timeline.readout(timeline.end, end), timeline.positions(starts)
    )  # fmt: skip
