"""The reference engine of the three-dimensional navigator: its scheme, its errors' definitions, its instruments."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from mcnav.arrays.types import Array
from mcnav.systems.ins.earth import WGS84, Earth
from mcnav.systems.ins.imu.instruments import CONSTANTS, GYRO, OUTPUTS
from mcnav.systems.ins.reference import mechanization
from mcnav.systems.ins.reference.collocation import NODES
from mcnav.systems.ins.reference.mechanization import (
    LARGEST_TURN_ERROR,
    LONGEST_STEP,
    Diverged,
    Mechanization,
    _turn_error,
)
from mcnav.systems.ins.truth.trajectory import Platform, Truth
from tests.flights import flight, rest

PLATFORMS: tuple[Platform, ...] = ("strapdown", "inertial", "level")
ANGLES = (0.7, -0.2, 0.4)
GRAVITY = 9.80619776934378
"""On the ellipsoid at 45 degrees, m/s^2."""

GROWTH = 300.0
"""By which the vertical channel multiplies an error of position in an hour, cosh(1.751532e-3 * 3600), rounded up."""

POSITION_ROUNDING = 1e-8
"""Of a position by way of latitude and longitude, m: some units in the last place, 9e-10 m, of its coordinates."""

NONE = np.zeros(len(CONSTANTS))


def constants(**values: float) -> Array:
    """Return constant errors of which the named ones are not zero."""
    errors = NONE.copy()
    for name, value in values.items():
        errors[CONSTANTS.index(name)] = value
    return errors


def navigator(
    truth: Truth, platform: Platform = "strapdown", duration: float = 600.0, **options: float
) -> Mechanization:
    """Return a navigator with four epochs, two of them within steps."""
    return Mechanization(truth, platform, 0.0, duration, duration * np.array([0.0, 0.33334, 0.777777, 1.0]), **options)


@pytest.mark.parametrize("platform", PLATFORMS)
@pytest.mark.parametrize("interval", [0.1, 1.0])
def test_no_errors_give_none_after_an_hour(platform: Platform, interval: float) -> None:
    """The scheme's error is far below rounding, 1e-9 m in the truth's coordinates, which grows by 300."""
    errors = navigator(flight(interval), platform, 3600.0).simulate(NONE)
    assert np.max(np.abs(errors[:, :3])) <= 1e-6
    assert np.max(np.abs(errors[:, 3:6])) <= 2e-3 * 1e-6  # the vertical channel's rate
    assert np.max(np.abs(errors[:, 6:])) <= 1e-13  # 1e-6 m of 6e6 m


@pytest.mark.parametrize("platform", PLATFORMS)
def test_no_errors_give_none_at_rest(platform: Platform) -> None:
    errors = navigator(rest(angles=ANGLES), platform, 3600.0).simulate(NONE)
    assert np.max(np.abs(errors[:, :3])) <= 1e-6


def test_no_errors_give_none_from_a_later_start() -> None:
    errors = Mechanization(flight(), "inertial", 1490.05, 1700.0, np.array([1490.05, 1600.0, 1700.0])).simulate(NONE)
    assert np.max(np.abs(errors[:, :3])) <= 1e-6


def test_method_is_of_order_six(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without division for turns, the method's only error that shows.

    With two thirds of the step the error is 1.5^6 times smaller, but for a hundredth of rounding in the smaller.
    """
    monkeypatch.setattr(mechanization, "LARGEST_TURN_ERROR", np.inf)
    errors = constants(gyro_bias_x=1e-5, gyro_scale_factor_z=1e-3, accelerometer_bias_y=1e-2, velocity_east=1.0)
    steps = (1.0 / 2.0, 1.0 / 3.0, 1.0 / 10.0)
    found = [navigator(flight(1.0), duration=3600.0, longest_step=step).simulate(errors) for step in steps]
    coarse, fine = (np.abs(each - found[2])[-1, :2] for each in found[:2])
    assert np.all(fine > 30 * POSITION_ROUNDING)
    np.testing.assert_allclose(coarse / fine, 1.5**6, rtol=2.0 / 30.0)


def test_steps_end_at_rows_and_follow_turns() -> None:
    """Steps meet every row of the truth, are no longer than the longest, and no turn within one errs too much."""
    time = np.array([0.0, 0.25, 0.7, 1.0, 2.0, 2.05])
    same = np.ones(len(time))
    heading = np.array([0.0, 0.1, 0.3, 1.0, 3.0, 3.1])
    truth = Truth.through(WGS84, time, 0.5 * same, same, same, np.stack([heading, 0.0 * same, 0.0 * same], axis=-1))
    steps = Mechanization(truth, "strapdown", 0.1, 2.01, np.array([2.01])).step_times
    assert (steps[0], steps[-1]) == (0.1, 2.01)
    assert set(time[(time > 0.1) & (time < 2.01)]) <= set(steps)
    assert np.all(np.diff(steps) > 0.0)
    assert np.max(np.diff(steps)) <= LONGEST_STEP * (1.0 + 1e-9)
    at = steps[:-1, None] + np.diff(steps)[:, None] * NODES
    rates = truth.states(at.ravel(), "strapdown", 0.1).rate.reshape(-1, 3, 3)
    # within an interval that was divided the rate changes, by less than a third of it
    assert np.max(_turn_error(rates, np.diff(steps))) <= 10.0 * LARGEST_TURN_ERROR
    assert len(steps) > 40  # 3 rad


def test_error_of_a_turn_at_a_constant_rate() -> None:
    """The angle that the method turns is 2 arg R(i turn / 2), R the (3, 3) Pade approximant of the exponential."""
    turn = 0.4
    z = 0.5j * turn
    upper = 1.0 + z / 2.0 + z**2 / 10.0 + z**3 / 120.0
    error = abs(2.0 * np.angle(upper / np.conj(upper)) - turn)
    rates = np.tile([0.0, 0.0, 2.0 * turn], (1, 3, 1))
    # twice: an angle is twice that of its quaternion; the next order is (turn / 2)^2 / 28 of it
    assert 2.0 * _turn_error(rates, np.array([0.5]))[0] == pytest.approx(error, rel=0.02)


def test_abrupt_roll_is_followed() -> None:
    """A roll of 2 rad/s that begins within a row of 100 Hz: no more error than rounding in each step."""
    time = np.linspace(0.0, 2.0, 201)
    same = np.ones(len(time))
    roll = np.clip(2.0 * (time - 0.5), 0.0, 1.0)
    truth = Truth.through(WGS84, time, 0.5 * same, same, same, np.stack([same, 0.3 * same, roll], axis=-1))
    engine = Mechanization(truth, "strapdown", 0.0, 2.0, np.array([2.0]))
    assert np.max(np.abs(engine.simulate(NONE)[0, 6:])) <= np.finfo(float).eps * np.sqrt(len(engine.step_times)) * 4.0


def test_epochs_do_not_change_the_steps() -> None:
    """Errors at an epoch are the same to the last bit whatever the other epochs are."""
    errors = constants(gyro_bias_x=1e-6, accelerometer_scale_factor_z=1e-3)
    many = Mechanization(flight(), "strapdown", 0.0, 100.0, np.linspace(0.0, 100.0, 1234)).simulate(errors)
    few = Mechanization(flight(), "strapdown", 0.0, 100.0, np.linspace(0.0, 100.0, 1234)[[5, 600, 1233]])
    assert np.array_equal(few.simulate(errors), many[[5, 600, 1233]])


def test_epoch_within_a_step_is_that_of_shorter_steps() -> None:
    """Both grids have rounding's error, 1e-8 m, and a step and a half of it have the noise of the step."""
    errors = constants(gyro_bias_x=1e-6, accelerometer_scale_factor_z=1e-3)
    times = np.array([0.05, 33.35, 99.95])
    whole = Mechanization(flight(1.0), "strapdown", 0.0, 100.0, times)
    halves = Mechanization(flight(1.0), "strapdown", 0.0, 100.0, times, longest_step=0.05)
    noise = np.random.default_rng(1).standard_normal((2, len(whole.step_times) - 1, 3)) * [[[1e-4]], [[1e-2]]]
    found, expected = whole.simulate(errors, *noise), halves.simulate(errors, *np.repeat(noise, 2, axis=1))
    np.testing.assert_allclose(found[:, :3], expected[:, :3], atol=POSITION_ROUNDING)
    np.testing.assert_allclose(found[:, 3:], expected[:, 3:], atol=1e-12)


@pytest.mark.parametrize("platform", PLATFORMS)
def test_initial_errors_are_inverted_exactly(platform: Platform) -> None:
    """At the start the errors are those given: large ones, in which rounding is below 1e-12."""
    errors = constants(
        position_north=-3e4, position_east=2e4, position_down=1e4, velocity_north=-90.0, velocity_east=70.0,
        velocity_down=50.0, tilt_north=0.3, tilt_east=-0.5, heading=1.5,
    )  # fmt: skip
    found = Mechanization(flight(), platform, 700.0, 700.1, np.array([700.0])).simulate(errors)[0]
    np.testing.assert_allclose(found, errors[: len(OUTPUTS)], rtol=1e-12)


def test_signs_of_initial_errors() -> None:
    """After half a second at rest velocity has moved the position, and tilts have accelerated it by gravity."""
    time = 0.5
    fall = 0.5 * GRAVITY * time**2
    expected = {
        "velocity_north": ("position_north", time),
        "velocity_east": ("position_east", time),
        "velocity_down": ("position_down", time),
        "tilt_north": ("position_east", fall),
        "tilt_east": ("position_north", -fall),
    }
    engine = Mechanization(rest(), "strapdown", 0.0, time, np.array([time]))
    for name, (output, response) in expected.items():
        found = engine.simulate(constants(**{name: 1e-3}))[0, OUTPUTS.index(output)]
        # Coriolis and Schuler terms: the earth turns by 4e-5 rad, and the square of 6e-4 Schuler radians
        assert found == pytest.approx(1e-3 * response, rel=1e-4)


@pytest.mark.parametrize("platform", PLATFORMS)
def test_readings_are_those_of_the_truth(platform: Platform) -> None:
    """Except for the gravitation, whose zonal series leaves out 1.4e-12 m/s^2; the axes are rounded three times."""
    engine = Mechanization(flight(), platform, 0.0, 1600.0, np.array([1570.05, 1600.0]))
    steps = len(engine.step_times) - 1
    at = engine.step_times[:-1] + 0.5 * np.diff(engine.step_times)
    state = flight().states(at, platform, 0.0)
    found = engine.readings.values[:steps, 1]
    np.testing.assert_allclose(found[:, :3], state.rate, rtol=0.0, atol=1e-15)
    np.testing.assert_allclose(found[:, 3:], state.force, rtol=0.0, atol=1.5e-12 + 20 * np.finfo(float).eps * 11.0)


@pytest.mark.parametrize("platform", ["strapdown", "level"])
def test_every_instrument_error_is_a_bias_at_rest(platform: Platform) -> None:
    """At rest the inputs are constant, so that each error acts as the bias that its law makes of them."""
    truth = rest(angles=ANGLES)
    engine = Mechanization(truth, platform, 0.0, 300.0, np.array([300.0]))
    rate, force = np.split(engine.readings.values[0, 0], 2)
    inputs = {"gyro": rate, "accelerometer": force}
    laws = {"gyro_g_sensitivity": force, "accelerometer_nonlinearity": force**2}
    for name in CONSTANTS[len(OUTPUTS) :]:
        kind, axes = name.rsplit("_", 1)
        instrument = name.split("_", 1)[0]
        read, along = "xyz".index(axes[0]), "xyz".index(axes[-1])
        factor = 1.0 if kind.endswith("bias") else laws.get(kind, inputs[instrument])[along]
        size = 1e-4 if name in GYRO else 1e-3
        found = engine.simulate(constants(**{name: size}))
        expected = engine.simulate(constants(**{f"{instrument}_bias_{'xyz'[read]}": size * factor}))
        np.testing.assert_allclose(found[:, :3], expected[:, :3], atol=POSITION_ROUNDING)
        np.testing.assert_allclose(found[:, 3:], expected[:, 3:], atol=1e-11)


def test_constant_noise_is_a_bias() -> None:
    engine = navigator(flight(), duration=200.0)
    steps = len(engine.step_times) - 1
    gyro, accelerometer = np.tile([1e-6, 2e-6, -3e-6], (steps, 1)), np.tile([1e-3, -2e-3, 3e-3], (steps, 1))
    biases = {f"gyro_bias_{axis}": gyro[0, i] for i, axis in enumerate("xyz")}
    biases |= {f"accelerometer_bias_{axis}": accelerometer[0, i] for i, axis in enumerate("xyz")}
    found, expected = engine.simulate(NONE, gyro, accelerometer), engine.simulate(constants(**biases))
    np.testing.assert_allclose(found[:, :3], expected[:, :3], atol=POSITION_ROUNDING)
    np.testing.assert_allclose(found[:, 3:], expected[:, 3:], atol=1e-12)


def test_platforms_are_the_same_on_a_sphere_at_rest() -> None:
    """Where nothing turns, a body that is level and heads north carries all platforms alike."""
    earth = Earth(6_378_137.0, 0.0, 9.80665 * 6_378_137.0**2, 0.0)
    errors = np.random.default_rng(3).standard_normal(len(CONSTANTS)) * 1e-4
    errors[CONSTANTS.index("gyro_bias_x") : CONSTANTS.index("accelerometer_bias_x")] *= 1e-2
    found = [navigator(rest(earth=earth), platform).simulate(errors) for platform in PLATFORMS]
    for other in found[1:]:
        np.testing.assert_allclose(other, found[0], rtol=1e-11, atol=POSITION_ROUNDING)


def test_schuler_oscillation_on_a_sphere() -> None:
    """A bias b makes b (1 - cos w t) / w^2, w^2 = g / R; the vertical and the square of b / g change 1e-7 of it."""
    radius, gravity = 6_378_137.0, 9.80665
    earth = Earth(radius, 0.0, gravity * radius**2, 0.0)
    rate = np.sqrt(gravity / radius)
    assert 2.0 * np.pi / rate / 60.0 == pytest.approx(84.4530, abs=5e-5)
    times = np.array([600.0, 2533.6, 3600.0])
    engine = Mechanization(rest(earth=earth), "strapdown", 0.0, 3600.0, times)
    found = [engine.simulate(constants(accelerometer_bias_x=bias))[:, 0] for bias in (1e-5, -1e-5)]
    expected = 1e-5 / rate**2 * (1.0 - np.cos(rate * times))
    np.testing.assert_allclose((found[0] - found[1]) / 2.0, expected, rtol=1e-7, atol=POSITION_ROUNDING)


def test_longitude_error_takes_the_short_way() -> None:
    """Across the antimeridian an error of 200 m remains 200 m."""
    time = np.linspace(0.0, 10.0, 5)
    same = np.ones(5)
    truth = Truth.through(WGS84, time, 0.3 * same, (np.pi - 1e-5) * same, 0.0 * same, np.zeros((5, 3)))
    found = Mechanization(truth, "strapdown", 0.0, 10.0, np.array([0.0])).simulate(constants(position_east=200.0))
    assert found[0, 1] == pytest.approx(200.0, rel=1e-10)


def test_pickled_navigator_gives_the_same_bits() -> None:
    engine = navigator(flight(), duration=50.0)
    errors = constants(heading=1e-3)
    before = engine.simulate(errors)
    assert np.array_equal(pickle.loads(pickle.dumps(engine)).simulate(errors), before)
    assert np.array_equal(pickle.loads(pickle.dumps(navigator(flight(), duration=50.0))).simulate(errors), before)


@pytest.mark.parametrize(
    ("errors", "message"),
    [
        ({"accelerometer_bias_z": 100.0}, "near the earth's centre at"),
        ({"gyro_bias_z": 1e3}, "turned by more than a step can follow at 0.0 s"),
        ({"accelerometer_bias_x": 1e200}, "ceased to be finite at"),
        ({"gyro_bias_x": np.nan}, "errors that are not finite"),
        ({"position_down": np.inf}, "errors that are not finite"),
        ({"position_north": 6e6}, "beyond a pole at the start"),
        ({"position_north": 5e6}, "near a pole at 0.0 s"),
    ],
)
def test_sample_that_breaks_down_says_why(errors: dict[str, float], message: str) -> None:
    engine = navigator(rest(), duration=400.0)
    if message.startswith("near a pole"):
        errors = {"position_north": np.radians(45.0) * 6_367_381.8 - 1e3}  # the meridian's radius of curvature
    with pytest.raises(Diverged, match=message):
        engine.simulate(constants(**errors))


def test_one_epoch_near_a_pole_is_enough() -> None:
    """Ten kilometres from the pole at the start, close to it after 20 s, and as far beyond it later."""
    engine = navigator(rest(), duration=60.0)
    start = np.radians(45.0) * 6_367_381.8 - 1e4  # the meridian's radius of curvature
    with pytest.raises(Diverged, match=r"near a pole at 20\.0 s"):
        engine.simulate(constants(position_north=start, velocity_north=800.0))


def test_noise_that_is_not_finite_breaks_down() -> None:
    engine = navigator(rest(), duration=10.0)
    noise = np.zeros((100, 3))
    noise[40, 1] = np.nan
    for noises in ((noise, None), (None, noise)):
        with pytest.raises(Diverged, match=r"ceased to be finite at 4\.0 s"):
            engine.simulate(NONE, *noises)


def test_shapes_and_epochs_are_checked() -> None:
    engine = navigator(rest(), duration=10.0)
    with pytest.raises(ValueError, match=r"shape \(39,\), one for each constant; got \(9,\)"):
        engine.simulate(np.zeros(9))
    with pytest.raises(ValueError, match=r"shape \(100, 3\), one row for each step; got \(99, 3\)"):
        engine.simulate(NONE, np.zeros((99, 3)))
    for times in ([5.0, 4.0], [-1.0, 4.0], [4.0, 11.0], []):
        with pytest.raises(ValueError, match="epochs must be in order"):
            Mechanization(rest(), "strapdown", 0.0, 10.0, np.array(times)).simulate(NONE)
