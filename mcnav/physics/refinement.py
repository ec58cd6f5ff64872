"""How fine the shared grid must be: settled by measurement on a campaign's own samples."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav.physics.ensemble import fly_ensemble
from mcnav.physics.grid import Grid, shared_grid
from mcnav.physics.truth import Trajectory

Array = NDArray[np.float64]

TOLERANCE: Final = 2e-6
"""Largest error of any probe, as a share of the probes' standard deviation in that output."""

FINEST: Final = 64
"""Largest number of parts of one step of the truth's integrator."""

_ORDER: Final = 4
"""Order of the kernel's scheme: halving the step divides its error by 2^4."""


@dataclass(frozen=True)
class Refinement:
    """A grid and the error that was measured with it (share of the probes' standard deviation)."""

    grid: Grid
    parts: int
    error: float


def refined_grid(
    trajectory: Trajectory, start: float, theta_axes: float, probes: Array, tolerance: float = TOLERANCE
) -> Refinement:
    """The coarsest grid on which the probes meet a tolerance.

    Two grids, one twice as fine, give the error of the coarse one by Richardson's rule, ``16/15`` of their difference;
    its fourth power law says how many parts will do, and the choice is measured again.

    Parameters
    ----------
    trajectory, start, theta_axes
        As for `mcnav.physics.grid.shared_grid`.
    probes : ndarray, shape (n, 10)
        Samples as the campaign will fly them.
    tolerance : float
        Share of each output's standard deviation over the probes (or of its size, where they do not differ).
    """

    def flown(parts: int) -> tuple[Grid, Array]:
        grid = shared_grid(trajectory, start, theta_axes, parts)
        values, valid = fly_ensemble(grid, probes)
        return grid, np.where(valid[:, None], values, 0.0)

    parts = 2
    while True:
        grid, coarse = flown(parts)
        _, fine = flown(2 * parts)
        scale = fine.std(axis=0)
        scale = np.where(scale > 0.0, scale, np.abs(fine).max(axis=0))
        shares = np.abs(coarse - fine).max(axis=0)[scale > 0.0] / scale[scale > 0.0]
        error = float(shares.max(initial=0.0)) * 2**_ORDER / (2**_ORDER - 1)
        if error <= tolerance or parts >= FINEST:
            return Refinement(grid, parts, error)
        wanted = int(np.ceil(1.1 * parts * (error / tolerance) ** (1.0 / _ORDER)))
        parts = min(max(wanted, parts + 1), FINEST)
