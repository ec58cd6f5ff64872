"""Number of steps of an ensemble: settled by measurement on a campaign's own samples."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array


def largest_share(values: Array, best: Array) -> float:
    """Compute the largest difference as a share of its output's standard deviation, or size where that is zero."""
    scale = best.std(axis=0)
    scale = np.where(scale > 0.0, scale, np.abs(best).max(axis=0))
    return float((np.abs(values - best).max(axis=0)[scale > 0.0] / scale[scale > 0.0]).max(initial=0.0))


def refined_steps(
    simulate: Callable[[int], tuple[Array, NDArray[np.bool_]]], fewest: int, most: int, order: int, tolerance: float
) -> tuple[int, float]:
    """Find the fewest equal steps with which a scheme meets a tolerance, and its error with them.

    With twice as many steps, the error of a scheme of order p falls to a share of 2^-p: that of the fewer steps is the
    difference times ``2^p / (2^p - 1)``.

    Parameters
    ----------
    simulate : callable
        Steps to outcomes of some probes, shape (n, outputs), and whether each is valid, shape (n,).
    fewest, most : int
        First number of steps, and the last that is tried.
    tolerance : float
        Largest error of any probe, as a share of the probes' standard deviation in that output.
    """

    def outcomes(steps: int) -> Array:
        values, valid = simulate(steps)
        return np.asarray(np.where(valid[:, None], values, 0.0))

    steps = fewest
    while True:
        error = largest_share(outcomes(steps), outcomes(2 * steps)) / (1.0 - 0.5**order)
        if error <= tolerance or steps >= most:
            return steps, error
        wanted = int(np.ceil(1.1 * steps * (error / tolerance) ** (1.0 / order)))
        steps = min(max(wanted, steps + 1), most)
