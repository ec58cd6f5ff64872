"""Published numbers beside computed ones, and the judgement of their agreement."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Final

CONFIDENCE: Final = 0.999
"""Confidence of each interval of the samples: a hundred intervals all contain their numbers with 90 % probability."""

ROUNDING: Final = 1e-9
"""Share of half a digit by which a number may miss it, for the rounding of the comparison itself."""

SOURCES: Final = {
    "growth": (
        "Laws of growth in the forms of D. Titterton and J. Weston, Strapdown Inertial Navigation Technology, and "
        "P. Groves, Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems, derived again and "
        "evaluated here; the books themselves could not be retrieved"
    ),
    "course": (
        "Table of growth of error processes, usafa-ece.github.io/tps-sy6301, Block 2, ErrorIntegrationDemo; "
        "its formulas are evaluated here"
    ),
    "tuning": "Article on Schuler tuning, probsee.com/p/Schuler_tuning",
    "toolbox": "Single-channel simulation of an inertial navigation toolbox, gpsoftnav.com/1chnsim.html",
    "pendulum": "Article on Foucault's pendulum, everything2.com, by Thomas Miconi",
    "tutorial": (
        "Kalman filter in one dimension, kalmanfilter.net/kalman1d.html; the values as the tests of a public C++ "
        "library quote them, because the page could be retrieved only in part"
    ),
    "budgets": (
        "Error budgets in the programs of M. Grewal and A. Andrews, Kalman Filtering: Theory and Practice Using "
        "MATLAB, 4th edition, 2014, with the fit of the rate in those of M. Grewal, A. Andrews and C. Bartone, Global "
        "Navigation Satellite Systems, Inertial Navigation, and Integration, 3rd edition; the book's own text was not "
        "available"
    ),
    "closed": "Closed forms, evaluated here",
    "checks": "Check values of this project, each computed in two ways or against another package, without its code",
}  # fmt: skip
"""Sources of the published numbers."""


class Agreement(StrEnum):
    """Agreement of the computed numbers with a published one."""

    AGREES = "agrees"
    DIFFERS = "differs"


@dataclass(frozen=True)
class Number:
    """A published number with those computed for it, all in its unit.

    Attributes
    ----------
    chapter, quantity, unit : str
    source : str
        Key of `SOURCES`.
    printed : str
        The number as published, or a published formula evaluated to six digits.
    formula : str
        The formula, or what the number is.
    linear : float
        By linear covariance analysis.
    simulated : float or None
        By nonlinear simulation: a standard deviation or mean of samples where there is an interval, the result of
        single simulations where there is none.
    interval : tuple of (float, float) or None
        Of the samples' result, at `CONFIDENCE`.
    paired : float or None
        The same standard deviation by the difference of each sample from its linear outcome, which has hardly any
        sampling error.
    remark : str
        Why a number differs, or what is peculiar to it.
    """

    chapter: str
    quantity: str
    unit: str
    source: str
    printed: str
    formula: str
    linear: float
    simulated: float | None = None
    interval: tuple[float, float] | None = None
    paired: float | None = None
    remark: str = ""

    @property
    def value(self) -> float:
        """Published number as a float."""
        return float(self.printed)

    @property
    def half_digit(self) -> float:
        """Half a unit of the last printed digit.

        >>> Number("", "", "m", "growth", "0.0250", "", 0.0).half_digit
        5e-05
        >>> Number("", "", "m", "growth", "1.25e-3", "", 0.0).half_digit
        5e-06
        """
        mantissa, _, exponent = self.printed.partition("e")
        return float(f"0.5e{int(exponent or 0) - len(mantissa.partition('.')[2])}")

    @property
    def linear_agrees(self) -> bool:
        """True where linear analysis has the printed digits."""
        return self._has_digits(self.linear)

    @property
    def simulated_agrees(self) -> bool | None:
        """True where the interval contains the size of the number, or a single simulation has the printed digits."""
        if self.simulated is None:
            return None
        if self.interval is None:
            return self._has_digits(self.simulated)
        low, high = self.interval
        size = abs(self.value)
        return low <= size + self.half_digit and size - self.half_digit <= high

    @property
    def agreement(self) -> Agreement:
        """Agreement of both."""
        both = self.linear_agrees and self.simulated_agrees is not False
        return Agreement.AGREES if both else Agreement.DIFFERS

    def explained(self, remark: str) -> Number:
        """Return the same number with a remark."""
        return replace(self, remark=remark)

    def _has_digits(self, computed: float) -> bool:
        return abs(computed - self.value) <= self.half_digit * (1.0 + ROUNDING)


def six_digits(value: float) -> str:
    """Write the value of a formula to six significant digits.

    >>> six_digits(0.04082483), six_digits(2040.0)
    ('0.0408248', '2040.00')
    """
    written = f"{value:#.6g}"
    return f"{value:.5e}" if "e" in written else written.rstrip(".")
