"""Gravity disturbances: closed forms, a dense covariance written here, both engines, filters that know them or not."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from scipy import stats
from scipy.linalg import expm

from mcnav.arrays.types import Array
from mcnav.contract.samples import Batch, SimulationResult
from mcnav.systems.ins.aided import AidedEngine, AidedReferenceEngine
from mcnav.systems.ins.earth import WGS84, Earth
from mcnav.systems.ins.ensemble.aided import simulate_aided
from mcnav.systems.ins.imu.gravity import GravityDisturbance
from mcnav.systems.ins.imu.instruments import CONSTANTS, Imu, Noise
from mcnav.systems.ins.linear.covariance import output_map
from mcnav.systems.ins.scenario import Ins, Navigation
from mcnav.systems.ins.truth.trajectory import Truth
from tests.aided import make_filter, make_sensor, propagated_at_once, sized

ARCSEC, MGAL = np.pi / 648_000.0, 1e-5
GRAVITY = GravityDisturbance(5.0 * ARCSEC, 30e3, 30.0 * MGAL, 50e3)
END = 900.0
FALSE_ALARM = 1e-4
"""Of each test here."""

STILL = Earth(6.378137e6, 0.0, 3.986004418e14, 0.0)
"""A sphere that does not turn."""


def truth(earth: Earth, speed: float, swings: float = 0.0) -> Truth:
    """Go north from 47 degrees at a speed over the ground, which swings around it."""
    time = np.linspace(0.0, END, 1801)
    turn = 2.0 * np.pi / END
    way = speed * time - swings * np.sin(turn * time) / turn
    north, _ = earth.curvature_radii(np.array(np.radians(47.0)))
    latitude, same = np.radians(47.0) + way / north, np.ones_like(time)
    return Truth.through(earth, time, latitude, 0.2 * same, 1e3 * same, np.zeros((len(time), 3)))


def navigation(of: Truth, imu: Imu | None = None) -> Navigation:
    return Navigation(of, "strapdown", 0.0, END, imu or Imu(gravity=GRAVITY))


@pytest.mark.parametrize("name", ["gravity_deflection", "gravity_anomaly"])
def test_at_rest_disturbances_are_constants_with_closed_forms(name: str) -> None:
    """``r xi (1 - cos w t)`` north and ``-A (cosh u t - 1) / u^2`` down, with w^2 = g / r and u^2 = 2 g / r.

    Velocity errors are their derivatives. The tilt of the local axes by the error of the position is the error of the
    attitude. The quadrature of the responses errs by less than 1e-8.
    """
    of = navigation(truth(STILL, 0.0))
    radius = STILL.radius + 1e3
    gravity = STILL.gravitational_parameter / radius**2
    w, u = np.sqrt(gravity / radius), np.sqrt(2.0 * gravity / radius)
    times, xi, anomaly = of.times, 5.0 * ARCSEC, 30.0 * MGAL
    sigmas = np.sqrt(np.maximum(np.diagonal(of.linear.processes[name], axis1=1, axis2=2), 0.0))  # zeros are rounded
    level = np.stack([radius * xi * (1.0 - np.cos(w * times)), radius * xi * w * np.sin(w * times)], axis=1)
    if name == "gravity_deflection":
        np.testing.assert_allclose(sigmas[:, [0, 3]], level, rtol=1e-6, atol=1e-12)
        np.testing.assert_allclose(sigmas[:, [1, 4]], level, rtol=1e-6, atol=1e-12)
        np.testing.assert_allclose(sigmas[:, 7] * radius, level[:, 0], rtol=1e-6, atol=1e-12)
        assert np.all(sigmas[:, [2, 5]] <= 1e-7 * level[-1])  # roots of rounded variances
    else:
        down = np.stack([anomaly * (np.cosh(u * times) - 1.0) / u**2, anomaly * np.sinh(u * times) / u], axis=1)
        np.testing.assert_allclose(sigmas[:, [2, 5]], down, rtol=1e-6, atol=1e-12)
        assert np.all(sigmas[:, [0, 1, 3, 4]] <= 1e-7 * down[-1].repeat(2))


def system(of: Truth, time: float, disturbances: GravityDisturbance) -> Array:
    """Return ``[[F, Q], [0, -F^T]]`` of earth-fixed v and x and of the three processes, which are these ten lines."""
    spin = np.array([[0.0, -of.earth.rotation_rate, 0.0], [of.earth.rotation_rate, 0.0, 0.0], [0.0, 0.0, 0.0]])
    sigma = np.array([disturbances.deflection, disturbances.deflection, disturbances.anomaly])
    length = np.array([disturbances.deflection_length] * 2 + [disturbances.anomaly_length])
    position, velocity = (each[0] for each in of.earth_fixed(np.array([time])))
    latitude, longitude, altitude = of.earth.to_geodetic(position[None])[0]
    above = of.earth.from_geodetic(*(np.array(each) for each in (latitude, longitude, altitude + 1e3)))
    down, east = (position - above) / 1e3, np.cross([0.0, 0.0, 1.0], position) / np.hypot(*position[:2])
    gravity = np.linalg.norm(of.earth.gravitation(position[None])[0] - spin @ spin @ position)
    f, q, rates = np.zeros((9, 9)), np.zeros((9, 9)), np.linalg.norm(velocity) / length
    f[:3, :3], f[3:6, :3] = -2.0 * spin, np.eye(3)
    f[:3, 3:6] = of.earth.gravity_gradient(position[None])[0] - spin @ spin
    f[:3, 6:] = np.stack([gravity * np.cross(east, down), gravity * east, -down], axis=1)
    f[6:, 6:], q[6:, 6:] = -np.diag(rates), np.diag(2.0 * sigma**2 * rates)
    return np.block([[f, q], [np.zeros((9, 9)), -f.T]])


def dense(of: Truth, times: Array, disturbances: GravityDisturbance) -> list[Array]:
    """Propagate the covariance to times by Magnus' series of fourth order over each second.

    It errs by the fourth power of what the vehicle and the earth turn, and a disturbance changes, in it: (1e-2)^4.
    """
    sigma = np.array([disturbances.deflection, disturbances.deflection, disturbances.anomaly])
    p, now, found, node = np.diag(np.concatenate([np.zeros(6), sigma**2])), 0.0, [], np.sqrt(3.0) / 6.0
    for end in times:
        for middle in now + np.arange(round(end - now)) + 0.5:
            a, b = (system(of, middle + shift, disturbances) for shift in (-node, node))
            whole = expm(0.5 * (a + b) - np.sqrt(3.0) / 12.0 * (a @ b - b @ a))
            p = (whole[:9, :9] @ p + whole[:9, 9:]) @ whole[:9, :9].T
        now = end
        found.append(p)
    return found


def outputs_of(of: Truth, time: float, p: Array) -> Array:
    """Map the covariance of earth-fixed velocity and position to that of the outputs."""
    rate, turned = of.earth.rotation_rate, of.earth.turned(np.array(time - of.times[0]))
    spin = np.array([[0.0, -rate, 0.0], [rate, 0.0, 0.0], [0.0, 0.0, 0.0]])
    to_inertial = np.zeros((9, 6))
    to_inertial[3:6, :3], to_inertial[3:6, 3:], to_inertial[6:, 3:] = turned, spin @ turned, turned
    both = output_map(of, time) @ to_inertial
    return np.asarray(both @ p[:6, :6] @ both.T)


@pytest.mark.parametrize(
    ("speed", "swings"), [(0.0, 0.0), (250.0, 0.0), (100.0, 100.0)], ids=["at rest", "cruise", "from rest to rest"]
)
def test_linear_covariance_is_the_dense_one(speed: float, swings: float) -> None:
    """Over the turning ellipsoid to 1e-6 of the sigmas, in the usual steps of 15 s.

    Beside the largest of its kind a variance of an output is rounded to 1e-15 of it.
    """
    of = navigation(truth(WGS84, speed, swings))
    for name, size in (
        ("gravity_deflection", replace(GRAVITY, anomaly=0.0)), ("gravity_anomaly", replace(GRAVITY, deflection=0.0)),
    ):  # fmt: skip
        for place, p in zip((20, 60), dense(of.truth, of.times[[20, 60]], size), strict=True):
            expected = outputs_of(of.truth, float(of.times[place]), p)
            found = of.linear.processes[name][place]
            sigma = np.sqrt(np.diag(expected))
            largest = np.repeat(sigma.reshape(3, 3).max(axis=1), 3)
            allowed = 1e-6 * np.outer(sigma, sigma) + 1e-15 * np.outer(largest, largest)
            assert np.all(np.abs(found - expected) <= allowed)


def test_disturbances_started_within_the_flight_are_stationary_there() -> None:
    """The noise of navigation from each start is that of a navigation which begins then."""
    of = Ins(navigation(truth(WGS84, 250.0)))
    starts = np.array([0.0, 200.0, 500.0])
    for start, noise in zip(starts, of.noise_at(starts), strict=True):
        own = of.started_at(float(start), "start").navigation.linear
        expected = sum(each[-1] for each in own.processes.values())
        np.testing.assert_allclose(noise, expected, rtol=1e-9, atol=1e-12 * np.abs(expected).max())


@lru_cache
def simulated(name: str, count: int) -> tuple[Navigation, SimulationResult]:
    of = navigation(truth(WGS84, 250.0))
    none = np.zeros((count, len(CONSTANTS)))
    return of, Ins(of).engine(name, none[:8]).simulate(Batch(np.arange(count), none, 11))


@pytest.mark.parametrize(("name", "count"), [("ensemble", 2_000), ("reference", 100)])
def test_samples_have_the_linear_covariance_and_twins(name: str, count: int) -> None:
    """Without any other error: mean squares within chi-square intervals at epochs, and those of the twins.

    What is not linear is 300 m over the earth's radius of an error of that size, 5e-5.
    """
    of, result = simulated(name, count)
    assert not result.failures
    assert result.history is not None
    assert result.linear_values is not None
    variances = sum(np.diagonal(each, axis1=1, axis2=2) for each in of.linear.processes.values())
    places = [10, 30, 60]
    each = FALSE_ALARM / (len(places) * 9)
    low, high = stats.chi2.ppf([each / 2, 1.0 - each / 2], count) / count
    ratios = (result.history[:, places] ** 2).mean(axis=0)[:, :8] / np.asarray(variances)[places, :8]
    assert np.all((low < ratios) & (ratios < high))
    sigma = np.sqrt(np.asarray(variances)[-1])
    assert np.all(np.abs(result.values - result.linear_values) <= 1e-3 * sigma)
    assert np.abs(result.values - result.linear_values).max() > 0.0


WALK = Imu(Noise(np.full(3, 6e-7)), Noise(np.full(3, 2e-5)), GRAVITY)
SIGMAS = {"position": 10.0, "velocity": 0.1, "tilt": 5e-5, "heading": 3e-4, "gyro_bias": 5e-8}
STATES = ("gravity_deflection", "gravity_anomaly")


def aided(
    estimates: tuple[str, ...] = STATES, considers: tuple[str, ...] = (), believed: GravityDisturbance = GRAVITY
) -> Ins:
    """Aid a cruise by positions each 20 s, precise enough to see the disturbances."""
    sensor = make_sensor("gnss", np.arange(20.0, END, 20.0), {"position": 0.5, "velocity": 0.005})
    model = make_filter((sensor,), replace(WALK, gravity=believed), SIGMAS, ("gyro_bias", *estimates), considers)
    return Ins(Navigation(truth(WGS84, 250.0), "strapdown", 0.0, END, WALK, (sensor,), model))


def total(of: Ins) -> Array:
    """Return the true covariance of the outputs at the epochs."""
    linear = of.navigation.linear
    sizes = sized(of.navigation.sensors, SIGMAS) ** 2
    partials = linear.partials
    return np.asarray(np.einsum("mis,s,mjs->mij", partials, sizes, partials) + sum(linear.processes.values()))


@pytest.mark.parametrize(("estimates", "considers"), [(STATES, ()), ((), STATES), (STATES[:1], STATES[1:])])
def test_a_filter_that_knows_them_has_the_true_covariance(
    estimates: tuple[str, ...], considers: tuple[str, ...]
) -> None:
    """Estimated or considered: its own is the true one to 1e-9, in outputs and in its other states."""
    of = aided(estimates, considers)
    prediction = of.filter_prediction()
    assert prediction is not None
    sigma = np.sqrt(np.diagonal(prediction.covariance, axis1=1, axis2=2))
    apart = np.abs(total(of) - prediction.covariance)
    assert np.all(apart <= 1e-9 * sigma[:, :, None] * sigma[:, None, :])
    assert of.navigation.aided is not None
    closed = of.navigation.aided.linear
    sizes = sized(of.navigation.sensors, SIGMAS)
    true = np.einsum("mqs,s->mq", closed.state_partials**2, sizes**2) + sum(closed.state_variances.values())
    np.testing.assert_allclose(true, closed.own_variances, rtol=1e-9)
    at_once = propagated_at_once(of.navigation.aided, np.array([END]), sizes)
    assert np.all(np.abs(at_once.covariance[-1] - total(of)[-1]) <= 1e-9 * np.outer(sigma[-1], sigma[-1]))
    final = closed.own_variances[-1, -3:] / np.array([GRAVITY.deflection, GRAVITY.deflection, GRAVITY.anomaly]) ** 2
    if estimates == STATES:
        assert np.all(final < 0.8)  # it has learned something


def test_a_filter_that_neglects_them_is_optimistic_and_one_that_considers_them_is_no_worse_than_it_says() -> None:
    neglecting, knowing = aided(()), aided()
    for of, optimistic in ((neglecting, True), (knowing, False)):
        prediction = of.filter_prediction()
        assert prediction is not None
        ratio = np.sqrt(np.diag(total(of)[-1]) / np.diag(prediction.covariance[-1]))
        assert bool(ratio[:6].max() > 1.2) is optimistic
    true = [np.sqrt(np.diag(total(of)[-1])) for of in (neglecting, knowing)]
    assert np.all(true[1] <= true[0] * (1.0 + 1e-9))


def test_beliefs_replace_sizes_and_lengths() -> None:
    """A filter that believes in ten times the deflection over half the distance has another covariance."""
    believed = replace(GRAVITY, deflection=10.0 * GRAVITY.deflection, deflection_length=15e3)
    of, matched = aided(believed=believed), aided()
    own, other = of.filter_prediction(), matched.filter_prediction()
    assert own is not None
    assert other is not None
    assert np.all(np.diag(own.covariance[-1])[3:5] > 1.2 * np.diag(other.covariance[-1])[3:5])
    assert of.filter_schema is not None
    assert of.filter_schema.states == matched.filter_schema.states  # type: ignore[union-attr]
    assert np.all(np.diag(total(of)[-1])[3:5] > np.diag(total(matched)[-1])[3:5])


@lru_cache
def filtered(count: int) -> tuple[Ins, AidedEngine, SimulationResult]:
    of = aided()
    errors = np.random.default_rng(3).standard_normal((count, len(of.sources))) * sized(of.navigation.sensors, SIGMAS)
    engine = of.engine("ensemble", errors[:8])
    assert isinstance(engine, AidedEngine)
    return of, engine, engine.simulate(Batch(np.arange(count), errors, 5))


def test_a_matched_filter_with_them_as_states_is_consistent() -> None:
    """NEES of all groups, and mean squares of the states' errors over their variances, within intervals at epochs."""
    count = 200
    _, engine, result = filtered(count)
    assert not result.failures
    assert result.filter_values is not None
    places = engine.filter.places
    nees = result.filter_values[..., places["nees"]].mean(axis=0)
    each = FALSE_ALARM / nees.size
    for place, size in enumerate(engine.filter.groups.values()):
        low, high = stats.chi2.ppf([each / 2, 1.0 - each / 2], count * size) / count
        assert np.all((nees[:, place] > low) & (nees[:, place] < high))
    square = (result.filter_values[..., places["state_error"]] ** 2).mean(axis=0)
    ratio = square / result.filter_values[..., places["state_variance"]].mean(axis=0)
    each = FALSE_ALARM / ratio.size
    low, high = stats.chi2.ppf([each / 2, 1.0 - each / 2], count) / count
    assert np.all((ratio > low) & (ratio < high))


def test_the_ensemble_agrees_with_the_reference_fed_the_same_noise() -> None:
    """Three samples whose filters estimate the disturbances, to 1e-3 of the filter's sigma at every epoch.

    The reference adds its estimate along the local axes; the ensemble turns it by the error of the attitude, 3e-4 rad
    at most, with all that is subtracted in a step: 3e-4 of the estimate.
    """
    of = aided()
    reference = of.engine("reference", np.zeros((1, 1)))
    assert isinstance(reference, AidedReferenceEngine)
    own = of.filter_prediction()
    assert own is not None
    assert of.navigation.aided is not None
    assert of.filter_schema is not None
    sigma = np.sqrt(np.diagonal(own.covariance, axis1=1, axis2=2))
    tables, places = of.navigation.aided.tables(1), of.filter_schema.places
    errors = np.random.default_rng(3).standard_normal((3, len(of.sources))) * sized(of.navigation.sensors, SIGMAS)
    for number in range(len(errors)):
        noise = reference.mechanization.draw(WALK, 17, number)
        given = reference.given(noise)
        found = simulate_aided(tables, errors[number : number + 1], 0, np.zeros(1, int), True, given)
        expected, records = reference.mechanization.simulate(errors[number], noise)
        assert np.all(np.abs(found.values[0] - expected) < 1e-3 * sigma)
        one, other = (each[:, places["state_variance"]] for each in (records, found.records[0]))
        np.testing.assert_allclose(one, other, rtol=1e-3)
        assert reference.linear(errors[number], noise) == pytest.approx(found.linear[0], abs=1e-12)


def test_reference_filters_are_consistent_with_their_states() -> None:
    """NEES of 16 samples of the reference engine, which draws the disturbances in its own steps.

    Its draws are those of 100 samples above, and its filter, fed the same noise, is the ensemble's.
    """
    of, count = aided(), 16
    errors = np.random.default_rng(4).standard_normal((count, len(of.sources))) * sized(of.navigation.sensors, SIGMAS)
    engine = of.engine("reference", errors[:8])
    assert isinstance(engine, AidedReferenceEngine)
    result = engine.simulate(Batch(np.arange(count), errors, 5))
    assert result.filter_values is not None
    nees = result.filter_values[:, [20, 60]][..., engine.filter.places["nees"]].mean(axis=0)
    each = FALSE_ALARM / nees.size
    for place, size in enumerate(engine.filter.groups.values()):
        low, high = stats.chi2.ppf([each / 2, 1.0 - each / 2], count * size) / count
        assert np.all((nees[:, place] > low) & (nees[:, place] < high))
