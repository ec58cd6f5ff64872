"""Trajectories of the report laid on its sphere, for the navigator in three dimensions with an inertial platform.

The plane of motion is the equator, flown eastwards, and the platform has forward, right (south) and down axes at the
start. The report's ten errors are errors in the plane; each has a counterpart across it, of the same size.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.samples import Batch, SimulationResult
from mcnav.physics.constants import EARTH_RADIUS, GRAVITATIONAL_PARAMETER
from mcnav.systems.ins.earth import Earth
from mcnav.systems.ins.filter.model import Beliefs, FilterModel
from mcnav.systems.ins.imu.instruments import CONSTANTS, OUTPUTS, Imu
from mcnav.systems.ins.scenario import Ins, Navigation
from mcnav.systems.ins.sensors.aiding import Component, Sensor, aiding_constants
from mcnav.systems.ins.sensors.registry import QUANTITIES
from mcnav.systems.ins.truth.reentry import Plane, reentry_truth
from mcnav.systems.reentry.instruments import Error
from mcnav.systems.reentry.table_i import ALL_ERRORS, ERROR_SIZES
from mcnav.validation.reproduce.tn_d1772.tables import table_i_scenario

SPHERE: Final = Earth(EARTH_RADIUS, 0.0, GRAVITATIONAL_PARAMETER, 0.0)
EQUATOR: Final = Plane.at(0.0, 0.0, 0.5 * np.pi)

ACROSS: Final = {
    "position_north": ERROR_SIZES[Error.RANGE],
    "velocity_north": ERROR_SIZES[Error.RANGE_RATE],
    "tilt_east": ERROR_SIZES[Error.MISALIGNMENT],
    "heading": ERROR_SIZES[Error.MISALIGNMENT],
    "gyro_bias_x": ERROR_SIZES[Error.GYRO_DRIFT],
    "gyro_bias_z": ERROR_SIZES[Error.GYRO_DRIFT],
    "accelerometer_bias_y": ERROR_SIZES[Error.BIAS_X],
    "accelerometer_scale_factor_y": ERROR_SIZES[Error.SCALE_FACTOR_X],
}
"""Errors across the plane and their sizes, those of their counterparts in the plane."""

ACROSS_INITIAL: Final = 4
"""Sources, of which the initial conditions and the platform's alignment come first."""

ALTITUDE, RANGE, CROSSRANGE = range(3)
RESULTS: Final = ("altitude", "range", "crossrange")
"""Final errors that are compared; ranges are arcs on the ground, as in the report."""

INSTRUMENTS: Final = {
    Error.MISALIGNMENT: ("tilt_north", -1.0),
    Error.GYRO_DRIFT: ("gyro_bias_y", 1.0),
    Error.BIAS_X: ("accelerometer_bias_x", 1.0),
    Error.BIAS_Z: ("accelerometer_bias_z", 1.0),
    Error.SCALE_FACTOR_X: ("accelerometer_scale_factor_x", 1.0),
    Error.SCALE_FACTOR_Z: ("accelerometer_scale_factor_z", 1.0),
    Error.CROSS_AXIS_X: ("accelerometer_misalignment_xz", 1.0),
    Error.CROSS_AXIS_Z: ("accelerometer_misalignment_zx", 1.0),
}
"""Errors of platform and instruments in the plane: their names in three dimensions, and signs."""

ESTIMATES: Final = ("gyro_bias", "accelerometer_bias", "accelerometer_scale_factor")
"""States that the filter of an updated navigator estimates besides position, velocity and attitude."""

TRACKING: Final[dict[str, tuple[float, float, float]]] = {
    "position": (ACROSS["position_north"], ERROR_SIZES[Error.RANGE], ERROR_SIZES[Error.ALTITUDE]),
    "velocity": (ACROSS["velocity_north"], ERROR_SIZES[Error.RANGE_RATE], ERROR_SIZES[Error.ALTITUDE_RATE]),
}
"""Sigmas of an update from the ground, north, east and down: as accurate as the report's initial conditions."""

STARS: Final = ERROR_SIZES[Error.MISALIGNMENT]
"""Sigma of a star tracker about each axis, rad: as accurate as the report's alignment."""


@dataclass(frozen=True)
class Globe:
    """A trajectory of Table I on a sphere, and the navigation of it in three dimensions.

    Attributes
    ----------
    number : int
    navigation : Ins
        From the trajectory's first point.
    reentry : float
        Time of reentry after the first point, s.
    """

    number: int
    navigation: Ins
    reentry: float

    @classmethod
    def of(cls, number: int, earth: Earth = SPHERE, plane: Plane = EQUATOR) -> Globe:
        """Lay a trajectory of Table I on an earth."""
        trajectory = table_i_scenario(number).trajectory
        truth = reentry_truth(trajectory, earth, plane)
        first, last = (float(time) for time in truth.times[[0, -1]])
        return cls(number, Ins(Navigation(truth, "inertial", first, last, Imu())), trajectory.reentry_time)

    def time(self, minutes: float) -> float:
        """Convert minutes from reentry to the trajectory's time, s; not before its first point."""
        return max(self.navigation.navigation.start, self.reentry + 60.0 * minutes)

    def _polar(self, time: float) -> tuple[float, float]:
        """Return radius, m, and angular rate, rad/s, of the truth."""
        position, velocity = (each[0] for each in self.navigation.navigation.truth.earth_fixed(np.array([time])))
        radius = float(np.linalg.norm(position))
        return radius, float(position[0] * velocity[1] - position[1] * velocity[0]) / radius**2

    @cached_property
    def to_results(self) -> Array:
        """Matrix from final navigation errors to those of `RESULTS`, shape (3, 9)."""
        arc = EARTH_RADIUS / self._polar(self.navigation.navigation.end)[0]
        matrix = np.zeros((len(RESULTS), len(OUTPUTS)))
        matrix[ALTITUDE, OUTPUTS.index("position_down")] = -1.0
        matrix[RANGE, OUTPUTS.index("position_east")] = arc
        matrix[CROSSRANGE, OUTPUTS.index("position_north")] = arc
        return matrix

    def from_planar(self, time: float) -> Array:
        """Return the matrix from the planar errors at a start to the constant errors, shape (39, planar errors).

        An altitude error is one of eastward velocity as well, because the report's rate is an angular one; a range
        error turns the local axes, but not the platform.
        """
        radius, rate = self._polar(time)
        matrix = np.zeros((len(CONSTANTS), len(Error)))
        entries = [
            ("position_down", Error.ALTITUDE, -1.0), ("velocity_east", Error.ALTITUDE, rate),
            ("position_east", Error.RANGE, 1.0), ("tilt_north", Error.RANGE, -1.0 / radius),
            ("velocity_down", Error.ALTITUDE_RATE, -1.0), ("velocity_east", Error.RANGE_RATE, 1.0),
            *((name, error, sign) for error, (name, sign) in INSTRUMENTS.items()),
        ]  # fmt: skip
        for name, error, value in entries:
            matrix[CONSTANTS.index(name), error] = value
        return matrix

    def errors(self, time: float, planar: Array, across: Array) -> Array:
        """Combine planar errors, shape (n, planar errors), and those across, (n, 8), at a start: shape (n, 39)."""
        errors = planar @ self.from_planar(time).T
        errors[:, [CONSTANTS.index(name) for name in ACROSS]] += across
        return np.asarray(errors)

    def covariance(self, time: float) -> Array:
        """Return the covariance of the constant errors at a start, shape (39, 39)."""
        planar = self.from_planar(time) * ALL_ERRORS
        across = np.zeros(len(CONSTANTS))
        across[[CONSTANTS.index(name) for name in ACROSS]] = list(ACROSS.values())
        return np.asarray(planar @ planar.T + np.diag(across**2))

    def results(self, partials: Array, time: float) -> tuple[Array, Array]:
        """Return the effects on `RESULTS` of the planar errors, shape (3, planar errors), and of those across, (3, 8).

        Parameters
        ----------
        partials : ndarray, shape (9, 39)
            Of the final navigation errors for a start at the time, s.
        """
        final = self.to_results @ partials
        across = final[:, [CONSTANTS.index(name) for name in ACROSS]] * np.array(list(ACROSS.values()))
        return final @ self.from_planar(time) * ALL_ERRORS, across

    def updated(self, time: float, stars: bool = True) -> Ins:
        """Return the navigation from the first point, updated once by tracking and, perhaps, a star tracker."""
        sensors = tuple(_at_once(time, stars))
        navigation = self.navigation.navigation
        covariance = self.covariance(navigation.start)
        names = (*CONSTANTS, *aiding_constants(sensors))
        sigmas = dict(zip(names, np.sqrt(np.diag(covariance)).tolist(), strict=False))
        beliefs = Beliefs(sigmas, covariance[: len(OUTPUTS), : len(OUTPUTS)], navigation.imu, sensors)
        return Ins(replace(navigation, sensors=sensors, filter=FilterModel(ESTIMATES, (), beliefs), sigmas=sigmas))


def _at_once(time: float, stars: bool) -> Sequence[Sensor]:
    """List the sensors of an update at one instant."""
    fixes = tuple(
        Component(quantity, axis, sigma, 0.0, 1.0, f"tracking_{quantity}")
        for quantity, sigmas in TRACKING.items()
        for axis, sigma in enumerate(sigmas)
    )
    sensors = [Sensor("tracking", "gnss", np.array([time]), fixes)]
    if stars:
        axes = tuple(
            Component("attitude", axis, STARS, 0.0, 1.0, "stars") for axis in range(len(QUANTITIES["attitude"].axes))
        )
        sensors.append(Sensor("stars", "star-tracker", np.array([time]), axes))
    return sensors


def draw(count: int, seed: int) -> tuple[Array, Array]:
    """Draw normal errors with the report's sizes as sigmas: planar ones, (n, planar errors), and across, (n, 8)."""
    generator = np.random.Generator(np.random.Philox(key=seed))
    planar = generator.standard_normal((count, len(Error))) * ALL_ERRORS
    return planar, generator.standard_normal((count, len(ACROSS))) * np.array(list(ACROSS.values()))


PROBES: Final = 32
"""Samples on which an engine's steps are settled."""


def simulate(scenario: Ins, errors: Array, seed: int) -> tuple[Array, Array]:
    """Simulate samples with given constant errors, shape (n, 39), of a navigation.

    Returns
    -------
    tuple of ndarray, shape (n, 9)
        Final errors, and those of the linear system with the same errors and the same noise.

    Raises
    ------
    RuntimeError
        When a sample fails.
    """
    padded = np.zeros((len(errors), len(scenario.sources)))
    padded[:, : errors.shape[1]] = errors
    engine = scenario.engine(scenario.engines[0], padded[:PROBES])
    results: list[SimulationResult] = []
    for begin in range(0, len(padded), engine.chunk):
        index = np.arange(begin, min(begin + engine.chunk, len(padded)))
        results.append(engine.simulate(Batch(index, padded[index], seed)))
        if results[-1].failures:
            raise RuntimeError(f"a sample fails: {next(iter(results[-1].failures.values()))}")
    linear = [result.linear_values for result in results if result.linear_values is not None]
    return np.concatenate([result.values for result in results]), np.concatenate(linear)
