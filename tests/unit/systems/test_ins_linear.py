"""Linear covariance of the three-dimensional navigator: closed forms, growth laws, and composition of steps."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest

from mcnav.systems.ins.earth import WGS84, Earth
from mcnav.systems.ins.imu.instruments import CONSTANTS, OUTPUTS, Imu, Noise
from mcnav.systems.ins.linear.covariance import LinearErrors
from mcnav.systems.ins.linear.free_timeline import free_errors
from mcnav.systems.ins.linear.response_blocks import Responses
from mcnav.systems.ins.truth.trajectory import Truth
from tests.flights import flight, rest

GRAVITY = 9.80665
DEGREE = np.pi / 180.0
HOUR = 3600.0

RADIUS = 1e13
FLAT = Earth(RADIUS, 0.0, GRAVITY * RADIUS**2, 0.0)
"""So large that gravity is the same everywhere: its change over 1 km is 1e-9 of it."""


def linear(truth: Truth, imu: Imu, end: float, steps: int = 4) -> LinearErrors:
    responses = Responses(truth, "strapdown", np.linspace(0.0, end, steps + 1), imu)
    return free_errors(truth, responses, imu, np.array([0, steps]))


def noise(name: str, size: float, correlation: float = HOUR) -> Noise:
    return Noise(**{name: np.full(3, size), "correlation_time": np.full(3, correlation)})


def test_the_earth_has_the_published_gravity() -> None:
    """To the 5e-11 m/s^2 that the printed equatorial gravity leaves open; places and radii to rounding."""
    for latitude, gravity in ((45.0, 9.80619776934378), (51.0, 9.81159132687041)):
        place = WGS84.from_geodetic(np.radians([latitude]), np.zeros(1), np.zeros(1))
        pull = WGS84.gravitation(place) + WGS84.rotation_rate**2 * place * [1.0, 1.0, 0.0]
        assert np.linalg.norm(pull) == pytest.approx(gravity, abs=5e-11)
    meridian, prime = WGS84.curvature_radii(np.radians(45.0))
    assert (float(meridian), float(prime)) == pytest.approx((6367381.815619549, 6388838.290121148), rel=1e-15)
    place = WGS84.from_geodetic(np.radians(42.0), np.radians(-82.0), np.asarray(200.0))
    np.testing.assert_allclose(place, [660675.251824733, -4700948.683162267, 4245737.662222387], rtol=1e-15)
    back = WGS84.to_geodetic(place[None])[0]
    np.testing.assert_allclose(back, [np.radians(42.0), np.radians(-82.0), 200.0], rtol=1e-12)


def test_gravitation_has_neither_sources_nor_curl() -> None:
    """Outside the earth its gradient is symmetric and free of trace: to the 1e-10 of the central differences."""
    place = WGS84.from_geodetic(
        np.radians([10.0, 45.0, -80.0]), np.radians([0.0, 100.0, -20.0]), np.array([0, 1e4, 1e6])
    )
    gradient = WGS84.gravity_gradient(place)
    size = np.abs(gradient).max()
    assert np.abs(np.trace(gradient, axis1=1, axis2=2)).max() < 1e-9 * size
    assert np.abs(gradient - gradient.swapaxes(1, 2)).max() < 1e-9 * size


def test_growth_laws_of_the_processes() -> None:
    """On a flat earth the laws are exact; the horizontal and vertical gradients would add some per cent in 600 s."""
    time = 600.0
    truth = rest(duration=time, earth=FLAT)
    walk, instability, rate_walk = 0.1 * DEGREE / 60.0, DEGREE / HOUR, 1e-8
    accelerometer = 0.03 / 60.0
    x = time / HOUR
    angle = instability * HOUR * np.sqrt(2.0 * (x - 1.0 + np.exp(-x)))
    cases = [
        (Imu(gyro=noise("random_walk", walk)), "gyro_angle_random_walk_x", "tilt_north", walk * np.sqrt(time)),
        (Imu(gyro=noise("random_walk", walk)), "gyro_angle_random_walk_y", "position_north",
         GRAVITY * walk * time**2.5 / np.sqrt(20.0)),
        (Imu(gyro=noise("rate_random_walk", rate_walk)), "gyro_rate_random_walk_x", "position_east",
         GRAVITY * rate_walk * time**3.5 / np.sqrt(252.0)),
        (Imu(gyro=noise("instability", instability)), "gyro_bias_instability_z", "heading", angle),
        (Imu(accelerometer=noise("random_walk", accelerometer)), "accelerometer_velocity_random_walk_z",
         "velocity_down", accelerometer * np.sqrt(time)),
        (Imu(accelerometer=noise("random_walk", accelerometer)), "accelerometer_velocity_random_walk_x",
         "position_north", accelerometer * np.sqrt(time**3 / 3.0)),
        (Imu(accelerometer=noise("rate_random_walk", rate_walk)), "accelerometer_rate_random_walk_y",
         "position_east", rate_walk * time**2.5 / np.sqrt(20.0)),
    ]  # fmt: skip
    for imu, process, output, expected in cases:
        covariance = linear(truth, imu, time).processes[process][-1]
        sigma = np.sqrt(covariance[OUTPUTS.index(output), OUTPUTS.index(output)])
        assert sigma == pytest.approx(expected, rel=2e-7), (process, output)
    printed = {"0.040825 deg": walk * np.sqrt(time) / DEGREE, "0.162163 deg": angle / DEGREE}
    for text, value in printed.items():
        assert f"{value:.6f} deg" == text


def test_a_stationary_bias_is_stationary() -> None:
    """Over 300 correlation times, to the 4e-7 of the quadrature with four intervals in each: it is of order 4."""
    sigma, correlation, time = 1e-6, 2.0, 600.0
    found = linear(rest(duration=time, earth=FLAT), Imu(gyro=noise("instability", sigma, correlation)), time)
    x = time / correlation
    expected = sigma * correlation * np.sqrt(2.0 * (x - 1.0 + np.exp(-x)))
    heading = OUTPUTS.index("heading")
    assert np.sqrt(found.processes["gyro_bias_instability_z"][-1][heading, heading]) == pytest.approx(
        expected, rel=1e-6
    )


def test_initial_errors_are_outputs_at_the_start() -> None:
    found = linear(flight(1.0), Imu(), 60.0)
    np.testing.assert_allclose(found.partials[0][:, :9], np.eye(9), atol=1e-9)
    assert not found.partials[0][:, 9:].any()


def test_steps_compose() -> None:
    """One long step responds as many short ones do: partial derivatives to 1e-9 of each row's largest contribution.

    The quadrature is the same, so that only rounding differs, and gravity's gradient within an interval.
    """
    truth = flight(1.0)
    imu = Imu(noise("random_walk", 1e-6), noise("instability", 1e-5))
    few, many = linear(truth, imu, 1800.0, 3), linear(truth, imu, 1800.0, 60)
    sizes = np.abs(many.partials[-1]).max(axis=1, keepdims=True)
    np.testing.assert_allclose(few.partials[-1] / sizes, many.partials[-1] / sizes, atol=1e-9)
    for name, covariance in many.processes.items():
        np.testing.assert_allclose(few.processes[name][-1], covariance[-1], rtol=1e-7, atol=1e-9 * covariance[-1].max())


def test_covariances_are_positive() -> None:
    """Every process adds a covariance without negative eigenvalues, to rounding, at every epoch of a flight."""
    imu = Imu(*(Noise(*(np.full(3, size) for size in (1e-6, 1e-7, 600.0, 1e-9))) for _ in range(2)))
    found = linear(flight(1.0), imu, 3600.0, 60)
    assert len(found.processes) == 18
    for covariance in found.processes.values():
        scale = np.sqrt(np.diag(covariance[-1]))
        scale = np.where(scale > 0.0, scale, 1.0)
        assert np.linalg.eigvalsh(covariance[-1] / np.outer(scale, scale)).min() > -1e-9


def test_the_names_are_those_of_the_design() -> None:
    assert CONSTANTS[:9] == OUTPUTS
    assert len(CONSTANTS) == 39
    assert CONSTANTS[15:21] == tuple(f"gyro_misalignment_{pair}" for pair in ("xy", "xz", "yx", "yz", "zx", "zy"))
    assert [field.name for field in fields(Noise)] == [
        "random_walk", "instability", "correlation_time", "rate_random_walk", "quantization", "quantization_interval",
    ]  # fmt: skip
