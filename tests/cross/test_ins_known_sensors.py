"""No sensor is ignored in silence: unknown quantities are refused, measurements of many components are processed."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
import pytest

from mcnav._types import Array
from mcnav.config.read import parse_campaign
from mcnav.errors import CampaignError
from mcnav.systems.ins.aided import AidedNavigation
from mcnav.systems.ins.ensemble.updates import INNOVATED
from mcnav.systems.ins.imu.instruments import CONSTANTS, Imu, Noise
from mcnav.systems.ins.reference.aided import AidedMechanization
from mcnav.systems.ins.scenario import Navigation
from mcnav.systems.ins.sensors import measurements
from mcnav.systems.ins.sensors.aiding import COMPONENTS, Component, Quantity, Sensor
from mcnav.systems.ins.sensors.measurements import KINDS, check_kinds, measure
from mcnav.systems.ins.sensors.sources import UNITS
from mcnav.systems.ins.tables.aiding import SENSOR_TYPES
from mcnav.systems.ins.tables.sensors import SensorType
from tests.aided import make_filter, make_sensor, sized
from tests.flights import flight
from tests.unit.config.test_aiding import described

FIELD = cast(Quantity, "magnetic_field")
UNIT = Imu(Noise(np.full(3, 1e-6)), Noise(np.full(3, 1e-4)))
SIGMAS = {
    "position": 2.0,
    "velocity": 0.1,
    "tilt": 1e-4,
    "heading": 3e-4,
    "gyro_bias": 1e-6,
    "accelerometer_bias": 1e-3,
}
TIMES = np.arange(602.0, 621.0, 2.0)


@pytest.fixture
def magnetometer(monkeypatch: pytest.MonkeyPatch) -> Sensor:
    """A sensor whose quantity has a number, but equations nowhere."""
    monkeypatch.setitem(COMPONENTS, FIELD, ("x", "y", "z"))
    monkeypatch.setitem(KINDS, FIELD, 6)
    components = tuple(Component(FIELD, axis, 1e-3, 0.0, 100.0, "magnetometer") for axis in range(3))
    return Sensor("magnetometer", "magnetometer", TIMES, components)


def aided(*sensors: Sensor) -> AidedNavigation:
    model = make_filter(sensors, UNIT, SIGMAS, ("gyro_bias", "accelerometer_bias"))
    found = Navigation(flight(), "strapdown", 600.0, 620.0, UNIT, sensors, model).aided
    assert found is not None
    return found


def test_linear_analysis_refuses_a_quantity_without_geometry(magnetometer: Sensor) -> None:
    with pytest.raises(ValueError, match="measurements has no geometry of magnetic_field; add it there"):
        _ = aided(magnetometer).linear


def test_linear_analysis_refuses_a_quantity_without_responses(
    magnetometer: Sensor, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whose geometry is there: it was taken for a heading."""
    give_geometry(monkeypatch)
    with pytest.raises(ValueError, match="fill_row has no equations for measurements of magnetic_field; add them"):
        measure(flight(), "strapdown", 600.0, (magnetometer,))


def test_the_ensemble_refuses_a_quantity_without_innovations(
    magnetometer: Sensor, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whose responses are there: its innovation was zero."""
    give_geometry(monkeypatch)
    monkeypatch.setattr(measurements, "ROWS", (*measurements.ROWS, KINDS[FIELD]))
    navigation = aided(magnetometer)
    tables = navigation.tables(1)
    with pytest.raises(ValueError, match="innovate has no equations for measurements of magnetic_field; add them"):
        navigation.propagate(tables, np.zeros((1, len(CONSTANTS) + 3)), True)


def test_the_reference_engine_refuses_a_quantity_without_equations(magnetometer: Sensor) -> None:
    """It read what was in memory."""
    model = make_filter((magnetometer,), UNIT, SIGMAS)
    engine = AidedMechanization(flight(), "strapdown", 600.0, 620.0, np.array([620.0]), (magnetometer,), model)
    with pytest.raises(ValueError, match="earth_fixed_sensors has no equations for magnetic_field, which magnetometer"):
        engine.simulate(np.zeros(len(CONSTANTS) + 3))


def test_a_campaign_with_such_a_sensor_is_one_line(magnetometer: Sensor, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(SENSOR_TYPES, "magnetometer", SensorType({"field": FIELD}))  # type: ignore[index]
    monkeypatch.setitem(UNITS, FIELD, UNITS["attitude"])
    entry: dict[str, Any] = {"type": "magnetometer", "interval": "1 s", "field": "1 mrad"}
    with pytest.raises(CampaignError) as wrong:
        parse_campaign(described(entry), "mine.toml", "mine")
    assert str(wrong.value) == (
        "mine.toml: aiding #1.type: got 'magnetometer'; mcnav.systems.ins.sensors.measurements has no equations for "
        "magnetic_field"
    )


def test_kinds_of_unused_components_are_not_looked_at() -> None:
    kinds, sizes = np.array([[0, 99], [1, 2]]), np.array([1, 2])
    check_kinds(kinds, sizes, INNOVATED, "innovate")
    with pytest.raises(ValueError, match="innovate has no equations for measurements of kind 99"):
        check_kinds(kinds, np.array([2, 2]), INNOVATED, "innovate")


def give_geometry(monkeypatch: pytest.MonkeyPatch) -> None:
    """Give the magnetometer the geometry of a star tracker."""
    known = measurements._Surroundings.geometry

    def geometry(self: Any, quantity: Quantity, axis: int) -> tuple[Array, Array, Array]:
        return known(self, "attitude" if quantity == FIELD else quantity, axis)

    monkeypatch.setattr(measurements._Surroundings, "geometry", geometry)


@pytest.mark.parametrize("noise", [3.0, 1e-3])
def test_a_sensor_of_nine_components_is_two_sensors_at_one_instant(noise: float) -> None:
    """Its filter and errors, in linear analysis and both engines; small noise of the position needs Joseph's form.

    One update and two are the same but for rounding: earth-fixed positions have units of 1e-9 m, some of which are a
    larger share of the small sigma. Between the two, samples with errors of a hundredth of a sigma correct themselves,
    which changes them by products of these, less than 1e-6 of sigma.
    """
    arm = (1.0, 0.3, -0.5)
    quantities: dict[Quantity, float] = {"position": noise, "velocity": 0.1}
    receiver = make_sensor("both", TIMES, quantities, lever_arm=arm)
    odometer = make_sensor("odometer", TIMES, {"body_velocity": 0.2})
    one = aided(make_sensor("all", TIMES, {**quantities, "body_velocity": 0.2}, lever_arm=arm))
    two = aided(receiver, odometer)
    assert one.loop.measurements.sizes.tolist() == [9] * len(TIMES)
    np.testing.assert_allclose(one.linear.own, two.linear.own, rtol=0.0, atol=1e-11 * np.abs(two.linear.own).max())
    for source in ("heading", "gyro_bias_y", "accelerometer_bias_x"):
        found = []
        for each in (one, two):
            sigmas = sized(each.sensors, SIGMAS)
            errors = np.zeros((1, len(sigmas)))
            errors[0, CONSTANTS.index(source)] = 0.01 * sigmas[CONSTANTS.index(source)]
            tables = each.tables(1)
            own, shared = (each.propagate(tables, errors, own)[0][0, 1:] for own in (True, False))
            engine = AidedMechanization(each.truth, "strapdown", 600.0, 620.0, each.times, each.sensors, each.filter)
            found.append((own, shared, engine.simulate(errors[0])[0][1:]))
        sigma = np.sqrt(np.diagonal(two.linear.own, axis1=1, axis2=2))[1:]
        allowed = 1e-6 + 8e-9 / sigma[:, :3].min()
        for ones, twos in zip(*found, strict=True):
            assert np.abs(twos / sigma).max() > 1e-3
            assert np.abs((ones - twos) / sigma).max() <= allowed
