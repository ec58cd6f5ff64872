"""The key ``quantization`` of an instrument: its size by axis, and the interval between readings."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from mcnav._types import Array
from mcnav.entries.axes import read_axes, within
from mcnav.entries.context import FileContext
from mcnav.errors import suggestion
from mcnav.systems.ins.imu.instruments import AXES, READING_INTERVAL

QUANTIZATION: Final = "quantization"

STEP: Final = np.sqrt(12.0)
"""Step in which an angle or a velocity is counted, over the sigma of the error that is even within a step."""

INTERVALS: Final = (1e-3, 1.0)
"""Shortest and longest interval between readings, s."""

EXPECTED: Final = 'expected { sigma = "1e-6 rad", interval = "0.01 s" }, or step in place of sigma'


def read_quantization(entry: object, kinds: Mapping[str, str], key: str, context: FileContext) -> tuple[Array, Array]:
    """Read the sigma of the accumulated angle or velocity, and the interval between readings, each of shape (3,).

    A quantity, or one by axis, is the sigma; a table has ``sigma`` or ``step``, and ``interval``.
    """
    sigma, interval = np.zeros(3), np.full(3, READING_INTERVAL)
    if entry is None:
        return sigma, interval
    if not isinstance(entry, dict) or entry.keys() & set(AXES):
        return read_axes(entry, kinds[f"{QUANTIZATION}.sigma"], AXES, key, context), interval
    names = ("sigma", "step", "interval")
    for name in entry.keys() - set(names):
        context.problem(f"{key}.{name}", f"unknown key{suggestion(name, list(names))}")
    sizes = [name for name in names[:2] if name in entry]
    if len(sizes) != 1:
        context.problem(key, f"got {', '.join(sorted(entry)) or 'nothing'}; {EXPECTED}")
        return sigma, interval
    for name in sizes:
        sigma = read_axes(entry[name], kinds[f"{QUANTIZATION}.{name}"], AXES, f"{key}.{name}", context)
        sigma = sigma / STEP if name == "step" else sigma
    if "interval" in entry:
        limits = within(*INTERVALS, "s", "an interval is positive")
        interval = read_axes(entry["interval"], "s", AXES, f"{key}.interval", context, READING_INTERVAL, limits)
    return sigma, interval
