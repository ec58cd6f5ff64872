"""Error model, measurements and compensation of the reference engine's filter: identities and derivatives."""

from __future__ import annotations

from dataclasses import replace
from math import comb

import numpy as np
import pytest
from filterpy.common import van_loan_discretization
from scipy.spatial.transform import Rotation

from mcnav.arrays.types import Array
from mcnav.systems.ins.earth import WGS84
from mcnav.systems.ins.filter.model import FilterModel
from mcnav.systems.ins.imu.instruments import ACCELEROMETER, CONSTANTS, GYRO
from mcnav.systems.ins.reference.aided import AidedMechanization
from mcnav.systems.ins.reference.compensation import Compensation, measure
from mcnav.systems.ins.reference.earth_fixed_errors import ErrorModel, FilterSteps, gravitation_gradients
from mcnav.systems.ins.reference.earth_fixed_sensors import SensorModel
from mcnav.systems.ins.reference.local_frame import LocalFrame
from mcnav.systems.ins.reference.navigation_errors import EarthFixedStates, navigation_errors
from mcnav.systems.ins.reference.normal_field import field_constants
from mcnav.systems.ins.sensors.aiding import aiding_constants
from mcnav.systems.ins.sensors.comparison import Indicated
from mcnav.systems.ins.truth.trajectory import Platform
from tests.every_sensor import SIZES, UNIT, every_sensor, gnss, matched
from tests.flights import flight

PLATFORMS: tuple[Platform, ...] = ("strapdown", "inertial", "level")
INSTRUMENTS = tuple(kind for kind in SIZES if kind.startswith(("gyro", "accelerometer")))
SENSORS = tuple(kind for kind in SIZES if kind not in INSTRUMENTS)

DEVIATIONS = np.repeat([1e-4, 0.1, 100.0], 3)
"""Sizes of psi, dv, dr for differences: of what they change, the third order is below 1e-8."""


def engine(model: FilterModel, platform: Platform, begin: float = 600.0, duration: float = 20.0) -> AidedMechanization:
    """Return a navigator whose measurements, from the middle of a turn on, are those of all sensors."""
    sensors = tuple(replace(each, times=begin + each.times) for each in model.beliefs.sensors)
    moved = replace(model, beliefs=replace(model.beliefs, sensors=sensors))
    return AidedMechanization(flight(), platform, begin, begin + duration, np.array([begin + duration]), sensors, moved)


def deviated(state: EarthFixedStates, deviation: Array, reading: Array | None = None) -> Indicated:
    """Return an indicated state with psi, dv, dr from a true one, and what its instruments read."""
    position = state.position[0] + deviation[6:9]
    axes = Rotation.from_rotvec(deviation[:3]).as_matrix() @ state.axes[0]
    return Indicated(
        position,
        state.velocity[0] + deviation[3:6],
        axes,
        LocalFrame.at(WGS84, position),
        np.zeros(6) if reading is None else reading,
    )


@pytest.mark.parametrize("platform", PLATFORMS)
@pytest.mark.parametrize("name", [sensor.name for sensor in every_sensor(20.0)])
def test_responses_are_derivatives_of_the_innovation(name: str, platform: Platform) -> None:
    """Of each sensor, to psi, dv, dr and to the errors that the filter estimates.

    Central differences leave the third order of a deviation, which for angles of 1e-4 is 1e-8 of the first, and the
    rounding of positions, 1e-9 m. What a measurement in local axes leaves out is their turn with the indicated
    position, times the innovation. An error acts as the estimate with the other sign.
    """
    model = matched(every_sensor(20.0), SENSORS, imu=UNIT)
    aided = engine(model, platform)
    sensor = next(each for each in aided.sensor_models if each.sensor.name == name)
    row = len(sensor.truth.altitude) - 1
    truth = sensor.truth.states
    true = EarthFixedStates(truth.position[row][None], truth.velocity[row][None], truth.axes[row][None])
    sizes = np.array([size_of(state.name) for state in model.states])
    estimates = np.random.default_rng(2).standard_normal(len(sizes)) * sizes
    none = (np.zeros(sensor.size), np.zeros(sensor.size), np.zeros(3))
    reading = true_reading(aided, sensor, row)
    innovation, response = sensor.innovation(
        sensor.true_at(row), deviated(true, np.zeros(9), reading), estimates, *none
    )
    for column, size in enumerate(np.concatenate([DEVIATIONS, sizes])):
        step = np.zeros(9 + len(sizes))
        step[column] = size
        found = [
            sensor.innovation(
                sensor.true_at(row), deviated(true, sign * step[:9], reading), estimates - sign * step[9:], *none
            )[0]
            for sign in (1.0, -1.0)
        ]
        expected = response @ step
        left_out = np.max(np.abs(innovation)) * np.linalg.norm(step[6:9]) * 1.1 / WGS84.radius
        allowed = 1e-7 * np.max(np.abs(expected)) + left_out + 2e-9
        assert np.all(np.abs((found[0] - found[1]) / 2.0 - expected) <= allowed)


def true_reading(aided: AidedMechanization, sensor: SensorModel, row: int) -> Array:
    """Return what perfect instruments read at a measurement."""
    states = aided.truth.states(sensor.sensor.times[row : row + 1], aided.platform, aided.start)
    return np.concatenate([states.rate[0], states.force[0]])


def size_of(name: str) -> float:
    """Return the size of an error that is a state, m, m/s or rad."""
    return SIZES.get(name.rpartition("_")[0], SIZES.get(name, 1e-3))


@pytest.mark.parametrize("name", [sensor.name for sensor in every_sensor(20.0)])
def test_errors_of_a_measurement_are_those_of_its_states(name: str) -> None:
    """A constant error changes an innovation as its estimate does with the other sign, to first order in both."""
    model = matched(every_sensor(20.0), SENSORS, imu=UNIT)
    aided = engine(model, "strapdown")
    place = next(n for n, each in enumerate(aided.sensor_models) if each.sensor.name == name)
    sensor = aided.sensor_models[place]
    truth = sensor.truth.states
    true = EarthFixedStates(truth.position[:1], truth.velocity[:1], truth.axes[:1])
    zero, noise = np.zeros(len(model.states)), np.zeros((len(sensor.truth.altitude), sensor.size))
    indicated = deviated(true, np.zeros(9), true_reading(aided, sensor, 0))
    names = list(sensor.sensor.constants())
    for number, state in enumerate(model.states):
        if state.name not in names:
            continue
        size = size_of(state.name)
        constants = size * (np.array(names) == state.name)
        offsets, factors, arm = sensor.measurement_errors(constants, noise)
        found, response = sensor.innovation(sensor.true_at(0), indicated, zero, offsets[0], factors, arm)
        assert np.any(found != 0.0)
        np.testing.assert_allclose(found, response[:, 9 + number] * size, rtol=1e-9, atol=1e-12)
        compensated, _ = sensor.innovation(
            sensor.true_at(0), indicated, constants_of(model, state.name, size), offsets[0], factors, arm
        )
        np.testing.assert_allclose(compensated, 0.0, atol=1e-9)


def constants_of(model: FilterModel, name: str, size: float) -> Array:
    return np.array([size * (state.name == name) for state in model.states])


def test_output_map_is_the_derivative_of_the_navigation_errors() -> None:
    """By differences of the exact errors; positions are rounded by 1e-9 m of 10 m."""
    truth = flight()
    position, velocity = truth.earth_fixed(np.array([1500.0]))
    state = EarthFixedStates(position, velocity, truth.attitude([1500.0]).as_matrix())
    found = LocalFrame.at(WGS84, position[0]).to_outputs(velocity[0])
    for column, size in enumerate(np.repeat([1e-5, 0.01, 10.0], 3)):
        outputs = []
        for sign in (1.0, -1.0):
            deviation = np.zeros(9)
            deviation[column] = sign * size
            there = deviated(state, deviation)
            indicated = EarthFixedStates(there.position[None], there.velocity[None], there.axes[None])
            outputs.append(navigation_errors(WGS84, state, indicated)[0])
        difference = (outputs[0] - outputs[1]) / (2.0 * size)
        # a displacement h leaves (h / R)^2; rounding is 1e-9 m, 1e-13 m/s, 1e-16
        rounding = np.repeat([2e-9, 1e-12, 1e-15], 3) / size
        assert np.all(np.abs(difference - found[:, column]) <= 1e-9 * np.abs(found[:, column]) + rounding)


def test_gradient_of_gravitation_is_traceless_and_that_of_the_series() -> None:
    """Laplace's equation; the other series of the field differs by 1.4e-12 m/s^2 over more than a thousand km."""
    position = np.array([[4.0e6, 1.0e6, 4.8e6], [6.4e6, 0.0, 0.1e6]])
    found = gravitation_gradients(field_constants(WGS84), position)
    assert np.max(np.abs(np.trace(found, axis1=1, axis2=2))) <= 1e-9 * np.max(np.abs(found))
    np.testing.assert_allclose(found, WGS84.gravity_gradient(position), rtol=0.0, atol=1e-9 * np.max(np.abs(found)))


def test_transition_and_noise_are_those_of_van_loan() -> None:
    """Over half a second with constant readings, against filterpy's exponential of the whole system.

    The transition leaves out the fourth order; Simpson's rule is exact to the third, and errs by h^5 / 2880 of the
    integrand's fourth derivative.
    """
    model = matched((gnss(np.array([1.0])),), INSTRUMENTS, imu=UNIT)
    errors, step = ErrorModel(model), 0.1
    steps = FilterSteps.group(np.full(5, step), 0.5, errors.decay_rates)
    duration = 0.5
    generator = np.random.default_rng(0)
    axes = np.tile(Rotation.random(rng=generator).as_matrix(), (5, 1, 1))
    rates, forces = np.tile([0.02, -0.05, 0.1], (5, 1)), np.tile([3.0, -2.0, -12.0], (5, 1))
    gradients = gravitation_gradients(field_constants(WGS84), np.array([[4.0e6, 1.0e6, 4.8e6]]))
    transition, noise = errors.transitions(WGS84.rotation_rate, steps, axes, rates, forces, gradients)
    system, coupling = errors._system(WGS84.rotation_rate, steps, axes, rates, forces, gradients)
    whole = np.zeros((errors.size, errors.size))
    whole[:9, :9], whole[:9, 9:] = system[0], coupling[0]
    whole[9:, 9:] = -np.diag(errors.decay_rates)
    factors = np.zeros((errors.size, errors.size))
    factors[:3, :3] = axes[0] * UNIT.gyro.random_walk
    factors[3:6, 3:6] = axes[0] * UNIT.accelerometer.random_walk
    factors[9:, 9:] = np.diag(np.sqrt(errors._driven(errors.decay_rates)))
    # scaled so that no entry of the exponential hides another's digits
    scale = np.concatenate([np.repeat([1e-6, 1e-5, 1e-5], 3), [state.sigma for state in errors.states]])
    whole, factors = whole * scale / scale[:, None], factors / scale[:, None]
    expected, added = van_loan_discretization(whole, factors, duration)
    fourth = np.max(np.abs(np.linalg.matrix_power(whole * duration, 4))) / 24.0
    found = transition[0] * scale / scale[:, None]
    assert np.max(np.abs(found - expected)) <= 1.1 * fourth
    assert fourth <= 1e-7 * np.max(np.abs(expected))
    density = factors @ factors.T
    bound = np.zeros_like(whole)
    for middle in (density, expected @ density @ expected.T):
        powers = [np.linalg.matrix_power(whole, order) for order in range(5)]
        derivative = sum(comb(4, order) * powers[order] @ middle @ powers[4 - order].T for order in range(5))
        bound = np.maximum(bound, np.abs(derivative) * duration**5 / 2880.0)
    sigma = np.sqrt(np.diag(added))
    spread = np.where(np.outer(sigma, sigma) > 0.0, np.outer(sigma, sigma), 1.0)
    assert np.all(np.abs(noise[0] / np.outer(scale, scale) - added) <= 1.1 * bound + 1e-7 * spread)
    assert np.max(bound / spread) <= 1e-4


def test_error_falls_with_the_square_of_the_filters_step() -> None:
    """Through the turn: sigmas of a filter with steps of 1 s, of 0.5 s, and of a tenth."""
    sensors = (gnss(np.arange(601.0, 660.5)),)
    model = matched(sensors, ("gyro_bias", "accelerometer_bias"), imu=UNIT)
    times = np.array([660.0])
    found = []
    for longest in (1.0, 0.5, 0.1):
        aided = AidedMechanization(
            flight(), "strapdown", 600.0, 660.0, times, sensors, model, longest_filter_step=longest
        )
        _, records = aided.simulate(np.zeros(len(CONSTANTS) + len(aiding_constants(aided.sensors))))
        found.append(np.sqrt(records[-1][6 + np.array([0, 2, 5, 9, 14, 20, 27, 35, 44])]))
    coarse, fine = (np.abs(each / found[2] - 1.0) for each in found[:2])
    assert np.max(fine) <= 1e-5
    # less what the finest errs by, a twenty-fifth of the middle one
    worst = np.argmax(coarse)
    assert 3.5 <= coarse[worst] / fine[worst] <= 4.5


def test_steps_of_the_filter_are_whole_steps() -> None:
    """Of the same length as nearly as possible, none left out, and no longer than allowed by more than a step."""
    durations = np.array([0.1, 0.1, 0.1, 0.1, 0.06, 0.1, 0.1, 0.1, 0.1, 0.1])
    steps = FilterSteps.group(durations, 0.5, np.array([0.01]))
    assert steps.begins.tolist() == [0, 5]
    assert steps.middles.tolist() == [2, 7]
    assert np.sum(steps.durations) == pytest.approx(0.96, rel=1e-15)
    assert np.add.reduceat(steps.weights, steps.begins) == pytest.approx([1.0, 1.0], rel=1e-15)
    assert len(FilterSteps.group(durations, 0.01, np.zeros(0)).begins) == len(durations)
    np.testing.assert_allclose(steps.mean(np.ones((10, 3, 3))), 1.0, rtol=1e-15)


@pytest.mark.parametrize("duration", [1e-3, 0.5, 40.0, 4e3])
def test_integrals_of_a_decay(duration: float) -> None:
    """Series and closed forms, by Gauss quadrature of the repeated integral's kernel."""
    rate, nodes = 1e-2, np.polynomial.legendre.leggauss(60)
    _, whole = FilterSteps.group(np.array([duration]), 1e9, np.array([rate])).integrals
    time, weight = 0.5 * duration * (nodes[0] + 1.0), 0.5 * duration * nodes[1]
    for order, factorial in ((1, 1.0), (2, 1.0), (3, 2.0)):
        kernel = (duration - time) ** (order - 1) / factorial
        assert whole[0, order, 0] == pytest.approx(np.sum(weight * kernel * np.exp(-rate * time)), rel=1e-11)
        assert whole[0, order, 1] == pytest.approx(np.sum(weight * kernel), rel=1e-13)


def test_compensation_with_the_true_errors_leaves_none() -> None:
    """Of all instrument errors at once; the law's input is the compensated one, to second order.

    The nonlinearity is 1e-5 of the force, whose square it takes before its own compensation.
    """
    model = matched((gnss(np.array([1.0])),), INSTRUMENTS, imu=UNIT)
    errors = ErrorModel(model)
    generator = np.random.default_rng(1)
    values = np.concatenate(
        [0.1 * generator.standard_normal((4, 3, 3)), 10.0 * generator.standard_normal((4, 3, 3))], axis=-1
    )
    constants = {name: 100.0 * model.beliefs.sigmas[name] * generator.standard_normal() for name in CONSTANTS[9:]}
    gyro, accelerometer = (np.array([constants[name] for name in names]) for names in (GYRO, ACCELEROMETER))
    none = np.zeros((4, 3))
    measured = measure(values, gyro, accelerometer, none, none)
    estimates = np.array([constants.get(state.name, 0.0) for state in errors.states])
    found = Compensation(errors).compensate(measured, estimates, none)
    second = np.max(np.abs(accelerometer[-3:])) * np.max(np.abs(values[..., 3:]))
    left = 2.0 * second**2 * np.max(np.abs(values[..., 3:]))
    np.testing.assert_allclose(found[..., 3:], values[..., 3:], rtol=0.0, atol=left)
    np.testing.assert_allclose(found[..., :3], values[..., :3], rtol=0.0, atol=left * np.max(np.abs(gyro[-3:])) + 1e-15)
    assert np.max(np.abs(measured - values)) > 1e3 * left


def test_estimates_of_a_gauss_markov_bias_decay() -> None:
    """With the believed correlation time."""
    model = matched((gnss(np.array([1.0])),), ("gyro_bias", "accelerometer_bias"), imu=UNIT)
    errors = ErrorModel(model)
    names = [state.name for state in errors.states]
    estimates = np.zeros(len(names))
    estimates[names.index("gyro_bias_instability_y")] = 1e-6
    estimates[names.index("accelerometer_bias_z")] = 1e-3
    elapsed = np.array([[0.0, 300.0, 600.0]])
    found = Compensation(errors).compensate(np.zeros((1, 3, 6)), estimates, elapsed)
    np.testing.assert_allclose(found[0, :, 1], -1e-6 * np.exp(-elapsed[0] / 600.0), rtol=1e-14)
    np.testing.assert_allclose(found[0, :, 5], -1e-3, rtol=1e-14)
    assert not np.any(found[0][:, [0, 2, 3, 4]])
