"""numbalsoda's DOP853, called from compiled code: no interpreter between one draw and the next.

The truth is integrated with the indicated state. Its one absolute tolerance is why the units of a `Case` make every
component of the order of one.
"""

from __future__ import annotations

import numba
import numpy as np
from numbalsoda import dop853, lsoda_sig

from tests.benchmarks.case import Case, outcomes
from tests.benchmarks.equations import joint_rates
from tests.benchmarks.peer import Fly, Peer

rates = numba.njit(joint_rates(np))


@numba.cfunc(lsoda_sig)
def right_side(time, state, change, constants):  # type: ignore[no-untyped-def]
    """Rates of actual and indicated state, from pointers: 8 numbers, 8 numbers, and 8 and 6 constants."""
    actual = (state[0], state[1], state[2], state[3])
    indicated = (state[4], state[5], state[6], state[7])
    phase = (
        constants[0], constants[1], constants[2], constants[3], constants[4], constants[5], constants[6], constants[7],
    )  # fmt: skip
    errors = (constants[8], constants[9], constants[10], constants[11], constants[12], constants[13])
    of_actual, of_indicated = rates(time, actual, indicated, phase, errors)
    for row in range(4):
        change[row] = of_actual[row]
        change[4 + row] = of_indicated[row]


ADDRESS = right_side.address


@numba.njit(nogil=True)
def fly_all(
    address: int,
    tolerance: float,
    spans: np.ndarray,
    truths: np.ndarray,
    phases: np.ndarray,
    starts: np.ndarray,
    errors: np.ndarray,
) -> np.ndarray:
    """States at the end, shape (8, n), of indicated starts, shape (4, n), and equipment errors, shape (6, n)."""
    last = np.empty((8, starts.shape[1]))
    state, constants = np.empty(8), np.empty(14)
    for draw in range(starts.shape[1]):
        state[:4], state[4:] = truths[0], starts[:, draw]
        constants[8:] = errors[:, draw]
        for stretch in range(len(spans)):
            drift = truths[stretch] - state[:4]
            state[:4] += drift
            state[4:] += drift
            constants[:8] = phases[stretch]
            flown, done = dop853(address, state, spans[stretch], constants, tolerance, tolerance, 100_000)
            state[:] = flown[-1]
            if not done:
                state[:] = np.nan
        last[:, draw] = state
    return last


def prepare(case: Case, tolerance: float, cores: int) -> Fly:
    """Everything in one compiled loop."""
    spans = np.stack([case.begins, case.ends], axis=1)

    def fly(draws: np.ndarray) -> np.ndarray:
        last = fly_all(ADDRESS, tolerance, spans, case.truths, case.phases, *case.started(draws))
        return outcomes(last[:4], last[4:])

    return fly


PEER = Peer(prepare, "relative tolerance", (1e-6, 1e-7, 1e-8, 1e-10, 1e-12), 128, "threads")
