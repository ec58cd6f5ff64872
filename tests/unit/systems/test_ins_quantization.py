"""Quantization of the instruments: closed forms at rest, every reading on its own in a turn, and its draws."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from mcnav.arrays.types import Array
from mcnav.systems.ins.earth import Earth
from mcnav.systems.ins.imu.fine_noise import draw_noise
from mcnav.systems.ins.imu.instruments import AXES, OUTPUTS, Imu, Noise, process_sizes
from mcnav.systems.ins.imu.linear_noise import respond_from_rest
from mcnav.systems.ins.linear.covariance import process_systems
from mcnav.systems.ins.linear.free_timeline import free_errors
from mcnav.systems.ins.linear.response import respond
from mcnav.systems.ins.linear.response_blocks import Responses
from mcnav.systems.ins.reference.mechanization import LONGEST_STEP, longest_step
from mcnav.systems.ins.truth.trajectory import Truth
from tests.flights import flight, rest

GRAVITY = 9.80665
RADIUS = 1e13
FLAT = Earth(RADIUS, 0.0, GRAVITY * RADIUS**2, 0.0)
"""So large that gravity is the same everywhere: its change over 1 km is 1e-9 of it."""

INTERVAL = 0.02


def quantized(gyro: float, accelerometer: float = 0.0, interval: float = INTERVAL) -> Imu:
    return Imu(
        *(
            Noise(quantization=np.full(3, size), quantization_interval=np.full(3, interval))
            for size in (gyro, accelerometer)
        )
    )


def covariances(truth: Truth, imu: Imu, begin: float, end: float, steps: int) -> dict[str, Array]:
    responses = Responses(truth, "strapdown", np.linspace(begin, end, steps + 1), imu)
    return {name: each[0] for name, each in free_errors(truth, responses, imu, np.array([steps])).processes.items()}


@pytest.mark.parametrize("instrument", [0, 1])
def test_of_a_single_axis(instrument: int) -> None:
    """It is there, and as large as beside that of the others."""
    sizes = [np.zeros(3), np.zeros(3)]
    sizes[instrument][1] = 1e-4
    one = Imu(*(Noise(quantization=size, quantization_interval=np.full(3, INTERVAL)) for size in sizes))
    (name,) = (name for name, size in process_sizes(one).items() if size > 0.0)
    found = covariances(rest(duration=60.0, earth=FLAT), one, 0.0, 60.0, 4)[name]
    all_axes = covariances(rest(duration=60.0, earth=FLAT), quantized(1e-4, 1e-4), 0.0, 60.0, 4)[name]
    assert found.any()
    np.testing.assert_array_equal(found, all_axes)


def test_growth_at_rest() -> None:
    """The first reading's error stays as a tilt, the last one's is added, those between are a white tilt.

    On a flat earth ``psi = n - n_0``, and the velocity is g times its integral: g^2 Q^2 (t^2 + t_s t) with t_s between
    readings. To the 2e-7 of the growth laws of the other processes.
    """
    time, angle, speed = 600.0, 5e-6, 1e-3
    found = covariances(rest(duration=time, earth=FLAT), quantized(angle, speed), 0.0, time, 4)
    grown = time**2 + INTERVAL * time
    cases = {
        ("gyro_quantization_z", "heading"): 2.0 * angle**2,
        ("gyro_quantization_x", "tilt_north"): 2.0 * angle**2,
        ("gyro_quantization_x", "velocity_east"): (GRAVITY * angle) ** 2 * grown,
        ("accelerometer_quantization_y", "velocity_east"): 2.0 * speed**2,
        ("accelerometer_quantization_y", "position_east"): speed**2 * grown,
    }
    for (process, output), variance in cases.items():
        place = OUTPUTS.index(output)
        assert found[process][place, place] == pytest.approx(variance, rel=4e-7), (process, output)


def test_each_reading_in_a_turn() -> None:
    """The system of a step is the sum over its readings, each put through the discrete navigator on its own.

    The first and the last one also weigh half of what their neighbours do: to the change of that weight within an
    interval, 0.3 % at the largest turn rate; a position does not move within an interval by more than that times the
    velocity. The rest is the trapezoidal rule: its error is the square of that.
    """
    begin, end = 630.0, 650.0
    times = np.linspace(begin, end, round((end - begin) / INTERVAL) + 1)
    ends, none = np.array([begin, end]), np.zeros((len(times) - 1, 3))
    imu = quantized(1.0, 1.0)
    systems = process_systems(respond(flight(), "strapdown", ends, imu), imu)
    change = 0.003
    for instrument in ("gyro", "accelerometer"):
        for axis, letter in enumerate(AXES):
            found = np.empty((len(times), 9))
            for reading in range(len(times)):
                errors = np.zeros((len(times), 3))
                errors[reading, axis] = 1.0
                rates = np.diff(errors, axis=0) / INTERVAL
                given = (rates, none) if instrument == "gyro" else (none, rates)
                found[reading] = respond_from_rest(flight(), "strapdown", times, ends, *given)[0]
            response, covariance, variance = systems[f"{instrument}_quantization_{letter}"]
            assert variance == 1.0
            last = covariance[0, 9, :9]
            first_half, last_half = found[0] - response[0, :9], found[-1] - last
            for half, next_to_it in ((first_half, found[1]), (last_half, found[-2])):
                gap, size = np.abs(half - 0.5 * next_to_it), INTERVAL * (GRAVITY if instrument == "gyro" else 1.0)
                assert gap[:6].max() < change * size
                assert gap[6:].max() < max(change, INTERVAL) * size
            between = found[1:-1].T @ found[1:-1]
            between += 2.0 * (np.outer(first_half, first_half) + np.outer(last_half, last_half))
            got = covariance[0, :9, :9] - np.outer(last, last)
            sigma = np.sqrt(np.diag(between))
            sigma = np.where(sigma > 0.0, sigma, 1.0)
            np.testing.assert_allclose(got / np.outer(sigma, sigma), between / np.outer(sigma, sigma), atol=change**2)


def test_steps_compose() -> None:
    """What a step adds for the reading at its end, the next one takes back: to rounding of the quadrature's sums."""
    few, many = (covariances(flight(), quantized(1e-6, 1e-3), 600.0, 1200.0, steps) for steps in (2, 60))
    assert len(many) == 6
    for name, covariance in many.items():
        np.testing.assert_allclose(few[name], covariance, rtol=1e-7, atol=1e-9 * covariance.max())


def test_drawn_increments_are_differences() -> None:
    """What the readings add up to is white with sigma Q about the first one's error, at a false-alarm rate of 1e-4.

    Readings between the instants at which they are taken are in proportion, and a step is at most an interval long.
    """
    size, count = 1e-3, 20_000
    imu = quantized(size, 2.0 * size)
    assert longest_step(imu) == INTERVAL
    assert longest_step(Imu()) == LONGEST_STEP
    coarse = INTERVAL * np.arange(count + 1)
    fine = 0.5 * INTERVAL * np.arange(2 * count + 1)
    limit = float(stats.norm.isf(0.5e-4)) / np.sqrt(count)
    low, high = stats.chi2.ppf([0.5e-4, 1.0 - 0.5e-4], count - 1) / (count - 1)
    halves = draw_noise(imu, fine, 3, 8)
    for number, found in enumerate(draw_noise(imu, coarse, 3, 8)):
        summed = INTERVAL * np.cumsum(found, axis=0) / (size * (number + 1))
        errors = summed - summed.mean(axis=0)
        for axis in range(3):
            assert low < errors[:, axis].var(ddof=1) < high
            assert abs(np.mean(errors[1:, axis] * errors[:-1, axis])) < limit
        np.testing.assert_allclose(
            halves[number].reshape(count, 2, 3).mean(axis=1), found, atol=1e-12 * np.abs(found).max()
        )


def test_draws_leave_other_processes_alone() -> None:
    walk = Noise(np.full(3, 1e-6))
    times = np.arange(0.0, 10.0, 0.01)
    only = draw_noise(Imu(walk, walk), times, 3, 8)
    counted = draw_noise(quantized(1e-6, 1e-3), times, 3, 8)
    both = draw_noise(
        Imu(
            Noise(walk.random_walk, quantization=np.full(3, 1e-6), quantization_interval=np.full(3, INTERVAL)),
            Noise(walk.random_walk, quantization=np.full(3, 1e-3), quantization_interval=np.full(3, INTERVAL)),
        ),
        times, 3, 8,
    )  # fmt: skip
    for one, other, sum_of_both in zip(only, counted, both, strict=True):
        np.testing.assert_allclose(one + other, sum_of_both, atol=1e-12 * np.abs(sum_of_both).max())
