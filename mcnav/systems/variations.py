"""Timelines of systems whose equations of variation are integrated as a whole.

With ``X(t) = S(t) X_0 + U(t) c`` from the start on, the transition between two times a and b is

    A = S(b) S(a)^-1,      B = U(b) - A U(a).

Where errors grow by many powers of ten, S becomes singular. There integration starts again, with S = I and U = 0.

States that each step writes, such as a largest value so far, depend on the others before it and not on themselves: they
have rows of S, and no columns.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array
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
    by_state : ndarray, shape (K + 1, n + w, n)
        S; the last w states are written by each step. What is zero at all times is zero in each transition.
    by_constant : ndarray, shape (K + 1, n + w, s + 1)
        U.
    starts_again : ndarray of bool, shape (K + 1,), optional
        Whether the solution starts again at a time, where it is that from the start before.
    """

    times: Array
    by_state: Array
    by_constant: Array
    starts_again: NDArray[np.bool_] | None = None

    def steps(self, first: int, last: int) -> Steps:
        """Return the transitions between times, by the numbers of the first and past the last."""
        before, after = slice(first, last), slice(first + 1, last + 1)
        rows, size = self.by_state.shape[1:]
        states, constants = self.by_state[before, :size], self.by_constant[before, :size]
        if self.starts_again is not None:
            again = self.starts_again[before, None, None]
            states, constants = np.where(again, np.eye(size), states), np.where(again, 0.0, constants)
        turned = np.linalg.solve(states.swapaxes(1, 2), self.by_state[after].swapaxes(1, 2))
        transitions = np.zeros((last - first, rows, rows))
        transitions[:, :, :size] = turned.swapaxes(1, 2) * self.by_state.any(axis=0)
        inputs = self.by_constant[after] - transitions[:, :, :size] @ constants
        return Steps(transitions, inputs * self.by_constant.any(axis=0))

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
