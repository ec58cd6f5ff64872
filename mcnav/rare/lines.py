"""Entries of lines into the event: all lines together, one flight of each at a time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array, IndexArray
from mcnav.rare.flights import NoisyMargins

CLOSE: Final = 0.03
"""Last step of the secant method, times t, where the step before was no longer than `NEAR`."""

NEAR: Final = 0.1
"""Step from which the last one must be smaller in proportion: a secant errs by their product times f'' / 2 f'."""

NARROW: Final = 0.002
"""Width of a bracket, times t, at which a jump is located: its middle moves Phi(-t) by 0.1 % at most."""

THERE: Final = 1e-4
"""Margin over the expected slope, times t, at which a line is at its crossing."""

APART: Final = 4.0
"""Distance of two points from which their secant says nothing, such as of a margin that rises exponentially."""

MOST_STEPS: Final = 24
SECANTS: Final = 5
"""Steps after which brackets are halved."""


@dataclass(frozen=True)
class Crossings:
    """Entries of lines into the event, shape (n,).

    Attributes
    ----------
    at : ndarray
        t of the crossing; infinite for a line that does not enter before its end.
    flights : int
    """

    at: Array
    flights: int


@dataclass
class _Search:
    """State of the search along each line: brackets and the last two points with their margins, shape (n,)."""

    low: Array
    high: Array
    last: Array
    before: Array
    last_margin: Array
    before_margin: Array


def crossings(
    margins: NoisyMargins, noise: IndexArray, feet: Array, directions: Array, guesses: Array, slopes: Array,
    begins: Array, ends: Array,
) -> Crossings:  # fmt: skip
    """Find where lines ``w + t alpha`` enter the event, by the secant method within brackets.

    Parameters
    ----------
    margins : callable
    noise : ndarray of int, shape (n,)
        Number of the noise of each line.
    feet, directions : ndarray, shape (n, d)
        w and alpha.
    guesses, slopes, begins, ends : ndarray, shape (n,)
        First t, expected slope of the margin, and the part of the line that counts. A line whose begin is beyond its
        limit enters there.
    """
    number = len(feet)
    at, flights = np.full(number, np.inf), 0
    now = np.clip(guesses, begins, ends)
    state = _Search(
        begins.copy(), ends.copy(), now.copy(), now.copy(), np.full(number, np.nan), np.full(number, np.nan)
    )
    below, above = np.zeros(number, dtype=bool), np.zeros(number, dtype=bool)
    active = np.flatnonzero(begins < ends)
    for step in range(MOST_STEPS):
        if not len(active):
            break
        t = now[active]
        margin = margins(feet[active] + t[:, None] * directions[active], noise[active])
        flights += len(active)
        state.before[active], state.before_margin[active] = state.last[active], state.last_margin[active]
        state.last[active], state.last_margin[active] = t, margin
        beyond = ~(margin <= 0.0)
        state.high[active] = np.where(beyond, t, state.high[active])
        state.low[active] = np.where(beyond, state.low[active], t)
        above[active] |= beyond
        below[active] |= ~beyond
        at_begin, at_end = beyond & (t <= begins[active]), ~beyond & (t >= ends[active])
        at[active[at_begin]] = begins[active[at_begin]]
        following, shift = _next(state, active, slopes, below, above, step)
        gap = np.abs(t - state.before[active])
        near = (shift * np.maximum(t, 1.0) * np.maximum(gap, NEAR) < CLOSE * NEAR) & (gap < APART)
        width = (state.high - state.low)[active] * np.maximum(t, 1.0)
        closed = below[active] & above[active] & (width < NARROW)
        there = np.abs(margin) * np.maximum(t, 1.0) < THERE * slopes[active]
        settled = ~at_begin & ~at_end & (closed | there | near)
        at[active[settled]] = np.where(there, t, np.where(closed, 0.5 * (state.low + state.high)[active], following))[
            settled
        ]
        rest = ~(at_begin | at_end | settled)
        now[active] = following
        active = active[rest]
    at[active] = np.where(above[active], 0.5 * (state.low + state.high)[active], np.inf)
    return Crossings(at, flights)


def _next(
    state: _Search, active: IndexArray, slopes: Array, below: NDArray[np.bool_], above: NDArray[np.bool_], step: int
) -> tuple[Array, Array]:
    """Return the next t of each active line, and how far the secant would go, infinite where it is not used."""
    t, margin = state.last[active], state.last_margin[active]
    with np.errstate(divide="ignore", invalid="ignore"):
        secant = (margin - state.before_margin[active]) / (t - state.before[active])
    slope = slopes[active] if step == 0 else secant
    known = np.isfinite(slope) & (slope > 0.0) & np.isfinite(margin)
    target = t - margin / np.where(known, slope, 1.0)
    low, high = state.low[active], state.high[active]
    both = below[active] & above[active]
    outside = ~known | (both & ((target <= low) | (target >= high))) | (both & (step > SECANTS))
    halfway = 0.5 * (low + high)
    # without a bracket: where the slope does not tell, the end that could close it
    other_end = np.where(margin <= 0.0, high, low)
    following = np.where(outside, np.where(both, halfway, other_end), np.clip(target, low, high))
    shift = np.where(outside | (following == low) | (following == high), np.inf, np.abs(following - t))
    return following, shift if step > 0 else np.full(len(t), np.inf)
