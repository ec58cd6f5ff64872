"""Dispersion against the start time of navigation: P(t_s) S(t_s) P(t_s)^T, and with noise Q(t_s) added."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.history import StartClock
from mcnav.contract.quantities import kind_of
from mcnav.contract.scenario import Scenario
from mcnav.linear.covariance import propagated_covariance


@dataclass(frozen=True)
class ErrorSchedule:
    """Start errors as a function of the time at which navigation starts.

    Attributes
    ----------
    multiples : mapping of int to (ndarray, ndarray)
        By source: times (rising, s from the scenario's event), and the multiples of its stated errors at these times,
        linear between the times and constant beyond them. Other sources keep their stated errors.
    """

    multiples: Mapping[int, tuple[Array, Array]] = field(default_factory=dict)

    def at(self, times: Array, sources: int) -> Array:
        """Interpolate the multiple of every source's errors at each time, shape (n, sources)."""
        result = np.ones((len(times), sources))
        for source, (known, values) in self.multiples.items():
            result[:, source] = np.interp(times, known, values)
        return result


@dataclass(frozen=True)
class StartTimeStudy:
    """Effect of the start time on the final errors, by the linear model.

    Attributes
    ----------
    axes : str
        Convention of the reference axes.
    times : ndarray, shape (n,)
        Start times, s from the scenario's event.
    partials, effects : ndarray, shape (n, outputs, sources)
        Partial derivatives, and final errors due to one sigma of each source at that start time, SI.
    sigma : ndarray, shape (n, outputs)
        Dispersion, SI.
    weights : ndarray, shape (outputs,)
        Weight of an output's sigma, per SI unit, in the weighted dispersion.
    clock : StartClock
        How the start times are counted.
    noise : ndarray, shape (n, outputs), optional
        Sigma of the part from noise, SI; none for a scenario without noise.
    means : ndarray, shape (n, outputs), optional
        Mean errors, SI; none where they are zero. Start times rank by root mean square.
    """

    axes: str
    times: Array
    partials: Array
    effects: Array
    sigma: Array
    weights: Array
    clock: StartClock
    noise: Array | None = None
    means: Array | None = None

    @property
    def rms(self) -> Array:
        """Root mean square errors, shape (n, outputs): sigmas where mean errors are zero."""
        return self.sigma if self.means is None else np.hypot(self.sigma, self.means)

    @property
    def means_matter(self) -> bool:
        """Whether a mean error exceeds its sigma at a start time up to the event."""
        if self.means is None:
            return False
        return bool((np.abs(self.means) > self.sigma)[: self.before_event].any())

    @property
    def weighted(self) -> Array:
        """Root sum square of the outputs' weighted root mean squares, shape (n,)."""
        return np.asarray(np.sqrt(((self.rms * self.weights) ** 2).sum(axis=1)))

    @property
    def before_event(self) -> int:
        """Number of start times that are not later than the event, or of all of them without an event.

        Only these are candidates for the best: at the very end only the start errors remain.
        """
        if not self.clock.event:
            return len(self.times)
        return max(1, int(np.searchsorted(self.times, 0.0, side="right")))

    @property
    def best(self) -> Array:
        """Position of the start time of the least root mean square of each output, up to the event, (outputs,)."""
        return np.asarray(np.argmin(self.rms[: self.before_event], axis=0))

    @property
    def best_weighted(self) -> int:
        """The same for the weighted root mean squares."""
        return int(np.argmin(self.weighted[: self.before_event]))


def study_start_times(
    scenario: Scenario,
    start_covariance: Array,
    axes: str,
    count: int,
    schedule: ErrorSchedule | None = None,
    weights: Array | None = None,
) -> StartTimeStudy:
    """Compute partial derivatives and dispersion for evenly spaced start times, for the stated errors' covariance.

    Parameters
    ----------
    axes : str
        ``start``: reference axes aligned at each start time; ``trajectory``: those of the first point throughout.
    schedule : ErrorSchedule, optional
        Constant by default.
    weights : ndarray, shape (outputs,), optional
        See `StartTimeStudy`; by default as `usual_weights` has them.
    """
    times = scenario.start_times(count)
    partials = scenario.partials_at(times, axes)
    multiples = (schedule or ErrorSchedule()).at(times, len(start_covariance))
    variances = np.array(
        [
            np.diag(propagated_covariance(matrix * multiple, start_covariance))
            for matrix, multiple in zip(partials, multiples, strict=True)
        ]
    )
    noise = scenario.noise_at(times, axes) if scenario.parts.noise else None
    of_noise = None
    if noise is not None and noise.any():
        of_noise = np.diagonal(noise, axis1=1, axis2=2)
        variances = variances + of_noise
        of_noise = np.sqrt(of_noise)
    sigma = np.sqrt(np.maximum(variances, 0.0))
    weights = usual_weights(scenario, sigma[0]) if weights is None else weights
    effects = partials * (multiples * np.sqrt(np.diag(start_covariance)))[:, None, :]
    return StartTimeStudy(axes, times, partials, effects, sigma, weights, scenario.start_clock, of_noise)


def usual_weights(scenario: Scenario, first: Array) -> Array:
    """Return the weights of a campaign without any: over the root mean squares of a start at the first point.

    Those alone count that the clock weighs, if they vary.

    Parameters
    ----------
    first : ndarray, shape (outputs,)
    """
    counted = first > 0.0
    weighed = counted & np.array([kind_of(output) == scenario.start_clock.weighs for output in scenario.outputs])
    counted = weighed if weighed.any() else counted
    return np.divide(1.0, first, out=np.zeros_like(first), where=counted)
