"""Steps of psi, v, x that timelines of unaided and of aided navigation have in common."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from mcnav.arrays.types import Array, IndexArray
from mcnav.contract.timeline import StepNoise, Steps
from mcnav.systems.ins.filter.model import NAVIGATION
from mcnav.systems.ins.imu.instruments import CONSTANTS, Imu, of_unit_sizes
from mcnav.systems.ins.linear.covariance import constant_inputs, process_systems, transitions
from mcnav.systems.ins.linear.response_blocks import Responses


@dataclass(frozen=True)
class InertialSteps:
    """Steps of psi, v, x with constant errors of the instruments, and with a bias of each process that has one.

    Processes are of size one: sizes are those of a timeline.

    Attributes
    ----------
    imu : Imu
        Which has all processes.
    states, sources : int
        n and s of the timeline.
    first_bias : int
        State that is the first bias.
    """

    responses: Responses
    imu: Imu
    states: int
    sources: int
    first_bias: int

    @classmethod
    def of(cls, responses: Responses, imu: Imu, sources: int, first_bias: int, after: int = 0) -> InertialSteps:
        """Return those of a timeline with other states before the biases, and a number of them after."""
        named = cls(responses, imu, 0, sources, first_bias)
        return replace(named, states=first_bias + len(named.biases) + after)

    @cached_property
    def _unit(self) -> Imu:
        return of_unit_sizes(self.imu)

    @cached_property
    def variances(self) -> dict[str, float | None]:
        """Variance of each process's bias at the start; none of a process without one."""
        systems = process_systems(self.responses.between(0, 1), self._unit)
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
        responses, count = self.responses.between(first, last), last - first
        over, inputs = np.zeros((count, self.states, self.states)), np.zeros((count, self.states, self.sources + 1))
        places = np.arange(NAVIGATION, self.states)
        over[:, :NAVIGATION, :NAVIGATION], over[:, places, places] = transitions(responses), 1.0
        inputs[:, :NAVIGATION, NAVIGATION : len(CONSTANTS)] = constant_inputs(responses)
        noise = {}
        for name, (response, covariance, _) in process_systems(responses, self._unit).items():
            rows, used = np.arange(NAVIGATION + 1), np.diagonal(covariance, axis1=1, axis2=2).any(axis=0)
            if name in self.biases:
                rows[NAVIGATION] = bias = int(self.biases[name][0])
                over[:, :NAVIGATION, bias], over[:, bias, bias] = response[:, :NAVIGATION], response[:, NAVIGATION]
            noise[name] = StepNoise(rows[used], covariance[:, used][:, :, used])
        return Steps(over, inputs, noise)
