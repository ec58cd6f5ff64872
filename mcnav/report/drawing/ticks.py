"""Ticks of axes, their labels, and places of labels at which none covers another."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.report.format import SUPERSCRIPTS

GAP: Final = 8.0
"""Least room between two labels of an axis, px."""

WIDTHS: Final = {**dict.fromkeys("iljI.,:;'|!", 0.32), **dict.fromkeys("ftr ()[]/·-", 0.42),
                 **dict.fromkeys("mwMW@%", 0.95), **dict.fromkeys("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", 0.45)}  # fmt: skip
"""Width of characters over the font's size, as in DejaVu Sans, the widest of the fonts that pages ask for."""

ROUNDING: Final = 1e-10
"""Span of values over their size up to which they are one value: an altitude of 500 m that is computed from positions
on the earth moves by 1e-11 of itself, and no figure can show less."""

Box = tuple[float, float, float, float]
"""Left, top, right and bottom of a rectangle, px."""

NEAR: Final = 4.0
"""Distance of a label from its point, in px."""


def text_width(text: str, size: float) -> float:
    """Estimate the width of a text of some size, px; never less than it is."""
    return size * sum(WIDTHS.get(letter, 0.7 if letter.isupper() else 0.64) for letter in text)


def linear_ticks(low: float, high: float, most: int) -> tuple[list[float], float]:
    """Return ticks at multiples of 1, 2, 2.5 or 5 times a power of ten within limits, and their step.

    >>> linear_ticks(-0.3, 1.1, 5)
    ([0.0, 0.5, 1.0], 0.5)
    """
    span = high - low
    power = 10.0 ** math.floor(math.log10(span / most))
    step = next(factor * power for factor in (1.0, 2.0, 2.5, 5.0, 10.0) if span <= most * factor * power * (1.0 + 1e-9))
    first, last = math.ceil(low / step - 1e-6), math.floor(high / step + 1e-6)
    digits = max(0, 1 - math.floor(math.log10(step)))
    return [round(k * step, digits) + 0.0 for k in range(first, last + 1)], step


def log_ticks(low: float, high: float, most: int) -> list[float]:
    """Return ticks at powers of ten, at 1, 2 and 5 times them where few, or at multiples where there are hardly any.

    >>> log_ticks(0.5, 2000.0, 6), log_ticks(90.0, 600.0, 6)
    ([1.0, 10.0, 100.0, 1000.0], [100.0, 200.0, 500.0])
    """
    first, last = math.ceil(math.log10(low) - 1e-9), math.floor(math.log10(high) + 1e-9)
    finer = [
        factor * 10.0**power
        for power in range(first - 1, last + 1)
        for factor in (1.0, 2.0, 5.0)
        if low * (1.0 - 1e-9) <= factor * 10.0**power <= high * (1.0 + 1e-9)
    ]
    if len(finer) < 3:
        return [tick for tick in linear_ticks(low, high, most)[0] if tick > 0.0]
    if len(finer) <= most:
        return finer
    stride = max(1, math.ceil((last - first + 1) / most))
    return [10.0**power for power in range(first, last + 1, stride)]


def labelled(ticks: Sequence[float], step: float) -> list[str]:
    """Write ticks with as many decimals as their step needs, or with powers of ten where they are very large or small.

    >>> labelled([-1000.0, 0.0, 1000.0], 1000.0), labelled([0.0, 2e-7], 1e-7)
    (['−1,000', '0', '1,000'], ['0', '2·10⁻⁷'])
    """
    largest = max(map(abs, ticks), default=0.0)
    exponent = math.floor(math.log10(largest)) if largest > 0.0 else 0
    power = exponent if exponent >= 7 or step < 1e-5 else 0
    decimals = next((d for d in range(12) if abs(round(unit := step / 10.0**power, d) - unit) < 1e-6 * unit), 12)
    shown = [f"{tick / 10.0**power:,.{decimals}f}".replace("-", "−") for tick in ticks]
    if power:
        shown = ["0" if tick == 0.0 else f"{text}·10{str(power).translate(SUPERSCRIPTS)}"
                for tick, text in zip(ticks, shown, strict=True)]  # fmt: skip
    return shown


def log_label(tick: float) -> str:
    """Write a tick of a logarithmic axis.

    >>> log_label(0.05), log_label(20000.0), log_label(1e-7)
    ('0.05', '20,000', '10⁻⁷')
    """
    if 1e-4 < tick < 1e7:
        return f"{tick:,.6g}" if tick >= 1e-4 else f"{tick:g}"
    exponent = math.floor(math.log10(tick) + 1e-9)
    mantissa = tick / 10.0**exponent
    power = f"10{str(exponent).translate(SUPERSCRIPTS)}"
    return power if abs(mantissa - 1.0) < 1e-6 else f"{mantissa:.3g}·{power}"


def ticks_along(
    low: float, high: float, log: bool, room: float, extent: Callable[[str], float], most: int = 8
) -> tuple[list[float], list[str]]:
    """Return the most ticks, with their labels, whose labels have room beside each other.

    ``room`` is the length of the axis, ``extent`` how much of it a label takes, px.
    """
    for number in range(most, 0, -1):
        if log:
            ticks = log_ticks(low, high, number)
            labels = [log_label(tick) for tick in ticks]
            places = [math.log(tick / low) / math.log(high / low) * room for tick in ticks]
        else:
            ticks, step = linear_ticks(low, high, number)
            labels = labelled(ticks, step)
            places = [(tick - low) / (high - low) * room for tick in ticks]
        ends = [
            (place - 0.5 * extent(label), place + 0.5 * extent(label))
            for place, label in zip(places, labels, strict=True)
        ]
        if all(left[1] + GAP <= right[0] for left, right in pairwise(ends)):
            break
    return ticks, labels


def limits(values: Array, log: bool, margin: float) -> tuple[float, float]:
    """Return limits around the finite values with a margin, a share of their span; never of no length."""
    known = values[np.isfinite(values) & ((values > 0.0) | (not log))]
    if not known.size:
        return (1.0, 10.0) if log else (0.0, 1.0)
    low, high = float(known.min()), float(known.max())
    if log:
        low, high = math.log10(low), math.log10(high)
    if high - low <= ROUNDING * max(abs(low), abs(high)):
        room = 0.5 if log else 0.05 * abs(low) or 1.0
        low, high = low - room, high + room
    else:
        low, high = low - margin * (high - low), high + margin * (high - low)
    return (10.0**low, 10.0**high) if log else (low, high)


def overlap(a: Box, b: Box) -> bool:
    """Return whether two rectangles share more than an edge."""
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def points_in(box: Box, points: Array) -> int:
    """Count the points, shape (n, 2), within a rectangle."""
    x, y = points[:, 0], points[:, 1]
    return int(((x > box[0]) & (x < box[2]) & (y > box[1]) & (y < box[3])).sum())


def place_label(
    x: float, y: float, width: float, height: float, bounds: Box, taken: Sequence[Box], points: Array
) -> Box | None:
    """Find a place for a label beside a point, within a rectangle and over none that is taken; none without room.

    The place that hides the fewest points, shape (n, 2), is preferred.
    """
    label: tuple[int, int, Box] | None = None
    for rank, (across, up) in enumerate(
        ((1, 1), (1, -1), (-1, 1), (-1, -1), (1, 0), (-1, 0), (0, 1), (0, -1), (2, 2), (-2, 2), (2, -2), (-2, -2))
    ):
        left = x + across * NEAR if across > 0 else x - width + across * NEAR if across < 0 else x - 0.5 * width
        top = y - height - up * NEAR + NEAR if up > 0 else y - up * NEAR - NEAR if up < 0 else y - 0.5 * height
        if across == 0:
            top -= up * NEAR
        box = (left, top, left + width, top + height)
        if box[0] < bounds[0] or box[1] < bounds[1] or box[2] > bounds[2] or box[3] > bounds[3]:
            continue
        if any(overlap(box, other) for other in taken):
            continue
        hidden = points_in(box, points)
        if label is None or (hidden, rank) < label[:2]:
            label = (hidden, rank, box)
    return None if label is None else label[2]
