"""States between the steps of DOP853, by its interpolant of seventh order.

scipy's own evaluates one step after another in Python, which takes longer than the integration where thousands of times
are asked for, or one at a time. Results are the same bits.

Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I (1993), section II.6.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import ArrayLike

from mcnav.arrays.types import Array
from mcnav.compiled.jit import uncontracted

if TYPE_CHECKING:
    from scipy.integrate import OdeSolution  # slow to import: a tenth of a second


@dataclass(frozen=True)
class DenseOutput:
    """Continuous solution of an integration.

    Attributes
    ----------
    ts : ndarray, shape (m + 1,)
        Ends of the steps, s, in the order in which they were taken.
    begins, lengths : ndarray, shape (m,)
        Begin and length of each step, s; the last one may be longer than the solution.
    states : ndarray, shape (m, n)
        States at the begins of the steps.
    coefficients : ndarray, shape (m, 7, n)
        Of the interpolant in each step, the last factor first.
    """

    ts: Array
    begins: Array
    lengths: Array
    states: Array
    coefficients: Array

    @classmethod
    def of(cls, solution: OdeSolution) -> Self:
        """Return the continuous solution that scipy's `solve_ivp` has found with DOP853."""
        steps = solution.interpolants
        begins, ends = np.array([[step.t_old, step.t] for step in steps], dtype=float).T
        if hasattr(steps[0], "F"):
            states = np.array([step.y_old for step in steps])
            coefficients = np.array([step.F[::-1] for step in steps])
        else:  # a span of no length
            states, ends = np.array([steps[0].value]), begins + 1.0
            coefficients = np.zeros((1, 1, states.shape[1]))
        return cls(np.asarray(solution.ts, dtype=float), begins, ends - begins, states, coefficients)

    def __call__(self, times: ArrayLike) -> Array:
        """Evaluate the state at a time, shape (n,), or at many in any order (s), shape (n, times).

        At the end of a step the state is that of this step; before the first step and after the last one, the
        interpolants of these are continued.
        """
        asked = np.asarray(times, dtype=float)
        result = np.empty((asked.size, self.states.shape[1]))
        _interpolate(asked.reshape(-1), self.ts, self.begins, self.lengths, self.states, self.coefficients, result)
        return result[0] if asked.ndim == 0 else result.T


@uncontracted
def _interpolate(
    times: Array, ts: Array, begins: Array, lengths: Array, states: Array, coefficients: Array, result: Array
) -> None:
    """Evaluate the nested products ``(... (c_0 x + c_1) (1 - x) + c_2) x ...`` of each time's step."""
    rising = ts[-1] >= ts[0]
    for row in range(len(times)):
        time = times[row]
        step, last = 0, len(begins) - 1
        while step < last:  # the last one that begins before the time
            middle = (step + last + 1) // 2
            if ts[middle] < time if rising else ts[middle] > time:
                step = middle
            else:
                last = middle - 1
        within = (time - begins[step]) / lengths[step]
        for column in range(states.shape[1]):
            value = 0.0
            for number in range(coefficients.shape[1]):
                value += coefficients[step, number, column]
                value *= within if number % 2 == 0 else 1.0 - within
            result[row, column] = value + states[step, column]
