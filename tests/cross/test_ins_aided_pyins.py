"""The aided navigator of the reference engine against pyins' feedback filter.

pyins integrates in local axes from increments, and its filter has the modified phi-angle model in local axes
(Scherzinger and Reid 1994) with states of its own. Its gravity falls by 2 h / a and points straight down, so that a run
with errors is compared by its difference from one without.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest
from pyins.filters import run_feedback_filter
from pyins.inertial_sensor import EstimationModel
from pyins.measurements import NedVelocity, Position
from pyins.strapdown import compute_increments_from_imu
from pyins.util import ACCEL_COLS, DV_COLS, GYRO_COLS, LLA_COLS, RPH_COLS, THETA_COLS, TRAJECTORY_COLS, VEL_COLS
from scipy.spatial.transform import Rotation

import tests.stored_pyins  # noqa: F401
from mcnav.arrays.types import Array
from mcnav.systems.ins.earth import WGS84, local_axes
from mcnav.systems.ins.filter.model import Beliefs, FilterModel
from mcnav.systems.ins.imu.instruments import CONSTANTS, OUTPUTS, Imu, Noise
from mcnav.systems.ins.imu.sample_noise import SampleNoise
from mcnav.systems.ins.reference.aided import AidedMechanization
from mcnav.systems.ins.reference.navigation_errors import EarthFixedStates, indicated_state, navigation_errors
from tests.every_sensor import DEG_PER_HOUR, MICRO_G, gnss
from tests.flights import flight

START, END, EPOCH = 610.0, 640.0, 10.0
"""In a turn of 90 degrees; interval of epochs, s."""

INTERVAL = 0.02
"""Of pyins' readings, s: its coning corrections err by the fourth power of it."""

STEP = 0.1
"""Of noise, s."""

COVARIANCE_STEP = 0.2
"""Of pyins' covariance, s."""

POSITION, VELOCITY, LEVEL, HEADING = 10.0, 0.1, 1e-4, 3e-4
"""Initial sigmas: m, m/s, rad of roll and pitch, rad."""

GYRO_BIAS, ACCELEROMETER_BIAS = 0.1 * DEG_PER_HOUR, 200.0 * MICRO_G
IMU = Imu(
    Noise(np.full(3, 0.01 * DEG_PER_HOUR * 60.0), rate_random_walk=np.full(3, 0.01 * DEG_PER_HOUR / 60.0)),
    Noise(np.full(3, 0.02 / 60.0), rate_random_walk=np.full(3, MICRO_G)),
)


def euler_map(time: float) -> Array:
    """Compute the map of a small rotation vector in n to changes of roll, pitch and heading."""
    heading, pitch, _ = flight().angles(np.array([time]))[0]
    sine, cosine = np.sin(heading), np.cos(heading)
    return np.array(
        [
            [cosine / np.cos(pitch), sine / np.cos(pitch), 0.0],
            [-sine, cosine, 0.0],
            [cosine * np.tan(pitch), sine * np.tan(pitch), 1.0],
        ]
    )


def reference() -> AidedMechanization:
    """Return the navigator, with the filter's initial attitude covariance that pyins has: of Euler angles."""
    covariance = np.diag(np.repeat([POSITION, VELOCITY, 0.0], 3) ** 2)
    to_vector = np.linalg.inv(euler_map(START))
    covariance[6:, 6:] = to_vector @ np.diag(np.array([LEVEL, LEVEL, HEADING]) ** 2) @ to_vector.T
    sensors = (gnss(np.arange(START + 1.0, END + 0.5)),)
    sigmas = {f"gyro_bias_{axis}": GYRO_BIAS for axis in "xyz"}
    sigmas |= {f"accelerometer_bias_{axis}": ACCELEROMETER_BIAS for axis in "xyz"}
    model = FilterModel(("gyro_bias", "accelerometer_bias"), (), Beliefs(sigmas, covariance, IMU, sensors))
    times = np.arange(START + EPOCH, END + 1.0, EPOCH)
    return AidedMechanization(flight(), "strapdown", START, END, times, sensors, model)


def pyins_state(errors: Array) -> pd.Series:
    """Return pyins' state at the start, with initial errors."""
    true = reference().navigator.earth_fixed(np.array([START]))
    state = indicated_state(WGS84, true, errors[None])
    latitude, longitude, altitude = WGS84.to_geodetic(state.position)[0]
    level = local_axes(latitude, longitude)
    angles = Rotation.from_matrix(level.T @ state.axes[0]).as_euler("ZYX", degrees=True)[::-1]
    place = [np.degrees(latitude), np.degrees(longitude), altitude]
    return pd.Series([*place, *(level.T @ state.velocity[0]), *angles], index=TRAJECTORY_COLS, name=START)


def pyins_increments(errors: Array, noise: SampleNoise) -> pd.DataFrame:
    """Return increments of readings with biases, and with noise that is constant over each step."""
    time = np.linspace(START, END, round((END - START) / INTERVAL) + 1)
    true = flight().states(time, "strapdown", START)
    bias = [errors[[CONSTANTS.index(f"{kind}_bias_{axis}") for axis in "xyz"]] for kind in ("gyro", "accelerometer")]
    readings = np.hstack([true.rate + bias[0], true.force + bias[1]])
    found = compute_increments_from_imu(pd.DataFrame(readings, index=time, columns=[*GYRO_COLS, *ACCEL_COLS]), "rate")
    within = round(STEP / INTERVAL)
    found[THETA_COLS] += np.repeat(noise.gyro, within, axis=0) * INTERVAL
    found[DV_COLS] += np.repeat(noise.accelerometer, within, axis=0) * INTERVAL
    return found


def pyins_measurements(engine: AidedMechanization, noise: SampleNoise) -> list[Any]:
    times = engine.sensors[0].times
    true = engine.navigator.earth_fixed(times)
    place = WGS84.to_geodetic(true.position)
    level = local_axes(place[:, 0], place[:, 1])
    error = noise.measurements.get("gnss", np.zeros((len(times), 6)))
    measured = WGS84.to_geodetic(true.position + np.einsum("nij,nj->ni", level, error[:, :3]))
    velocity = np.einsum("nji,nj->ni", level, true.velocity) + error[:, 3:]
    place = np.column_stack([np.degrees(measured[:, :2]), measured[:, 2]])
    return [
        Position(pd.DataFrame(place, index=times, columns=LLA_COLS), 3.0),
        NedVelocity(pd.DataFrame(velocity, index=times, columns=VEL_COLS), 0.1),
    ]


def run_pyins(engine: AidedMechanization, errors: Array, noise: SampleNoise) -> tuple[EarthFixedStates, Array]:
    """Run pyins' filter; states at the epochs but the last, and sigmas of position, velocity and Euler angles."""
    models = [
        EstimationModel(bias, each.random_walk, each.rate_random_walk)
        for bias, each in ((GYRO_BIAS * np.ones(3), IMU.gyro), (ACCELEROMETER_BIAS * np.ones(3), IMU.accelerometer))
    ]
    found = run_feedback_filter(
        pyins_state(errors[: len(OUTPUTS)]), POSITION, VELOCITY, np.degrees(LEVEL), np.degrees(HEADING),
        pyins_increments(errors, noise), *models, pyins_measurements(engine, noise), COVARIANCE_STEP,
    )  # fmt: skip
    sigmas = found.trajectory_sd
    rows = np.abs(sigmas.index.to_numpy()[:, None] - engine.times[:-1]).argmin(axis=0)
    states = found.trajectory.loc[sigmas.index[rows]]
    latitude, longitude = np.radians(states["lat"].to_numpy()), np.radians(states["lon"].to_numpy())
    level = local_axes(latitude, longitude)
    return EarthFixedStates(
        WGS84.from_geodetic(latitude, longitude, states["alt"].to_numpy()),
        np.einsum("nij,nj->ni", level, states[VEL_COLS].to_numpy()),
        level @ Rotation.from_euler("ZYX", states[RPH_COLS].to_numpy()[:, ::-1], degrees=True).as_matrix(),
    ), sigmas.to_numpy()[rows] * np.repeat([1.0, np.radians(1.0)], [6, 3])


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:The copy keyword is deprecated")  # pyins' use of pandas
def test_sigmas_and_errors_are_those_of_pyins() -> None:
    """One sample: biases, random walks, white noise, and measurements with noise, the same in both.

    The filters are linearized along their own indicated trajectories. Attitudes and noisy readings err by some 1e-4 of
    what they multiply in the equations, and sigmas differ by a share of this. Gains that differ by 3e-4 of them, at
    innovations of several sigmas, leave ten times as much in the errors.
    """
    engine = reference()
    errors = np.zeros(len(CONSTANTS) + 7)
    generator = np.random.default_rng(5)
    errors[:9] = generator.standard_normal(9) * np.repeat([POSITION, VELOCITY, LEVEL, HEADING], [3, 3, 2, 1])
    for kind, size in (("gyro_bias", GYRO_BIAS), ("accelerometer_bias", ACCELEROMETER_BIAS)):
        for axis in "xyz":
            errors[CONSTANTS.index(f"{kind}_{axis}")] = size * generator.standard_normal()
    noise = engine.draw(IMU, 1963, 0)
    ours, records = engine.simulate(errors, noise)
    theirs, sigmas = run_pyins(engine, errors, noise)
    none, _ = run_pyins(engine, np.zeros_like(errors), engine.quiet())
    covariance = np.zeros((len(engine.times), 9, 9))
    rows, columns = np.tril_indices(9)
    covariance[:, rows, columns] = covariance[:, columns, rows] = records[:, 6 : 6 + len(rows)]
    for epoch, time in enumerate(engine.times):
        to_euler = np.eye(9)
        to_euler[6:, 6:] = euler_map(time)
        covariance[epoch] = to_euler @ covariance[epoch] @ to_euler.T
    own = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))[:-1]
    difference = np.abs(navigation_errors(WGS84, none, theirs) - ours[:-1]) / own
    allowed = np.repeat([1e-4, 3e-4, 3e-4], 3)
    assert np.all(np.abs(own / sigmas - 1.0) <= allowed)
    assert np.all(difference <= np.repeat([1e-3, 3e-3, 3e-3], 3))
    assert np.all(np.max(np.abs(ours[:-1]) / own, axis=0) > 0.1)
