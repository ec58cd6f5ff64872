"""A ratio with its interval on the band of the tolerance, drawn small enough to stand in a cell or beside a number."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from markupsafe import Markup

from mcnav.report.drawing.palette import BAND, FLOWN, MUTED, variable
from mcnav.report.format import rounded

WIDTH, HEIGHT = 72.0, 14.0
"""Size, px."""

REACH: Final = 4.0
"""Tolerances from one to an end of the strip, on the logarithmic scale; what is farther off is an arrow."""

KEY: Final = "Marks: ratio and interval on the tolerance, ±{tolerance:g} %."
"""Meaning of the marks, for a caption."""


@dataclass(frozen=True)
class Strip:
    """A ratio with its interval on the band of the tolerance.

    Attributes
    ----------
    ratio : float
    low, high : float or None
        Ends of its interval; none where it is not known or not bounded.
    tolerance : float
        The band reaches from one less this to one and this.
    """

    ratio: float
    low: float | None
    high: float | None
    tolerance: float

    @classmethod
    def of(
        cls, ratio: float | None, ends: tuple[float | None, float | None] | None, tolerance: float | None
    ) -> Strip | None:
        """Return the strip of a ratio; none where the ratio or the tolerance is not known."""
        if ratio is None or not math.isfinite(ratio) or not tolerance or not 0.0 < tolerance < 1.0:
            return None
        low, high = (None if end is None or not math.isfinite(end) else float(end) for end in ends or (None, None))
        return cls(float(ratio), low, high, tolerance)

    def place(self, ratio: float) -> float:
        """Return where a ratio stands on the logarithmic scale, px from the left; what is farther is at an end."""
        if ratio <= 0.0:
            return 0.0
        off = math.log(ratio) / (REACH * math.log1p(self.tolerance))
        return 0.5 * WIDTH * (1.0 + min(max(off, -1.0), 1.0))

    @property
    def words(self) -> str:
        """The interval, and where it lies, for those who do not see it, and for copies."""
        low, high = self.low or 0.0, math.inf if self.high is None else self.high
        bottom, top = 1.0 - self.tolerance, 1.0 + self.tolerance
        band = f"{rounded(bottom)} to {rounded(top)}"
        if self.low is None and self.high is None:
            return f"no interval; tolerance {band}"
        between = f"{rounded(low)} to {rounded(high)}" if math.isfinite(high) else f"above {rounded(low)}"
        if bottom <= low and high <= top:
            where = "within"
        elif low > top or high < bottom:
            where = "beyond"
        else:
            where = "partly beyond"
        return f"{between}; {where} the tolerance, {band}"

    @property
    def svg(self) -> Markup:
        """The drawing, which has no text: `words` stand beside it."""
        middle, (left, right) = 0.5 * HEIGHT, (self.place(1.0 - self.tolerance), self.place(1.0 + self.tolerance))
        one, colour = 0.5 * WIDTH, variable(FLOWN)
        parts = [
            f'<rect x="{_n(left)}" y="0" width="{_n(right - left)}" height="{_n(HEIGHT)}" fill="{variable(BAND)}"/>',
            f'<path d="M{_n(one)} 0V{_n(HEIGHT)}" stroke="{variable(MUTED)}" stroke-width=".8"/>',
        ]
        if self.low is not None or self.high is not None:
            low, high = self.place(self.low or 0.0), WIDTH if self.high is None else self.place(self.high)
            parts.append(f'<path d="M{_n(low)} {_n(middle)}H{_n(high)}" stroke="{colour}" stroke-width="1.8"/>')
        parts.append(f'<path d="{self._mark()}" fill="{colour}"/>')
        size = f'width="{_n(WIDTH)}" height="{_n(HEIGHT)}" viewBox="0 0 {_n(WIDTH)} {_n(HEIGHT)}"'
        return Markup(f'<svg class="strip" {size} aria-hidden="true">{"".join(parts)}</svg>')

    def _mark(self) -> str:
        """Write a dot, or an arrow at the end that the ratio is beyond."""
        at, middle = self.place(self.ratio), 0.5 * HEIGHT
        if at >= WIDTH:
            return f"M{_n(WIDTH)} {_n(middle)}l-7 -4v8z"
        if at <= 0.0:
            return f"M0 {_n(middle)}l7 -4v8z"
        return f"M{_n(at - 3.0)} {_n(middle)}a3 3 0 1 0 6 0a3 3 0 1 0-6 0"


def _n(value: float) -> str:
    """Write a coordinate with at most one decimal."""
    return f"{value:.1f}".rstrip("0").rstrip(".")
