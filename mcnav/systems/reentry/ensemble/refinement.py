"""Number of nodes of the shared grid: settled by measurement on a campaign's own samples."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.numerics.refinement import largest_share
from mcnav.systems.reentry.ensemble.grid import Grid, shared_grid
from mcnav.systems.reentry.ensemble.kernel import simulate_ensemble
from mcnav.systems.reentry.ensemble.transition import linear_response
from mcnav.systems.reentry.truth import Trajectory

TOLERANCE: Final = 1e-6
"""Largest error of any probe, as a share of the probes' standard deviation in that output."""

COARSEST: Final = 24
FINEST: Final = 384
"""Fewest and most nodes of a flight."""

_HALVINGS: Final = 2
"""Halvings of the range between too few nodes and enough, to save some."""


@dataclass(frozen=True)
class Refinement:
    """A grid and the error that was measured with it (share of the probes' standard deviation)."""

    grid: Grid
    nodes: int
    error: float


def refined_grid(
    trajectory: Trajectory, start: float, theta_axes: float, probes: Array, tolerance: float = TOLERANCE
) -> Refinement:
    """Find the coarsest grid, to within a fifth, on which the probes meet a tolerance.

    The nodes are doubled until that changes no probe by more than the tolerance: what the finer grid leaves is a small
    part of the change, its error falling with the fifth power or faster. Fewer nodes are then held against the same
    finer grid.

    Parameters
    ----------
    start, theta_axes : float
        Start of navigation, s from the first point of the truth; range angle of the reference axes, rad.
    probes : ndarray, shape (n, sources)
        Samples as the campaign will fly them.
    tolerance : float
        Share of each output's standard deviation over the probes (or of its size, where they do not differ).
    """
    response = linear_response(trajectory, start, theta_axes)

    def simulate(nodes: int) -> tuple[Grid, Array]:
        grid = shared_grid(response, nodes)
        values, valid = simulate_ensemble(grid, probes)
        return grid, np.where(valid[:, None], values, np.nan)

    def held_against(best: Array, grid: Grid, values: Array) -> tuple[Refinement, bool]:
        """Measure a grid's error, and whether it will do: few valid probes say too little of a sample to come."""
        valid = np.isfinite(values).all(axis=1) & np.isfinite(best).all(axis=1)
        error = largest_share(values[valid], best[valid]) if valid.any() else 0.0
        return Refinement(grid, len(grid.readout), error), error <= tolerance and 2 * valid.sum() >= len(probes)

    grid, values = simulate(COARSEST)
    while True:
        finer, best = simulate(2 * len(grid.readout))
        refinement, enough = held_against(best, grid, values)
        if enough or 2 * refinement.nodes > FINEST:
            break
        grid, values = finer, best
    too_few = refinement.nodes // 2
    for _ in range(_HALVINGS if enough and refinement.nodes > COARSEST else 0):
        between, will_do = held_against(best, *simulate(round(float(np.sqrt(too_few * refinement.nodes)))))
        if will_do:
            refinement = between
        else:
            too_few = between.nodes
    return refinement
