"""Intervals of a quadrature along a truth, and the responses of v and x over them."""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.compiled.jit import allocation_free_part
from mcnav.systems.ins.truth.trajectory import Truth

LONGEST_INTERVAL: Final = 0.25
"""Longest interval of the quadrature, s: a rate of 1 rad/s leaves an error of 1e-6."""

SHARE_OF_CORRELATION: Final = 0.25
"""Longest interval as a share of the shortest correlation time."""

NODE: Final = float(0.5 - np.sqrt(3.0) / 6.0)
"""First node of the Gauss method as a share of the interval; the second is one less this."""

LATER: Final = (1.0 - NODE, NODE)
"""From a node to the end of the interval, as a share of it."""

AHEAD: Final = ((0.25, 0.25 + float(np.sqrt(3.0) / 6.0)), (0.25 - float(np.sqrt(3.0) / 6.0), 0.25))
"""Weights of both nodes in an integral from a node to the end of the interval."""


def intervals_of(truth: Truth, times: Array, longest: float) -> Array:
    """Return the boundaries of intervals, at most so long, in which the truth is smooth: all times are among them."""
    first, last = np.searchsorted(truth.times, times[0], side="right"), np.searchsorted(truth.times, times[-1])
    knots = np.union1d(times, truth.times[first:last])
    gaps = np.diff(knots)
    knots = knots[np.concatenate([[True], gaps > 1e-9]) | np.isin(knots, times)]
    gaps = np.diff(knots)
    pieces = np.maximum(1, np.ceil(gaps / longest - 1e-9)).astype(np.int64)
    begins = np.repeat(knots[:-1], pieces)
    within = np.arange(len(begins)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    return np.append(begins + within * np.repeat(gaps / pieces, pieces), knots[-1])


@allocation_free_part
def advance_motion(of_v: Array, of_x: Array, gradient: Array, s: float, out_v: Array, out_x: Array) -> None:
    """Take the responses to v and to x back by a time s, in which the gravity gradient is constant (to order s^3)."""
    for r in range(6):
        for c in range(3):
            pulled = pushed = 0.0
            for m in range(3):
                pulled += of_v[r, m] * gradient[m, c]
                pushed += of_x[r, m] * gradient[m, c]
            out_v[r, c] = of_v[r, c] + s * (of_x[r, c] + s * (0.5 * pulled + s * (pushed / 6.0)))
            out_x[r, c] = of_x[r, c] + s * (pulled + 0.5 * s * pushed)
