"""A recording of a simulated sample: what its instruments and sensors read, and the truth as reference."""

from __future__ import annotations

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.recorded import RecordedMeasurements, RecordedTrack, Recording
from mcnav.systems.ins.earth import local_axes
from mcnav.systems.ins.imu.instruments import Imu
from mcnav.systems.ins.recorded.measurements import recorded_values, stated_sigmas
from mcnav.systems.ins.reference.aided import AidedFlight, AidedMechanization
from mcnav.systems.ins.reference.collocation import WEIGHTS
from mcnav.systems.ins.reference.mechanization import matrices


def simulate_recording(engine: AidedMechanization, errors: Array, seed: int, index: int, imu: Imu) -> Recording:
    """Record a sample of the reference engine, whose steps are the intervals of the readings.

    Parameters
    ----------
    errors : ndarray, shape (39 + a,)
        Constant errors, as `AidedMechanization.simulate` takes them.
    imu : Imu
        Processes of the instruments.
    """
    flight = AidedFlight(engine, errors, engine.draw(imu, seed, index))
    readings = np.einsum("p,npi->ni", WEIGHTS, flight.measured)
    measurements = {}
    for number, (model, errors_of_sensor) in enumerate(zip(engine.sensor_models, flight.offsets, strict=True)):
        offsets, factors, arm = errors_of_sensor
        times = engine.measured(model.sensor)
        rows = [
            recorded_values(engine.truth.earth, model.sensor, flight.true_at(number, row), offsets[row], factors, arm)
            for row in range(len(times))
        ]
        values = {quantity: np.array([row[quantity] for row in rows]) for quantity in rows[0]} if rows else {}
        measurements[model.sensor.name] = RecordedMeasurements(
            times - engine.start, values, stated_sigmas(model.sensor)
        )
    ends = engine.step_times[1:] - engine.start
    start = _track(engine, np.zeros(1), flight.navigator.state)
    return Recording(ends, readings[:, :3], readings[:, 3:], measurements, start, true_track(engine))


def _track(engine: AidedMechanization, times: Array, state: Array) -> RecordedTrack:
    """Return one state, shape (10,), as a track."""
    position = engine.truth.earth.to_geodetic(state[None, 7:])
    level = local_axes(position[:, 0], position[:, 1])
    velocity = np.einsum("nji,nj->ni", level, state[None, 4:7])
    return RecordedTrack(times, position, velocity, _angles(level, matrices(state[None, :4])))


def true_track(engine: AidedMechanization, interval: float = 1.0) -> RecordedTrack:
    """Return the truth as a track with a constant interval, s."""
    times = np.arange(engine.start, engine.end + 1e-9, interval)
    states = engine.navigator.earth_fixed(times)
    position = engine.truth.earth.to_geodetic(states.position)
    level = local_axes(position[:, 0], position[:, 1])
    velocity = np.einsum("nji,nj->ni", level, states.velocity)
    return RecordedTrack(times - engine.start, position, velocity, _angles(level, states.axes))


def _angles(level: Array, axes: Array) -> Array:
    """Return roll, pitch and heading of a body, shape (n, 3)."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(np.swapaxes(level, -1, -2) @ axes).as_euler("ZYX")[:, ::-1])
