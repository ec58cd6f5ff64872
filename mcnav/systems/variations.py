"""Timelines of systems whose equations of variation are integrated as a whole.

With ``X(t) = S(t) X_0 + U(t) c`` from the start on, the transition between two times a and b is

    A = S(b) S(a)^-1,      B = U(b) - A U(a).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav._types import Array
from mcnav.contract.errors import ScenarioError
from mcnav.contract.timeline import Instants, Start, Steps, Timeline

ROUNDING: Final = 1e-6
"""Time, s, by which the end of a flight may be missed that someone has read off a table."""


@dataclass(frozen=True)
class Variations:
    """The solution of equations of variation at rising times, K + 1 of them, the first that of the start.

    Attributes
    ----------
    times : ndarray, shape (K + 1,)
        s.
    by_state : ndarray, shape (K + 1, n, n)
        S.
    by_constant : ndarray, shape (K + 1, n, s + 1)
        U.
    """

    times: Array
    by_state: Array
    by_constant: Array

    def steps(self, first: int, last: int) -> Steps:
        """Return the transitions between times, by the numbers of the first and past the last."""
        before, after = slice(first, last), slice(first + 1, last + 1)
        turned = np.linalg.solve(self.by_state[before].swapaxes(1, 2), self.by_state[after].swapaxes(1, 2))
        transitions = np.asarray(turned.swapaxes(1, 2), dtype=float)
        return Steps(transitions, self.by_constant[after] - transitions @ self.by_constant[before])

    def timeline(
        self,
        start: Start,
        readout: Callable[[int, float], Array],
        begin: Callable[[int], Start] | None = None,
        refined: Callable[[Array], Timeline] | None = None,
    ) -> Timeline:
        """Return the timeline whose instants are the times; arguments as those of `Timeline`."""
        places = np.arange(len(self.times))
        return Timeline(
            start, np.zeros(len(self.times) - 1, dtype=np.bool_), self.steps, Instants(self.times, places, places),
            readout, begin=begin, refined=refined,
        )  # fmt: skip


def check_span(times: Array, first: float, last: float, clock: str = "") -> None:
    """Raise `ScenarioError` for the first of some times, s, that is outside of navigation, by more than rounding."""
    outside = times[(times < first - ROUNDING) | (times > last + ROUNDING)]
    if len(outside):
        raise ScenarioError("at", f"got {outside[0]:.10g} s{clock}; navigation is from {first:.10g} s to {last:.10g} s")
