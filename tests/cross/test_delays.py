"""Measurements that are late: how fast each quantity changes, anchors of linear analysis, and both engines."""

from __future__ import annotations

import re
from copy import deepcopy
from dataclasses import replace
from functools import lru_cache
from typing import Any, Final

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mcnav.arrays.products import map_covariances
from mcnav.arrays.types import Array
from mcnav.config.campaign import Campaign
from mcnav.config.read import parse_campaign
from mcnav.contract.samples import Batch
from mcnav.studies.sweep import SweepPlan, run_sweep
from mcnav.systems.ins.aided import AidedNavigation, AidedReferenceEngine
from mcnav.systems.ins.earth import WGS84, local_axes
from mcnav.systems.ins.ensemble.aided import GivenNoise, simulate_aided
from mcnav.systems.ins.filter.tables import noise_matrices
from mcnav.systems.ins.scenario import Ins
from mcnav.systems.ins.sensors.beams import beam_range, ground_scales
from mcnav.systems.ins.sensors.magnetometer import POLE, dipole_field
from mcnav.systems.ins.sensors.measurements import measure
from mcnav.systems.ins.sensors.registry import QUANTITIES
from mcnav.systems.ins.truth.trajectory import Truth
from tests.cross.test_sensor_conformance import ARRANGEMENTS, sensor_of

ARM = np.array([2.0, 0.3, -1.0])


@lru_cache
def tumble() -> Truth:
    """Climb in a turn of 3 deg/s at 80 m/s, pitching and rolling by up to 30 deg, with rows ten times a second."""
    time = np.arange(0.0, 60.05, 0.1)
    heading, altitude = np.radians(3.0) * time, 500.0 + 10.0 * time + 20.0 * np.sin(0.3 * time)
    radius = 6.38e6
    latitude = np.radians(45.0) + 80.0 / np.radians(3.0) * np.sin(heading) / radius
    longitude = np.radians(10.0) + 80.0 / np.radians(3.0) * (1.0 - np.cos(heading)) / radius / np.cos(np.radians(45.0))
    angles = np.stack([heading, 0.3 * np.sin(0.7 * time), 0.5 * np.sin(0.9 * time + 1.0)], axis=-1)
    return Truth.through(WGS84, time, latitude, longitude, altitude, angles)


def measured_at(truth: Truth, quantity: str, time: float, level: Array, axes: Array) -> Array:
    """Return what a sensor measures without errors; positions along given local axes, attitudes from given axes."""
    times = np.array([time])
    (position,), (velocity,) = truth.earth_fixed(times)
    body, turning = truth.attitude(time).as_matrix(), truth.attitude(time, 1)
    latitude, longitude, altitude = truth.geodetic(times)[0]
    own_level, antenna = local_axes(latitude, longitude), body @ np.cross(turning, ARM)
    arrangement = ARRANGEMENTS.get(quantity.partition("_")[0])
    match quantity:
        case "position":
            return np.asarray(level.T @ (position + body @ ARM))
        case "velocity":
            return np.asarray(own_level.T @ (velocity + antenna))
        case "altitude":
            return np.array([altitude])
        case "attitude":
            inertial = WGS84.turned(np.array(time)) @ body
            return Rotation.from_matrix(axes.T @ inertial).as_rotvec()
        case "body_velocity":
            return np.asarray(body.T @ velocity)
        case "heading":
            forward = own_level.T @ body[:, 0]
            return np.array([np.arctan2(forward[1], forward[0])])
        case "magnetic_field":
            return np.asarray(body.T @ dipole_field(POLE, position))
        case "beam_velocity":
            assert arrangement is not None
            return np.asarray(arrangement[:, :3] @ (body.T @ velocity + np.cross(turning, ARM)))
        case "beam_range":
            assert arrangement is not None
            place = position + body @ ARM
            return np.array([beam_range(ground_scales(WGS84, b[3]), place, body @ b[:3])[0] for b in arrangement])
    assert arrangement is not None
    away = arrangement[0] - position
    return np.array([np.linalg.norm(away)]) if quantity == "landmark_range" else body.T @ away / np.linalg.norm(away)


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_what_a_quantity_changes_by_is_its_derivative(quantity: str) -> None:
    """Central differences within an interval of the truth's splines, extrapolated: (0.04 s)^4 of the fifth order.

    Rounding of positions of 6.4e6 m adds 1e-9 m / 0.02 s.
    """
    truth, time = tumble(), 30.05
    latitude, longitude, _ = truth.geodetic(np.array([time]))[0]
    axes = WGS84.turned(np.array(time)) @ truth.attitude(time).as_matrix()
    fixed = (local_axes(latitude, longitude), axes)

    def difference(step: float) -> Array:
        ahead, behind = (measured_at(truth, quantity, time + sign * step, *fixed) for sign in (1.0, -1.0))
        return np.asarray((ahead - behind) / (2.0 * step))

    expected = (4.0 * difference(0.02) - difference(0.04)) / 3.0
    found = measure(truth, "strapdown", 0.0, (sensor_of(quantity, np.array([time])),)).changes[0]
    scale = QUANTITIES[quantity].usual
    np.testing.assert_allclose(found[: len(expected)], expected, rtol=2e-6, atol=1e-7 * max(1.0, scale))


STRAIGHT: Final[dict[str, Any]] = {
    "scenario": {
        "type": "ins",
        "trajectory": {
            "start": {"speed": "80 m/s", "course": "90 deg", "latitude": "0 deg", "longitude": "10 deg"},
            "segments": [{"straight": "600 s"}],
        },
    },
    "imu": {
        "gyro": {"bias": "1 deg/h", "angle_random_walk": "0.05 deg/sqrt(h)"},
        "accelerometer": {"bias": "300 ug", "velocity_random_walk": "50 ug/sqrt(Hz)"},
    },
    "errors": {"position": "3 m", "velocity": "0.1 m/s", "tilt": "1 mrad", "heading": "5 mrad"},
    "aiding": [{"type": "gnss", "interval": "1 s", "position": "1 m"}],
    "filter": {"estimates": ["position", "velocity", "attitude", "gyro_bias", "accelerometer_bias"]},
}  # fmt: skip
TURNS: Final = [
    {"straight": "5 s"}, {"turn": "60 deg", "bank": "40 deg"}, {"speed": "100 m/s"},
    {"turn": "-45 deg", "bank": "40 deg"},
]  # fmt: skip
ON_ARM: Final = {"velocity": "0.1 m/s", "lever_arm": ["2 m", "0.5 m", "-1 m"], "lever_arm_error": "10 cm"}


def campaign(
    gnss: dict[str, Any] | None = None, errors: dict[str, Any] | None = None, states: tuple[str, ...] = (),
    considers: tuple[str, ...] = (), segments: list[dict[str, Any]] | None = None,
    believes: dict[str, Any] | None = None,
) -> Campaign:  # fmt: skip
    """Fly at 80 m/s with a receiver once a second."""
    content = deepcopy(STRAIGHT)
    content["aiding"][0] |= gnss or {}
    content["errors"] |= errors or {}
    content["filter"]["estimates"] += states
    content["filter"] |= {"considers": list(considers)}
    if believes:
        content["filter"]["believes"] = {"aiding": {"gnss": believes}}
    if segments is not None:
        content["scenario"]["trajectory"]["segments"] = segments
    return parse_campaign(content, "mine.toml", "mine")


def aided_of(campaign: Campaign) -> AidedNavigation:
    scenario = campaign.scenario
    assert isinstance(scenario, Ins)
    assert scenario.navigation.aided is not None
    return scenario.navigation.aided


def sigmas_at_end(campaign: Campaign) -> tuple[Array, Array, Array]:
    """Return the true sigmas of the outputs, those of the filter, and the mean errors."""
    linear, covariance = aided_of(campaign).linear, campaign.errors.covariance
    partials = linear.partials[-1]
    true = map_covariances(partials, covariance) + sum(each[-1] for each in linear.processes.values())
    return np.sqrt(np.diag(true)), np.sqrt(np.diag(linear.own[-1])), partials @ campaign.errors.mean


def test_a_known_delay_moves_the_position_and_no_sigma() -> None:
    """50 ms at 80 m/s are 4 m; the curvature of the earth adds 8e-4 m. The filter's sigma is that without a delay."""
    late, plain = campaign(errors={"gnss_delay": {"distribution": "fixed", "value": "50 ms"}}), campaign()
    sigma, own, mean = sigmas_at_end(late)
    assert mean[1] == pytest.approx(-4.0008, abs=5e-5)
    np.testing.assert_allclose(own, sigmas_at_end(plain)[1], rtol=1e-12)
    np.testing.assert_allclose(sigma, own, rtol=1e-9)


def test_a_mean_with_a_sigma_is_a_known_delay_and_a_sigma() -> None:
    """The mean error is that of a fixed delay, and sigmas are those of the key ``delay``: the filter takes no mean."""
    states = ("gnss_delay", "gnss_lever_arm")
    stated = {"mean": "110 ms", "sigma": "20 ms"}
    alone, known_delay = {"mean": "110 ms", "sigma": "0 s"}, {"distribution": "fixed", "value": "110 ms"}
    both, without_sigma, fixed = (
        campaign(ON_ARM, {"gnss_delay": delay}, states, (), TURNS, believes)
        for delay, believes in (
            (stated, None), (alone, {"delay": "20 ms"}), (known_delay, {"delay": "20 ms"}),
        )
    )  # fmt: skip
    about_zero = campaign({"delay": "20 ms", **ON_ARM}, None, states, (), TURNS)
    assert both.errors.mean[list(both.errors.names).index("gnss_delay")] == 0.11
    for found, expected in zip(sigmas_at_end(both)[:2], sigmas_at_end(about_zero)[:2], strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-12)
    np.testing.assert_allclose(sigmas_at_end(both)[2], sigmas_at_end(fixed)[2], rtol=1e-12)
    for of_mean, of_fixed in zip(sigmas_at_end(without_sigma), sigmas_at_end(fixed), strict=True):
        np.testing.assert_array_equal(of_mean, of_fixed)
    draws, centred, known = (each.errors.draw("random", 1, 8, 0, 8) for each in (both, about_zero, fixed))
    place = list(both.errors.names).index("gnss_delay")
    np.testing.assert_array_equal(draws[:, place], 0.11 + centred[:, place])
    np.testing.assert_array_equal(known[:, place], 0.11)


def test_an_unmodelled_delay_adds_its_way() -> None:
    """1.6316 m, where the closed form sqrt(0.31784^2 + (80 m/s 20 ms)^2) leaves the earth's curvature out."""
    sigma, own, _ = sigmas_at_end(campaign({"delay": "20 ms"}))
    assert sigma[1] == pytest.approx(1.6316, abs=5e-5)
    assert own[1] == pytest.approx(0.3178, abs=5e-5)
    assert sigma[1] == pytest.approx(np.hypot(own[1], 1.6), rel=3e-4)


def test_an_estimated_delay_stays_where_position_and_delay_are_one() -> None:
    """At (1/0.02^2 + 80^2/3^2)^(-1/2) = 17.647 ms; measured 17.67, as the velocity's error hides some of it."""
    late = campaign({"delay": "20 ms"}, states=("gnss_delay",))
    aided = aided_of(late)
    assert [state.name for state in aided.filter.states][-1] == "gnss_delay"
    last = np.sqrt(aided.linear.own_variances[-1, -1])
    assert last == pytest.approx(17.67e-3, abs=5e-6)
    assert last == pytest.approx((0.02**-2 + (80.0 / 3.0) ** 2) ** -0.5, rel=2e-3)
    sigma, own, _ = sigmas_at_end(late)
    np.testing.assert_allclose(sigma, own, rtol=1e-9)


@pytest.mark.parametrize(
    ("states", "considers"),
    [(("gnss_lever_arm", "gnss_delay"), ()), (("gnss_lever_arm",), ("gnss_delay",))],
)  # fmt: skip
def test_a_filter_that_knows_its_delays_is_consistent(states: tuple[str, ...], considers: tuple[str, ...]) -> None:
    late = campaign({"delay": "20 ms", "jitter": "5 ms", **ON_ARM}, None, states, considers, TURNS)
    linear = aided_of(late).linear
    sigma, own, _ = sigmas_at_end(late)
    np.testing.assert_allclose(sigma, own, rtol=1e-9)
    assert linear.processes["gnss_jitter"][-1].any()


def test_a_smoother_that_knows_its_delays_is_consistent() -> None:
    states = ("gnss_delay", "gnss_lever_arm")
    late = campaign({"delay": "20 ms", "jitter": "5 ms", **ON_ARM}, None, states, (), TURNS)
    aided = aided_of(late)
    smoothed = replace(aided, filter=replace(aided.filter, lag=np.inf)).smoothed_at_epochs
    true = map_covariances(smoothed.partials, late.errors.covariance) + sum(smoothed.processes.values())
    np.testing.assert_allclose(
        np.diagonal(smoothed.own, axis1=1, axis2=2), np.diagonal(true, axis1=1, axis2=2), rtol=1e-9
    )


def test_a_filter_in_turns_that_neglects_a_delay_is_optimistic_in_the_arm() -> None:
    """By 15 after 37 min: at 80 m/s 20 ms are an arm of 1.6 m forward, in turns as well, where the filter has 0.1 m."""
    turns = [{"straight": "60 s"}, {"turn": "180 deg", "bank": "30 deg"}]
    gnss = {"delay": "20 ms", **ON_ARM, "lever_arm_error": "1 m"}
    late = campaign(gnss, states=("gnss_lever_arm",), segments=19 * turns)
    aided = aided_of(late)
    place = [state.name for state in aided.filter.states].index("gnss_lever_arm_x")
    linear, partials = aided.linear, aided.linear.state_partials[-1, place]
    true = partials @ late.errors.covariance @ partials
    true += sum(variances[-1, place] for variances in linear.state_variances.values())
    own = linear.own_variances[-1, place]
    assert np.sqrt(true / own) == pytest.approx(15.0, abs=0.5)
    assert np.sqrt(true) == pytest.approx(1.6, rel=0.02)


def test_jitter_is_noise_that_is_common_to_a_measurement() -> None:
    """A filter of its own, with R = D + s^2 h' h'^T, has the same covariance as one with a state without memory."""
    jittering, plain = (
        aided_of(campaign({**gnss, **ON_ARM}, segments=TURNS)).loop for gnss in ({"jitter": "5 ms"}, {})
    )
    timeline, measured = plain.timeline, plain.measurements
    assert timeline.filter is not None
    steps = timeline.filter.steps(0, len(plain.times) - 1)
    noise, rows = noise_matrices(plain.filter.whole.noise), np.concatenate([measured.rows, plain.filter.rows], axis=2)
    covariance = plain.filter.initial
    for k in range(len(plain.times)):
        for u in range(plain.first_updates[k], plain.first_updates[k + 1]):
            change, response = measured.changes[u], rows[u]
            assert change.any()
            own = response @ covariance @ response.T + np.diag(plain.filter.variances[u])
            gain = np.linalg.solve(own + 0.005**2 * np.outer(change, change), response @ covariance).T
            covariance = covariance - gain @ response @ covariance
        if k < len(noise):
            covariance = steps.transitions[k] @ covariance @ steps.transitions[k].T + noise[k]
    last = jittering.positions(np.array([len(plain.times) - 1]), np.ones(1))
    found = jittering.designed(last).covariances[0][:-1, :-1]
    scale = np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
    assert np.abs((found - covariance) / scale).max() < 1e-9


CASES: Final = {
    "neglected": campaign({"delay": "20 ms", **ON_ARM}, segments=TURNS),
    "considered": campaign(
        {"delay": "20 ms", "jitter": "2 ms", **ON_ARM}, None, ("gnss_lever_arm",), ("gnss_delay",), TURNS
    ),
    "estimated": campaign(
        {"delay": "20 ms", "jitter": "2 ms", **ON_ARM}, None, ("gnss_lever_arm", "gnss_delay"), (), TURNS
    ),
    "with a mean": campaign(
        {"jitter": "5 ms", **ON_ARM}, {"gnss_delay": {"distribution": "fixed", "value": "50 ms"}},
        ("gnss_lever_arm", "gnss_delay"), (), TURNS, {"delay": "60 ms"},
    ),
    "with a mean and a sigma": campaign(
        {"jitter": "5 ms", **ON_ARM}, {"gnss_delay": {"mean": "50 ms", "sigma": "10 ms"}},
        ("gnss_lever_arm", "gnss_delay"), (), TURNS, {"delay": "60 ms"},
    ),
}  # fmt: skip


@pytest.mark.parametrize(("case", "size", "share", "rest"), [
    ("neglected", 1.0, 0.03, 1e-4), ("considered", 0.1, 0.0, 1e-4), ("estimated", 0.1, 0.0, 1e-4),
    ("with a mean", 0.1, 0.0, 1e-4),
])  # fmt: skip
def test_both_engines_measure_what_was_there_before(case: str, size: float, share: float, rest: float) -> None:
    """The same sample in both: they share no equation of the sensors.

    Where the filter has no delay they agree to 3 % of what departs from first order. Where it has one, both respond to
    it as along the indicated trajectory. One leaves out errors of the gyros and turns of local axes, 1e-4 of a sigma at
    most where delays are 3 ms and the noise a tenth.
    """
    late = CASES[case]
    aided, scenario = aided_of(late), late.scenario
    assert isinstance(scenario, Ins)
    assert scenario.filter_schema is not None
    engine = AidedReferenceEngine(aided, scenario.filter_schema)
    sample = 0.1 * late.errors.draw("random", 3, 1, 0, 1)[0]
    sample[[source.name for source in scenario.sources].index("gnss_delay")] = 0.03
    noise, quiet = engine.mechanization.draw(aided.imu, 5, 0), engine.mechanization.quiet()
    smaller = {name: size * errors for name, errors in noise.measurements.items()}
    jitters = {name: size * jitter for name, jitter in noise.jitters.items()}
    drawn = replace(quiet, measurements=smaller, jitters=jitters)
    expected = engine.mechanization.simulate(size * sample, drawn)[0][-1]
    found = simulate_aided(aided.tables(1), size * sample[None], 0, np.zeros(1, int), True, engine.given(drawn))
    sigma = sigmas_at_end(late)[0]
    beyond = np.abs((found.values[0, -1] - found.linear[0]) / sigma).max()
    assert np.abs(found.linear[0] / sigma).max() > 0.03
    assert np.abs((found.values[0, -1] - expected) / sigma).max() <= share * beyond + rest


@pytest.mark.parametrize("case", CASES)
def test_linear_analysis_predicts_the_samples(case: str) -> None:
    """Paired with the linear closed loop of the same draws; 99.99 % of a sigma and of a mean of 256 samples.

    A mean delay of 50 ms that a filter has estimated multiplies the navigator's errors, which linear analysis about no
    delay lacks: 0.1 to 0.4 % of a sigma. Over 12 samples the reference engine has 0.3 % as well.
    """
    late, count = CASES[case], 256
    draws = late.errors.draw("random", 1, count, 0, count)
    sigma, _, mean = sigmas_at_end(late)
    for name in ("shared-gains", "ensemble"):
        result = late.scenario.engine(name, draws[:8]).simulate(Batch(np.arange(count), draws, 1))
        assert not result.failures
        assert result.linear_values is not None
        paired = result.values.std(axis=0) / result.linear_values.std(axis=0)
        np.testing.assert_allclose(paired, 1.0, atol=4e-3 if name == "ensemble" and "mean" in case else 1e-3)
        np.testing.assert_allclose(result.values.std(axis=0) / sigma, 1.0, atol=3.9 / np.sqrt(2.0 * count))
        assert np.all(np.abs(result.values.mean(axis=0) - mean) <= (3.9 / np.sqrt(count) + 0.01) * sigma)


def test_linear_sigmas_hold_to_a_ten_thousandth_where_delays_are_small() -> None:
    """Errors and noise of a hundredth: what samples depart by is quadratic, and 1e-4 of that of the size before."""
    late = CASES["estimated"]
    aided, count = aided_of(late), 64
    draws = 0.01 * late.errors.draw("random", 1, count, 0, count)
    tables = aided.tables(1)
    quiet = GivenNoise(
        np.zeros((count, *tables.ensemble.factors.shape[:2])), np.zeros((count, *tables.white.shape)),
        0.01 * 0.002 * np.random.default_rng(1).standard_normal((count, len(tables.white))),
    )  # fmt: skip
    for own in (True, False):
        result = simulate_aided(tables, draws, 0, np.arange(count), own, quiet)
        np.testing.assert_allclose(result.values[:, -1].std(axis=0), result.linear.std(axis=0), rtol=1e-4)


def test_delay_and_arm_are_one_at_constant_speed_and_that_is_said() -> None:
    """Not with changes of speed, or an arm that is known."""
    straight = campaign({"delay": "20 ms", **ON_ARM}, segments=[{"straight": "60 s"}, {"turn": "90 deg"}])
    (remark,) = remarks_of(straight)
    assert remark == (
        "the measurements of gnss cannot tell its delay from its lever arm. At constant speed the two are one: 20 ms "
        "are 1.6 m"
    )
    exact = {**ON_ARM, "lever_arm_error": "0 m"}
    changing = [{"speed": "160 m/s"}, {"straight": "60 s"}, {"speed": "80 m/s"}]
    assert not remarks_of(campaign({"delay": "20 ms", **exact}, segments=[{"straight": "60 s"}]))
    assert not remarks_of(campaign({"delay": "20 ms", **ON_ARM}, segments=changing))


def test_a_delay_that_is_not_small_is_named() -> None:
    """In a turn of 40 deg of bank at 80 m/s: h'' of the velocity is (9.8 tan 40 deg)^2 / 80 = 0.84 m/s^3."""
    turning = [{"straight": "60 s"}, {"turn": "90 deg", "bank": "40 deg"}, {"straight": "10 s"}]
    assert not remarks_of(campaign({"delay": "1 ms", "velocity": "0.1 m/s"}, segments=turning))
    (remark,) = remarks_of(campaign({"delay": "0.1 s", "velocity": "0.1 m/s"}, segments=turning))
    assert re.fullmatch(
        r"the delay of gnss is not small. 300 ms late, its \w+ \w+ is wrong by [\d.]+ filter sigmas beyond first "
        r"order, at [\d.]+ s. Linear results may be wrong there; samples hold",
        remark,
    )
    known = campaign(None, {"gnss_delay": {"distribution": "fixed", "value": "0.3 s"}}, segments=turning)
    assert any("is not small" in remark for remark in remarks_of(known))


def remarks_of(late: Campaign) -> tuple[str, ...]:
    """Return what a scenario remarks of its delays."""
    return late.scenario.remarks_on(late.errors.mean, late.errors.covariance)


def test_a_sweep_says_from_which_delay_on_first_order_is_not_enough() -> None:
    """Half of the acceleration a times the squares of d, three sigmas of the delay, is a tenth of the filter's sigma.

    On a circle at the equator a is read from differences of latitude and longitude, sin(w/2)^2 / (w/2)^2 = 0.1 % too
    small; the radius is known to 0.3 %, and the value is found within 1 %. Sigmas are read every 2 s, in which the
    course turns by 12 deg: up to 0.6 % are missed.
    """
    content = deepcopy(STRAIGHT)
    content["aiding"][0] |= {"delay": "20 ms"}
    content["scenario"]["trajectory"]["segments"] = [{"turn": "720 deg", "rate": "6 deg/s"}]
    plan = SweepPlan({"aiding.gnss.delay": "0..400 ms"}, points=5, examine=False)
    (remark,) = run_sweep(content, plan).remarks
    least = re.match(r"From aiding.gnss.delay = (.*) ms on, the delay of gnss is not small", remark)
    assert least is not None
    aided = aided_of(parse_campaign(content, "mine.toml", "mine"))
    sigmas = np.sqrt(np.diagonal(aided.linear.own, axis1=1, axis2=2)[1:-1, :2])
    times = np.linspace(0.0, aided.loop.times[-1], len(sigmas) + 2)[1:-1]
    before, at, after = (aided.loop.truth.geodetic(times + step)[:, :2] for step in (-1.0, 0.0, 1.0))
    bend = 6.37e6 * np.abs(after - 2.0 * at + before)
    expected = np.sqrt(0.2 / (bend / sigmas).max()) / 3.0
    assert float(least[1]) == pytest.approx(1e3 * expected, rel=0.02)
    assert not run_sweep(content, replace(plan, varied={"aiding.gnss.delay": "0..20 ms"})).remarks
