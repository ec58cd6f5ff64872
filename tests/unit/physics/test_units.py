"""Quantities: what is read, and what is said of what cannot be."""

from __future__ import annotations

import math
import re
import sys

import pytest

from mcnav.physics import units
from mcnav.physics.units import DIMENSIONS, USUAL, UnitError, conversion, quantity
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
        ("0.5 NM", "m", 926.0),
        ("0.5 nmi", "m", 926.0),
        ("2 nautical_miles", "m", 3704.0),
        ("36 kn", "m/s", 18.52),
        ("36 kt", "m/s", 18.52),
        ("36 kts", "m/s", 18.52),
        ("36 knots", "m/s", 18.52),
        ("1 NM/h", "m/s", 1852.0 / 3600.0),
        ("5 rpm", "rad/s", math.pi / 6.0),
        ("2 rev/s", "rad/s", 4.0 * math.pi),
        ("3 mas", "rad", 3e-3 * ARCSEC),
        ("2'", "rad", 120 * ARCSEC),
        ("2''", "rad", 2 * ARCSEC),
        ('2"', "rad", 2 * ARCSEC),
        ("2 ″/h", "rad/s", 2 * ARCSEC / 3600.0),
        ("60 deg/rt-hr", "rad/sqrt(s)", math.pi / 180.0),
        ("1 ms", "s", 1e-3),
        ("2 hrs", "s", 7200.0),
        ("2 mins", "s", 120.0),
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
        ("5 __import__('os')", "m", "is not a known unit"),
        ("5 m**9**9**9", "m", "is not a unit"),
        ("5 " + "k" * 5000, "m", "is not a unit"),
        ("5 m\x1b[31m", "m", "is not a unit"),
        ("1..2 mrad", "rad", "got '1..2 mrad', a range; expected an angle"),
        ("1..x mrad", "rad", "got '1..x mrad'; expected an angle"),
    ],
)
def test_what_cannot_be_read(text: object, unit: str, message: str) -> None:
    with pytest.raises(UnitError) as found:
        quantity(text, unit)
    assert message in str(found.value)
    assert "expected" in str(found.value)
    assert "\n" not in str(found.value)
    assert str(found.value).isprintable()


@pytest.mark.parametrize(
    ("text", "unit", "question"),
    [
        ("0.5 nm", "m", "NM or nmi?"),
        ("250 nm/h", "m/s", "NM or nmi?"),
        ("1 M", "m", "NM or m?"),
        ("1 mil", "rad", "mrad or deg?"),
        ("1 G", "T", "g or gauss?"),
        ("1 mG", "m/s^2", "mg or milligauss?"),
        ("1 rps", "rad/s", "rad/s or rev/s?"),
        ("1 KM", "m", "did you mean km?"),
        ("1 hz", "1/s", "did you mean Hz?"),
    ],
)
def test_units_with_two_meanings_are_asked_for(text: str, unit: str, question: str) -> None:
    with pytest.raises(UnitError, match=re.escape(question)):
        quantity(text, unit)


@pytest.mark.parametrize(
    "text",
    ["1 cd", "1 kd", "1 mh", "1 uh", "1 mmin", "1 cs", "1 mmi", "1 nmis", "1 nft", "1 cg", "1 kg", "1 mppm", "1 m%"],
)
@pytest.mark.parametrize("unit", ["m", "s", "m/s^2", "1"])
def test_prefixes_stand_before_units_that_navigators_use_so(text: str, unit: str) -> None:
    """A centiday, a milli-mile or a nanofoot is a slip of the pen; "nmis" alone is a plural, of nautical miles."""
    if (text, unit) == ("1 nmis", "m"):
        assert quantity(text, unit) == 1852.0
        return
    with pytest.raises(UnitError):
        quantity(text, unit)


def test_a_misalignment_may_be_a_share() -> None:
    assert quantity("1 %", "rad", shares=True) == 0.01
    assert quantity("100 ppm", "rad", shares=True) == pytest.approx(1e-4, rel=1e-15)
    assert quantity("1 mrad", "rad", shares=True) == 1e-3
    for wrong in ("1 km", "0.01", 0.01):
        with pytest.raises(UnitError, match="or a share such as"):
            quantity(wrong, "rad", shares=True)
    with pytest.raises(UnitError, match="pure number"):
        quantity("1 %", "rad")


def test_conversion_refuses_another_dimension() -> None:
    with pytest.raises(UnitError, match="'km' is a length; expected an angle"):
        conversion("km", "rad")


@pytest.mark.parametrize(("unit", "usual"), [(unit, each) for unit, known in USUAL.items() for each in known])
def test_usual_units_are_converted_as_by_pint(unit: str, usual: str) -> None:
    registry = units._registry()
    for one, other, factor in ((usual, unit, USUAL[unit][usual][0]), (unit, usual, USUAL[unit][usual][1])):
        assert registry.Quantity(1.0, units._unit(one)).to(units._unit(other)).magnitude == factor
        assert conversion(one, other) == factor
    assert quantity(f"3 {'' if usual == '1' else usual}", unit) == 3.0 * USUAL[unit][usual][0]


def test_usual_units_are_read_without_pint() -> None:
    program = "import sys; from mcnav.physics.units import quantity; quantity('2 deg/h', 'rad/s'); "
    program += "print('pint' in sys.modules)"
    assert run_to_end([sys.executable, "-c", program]).stdout == "False\n"


def test_examples_are_of_their_kind() -> None:
    for unit, dimension in DIMENSIONS.items():
        quantity(dimension.example, unit)


@pytest.mark.parametrize("first", ["", "import dask.base; "])
def test_units_do_not_load_dask_but_leave_it_usable(first: str) -> None:
    program = f"{first}import sys; from mcnav.physics.units import conversion; conversion('lb', 'kg')\n" + (
        "print('dask' in sys.modules); import dask.base; print(dask.base.is_dask_collection(1))"
    )
    finished = run_to_end([sys.executable, "-c", program])
    assert finished.returncode == 0, finished.stderr
    assert finished.stdout.split() == [str(bool(first)), "False"]
