"""Numbers as the report's tables print them."""

from __future__ import annotations

import math
from typing import Final

SUPERSCRIPTS: Final = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")

LONGEST: Final = 6
"""Decimals of a value with its error; smaller errors are written with powers of ten."""


def number(value: float | None, digits: int = 4) -> str:
    """A number with so many significant digits; a dash for one that does not exist.

    >>> number(36.3456789), number(-1.6e-8, 2), number(123456.7, 3)
    ('36.35', '−1.6·10⁻⁸', '1.23·10⁵')
    """
    if value is None or not math.isfinite(value):
        return "–"
    if value == 0.0:
        return "0"
    magnitude = math.floor(math.log10(abs(value)))
    if magnitude >= digits + 2 or magnitude < -4:
        mantissa, exponent = f"{value:.{digits - 1}e}".replace("-", "−", int(value < 0.0)).split("e")
        return f"{mantissa}·10{str(int(exponent)).translate(SUPERSCRIPTS)}"
    return f"{value:,.{max(0, digits - 1 - magnitude)}f}".replace("-", "−")


def signed(value: float | None, digits: int = 3) -> str:
    """A number that always carries its sign.

    >>> signed(0.0012345), signed(-2.0)
    ('+0.00123', '−2.00')
    """
    shown = number(value, digits)
    return f"+{shown}" if value is not None and value > 0.0 and math.isfinite(value) else shown


def fixed(value: float, decimals: int) -> str:
    """A number with its sign and so many decimals.

    >>> fixed(-0.25, 3)
    '−0.250'
    """
    return f"{value:+.{decimals}f}".replace("-", "−")


def with_error(value: float, error: float, sign: bool = False) -> str:
    """A value and its error, which has two digits; the value has no more decimals than that.

    >>> with_error(4.47512, 0.0403), with_error(-7.7e-6, 0.0021), with_error(0.5, 12.3, sign=True)
    ('4.475 ± 0.040', '0.0000 ± 0.0021', '+0 ± 12')
    """
    decimals = 1 - math.floor(math.log10(error)) if 0.0 < error < math.inf else -1
    if not math.isfinite(value) or not 0 <= decimals <= LONGEST:
        return f"{(signed if sign else number)(value)} ± {number(error, 2)}"
    rounded = round(value, decimals) + 0.0  # no negative zero
    mark = "+" if sign and value > 0.0 else ""
    return f"{mark}{rounded:,.{decimals}f} ± {error:,.{decimals}f}".replace("-", "−")


def share(value: float) -> str:
    """A share of a variance in per cent.

    >>> share(0.00001)
    '<0.01'
    """
    if not math.isfinite(value):
        return "–"
    return "<0.01" if 0.0 < abs(value) < 5e-5 else f"{100.0 * value:.2f}".replace("-", "−")
