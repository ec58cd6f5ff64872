"""Engines of a reentry: navigation along an integrated truth, simulated by the polar equations and on a shared grid."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.failure import Failure
from mcnav.contract.filter_record import FilterSchema
from mcnav.contract.history import Epochs
from mcnav.contract.power_sums import PowerSums
from mcnav.contract.samples import Batch, SimulationResult
from mcnav.numerics.integration import Diverged
from mcnav.numerics.power_sums import sum_powers
from mcnav.systems.reentry.ensemble.grid import Grid
from mcnav.systems.reentry.ensemble.history_kernel import (
    HistoryGrid,
    followed_samples,
    history_grid,
    history_sums,
    nominal_errors,
    simulate_histories,
)
from mcnav.systems.reentry.ensemble.kernel import simulate_ensemble
from mcnav.systems.reentry.ensemble.transition import linear_response
from mcnav.systems.reentry.navigator import simulate_indicated
from mcnav.systems.reentry.outputs import (
    DEVIATIONS,
    FurtherOutput,
    append_errors,
)
from mcnav.systems.reentry.truth import Trajectory
from mcnav.systems.sample_loop import simulate_each

ENSEMBLE_CHUNK: Final = 8_192
REFERENCE_CHUNK: Final = 32
HISTORY_TIME: Final = "time from reentry [min]"

EPOCHS: Final = 60
"""Instants at which errors are read out."""

FEWEST_AFTER_REENTRY: Final = 24
"""Smallest number of them: the flight through the atmosphere is short and eventful."""

HISTORY_NODES: Final = 1.5
"""Nodes for histories, as a multiple of those for final errors: remainders that stand in want them closer."""


@dataclass(frozen=True)
class Navigation:
    """An integrated truth with its start of navigation and reference axes, as every engine uses it.

    Attributes
    ----------
    start : float
        Start of navigation, s from the first point of the truth.
    theta_axes : float
        Range angle of the reference axes, rad.
    further : tuple of FurtherOutput
        Outputs after the errors of the polar state.
    further_epochs : tuple of float
        Epochs besides the usual ones, s from reentry.
    """

    trajectory: Trajectory
    start: float
    theta_axes: float
    further: tuple[FurtherOutput, ...] = ()
    further_epochs: tuple[float, ...] = ()

    @cached_property
    def final(self) -> Array:
        """Actual polar state at the end, shape (4,)."""
        return self.trajectory.state(self.trajectory.final_time)

    def outputs_from(self, deviations: Array) -> Array:
        """Append further outputs to errors of the polar state at the end, shape (..., 4)."""
        return append_errors(self.further, deviations, self.final)

    def simulate_reference(self, errors: Array, rows: Iterable[int], values: Array) -> dict[int, Failure]:
        """Simulate some rows of errors, shape (n, sources), by the reference engine; see `simulate_each`."""

        def simulate(row: int) -> Array:
            deviations = simulate_indicated(self.trajectory, errors[row], self.start, self.theta_axes)
            return self.outputs_from(deviations)

        return simulate_each(simulate, rows, values, Diverged)


@dataclass(frozen=True)
class ReferenceEngine:
    """The polar equations of the report, one sample at a time."""

    navigation: Navigation
    parallel: str = "processes"
    chunk: int = REFERENCE_CHUNK
    accuracy: str = "polar equations of NASA TN D-1772, DOP853 with relative tolerance 1e-12"
    epochs: Epochs | None = None
    noisy: bool = False
    filter: FilterSchema | None = None

    def simulate(self, batch: Batch, noise: bool = True) -> SimulationResult:
        """Simulate samples."""
        errors = batch.errors
        values = np.empty((len(errors), len(DEVIATIONS) + len(self.navigation.further)))
        return SimulationResult(values, self.navigation.simulate_reference(errors, range(len(errors)), values))


@dataclass(frozen=True)
class EnsembleEngine:
    """Variation of constants on a shared grid; the reference engine simulates the samples beyond its validity."""

    navigation: Navigation
    grid: Grid
    accuracy: str
    parallel: str = "threads"
    chunk: int = ENSEMBLE_CHUNK
    noisy: bool = False
    filter: FilterSchema | None = None

    def simulate(self, batch: Batch, noise: bool = True) -> SimulationResult:
        """Simulate samples."""
        errors = batch.errors
        deviations, valid = simulate_ensemble(self.grid, errors)
        values = self.navigation.outputs_from(deviations)
        beyond = np.flatnonzero(~valid).tolist()
        return SimulationResult(values, self.navigation.simulate_reference(errors, beyond, values), len(beyond))

    @cached_property
    def epochs(self) -> Epochs:
        """Evenly spaced before reentry, and evenly after it."""
        return Epochs(HISTORY_TIME, reading_times(self.navigation) / 60.0, events(self.navigation))

    @cached_property
    def _moments(self) -> Array:
        """The epochs, s from the first point of the truth."""
        times = self.epochs.times * 60.0 + self.navigation.trajectory.reentry_time
        return np.clip(times, self.navigation.start, self.navigation.trajectory.final_time)

    @cached_property
    def _actual(self) -> Array:
        return self.navigation.trajectory.states(self._moments)

    @cached_property
    def _followed(self) -> HistoryGrid:
        navigation = self.navigation
        response = linear_response(navigation.trajectory, navigation.start, navigation.theta_axes)
        return history_grid(response, int(np.ceil(HISTORY_NODES * len(self.grid.readout))), self._moments)

    def histories(self, errors: Array) -> Array:
        """Simulate samples, shape (n, sources): their errors at every epoch, shape (n, m, outputs)."""
        deviations, component = simulate_histories(self._followed, errors)
        deviations[~followed_samples(component)] = np.nan
        return append_errors(self.navigation.further, deviations, self._actual)

    def history_sums(self, errors: Array) -> PowerSums:
        """Add up power sums of samples' errors, shape (n, sources), at every epoch.

        The kernel adds those of the polar state as it goes; further outputs need the histories.
        """
        if not self.navigation.further:
            return history_sums(self._followed, errors)
        histories = self.histories(errors)
        pivot = append_errors(self.navigation.further, nominal_errors(self._followed), self._actual)
        return sum_powers(histories[np.isfinite(histories).all(axis=(1, 2))], pivot)


def reading_times(navigation: Navigation) -> Array:
    """Space epochs evenly before reentry and evenly after it, and add further ones; s from reentry."""
    start, reentry, end = navigation.start, navigation.trajectory.reentry_time, navigation.trajectory.final_time
    times = np.linspace(start, end, EPOCHS)
    if start < reentry:
        after = min(max(FEWEST_AFTER_REENTRY, round(EPOCHS * (end - reentry) / (end - start))), EPOCHS - 2)
        before = np.linspace(start, reentry, EPOCHS - after, endpoint=False)
        times = np.concatenate([before, np.linspace(reentry, end, after)])
    return np.union1d(times - reentry, navigation.further_epochs)


def events(navigation: Navigation) -> dict[str, float]:
    """Name the instants of a flight, minutes from reentry."""
    reentry, final = navigation.trajectory.reentry_time, navigation.trajectory.final_time
    return {
        "reentry": 0.0,
        "start of navigation": (navigation.start - reentry) / 60.0,
        "final altitude": (final - reentry) / 60.0,
    }
