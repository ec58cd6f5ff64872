"""Readings that are low-passed: their noise falls towards half the sampling rate, where white noise stays level."""

from __future__ import annotations

from itertools import pairwise
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.recorded import Recording

SEGMENT: Final = 256
"""Readings of which each periodogram is; at least `FEWEST` of them, which overlap by half, are averaged."""

FEWEST: Final = 16

BANDS: Final = (0.15, 0.3, 0.5, 0.7, 0.85, 1.0)
"""Ends of bands whose mean densities are compared, as shares of half the sampling rate: motion is below them."""

FALLS: Final = 2.0
"""Ratio of the densities of the first and the last band from which readings are low-passed.

Of white noise each band's mean has a spread of 7 % in `FEWEST` segments, and less in more.
"""

RISE: Final = 1.25
"""Ratio of the densities of a band and the one before that is more than the spread of both."""


def low_pass_remarks(recording: Recording) -> tuple[str, ...]:
    """Say which readings are low-passed, a line each, without a full stop."""
    half = 0.5 / float(np.median(np.diff(recording.ends)))
    instruments = {"gyro": recording.gyro, "accelerometer": recording.accelerometer}
    falls = {name: density_fall(readings) for name, readings in instruments.items()}
    low, high = (0.5 * half * (begin + end) for begin, end in (BANDS[:2], BANDS[-2:]))
    return tuple(
        f"{name} readings are low-passed: their density falls by a factor of {fall:.2g} from {low:.3g} to "
        f"{high:.3g} Hz. A filter makes readings late, which judge names as an early sensor"
        for name, fall in falls.items() if fall > FALLS
    )  # fmt: skip


def density_fall(readings: Array) -> float:
    """Return by which factor the density of readings, shape (n, 3), falls from the first band to the last one.

    The least of the axes; one where the density of any of them rises between bands by more than `RISE`: a vibration
    does.
    """
    starts = np.arange(0, len(readings) - SEGMENT + 1, SEGMENT // 2)
    if len(starts) < FEWEST:
        return 1.0
    segments = readings[starts[:, None] + np.arange(SEGMENT)]
    segments = (segments - segments.mean(axis=1, keepdims=True)) * np.hanning(SEGMENT)[:, None]
    density = np.mean(np.abs(np.fft.rfft(segments, axis=1)) ** 2, axis=0)
    shares = np.linspace(0.0, 1.0, len(density))
    bands = [(shares >= low) & (shares <= high) for low, high in pairwise(BANDS)]
    levels = np.array([density[band].mean(axis=0) for band in bands])
    if np.any(levels[1:] > RISE * levels[:-1]):
        return 1.0
    return float(np.min(levels[0] / levels[-1]))
