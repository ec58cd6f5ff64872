"""Initial errors of speed and flight-path angle (NASA TN D-1772, p. 17), as sources beside those of the polar rates.

With ``r' = V sin gamma`` and ``r theta' = V cos gamma`` of the inertial velocity at the start of navigation, errors dV
and dgamma are errors of the two rates:

    d r'       = (V + dV) sin(gamma + dgamma) - V sin gamma,
    d r theta' = (V + dV) cos(gamma + dgamma) - V cos gamma.

They are added to those of `altitude_rate` and `range_rate`, so that engines and linearization know the polar state
alone. An altitude error keeps the polar rates; one that keeps speed and angle instead has correlations:
``dV = -cos(gamma) theta' dr`` and ``dgamma = sin(gamma) theta' dr / V``.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.engine import Engine, HistoryEngine
from mcnav.contract.filter_record import FilterSchema
from mcnav.contract.history import Epochs, History
from mcnav.contract.linear import LinearSystem
from mcnav.contract.power_sums import PowerSums
from mcnav.contract.quantities import Source
from mcnav.contract.samples import Batch, SimulationResult
from mcnav.systems.reentry.instruments import Error
from mcnav.systems.reentry.scenario import SOURCES, Reentry

SPEED_AND_ANGLE: Final = (
    Source("speed", "m/s", "m/s", 0.5, later=True),
    Source("flight_path_angle", "rad", "mrad", 5e-5, later=True),
)
"""The sources that a campaign gains where it names one of them, after those of every reentry."""


def to_polar_rates(errors: Array, start: Array) -> Array:
    """Add errors of speed and angle to those of the polar rates.

    Parameters
    ----------
    errors : ndarray, shape (..., sources + 2)
        In the order of `Error`, then speed and flight-path angle, SI.
    start : ndarray, shape (4,)
        Actual polar state at the start of navigation.

    Returns
    -------
    ndarray, shape (..., sources)
    """
    radius, _, climb, rate = start
    speed, angle = np.hypot(climb, radius * rate), np.arctan2(climb, radius * rate)
    polar, faster, steeper = np.array(errors[..., :-2]), errors[..., -2], errors[..., -1]
    # differences of sines and cosines without cancellation
    middle, half = angle + 0.5 * steeper, 2.0 * np.sin(0.5 * steeper)
    polar[..., Error.ALTITUDE_RATE] += faster * np.sin(angle + steeper) + speed * np.cos(middle) * half
    polar[..., Error.RANGE_RATE] += faster * np.cos(angle + steeper) - speed * np.sin(middle) * half
    return polar


def append_speed_and_angle(partials: Array, start: Array) -> Array:
    """Append the columns of speed and angle to partial derivatives, shape (..., outputs, sources).

    Parameters
    ----------
    start : ndarray, shape (..., 4)
        Actual polar states at the starts of navigation.
    """
    radius, climb, rate = (start[..., i, None] for i in (0, 2, 3))
    across = radius * rate
    speed = np.hypot(climb, across)
    by_climb, by_across = partials[..., Error.ALTITUDE_RATE], partials[..., Error.RANGE_RATE]
    columns = (climb * by_climb + across * by_across) / speed, across * by_climb - climb * by_across
    return np.concatenate([partials, np.stack(columns, axis=-1)], axis=-1)


@dataclass(frozen=True)
class SpeedAndAngleEngine:
    """An engine of the polar errors, given those of speed and angle as well.

    Attributes
    ----------
    polar : HistoryEngine
        Its histories are asked for where it has epochs.
    start : ndarray, shape (4,)
        Actual polar state at the start of navigation.
    """

    polar: HistoryEngine
    start: Array

    @property
    def parallel(self) -> str:
        """As of the engine of the polar errors."""
        return self.polar.parallel

    @property
    def chunk(self) -> int:
        """As of that engine."""
        return self.polar.chunk

    @property
    def accuracy(self) -> str:
        """As of that engine."""
        return self.polar.accuracy

    @property
    def epochs(self) -> Epochs | None:
        """As of that engine."""
        return self.polar.epochs

    @property
    def noisy(self) -> bool:
        """As of that engine."""
        return self.polar.noisy

    @property
    def filter(self) -> FilterSchema | None:
        """As of that engine."""
        return self.polar.filter

    def simulate(self, batch: Batch, noise: bool = True) -> SimulationResult:
        """Simulate samples."""
        return self.polar.simulate(replace(batch, errors=to_polar_rates(batch.errors, self.start)), noise)

    def histories(self, errors: Array) -> Array:
        """Simulate samples, shape (n, sources): their errors at every epoch, shape (n, m, outputs)."""
        return self.polar.histories(to_polar_rates(errors, self.start))

    def history_sums(self, errors: Array) -> PowerSums:
        """Add up power sums of samples' errors, shape (n, sources), at every epoch."""
        return self.polar.history_sums(to_polar_rates(errors, self.start))


class SpeedAndAngleReentry(Reentry):
    """A reentry with initial errors of speed and flight-path angle besides those of the polar state."""

    sources = (*SOURCES, *SPEED_AND_ANGLE)

    @property
    def _start(self) -> Array:
        """Actual polar state at the start of navigation."""
        return self.trajectory.departure(self.navigation.start)

    def _with_columns(self, system: LinearSystem) -> LinearSystem:
        return replace(system, partials=append_speed_and_angle(system.partials, self._start))

    def linear(self, times: Array | None = None) -> LinearSystem:
        """Compute partial derivatives at the end."""
        return self._with_columns(super().linear(times))

    def partials_at(self, times: Array, axes: str = "start") -> Array:
        """Compute the partial derivatives for navigation started at each time, shape (n, outputs, sources)."""
        since = np.clip(times + self.trajectory.reentry_time, 0.0, self.trajectory.final_time)
        return append_speed_and_angle(super().partials_at(times, axes), self.trajectory.states(since))

    def error_histories(self, errors: Array, times: Array) -> tuple[Array, Array, Array]:
        """Simulate a few samples at times; see `Reentry.error_histories`."""
        return super().error_histories(to_polar_rates(errors, self._start), times)

    def simulate_one(self, errors: Array) -> History:
        """Simulate one sample, shape (sources,), on the reference path."""
        return super().simulate_one(to_polar_rates(errors, self._start))

    def error_sets(self, errors: Array, times: Array) -> tuple[Array, Array]:
        """Convert errors in force to start errors of flights begun then: those of the polar state hold all."""
        sets, final = super().error_sets(errors, times)
        sets[..., -len(SPEED_AND_ANGLE) :] = 0.0
        return sets, final

    def engine(self, engine: str, probes: Array) -> Engine:
        """Prepare one of `engines`."""
        polar = super().engine(engine, to_polar_rates(probes, self._start))
        return SpeedAndAngleEngine(polar, self._start)  # type: ignore[arg-type]
