"""Runge-Kutta in numpy: samples are columns, all of them flown over the same steps.

The steps are those that scipy's DOP853 chooses for the truth with a sample that has one sigma of every error, taken
over as they are (DOP853, whose knob is the tolerance of that flight) or cut into equal pieces (RK4, whose knob is their
number). The truth is flown beside the columns, once for all of them.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
import scipy.integrate

from tests.benchmarks.case import Case, outcomes
from tests.benchmarks.equations import joint_rates
from tests.benchmarks.peer import Fly, Peer

COLUMNS = 4_096
"""Samples flown side by side: enough to hide the interpreter, few enough for the cache."""

RK4_STEPS = 1e-6
"""Tolerance of the flight whose steps RK4 cuts into pieces."""

rates = joint_rates(np)


class Tableau(NamedTuple):
    """An explicit method: matrix, weights and nodes."""

    matrix: np.ndarray
    weights: np.ndarray
    nodes: np.ndarray


EIGHTH_ORDER = Tableau(
    scipy.integrate.DOP853.A[: scipy.integrate.DOP853.n_stages, : scipy.integrate.DOP853.n_stages],
    scipy.integrate.DOP853.B,
    scipy.integrate.DOP853.C[: scipy.integrate.DOP853.n_stages],
)
CLASSICAL = Tableau(
    np.array([[0, 0, 0, 0], [0.5, 0, 0, 0], [0, 0.5, 0, 0], [0, 0, 1, 0]]),
    np.array([1, 2, 2, 1]) / 6,
    np.array([0, 0.5, 0.5, 1]),
)


def _steps(case: Case, tolerance: float) -> list[np.ndarray]:
    """Ends of the steps, stretch by stretch."""
    start, errors = case.started(case.one_sigma[None, :])

    def right_side(time: float, state: np.ndarray, phase: np.ndarray) -> np.ndarray:
        return np.concatenate(rates(time, state[:4], state[4:], phase, errors[:, 0]))

    actual, indicated, found = case.truths[0], start[:, 0], []
    for stretch, (span, phase) in enumerate(zip(zip(case.begins, case.ends, strict=True), case.phases, strict=True)):
        state = np.concatenate(case.onto_truth(stretch, actual, indicated))
        flown = scipy.integrate.solve_ivp(
            right_side, span, state, method="DOP853", rtol=tolerance, atol=tolerance, args=(phase,)
        )
        found.append(flown.t)
        actual, indicated = flown.y[:4, -1], flown.y[4:, -1]
    return found


def _cut(ends: np.ndarray, pieces: int) -> np.ndarray:
    """Steps cut into equal pieces."""
    return np.append(np.linspace(ends[:-1], ends[1:], pieces, endpoint=False).T.ravel(), ends[-1])


def _fly_columns(case: Case, steps: list[np.ndarray], method: Tableau, draws: np.ndarray) -> np.ndarray:
    indicated, errors = case.started(draws)
    actual = case.truths[0]
    stages = len(method.weights)
    of_actual, of_indicated = np.empty((stages, 4)), np.empty((stages, 4, len(draws)))
    flat = of_indicated.reshape(stages, -1)
    for stretch, ends in enumerate(steps):
        actual, indicated = case.onto_truth(stretch, actual, indicated)
        for begin, end in pairwise(ends):
            step = end - begin
            for stage in range(stages):
                weights = step * method.matrix[stage, :stage]
                there = actual + weights @ of_actual[:stage]
                here = indicated + (weights @ flat[:stage]).reshape(indicated.shape) if stage else indicated
                time = begin + method.nodes[stage] * step
                of_actual[stage], change = rates(time, there, here, case.phases[stretch], errors)
                for row in range(4):
                    of_indicated[stage, row] = change[row]
            actual = actual + step * method.weights @ of_actual
            indicated = indicated + (step * method.weights @ flat).reshape(indicated.shape)
    return outcomes(actual, indicated)


def prepare_eighth_order(case: Case, tolerance: float, cores: int) -> Fly:
    """DOP853 over the steps of a flight at a tolerance."""
    steps = _steps(case, tolerance)
    return lambda draws: _fly_columns(case, steps, EIGHTH_ORDER, draws)


def prepare_classical(case: Case, pieces: float, cores: int) -> Fly:
    """The classical method of order four."""
    steps = [_cut(ends, int(pieces)) for ends in _steps(case, RK4_STEPS)]
    return lambda draws: _fly_columns(case, steps, CLASSICAL, draws)


DOP853 = Peer(
    prepare_eighth_order, "tolerance of the steps", (1e-6, 1e-7, 1e-8, 1e-9, 1e-10), COLUMNS, "processes", COLUMNS // 4
)
RK4 = Peer(prepare_classical, "pieces of a step", (4, 8, 16, 32), COLUMNS, "processes", COLUMNS // 4)
