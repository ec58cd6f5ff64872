"""Values of a key that a sweep varies: a range such as ``0.001..1 deg/h``, a list of numbers, or one of words."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from mcnav.analysis.sweep import Variable
from mcnav.arrays.types import Array
from mcnav.errors import CampaignError, Problem
from mcnav.physics.ranges import DECADE, NUMBER, is_range, read_range
from mcnav.physics.units import UnitError, conversion, si_unit
from mcnav.sampler.sizes import in_si

POINTS: Final = 20
"""Values of a range."""

MOST_POINTS: Final = 10_000
"""Points of a grid."""

MOST_WORDS: Final = 12
"""Values that are no numbers."""

_ITEM: Final = re.compile(rf"\s*({NUMBER})\s*(.*?)\s*", re.DOTALL)

EXPECTED: Final = 'expected a range such as "0.001..1 deg/h", or a list such as "1, 2, 5 deg/h"'


def read_variables(varied: Mapping[str, str | Sequence[object]], points: int = POINTS) -> tuple[Variable, ...]:
    """Read the variables of a sweep: one or two.

    Parameters
    ----------
    varied : mapping of str to str or sequence
        Ranges and lists as written, by path; or sequences of quantities, as text or pint's, and of numbers, which are
        SI where others have a unit.
    points : int
        Values of each range.

    Raises
    ------
    CampaignError
        When there are none or more than two, one has no two different values, or the grid has too many points.

    Examples
    --------
    >>> (bias,) = read_variables({"imu.gyro.bias": "0.01..1 deg/h"}, 3)
    >>> bias.values, bias.unit, bias.log
    (array([0.01, 0.1 , 1.  ]), 'deg/h', True)
    """
    if not 1 <= len(varied) <= 2:
        raise CampaignError([Problem("--vary", "", f"got {len(varied)} keys; expected one or two")])
    variables = []
    for path, written in varied.items():
        try:
            text = written if isinstance(written, str) else _listed(written)
            variables.append(_read_variable(path, text, points))
        except UnitError as wrong:
            raise CampaignError([Problem("--vary", path, str(wrong))]) from None
    variables.sort(key=lambda variable: not variable.words)  # words first: numbers are solved for at each of them
    count = math.prod(len(variable.values) for variable in variables)
    if count > MOST_POINTS:
        sizes = " x ".join(str(len(variable.values)) for variable in variables)
        message = f"got {sizes} points; at most {MOST_POINTS:,} in all, fewer --points make fewer"
        raise CampaignError([Problem("--vary", "", message)])
    return tuple(variables)


def _listed(values: Sequence[object]) -> str:
    """Write a sequence as a list; numbers beside quantities get their SI unit.

    >>> _listed([1e3, "5 km"]), _listed([1, 4])
    ('1000.0 m, 5 km', '1, 4')
    """
    texts = [_text(value) for value in values]
    units = [match[2] for text in texts if (match := _ITEM.fullmatch(text)) is not None and match[2]]
    if not units:
        return ", ".join(texts)
    own = si_unit(units[-1])
    numbers = [isinstance(value, (int, float, np.number)) for value in values]
    return ", ".join(f"{text} {own}" if number else text for text, number in zip(texts, numbers, strict=True))


def _text(value: object) -> str:
    if hasattr(value, "to_base_units"):  # a quantity of pint
        number, unit = in_si(value)
        return f"{number!r} {unit}".removesuffix(" 1")
    return repr(value.item()) if isinstance(value, np.number) else str(value)


def split_varied(written: Sequence[str]) -> dict[str, str]:
    """Split ``KEY=VALUES``; `CampaignError` when one has no key, or a key comes twice."""
    varied: dict[str, str] = {}
    for word in written:
        path, equals, values = word.partition("=")
        if not equals or not path.strip():
            message = f'got {word!r}; expected KEY=VALUES such as imu.gyro.bias="0.001..1 deg/h"'
            raise CampaignError([Problem("--vary", "", message)])
        if path.strip() in varied:
            raise CampaignError([Problem("--vary", path.strip(), "is given twice; keep one")])
        varied[path.strip()] = values
    return varied


def _read_variable(path: str, text: str, points: int) -> Variable:
    if ".." in text:
        if not is_range(text):
            raise UnitError(f"got {text!r}; {EXPECTED}")
        span = read_range(text)
        if span.low == span.high:
            raise UnitError(f"got {text!r}, which is empty; expected a range from a smaller value to a larger one")
        spaced = np.geomspace if span.log else np.linspace
        values = np.array([float(f"{value:.12g}") for value in spaced(span.low, span.high, points)])
        values[[0, -1]] = span.low, span.high
        return Variable(path, values, span.unit, span.log)
    if not any(_ITEM.fullmatch(piece) for piece in text.split(",")):
        return _read_words(path, text)
    given, unit = _read_items(text.split(","), text)
    values = np.unique(given)
    if len(values) < 2:
        raise UnitError(f"got {text!r}; expected at least two different values: {EXPECTED.removeprefix('expected ')}")
    if len(values) < len(given):
        raise UnitError(f"got {text!r}; a value occurs twice")
    log = bool(values[0] > 0.0 and values[-1] / values[0] >= DECADE * (1.0 - 1e-12))
    return Variable(path, values, unit, log)


def _read_words(path: str, text: str) -> Variable:
    """Read values that are no numbers, such as grades of the catalogue."""
    words = tuple(piece.strip() for piece in text.split(","))
    if not all(words) or len(words) < 2 or len(words) > MOST_WORDS:
        raise UnitError(f"got {text!r}; {EXPECTED}, or two to {MOST_WORDS} words such as navigation, tactical")
    if len(set(words)) < len(words):
        raise UnitError(f"got {text!r}; a value occurs twice")
    return Variable(path, np.arange(float(len(words))), "", False, words)


def _read_items(items: Sequence[str], text: str) -> tuple[Array, str]:
    """Read numbers with their units into the last one's unit, which those without one have."""
    matches = [_ITEM.fullmatch(item) for item in items]
    if not all(matches):
        raise UnitError(f"got {text!r}; {EXPECTED}")
    numbers = [(float(match[1]), match[2]) for match in matches if match is not None]
    unit = numbers[-1][1]
    values = []
    for number, own in numbers:
        if not own or own == unit:
            values.append(number)
            continue
        values.append(number * conversion(own, unit or "1"))
    result = np.array(values)
    if not np.isfinite(result).all():
        raise UnitError(f"got {text!r}; expected finite values")
    return result, unit
