"""Closed-loop linear covariance: steady states of textbooks, honest and mismatched filters, budgets."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mcnav.arrays.types import Array
from mcnav.systems.ins.filter.model import FilterModel
from mcnav.systems.ins.imu.instruments import Imu, Noise
from mcnav.systems.ins.linear.aided_errors import ClosedLoopErrors, propagate_closed_loop
from mcnav.systems.ins.linear.closed_loop import close_loop
from mcnav.systems.ins.truth.trajectory import Truth
from tests.aided import EMPTY_SPACE, make_filter, make_sensor, sized
from tests.flights import flight, rest

DEG = np.radians(1.0)
SIGMAS = {
    "position": 10.0, "velocity": 0.1, "tilt": 1e-4, "heading": 1e-3, "gyro_bias": 0.01 * DEG / 3600.0,
    "accelerometer_bias": 5e-4,
}  # fmt: skip
NEGLECTED = {"gyro_scale": 1e-4, "accelerometer_scale": 3e-4, "gyro_mis": 1e-4, "accelerometer_mis": 3e-4}
NOISY = Imu(
    Noise(np.full(3, 6e-7), np.full(3, 1.5e-8), np.full(3, 1000.0), np.full(3, 1e-10)),
    Noise(np.full(3, 2e-4), np.full(3, 5e-5), np.full(3, 500.0), np.full(3, 1e-7)),
)


def white(acceleration: float) -> Imu:
    return Imu(Noise(), Noise(random_walk=np.full(3, acceleration)))


def close(
    truth: Truth, imu: Imu, sensors: tuple, model: FilterModel, end: float, after: bool = True
) -> ClosedLoopErrors:
    """Close the loop on a grid of seconds and read it out at the end."""
    loop = close_loop(truth, "level", np.arange(end + 1.0), imu, sensors, model)
    return propagate_closed_loop(loop, np.array([int(end)]), np.array([after]))


def sigma_of(found: ClosedLoopErrors, sensors: tuple, sigmas: dict[str, float]) -> tuple[Array, Array]:
    """Return true sigmas and the filter's, shape (m, 9)."""
    sizes = sized(sensors, sigmas)
    constant = np.einsum("mis,s->mi", found.partials**2, sizes**2)
    total = constant + sum(np.diagonal(each, axis1=1, axis2=2) for each in found.processes.values())
    return np.sqrt(total), np.sqrt(np.diagonal(found.own, axis1=1, axis2=2))


@pytest.mark.parametrize(
    ("density", "after", "position", "velocity"),
    [
        (1.0, True, 1.590075, 1.258635), (1.0, False, 2.621465, 1.607533),
        (0.03 / 60.0, True, 0.297406, 0.004716),
    ],
)  # fmt: skip
def test_a_constant_velocity_filter_has_the_riccati_steady_state(
    density: float, after: bool, position: float, velocity: float
) -> None:
    """The position sigma is printed to six decimals: half a unit of the last."""
    end = 200.0 if density == 1.0 else 3000.0
    sensors = (make_sensor("fix", np.arange(1.0, end + 1.0), {"position": 2.0}),)
    sigmas = {"position": 3.0, "velocity": 1.0}
    model = make_filter(sensors, white(density), sigmas)
    found = close(rest(duration=end, earth=EMPTY_SPACE), white(density), sensors, model, end, after)
    true, own = sigma_of(found, sensors, sigmas)
    assert true[0, :3] == pytest.approx(position, abs=6e-7)
    assert true[0, 3:6] == pytest.approx(velocity, abs=6e-7)
    assert own == pytest.approx(true, rel=1e-9)


@pytest.mark.parametrize(
    ("velocity_noise", "expected"), [(None, (0.608786, 0.036577, 149.42)), (0.1, (0.427875, 0.023352, 123.23))]
)
def test_a_gauss_markov_bias_is_estimated_to_its_steady_state(
    velocity_noise: float | None, expected: tuple[float, float, float]
) -> None:
    end, micro_g = 4000.0, 9.80665e-6
    imu = Imu(Noise(), Noise(np.full(3, 0.03 / 60.0), np.full(3, 1000.0 * micro_g), np.full(3, 3600.0)))
    measured = {"position": 2.0} if velocity_noise is None else {"position": 2.0, "velocity": velocity_noise}
    sensors = (make_sensor("fix", np.arange(1.0, end + 1.0), measured),)
    sigmas = {"position": 3.0, "velocity": 1.0}
    model = make_filter(sensors, imu, sigmas, ("accelerometer_bias",))
    found = close(rest(duration=end, earth=EMPTY_SPACE), imu, sensors, model, end)
    true, own = sigma_of(found, sensors, sigmas)
    assert true[0, 0] == pytest.approx(expected[0], abs=6e-7)
    assert true[0, 3] == pytest.approx(expected[1], abs=6e-7)
    assert np.sqrt(found.own_variances[0, 0]) / micro_g == pytest.approx(expected[2], abs=6e-3)
    assert own == pytest.approx(true, rel=1e-9)


def test_a_bias_left_out_makes_the_filter_dishonest_and_considered_it_is_honest() -> None:
    """Check values: the filter says 0.616969 m, 1.939450 m is true; as a Schmidt state 0.865602 m."""
    end = 6000.0
    bias = Noise(np.full(3, 0.03 / 60.0), np.full(3, 1e-3 * 9.80665), np.full(3, 3600.0))
    imu = Imu(Noise(), bias)
    sensors = (make_sensor("fix", np.arange(1.0, end + 1.0), {"position": 2.0}),)
    sigmas = {"position": 3.0, "velocity": 1.0}
    truth = rest(duration=end, earth=EMPTY_SPACE)
    believed = white(1e-2)  # its density squared is 1e-4
    found = close(truth, imu, sensors, make_filter(sensors, believed, sigmas), end)
    true, own = sigma_of(found, sensors, sigmas)
    assert own[0, 0] == pytest.approx(0.616969, abs=6e-7)
    assert true[0, 0] == pytest.approx(1.939450, abs=6e-7)
    model = make_filter(sensors, imu, sigmas, (), ("accelerometer_bias",))
    true, own = sigma_of(close(truth, imu, sensors, model, end), sensors, sigmas)
    assert true[0, 0] == pytest.approx(0.865602, abs=6e-7)
    assert own == pytest.approx(true, rel=1e-9)


def test_a_mismatched_scalar_filter_has_the_printed_variances() -> None:
    """Attitude as a random walk: truth q = 1, r = 4, filter q = 0.25, all times 1e-12."""
    end = 200.0
    imu, believed = (Imu(Noise(random_walk=np.full(3, size * 1e-6)), Noise()) for size in (1.0, 0.5))
    sensors = (make_sensor("stars", np.arange(1.0, end + 1.0), {"attitude": 2e-6}),)
    found = close(
        rest(duration=end, earth=EMPTY_SPACE), imu, sensors, make_filter(sensors, believed, {"tilt": 1e-6}), end
    )
    true, own = sigma_of(found, sensors, {"tilt": 1e-6})
    assert own[0, 6] ** 2 == pytest.approx(0.8827822185e-12, rel=1e-9)
    assert true[0, 6] ** 2 == pytest.approx(2.0427120591e-12, rel=1e-9)


def all_sensors(end: float) -> tuple:
    """Every kind of measurement, with constant and correlated errors."""
    return (
        make_sensor("gnss", np.arange(1.0, end), {"position": 3.0, "velocity": 0.1}, lever_arm=(2.0, 0.3, -1.0)),
        make_sensor("altimeter", np.arange(5.0, end, 5.0), {"altitude": 5.0}, 10.0, 300.0),
        make_sensor("stars", np.arange(20.0, end, 20.0), {"attitude": 2e-5}, 1e-5, 60.0),
        make_sensor("doppler", np.arange(2.5, end, 7.0), {"body_velocity": 0.2}),
        make_sensor("compass", np.arange(3.0, end, 10.0), {"heading": 0.02}),
    )


def test_a_filter_that_believes_the_truth_has_the_true_covariance_at_every_epoch() -> None:
    """Along a flight with turns, with every kind of sensor: 1e-9 of each sigma, of the estimated errors, too."""
    end = 900.0
    sensors = all_sensors(end)
    sigmas = SIGMAS | {
        "gnss_position_bias": 1.0, "gnss_lever_arm": 0.05, "altimeter_bias": 20.0, "altimeter_scale": 1e-3,
        "stars_bias": 3e-5, "doppler_bias": 0.05, "doppler_scale": 2e-3, "compass_bias": 0.01,
    }  # fmt: skip
    kinds = (
        "gyro_bias", "accelerometer_bias", "gnss_position_bias", "gnss_lever_arm", "altimeter_bias",
        "altimeter_scale_factor", "stars_bias", "doppler_bias", "doppler_scale_factor", "compass_bias",
    )  # fmt: skip
    times = np.union1d(np.arange(end + 1.0), sensors[3].times)
    model = make_filter(sensors, NOISY, sigmas, kinds)
    loop = close_loop(flight(1.0), "strapdown", times, NOISY, sensors, model)
    readings = np.repeat(np.arange(0, len(times), 50), 2)
    found = propagate_closed_loop(loop, readings, np.tile([False, True], len(readings) // 2))
    sizes = sized(sensors, sigmas)
    total = np.einsum("mis,s,mjs->mij", found.partials, sizes**2, found.partials) + sum(found.processes.values())
    scale = np.sqrt(np.einsum("mii,mjj->mij", found.own, found.own))
    assert np.abs((total - found.own) / scale).max() < 1e-9
    states = np.einsum("mqs,s->mq", found.state_partials**2, sizes**2) + sum(found.state_variances.values())
    assert states == pytest.approx(found.own_variances, rel=1e-9)


def test_causes_add_up_and_each_alone_has_its_share() -> None:
    """One cause at a time through the same gains: the sum is the whole, to 1e-10 by rounding of 300 steps."""
    end = 300.0
    sensors = (
        make_sensor("gnss", np.arange(1.0, end), {"position": 3.0, "velocity": 0.1}),
        make_sensor("altimeter", np.arange(5.0, end, 5.0), {"altitude": 5.0}, 10.0, 300.0),
    )
    sigmas = SIGMAS | NEGLECTED | {"altimeter_bias": 20.0}
    times = np.arange(end + 1.0)
    model = make_filter(sensors, NOISY, SIGMAS, ("gyro_bias", "accelerometer_bias"))
    loop = close_loop(flight(1.0), "strapdown", times, NOISY, sensors, model)
    last, after = np.array([int(end)]), np.array([True])
    whole = propagate_closed_loop(loop, last, after)
    quiet = replace(loop, imu=Imu(gyro=NOISY.gyro))
    gyros = propagate_closed_loop(quiet, last, after)
    assert set(gyros.processes) < set(whole.processes)
    for name, covariance in gyros.processes.items():
        sigma = np.sqrt(np.diagonal(whole.processes[name], axis1=1, axis2=2))
        assert np.all(np.abs(covariance - whole.processes[name]) <= 1e-10 * sigma[:, :, None] * sigma[:, None])
    true, own = sigma_of(whole, sensors, sigmas)
    matched, _ = sigma_of(whole, sensors, SIGMAS)
    assert np.all(true[0] > own[0])
    assert np.all(true[0] > matched[0])
