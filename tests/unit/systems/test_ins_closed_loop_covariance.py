"""Covariance of aided errors from all causes at once: the sum over causes, means, and tables that loops share."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mcnav._types import Array
from mcnav.systems.ins.imu.instruments import Imu, Noise
from mcnav.systems.ins.linear.aided_errors import propagate_closed_loop, propagate_covariance
from mcnav.systems.ins.linear.closed_loop import ClosedLoop, close_loop
from mcnav.systems.ins.linear.response import respond
from tests.aided import make_filter, make_sensor, sized
from tests.flights import flight

END = 300.0
NOISY = Imu(
    Noise(np.full(3, 6e-7), np.full(3, 1.5e-8), np.full(3, 1000.0), np.full(3, 1e-10), np.full(3, 1e-6)),
    Noise(np.full(3, 2e-4), np.full(3, 5e-5), np.full(3, 500.0), np.full(3, 1e-7)),
)
SIGMAS = {
    "position": 10.0, "velocity": 0.1, "tilt": 1e-4, "heading": 1e-3, "gyro_bias": 5e-8, "accelerometer_bias": 5e-4,
    "gnss_position_bias": 1.0, "gnss_lever_arm": 0.05, "altimeter_bias": 20.0, "altimeter_scale": 1e-3,
}  # fmt: skip
NEGLECTED = {"gyro_scale": 1e-4, "accelerometer_mis": 3e-4}
SENSORS = (
    make_sensor("gnss", np.arange(1.0, END), {"position": 3.0, "velocity": 0.1}, 1.0, 60.0, (2.0, 0.3, -1.0)),
    make_sensor("altimeter", np.arange(5.0, END, 5.0), {"altitude": 5.0}, 10.0, 300.0),
)
TIMES = np.arange(END + 1.0)
READ = np.arange(0, len(TIMES), 50)
TRUTH = flight(1.0)


def loop_of(believed: dict[str, float], shared: ClosedLoop | None = None) -> ClosedLoop:
    model = make_filter(SENSORS, NOISY, believed, ("gyro_bias", "altimeter_bias"), ("gnss_lever_arm",))
    return close_loop(TRUTH, "strapdown", TIMES, NOISY, SENSORS, model, respond, shared)


def correlated(sizes: Array) -> Array:
    """Return a covariance with correlations between initial errors, and of one with a bias of an instrument."""
    covariance = np.diag(sizes**2)
    for one, other, coefficient in ((0, 3, 0.5), (6, 10, -0.4), (2, len(sizes) - 5, 0.3)):
        covariance[one, other] = covariance[other, one] = coefficient * sizes[one] * sizes[other]
    return covariance


def test_the_covariance_is_the_sum_over_all_causes() -> None:
    """To 1e-9 of the sigmas: 300 steps and 360 updates with rounding of 1e-16 of a first covariance 1e4 as large."""
    loop = loop_of(SIGMAS)
    causes = propagate_closed_loop(loop, READ, np.ones(len(READ)))
    sources = correlated(sized(SENSORS, SIGMAS | NEGLECTED))
    expected = causes.partials @ sources @ causes.partials.swapaxes(1, 2) + sum(causes.processes.values())
    found = propagate_covariance(loop, READ, np.zeros(len(sources)), sources)
    scale = np.sqrt(np.einsum("mii,mjj->mij", expected, expected))
    assert np.abs((found.true - expected) / scale).max() < 1e-9
    assert np.array_equal(found.own, causes.own)
    assert not found.mean.any()


def test_the_mean_is_the_response_to_the_mean_of_the_sources() -> None:
    loop = loop_of(SIGMAS)
    sizes = sized(SENSORS, SIGMAS | NEGLECTED)
    mean = sizes * np.linspace(-1.0, 1.0, len(sizes))
    partials = propagate_closed_loop(loop, READ, np.ones(len(READ))).partials
    found = propagate_covariance(loop, READ, mean, np.zeros((len(sizes), len(sizes))))
    assert found.mean == pytest.approx(partials @ mean, rel=1e-9, abs=1e-12)


def test_a_loop_that_shares_tables_is_the_same_as_one_of_its_own() -> None:
    """Whether only the flight is shared, or the filter's gains as well."""
    first = loop_of(SIGMAS)
    sources = correlated(sized(SENSORS, SIGMAS | NEGLECTED))
    before = propagate_covariance(first, READ, np.zeros(len(sources)), sources)
    for believed, same_gains in ((SIGMAS | {"tilt": 3e-4}, False), (SIGMAS | {"gyro_scale": 1.0}, True)):
        shared, own = loop_of(believed, first), loop_of(believed)
        assert shared.responses is first.responses
        assert (shared.filter_design is first.filter_design) is same_gains
        mean = np.zeros(len(sources))
        taken_over = propagate_covariance(shared, READ, mean, sources, before)
        alone = propagate_covariance(own, READ, mean, sources)
        assert taken_over.maps is before.maps
        assert np.array_equal(taken_over.true, alone.true)
        assert np.array_equal(taken_over.own, alone.own)


def test_tables_of_another_flight_grid_or_sensor_are_not_shared() -> None:
    first = loop_of(SIGMAS)
    model, same = first.model, {"truth": TRUTH, "platform": "strapdown", "times": TIMES, "sensors": SENSORS}
    moved = (replace(SENSORS[0], lever_arm=np.array([9.0, 0.0, 0.0])), SENSORS[1])
    for change, responses, measurements in (
        ({"truth": replace(TRUTH)}, False, False),
        ({"platform": "inertial"}, False, False),
        ({"times": np.arange(0.0, END + 0.5, 0.5)}, False, True),
        ({"sensors": moved}, True, False),
    ):
        found = same | change
        loop = close_loop(
            found["truth"], found["platform"], found["times"], NOISY, found["sensors"], model, respond, first
        )
        assert (loop.responses is first.responses) is responses
        assert (loop.measurements is first.measurements) is measurements
        assert loop.filter_design is not first.filter_design
