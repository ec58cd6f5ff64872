"""The linear system at the end of navigation for many starts along one truth, by a backward recursion.

With the transitions T_k of psi, v, x over the steps between starts, the responses B_k to the constant errors of the
instruments, and the map H to the outputs, P of a start j is ``A_j H_j^-1`` for initial errors and D_j for the
instruments, with ``A_k = A_(k+1) T_k`` and ``D_k = D_(k+1) + A_(k+1) B_k`` from A = H and D = 0 at the end. A process
is treated in the same way with its bias, and its covariance is summed backwards.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav._types import Array
from mcnav.systems.ins.imu.instruments import CONSTANTS, OUTPUTS, Imu, count_processes
from mcnav.systems.ins.linear.covariance import constant_inputs, output_map, process_systems, transitions
from mcnav.systems.ins.linear.response import StepResponses, respond
from mcnav.systems.ins.truth.trajectory import Platform, Truth

BLOCK: Final = 256
"""Starts whose tables are in memory at the same time."""


@dataclass(frozen=True)
class LinearStarts:
    """The linear system at the end of navigation for n starts.

    Attributes
    ----------
    partials : ndarray, shape (n, 9, 39)
        Of the outputs to the constant sources.
    noise : ndarray, shape (n, 9, 9)
        Covariance of the outputs from all processes, each as it is at the start of navigation.
    """

    partials: Array
    noise: Array


@dataclass
class _Backward:
    """Responses of the outputs at the end, with which the step before is continued.

    Attributes
    ----------
    to_state : ndarray, shape (9, 9)
    to_instruments : ndarray, shape (9, 30)
    to_biased : ndarray, shape (processes, 9, 10)
        To psi, v, x and the bias of each process.
    noise : ndarray, shape (9, 9)
    """

    to_state: Array
    to_instruments: Array
    to_biased: Array
    noise: Array

    @classmethod
    def at_the_end(cls, to_outputs: Array, processes: int) -> _Backward:
        """Begin at the end of navigation."""
        to_biased = np.zeros((processes, 9, 10))
        to_biased[:, :, :9] = to_outputs
        return cls(to_outputs, np.zeros((9, 30)), to_biased, np.zeros((9, 9)))

    def over(self, responses: StepResponses, imu: Imu) -> Iterator[tuple[Array, Array]]:
        """Continue over steps, the last first; yield P without the start's map, (9, 39), and the noise, for each."""
        transition, inputs = transitions(responses), constant_inputs(responses)
        systems = list(process_systems(responses, imu).values())
        initial = np.array([variance for _, _, variance in systems])
        for step in range(len(transition) - 1, -1, -1):
            self.to_instruments = self.to_instruments + self.to_state @ inputs[step]
            self.to_state = self.to_state @ transition[step]
            started = self.noise
            if systems:
                added = np.stack([noise[step] for _, noise, _ in systems])
                response = np.stack([each[step] for each, _, _ in systems])
                self.noise = self.noise + (self.to_biased @ added @ self.to_biased.swapaxes(1, 2)).sum(axis=0)
                to_bias = np.einsum("prc,pc->pr", self.to_biased, response)
                self.to_biased[:, :, :9] = self.to_biased[:, :, :9] @ transition[step]
                self.to_biased[:, :, 9] = to_bias
                started = self.noise + np.einsum("p,pr,pc->rc", initial, to_bias, to_bias)
            yield np.concatenate([self.to_state, self.to_instruments], axis=1), started


def propagate_starts(
    truth: Truth, platform: Platform, starts: Array, end: float, imu: Imu, aligned: float | None = None
) -> LinearStarts:
    """Compute the linear system at the end for navigation from each start.

    An inertial platform with the body's directions at each start has tables of its own for each; the others share
    theirs.

    Parameters
    ----------
    starts : ndarray, shape (n,)
        In the trajectory's time, s; all before the end.
    aligned : float, optional
        Instant whose directions an inertial platform keeps, whatever the start, s; by default those at each start.
    """
    alone = platform == "inertial" and aligned is None
    truth = truth if aligned is None else truth.held(aligned)
    times, place = np.unique(starts, return_inverse=True)
    to_outputs, processes = output_map(truth, end), count_processes(imu)
    partials = np.empty((len(times), len(OUTPUTS), len(CONSTANTS)))
    noise = np.empty((len(times), len(OUTPUTS), len(OUTPUTS)))
    knots = np.append(times, end)
    backward = _Backward.at_the_end(to_outputs, processes)
    size = 1 if alone else BLOCK
    for last in range(len(times), 0, -size):
        first = max(0, last - size)
        bounds = knots[first : last + 1]
        if alone:
            bounds = np.array([times[first], end])
            backward = _Backward.at_the_end(to_outputs, processes)
        linear_starts = backward.over(respond(truth, platform, bounds, imu), imu)
        for row, (partials[row], noise[row]) in zip(range(last - 1, first - 1, -1), linear_starts, strict=True):
            partials[row, :, :9] = partials[row, :, :9] @ np.linalg.inv(output_map(truth, float(times[row])))
    return LinearStarts(partials[place], noise[place])
