"""Recorded readings at the Gauss points of a navigator's steps.

A reading is the mean over its interval. Within it, the rate is the parabola whose means over the interval, and over
those before and after it, are the three readings: with u from -1/2 to 1/2 ::

    r(u) = r_0 + (r_1 - r_-1) u / 2 + (r_1 - 2 r_0 + r_-1) (u^2 - 1/12) / 2

so that coning and sculling within an interval are not lost. Beside an interval of another duration it is constant.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.recorded import Recording
from mcnav.systems.ins.reference.collocation import NODES

SAME_DURATION: Final = 0.01
"""Relative difference up to which neighbouring intervals are equally long."""


def gauss_readings(recording: Recording, step_times: Array) -> Array:
    """Compute rates and specific forces at the Gauss points of steps, shape (S, 3, 6).

    Parameters
    ----------
    step_times : ndarray, shape (S + 1,)
        Boundaries of the steps, s after the start of the record; no step crosses the end of an interval.
    """
    ends = recording.ends
    values = np.concatenate([recording.gyro, recording.accelerometer], axis=1)
    widths = np.diff(ends, prepend=0.0)
    slope, bend = _parabola(values, widths)
    begins, durations = step_times[:-1], np.diff(step_times)
    number = np.minimum(np.searchsorted(ends, begins + 0.5 * durations), len(ends) - 1)
    within = (begins[:, None] + durations[:, None] * NODES - (ends - 0.5 * widths)[number, None]) / widths[number, None]
    u = within[..., None]
    return np.asarray(values[number, None] + slope[number, None] * u + bend[number, None] * (u * u - 1.0 / 12.0))


def _parabola(values: Array, widths: Array) -> tuple[Array, Array]:
    """Compute slopes and half second derivatives over intervals, in units of their durations, each shape (n, 6)."""
    slope, bend = np.zeros_like(values), np.zeros_like(values)
    if len(values) < 3:
        return slope, bend
    middle = widths[1:-1]
    even = np.abs(widths[:-2] - middle) <= SAME_DURATION * middle
    even &= np.abs(widths[2:] - middle) <= SAME_DURATION * middle
    before, here, after = values[:-2], values[1:-1], values[2:]
    slope[1:-1] = np.where(even[:, None], 0.5 * (after - before), 0.0)
    bend[1:-1] = np.where(even[:, None], 0.5 * (after - 2.0 * here + before), 0.0)
    return slope, bend
