"""Paths of SVG in whole coordinates, of which `UNIT` are a pixel: curves with gaps, dots, areas, outlines.

Paths know ``M``, ``m``, ``l``, ``h0`` and ``z`` only, so that the page's script can read values from them, and zoom by
scaling them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from mcnav.arrays.types import Array

UNIT: Final = 20
"""Coordinates to a pixel."""

FAR: Final = 1e4
"""Coordinates are cut at so many pixels, which is far outside."""


@dataclass(frozen=True)
class Scale:
    """From values to pixels: ``low`` is at ``begin``, ``high`` at ``end``."""

    low: float
    high: float
    begin: float
    end: float
    log: bool = False

    def __call__(self, values: ArrayLike) -> Array:
        """Return the pixels of values; NaN where there is none."""
        result = np.asarray(values, dtype=float)
        low, high = self.low, self.high
        if self.log:
            result = np.log10(np.where(result > 0.0, result, np.nan))
            low, high = math.log10(low), math.log10(high)
        share = (result - low) / (high - low)
        return np.clip(self.begin + (self.end - self.begin) * share, -FAR, FAR)

    def attribute(self) -> str:
        """For the script: limits, their coordinates, and whether it is logarithmic."""
        return f"{self.low:.10g} {self.high:.10g} {coordinate(self.begin)} {coordinate(self.end)} {int(self.log)}"


def coordinate(pixels: float) -> int:
    """Return the coordinate at so many pixels."""
    return round(float(pixels) * UNIT)


def _coordinates(x: Array, y: Array) -> list[tuple[Array, Array]]:
    """Split points into runs of finite ones, in whole coordinates."""
    known = np.isfinite(x) & np.isfinite(y)
    if known.all():
        return [(np.rint(x * UNIT).astype(np.int64), np.rint(y * UNIT).astype(np.int64))] if len(x) else []
    ends = np.flatnonzero(np.diff(known.astype(np.int8))) + 1
    parts = zip(np.split(x, ends), np.split(y, ends), np.split(known, ends), strict=True)
    return [coordinate for a, b, own in parts if own[0] for coordinate in _coordinates(a, b)]


def _pairs(command: str, x: Array, y: Array, end: str = "") -> str:
    pairs = zip(x.tolist(), y.tolist(), strict=True)
    return "".join([f"{command}{a} {b}{end}" if b >= 0 else f"{command}{a}{b}{end}" for a, b in pairs])


def line_path(x: Array, y: Array) -> str:
    """Return the path of a curve through pixels, with gaps where it is not finite; points that coincide are one.

    >>> line_path(np.array([0.0, 1.0, 1.01, 3.0]), np.array([2.0, 1.0, 1.0, 1.0]))
    'M0 40l20-20l40 0'
    """
    path = ""
    for a, b in _coordinates(x, y):
        dx, dy = np.diff(a), np.diff(b)
        moves = (dx != 0) | (dy != 0)
        path += f"M{a[0]} {b[0]}" + (_pairs("l", dx[moves], dy[moves]) or "h0")
    return path


def dots_path(x: Array, y: Array) -> str:
    """Return one path of zero-length strokes, from left to right; points that coincide are one.

    >>> dots_path(np.array([2.0, 1.0]), np.array([0.0, 1.0]))
    'M20 20h0m20-20h0'
    """
    known = np.isfinite(x) & np.isfinite(y)
    if not known.any():
        return ""
    # one number for both coordinates sorts faster than rows do
    both = np.unique(np.rint(x[known] * UNIT).astype(np.int64) * 2**32 + np.rint(y[known] * UNIT).astype(np.int64))
    a, b = (both + 2**31) >> 32, ((both + 2**31) & (2**32 - 1)) - 2**31
    return f"M{a[0]} {b[0]}h0" + _pairs("m", np.diff(a), np.diff(b), "h0")


def area_path(x: Array, low: Array, high: Array) -> str:
    """Return the outline of an area: along ``low`` and back along ``high``."""
    known = np.isfinite(x) & np.isfinite(low) & np.isfinite(high)
    x, low, high = x[known], low[known], high[known]
    return outline(np.append(x, x[::-1]), np.append(low, high[::-1])) if len(x) else ""


def outline(x: Array, y: Array) -> str:
    """Return the closed outline through pixels."""
    a, b = (np.rint(each * UNIT).astype(np.int64) for each in (x, y))
    return f"M{a[0]} {b[0]}" + _pairs("l", np.diff(a), np.diff(b)) + "z"


def rectangle(left: float, top: float, right: float, bottom: float) -> str:
    """Return the outline of a rectangle."""
    a, b, c, d = map(coordinate, (left, top, right, bottom))
    return f"M{a} {b}h{c - a}v{d - b}h{a - c}z"
