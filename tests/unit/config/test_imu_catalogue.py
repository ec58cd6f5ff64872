"""The catalogue of inertial measurement units: every value is a quantity of its kind and has a source."""

from __future__ import annotations

import json

import pytest

from mcnav.physics.constants import STANDARD_GRAVITY
from mcnav.physics.units import quantity
from mcnav.systems.ins.tables.imu_catalogue import ALLAN_MINIMUM, catalogue, catalogue_units
from tests.commands import in_process

GRADES = {"strategic": (1e-4, 1e-3), "navigation": (0.0, 0.01), "tactical": (1.0, 10.0), "consumer": (360.0, 360.0)}
"""Ranges of gyro bias, deg/h (El-Sheimy and Youssef 2020)."""


def test_every_value_is_a_positive_quantity_of_its_kind_with_a_source() -> None:
    units = catalogue_units()
    assert len({unit.name for unit in units}) == len(units) == len(GRADES) + 10
    for unit in units:
        assert unit.values
        assert len({(value.instrument, value.key) for value in unit.values}) == len(unit.values)
        for value in unit.values:
            assert quantity(value.text, value.unit) > 0.0
            assert value.source


def test_grades_are_in_their_ranges() -> None:
    for name, (low, high) in GRADES.items():
        bias = quantity(catalogue()[name]["gyro"]["bias"], "rad/s") / quantity("1 deg/h", "rad/s")
        assert low * (1.0 - 1e-12) <= bias <= high * (1.0 + 1e-12)  # rounding of a unit there and back


def test_every_grade_has_an_instability_and_misalignments_of_its_own_size() -> None:
    """An instability is smaller than the bias; none is zero, so that no filter calibrates the unit perfectly."""
    for name in GRADES:
        for instrument, unit in (("gyro", "rad/s"), ("accelerometer", "m/s^2")):
            table = catalogue()[name][instrument]
            (size,) = (text for key, text in table["bias_instability"].items() if key != "correlation_time")
            assert 0.0 < quantity(size, unit) / ALLAN_MINIMUM < quantity(table["bias"], unit)
            assert 0.0 < quantity(table["misalignment"], "rad") < 0.02


def test_what_is_assumed_says_so() -> None:
    for unit in catalogue_units():
        for value in unit.values:
            if unit.name in GRADES and value.key.startswith("bias_instability"):
                assert value.source.startswith(("no source for the grade; ", "assumed"))


def test_instabilities_are_complete() -> None:
    for name, tables in catalogue().items():
        for table in tables.values():
            if "bias_instability" in table:
                size = {"sigma", "allan_minimum"} & table["bias_instability"].keys()
                assert len(size) == 1, name
                assert table["bias_instability"].keys() - size == {"correlation_time"}, name


def test_units_of_data_sheets() -> None:
    per_root_hour = {"0.002 deg/sqrt(h)", "0.002 °/√h", "0.002 deg/h^0.5", "0.002 deg/√(h)", "0.12 deg/h/sqrt(Hz)"}
    values = {text: quantity(text, "rad/sqrt(s)") for text in per_root_hour}
    assert list(values.values()) == pytest.approx([quantity("0.002 deg", "rad") / 60.0] * 5, rel=1e-14)
    # 20 ug/sqrt(Hz) over an hour is 20e-6 g * 60 s^0.5
    assert quantity("20 ug/sqrt(Hz)", "m/s/sqrt(s)") == pytest.approx(20e-6 * STANDARD_GRAVITY, rel=1e-14)
    assert quantity("0.01176798 m/s/√h", "m/s/sqrt(s)") == pytest.approx(20e-6 * STANDARD_GRAVITY, rel=1e-14)
    assert quantity("15 mGal", "m/s^2") == pytest.approx(1.5e-4, rel=1e-14)
    assert quantity("7 mdps", "rad/s") == pytest.approx(quantity("0.007 deg/s", "rad/s"), rel=1e-14)
    assert quantity("1 deg/h/g", "rad/s/(m/s^2)") == pytest.approx(quantity("1 deg/h", "rad/s") / STANDARD_GRAVITY)
    assert quantity("10 ug/g²", "(m/s^2)/(m/s^2)^2") == pytest.approx(1e-5 / STANDARD_GRAVITY, rel=1e-14)


def test_the_command_lists_and_shows() -> None:
    listed = in_process("docs", "imu")
    assert listed.exit_code == 0, listed.output
    for unit in catalogue_units():
        assert unit.name in listed.output
    shown = in_process("docs", "imu", "STIM300")
    assert shown.exit_code == 0
    assert "gyro.g_sensitivity" in shown.output
    assert "citing the data sheet" in shown.output
    table = json.loads(in_process("docs", "imu", "--format", "json").stdout)
    assert len(table["values"]) == sum(len(unit.values) for unit in catalogue_units())
    refused = in_process("docs", "imu", "STIM30")
    assert refused.exit_code == 2
    assert "no grade or unit 'STIM30'; did you mean 'STIM300'?" in refused.stderr
