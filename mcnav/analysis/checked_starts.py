"""Starts of navigation that a Monte Carlo simulation has checked."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mcnav.arrays.types import Array
from mcnav.linear.start_times import StartTimeStudy

if TYPE_CHECKING:
    from mcnav.analysis.comparison import Comparison


def simulated_rms(study: StartTimeStudy, time: float, comparison: Comparison) -> Array:
    """Return the root mean squares of a Monte Carlo check of a start time, shape (outputs,): sigmas without means."""
    sigma = np.array([output.sigma_paired for output in comparison.outputs])
    if study.means is None:
        return sigma
    linear = study.means[int(np.abs(study.times - time).argmin())]
    means = linear + np.array([output.bias.value for output in comparison.outputs])
    return np.asarray(np.hypot(sigma, means))
