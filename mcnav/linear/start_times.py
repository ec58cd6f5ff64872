"""Dispersion against the start time of navigation: P(t_s) S P(t_s)^T for one start covariance at every start time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcnav.linear.covariance import propagated_covariance
from mcnav.scenarios.protocol import StartTimes

Array = NDArray[np.float64]


@dataclass(frozen=True)
class StartTimeStudy:
    """What a start time does to the final errors.

    Attributes
    ----------
    axes : str
        Convention of the reference axes.
    times : ndarray, shape (n,)
        Start times, s from the scenario's event.
    partials : ndarray, shape (n, outputs, sources)
        SI.
    sigma : ndarray, shape (n, outputs)
        Dispersion by the linear model, SI.
    """

    axes: str
    times: Array
    partials: Array
    sigma: Array

    @property
    def best(self) -> Array:
        """Position of the start time of least dispersion in each output, up to the event, shape (outputs,).

        Later starts are left out: at the very end only the start errors themselves remain.
        """
        before = max(1, int(np.searchsorted(self.times, 0.0, side="right")))
        return np.asarray(np.argmin(self.sigma[:before], axis=0))


def study_start_times(scenario: StartTimes, start_covariance: Array, axes: str, count: int) -> StartTimeStudy:
    """Partial derivatives and dispersion for evenly spaced start times.

    Parameters
    ----------
    scenario : StartTimes
    start_covariance : ndarray, shape (sources, sources)
        Of the errors at whatever time navigation starts.
    axes : str
        ``start``: reference axes alined at each start time; ``trajectory``: those of the first point throughout.
    count : int
        Start times.
    """
    times = scenario.start_times(count)
    partials = scenario.partials_at(times, axes)
    variances = [np.diag(propagated_covariance(matrix, start_covariance)) for matrix in partials]
    return StartTimeStudy(axes, times, partials, np.sqrt(np.maximum(variances, 0.0)))
