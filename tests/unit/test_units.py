"""Quantities: what is read, and what is said of what cannot be."""

from __future__ import annotations

import math
import sys

import pytest

from mcnav import units
from mcnav.units import DIMENSIONS, USUAL, UnitError, conversion, quantity
from tests.processes import run_to_end

ARCSEC = math.pi / 648_000.0


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("5 km", "m", 5e3),
        ("5km", "m", 5e3),
        ("-1.5e3 ft", "m", -457.2),
        ("2 mi", "m", 3218.688),
        ("3 statute_mile", "m", 4828.032),
        ("0.2 deg/h", "rad/s", 0.2 * math.pi / 648_000.0),
        ("13 meru", "rad/s", 13 * 7.292115e-8),
        ("40 arcsec", "rad", 40 * ARCSEC),
        ("0.2 mrad", "rad", 2e-4),
        ("1 g", "m/s^2", 9.80665),
        ("100 mg", "m/s^2", 0.980665),
        ("100 ug", "m/s^2", 9.80665e-4),
        ("100 µg", "m/s^2", 9.80665e-4),
        ("100 ppm", "1", 1e-4),
        ("1e-4 g/g", "1", 1e-4),
        ("5 %", "1", 0.05),
        ("0.25", "1", 0.25),
        (0.25, "1", 0.25),
        (3, "1", 3.0),
        ("5.0e-9 km^2/kg", "m^2/kg", 5e-3),
        ("3.281 s/km", "s/m", 3.281e-3),
        ("-20 min", "s", -1200.0),
        ("3 deg/sqrt(h)", "rad/s^0.5", None),
    ],
)
def test_quantities(text: object, unit: str, value: float | None) -> None:
    if value is None:
        assert conversion("deg/sqrt(h)", "rad/sqrt(s)") == pytest.approx(math.pi / 180.0 / 60.0, rel=1e-12)
    else:
        assert quantity(text, unit) == pytest.approx(value, rel=1e-14)


@pytest.mark.parametrize(
    ("text", "unit", "message"),
    [
        ("5 km", "rad/s", "got '5 km', which is a length; expected an angular rate such as \"0.2 deg/h\""),
        ("2 g", "m", "got '2 g', which is an acceleration"),
        ("40 arcsec", "1", "got '40 arcsec', which is an angle; expected a pure number"),
        ("100 ppm", "rad", "got '100 ppm', which is a pure number; expected an angle"),
        ("5 furlong", "m", "'furlong' is not a known unit"),
        (5, "m", "got 5 without a unit"),
        ("5", "m", "got '5' without a unit"),
        ("nan km", "m", "got 'nan km'"),
        ("1e999 km", "m", "which is not finite"),
        ("km", "m", "got 'km'"),
        ("", "m", "got ''"),
        (True, "1", "got true"),
        (["5 km"], "m", "got a list"),
        ({}, "m", "got a table"),
        (10**400, "1", "beyond 1e308"),
        ("5 km^999999999", "m", "is not a unit"),
        ("5 __import__('os')", "m", "is not a unit"),
        ("5 m**9**9**9", "m", "is not a unit"),
        ("5 " + "k" * 5000, "m", "is not a unit"),
        ("5 m\x1b[31m", "m", "is not a unit"),
    ],
)
def test_what_cannot_be_read(text: object, unit: str, message: str) -> None:
    with pytest.raises(UnitError) as found:
        quantity(text, unit)
    assert message in str(found.value)
    assert "expected" in str(found.value)
    assert "\n" not in str(found.value)
    assert str(found.value).isprintable()


@pytest.mark.parametrize(("unit", "usual"), [(unit, each) for unit, known in USUAL.items() for each in known])
def test_usual_units_are_converted_as_by_pint(unit: str, usual: str) -> None:
    registry = units._registry()
    for one, other, factor in ((usual, unit, USUAL[unit][usual][0]), (unit, usual, USUAL[unit][usual][1])):
        assert registry.Quantity(1.0, units._unit(one)).to(units._unit(other)).magnitude == factor
        assert conversion(one, other) == factor
    assert quantity(f"3 {'' if usual == '1' else usual}", unit) == 3.0 * USUAL[unit][usual][0]


def test_usual_units_are_read_without_pint() -> None:
    program = "import sys; from mcnav.units import quantity; quantity('2 deg/h', 'rad/s'); print('pint' in sys.modules)"
    assert run_to_end([sys.executable, "-c", program]).stdout == "False\n"


def test_examples_are_of_their_kind() -> None:
    for unit, dimension in DIMENSIONS.items():
        quantity(dimension.example, unit)


@pytest.mark.parametrize("first", ["", "import dask.base; "])
def test_units_do_not_load_dask_but_leave_it_usable(first: str) -> None:
    program = f"{first}import sys; from mcnav.units import conversion; conversion('lb', 'kg')\n" + (
        "print('dask' in sys.modules); import dask.base; print(dask.base.is_dask_collection(1))"
    )
    finished = run_to_end([sys.executable, "-c", program])
    assert finished.returncode == 0, finished.stderr
    assert finished.stdout.split() == [str(bool(first)), "False"]
