"""Partial derivatives of the final errors by simulation: one error at a time, and from independent error sets.

The third method, the variational equations, belongs to a scenario (`Scenario.linear_model`). The three methods share
only the physics; `compare_partials` computes how well they agree.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.engine import Engine, HistoryEngine, without_noise
from mcnav.contract.errors import SimulationFailed as SimulationFailed
from mcnav.contract.members import ready_engine
from mcnav.contract.samples import SimulationResult
from mcnav.contract.scenario import Scenario
from mcnav.execution.stopping import check_stopped

Propagate = Callable[[Array], SimulationResult]
"""Simulation of errors, shape (n, sources), SI."""

STEP: Final = 1e-3
"""Step of the differences, as a share of each source's nominal size: the third-order term, the error of a central
difference, falls with its square, while the engines resolve errors a million times smaller."""

HISTORY_STEP: Final = 2e-2
"""Step for histories: their errors are differences of positions, rounded to 1e-9 m, which the inverse of S amplifies up
to a million times where the ten runs are nearly alike. The third-order term is eliminated by extrapolation."""

RUNS_SEED: Final = 1963

QUICK: Final = 1_024
"""Smallest chunk of an engine that is fast enough for thousands of further simulations."""

FAST: Final = 8_192
"""Smallest chunk of an engine that takes no notice of tens of thousands."""

AT_ONCE: Final = 16_384
"""Samples that an engine is given at once: what it computes of 200 sources takes 30 MB an array."""

REDUCTION: Final = 8
"""Number by which the flights on the side are divided for an engine that is quick but not fast."""


def require_fast(engine: Engine) -> None:
    """Raise `SimulationFailed` for an engine that is too slow for thousands of further simulations."""
    if engine.chunk < QUICK:
        raise SimulationFailed("the engine is too slow for so many flights on the side")


def affordable(flights: int, engine: Engine) -> int:
    """Return how many of so many flights on the side an engine simulates without being waited for."""
    return flights if engine.chunk >= FAST else max(flights // REDUCTION, 1)


def simulate_or_raise(propagate: Propagate, errors: Array) -> Array:
    """Simulate samples that must all succeed, shape (n, outputs); `SimulationFailed` names the first that does not."""
    values = []
    for begin in range(0, max(len(errors), 1), AT_ONCE):
        check_stopped()
        outcomes = propagate(errors[begin : begin + AT_ONCE])
        for row, reason in outcomes.failures.items():
            flight = f"flight {begin + row + 1} of {len(errors)}"
            raise SimulationFailed(f"{flight} for the partial derivatives failed: {reason}")
        values.append(outcomes.values)
    return np.concatenate(values) if len(values) > 1 else values[0]


def partials_by_differences(propagate: Propagate, sizes: Array) -> Array:
    """Compute P by central differences, one error at a time as NASA TN D-1772's ten runs, shape (outputs, sources).

    Each error is displaced by the share `STEP` of its nominal size, shape (sources,), SI, to either side. Raises
    `SimulationFailed` when a sample fails.
    """
    steps = STEP * sizes
    up, down = np.split(simulate_or_raise(propagate, np.vstack([np.diag(steps), -np.diag(steps)])), 2)
    return np.asarray(((up - down) / (2.0 * steps[:, None])).T)


def partials_from_runs(start_errors: Array, final_errors: Array) -> Array:
    """Compute P = F S^-1 (NASA TN D-1772, eqs. 14-16), shape (outputs, sources).

    S has one independent set of start errors a column, shape (sources, runs), and F the final errors of the same runs,
    shape (outputs, runs).
    """
    if start_errors.shape[0] != start_errors.shape[1] or final_errors.shape[1] != start_errors.shape[1]:
        raise ValueError(
            "F S^-1 needs as many runs as sources, and the same runs in both matrices. Got start errors of shape "
            f"{start_errors.shape} and final errors of shape {final_errors.shape}"
        )
    return np.asarray(np.linalg.solve(start_errors.T, final_errors.T).T)


def partials_by_independent_sets(propagate: Propagate, sizes: Array) -> Array:
    """Compute P = F S^-1 from independent error sets in which all sources act at once, shape (outputs, sources).

    The sets are the columns of a random orthogonal matrix, scaled to the nominal sizes. Each is simulated with both
    signs and F is half the difference, so that the second-order term that one-sided runs leave in eq. (16) cancels.
    Raises `SimulationFailed` when a sample fails.
    """
    sets = STEP * _orthogonal(len(sizes))
    plus, minus = np.split(simulate_or_raise(propagate, np.vstack([sets.T * sizes, -sets.T * sizes])), 2)
    # solved for the scaled sources, whose matrix is orthogonal: metres beside microradians would cost digits
    return np.asarray(partials_from_runs(sets, 0.5 * (plus - minus).T) / sizes)


def partials_at_later_starts(histories: Callable[[Array], tuple[Array, Array]], sizes: Array) -> Array:
    """Compute P for every later start time from the histories of one set of runs, shape (times, outputs, sources).

    The errors at an instant are the start errors of navigation begun there (NASA TN D-1772, eqs. 14-16). Each set is
    simulated with both signs, as in `partials_by_independent_sets`, and with the steps `HISTORY_STEP` and twice that,
    which eliminates the error of second order in the step.

    Parameters
    ----------
    histories : callable
        Errors, shape (n, sources), to the error sets in force at each start time, shape (times, n, sources), and the
        final errors, shape (n, outputs).
    sizes : ndarray, shape (sources,)
        Nominal size of each error.
    """

    def estimate(step: float) -> Array:
        runs = step * _orthogonal(len(sizes)).T * sizes
        sets, final = histories(np.vstack([runs, -runs]))
        (plus, minus), (end_plus, end_minus) = np.split(sets, 2, axis=1), np.split(final, 2)
        outcome = 0.5 * (end_plus - end_minus).T
        return np.array([partials_from_runs(start.T, outcome) / sizes for start in 0.5 * (plus - minus) / sizes])

    return np.asarray((4.0 * estimate(HISTORY_STEP) - estimate(2.0 * HISTORY_STEP)) / 3.0)


def _orthogonal(count: int) -> Array:
    """Return a random orthogonal matrix, always the same."""
    return np.asarray(np.linalg.qr(np.random.default_rng(RUNS_SEED).standard_normal((count, count)))[0])


def partials_throughout(engine: HistoryEngine, sizes: Array) -> tuple[Array, Array]:
    """Compute P at m epochs, shape (m, outputs, sources), and the nominal errors, shape (m, outputs).

    P is by central differences of histories; see `partials_by_differences`.
    """
    steps = STEP * sizes
    errors = engine.histories(np.concatenate([np.diag(steps), -np.diag(steps), np.zeros((1, len(steps)))]))
    up, down = np.split(errors[:-1], 2)
    return np.asarray(((up - down) / (2.0 * steps[:, None, None])).transpose(1, 2, 0)), errors[-1]


def partials_by(scenario: Scenario, method: str) -> Array:
    """Compute partial derivatives, shape (outputs, sources), SI, by one of three methods.

    These are ``variational``, the equations of variation along the truth; ``differences``, one error at a time on the
    ensemble engine; and ``runs``, F S^-1 from independent error sets on the reference engine.
    """
    if method == "variational":
        return scenario.linear().end.partials
    sizes = np.array([source.nominal for source in scenario.sources])
    fast, slow = scenario.engines[0], scenario.engines[-1]
    if method == "differences":
        return partials_by_differences(without_noise(ready_engine(scenario, fast, np.diag(sizes))), sizes)
    return partials_by_independent_sets(without_noise(ready_engine(scenario, slow, np.diag(sizes))), sizes)


def compare_partials(scenario: Scenario, methods: Sequence[str]) -> tuple[Array, dict[str, Array]]:
    """Compute partial derivatives by the first of some methods, and the differences of the others from them.

    Raises `SimulationFailed` when a sample that they need fails.

    Returns
    -------
    partials : ndarray, shape (outputs, sources)
        SI.
    differences : dict of str to ndarray, shape (outputs,)
        For each further method the largest difference in each row, as a share of the row's largest contribution of one
        source at its nominal size; NaN for an output that no source disturbs.
    """
    sizes = np.array([source.nominal for source in scenario.sources])
    first = partials_by(scenario, methods[0])
    largest = np.abs(first * sizes).max(axis=1)
    others = {method: partials_by(scenario, method) for method in methods[1:]}
    shares = np.where(largest > 0.0, largest, np.nan)
    return first, {name: np.abs((other - first) * sizes).max(axis=1) / shares for name, other in others.items()}
