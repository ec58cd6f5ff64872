"""Reentry navigation: the system of NASA TN D-1772 as a scenario.

Two engines fly it. ``ensemble`` takes Encke's form in cartesian axes through a compiled kernel on a shared grid;
``reference`` takes the report's polar equations, sample by sample, through scipy's DOP853.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from mcnav.constants import EARTH_RADIUS, REENTRY_ALTITUDE
from mcnav.physics.adjoint import Adjoint, sweep
from mcnav.physics.ensemble import fly_ensemble
from mcnav.physics.grid import Grid
from mcnav.physics.linearized import linearise
from mcnav.physics.navigator import Diverged, fly_indicated
from mcnav.physics.refinement import refined_grid
from mcnav.physics.truth import NeverComesDown, Trajectory, airspeed_and_angle, fly_truth
from mcnav.physics.vehicle import Vehicle
from mcnav.scenarios.protocol import History, LinearModel, Outcomes, Output, Prepared, ScenarioError, Source
from mcnav.scenarios.tn_d1772 import ERRORS

Array = NDArray[np.float64]

SOURCES: Final = tuple(
    Source(name, unit, shown_in, float(nominal))
    for (name, unit, shown_in), nominal in zip(
        [
            ("altitude", "m", "km"),
            ("range", "m", "km"),
            ("altitude_rate", "m/s", "m/s"),
            ("range_rate", "m/s", "m/s"),
            ("misalignment", "rad", "arcsec"),
            ("gyro_drift", "rad/s", "deg/h"),
            ("bias_x", "m/s^2", "ug"),
            ("bias_z", "m/s^2", "ug"),
            ("scale_factor_x", "1", "ppm"),
            ("scale_factor_z", "1", "ppm"),
        ],
        ERRORS,
        strict=True,
    )
)
"""Initial-condition and equipment errors, the columns of P."""

OUTPUTS: Final = (
    Output("altitude", "m", "km"),
    Output("range", "m", "km"),
    Output("altitude_rate", "m/s", "m/s"),
    Output("range_rate", "m/s", "m/s"),
)
"""Final navigation errors, the rows of P."""

ENSEMBLE_CHUNK: Final = 8_192
REFERENCE_CHUNK: Final = 32
HISTORY_POINTS: Final = 600

HAND_OVER_SHARE: Final = 0.01
"""When more of the probes leave the kernel's validity, the reference path will do most of the work, in processes."""


@dataclass(frozen=True)
class Flight:
    """What is to be flown.

    Attributes
    ----------
    first_point : tuple of float
        Polar state at which the truth begins: m, rad, m/s, rad/s.
    vehicle : Vehicle
    final_altitude : float
        m.
    start : float, optional
        Start of navigation, s from reentry (negative before); by default the first point of the truth.
    axes : str
        ``start``: alined at the start of navigation. ``trajectory``: as alined at the first point of the truth.
    accelerometers_off_above : float, optional
        Actual altitude (m) above which the accelerometers' outputs are taken as zero.
    """

    first_point: tuple[float, ...]
    vehicle: Vehicle
    final_altitude: float
    start: float | None = None
    axes: Literal["start", "trajectory"] = "start"
    accelerometers_off_above: float | None = None


@dataclass(frozen=True)
class Navigation:
    """A flown truth with the start of navigation and the reference axes settled: what every engine flies along.

    Attributes
    ----------
    trajectory : Trajectory
    start : float
        Start of navigation, s from the first point of the truth.
    theta_axes : float
        Range angle of the reference axes, rad.
    """

    trajectory: Trajectory
    start: float
    theta_axes: float

    def by_reference(self, errors: Array, rows: Iterable[int]) -> tuple[dict[int, Array], dict[int, str]]:
        """Fly some rows of errors, shape (n, 10), on the reference path: results and failures by row."""
        flown: dict[int, Array] = {}
        failures: dict[int, str] = {}
        for row in rows:
            try:
                flown[row] = fly_indicated(self.trajectory, errors[row], self.start, self.theta_axes)
            except Diverged as failure:
                failures[row] = str(failure)
        return flown, failures


@dataclass(frozen=True)
class ReferenceEngine:
    """The polar equations of the report, one sample at a time."""

    navigation: Navigation
    parallel: str = "processes"
    chunk: int = REFERENCE_CHUNK
    accuracy: str = "polar equations of NASA TN D-1772, DOP853 with relative tolerance 1e-12"

    def propagate(self, errors: Array) -> Outcomes:
        """Fly samples, shape (n, 10)."""
        flown, failures = self.navigation.by_reference(errors, range(len(errors)))
        values = np.full((len(errors), len(OUTPUTS)), np.nan)
        for row, outcome in flown.items():
            values[row] = outcome
        return Outcomes(values, failures)


@dataclass(frozen=True)
class EnsembleEngine:
    """Encke's form on a shared grid; a sample beyond its validity is flown by the reference path instead."""

    navigation: Navigation
    grid: Grid
    accuracy: str
    parallel: str = "threads"
    chunk: int = ENSEMBLE_CHUNK

    def propagate(self, errors: Array) -> Outcomes:
        """Fly samples, shape (n, 10)."""
        values, valid = fly_ensemble(self.grid, errors)
        beyond = np.flatnonzero(~valid)
        flown, failures = self.navigation.by_reference(errors, (int(row) for row in beyond))
        values[beyond] = np.nan
        for row, outcome in flown.items():
            values[row] = outcome
        return Outcomes(values, failures, len(beyond))


class Reentry:
    """The scenario: a truth flown once, and the ways to fly a navigator along it.

    Raises
    ------
    ScenarioError
        When the truth never comes down, or navigation would start outside it.
    """

    sources = SOURCES
    outputs = OUTPUTS
    engines = ("ensemble", "reference")

    def __init__(self, flight: Flight) -> None:
        if not 0.0 <= flight.final_altitude < REENTRY_ALTITUDE:
            raise ScenarioError(
                "final_altitude",
                f"{flight.final_altitude / 1e3:g} km cannot be the end of a reentry; it lies from 0 km to below "
                f"{REENTRY_ALTITUDE / 1e3:g} km",
            )
        try:
            trajectory = fly_truth(
                np.array(flight.first_point), flight.vehicle, flight.final_altitude, flight.accelerometers_off_above
            )
        except NeverComesDown as failure:
            raise ScenarioError("final_altitude", str(failure)) from None
        start = 0.0 if flight.start is None else trajectory.reentry_time + flight.start
        if not 0.0 <= start < trajectory.final_time:
            earliest, latest = -trajectory.reentry_time, trajectory.final_time - trajectory.reentry_time
            raise ScenarioError(
                "start",
                f"{(start - trajectory.reentry_time) / 60:g} min from reentry is not on the trajectory, which runs "
                f"from {earliest / 60:.2f} min to {latest / 60:.2f} min",
            )
        aligned = trajectory.state(start if flight.axes == "start" else 0.0)
        self.navigation = Navigation(trajectory, start, float(aligned[1]))

    @property
    def trajectory(self) -> Trajectory:
        """The truth."""
        return self.navigation.trajectory

    @cached_property
    def _model(self) -> LinearModel:
        return LinearModel(*linearise(self.trajectory, self.navigation.start, self.navigation.theta_axes))

    def linearised(self) -> LinearModel:
        """Partial derivatives by the variational equations along the truth."""
        return self._model

    @cached_property
    def _adjoint(self) -> Adjoint:
        return sweep(self.trajectory, float(self.trajectory.state(0.0)[1]))

    def start_times(self, count: int) -> Array:
        """Start times from the first point of the truth to its end, shape (count,), s from reentry."""
        trajectory = self.trajectory
        return np.asarray(np.linspace(0.0, trajectory.final_time, count) - trajectory.reentry_time)

    def partials_at(self, times: Array, axes: str = "start") -> Array:
        """Partial derivatives for navigation started at each time (s from reentry), shape (n, 4, 10).

        From one backward sweep of the adjoint. ``axes`` as in `Flight`.
        """
        starts = np.clip(times + self.trajectory.reentry_time, 0.0, self.trajectory.final_time)
        return np.array([self._adjoint.partials(float(start), axes) for start in starts])

    def prepared(self, engine: str, probes: Array) -> Prepared:
        """A flyer for one of `engines`; the ensemble's grid is refined until the probes, shape (n, 10), agree."""
        if engine == "reference":
            return ReferenceEngine(self.navigation)
        refined = refined_grid(self.trajectory, self.navigation.start, self.navigation.theta_axes, probes)
        accuracy = (
            f"Encke's form, Nyström order 4, {len(refined.grid.steps)} steps; largest numerical error of "
            f"{len(probes)} probe samples {refined.error:.1e} of an output's dispersion"
        )
        ready = EnsembleEngine(self.navigation, refined.grid, accuracy)
        if ready.propagate(probes).handed_over > HAND_OVER_SHARE * len(probes):
            return replace(ready, parallel="processes", chunk=REFERENCE_CHUNK)
        return ready

    def history(self) -> History:
        """Altitude, range, speed, angle and force of the truth against time from reentry."""
        reentry, final = self.trajectory.reentry_time, self.trajectory.final_time
        share = (final - reentry) / final
        before = np.linspace(0.0, reentry, max(2, round(HISTORY_POINTS * (1.0 - share))), endpoint=False)
        times = np.concatenate([before, np.linspace(reentry, final, max(2, round(HISTORY_POINTS * share)))])
        states, forces = self.trajectory.states(times), self.trajectory.forces(times)
        speeds, angles = np.array([airspeed_and_angle(state) for state in states]).T
        columns = {
            "time from reentry [min]": (times - reentry) / 60.0,
            "altitude [km]": (states[:, 0] - EARTH_RADIUS) / 1e3,
            "range [km]": EARTH_RADIUS * states[:, 1] / 1e3,
            "altitude rate [km/s]": states[:, 2] / 1e3,
            "range rate [km/s]": EARTH_RADIUS * states[:, 3] / 1e3,
            "airspeed [km/s]": speeds / 1e3,
            "flight-path angle [deg]": np.degrees(angles),
            "horizontal force [m/s^2]": forces[:, 0],
            "vertical force, down [m/s^2]": forces[:, 1],
        }
        events = {
            "reentry": 0.0,
            "start of navigation": (self.navigation.start - reentry) / 60.0,
            "final altitude": (final - reentry) / 60.0,
        }
        return History(columns, events)
