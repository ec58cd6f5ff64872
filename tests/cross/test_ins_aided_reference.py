"""The reference engine of aided navigation against the ensemble and the closed-loop linear covariance.

They share the truth, the ellipsoid's geodesy and the definitions of errors and measurements. Mechanization, error
model, responses of innovations and the filter itself are other equations.
"""

from __future__ import annotations

import numpy as np
import pytest

from mcnav.arrays.types import Array
from mcnav.contract.filter_record import FilterSchema
from mcnav.systems.ins.aided import AidedReferenceEngine, filter_schema
from mcnav.systems.ins.ensemble.aided import GivenNoise, simulate_aided
from mcnav.systems.ins.filter.model import FilterModel
from mcnav.systems.ins.imu.instruments import CONSTANTS, Imu, Noise
from mcnav.systems.ins.linear.aided_errors import propagate_closed_loop
from mcnav.systems.ins.linear.closed_loop import close_loop
from mcnav.systems.ins.reference.aided import AidedMechanization
from mcnav.systems.ins.scenario import Ins, Navigation
from mcnav.systems.ins.sensors.aiding import Sensor, aiding_constants
from mcnav.systems.ins.truth.trajectory import Platform
from tests.every_sensor import SIZES, UNIT, components, drawn, every_sensor, matched
from tests.flights import flight

WALK = Imu(Noise(UNIT.gyro.random_walk), Noise(UNIT.accelerometer.random_walk))
INSTRUMENTS = tuple(kind for kind in SIZES if kind.startswith(("gyro", "accelerometer")))


class _Same(dict[str, tuple[str, str]]):
    def __missing__(self, name: str) -> tuple[str, str]:
        return ("1", "1")


def schema(model: FilterModel) -> FilterSchema:
    return filter_schema(model.beliefs.sensors, model, _Same())


@pytest.mark.parametrize("platform", ["strapdown", "inertial", "level"])
def test_covariance_along_the_truth_is_that_of_the_closed_loop(platform: Platform) -> None:
    """Without errors, with all sensors and 70 states, two kinds of them considered.

    The reference's steps of a fifth of a second leave 1e-6 at most, as in
    `test_error_falls_with_the_square_of_the_filters_step`.
    """
    duration = 60.0
    sensors = every_sensor(duration)
    considers = ("altimeter_scale_factor", "star_bias")
    others = [kind for kind in SIZES if kind not in considers]
    model = matched(sensors, others, considers, UNIT)
    times = np.linspace(0.0, duration, 4)
    reference = AidedMechanization(flight(), platform, 0.0, duration, times, sensors, model)
    _, records = reference.simulate(np.zeros(len(CONSTANTS) + len(aiding_constants(sensors))))
    loop = close_loop(flight(), platform, np.concatenate([[0.0], reference.stop_times]), UNIT, sensors, model)
    own = propagate_closed_loop(loop, np.searchsorted(loop.times, times - 1e-9), np.ones(len(times)))
    record = schema(model)
    assert len(record.states) == 70
    sigma, expected = (np.sqrt(np.diagonal(each, axis1=1, axis2=2)) for each in (record.covariance(records), own.own))
    np.testing.assert_allclose(sigma, expected, rtol=1e-6)
    found = np.sqrt(records[:, record.places["state_variance"]])
    np.testing.assert_allclose(found, np.sqrt(own.own_variances), rtol=1e-6)


DELAY = 1e-3
"""Size of the sensors' delays, s."""


@pytest.mark.slow
def test_partial_derivatives_are_those_of_the_closed_loop() -> None:
    """Of the outputs, and of the errors of estimates, with neglected and considered errors: every fifth source.

    Central differences of a tenth of a sigma leave the third order, and the filter's steps 1e-6 of the gains.
    """
    duration = 60.0
    sensors = every_sensor(duration)
    estimates = ("gyro_bias", "accelerometer_bias", "accelerometer_scale_factor", "gyro_misalignment",
                 "gnss_position_bias", "altimeter_bias", "odometer_scale_factor", "gnss_lever_arm")  # fmt: skip
    model = matched(sensors, estimates, ("star_bias",), UNIT)
    times = np.linspace(0.0, duration, 4)
    reference = AidedMechanization(flight(), "strapdown", 0.0, duration, times, sensors, model)
    loop = close_loop(flight(), "strapdown", np.concatenate([[0.0], reference.stop_times]), UNIT, sensors, model)
    linear = propagate_closed_loop(loop, np.searchsorted(loop.times, times - 1e-9), np.ones(len(times)))
    names, record = (*CONSTANTS, *aiding_constants(sensors)), schema(model)
    sizes = np.concatenate([
        np.sqrt(np.diag(model.beliefs.covariance)),
        [next((SIZES[kind] for kind in SIZES if name.startswith(kind)), DELAY) for name in names[9:]],
    ])  # fmt: skip
    outputs, states = linear.partials * sizes, linear.state_partials * sizes
    for source in range(0, len(names), 5):
        found = []
        for sign in (0.1, -0.1):
            errors = np.zeros(len(names))
            errors[source] = sign * sizes[source]
            found.append(reference.simulate(errors))
        difference = (found[0][0] - found[1][0]) / 0.2
        spread = np.linalg.norm(outputs, axis=-1)
        assert np.all(np.abs(difference - outputs[..., source]) <= 3e-6 * spread), names[source]
        place = record.places["state_error"]
        difference = (found[0][1] - found[1][1])[:, place] / 0.2
        spread = np.linalg.norm(states, axis=-1)
        assert np.all(np.abs(difference - states[..., source]) <= 3e-6 * spread), names[source]


START, END, SAMPLES = 540.0, 720.0, 6
"""With a climb, and a turn of 90 degrees from 600 to 660 s."""


def scenario() -> Ins:
    """Fly with a filter that estimates errors of instruments and sensors, considers one, and neglects others."""

    def at(interval: float) -> Array:
        times = np.arange(START + interval, END + 0.5, interval)
        return times[(times < 620.0) | (times >= 650.0)]

    receiver = components("position", 3.0, "gnss_position", 1.0, 60.0) + components("velocity", 0.1, "gnss_velocity")
    sensors = (
        Sensor("gnss", "gnss", at(1.0), receiver, np.array([2.0, 0.5, -1.0]), True, gate=0.9),
        Sensor("altimeter", "altimeter", at(5.0), components("altitude", 5.0, "altimeter")),
        Sensor("star", "star-tracker", at(20.0), components("attitude", 1e-4, "star")),
        Sensor("odometer", "velocity", at(10.0), components("body_velocity", 0.2, "odometer")),
        Sensor("compass", "heading", at(25.0), components("heading", 1e-2, "compass")),
    )
    estimates = ("gyro_bias", "accelerometer_bias", "altimeter_bias", "gnss_lever_arm", "odometer_bias")
    model = matched(sensors, estimates, ("compass_bias",), WALK)
    return Ins(Navigation(flight(1.0), "strapdown", START, END, WALK, sensors, model))


def errors_of(model: FilterModel, generator: np.random.Generator) -> Array:
    """Draw constant errors, also those that the filter neglects."""
    errors = drawn(model, generator)
    names = (*CONSTANTS, *aiding_constants(model.beliefs.sensors))
    for place, name in enumerate(names):
        kind = name.rpartition("_")[0]
        if kind in ("gyro_misalignment", "accelerometer_misalignment", "accelerometer_scale_factor", "star_bias"):
            errors[place] = SIZES[kind] * generator.standard_normal()
    return errors


@pytest.mark.slow
def test_records_are_those_of_the_ensemble_fed_the_same_noise() -> None:
    """Samples with neglected errors, an outage, and a gate that rejects a tenth: errors and all of the record.

    Errors agree to 1e-4 of sigma: the ensemble's steps leave 3e-6 of it, the reference's 1e-6 in the gains, which
    errors of a few sigmas multiply. The rest is of second order in the errors. NEES follows from the errors: a change
    of d in each of n errors in units of sigma changes it by 2 d sqrt(n NEES).
    """
    of = scenario()
    model, generator = of.navigation.filter, np.random.default_rng(1963)
    assert model is not None
    errors = np.stack([errors_of(model, generator) for _ in range(SAMPLES)])
    engine = of.engine("reference", errors)
    assert isinstance(engine, AidedReferenceEngine)
    reference, found, given = engine.mechanization, [], []
    for index in range(SAMPLES):
        noise = reference.draw(WALK, 7, index)
        given.append(engine.given(noise))
        found.append(reference.simulate(errors[index], noise))
    noises = GivenNoise(np.concatenate([one.added for one in given]), np.concatenate([one.measured for one in given]))
    expected = simulate_aided(engine.navigation.tables(1), errors, 0, np.arange(SAMPLES), True, noises)
    values, records = (np.stack(each) for each in zip(*found, strict=True))
    record = engine.filter
    places = record.places
    sigma = np.sqrt(np.diagonal(record.covariance(records), axis1=2, axis2=3))
    assert np.max(np.abs(values - expected.values) / sigma) <= 1e-4
    ensembles = {name: expected.records[..., place] for name, place in places.items()}
    spread = np.sqrt(np.diagonal(record.covariance(expected.records), axis1=2, axis2=3))
    assert np.max(np.abs(spread / sigma - 1.0)) <= 1e-4
    sizes, nees = np.array(list(record.groups.values())), ensembles["nees"]
    allowed = 2e-4 * np.sqrt(sizes * nees) + 1e-4 * nees
    assert np.all(np.abs(records[..., places["nees"]] - nees) <= allowed + 1e-9)
    for factor, name in ((1.0, "within_1"), (3.0, "within_3")):
        near = np.abs(np.abs(values) - factor * sigma) <= 4e-4 * sigma
        assert np.all((records[..., places[name]] == ensembles[name]) | near)
    states = np.sqrt(ensembles["state_variance"])
    assert np.max(np.abs(records[..., places["state_error"]] - ensembles["state_error"]) / states) <= 1e-4
    for sensor in reference.sensors:
        counts, size = ensembles[f"sensor:{sensor.name}"], len(sensor.components)
        assert np.any(counts[..., 2] > 0.0) == (sensor.gate is not None)
        column = records[..., places[f"sensor:{sensor.name}"]]
        assert np.array_equal(column[..., [1, 2, 4]], counts[..., [1, 2, 4]])
        updates = counts[..., 1] + counts[..., 2]
        allowed = 2e-4 * np.sqrt(size * updates * counts[..., 0]) + 1e-9
        assert np.all(np.abs(column[..., 0] - counts[..., 0]) <= allowed)
        # a product u v / n changes by d (|u| + |v|) / sqrt(n), and innovations are below five sigmas
        assert np.all(np.abs(column[..., 3] - counts[..., 3]) <= 1e-3 * updates)
