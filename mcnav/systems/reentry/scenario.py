"""Reentry navigation: the system of NASA TN D-1772 as a scenario.

Two engines simulate it. ``ensemble`` uses cartesian axes and the variation of constants, in a compiled kernel on a
shared grid; ``reference`` integrates the report's polar equations, sample by sample, with DOP853.
"""

from __future__ import annotations

import contextlib
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final, Literal, Self

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.engine import Engine, without_noise
from mcnav.contract.history import History, Panel, StartClock
from mcnav.contract.linear import LinearSystem
from mcnav.contract.quantities import Output, Source
from mcnav.contract.questions import TimelineParts
from mcnav.contract.scenario import Capability, PlainScenario, ScenarioError
from mcnav.numerics.integration import Diverged
from mcnav.physics.constants import EARTH_RADIUS, REENTRY_ALTITUDE, STANDARD_GRAVITY
from mcnav.systems.histories import with_errors
from mcnav.systems.reentry.engines import (
    HISTORY_TIME,
    REFERENCE_CHUNK,
    EnsembleEngine,
    Navigation,
    ReferenceEngine,
    events,
    reading_times,
)
from mcnav.systems.reentry.ensemble.refinement import refined_grid
from mcnav.systems.reentry.instruments import Error
from mcnav.systems.reentry.linearized import LinearNavigator
from mcnav.systems.reentry.navigator import navigation_error, simulate_indicated
from mcnav.systems.reentry.outputs import (
    DEVIATIONS,
    FurtherOutput,
    append_errors,
)
from mcnav.systems.reentry.shared_steps import simulate_together
from mcnav.systems.reentry.table_i import ERROR_SIZES
from mcnav.systems.reentry.truth import NoReentry, Trajectory, airspeed_and_angle, fly_truth
from mcnav.systems.reentry.vehicle import Vehicle
from mcnav.systems.variations import check_span

SOURCES: Final = (
    Source("altitude", "m", "km", ERROR_SIZES[Error.ALTITUDE]),
    Source("range", "m", "km", ERROR_SIZES[Error.RANGE]),
    Source("altitude_rate", "m/s", "m/s", ERROR_SIZES[Error.ALTITUDE_RATE]),
    Source("range_rate", "m/s", "m/s", ERROR_SIZES[Error.RANGE_RATE]),
    Source("misalignment", "rad", "arcsec", ERROR_SIZES[Error.MISALIGNMENT]),
    Source("gyro_drift", "rad/s", "deg/h", ERROR_SIZES[Error.GYRO_DRIFT]),
    Source("bias_x", "m/s^2", "ug", ERROR_SIZES[Error.BIAS_X]),
    Source("bias_z", "m/s^2", "ug", ERROR_SIZES[Error.BIAS_Z]),
    Source("scale_factor_x", "1", "ppm", ERROR_SIZES[Error.SCALE_FACTOR_X]),
    Source("scale_factor_z", "1", "ppm", ERROR_SIZES[Error.SCALE_FACTOR_Z]),
    Source("cross_axis_x", "1", "ppm", 1e-4, later=True),
    Source("cross_axis_z", "1", "ppm", 1e-4, later=True),
)
"""Initial-condition and equipment errors in the order of `Error`, the columns of P."""

REVISION: Final = 2
"""Counts the changes of the samples' last digits: 1 had scipy's integrator, for the samples of the reference engine."""

HISTORY_POINTS: Final = 600
PANELS: Final = (
    Panel("The whole flight", "range [km]", ("altitude [km]",), log=True),
    Panel("From reentry on", "range [km]", ("altitude [km]",), begin=0.0, from_zero=True),
    Panel("Speed", "time from reentry [min]", ("airspeed [km/s]",), marks=("start of navigation",)),
    Panel("Aerodynamic force", "time from reentry [min]", ("aerodynamic force [g]",), begin=0.0, from_zero=True),
)
"""Diagrams of the flight in a report."""

HAND_OVER_SHARE: Final = 0.01
"""Share of probes beyond the kernel's validity above which the reference path does the work, in processes."""


@dataclass(frozen=True)
class Flight:
    """A truth, and when navigation starts along it.

    Attributes
    ----------
    first_point : tuple of float
        Polar state at which the truth begins: m, rad, m/s, rad/s.
    final_altitude : float
        m.
    start : float, optional
        Start of navigation, s from reentry (negative before); by default the first point of the truth.
    axes : str
        ``start``: aligned at the start of navigation. ``trajectory``: as aligned at the first point of the truth.
    accelerometers_off_above : float, optional
        Actual altitude (m) above which the accelerometers' outputs are taken as zero.
    """

    first_point: tuple[float, ...]
    vehicle: Vehicle
    final_altitude: float
    start: float | None = None
    axes: Literal["start", "trajectory"] = "start"
    accelerometers_off_above: float | None = None


def _navigation(trajectory: Trajectory, start: float, axes: str, further: tuple[FurtherOutput, ...]) -> Navigation:
    """Start navigation along a truth at a time (s from its first point); `ScenarioError` when that is not on it."""
    if not 0.0 <= start < trajectory.final_time:
        earliest, latest = -trajectory.reentry_time, trajectory.final_time - trajectory.reentry_time
        raise ScenarioError(
            "start",
            f"{(start - trajectory.reentry_time) / 60:g} min from reentry is not on the trajectory, which runs "
            f"from {earliest / 60:.2f} min to {latest / 60:.2f} min",
        )
    aligned = trajectory.state(start if axes == "start" else 0.0)
    return Navigation(trajectory, start, float(aligned[1]), further)


class Reentry(PlainScenario):
    """The scenario: a truth integrated once, and the engines that simulate a navigator along it.

    Its outputs are the errors of the polar state and ``further`` ones. Raises `ScenarioError` when the truth never
    comes down, or navigation would start outside it.
    """

    sources: tuple[Source, ...] = SOURCES
    engines = ("ensemble", "reference")
    revision = REVISION
    start_clock = StartClock("min from reentry", "reentry")
    can = frozenset({Capability.REPLAY})
    parts = TimelineParts("any time")

    _latest: tuple[bytes, EnsembleEngine] | None = None
    """Content of the last probes, and the ensemble: another run of the campaign has the same."""

    def __init__(self, flight: Flight, further: tuple[FurtherOutput, ...] = ()) -> None:
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
        except NoReentry as failure:
            raise ScenarioError("final_altitude", str(failure)) from None
        start = 0.0 if flight.start is None else trajectory.reentry_time + flight.start
        self.navigation = _navigation(trajectory, start, flight.axes, further)

    @property
    def trajectory(self) -> Trajectory:
        """The truth."""
        return self.navigation.trajectory

    @property
    def outputs(self) -> tuple[Output, ...]:
        """Errors of the polar state, and further outputs."""
        return (*DEVIATIONS, *(further_output.output for further_output in self.navigation.further))

    @cached_property
    def _navigator(self) -> LinearNavigator:
        navigation = self.navigation
        return LinearNavigator(self.trajectory, navigation.start, navigation.theta_axes, navigation.further)

    def linear(self, times: Array | None = None) -> LinearSystem:
        """Compute partial derivatives at times (s from reentry), by default at the end, along the truth."""
        reentry, final = self.trajectory.reentry_time, self.trajectory.final_time
        since = np.array([final]) if times is None else self._since(times)
        partials, nominal = self._navigator.read(since)
        return LinearSystem((since - reentry) / 60.0, partials, nominal, label=HISTORY_TIME)

    @property
    def reading_times(self) -> Array:
        """The epochs, s from reentry."""
        return reading_times(self.navigation)

    def with_epochs(self, times: tuple[float, ...]) -> Self:
        """Return the same with further epochs, s from reentry; the truth is shared."""
        other = copy(self)
        other.navigation, other._latest = replace(self.navigation, further_epochs=times), None
        other.further_epochs = times
        return other

    def linear_over_time(self, count: int | None = None) -> LinearSystem:
        """Compute the partial derivatives at the epochs, whatever the count."""
        return self.linear(self.reading_times)

    def _since(self, times: Array) -> Array:
        """Convert times from reentry to times from the first point of the truth, s.

        Raises `ScenarioError` outside of navigation, beyond rounding.
        """
        since, first, last = times + self.trajectory.reentry_time, self.navigation.start, self.trajectory.final_time
        check_span(times, first - self.trajectory.reentry_time, last - self.trajectory.reentry_time, " from reentry")
        return np.asarray(np.clip(since, first, last))

    def started_at(self, time: float, axes: str) -> Reentry:
        """Start navigation of the same flight at another time (s from reentry); the truth is shared.

        Raises `ScenarioError` when the time is not on the trajectory.
        """
        other = object.__new__(type(self))
        since = time + self.trajectory.reentry_time
        other.navigation = _navigation(self.trajectory, since, axes, self.navigation.further)
        return other

    def check_start_axes(self, axes: str) -> None:
        """Accept both conventions of the reference axes."""

    def start_times(self, count: int) -> Array:
        """Space start times from the first point of the truth to its end, shape (count,), s from reentry."""
        trajectory = self.trajectory
        return np.asarray(np.linspace(0.0, trajectory.final_time, count) - trajectory.reentry_time)

    def partials_at(self, times: Array, axes: str = "start") -> Array:
        """Compute the partial derivatives for navigation started at each time (s from reentry).

        Of shape (n, outputs, sources), from one backward recursion along the truth: where the accelerometers are
        switched off above an altitude, a perfect navigator departs from the truth by the drag that it misses, which
        this neglects. ``axes`` as in `Flight`.
        """
        starts = np.clip(times + self.trajectory.reentry_time, 0.0, self.trajectory.final_time)
        return self._told.final_partials(starts, axes)

    @cached_property
    def _told(self) -> LinearNavigator:
        first = float(self.trajectory.state(0.0)[1])
        return LinearNavigator(self.trajectory, 0.0, first, self.navigation.further, told=True)

    def error_histories(self, errors: Array, times: Array) -> tuple[Array, Array, Array]:
        """Simulate a few samples: actual and indicated polar states, and their errors, at times (s from reentry).

        Parameters
        ----------
        errors : ndarray, shape (n, sources)
        times : ndarray, shape (m,)
            Rising, none before the start of navigation.

        Returns
        -------
        actual, indicated, errors : ndarray, shapes (m, 4), (m, n, 4), (m, n, 4)
        """
        navigation, reentry = self.navigation, self.trajectory.reentry_time
        moments = np.clip(times + reentry, navigation.start, self.trajectory.final_time)
        flown = simulate_together(self.trajectory, errors, navigation.start, navigation.theta_axes, moments)
        return *flown, navigation_error(flown[0][:, None], flown[1])

    def simulate_one(self, errors: Array) -> History:
        """Simulate one sample, shape (sources,), on the reference path: actual and indicated flight, and the errors."""
        times: list[Array] = []
        states: list[Array] = []

        def watch(since: Array, flown: Array) -> None:
            times.append(since)
            states.append(flown.T)

        navigation = self.navigation
        with contextlib.suppress(Diverged):
            simulate_indicated(self.trajectory, errors, navigation.start, navigation.theta_axes, watch)
        if not times:
            return History()
        history = np.concatenate(states)
        deviations = navigation_error(history[:, :4], history[:, 4:])
        errors_over_time = append_errors(navigation.further, deviations, history[:, :4])
        columns = {"time from reentry [min]": (np.concatenate(times) - self.trajectory.reentry_time) / 60.0}
        for name, state in (("actual", history[:, :4]), ("indicated", history[:, 4:])):
            columns[f"{name} altitude [km]"] = (state[:, 0] - EARTH_RADIUS) / 1e3
            columns[f"{name} range [km]"] = EARTH_RADIUS * state[:, 1] / 1e3
        panels = [
            Panel(
                f"{quantity.capitalize()}, actual and indicated",
                "time from reentry [min]",
                (f"actual {quantity} [km]", f"indicated {quantity} [km]"),
                ("actual", "indicated"),
                f"{quantity} [km]",
            )
            for quantity in ("altitude", "range")
        ]
        return with_errors(History(columns, {}, tuple(panels)), errors_over_time, self.outputs)

    def error_sets(self, errors: Array, times: Array) -> tuple[Array, Array]:
        """Convert errors in force at chosen times of a few flights to start errors of flights begun there.

        Initial conditions are the navigation errors at that time, ranges as arc lengths at the radius of that time; the
        platform has drifted on; biases and scale factors keep their axes.

        Parameters
        ----------
        errors : ndarray, shape (n, sources)
        times : ndarray, shape (m,)
            Rising, s from reentry, none before the start of navigation.

        Returns
        -------
        sets : ndarray, shape (m, n, sources)
        final : ndarray, shape (n, 4)
        """
        reentry, final_time = self.trajectory.reentry_time, self.trajectory.final_time
        actual, _, instantaneous = self.error_histories(errors, np.append(times, final_time - reentry))
        sets = np.tile(errors, (len(times), 1, 1))
        arcs = actual[:-1, 0] / EARTH_RADIUS
        unchanged = np.ones_like(arcs)
        sets[:, :, :4] = instantaneous[:-1] * np.stack([unchanged, arcs, unchanged, arcs], axis=1)[:, None]
        elapsed = times + reentry - self.navigation.start
        sets[:, :, Error.MISALIGNMENT] += elapsed[:, None] * errors[:, Error.GYRO_DRIFT]
        return sets, instantaneous[-1]

    def engine(self, engine: str, probes: Array) -> Engine:
        """Prepare one of `engines`; the ensemble's grid is refined until the probes, shape (n, sources), agree."""
        if engine == "reference":
            return ReferenceEngine(self.navigation)
        probed, latest = probes.tobytes(), self._latest
        if latest is None or latest[0] != probed:
            latest = self._latest = probed, self._ensemble(probes)
        return latest[1]

    def _ensemble(self, probes: Array) -> EnsembleEngine:
        refined = refined_grid(self.trajectory, self.navigation.start, self.navigation.theta_axes, probes)
        accuracy = (
            f"variation of constants, {refined.nodes} nodes; largest numerical error of "
            f"{len(probes)} probe samples {refined.error:.1e} of an output's dispersion"
        )
        ready = EnsembleEngine(self.navigation, refined.grid, accuracy)
        if without_noise(ready)(probes).fallback_count > HAND_OVER_SHARE * len(probes):
            return replace(ready, parallel="processes", chunk=REFERENCE_CHUNK)
        return ready

    def nominal(self) -> History:
        """Tabulate altitude, range, speed, angle and force of the truth against time from reentry."""
        reentry, final = self.trajectory.reentry_time, self.trajectory.final_time
        share = (final - reentry) / final
        before = np.linspace(0.0, reentry, max(2, round(HISTORY_POINTS * (1.0 - share))), endpoint=False)
        times = np.concatenate([before, np.linspace(reentry, final, max(2, round(HISTORY_POINTS * share)))])
        states, forces = self.trajectory.states(times), self.trajectory.forces(times)
        speeds, angles = np.array([airspeed_and_angle(state) for state in states]).T
        columns = {
            HISTORY_TIME: (times - reentry) / 60.0,
            "altitude [km]": (states[:, 0] - EARTH_RADIUS) / 1e3,
            "range [km]": EARTH_RADIUS * states[:, 1] / 1e3,
            "altitude rate [km/s]": states[:, 2] / 1e3,
            "range rate [km/s]": EARTH_RADIUS * states[:, 3] / 1e3,
            "airspeed [km/s]": speeds / 1e3,
            "flight-path angle [deg]": np.degrees(angles),
            "horizontal force [m/s^2]": forces[:, 0],
            "vertical force, down [m/s^2]": forces[:, 1],
            "aerodynamic force [g]": np.hypot(forces[:, 0], forces[:, 1]) / STANDARD_GRAVITY,
        }
        return History(columns, events(self.navigation), PANELS)
