"""scipy's `solve_ivp`, draw by draw, joblib sharing the draws among processes.

The truth is integrated with the indicated state, as most would do it; DOP853 restarts where the constants of the
equations change. Its rates are compiled with numba: what is left is what `solve_ivp` itself costs.
"""

from __future__ import annotations

import numba
import numpy as np
from scipy.integrate import DOP853, solve_ivp

from tests.benchmarks.case import Case, outcomes
from tests.benchmarks.equations import joint_rates
from tests.benchmarks.peer import Fly, Peer

rates = numba.njit(cache=True)(joint_rates(np))


@numba.njit(cache=True)
def right_side(time: float, state: np.ndarray, phase: np.ndarray, errors: np.ndarray) -> np.ndarray:
    """Rates of actual and indicated state, shape (8,)."""
    actual, indicated = rates(time, state[:4], state[4:], phase, errors)
    return np.array((*actual, *indicated))


def fly_one(case: Case, tolerance: float, start: np.ndarray, errors: np.ndarray) -> np.ndarray:
    """State at the end, shape (8,), of one draw's indicated start, shape (4,), and equipment errors, shape (6,)."""
    actual, indicated = case.truths[0], start
    for stretch, (begin, end, phase) in enumerate(zip(case.begins, case.ends, case.phases, strict=True)):
        state = np.concatenate(case.onto_truth(stretch, actual, indicated))
        flown = solve_ivp(
            right_side, (begin, end), state, method=DOP853, rtol=tolerance, atol=tolerance, args=(phase, errors)
        )
        if flown.status != 0:
            raise ArithmeticError(flown.message)
        actual, indicated = flown.y[:4, -1], flown.y[4:, -1]
    return np.concatenate([actual, indicated])


def prepare(case: Case, tolerance: float, cores: int) -> Fly:
    """One draw after the other."""

    def fly(draws: np.ndarray) -> np.ndarray:
        starts, errors = case.started(draws)
        pairs = zip(starts.T, np.ascontiguousarray(errors.T), strict=True)
        last = np.array([fly_one(case, tolerance, *pair) for pair in pairs]).T
        return outcomes(last[:4], last[4:])

    return fly


PEER = Peer(prepare, "relative tolerance", (1e-6, 1e-7, 1e-8, 1e-10, 1e-12), 32, "processes")
