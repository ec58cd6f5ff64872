"""The trajectories and errors of NASA TN D-1772 (Table I; eqs. 18-21), SI units."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav.arrays.types import Array, IndexArray
from mcnav.physics.constants import EARTH_RADIUS, EARTH_RATE, TN_GRAVITY
from mcnav.systems.reentry.instruments import Error
from mcnav.systems.reentry.truth import Trajectory
from mcnav.systems.reentry.vehicle import ConstantLift, LiftLaw, VariableLift

START_ALTITUDE: Final = 18_476_300.0
START_RANGE: Final = -12_010_330.0
START_ALTITUDE_RATE: Final = -4_685.08
START_RANGE_RATE: Final = 732.9312
"""The common start point, eq. (18); ranges are r_E theta and r_E theta_dot, m and m/s."""

START_AIRSPEED: Final = 4_799.92
"""Airspeed at the start of the trajectories that Table I varies in angle, m/s."""

ERROR_SIZES: Final = {
    Error.ALTITUDE: 5e3,
    Error.RANGE: 500.0,
    Error.ALTITUDE_RATE: 0.5,
    Error.RANGE_RATE: 0.02,
    Error.MISALIGNMENT: 2e-4,
    Error.GYRO_DRIFT: 1e-6,
    Error.BIAS_X: 1e-4 * TN_GRAVITY,
    Error.BIAS_Z: 1e-4 * TN_GRAVITY,
    Error.SCALE_FACTOR_X: 1e-4,
    Error.SCALE_FACTOR_Z: 1e-4,
}
"""The report's ten initial-condition and equipment errors, eqs. (20) and (21), in the order of its runs."""

ERRORS: Final = np.array(list(ERROR_SIZES.values()))
"""Their sizes, shape (10,)."""

COLUMNS: Final[IndexArray] = np.array([int(error) for error in ERROR_SIZES])
"""Their places among all errors of a reentry: the columns of P that the report has."""


def among_all(errors: Array) -> Array:
    """Place the report's ten errors, shape (..., 10), among those of all sources; the others are zero."""
    result = np.zeros((*errors.shape[:-1], len(Error)))
    result[..., COLUMNS] = errors
    return result


ALL_ERRORS: Final = among_all(ERRORS)
"""The sizes among those of all sources, shape (sources,); zero for errors that the report does not have."""


@dataclass(frozen=True)
class Row:
    """A column of Table I.

    Lift law and final altitude (m); where the start angle is solved for, the final range (m) counted from reentry and
    the printed angle (deg).
    """

    lift_law: LiftLaw
    final_altitude: float
    final_range: float | None = None
    printed_angle: float | None = None


TABLE_I: Final = {
    1: Row(ConstantLift(0.05), 27_620.0),
    2: Row(VariableLift(), 29_500.0),
    3: Row(ConstantLift(0.22), 26_510.0),
    4: Row(VariableLift(), 26_750.0, 9_780_000.0, -77.4070),
    5: Row(ConstantLift(0.25), 29_570.0),
    6: Row(VariableLift(), 28_310.0, 20_980_000.0, -77.4068),
    7: Row(ConstantLift(0.27), 26_220.0),
}

START_ANGLES: Final = {4: -77.4070362767491, 6: -77.40674674411395}
"""Start angles (deg) of the solved trajectories, to 1e-13.

Trajectories 4 and 6 react so sharply to the start angle (0.002 deg moves the end by thousands of kilometres) that the
printed angle does not define them; theirs is solved for the printed final range.
"""


def common_start() -> Array:
    """Compute the polar state of eq. (18), shape (4,): m, rad, m/s, rad/s."""
    return np.array(
        [
            EARTH_RADIUS + START_ALTITUDE,
            START_RANGE / EARTH_RADIUS,
            START_ALTITUDE_RATE,
            START_RANGE_RATE / EARTH_RADIUS,
        ]
    )


def start_at_angle(angle: float) -> Array:
    """Compute common start point with the airspeed of Table I at a flight-path angle (rad), NASA TN D-1772, eq. (4)."""
    state = common_start()
    state[2] = START_AIRSPEED * np.sin(angle)
    state[3] = EARTH_RATE + START_AIRSPEED * np.cos(angle) / state[0]
    return state


def range_from_reentry(trajectory: Trajectory) -> float:
    """Compute r_E (theta_f - theta_R): final range from where the altitude falls through 121.92 km, m."""
    final, reentry = trajectory.state(trajectory.final_time), trajectory.state(trajectory.reentry_time)
    return float(EARTH_RADIUS * (final[1] - reentry[1]))


def start_state(number: int) -> tuple[float, ...]:
    """Compute the polar start state of a trajectory of Table I: m, rad, m/s, rad/s."""
    angle = START_ANGLES.get(number)
    return tuple(common_start() if angle is None else start_at_angle(np.radians(angle)))
