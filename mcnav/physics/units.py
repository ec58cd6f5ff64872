"""Units of campaign files and tables; all other values are in SI units and radians.

The registry (``units.txt``) replaces pint's default one, in which "2 g" is a mass and an angle has no dimension.
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from functools import lru_cache
from importlib.resources import files
from types import ModuleType
from typing import TYPE_CHECKING, Final, NamedTuple

if TYPE_CHECKING:
    import pint


class Dimension(NamedTuple):
    """A dimension in words, and an example."""

    words: str
    example: str


DIMENSIONS: Final = {
    "m": Dimension("a length", "5 km"),
    "s": Dimension("a time", "10 s"),
    "m/s": Dimension("a speed", "0.5 m/s"),
    "m/s^2": Dimension("an acceleration", "100 ug"),
    "rad": Dimension("an angle", "40 arcsec"),
    "rad/s": Dimension("an angular rate", "0.2 deg/h"),
    "m^2/kg": Dimension("an area per mass", "4.1e-9 km^2/kg"),
    "s/m": Dimension("a time per length", "3.281 s/km"),
    "1/m": Dimension("a number per length", "0.2 1/km"),
    "rad/sqrt(s)": Dimension("an angle random walk", "0.002 deg/sqrt(h)"),
    "rad/s/sqrt(s)": Dimension("a rate random walk", "0.01 deg/h/sqrt(h)"),
    "m/s/sqrt(s)": Dimension("a velocity random walk", "0.03 m/s/sqrt(h)"),
    "m/s^2/sqrt(s)": Dimension("an acceleration random walk", "5 ug/sqrt(h)"),
    "rad/s/(m/s^2)": Dimension("an angular rate per acceleration", "1 deg/h/g"),
    "(m/s^2)/(m/s^2)^2": Dimension("an acceleration per acceleration squared", "10 ug/g^2"),
    "T": Dimension("a magnetic flux density", "100 nT"),
    "1/s": Dimension("a frequency", "10 Hz"),
    "1": Dimension("a pure number", "100 ppm"),
}
"""Named dimensions by SI unit."""

USUAL: Final[Mapping[str, Mapping[str, tuple[float, float]]]] = {
    "m": {
        "m": (1.0, 1.0),
        "km": (1000.0, 0.001),
        "cm": (0.01, 100.0),
        "mm": (0.001, 1000.0),
        "ft": (0.3048, 3.280839895013123),
        "mi": (1609.344, 0.0006213711922373339),
        "nmi": (1852.0, 0.0005399568034557236),
    },
    "s": {
        "ms": (0.001, 1000.0),
        "s": (1.0, 1.0),
        "min": (60.0, 0.016666666666666666),
        "h": (3600.0, 0.0002777777777777778),
        "d": (86400.0, 1.1574074074074073e-05),
    },
    "m/s": {
        "m/s": (1.0, 1.0),
        "km/s": (1000.0, 0.001),
        "cm/s": (0.01, 100.0),
        "mm/s": (0.001, 1000.0),
        "km/h": (0.2777777777777778, 3.6),
        "ft/s": (0.3048, 3.280839895013123),
    },
    "m/s^2": {
        "m/s^2": (1.0, 1.0),
        "g": (9.80665, 0.10197162129779283),
        "mg": (0.00980665, 101.97162129779284),
        "ug": (9.806649999999999e-06, 101971.62129779284),
        "ft/s^2": (0.3048, 3.280839895013123),
        "mGal": (1e-05, 100000.0),
    },
    "rad": {
        "rad": (1.0, 1.0),
        "mrad": (0.001, 1000.0),
        "urad": (1e-06, 1000000.0),
        "deg": (0.017453292519943295, 57.29577951308232),
        "arcmin": (0.0002908882086657216, 3437.746770784939),
        "arcsec": (4.84813681109536e-06, 206264.80624709636),
    },
    "rad/s": {
        "rad/s": (1.0, 1.0),
        "deg/s": (0.017453292519943295, 57.29577951308232),
        "deg/h": (4.84813681109536e-06, 206264.80624709636),
        "meru": (7.292115e-08, 13713442.533476228),
    },
    "m^2/kg": {"m^2/kg": (1.0, 1.0), "km^2/kg": (1000000.0, 1e-06)},
    "s/m": {"s/m": (1.0, 1.0), "s/km": (0.001, 1000.0)},
    "1/m": {"1/m": (1.0, 1.0), "1/km": (0.001, 1000.0)},
    "rad/sqrt(s)": {"rad/sqrt(s)": (1.0, 1.0), "deg/sqrt(h)": (0.0002908882086657216, 3437.746770784939)},
    "rad/s/sqrt(s)": {"rad/s/sqrt(s)": (1.0, 1.0), "deg/h/sqrt(h)": (8.080228018492267e-08, 12375888.374825781)},
    "m/s/sqrt(s)": {
        "m/s/sqrt(s)": (1.0, 1.0),
        "m/s/sqrt(h)": (0.016666666666666666, 60.0),
        "ft/s/sqrt(h)": (0.00508, 196.85039370078738),
        "mg/sqrt(Hz)": (0.00980665, 101.97162129779284),
        "ug/sqrt(Hz)": (9.806649999999999e-06, 101971.62129779284),
    },
    "m/s^2/sqrt(s)": {"m/s^2/sqrt(s)": (1.0, 1.0), "ug/sqrt(h)": (1.6344416666666664e-07, 6118297.27786757)},
    "rad/s/(m/s^2)": {"rad/s/(m/s^2)": (1.0, 1.0), "deg/h/g": (4.94372370900905e-07, 2022766.7621830872)},
    "(m/s^2)/(m/s^2)^2": {"(m/s^2)/(m/s^2)^2": (1.0, 1.0), "ug/g^2": (1.0197162129779283e-07, 9806650.0)},
    "T": {"T": (1.0, 1.0), "uT": (1e-06, 1000000.0), "nT": (1e-09, 999999999.9999999)},
    "1/s": {"1/s": (1.0, 1.0), "Hz": (1.0, 1.0)},
    "1": {"1": (1.0, 1.0), "%": (0.01, 100.0), "ppm": (1e-06, 1000000.0)},
    "m^3/s^2": {"m^3/s^2": (1.0, 1.0)},
}
"""Factors of usual units, by SI unit: to it, and from it. They are pint's, whose import takes a tenth of a second."""

_RANGED: Final = re.compile(r"\d[^.]*\.\.\s*[-+]?\.?\d")
_QUANTITY: Final = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*", re.DOTALL)
_NAME: Final = re.compile(r"[A-Za-z%_]+")
_UNIT: Final = re.compile(rf"{_NAME.pattern}|[()*/ ]|[\^]-?\d(?!\d)|(?<![\d.])1(?![\d.])")
_LONGEST: Final = 80
_SHORTEST_PLURAL: Final = 3
"""Letters of the shortest name with a plural: "kms" and "gs" look like other units, "mins" and "degs" do not."""

_SIGNS: Final = {
    "µ": "u", "μ": "u", "°": "deg", "º": "deg", "˚": "deg", "²": "^2", "³": "^3", "′": "arcmin", "'": "arcmin",
    "’": "arcmin", "″": "arcsec", '"': "arcsec", "”": "arcsec",
}  # fmt: skip
"""Signs of data sheets and charts, in letters."""

QUESTIONS: Final = {
    "nm": 'NM or nmi? "nm" would be a nanometre; a nautical mile is "NM" or "nmi"',
    "Nm": 'NM or nmi? a nautical mile is "NM" or "nmi"',
    "M": 'NM or m? a nautical mile is "NM" or "nmi"',
    "mil": 'mrad or deg? a mil is 1/6400 of a turn, 1 mrad, or a thousandth of an inch; write "mrad" or "deg"',
    "mils": 'mrad or deg? a mil is 1/6400 of a turn, 1 mrad, or a thousandth of an inch; write "mrad" or "deg"',
    "G": 'g or gauss? write "g", or "100 uT" for a gauss',
    "mG": 'mg or milligauss? write "mg", or "0.1 uT" for a milligauss',
    "uG": 'ug or microgauss? write "ug", or "0.1 nT" for a microgauss',
    "gauss": 'write "100 uT" for a gauss',
    "rps": 'rad/s or rev/s? write "rad/s", or "rev/s" for revolutions per second',
    "dB": 'a ratio in decibels? write the ratio itself, such as "2 %"',
}
"""Names that mean one thing to one reader and another to the next, and the question that they are refused with."""


class UnitError(ValueError):
    """Quantity that cannot be read, or of the wrong dimension; the message states what came and what is expected."""


class PlainNumbers:
    """Record of whether `quantity` has read a number without a unit as SI."""

    read = False


_plain_numbers: ContextVar[PlainNumbers | None] = ContextVar("numbers without a unit that are SI", default=None)


@contextmanager
def numbers_in_si(wanted: bool = True) -> Iterator[PlainNumbers]:
    """Let `quantity` take numbers without a unit as SI while the block runs, if that is wanted."""
    numbers = PlainNumbers()
    before = _plain_numbers.set(numbers if wanted else None)
    try:
        yield numbers
    finally:
        _plain_numbers.reset(before)


@contextmanager
def _hidden(package: str) -> Iterator[None]:
    """Let imports find no such package, unless it is loaded already."""
    if package in sys.modules:
        yield
        return
    modules: dict[str, ModuleType | None] = sys.modules  # type: ignore[assignment]  # None stops an import
    modules[package] = None
    try:
        yield
    finally:
        del modules[package]


@lru_cache
def _registry() -> pint.UnitRegistry[float]:
    with _hidden("dask"):  # pint would load it for arrays that no quantity here holds: a tenth of a second
        import pint  # takes as long without it

    return pint.UnitRegistry(_definitions(), cache_folder=None)


@lru_cache
def _definitions() -> list[str]:
    return files("mcnav").joinpath("physics/units.txt").read_text(encoding="utf-8").splitlines()


@lru_cache
def _names() -> frozenset[str]:
    """Return the names of all units, as ``units.txt`` lists them."""
    definitions = (line.split("=") for line in _definitions() if "=" in line and not line.startswith("#"))
    return frozenset(name.strip() for first, _, *others in definitions for name in (first, *others))


def _spelled(text: str) -> str:
    """Spell the signs of data sheets in letters.

    >>> _spelled("°/√h"), _spelled("m/s/h^0.5"), _spelled("deg/√(h)"), _spelled("µg/rtHz")
    ('deg/sqrt(h)', 'm/s/sqrt(h)', 'deg/sqrt(h)', 'ug/sqrt(Hz)')
    """
    text = "".join(_SIGNS.get(sign, sign) for sign in text.replace("''", "″"))
    text = re.sub(r"\brt[- ]?(?:\(([^()]*)\)|(hr|h|Hz|s)\b)", r"sqrt(\1\2)", text)
    text = re.sub(r"√(?:\(([^()]*)\)|([A-Za-z]+))", r"sqrt(\1\2)", text)
    return re.sub(r"([A-Za-z]+)\^0\.5(?!\d)", r"sqrt(\1)", text)


def _singular(name: str) -> str:
    """Return the name of a unit without the ending of its plural; the empty text where it is none."""
    if name in _names():
        return name
    return name[:-1] if name.endswith("s") and name[:-1] in _names() and len(name) > _SHORTEST_PLURAL else ""


def _refuse_unknown(text: str, names: list[str]) -> None:
    """Raise `UnitError` where one of the names in a unit is that of none, with the one that may be meant."""
    for name in names:
        if _singular(name):
            continue
        if name in QUESTIONS:
            raise UnitError(f"{_quoted(text)}: {QUESTIONS[name]}")
        near = sorted(known for known in _names() if known.lower() == name.lower())
        raise UnitError(f"{_quoted(text)} is not a known unit" + (f" (did you mean {near[0]}?)" if near else ""))


@lru_cache(maxsize=1024)
def _unit(text: str) -> pint.Unit:
    """Parse a unit: names, products, quotients, one-digit powers and square roots."""
    spelled = re.sub(r"\bper\b", "/", _spelled(text)) if len(text) <= _LONGEST else text
    if len(text) > _LONGEST or _UNIT.sub("", spelled):
        raise UnitError(f"{_quoted(text)} is not a unit")
    _refuse_unknown(text, [name for name in _NAME.findall(spelled) if name != "sqrt"])
    spelled = _NAME.sub(lambda name: _singular(name[0]) or name[0], spelled)
    try:
        return _registry().Unit(re.sub(r"sqrt\(([^()]*)\)", r"(\1)**0.5", spelled) if text != "1" else "")
    except Exception:  # pint raises many types, even AssertionError, for text that is not a unit
        raise UnitError(f"{_quoted(text)} is not a known unit") from None


def printable(text: str, longest: int = _LONGEST) -> str:
    """Shorten foreign text for a message and escape characters that are not printable."""
    shown = text if len(text) <= longest else text[: longest - 3] + "..."
    return "".join(c if c.isprintable() else c.encode("unicode_escape", "replace").decode("ascii") for c in shown)


def _quoted(text: str) -> str:
    return f"'{printable(text)}'"


def dimension_of(unit: str) -> Dimension:
    """Return the dimension of an SI unit in words, or the unit itself when it has no words."""
    return DIMENSIONS.get(unit, Dimension(f"a quantity in {unit}", f"1 {unit}"))


def _usual(unit: str, target: str) -> float | None:
    """Return the factor from a unit to another, if one is the SI unit and the other usual."""
    if unit in USUAL.get(target, {}):
        return USUAL[target][unit][0]
    return USUAL[unit][target][1] if target in USUAL.get(unit, {}) else None


def conversion(unit: str, target: str) -> float:
    """Return the factor that converts values from one unit to another.

    Raises `UnitError` where one of them is not known, or they are of different dimensions.

    >>> conversion("km", "m")
    1000.0
    """
    known = _usual(unit, target)
    if known is not None:
        return known
    own, wanted = _unit(unit), _unit(target)
    if own.dimensionality != wanted.dimensionality:
        raise UnitError(f"{_quoted(unit)} is {_words(own)}; expected {_words(wanted)}")
    return _converted(own, target)


def _converted(unit: pint.Unit, target: str) -> float:
    """Return the factor that pint computes."""
    registry = _registry()
    return float(registry.Quantity(1.0, unit).to(_unit(target)).magnitude)


def quantity(text: object, unit: str, shares: bool = False) -> float:
    """Read a quantity such as ``"0.2 deg/h"`` into an SI unit.

    Parameters
    ----------
    text : object
        A string with a unit; a number for a pure number, and within `numbers_in_si` for any other.
    unit : str
        SI unit.
    shares : bool
        Whether an angle may be a share such as ``"1 %"``: that of an input that another axis reads is a small angle.

    Raises
    ------
    UnitError
        When it is not a quantity, not finite, or of another dimension.

    Examples
    --------
    >>> quantity("3 km", "m"), quantity("1 %", "rad", shares=True)
    (3000.0, 0.01)
    >>> quantity("5 km", "rad/s")
    Traceback (most recent call last):
    ...
    mcnav.physics.units.UnitError: got '5 km', which is a length; expected an angular rate such as "0.2 deg/h"
    """
    words, example = dimension_of(unit)
    expected = f'expected {words} such as "{example}"' + (' or a share such as "1 %"' if shares else "")
    if isinstance(text, (int, float)) and not isinstance(text, bool):
        plain = _plain_numbers.get()
        if unit != "1":
            if plain is None:
                raise UnitError(f"got {text!r} without a unit; {expected}")
            plain.read = True
        try:
            text = f"{float(text)!r} {unit}" if unit != "1" else repr(float(text))
        except OverflowError:
            raise UnitError(f"got a number beyond 1e308; {expected}") from None
    if not isinstance(text, str):
        raise UnitError(f"got {_described(text)}; {expected}")
    match = _QUANTITY.fullmatch(text)
    if match is None or ".." in text:
        raise UnitError(f"got {_quoted(text)}{', a range' if _RANGED.search(text) else ''}; {expected}")
    number, name = float(match[1]), match[2]
    if not name and unit != "1":
        raise UnitError(f"got {_quoted(text)} without a unit; {expected}")
    if shares and name in USUAL["1"]:
        unit = "1"
    factor = _usual(name or "1", unit)
    if factor is None:
        try:
            result = _unit(name or "1")
        except UnitError as problem:
            raise UnitError(f"{problem}; {expected}") from None
        if result.dimensionality != _unit(unit).dimensionality:
            raise UnitError(f"got {_quoted(text)}, which is {_words(result)}; {expected}")
        factor = _converted(result, unit)
    value = number * factor
    if not math.isfinite(value):
        raise UnitError(f"got {_quoted(text)}, which is not finite; {expected}")
    return value


def si_unit(unit: str) -> str:
    """Return the SI unit of a unit's dimension.

    Raises `UnitError` when it is not a unit, or of a dimension that no quantity here has.

    >>> si_unit("deg/h"), si_unit("km"), si_unit("ppm")
    ('rad/s', 'm', '1')
    """
    for target, usual in USUAL.items():
        if unit in usual:
            return target
    result = _unit(unit)
    for target in DIMENSIONS:
        if _unit(target).dimensionality == result.dimensionality:
            return target
    raise UnitError(f"{_quoted(unit)} is {_words(result)}, which no error source has")


def parted(text: str) -> tuple[float, str]:
    """Return the number and the unit of a quantity.

    Raises `UnitError` when it is not a quantity.

    >>> parted("0.2 deg/h"), parted("5")
    ((0.2, 'deg/h'), (5.0, ''))
    >>> parted("1..5 km")
    Traceback (most recent call last):
    ...
    mcnav.physics.units.UnitError: got '1..5 km', a range; expected a quantity
    """
    match = _QUANTITY.fullmatch(text)
    if match is None or ".." in text:
        raise UnitError(f"got {_quoted(text)}{', a range' if _RANGED.search(text) else ''}; expected a quantity")
    return float(match[1]), match[2].strip()


def multiplied(text: str, factor: float) -> str:
    """Multiply a quantity and keep its unit, to nine digits.

    Raises `UnitError` when it is not a quantity.

    >>> multiplied("0.2 deg/h", 0.5), multiplied("100 ppm", 0.123)
    ('0.1 deg/h', '12.3 ppm')
    """
    number, unit = parted(text)
    return f"{number * factor:.9g} {unit}".rstrip()


def _words(unit: pint.Unit) -> str:
    for known, dimension in DIMENSIONS.items():
        if _unit(known).dimensionality == unit.dimensionality:
            return dimension.words
    return f"of dimension {unit.dimensionality}"


def _described(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    names: dict[type, str] = {list: "a list", dict: "a table"}
    return names.get(type(value), type(value).__name__)
