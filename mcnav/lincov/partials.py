"""Partial derivatives of the final errors by simulation: one error at a time, and from independent error sets.

The third method, the variational equations, belongs to a scenario (`Scenario.linear_model`). The three methods share
only the physics.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from mcnav._types import Array
from mcnav.scenarios.protocol import SimulationResult, TimeHistoryEngine
from mcnav.scenarios.timeouts import check_stopped

Propagate = Callable[[Array], SimulationResult]
"""Simulation of errors, shape (n, sources), SI."""

STEP: Final = 1e-3
"""Step of the differences, as a share of each source's nominal size: the third-order term, the error of a central
difference, falls with its square, while the engines resolve errors a million times smaller."""

HISTORY_STEP: Final = 2e-2
"""Step for histories: their errors are differences of positions, rounded to 1e-9 m, which the inverse of S amplifies up
to a million times where the ten runs are nearly alike. The third-order term is eliminated by extrapolation."""

RUNS_SEED: Final = 1963


class SimulationFailed(ArithmeticError):
    """Failure of a sample that a derivative needs."""


def simulate_or_raise(propagate: Propagate, errors: Array) -> Array:
    """Simulate samples that must all succeed, shape (n, outputs); `SimulationFailed` names the first that does not."""
    check_stopped()
    outcomes = propagate(errors)
    for row, reason in outcomes.failures.items():
        raise SimulationFailed(f"flight {row + 1} of {len(errors)} for the partial derivatives failed: {reason}")
    return outcomes.values


def partials_by_differences(propagate: Propagate, nominal_sizes: Array, step: float = STEP) -> Array:
    """Compute P by central differences, one error at a time as NASA TN D-1772's ten runs, shape (outputs, sources).

    Parameters
    ----------
    nominal_sizes : ndarray, shape (sources,)
        Typical size of each error, SI.
    step : float
        Share of it by which each error is displaced to either side.

    Raises
    ------
    SimulationFailed
        When a sample fails.
    """
    steps = step * np.asarray(nominal_sizes)
    count = len(steps)
    values = simulate_or_raise(propagate, np.vstack([np.diag(steps), -np.diag(steps)]))
    return np.asarray(((values[:count] - values[count:]) / (2.0 * steps[:, None])).T)


def partials_from_runs(start_errors: Array, final_errors: Array) -> Array:
    """Compute P = F S^-1 (NASA TN D-1772, eqs. 14-16), shape (outputs, sources).

    Parameters
    ----------
    start_errors : ndarray, shape (sources, runs)
        S: one independent set of start errors a column.
    final_errors : ndarray, shape (outputs, runs)
        F: the final errors of the same runs.
    """
    if start_errors.shape[0] != start_errors.shape[1] or final_errors.shape[1] != start_errors.shape[1]:
        raise ValueError(
            "F S^-1 needs as many runs as sources, and the same runs in both matrices; got start errors of shape "
            f"{start_errors.shape} and final errors of shape {final_errors.shape}"
        )
    return np.asarray(np.linalg.solve(start_errors.T, final_errors.T).T)


def partials_by_independent_sets(propagate: Propagate, nominal_sizes: Array, step: float = STEP) -> Array:
    """Compute P = F S^-1 from independent error sets in which all sources act at once, shape (outputs, sources).

    The sets are the columns of a random orthogonal matrix, scaled to the nominal sizes. Each is simulated with both
    signs and F is half the difference, so that the second-order term that one-sided runs leave in eq. (16) cancels.

    Raises
    ------
    SimulationFailed
        When a sample fails.
    """
    sizes = np.asarray(nominal_sizes)
    count = len(sizes)
    sets = step * _orthogonal(count)
    values = simulate_or_raise(propagate, np.vstack([sets.T * sizes, -sets.T * sizes]))
    # solved for the scaled sources, whose matrix is orthogonal: metres beside microradians would cost digits
    return np.asarray(partials_from_runs(sets, 0.5 * (values[:count] - values[count:]).T) / sizes)


def partials_at_later_starts(
    histories: Callable[[Array], tuple[Array, Array]], nominal_sizes: Array, step: float = HISTORY_STEP
) -> Array:
    """Compute P for every later start time from the histories of one set of runs, shape (times, outputs, sources).

    The errors at an instant are the start errors of navigation begun there (NASA TN D-1772, eqs. 14-16). Each set is
    simulated with both signs, as in `partials_by_independent_sets`, and with two step sizes, which eliminates the error
    of second order in the step.

    Parameters
    ----------
    histories : callable
        Errors, shape (n, sources), to the error sets in force at each start time, shape (times, n, sources), and the
        final errors, shape (n, outputs).
    nominal_sizes : ndarray, shape (sources,)
    step : float
        The smaller step, as a share of the nominal sizes.
    """
    sizes = np.asarray(nominal_sizes)
    count = len(sizes)

    def estimate(size: float) -> Array:
        runs = size * _orthogonal(count).T * sizes
        sets, final = histories(np.vstack([runs, -runs]))
        halved = 0.5 * (sets[:, :count] - sets[:, count:]) / sizes
        outcome = 0.5 * (final[:count] - final[count:]).T
        return np.array([partials_from_runs(start.T, outcome) / sizes for start in halved])

    return np.asarray((4.0 * estimate(step) - estimate(2.0 * step)) / 3.0)


def _orthogonal(count: int) -> Array:
    """Return a random orthogonal matrix, always the same."""
    return np.asarray(np.linalg.qr(np.random.default_rng(RUNS_SEED).standard_normal((count, count)))[0])


def partials_throughout(engine: TimeHistoryEngine, nominal_sizes: Array, step: float = STEP) -> tuple[Array, Array]:
    """Compute P at every epoch by central differences of histories, and the nominal errors.

    Parameters
    ----------
    nominal_sizes : ndarray, shape (sources,)
        Typical size of each error, SI.
    step : float
        See `partials_by_differences`.

    Returns
    -------
    partials : ndarray, shape (m, outputs, sources)
    nominal : ndarray, shape (m, outputs)
    """
    steps = step * np.asarray(nominal_sizes)
    moved = np.concatenate([np.diag(steps), -np.diag(steps), np.zeros((1, len(steps)))])
    errors = engine.histories(moved)
    up, down, nominal = errors[: len(steps)], errors[len(steps) : -1], errors[-1]
    return np.asarray(((up - down) / (2.0 * steps[:, None, None])).transpose(1, 2, 0)), nominal
