"""Covariance of aided errors from all causes at once: the sum over causes, means, and many tunings in one pass."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mcnav.arrays.types import Array
from mcnav.systems.ins.imu.instruments import Imu, Noise
from mcnav.systems.ins.linear.aided_errors import ClosedLoopErrors, propagate_closed_loop
from mcnav.systems.ins.linear.closed_loop import close_loop
from mcnav.systems.ins.tunings import Navigated, Tunings
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


def navigated(believed: dict[str, float], mean: Array, covariance: Array) -> Navigated:
    """Return a navigation with a filter that believes some sizes."""
    model = make_filter(SENSORS, NOISY, believed, ("gyro_bias", "altimeter_bias"), ("gnss_lever_arm",))
    return Navigated(TRUTH, "strapdown", TIMES, TIMES[READ], NOISY, SENSORS, model, mean, covariance)


def by_cause(of: Navigated) -> ClosedLoopErrors:
    """Return the errors of a navigation by cause."""
    loop = close_loop(of.truth, of.platform, of.grid, of.imu, of.sensors, of.filter)
    return propagate_closed_loop(loop, READ, np.ones(len(READ)))


def correlated(sizes: Array) -> Array:
    """Return a covariance with correlations between initial errors, and of one with a bias of an instrument."""
    covariance = np.diag(sizes**2)
    for one, other, coefficient in ((0, 3, 0.5), (6, 10, -0.4), (2, len(sizes) - 5, 0.3)):
        covariance[one, other] = covariance[other, one] = coefficient * sizes[one] * sizes[other]
    return covariance


def scaled_by(factor: float, imu: Imu) -> Imu:
    """Return a unit with all processes of other sizes."""
    sizes = ("random_walk", "instability", "rate_random_walk", "quantization")
    gyro, accelerometer = (
        replace(noise, **{name: factor * getattr(noise, name) for name in sizes})
        for noise in (imu.gyro, imu.accelerometer)
    )
    return replace(imu, gyro=gyro, accelerometer=accelerometer)


SIZES = sized(SENSORS, SIGMAS | NEGLECTED)
NOTHING = np.zeros(len(SIZES))


def test_the_covariance_is_the_sum_over_all_causes() -> None:
    """To 1e-9 of the sigmas: 300 steps and 360 updates with rounding of 1e-16 of a first covariance 1e4 as large."""
    of = navigated(SIGMAS, NOTHING, correlated(SIZES))
    causes, (found,) = by_cause(of), Tunings().answer([of], [of])
    expected = causes.partials @ of.covariance @ causes.partials.swapaxes(1, 2) + sum(causes.processes.values())
    scale = np.sqrt(np.einsum("mii,mjj->mij", expected, expected))
    assert np.abs((found.covariance - expected) / scale).max() < 1e-9
    scale = np.sqrt(np.einsum("mii,mjj->mij", causes.own, causes.own))
    assert np.abs((found.own - causes.own) / scale).max() < 1e-9
    assert not found.mean.any()


def test_the_mean_is_the_response_to_the_mean_of_the_sources() -> None:
    mean = SIZES * np.linspace(-1.0, 1.0, len(SIZES))
    of = navigated(SIGMAS, mean, np.zeros((len(SIZES),) * 2))
    (found,) = Tunings().answer([of], [of])
    assert found.mean == pytest.approx(by_cause(of).partials @ mean, rel=1e-9, abs=1e-12)


def variations_of(base: Navigated) -> dict[str, Navigated]:
    """Return navigations that differ from one in sizes: of states, of noise, of sources; or in more than sizes."""
    model = make_filter(SENSORS, NOISY, SIGMAS | {"tilt": 3e-4}, ("gyro_bias", "altimeter_bias"), ("gnss_lever_arm",))
    without = {name: 0.0 if name == "altimeter_bias" else size for name, size in SIGMAS.items()}
    louder = (
        replace(SENSORS[0], components=tuple(replace(each, noise=7.0) for each in SENSORS[0].components)),
        SENSORS[1],
    )
    moved = (replace(SENSORS[0], lever_arm=np.array([9.0, 0.0, 0.0])), SENSORS[1])
    return {
        "tilt": replace(base, filter=model),
        "without a bias": navigated(without, NOTHING, np.diag(SIZES**2)),
        "unit": replace(base, imu=scaled_by(2.0, NOISY)),
        "no noise": replace(base, imu=scaled_by(0.0, NOISY)),
        "sensor": replace(base, sensors=louder),
        "sources": replace(base, covariance=np.diag(4.0 * SIZES**2), mean=SIZES),
        "another lever arm": replace(base, sensors=moved),
        "estimates more": replace(
            base, filter=make_filter(SENSORS, NOISY, SIGMAS, ("gyro_bias", "accelerometer_bias", "altimeter_bias"))
        ),
    }  # fmt: skip


def test_tunings_are_what_each_navigation_is_by_itself() -> None:
    base = navigated(SIGMAS, NOTHING, np.diag(SIZES**2))
    others = variations_of(base)
    together = Tunings().answer([base] * len(others), list(others.values()))
    for (name, of), found in zip(others.items(), together, strict=True):
        causes = by_cause(of)
        expected = causes.partials @ of.covariance @ causes.partials.swapaxes(1, 2) + sum(
            causes.processes.values(), np.zeros((9, 9))
        )
        for answer, exact in ((found.covariance, expected), (found.own, causes.own)):
            scale = np.sqrt(np.einsum("mii,mjj->mij", exact, exact))
            assert np.abs((answer - exact) / scale).max() < 1e-9, name
        alone = Tunings().answer([base], [of])[0]
        assert np.array_equal(alone.covariance, found.covariance), name
        assert base.has(of) is (name not in ("another lever arm", "estimates more")), name


def test_another_flight_or_grid_is_no_tuning() -> None:
    base = navigated(SIGMAS, NOTHING, np.diag(SIZES**2))
    for change in ({"truth": replace(TRUTH)}, {"platform": "inertial"}, {"grid": np.arange(0.0, END + 0.5, 0.5)}):
        assert not base.has(replace(base, **change))
