"""The aided navigator of the reference engine: identities, steady states, consistency of matched filters.

Filters are compared with the check values on an earth that neither attracts nor turns, where a vehicle at rest has the
constant-velocity model along each axis.
"""

from __future__ import annotations

import pickle
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy import stats

from mcnav.arrays.types import Array
from mcnav.contract.filter_record import FilterSchema
from mcnav.systems.ins.earth import Earth
from mcnav.systems.ins.filter.model import FilterModel
from mcnav.systems.ins.imu.instruments import CONSTANTS, OUTPUTS, Imu, Noise
from mcnav.systems.ins.imu.sample_noise import SampleNoise
from mcnav.systems.ins.reference.aided import AidedMechanization
from mcnav.systems.ins.reference.mechanization import Diverged, Mechanization
from mcnav.systems.ins.sensors.aiding import Sensor, aiding_constants
from mcnav.systems.ins.truth.trajectory import Platform, Truth
from tests.every_sensor import (
    INITIAL,
    MICRO_G,
    SIZES,
    UNIT,
    components,
    drawn,
    every_sensor,
    gnss,
    matched,
)
from tests.flights import flight, rest

PLATFORMS: tuple[Platform, ...] = ("strapdown", "inertial", "level")
INSTRUMENTS = tuple(kind for kind in SIZES if kind.startswith(("gyro", "accelerometer")))
FALSE_ALARM = 1e-4
"""Probability that a correct engine fails one of the bounds of a statistical test."""


def engine(
    truth: Truth,
    model: FilterModel,
    duration: float,
    platform: Platform = "strapdown",
    epochs: int = 4,
    **options: float,
) -> AidedMechanization:
    times = np.linspace(0.0, duration, epochs + 1)
    return AidedMechanization(truth, platform, 0.0, duration, times, model.beliefs.sensors, model, **options)


def schema(model: FilterModel) -> FilterSchema:
    estimated = sum(not state.considered for state in model.states)
    groups = {"all": 9 + estimated, "navigation": 9, "position": 3, "velocity": 3, "attitude": 3}
    groups |= {"sensors": estimated} if estimated else {}
    sizes = {sensor.name: len(sensor.components) for sensor in model.beliefs.sensors}
    names = tuple(state.name for state in model.states)
    return FilterSchema(groups, len(OUTPUTS), names, (("1", "1"),) * len(names), sizes)


def without_errors(model: FilterModel) -> Array:
    return np.zeros(len(CONSTANTS) + len(aiding_constants(model.beliefs.sensors)))


@pytest.mark.parametrize("platform", PLATFORMS)
def test_no_errors_stay_none(platform: Platform) -> None:
    """Ten minutes with all sensors: a correction rounds a position by 1e-9 m, and each innovation takes it back."""
    sensors = every_sensor(600.0)
    model = matched(sensors, ("gyro_bias", "accelerometer_bias", "altimeter_bias"), imu=UNIT)
    errors, records = engine(flight(), model, 600.0, platform).simulate(without_errors(model))
    assert np.max(np.abs(errors[:, :3])) <= 1e-6
    assert np.max(np.abs(errors[:, 3:6])) <= 1e-8
    assert np.max(np.abs(errors[:, 6:])) <= 1e-12
    assert np.max(records[:, schema(model).places["nees"]]) <= 1e-6


def test_without_updates_it_is_the_unaided_navigator() -> None:
    """In an outage as long as navigation; segments between epochs round in another way."""
    sensors = (gnss(np.zeros(0)),)
    model = matched(sensors, ("gyro_bias",), imu=UNIT)
    aided = engine(flight(), model, 300.0)
    errors = drawn(model, np.random.default_rng(4))
    noise = aided.draw(UNIT, 1963, 2)
    plain = Mechanization(flight(), "strapdown", 0.0, 300.0, aided.times, stops=aided.stop_times)
    assert np.array_equal(plain.step_times, aided.step_times)
    expected = plain.simulate(errors[: len(CONSTANTS)], noise.gyro, noise.accelerometer)
    found, records = aided.simulate(errors, noise)
    np.testing.assert_allclose(found[:, :3], expected[:, :3], rtol=0.0, atol=1e-7)
    np.testing.assert_allclose(found[:, 3:], expected[:, 3:], rtol=0.0, atol=1e-10)
    assert np.all(records[:, schema(model).places["sensor:gnss"]] == 0.0)


def test_columns_are_those_of_the_schema() -> None:
    """Everything that a record has, from the filter of one sample."""
    sensors = every_sensor(60.0)
    model = matched(sensors, ("gyro_bias", "gnss_position_bias"), ("star_bias",), UNIT)
    aided = engine(flight(), model, 60.0)
    errors = drawn(model, np.random.default_rng(7))
    found, records = aided.simulate(errors, aided.draw(UNIT, 1963, 0))
    record = schema(model)
    assert records.shape == (5, record.width)
    sigma = np.sqrt(np.diagonal(record.covariance(records), axis1=1, axis2=2))
    np.testing.assert_allclose(sigma[0], INITIAL, rtol=1e-9)  # mapped to psi, dv, dr and back
    for place, factor in (("within_1", 1.0), ("within_3", 3.0)):
        assert np.array_equal(records[:, record.places[place]], np.abs(found) <= factor * sigma)
    started = records[0, record.places["state_variance"]]
    np.testing.assert_allclose(started, [state.sigma**2 for state in model.states], rtol=1e-12)
    names = (*CONSTANTS, *aiding_constants(sensors))
    for number, state in enumerate(model.states):
        error = records[:, record.places["state_error"]][:, number]
        if state.name == "star_bias_x":
            assert np.all(error == errors[names.index(state.name)])  # considered: no estimate
        elif state.name in names and state.walk == 0.0:
            assert error[0] == errors[names.index(state.name)]
    for sensor in sensors:
        nis, accepted, rejected, _, lags = records[:, record.places[f"sensor:{sensor.name}"]].T
        counts = [np.sum((sensor.times > a) & (sensor.times <= b)) for a, b in pairwise(aided.times)]
        assert accepted.tolist() == [0, *counts]
        assert np.sum(lags) == len(sensor.times) - 1
        assert not np.any(rejected)
        assert np.all((nis > 0.0) == (accepted > 0.0))
    nees = records[:, record.places["nees"]]
    assert np.all(nees[:, 2] <= nees[:, 1] * (1.0 + 1e-9))
    assert np.all(nees[:, 1] <= nees[:, 0] * (1.0 + 1e-9))


FREE = Earth(6_378_137.0, 0.0, 0.0, 0.0)
"""An earth that neither attracts nor turns."""

KNOWN = np.repeat([10.0, 1.0, 0.0], 3)
"""Initial sigmas with a known attitude."""

BIAS = 1e3 * MICRO_G


def acceleration(density: float, bias: float = 0.0) -> Imu:
    """Return accelerometers with white noise and a Gauss-Markov bias of an hour."""
    return Imu(accelerometer=Noise(np.full(3, density), np.full(3, bias), np.full(3, 3600.0)))


def fixes(duration: float, velocity: float | None = None) -> Sensor:
    """Return a sensor of positions to 2 m, R = 4, at intervals of 1 s."""
    measured = components("position", 2.0, "fix_position")
    if velocity is not None:
        measured += components("velocity", velocity, "fix_velocity")
    return Sensor("fix", "gnss", np.arange(1.0, duration + 0.5), measured)


def steady(model: FilterModel, duration: float) -> tuple[Array, Array]:
    """Return the filter's sigmas of outputs and of other states at the end."""
    _, records = engine(rest(0.0, duration, earth=FREE), model, duration, epochs=1).simulate(without_errors(model))
    record = schema(model)
    covariance = record.covariance(records)[-1]
    return np.sqrt(np.diag(covariance)), np.sqrt(records[-1, record.places["state_variance"]])


def believing(
    sensor: Sensor, imu: Imu, estimates: tuple[str, ...] = (), considers: tuple[str, ...] = ()
) -> FilterModel:
    """Return a filter without constant errors of its instruments."""
    none = {f"accelerometer_bias_{axis}": 0.0 for axis in "xyz"}
    return matched((sensor,), estimates, considers, imu, KNOWN, none)


DIGITS = 0.51e-6
"""Half a unit of the last printed digit, m or m/s."""


@pytest.mark.parametrize(
    ("density", "duration", "position", "velocity"),
    [(1.0, 60.0, 1.590075, 1.258635), (0.03 / 60.0, 1500.0, 0.297406, 0.004716)],
)
def test_constant_velocity_is_the_riccati_steady_state(
    density: float, duration: float, position: float, velocity: float
) -> None:
    """The filter forgets its start within ten of its time constants, (R / q)^(1/4) = 1.4 s and 63 s."""
    sigma, _ = steady(believing(fixes(duration), acceleration(density)), duration)
    assert sigma[:3] == pytest.approx([position] * 3, abs=DIGITS)
    assert sigma[3:6] == pytest.approx([velocity] * 3, abs=DIGITS)


def test_before_an_update() -> None:
    """Without the last measurement: the printed sigmas before an update."""
    sensor = fixes(60.0)
    sigma, _ = steady(believing(replace(sensor, times=sensor.times[:-1]), acceleration(1.0)), 60.0)
    assert sigma[:6] == pytest.approx([2.621465] * 3 + [1.607533] * 3, abs=DIGITS)


@pytest.mark.parametrize(
    ("measured", "position", "velocity", "bias"),
    [(None, 0.608786, 0.036577, 149.42), (0.1, 0.427875, 0.023352, 123.23)],
)
def test_bias_is_the_riccati_steady_state(
    measured: float | None, position: float, velocity: float, bias: float
) -> None:
    """With a Gauss-Markov bias of 1 mg; the filter's time constant is (R t / 2 bias^2)^(1/6) = 20 s."""
    sensor, imu = fixes(600.0, measured), acceleration(0.03 / 60.0, BIAS)
    sigma, states = steady(believing(sensor, imu, ("accelerometer_bias",)), 600.0)
    assert sigma[:3] == pytest.approx([position] * 3, abs=DIGITS)
    assert sigma[3:6] == pytest.approx([velocity] * 3, abs=DIGITS)
    assert states / MICRO_G == pytest.approx([bias] * 3, abs=0.51e-2)


def test_considered_bias_is_the_schmidt_filter() -> None:
    """The bias left out, with process noise instead of it: a filter of its own; considered: Schmidt's."""
    sigma, _ = steady(believing(fixes(600.0), acceleration(1e-2)), 600.0)
    assert sigma[:3] == pytest.approx([0.616969] * 3, abs=DIGITS)
    imu = acceleration(0.03 / 60.0, BIAS)
    sigma, states = steady(believing(fixes(1500.0), imu, (), ("accelerometer_bias",)), 1500.0)
    assert sigma[:3] == pytest.approx([0.865602] * 3, abs=DIGITS)
    assert states == pytest.approx([BIAS] * 3, rel=1e-9)  # stationary


@pytest.mark.parametrize("correlation_time", [0.01, 0.05, 100.0])
def test_a_correlated_error_of_a_sensor_keeps_its_variance(correlation_time: float) -> None:
    """It is stationary, however short its correlation time is compared with a step."""
    measured = components("position", 3.0, "fix", 2.0, correlation_time)
    model = matched((Sensor("fix", "position-fix", np.array([3.0]), measured),), considers=("fix_bias",))
    _, records = engine(rest(), model, 8.0).simulate(without_errors(model))
    correlated = [state.name.startswith("fix_correlated") for state in model.states]
    assert records[:, schema(model).places["state_variance"]][:, correlated] == pytest.approx(4.0, rel=1e-9)


@pytest.mark.slow
def test_matched_filter_is_consistent() -> None:
    """NEES at the end and NIS of 16 samples within bounds of chi-square; each fails once in 10^4 correct engines.

    Innovations of a matched filter are independent. What errors do beyond first order is of their size in radians,
    1e-4, and far within the bounds of ten per cent.
    """
    sensors = every_sensor(100.0)
    kinds = ("gyro_bias", "accelerometer_bias", "gnss_position_bias", "gnss_lever_arm", "altimeter_bias", "star_bias",
             "odometer_bias", "odometer_scale_factor", "compass_bias")  # fmt: skip
    model = matched(sensors, kinds, imu=UNIT)
    aided, generator = engine(flight(), model, 100.0), np.random.default_rng(11)
    count, record = 16, schema(model)
    records = np.stack([aided.simulate(drawn(model, generator), aided.draw(UNIT, 1963, n))[1] for n in range(count)])
    nees = np.sum(records[:, :, record.places["nees"]], axis=0)
    sizes = np.array(list(record.groups.values()))
    low, high = stats.chi2(count * sizes).ppf([[FALSE_ALARM / 2], [1.0 - FALSE_ALARM / 2]])
    assert np.all((low <= nees) & (nees <= high))
    for sensor in sensors:
        nis, accepted, _, lag, lags = np.sum(records[:, :, record.places[f"sensor:{sensor.name}"]], axis=(0, 1))
        assert accepted == count * len(sensor.times)
        low, high = stats.chi2(accepted * len(sensor.components)).ppf([FALSE_ALARM / 2, 1.0 - FALSE_ALARM / 2])
        assert low <= nis <= high
        # a product of independent unit vectors has the variance 1 / size
        bound = stats.norm.isf(FALSE_ALARM / 2) / np.sqrt(lags * len(sensor.components))
        assert abs(lag / lags) <= bound
    within = np.mean(records[:, :, record.places["within_3"]])
    assert within >= 0.98  # of 720, normal errors leave out 0.27 %


def test_estimates_take_the_errors_away() -> None:
    """Biases of a sigma without any noise: what was estimated is subtracted, and little is left.

    Positions are measured to a millimetre, as the filter knows; without compensation ten seconds make 25 mm.
    """
    sensors = (Sensor("fix", "position-fix", np.arange(1.0, 110.5), components("position", 1e-3, "fix")),)
    model = matched(sensors, ("gyro_bias", "accelerometer_bias"), imu=UNIT)
    aided, errors = engine(flight(), model, 120.0, epochs=12), without_errors(model)
    for name, multiple in (("gyro_bias_y", 1.0), ("accelerometer_bias_x", 1.0), ("accelerometer_bias_z", -1.0)):
        errors[CONSTANTS.index(name)] = multiple * model.beliefs.sigmas[name]
    found, records = aided.simulate(errors)
    sigma = np.sqrt(np.diagonal(schema(model).covariance(records), axis1=1, axis2=2))
    assert np.all(np.abs(found) <= 2.0 * sigma)
    assert 0.5 * model.beliefs.sigmas["accelerometer_bias_x"] * 10.0**2 > 24e-3
    assert np.max(np.abs(found[-1, :3])) <= 5e-3  # ten seconds after the last measurement


def test_gate_rejects_a_blunder() -> None:
    """A measurement that is 100 sigmas off changes nothing, and is counted."""
    sensors = (gnss(np.arange(1.0, 20.5), gate=0.999),)
    model = matched(sensors, ("gyro_bias",), imu=UNIT)
    aided = engine(flight(), model, 20.0, epochs=20)
    blunder = aided.quiet()
    blunder.measurements["gnss"] = np.zeros((20, 6))  # type: ignore[index]
    blunder.measurements["gnss"][9, 0] = 300.0
    errors, records = aided.simulate(without_errors(model), blunder)
    counts = records[:, schema(model).places["sensor:gnss"]]
    assert counts[:, 2].tolist() == [0.0] * 10 + [1.0] + [0.0] * 10
    assert counts[10, 1] == 0.0
    assert counts[10, 0] > 1e3
    assert np.max(np.abs(errors[:, :3])) <= 1e-6
    opened = matched((replace(sensors[0], gate=None),), ("gyro_bias",), imu=UNIT)
    assert abs(engine(flight(), opened, 20.0, epochs=20).simulate(without_errors(opened), blunder)[0][10, 0]) > 1.0


def test_outage_is_no_failure() -> None:
    """Sigmas grow while there are no measurements, and fall with the next."""
    sensors = (gnss(np.array([10.0, 20.0, 90.0])),)
    model = matched(sensors, imu=UNIT)
    aided = AidedMechanization(flight(), "strapdown", 0.0, 100.0, np.array([20.0, 89.0, 90.0, 100.0]), sensors, model)
    _, records = aided.simulate(without_errors(model))
    sigma = np.sqrt(schema(model).covariance(records)[:, 0, 0])
    assert sigma[1] > 1.2 * sigma[0]
    assert sigma[2] < 0.8 * sigma[1]


def test_an_epoch_that_rounds_to_before_an_update_is_after_it() -> None:
    """An epoch and a measurement that differ by rounding are one instant."""
    update = 0.1 * 3.0  # not 0.3
    sensors = (gnss(np.array([update])),)
    model = matched(sensors)
    aided = AidedMechanization(flight(), "strapdown", 0.0, 1.0, np.array([0.3, 1.0]), sensors, model)
    assert update > 0.3
    assert len(aided.stops) == 3
    assert aided.simulate(without_errors(model))[1][0, schema(model).places["sensor:gnss"]][1] == 1.0


def test_draws_depend_on_seed_and_index_alone() -> None:
    sensors = every_sensor(50.0)
    aided = engine(flight(), matched(sensors, ("gyro_bias",), imu=UNIT), 50.0)
    one, two = aided.draw(UNIT, 5, 3), pickle.loads(pickle.dumps(aided)).draw(UNIT, 5, 3)
    other = aided.draw(UNIT, 5, 4)
    for name, values in one.measurements.items():
        assert np.array_equal(values, two.measurements[name])
        assert not np.any(values == other.measurements[name])
    # the first sensors alone have the same noise
    fewer = engine(flight(), matched(sensors[:2], (), imu=UNIT), 50.0).draw(UNIT, 5, 3)
    assert all(np.array_equal(fewer.measurements[sensor.name], one.measurements[sensor.name]) for sensor in sensors[:2])


def test_measurement_noise_has_its_covariance() -> None:
    """Variances, and covariances one interval apart, of 2,000 samples: each fails once in 10^4 correct draws."""
    sensor = Sensor(
        "altimeter", "altimeter", np.array([10.0, 40.0]), components("altitude", 5.0, "altimeter", 3.0, 50.0)
    )
    aided = engine(flight(), matched((sensor,)), 60.0, epochs=3)
    count = 2_000
    noises = [aided.draw(Imu(), 9, index) for index in range(count)]
    errors = np.stack([noise.measurements["altimeter"][:, 0] for noise in noises])
    values = np.stack([noise.processes["altimeter_correlated"] for noise in noises])  # at 0, 20, 40, 60 s
    low, high = stats.chi2(count).ppf([FALSE_ALARM / 2, 1.0 - FALSE_ALARM / 2]) / count
    for found, expected in ((errors, 34.0), (values, 9.0)):
        assert np.all((low <= np.mean(found**2, axis=0) / expected) & (np.mean(found**2, axis=0) / expected <= high))
    pairs = ((errors[:, 0], errors[:, 1], 34.0, 30.0), (values[:, 0], values[:, 3], 9.0, 60.0))
    for first, second, variance, apart in pairs:
        expected = 9.0 * np.exp(-apart / 50.0)
        spread = stats.norm.isf(FALSE_ALARM / 2) * np.sqrt((variance**2 + expected**2) / count)
        assert abs(np.mean(first * second) - expected) <= spread
    # the error at 40 s contains the value there: what is left is the white noise
    assert np.mean((errors[:, 1] - values[:, 2]) ** 2) / 25.0 == pytest.approx(1.0, abs=max(high - 1.0, 1.0 - low))


@pytest.mark.parametrize(
    ("errors", "message"),
    [
        ({"gyro_bias_z": 1e3}, "turned by more than a step can follow at 0.0 s"),
        ({"accelerometer_bias_x": 1e200}, r"ceased to be finite at 0\.\d s"),
        ({"gyro_bias_x": np.nan}, "errors that are not finite"),
        ({"position_north": 6e6}, "beyond a pole at the start"),
    ],
)
def test_sample_that_breaks_down_says_why(errors: dict[str, float], message: str) -> None:
    model = matched((gnss(np.arange(1.0, 10.5)),), ("gyro_bias",), imu=UNIT)
    values = without_errors(model)
    for name, value in errors.items():
        values[CONSTANTS.index(name)] = value
    with pytest.raises(Diverged, match=message):
        engine(rest(), model, 10.0).simulate(values)


def test_filter_without_a_covariance_says_so() -> None:
    """A believed covariance that is none, and measurements that are not finite."""
    model = matched((gnss(np.arange(1.0, 10.5)),))
    covariance = model.beliefs.covariance.copy()
    covariance[0, 1] = covariance[1, 0] = 300.0
    bad = replace(model, beliefs=replace(model.beliefs, covariance=covariance))
    with pytest.raises(Diverged, match=r"covariance lost its definiteness at 0\.0 s"):
        engine(rest(), bad, 10.0).simulate(without_errors(model))
    aided = engine(rest(), model, 10.0)
    noise = SampleNoise(aided.quiet().gyro, aided.quiet().gyro, {"gnss": np.full((10, 6), np.nan)})
    with pytest.raises(Diverged, match=r"innovation of gnss ceased to be finite at 1\.0 s"):
        aided.simulate(without_errors(model), noise)


def test_shapes_are_checked() -> None:
    model = matched((gnss(np.arange(1.0, 10.5)),))
    aided = engine(rest(), model, 10.0)
    with pytest.raises(ValueError, match=r"shape \(46,\), one for each constant; got \(39,\)"):
        aided.simulate(np.zeros(39))
    with pytest.raises(ValueError, match=r"shape \(100, 3\), one row for each step; got \(99, 3\)"):
        aided.simulate(np.zeros(46), SampleNoise(np.zeros((99, 3)), np.zeros((100, 3))))
