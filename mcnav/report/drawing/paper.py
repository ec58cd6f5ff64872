"""Sizes of figures for papers."""

from __future__ import annotations

import re
from typing import Final

CENTIMETRES: Final = {"mm": 0.1, "cm": 1.0, "in": 2.54}
"""Units of lengths, cm."""

LIMITS: Final = (2.0, 100.0)
"""Smallest and largest width and height, cm."""

_SIZE: Final = re.compile(r"(\d+(?:\.\d+)?)\s*[x×]\s*(\d+(?:\.\d+)?)\s*(mm|cm|in)")


def read_size(text: str) -> tuple[float, float]:
    """Read width and height such as ``88x60mm``, cm.

    Raises `ValueError` when it is none, or too small or large.

    >>> read_size("88x60mm"), read_size("3.5 x 2 in")
    ((8.8, 6.0), (8.89, 5.08))
    """
    size = _SIZE.fullmatch(text.strip())
    if size is None:
        raise ValueError(f"got {text!r:.60}; expected WIDTHxHEIGHT and a unit (mm, cm or in), such as 88x60mm")
    factor = CENTIMETRES[size[3]]
    width, height = (round(float(group) * factor, 6) for group in size.groups()[:2])
    if not (LIMITS[0] <= min(width, height) and max(width, height) <= LIMITS[1]):
        raise ValueError(f"got {text!r:.60}; expected lengths from {10.0 * LIMITS[0]:g} to {10.0 * LIMITS[1]:,g} mm")
    return width, height
