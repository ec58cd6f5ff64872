"""Partial derivatives of the final errors from flights: one error at a time, and from independent error sets.

The third way, the variational equations, belongs to a scenario (`Scenario.linearised`). The three share nothing but
the physics, and agree.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav.scenarios.protocol import Outcomes

Array = NDArray[np.float64]
Propagate = Callable[[Array], Outcomes]

STEP: Final = 1e-3
"""Step of the differences, as a share of each source's nominal size: the third-order term, the error of a central
difference, falls with its square, while the engines resolve errors a million times smaller."""

RUNS_SEED: Final = 1963


class FlightFailed(ArithmeticError):
    """A flight that a derivative needs did not succeed."""


def flown_values(propagate: Propagate, errors: Array) -> Array:
    """Outcomes of flights that must all succeed, shape (n, outputs); `FlightFailed` names the first that does not."""
    outcomes = propagate(errors)
    for row, reason in outcomes.failures.items():
        raise FlightFailed(f"flight {row + 1} of {len(errors)} for the partial derivatives failed: {reason}")
    return outcomes.values


def partials_by_differences(propagate: Propagate, nominal_sizes: Array, step: float = STEP) -> Array:
    """P by central differences, one error at a time as NASA TN D-1772's ten runs, shape (outputs, sources).

    Parameters
    ----------
    propagate : callable
        Errors, shape (n, sources), to `Outcomes`.
    nominal_sizes : ndarray, shape (sources,)
        A usual size of each error, SI.
    step : float
        Share of it by which each error is moved to either side.

    Raises
    ------
    FlightFailed
        When one of the flights fails.
    """
    steps = step * np.asarray(nominal_sizes)
    count = len(steps)
    values = flown_values(propagate, np.vstack([np.diag(steps), -np.diag(steps)]))
    return np.asarray(((values[:count] - values[count:]) / (2.0 * steps[:, None])).T)


def partials_from_runs(start_errors: Array, final_errors: Array) -> Array:
    """P = F S^-1 (NASA TN D-1772, eqs. 14-16), shape (outputs, sources).

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
    """P by F S^-1 from independent error sets in which all sources act at once, shape (outputs, sources).

    The sets are the columns of a random orthogonal matrix, scaled to the nominal sizes. Each is flown with both signs
    and F is half the difference, so that the second-order term that one-sided runs leave in eq. (16) cancels.

    Raises
    ------
    FlightFailed
        When one of the flights fails.
    """
    sizes = np.asarray(nominal_sizes)
    count = len(sizes)
    orthogonal, _ = np.linalg.qr(np.random.default_rng(RUNS_SEED).standard_normal((count, count)))
    sets = step * orthogonal
    values = flown_values(propagate, np.vstack([sets.T * sizes, -sets.T * sizes]))
    # solved for the scaled sources, whose matrix is orthogonal: metres beside microradians would cost digits
    return np.asarray(partials_from_runs(sets, 0.5 * (values[:count] - values[count:]).T) / sizes)
