"""The shared grid of the ensemble: truth and forces tabulated once, for every sample of a campaign.

The truth's own integrator has already found where the motion is fast and where it is slow, and restarts at every kink.
So the nodes of the ensemble are its steps, each divided into the same number of equal parts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcnav.constants import GRAVITATIONAL_PARAMETER
from mcnav.physics.truth import Phase, Trajectory, truth_force

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Grid:
    """Everything the kernel needs to know of a truth.

    Attributes
    ----------
    steps : ndarray, shape (n, 3)
        Length (s), time since the start of navigation (s), and accelerometers on (1) or off (0), for each step.
    stages : ndarray, shape (n, 3, 6)
        At the begin, middle and end of each step: position X, Y (m), 1 / r^2 (1/m^2), mu / r^3 (1/s^2), specific force
        along X (east) and down at the reference axes (m/s^2).
    first, last : ndarray, shape (4,)
        Polar state at the start of navigation and at the end, the range angle counted from the reference axes.
    """

    steps: Array
    stages: Array
    first: Array
    last: Array


def shared_grid(trajectory: Trajectory, start: float, theta_axes: float, parts: int) -> Grid:
    """Tabulate a truth from the start of navigation (s) on.

    Parameters
    ----------
    trajectory : Trajectory
        The truth.
    start : float
        Start of navigation, s from the first point.
    theta_axes : float
        Range angle of the reference axes, rad.
    parts : int
        Parts into which each step of the truth's integrator is divided.
    """
    steps, stages = [], []
    for begin, end, phase in trajectory.navigated(start):
        known = phase.solution.ts
        coarse = np.concatenate([[begin], known[(known > begin) & (known < end)], [end]])
        fine = np.interp(np.arange((len(coarse) - 1) * parts + 1) / parts, np.arange(len(coarse)), coarse)
        lengths = np.diff(fine)
        on = np.full(len(lengths), float(phase.accelerometers_on))
        steps.append(np.column_stack([lengths, fine[:-1] - start, on]))
        at_nodes, between = _rows(phase, fine, theta_axes), _rows(phase, fine[:-1] + 0.5 * lengths, theta_axes)
        stages.append(np.stack([at_nodes[:-1], between, at_nodes[1:]], axis=1))
    reference = np.array([0.0, theta_axes, 0.0, 0.0])
    return Grid(
        np.concatenate(steps),
        np.concatenate(stages),
        trajectory.state(start) - reference,
        trajectory.state(trajectory.final_time) - reference,
    )


def _rows(phase: Phase, times: Array, theta_axes: float) -> Array:
    """Rows of `Grid.stages` at times within one phase, shape (n, 6)."""
    states = phase.solution(times).T
    forces = np.array([truth_force(state, phase.coefficients) for state in states])
    radius, angle = states[:, 0], states[:, 1] - theta_axes
    sine, cosine = np.sin(angle), np.cos(angle)
    return np.column_stack(
        [
            radius * sine,
            radius * cosine,
            radius**-2,
            GRAVITATIONAL_PARAMETER * radius**-3,
            forces[:, 0] * cosine - forces[:, 1] * sine,
            forces[:, 0] * sine + forces[:, 1] * cosine,
        ]
    )
