"""Every quantity and every type of sensor of the registry, by linear analysis, by both engines, and in every list.

What a new file of sensors/ defines is tested here without a change.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from jsonschema import Draft7Validator
from scipy.spatial.transform import Rotation

from mcnav.arrays.types import Array
from mcnav.cli import shell_completion
from mcnav.config.json_schema.campaign import campaign_schema
from mcnav.config.read import parse_campaign
from mcnav.config.templates.ins import NewIns, new_ins
from mcnav.systems.ins.aided import AidedNavigation
from mcnav.systems.ins.earth import WGS84, local_axes
from mcnav.systems.ins.ensemble.filters import covariances_of
from mcnav.systems.ins.ensemble.steps import deviations_of
from mcnav.systems.ins.ensemble.updates import add_constant_errors, estimates_of, innovate
from mcnav.systems.ins.filter.model import estimated_kinds
from mcnav.systems.ins.imu.instruments import CONSTANTS, Imu, Noise
from mcnav.systems.ins.reference.aided import AidedMechanization
from mcnav.systems.ins.reference.local_frame import LocalFrame
from mcnav.systems.ins.scenario import Ins, Navigation
from mcnav.systems.ins.sensors.aiding import Component, Sensor, aiding_constants
from mcnav.systems.ins.sensors.comparison import Indicated
from mcnav.systems.ins.sensors.quantity import Geometry, QuantityDefinition, SensorType
from mcnav.systems.ins.sensors.registry import (
    FILES,
    QUANTITIES,
    SENSOR_TYPES,
    check_names,
    check_sensor_types,
    read_definitions,
)
from mcnav.systems.ins.sensors.surroundings import Surroundings
from mcnav.systems.ins.tables.sensors import keys_of_errors
from mcnav.systems.ins.truth.trajectory import Platform
from tests.aided import make_filter, make_sensor, sized
from tests.conftest import ROOT
from tests.flights import flight
from tests.unit.systems.test_ins_measurements import innovations_and_rows, tabulated

BEGIN, END = 600.0, 620.0
"""From the beginning of a turn of 90 degrees on, in a climb."""

UNIT = Imu(Noise(np.full(3, 1e-6)), Noise(np.full(3, 1e-4)))
SIGMAS = {
    "position": 2.0, "velocity": 0.1, "tilt": 1e-4, "heading": 3e-4, "gyro_bias": 1e-6, "accelerometer_bias": 1e-3,
}  # fmt: skip
LANDMARK = np.radians([45.7, 10.6])
ARRANGEMENTS = {
    "beam": np.array([[0.383, 0.0, 0.924, 300.0], [-0.191, 0.331, 0.924, 300.0], [0.0, 0.0, 1.0, 300.0]]),
    "landmark": np.concatenate([WGS84.from_geodetic(*LANDMARK, np.array(400.0))[None], local_axes(*LANDMARK)]),
}
"""Beams to the ground at 300 m, and a landmark, of the quantities that begin so."""

STEPS = np.repeat([1e-4, 0.1, 100.0], 3)
"""Steps of differences: rad, m/s, m."""


def differences(function: Callable[[Array], Array], step: Array) -> Array:
    """Return the change of a function along a step, to first order: central differences, extrapolated by Richardson.

    With D(h) of a step of share h, ``(4 D(1/2) - D(1)) / 3``: the fifth order of the function is left, a thirtieth of
    the step's fourth power where a quantity has the size one, such as (0.1 m/s / 80 m/s)^4 of a speed.
    """
    whole, half = (0.5 * (function(h * step) - function(-h * step)) / h for h in (1.0, 0.5))
    return (4.0 * half - whole) / 3.0


def sensor_of(quantity: str, times: Array) -> Sensor:
    """Measure all axes of a quantity, on a lever arm, with noise of the usual size of its errors."""
    sensor = make_sensor("sensor", times, {quantity: QUANTITIES[quantity].usual}, lever_arm=(2.0, 0.3, -1.0))
    offsets = next((kind.offsets for kind in SENSOR_TYPES.values() if quantity in kind.quantities.values()), ())
    return replace(sensor, offsets=offsets, arrangement=ARRANGEMENTS.get(quantity.partition("_")[0], np.zeros((0, 3))))


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_the_ensemble_has_the_responses_of_linear_analysis_which_are_derivatives(quantity: str) -> None:
    """Without a turn, to rounding; and differences of innovations leave their fifth order, and rounding."""
    measured = tabulated((sensor_of(quantity, np.array([700.0])),))
    none = np.zeros(3)
    values, rows = innovations_and_rows(measured, none, none, none)
    assert not values.any()
    assert rows.any(axis=1).all()
    np.testing.assert_allclose(rows, measured.rows[0], rtol=1e-13, atol=1e-13 * np.abs(rows).max())
    numerical = np.empty_like(rows)
    for j, step in enumerate(np.diag(STEPS)):
        change = differences(lambda errors: innovations_and_rows(measured, *np.split(errors, 3))[0], step)
        numerical[:, j] = change / STEPS[j]
    for part in (slice(0, 3), slice(3, 6), slice(6, 9)):
        scale = np.abs(rows[:, part]).max(axis=1)
        assert np.all(np.abs(numerical[:, part] - rows[:, part]).max(axis=1) <= 5e-9 * scale + 1e-15 * rows.max())


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_the_responses_of_a_turned_sample_are_derivatives_to_first_order(quantity: str) -> None:
    """About a navigator that is turned by 0.027 rad: a response may neglect as much of itself."""
    measured = tabulated((sensor_of(quantity, np.array([700.0])),))
    turn, none = np.array([0.01, -0.02, 0.015]), np.zeros(3)
    base = Rotation.from_rotvec(turn)
    rows = innovations_and_rows(measured, turn, none, none)[1]
    for j, step in enumerate(np.diag(STEPS)):
        sides = [
            innovations_and_rows(measured, (Rotation.from_rotvec(each[:3]) * base).as_rotvec(), each[3:6], each[6:])[0]
            for each in (step, -step)
        ]
        part = slice(3 * (j // 3), 3 * (j // 3) + 3)
        allowed = (np.linalg.norm(turn) + 5e-9) * np.abs(rows[:, part]).max(axis=1) + 1e-15 * np.abs(rows).max()
        assert np.all(np.abs((sides[0] - sides[1]) / (2.0 * STEPS[j]) - rows[:, j]) <= allowed)


@lru_cache
def mechanization(quantity: str, platform: Platform) -> AidedMechanization:
    """Navigate with a filter that estimates all constant errors of the sensor."""
    sensor = sensor_of(quantity, np.array([BEGIN + 10.0, END]))
    kinds = estimated_kinds(tuple(sensor.constants()))
    model = make_filter((sensor,), UNIT, SIGMAS | dict.fromkeys(kinds, 1e-3), kinds)
    return AidedMechanization(flight(), platform, BEGIN, END, np.array([END]), (sensor,), model)


@pytest.mark.parametrize("platform", ["strapdown", "level"])
@pytest.mark.parametrize("quantity", QUANTITIES)
def test_the_responses_of_the_reference_engine_are_derivatives(quantity: str, platform: Platform) -> None:
    """Differences leave 1e-7 of a response, and 4e-9 m of the rounding of positions of 6.4e6 m.

    A measurement in local axes leaves out their turn with the position, times the innovation, which is small here.
    """
    (model,) = mechanization(quantity, platform).sensor_models
    truth, row = model.truth, 1
    states = mechanization(quantity, platform).truth.states(model.sensor.times[row:], platform, BEGIN)
    reading = np.concatenate([states.rate[0], states.force[0]])
    exact = (np.zeros(model.size), np.zeros(model.size), np.zeros(3))

    def innovation(step: Array) -> tuple[Array, Array]:
        position = truth.states.position[row] + step[6:9]
        axes = Rotation.from_rotvec(step[:3]).as_matrix() @ truth.states.axes[row]
        frame = LocalFrame.at(WGS84, position)
        indicated = Indicated(position, truth.states.velocity[row] + step[3:6], axes, frame, reading)
        return model.innovation(model.true_at(row), indicated, -step[9:], *exact)

    value, response = innovation(np.zeros(9 + len(model.states)))
    rounding = 4e-9 * np.abs(response[:, 6:9]).max() + 1e-12 * np.abs(response[:, :6]).max()
    np.testing.assert_allclose(value, 0.0, atol=rounding)
    for step in np.diag(np.concatenate([np.repeat([1e-4, 0.1, 100.0], 3), np.full(len(model.states), 1e-3)])):
        numerical, expected = differences(lambda errors: innovation(errors)[0], step), response @ step
        assert np.all(np.abs(numerical - expected) <= 1e-7 * np.abs(expected).max() + rounding)


@lru_cache
def navigation(quantity: str) -> AidedNavigation:
    sensor = sensor_of(quantity, np.arange(BEGIN + 2.0, END + 1.0, 2.0))
    model = make_filter((sensor,), UNIT, SIGMAS, ("gyro_bias", "accelerometer_bias"))
    aided = Navigation(flight(), "strapdown", BEGIN, END, UNIT, (sensor,), model).aided
    assert aided is not None
    return aided


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_engines_and_linear_analysis_agree_on_every_sample(quantity: str) -> None:
    """A sample without noise for each kind of error: the initial ones, and each constant one of the sensor.

    Errors of a hundredth of a sigma change each other by products of them, less than 1e-6 of a sigma of attitude;
    earth-fixed positions have units of 1e-9 m, and the reference's filter steps leave 1e-6 of the gains.

    A last sample is 20 ms late, which is not small. Both engines with gains of their own measure it at the time before:
    they agree to 1e-4 of what it does, as the products of two attitudes of 0.8 mrad that one of them neglects.
    """
    of = navigation(quantity)
    (sensor,) = of.sensors
    names = (*CONSTANTS, *aiding_constants(of.sensors))
    sizes = sized(of.sensors, SIGMAS)
    usual = QUANTITIES[quantity].usual
    others = {"scale_factor": 1e-3, "boresight": 1e-4, "map": 1.0, "delay": 1e-3}
    own = {
        name: next((size for kind, size in others.items() if kind in name), usual)
        for name in sensor.constants()
        if "lever_arm" not in name
    }
    errors = np.zeros((3 + len(own), len(names)))
    errors[0, :9] = 0.01 * sizes[:9]
    errors[1, names.index("gyro_bias_y")] = 0.01 * sizes[names.index("gyro_bias_y")]
    for number, (name, size) in enumerate(own.items(), 2):
        errors[number, names.index(name)] = 0.01 * size
    errors[-1, names.index("sensor_delay")] = 0.02
    tables = of.tables(1)
    reference = AidedMechanization(of.truth, "strapdown", BEGIN, END, of.times, of.sensors, of.filter)
    results = [
        np.einsum("eis,ns->nei", of.linear.partials, errors),
        *(of.propagate(tables, errors, by_own)[0] for by_own in (True, False)),
        np.stack([reference.simulate(each)[0] for each in errors]),
    ]
    linear = results[0][:, 1:]
    sigma = np.sqrt(np.diagonal(of.linear.own, axis1=1, axis2=2))[1:]
    assert np.all(np.abs(linear / sigma).max(axis=(1, 2)) > 1e-6), "an error changes nothing"
    rounding = 2e-6 + 8e-9 / sigma[:, :3].min()
    for result in results[1:]:
        assert np.abs((result[:-1, 1:] - linear[:-1]) / sigma).max() <= rounding
    late, other = (result[-1, 1:] / sigma for result in (results[1], results[3]))
    assert np.abs(late - other).max() <= 1e-4 * np.abs(late).max() + rounding


@dataclass(frozen=True)
class Measured:
    """One measurement by a navigator that errs, as both engines have it.

    Attributes
    ----------
    fast, reference : ndarray, shape (c,)
        Innovations.
    along_truth : ndarray, shape (c,)
        What errors of the sensor and estimates of them contribute to first order.
    rows, responses : ndarray, shape (c, 9 + q)
        Responses to the filter's states in earth-fixed axes, of both engines.
    table : ndarray, shape (c, q)
        Responses to the other states along the truth.
    """

    fast: Array
    reference: Array
    along_truth: Array
    rows: Array
    responses: Array
    table: Array


def measured_by_both(quantity: str, endings: tuple[str, ...], errors: dict[str, list[float]], share: float) -> Measured:
    """Measure a quantity with errors of a sensor by kind, of which a filter estimates a share; none is late."""
    sensor = sensor_of(quantity, np.arange(BEGIN + 2.0, END + 1.0, 2.0))
    kinds = tuple(kind for kind in estimated_kinds(tuple(sensor.constants())) if kind.endswith(endings))
    model = make_filter((sensor,), UNIT, SIGMAS | dict.fromkeys(kinds, 1e-3), kinds)
    of = Navigation(flight(), "strapdown", BEGIN, END, UNIT, (sensor,), model).aided
    assert of is not None
    names, states = aiding_constants(of.sensors), [state.name for state in of.filter.states]
    error = np.zeros(len(names))
    for kind, values in errors.items():
        places = [place for place, name in enumerate(names) if f"_{kind}" in name]
        error[places] = values[: len(places)]
    estimates = share * np.array([error[names.index(name)] for name in states])
    error[[place for place, name in enumerate(names) if name.endswith("_delay")]] = 0.0
    turn, velocity, away = np.array([0.02, -0.01, 0.015]), np.array([1.0, -2.0, 0.5]), np.array([150.0, -200.0, 80.0])

    active = np.flatnonzero(error)
    updates = of.tables(1).updates(active, np.zeros(0, dtype=np.int64))
    row = len(updates.sizes) - 1
    around = Surroundings.at(of.truth, "strapdown", BEGIN, sensor.times[row:], sensor.lever_arm, sensor.arrangement)
    inertial, spin = around.earth[0], np.array([0.0, 0.0, of.truth.earth.rotation_rate])
    samples, own = deviations_of(0, 0), estimates_of(len(states), len(active), 0, 1)
    samples.turn[:] = np.roll(Rotation.from_rotvec(inertial @ turn).as_quat(), 1)[:, None]
    samples.moved[:3] = (inertial @ velocity + np.cross(spin, inertial @ away))[:, None]
    samples.moved[3:], own.aiding[:] = (inertial @ away)[:, None], error[active][:, None]
    own.estimate[:] = estimates[:, None]
    size, rows = int(updates.sizes[row]), covariances_of(len(states)).rows
    add_constant_errors(row, size, updates, own)
    innovate(row, size, of.truth.earth.constants, updates, samples, rows, own)
    to_inertial = np.eye(9 + len(states))
    to_inertial[:9, :9] = np.kron(np.eye(3), inertial)
    to_inertial[3:6, 6:9] = np.cross(spin, inertial.T).T

    reference = AidedMechanization(of.truth, "strapdown", BEGIN, END, of.times, of.sensors, of.filter)
    (by_reference,) = reference.sensor_models
    assert by_reference.truth is not None
    true, here = by_reference.truth.states, of.truth.states(sensor.times[row:], "strapdown", BEGIN)
    position, axes = true.position[row] + away, Rotation.from_rotvec(turn).as_matrix() @ true.axes[row]
    reading = np.concatenate([here.rate[0], here.force[0]])
    indicated = Indicated(position, true.velocity[row] + velocity, axes, LocalFrame.at(WGS84, position), reading)

    def measure(constants: Array, estimates: Array) -> tuple[Array, Array]:
        own = np.array([constants[names.index(name)] for name in sensor.constants()])
        offset, *others = by_reference.measurement_errors(own, np.zeros((len(sensor.times), size)))
        known = by_reference.offsets_of(own)
        return by_reference.innovation(
            by_reference.true_at(row), indicated, estimates, offset[row], *others, offsets=known
        )

    value, responses = measure(error, estimates)
    alone, _ = measure(0.0 * error, 0.0 * estimates)
    table = updates.of_filter.state_rows[row]
    table = table.reshape(*table.shape[:2], 3, 3).swapaxes(1, 2).reshape(3 * len(table), -1)[:size, : len(states)]
    first_order = updates.constant_rows[row, :size] @ error[active] - table @ estimates
    found = rows[:size, : 9 + len(states), 0] @ to_inertial
    return Measured(own.innovation[:size, 0], value, alone + first_order, found, responses, table)


@pytest.mark.parametrize(
    "quantity",
    [name for name in QUANTITIES if QUANTITIES[name].scaled or sensor_of(name, np.array([END])).offsets],
)
def test_both_engines_measure_and_respond_at_the_estimate_of_a_sample(quantity: str) -> None:
    """Errors of boresight, map and scale, and estimates of them, beside errors of the navigator.

    Their products are far above what is allowed: rounding of innovations, 4e-9 m of positions of 6.4e6 m, and of
    responses, 1e-9 of the largest of a kind. An altimeter's filter has up at the true place, 200 m away from the
    navigator's: 4e-5 of a response of size one. The landmark is 15 km away.
    """
    errors = {"boresight": [0.02, -0.01, 0.015], "map": [-120.0, 90.0, 150.0], "scale_factor": [0.03, -0.02, 0.01]}
    found = measured_by_both(quantity, ("scale_factor", "boresight", "map"), errors, 0.6)
    allowed = 1e-10 if quantity == "landmark_direction" else 1e-7
    assert np.abs(found.reference - found.along_truth).max() > 1e4 * allowed
    np.testing.assert_allclose(found.fast, found.reference, atol=allowed)
    for kind in (slice(0, 3), slice(3, 6), slice(6, 9), slice(9, None)):
        share = 6e-5 if quantity == "altitude" else 1e-9
        largest = np.abs(found.responses[:, kind]).max()
        np.testing.assert_allclose(found.rows[:, kind], found.responses[:, kind], atol=share * largest + 1e-15)
    assert np.abs(found.rows[:, 9:] - found.table).max() > 1e-3 * np.abs(found.table).max()


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_both_engines_have_the_change_of_what_a_navigator_measures(quantity: str) -> None:
    """A filter has estimated a delay of 20 ms: the engines differ by a fiftieth of what a navigator's errors change.

    The fast one leaves out the turns of the earth and of local axes, 1e-4 rad/s, beside the vehicle's of 0.1 rad/s, and
    has local axes at the true place: 4e-5 of an innovation and of a response to the navigator's errors. That of a
    heading to the place, 1e-7 rad/m, is along the truth. An attitude's change does not depend on the navigator.
    """
    found = measured_by_both(quantity, ("sensor_delay",), {"delay": [0.02]}, 1.0)
    for kind in (slice(0, 3), slice(3, 6), slice(6, 9))[: 2 if quantity == "heading" else 3]:
        allowed = 1e-4 * np.abs(found.responses[:, kind]).max() + 1e-15
        assert np.abs(found.rows[:, kind] - found.responses[:, kind]).max() <= allowed
    changed = np.abs(found.responses[:, 9:] - found.table).max()
    assert quantity == "attitude" or changed > 1e-6 * np.abs(found.table).max()
    assert np.abs(found.rows[:, 9:] - found.responses[:, 9:]).max() <= 0.02 * changed + 1e-12
    innovations = 0.02 * 0.02 * changed + 4e-5 * np.abs(found.reference).max()
    assert np.abs(found.fast - found.reference).max() <= innovations


@lru_cache
def shared_schema() -> dict[str, Any]:
    return campaign_schema()


@pytest.mark.parametrize("kind", SENSOR_TYPES.values(), ids=lambda kind: kind.name)
def test_a_type_of_sensor_is_in_every_list(kind: SensorType, tmp_path: Path) -> None:
    """Schema, completion, `mcnav new ins` and the page of campaigns have it; what is new is valid and read."""
    assert kind.name in shell_completion.aids("")
    (path,) = new_ins("mine", tmp_path, NewIns("STIM300", (kind.name,)))
    content = tomllib.loads(path.read_text(encoding="utf-8"))
    schema = shared_schema()
    assert not list(Draft7Validator(schema).iter_errors(content))
    assert {*keys_of_errors(kind), *kind.further} <= schema["properties"]["aiding"]["items"]["properties"].keys()
    scenario = parse_campaign(content, "mine.toml", "mine").scenario
    assert isinstance(scenario, Ins)
    (sensor,) = scenario.navigation.sensors
    assert {component.quantity for component in sensor.components} == set(kind.quantities.values())
    assert f"| `{kind.name}` | `{next(iter(kind.quantities))}`" in (ROOT / "mcnav" / "docs" / "CAMPAIGNS.md").read_text(
        "utf-8"
    )


def test_every_file_with_a_definition_is_listed() -> None:
    files = (ROOT / "mcnav" / "systems" / "ins" / "sensors").glob("*.py")
    defining = {file.stem for file in files if "\nQUANTITY: " in (text := file.read_text()) or "\nSENSOR: " in text}
    assert defining == set(FILES)


def test_a_quantity_that_no_file_defines_is_refused() -> None:
    with pytest.raises(ValueError, match="sonar measures depth, which no file of sensors/ defines; of posi"):
        Component("depth", 0, 1.0, 0.0, 100.0, "sonar")
    with pytest.raises(ValueError, match="altimeter: altitude has no axis number 1"):
        Component("altitude", 1, 1.0, 0.0, 100.0, "altimeter")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"axes": ()}, "quantity 'altitude': axes must be one to 3 different names"),
        ({"axes": ("a", "b", "c", "d")}, "quantity 'altitude': axes must be one to 3 different names"),
        ({"usual": 0.0}, "quantity 'altitude': usual must be the size of an error above zero"),
        ({"innovation": max}, "quantity 'altitude': innovation must be compiled: decorate it"),
        ({"innovation": flight}, "quantity 'altitude': innovation must be compiled: decorate it"),
        ({"compare": None}, "quantity 'altitude': compare must be a function"),
        ({"geometry": lambda along: None},
         r"quantity 'altitude': geometry must have the parameters \(along, axis\), and has \(along\)"),
        ({"compare": lambda: None}, r"quantity 'altitude': compare must have the parameters \(at\), and has \(\)"),
        ({"unit": "Pa"}, "quantity 'altitude': unit 'Pa' is not among DIMENSIONS in mcnav/physics/units.py"),
        ({"shown_in": "s"}, "quantity 'altitude': shown_in 's': got '1 s', which is a time; expected a length"),
    ],
)  # fmt: skip
def test_an_incomplete_quantity_is_refused(changes: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        replace(QUANTITIES["altitude"], **changes)  # type: ignore[arg-type]


def test_a_missing_part_of_a_definition_is_named() -> None:
    with pytest.raises(TypeError, match="missing 2 required positional arguments: 'innovation' and 'compare'"):
        QuantityDefinition("depth", ("",), "m", "m", 1.0, lambda along, axis: Geometry(along.position))  # type: ignore[call-arg]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"quantities": {}}, "sensor 'altimeter': quantities must name at least one"),
        ({"words": "Altitude"}, "sensor 'altimeter': words must be a sentence"),
        ({"template": ""}, "sensor 'altimeter': template must give altitude"),
        ({"select": None}, "sensor 'altimeter': select must read kind and ceiling"),
        ({"name": "Altimeter"}, "sensor 'Altimeter': name must be of small letters"),
        ({"limit": len}, r"sensor 'altimeter': limit must have the parameters \(truth, times\), and has \(obj\)"),
        ({"select": lambda entry: None}, "sensor 'altimeter': select must have the parameters"),
    ],
)
def test_an_incomplete_type_of_sensor_is_refused(changes: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        replace(SENSOR_TYPES["altimeter"], **changes)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("estimated", "message"),
    [
        ("bais", "sensor 'altimeter': estimated has 'bais'; its errors are bias, scale_factor"),
        ("lever_arm", "sensor 'altimeter': estimated has 'lever_arm'; its errors are bias, scale_factor"),
    ],
)
def test_an_estimated_error_that_a_sensor_has_not_is_refused(estimated: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        check_sensor_types([replace(SENSOR_TYPES["altimeter"], estimated=(estimated,))])


@pytest.mark.parametrize(
    ("names", "message"),
    [
        ({"SENSR": SENSOR_TYPES["altimeter"]}, "sonar: got a SensorType named SENSR; its name must be SENSOR"),
        ({"SENSOR": QUANTITIES["altitude"]}, "sonar: SENSOR must be a SensorType; got QuantityDefinition"),
        ({}, "sonar defines no QUANTITY and no SENSOR; expected one of them, or both"),
    ],
)
def test_a_file_names_what_it_defines(names: dict[str, object], message: str) -> None:
    module = ModuleType("sonar")
    vars(module).update(names)
    with pytest.raises(TypeError, match=message):
        read_definitions(module)


def test_two_files_cannot_define_one_name() -> None:
    with pytest.raises(ValueError, match="'altitude' is defined twice in mcnav/systems/ins/sensors; give one another"):
        check_names(["altitude", "heading", "altitude"])
