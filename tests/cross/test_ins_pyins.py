"""The reference engine of the three-dimensional navigator against pyins' strapdown integration.

pyins integrates in local axes, from increments of readings that it takes as linear between samples. Its gravity is
Somigliana's, falls by 2 h / a and points straight down, so that the flights without errors differ by metres. Errors,
differences from them, see only what gravity changes along an altitude error.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from pyins.strapdown import Integrator, compute_increments_from_imu
from pyins.util import ACCEL_COLS, GYRO_COLS, RPH_COLS, TRAJECTORY_COLS, VEL_COLS
from scipy.integrate import cumulative_trapezoid
from scipy.spatial.transform import Rotation

import tests.stored_pyins  # noqa: F401
from mcnav.arrays.types import Array
from mcnav.systems.ins.earth import WGS84, local_axes
from mcnav.systems.ins.imu.instruments import ACCELEROMETER, CONSTANTS, GYRO, OUTPUTS
from mcnav.systems.ins.reference.mechanization import Mechanization
from mcnav.systems.ins.reference.navigation_errors import EarthFixedStates, indicated_state, navigation_errors
from tests.flights import flight

START, END, INTERVAL = 400.0, 1000.0, 20.0
"""Through a climb from 2.4 to 6.9 km and a turn of 90 degrees; epochs, s."""

SPEED = 221.0
"""Of the flight, m/s."""

DEG_PER_HOUR = np.radians(1.0) / 3600.0
MICRO_G = 9.80665e-6

NORTH_GRADIENT = 8.2e-9
"""Gravity's north component per metre of altitude at 45 degrees, 1/s^2, which pyins leaves out."""

VERTICAL_GRADIENT = 0.005 * 3.1e-6
"""Largest difference of gravity's vertical gradient up to 10 km from 2 g / a, 1/s^2."""


def measured(true: Array, constants: Array, law: Array) -> Array:
    """Apply an instrument's constant errors to its inputs, shape (n, 3)."""
    bias, scale, (xy, xz, yx, yz, zx, zy), third = np.split(constants, [3, 6, 12])
    matrix = np.array([[scale[0], xy, xz], [yx, scale[1], yz], [zx, zy, scale[2]]])
    return np.asarray(true + bias + true @ matrix.T + third * law)


def start_state(errors: Array) -> pd.Series:
    """Return pyins' state at the start, with initial errors."""
    truth = flight()
    position, velocity = truth.earth_fixed(np.array([START]))
    axes = np.swapaxes(WGS84.turned(np.array([START])), -1, -2) @ truth.states(START, "strapdown", START).axes
    state = indicated_state(WGS84, EarthFixedStates(position, velocity, axes), errors[None])
    latitude, longitude, altitude = WGS84.to_geodetic(state.position)[0]
    level = local_axes(latitude, longitude)
    angles = Rotation.from_matrix(level.T @ state.axes[0]).as_euler("ZYX", degrees=True)[::-1]
    place = [np.degrees(latitude), np.degrees(longitude), altitude]
    return pd.Series([*place, *(level.T @ state.velocity[0]), *angles], index=TRAJECTORY_COLS, name=START)


def integrate(errors: Array, interval: float) -> EarthFixedStates:
    """Integrate with pyins from readings at an interval; states at the epochs."""
    time = np.linspace(START, END, round((END - START) / interval) + 1)
    true = flight().states(time, "strapdown", START)
    instruments = errors[len(OUTPUTS) :]
    rate = measured(true.rate, instruments[: len(GYRO)], true.force)
    force = measured(true.force, instruments[-len(ACCELEROMETER) :], true.force**2)
    readings = pd.DataFrame(np.hstack([rate, force]), index=time, columns=[*GYRO_COLS, *ACCEL_COLS])
    integrator = Integrator(start_state(errors[: len(OUTPUTS)]))
    found = integrator.integrate(compute_increments_from_imu(readings, "rate"))
    found = found.iloc[:: round(INTERVAL / interval)].iloc[1:]
    latitude, longitude = np.radians(found["lat"].to_numpy()), np.radians(found["lon"].to_numpy())
    level = local_axes(latitude, longitude)
    return EarthFixedStates(
        WGS84.from_geodetic(latitude, longitude, found["alt"].to_numpy()),
        np.einsum("nij,nj->ni", level, found[VEL_COLS].to_numpy()),
        level @ Rotation.from_euler("ZYX", found[RPH_COLS].to_numpy()[:, ::-1], degrees=True).as_matrix(),
    )


def draw() -> Array:
    """Draw all 39 errors, of a unit between navigation and tactical grade."""
    initial = np.array([10.0, 10.0, 10.0, 0.1, 0.1, 0.01, 1e-4, 1e-4, 1e-4])
    gyro = np.repeat([0.1 * DEG_PER_HOUR, 3e-5, 0.1 * DEG_PER_HOUR / 9.8], [3, 9, 3])
    accelerometer = np.repeat([100.0 * MICRO_G, 3e-5, 5.0 * MICRO_G / 9.8**2], [3, 9, 3])
    sizes = np.concatenate([initial, gyro, accelerometer])
    return np.asarray(np.random.default_rng(1).standard_normal(len(CONSTANTS)) * sizes)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:The copy keyword is deprecated")  # pyins' use of pandas
def test_errors_are_those_of_pyins() -> None:
    """Over ten minutes with a climb and a turn all errors agree to what pyins leaves out and its own integration error.

    Its error falls at least as the interval, so that the largest difference so far between 50 and 100 Hz bounds it.
    Gravity that it leaves out is integrated twice along the altitude error; the turning of local axes takes it from
    north to east, and the vertical follows it by the angle that it makes at the earth's centre.
    """
    errors = draw()
    epochs = np.arange(START + INTERVAL, END + 0.5 * INTERVAL, INTERVAL)
    ours = Mechanization(flight(), "strapdown", START, END, epochs).simulate(errors)
    none = np.zeros(len(CONSTANTS))
    coarse, fine = (
        navigation_errors(WGS84, integrate(none, interval), integrate(errors, interval)) for interval in (0.02, 0.01)
    )
    time = np.concatenate([[0.0], epochs - START])
    altitude = np.concatenate([[abs(errors[2])], np.abs(ours[:, 2])])
    once = cumulative_trapezoid(altitude, time, initial=0.0)
    twice = cumulative_trapezoid(once, time, initial=0.0)[1:]
    once, time = once[1:], time[1:]
    turned = (2.0 * WGS84.rotation_rate + SPEED / WGS84.radius) * time
    north, down, tilt = NORTH_GRADIENT * twice, VERTICAL_GRADIENT * twice, NORTH_GRADIENT * twice / WGS84.radius
    north_rate, down_rate = NORTH_GRADIENT * once, VERTICAL_GRADIENT * once
    gravity = np.stack(
        [north, turned * north, down, north_rate, turned * north_rate, down_rate, turned * tilt, tilt, turned * tilt],
        axis=-1,
    )
    rounding = np.repeat([1e-6, 1e-8, 1e-11], 3)  # of degrees, 1e-14 of 45, in 6e4 steps
    allowed = 1.1 * gravity + np.maximum.accumulate(np.abs(coarse - fine)) + rounding
    assert np.all(np.abs(fine - ours) <= allowed)
    # and what is allowed is little
    assert np.all(np.max(allowed, axis=0) <= 2e-3 * np.max(np.abs(ours), axis=0))
