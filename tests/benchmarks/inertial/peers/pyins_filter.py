"""python-ins: `run_feedback_filter` sample by sample, joblib sharing the samples among processes.

Its initial covariance is of Euler angles; it is given that of the case. A measurement at the end is not processed, so
that the last epoch is left out.
"""

from __future__ import annotations

import warnings
from typing import Any
from unittest.mock import patch

import numpy as np
import pandas as pd
from pyins import filters
from pyins.inertial_sensor import EstimationModel
from pyins.measurements import NedVelocity, Position
from pyins.util import DV_COLS, LLA_COLS, RPH_COLS, THETA_COLS, TRAJECTORY_COLS, VEL_COLS
from scipy.spatial.transform import Rotation

from mcnav.arrays.types import Array
from mcnav.systems.ins.earth import WGS84, local_axes
from tests.benchmarks.inertial.case import READING, Case, Samples
from tests.benchmarks.inertial.peer import Peer, Simulate


def to_rows(states: Array, times: Array) -> pd.DataFrame:
    """Return states of `Case`, shape (n, 15), as pyins has them."""
    latitude, longitude, altitude = WGS84.to_geodetic(np.ascontiguousarray(states[:, :3])).T
    level = local_axes(latitude, longitude)
    velocity = np.einsum("nji,nj->ni", level, states[:, 3:6])
    axes = np.swapaxes(level, 1, 2) @ states[:, 6:].reshape(-1, 3, 3)
    angles = Rotation.from_matrix(axes).as_euler("ZYX", degrees=True)[:, ::-1]
    place = np.column_stack([np.degrees(latitude), np.degrees(longitude), altitude])
    return pd.DataFrame(np.hstack([place, velocity, angles]), index=times, columns=TRAJECTORY_COLS)


def from_rows(rows: pd.DataFrame) -> Array:
    """Return states of `Case`, shape (n, 15)."""
    latitude, longitude = np.radians(rows["lat"].to_numpy()), np.radians(rows["lon"].to_numpy())
    level = local_axes(latitude, longitude)
    turns = Rotation.from_euler("ZYX", rows[RPH_COLS].to_numpy()[:, ::-1], degrees=True).as_matrix()
    velocity = np.einsum("nij,nj->ni", level, rows[VEL_COLS].to_numpy())
    position = WGS84.from_geodetic(latitude, longitude, rows["alt"].to_numpy())
    return np.hstack([position, velocity, (level @ turns).reshape(-1, 9)])


def euler_covariance(case: Case) -> Array:
    """Return the covariance of initial errors with those of roll, pitch and heading in degrees, shape (9, 9)."""
    _, pitch, heading = np.radians(to_rows(case.first[None], np.zeros(1))[RPH_COLS].to_numpy()[0])
    sine, cosine = np.sin(heading), np.cos(heading)
    to_angles = np.array([
        [cosine / np.cos(pitch), sine / np.cos(pitch), 0.0],
        [-sine, cosine, 0.0],
        [cosine * np.tan(pitch), sine * np.tan(pitch), 1.0],
    ])  # fmt: skip
    found = np.diag(case.initial**2)
    found[6:, 6:] = np.degrees(to_angles) @ found[6:, 6:] @ np.degrees(to_angles).T
    return found


class Flight:
    """All that samples share; it is pickled for processes."""

    def __init__(self, case: Case, step: float) -> None:
        self.case, self.step = case, step
        self.times = case.start + READING * np.arange(1, len(case.increments) + 1)
        self.measured = to_rows(case.measured, self.times[case.updates - 1])
        self.covariance = euler_covariance(case)

    def _initial_covariance(self, pva: Any, *arguments: Any) -> Array:
        found = np.array(_initialize_covariance(pva, *arguments))
        to_internal = arguments[4].transform_to_internal(pva)
        found[:9, :9] = to_internal @ self.covariance @ to_internal.T
        return found

    def fly(self, samples: Samples, seed: int) -> Array:
        """Return the states at the epochs but one at the end, of one sample, shape (m, 15)."""
        case, generator = self.case, np.random.default_rng(seed)
        if samples.given:
            noise, errors = samples.increments[0], samples.measurements[0]
        else:
            noise = generator.standard_normal(case.increments.shape) * case.noise * np.sqrt(READING)
            errors = generator.standard_normal((len(case.updates), 6)) * case.measurement
        increments = pd.DataFrame(case.increments + samples.biases[0] * READING + noise, self.times)
        increments.columns = [*THETA_COLS, *DV_COLS]
        increments.insert(0, "dt", READING)
        place, velocity = self.measured[LLA_COLS].to_numpy().copy(), self.measured[VEL_COLS] + errors[:, 3:]
        meridian, prime = WGS84.curvature_radii(np.radians(place[:, 0]))
        place[:, 1] += np.degrees(errors[:, 1] / ((prime + place[:, 2]) * np.cos(np.radians(place[:, 0]))))
        place[:, 0] += np.degrees(errors[:, 0] / (meridian + place[:, 2]))
        place[:, 2] -= errors[:, 2]
        models = [
            EstimationModel(case.biases[first : first + 3], case.noise[first : first + 3], np.zeros(3))
            for first in (0, 3)
        ]
        measurements = [
            Position(pd.DataFrame(place, self.measured.index, LLA_COLS), case.measurement[0]),
            NedVelocity(velocity, case.measurement[3]),
        ]
        start = to_rows(case.started(samples), np.array([case.start])).iloc[0]
        with warnings.catch_warnings(), patch.object(filters, "_initialize_covariance", self._initial_covariance):
            warnings.simplefilter("ignore")  # its use of pandas
            found = filters.run_feedback_filter(start, 0.0, 0.0, 0.0, 0.0, increments, *models, measurements, self.step)
        epochs = case.epochs[case.epochs < len(self.times)]
        times = found.trajectory.index.to_numpy()
        rows = np.abs(times[:, None] - self.times[epochs - 1]).argmin(axis=0)
        return from_rows(found.trajectory.iloc[rows])


_initialize_covariance = filters._initialize_covariance


def prepare(case: Case, setting: float, cores: int) -> Simulate:
    """One sample after the other; the setting is the step of the covariance, s."""
    flight = Flight(case, setting)

    def simulate(samples: Samples, seed: int) -> Array:
        return np.stack([flight.fly(samples[row : row + 1], seed + row) for row in range(len(samples))])

    return simulate


PEER = Peer(prepare, "covariance step [s]", (1.0, 0.1), 1, "processes")
