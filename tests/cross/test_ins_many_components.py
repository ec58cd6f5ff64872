"""Measurements of many components are those of several sensors at one instant."""

from __future__ import annotations

import numpy as np
import pytest

from mcnav.systems.ins.aided import AidedNavigation
from mcnav.systems.ins.imu.instruments import CONSTANTS, Imu, Noise
from mcnav.systems.ins.reference.aided import AidedMechanization
from mcnav.systems.ins.scenario import Navigation
from mcnav.systems.ins.sensors.aiding import Sensor
from tests.aided import make_filter, make_sensor, sized
from tests.flights import flight

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


def aided(*sensors: Sensor) -> AidedNavigation:
    model = make_filter(sensors, UNIT, SIGMAS, ("gyro_bias", "accelerometer_bias"))
    found = Navigation(flight(), "strapdown", 600.0, 620.0, UNIT, sensors, model).aided
    assert found is not None
    return found


@pytest.mark.parametrize("noise", [3.0, 1e-3])
def test_a_sensor_of_nine_components_is_two_sensors_at_one_instant(noise: float) -> None:
    """Its filter and errors, in linear analysis and both engines; small noise of the position needs Joseph's form.

    One update and two are the same but for rounding: earth-fixed positions have units of 1e-9 m, some of which are a
    larger share of the small sigma. Between the two, samples with errors of a hundredth of a sigma correct themselves,
    which changes them by products of these, less than 1e-6 of sigma.
    """
    arm = (1.0, 0.3, -0.5)
    quantities: dict[str, float] = {"position": noise, "velocity": 0.1}
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
