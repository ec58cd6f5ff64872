"""Agreement of the three methods for the partial derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from mcnav._types import Array
from mcnav.lincov.partials import partials_by_differences, partials_by_independent_sets
from mcnav.scenarios.protocol import Scenario

METHODS: Final = ("variational", "differences", "runs")
"""The equations of variation along the truth; one error at a time on the ensemble engine; F S^-1 from independent error
sets on the reference engine."""


def partials_by(scenario: Scenario, method: str) -> Array:
    """Compute partial derivatives by one of `METHODS`, shape (outputs, sources), SI; see `compare_partials`."""
    if method == "variational":
        return scenario.linear_model().partials
    sizes = np.array([source.nominal for source in scenario.sources])
    fast, slow = scenario.engines[0], scenario.engines[-1]
    if method == "differences":
        return partials_by_differences(scenario.engine(fast, np.diag(sizes)).propagate, sizes)
    return partials_by_independent_sets(scenario.engine(slow, np.diag(sizes)).propagate, sizes)


def compare_partials(scenario: Scenario, methods: Sequence[str]) -> tuple[Array, dict[str, Array]]:
    """Compute partial derivatives by the first of some of `METHODS`, and the differences of the others from them.

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
