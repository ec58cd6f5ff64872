"""Ranges of a quantity, ``0.5..2 deg/h``: a value known to lie between two ends."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Final

from mcnav.physics.units import UnitError, conversion, parted, printable

NUMBER: Final = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"

_RANGE: Final = re.compile(rf"\s*({NUMBER})\s*(.*?)\s*\.\.\s*({NUMBER})\s*(.*?)\s*", re.DOTALL)

DECADE: Final = 10.0
"""Ratio of the ends from which values of a range are spaced by their logarithm."""


@dataclass(frozen=True)
class Range:
    """Values from a lower end to an upper one.

    Attributes
    ----------
    low, high : float
        Ends, in the unit.
    unit : str
        As written behind the upper end; empty for pure numbers.
    """

    low: float
    high: float
    unit: str

    @property
    def log(self) -> bool:
        """Return whether values are spaced by their logarithm: over a decade and more."""
        return self.low > 0.0 and self.high / self.low >= DECADE * (1.0 - 1e-12)

    def at(self, share: float) -> float:
        """Return the value at a share of the way from the lower end, 0, to the upper one, 1; ends are exact.

        >>> Range(1.0, 100.0, "m").at(0.5), Range(1.0, 3.0, "m").at(0.5)
        (10.0, 2.0)
        """
        if share in (0.0, 1.0):
            return self.high if share else self.low
        value = self.low * (self.high / self.low) ** share if self.log else self.low + share * (self.high - self.low)
        return float(f"{value:.12g}")

    def written(self, value: float) -> str | int | float:
        """Return a value as a campaign file has it; a whole number without a unit is an integer."""
        return written(value, self.unit)

    def value_of(self, entry: str | int | float) -> float:
        """Return the value of what `written` has written."""
        return parted(entry)[0] if isinstance(entry, str) else float(entry)

    def __str__(self) -> str:
        return f"{self.low:.6g} to {self.high:.6g} {self.unit}".rstrip()


def written(value: float, unit: str) -> str | int | float:
    """Return a value with its unit as a campaign file has it.

    >>> written(0.5, "deg/h"), written(3.0, "")
    ('0.5 deg/h', 3)
    """
    if unit:
        return f"{float(value)!r} {unit}"
    return int(value) if float(value).is_integer() and abs(value) < 1e15 else float(value)


def is_range(text: object) -> bool:
    """Return whether a text is written as a range.

    >>> is_range("1 m..2 km"), is_range("1..2"), is_range("../flight.csv"), is_range("1.5 m")
    (True, True, False, False)
    """
    return isinstance(text, str) and _matched(text) is not None


def _matched(text: str) -> re.Match[str] | None:
    return _RANGE.fullmatch(text) if text.count("..") == 1 else None


def read_range(text: str) -> Range:
    """Read a range; an end without a unit has that of the upper one.

    Raises
    ------
    UnitError
        When it is none, it is empty, an end is not finite, or the ends are of different dimensions.

    Examples
    --------
    >>> read_range("500 m..2 km")
    Range(low=0.5, high=2.0, unit='km')
    """
    match = _matched(text)
    shown = f"got {printable(text)!r}"
    if match is None:
        raise UnitError(f'{shown}; expected a range such as "0.001..1 deg/h"')
    low, high, unit = float(match[1]), float(match[3]), match[4]
    if match[2] and match[2] != unit:
        low *= conversion(match[2], unit or "1")
    if not (math.isfinite(low) and math.isfinite(high)):
        raise UnitError(f"{shown}; expected finite values")
    if low > high:
        raise UnitError(f"{shown}, which is empty; expected a range from a smaller value to a larger one")
    return Range(low, high, unit)
