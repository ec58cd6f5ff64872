"""Sources and processes of aiding sensors: names, units, groups."""

from __future__ import annotations

import numpy as np
import pytest

from mcnav.contract.quantities import Source
from mcnav.physics.units import conversion
from mcnav.systems.ins.sensors.aiding import Component, Sensor, aiding_constants, aiding_processes
from mcnav.systems.ins.sensors.sources import aiding_outputs, aiding_sources

SENSORS = (
    Sensor(
        "gnss",
        "gnss",
        np.arange(1.0, 4.0),
        (*(Component("position", axis, 3.0, 2.0 * axis, 100.0, "gnss_position") for axis in range(3)),
         Component("velocity", 1, 0.1, 0.0, 100.0, "gnss_velocity")),
        has_lever_arm=True,
    ),
    Sensor("baro", "altimeter", np.arange(1.0, 4.0), (Component("altitude", 0, 5.0, 30.0, 900.0, "baro"),)),
    Sensor("star", "star-tracker", np.arange(3.0), (Component("attitude", 2, 1e-5, 0.0, 1.0, "star"),)),
    Sensor("log", "velocity", np.arange(3.0), (Component("body_velocity", 0, 0.2, 0.0, 1.0, "log"),)),
    Sensor("compass", "heading", np.arange(3.0), (Component("heading", 0, 0.01, 0.02, 60.0, "compass"),)),
)  # fmt: skip


def test_each_constant_error_is_a_source_in_order() -> None:
    sources = aiding_sources(SENSORS)
    assert tuple(source.name for source in sources) == aiding_constants(SENSORS)
    found = {source.name: (source.unit, source.shown_in, source.group) for source in sources}
    assert found["gnss_position_bias_north"] == ("m", "m", "gnss_position_bias")
    assert found["gnss_velocity_bias_east"] == ("m/s", "m/s", "gnss_velocity_bias")
    assert found["gnss_lever_arm_z"] == ("m", "cm", "gnss_lever_arm")
    assert found["baro_bias"] == ("m", "m", "baro_bias")
    assert found["baro_scale_factor"] == ("1", "ppm", "baro_scale_factor")
    assert found["star_bias_z"] == ("rad", "arcsec", "star_bias")
    assert found["log_scale_factor_x"] == ("1", "ppm", "log_scale_factor")
    assert found["compass_bias"] == ("rad", "mrad", "compass_bias")


def test_each_process_that_is_not_zero_has_the_unit_of_what_is_measured() -> None:
    processes = aiding_outputs(SENSORS)
    assert [process.name for process in processes] == list(aiding_processes(SENSORS))
    found = {process.name: process.unit for process in processes}
    assert found["gnss_position_noise_down"] == "m"
    assert "gnss_position_correlated_north" not in found
    assert found["gnss_position_correlated_east"] == "m"
    assert found["gnss_velocity_noise_east"] == "m/s"
    assert found["star_noise_z"] == "rad"
    assert found["compass_correlated"] == "rad"


@pytest.mark.parametrize("source", aiding_sources(SENSORS), ids=lambda source: source.name)
def test_units_shown_are_of_the_dimension(source: Source) -> None:
    assert conversion(source.shown_in, source.unit) > 0.0
