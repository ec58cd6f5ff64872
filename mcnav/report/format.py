"""Numbers as text for tables and sentences."""

from __future__ import annotations

import math
from typing import Final

from mcnav.analysis.verdict import NUMERICAL

SUPERSCRIPTS: Final = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")

LONGEST: Final = 6
"""Most decimals of a value with its error; smaller errors are written with powers of ten."""

SMALLEST: Final = 1e-4
"""Smallest p-value that is written out."""

LARGE_RATIO: Final = 3.0
"""Ratio above which a difference is given as a multiple, not in per cent."""

ROUNDING: Final = 1e-24
"""Share of a variance below which it is rounding: the square of what some thousand steps leave of a sigma."""


def number(value: float | None, digits: int = 4) -> str:
    """Format a number with significant digits; a missing or infinite one is a dash.

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


def rounded(value: float | None, digits: int = 3) -> str:
    """Format a number with significant digits after rounding to them, which may carry: 0.9999 has the digits 1.00.

    >>> rounded(0.9999), rounded(13.06)
    ('1.00', '13.1')
    """
    known = value is not None and math.isfinite(value)
    return number(float(f"{value:.{digits}g}") if known else value, digits)


def signed(value: float | None, digits: int = 3) -> str:
    """Format a number with its sign and significant digits.

    >>> signed(0.0012345), signed(-2.0)
    ('+0.00123', '−2.00')
    """
    shown = number(value, digits)
    return f"+{shown}" if value is not None and value > 0.0 and math.isfinite(value) else shown


def fixed(value: float | None, decimals: int) -> str:
    """Format a number with its sign and a fixed number of decimals; a missing one is a dash.

    >>> fixed(-0.25, 3)
    '−0.250'
    """
    return "–" if value is None or not math.isfinite(value) else f"{value:+.{decimals}f}".replace("-", "−")


def with_error(value: float, error: float, sign: bool = False) -> str:
    """Format a value with its error to two digits, and as many decimals of the value.

    >>> with_error(4.47512, 0.0403), with_error(-7.7e-6, 0.0021), with_error(0.5, 12.3, sign=True)
    ('4.475 ± 0.040', '0.0000 ± 0.0021', '+0 ± 12')
    """
    decimals = 1 - math.floor(math.log10(error)) if 0.0 < error < math.inf else -1
    if not math.isfinite(value) or not 0 <= decimals <= LONGEST:
        return f"{(signed if sign else number)(value)} ± {number(error, 2)}"
    rounded = round(value, decimals) + 0.0  # no negative zero
    mark = "+" if sign and value > 0.0 else ""
    return f"{mark}{rounded:,.{decimals}f} ± {error:,.{decimals}f}".replace("-", "−")


def interval(low: float | None, high: float | None) -> str:
    """Format an interval of a ratio; an unknown or unbounded one is a dash.

    >>> interval(0.99, 1.01), interval(None, None)
    ('0.9900 to 1.0100', '–')
    """
    known = low is not None and high is not None and math.isfinite(low) and math.isfinite(high)
    return f"{low:.4f} to {high:.4f}" if known else "–"


def share(value: float) -> str:
    """Format a share of a variance in per cent.

    >>> share(0.00001), share(3e-30)
    ('<0.01', '0.00')
    """
    if not math.isfinite(value):
        return "–"
    return "<0.01" if ROUNDING <= abs(value) < 5e-5 else f"{100.0 * value:.2f}".replace("-", "−")


def percent(share: float) -> str:
    """Format a signed difference in per cent: two significant digits below 0.1 %, two decimals to 10 %, one above.

    A difference that may be numerical is zero.

    >>> percent(0.0312), percent(-0.0000213), percent(3.5341), percent(-3e-12)
    ('+3.12 %', '−0.0021 %', '+353.4 %', '+0.00 %')
    """
    value = 0.0 if abs(share) < NUMERICAL else 100.0 * share
    if not math.isfinite(value):
        return "–"
    size = abs(value)
    decimals = 1 if size >= 10.0 else 2 if size >= 0.1 or size == 0.0 else 1 - math.floor(math.log10(size))
    return f"{value:+.{decimals}f} %".replace("-", "−")


def departure(ratio: float) -> str:
    """Format by how much a ratio departs from one: a large one as a multiple.

    >>> departure(1.0312), departure(147.67)
    ('+3.12 %', '148 times as large')
    """
    return f"{number(ratio, 3)} times as large" if ratio > LARGE_RATIO else percent(ratio - 1.0)


def probability(value: float) -> str:
    """Format a p-value.

    >>> probability(0.04321), probability(3e-9), probability(1e-4)
    ('0.043', '<0.0001', '0.0001')
    """
    if value < SMALLEST:
        return f"<{SMALLEST:.4f}"
    return f"{value:.2g}" if value < 0.995 else "1.0"
