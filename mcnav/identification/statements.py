"""Statements of a record on each parameter: an estimate with its interval, or a bound and the length that would do.

Parameters of the chosen model are stated with their intervals. Of a process that is not in it, the record has an upper
bound: the largest size with which the model with the process added is as likely as an interval asks for. A Gauss-Markov
process of any correlation time has no bound, nor has a third slow process.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav.identification.estimates import Estimate
from mcnav.identification.fit import AxisFit
from mcnav.identification.processes import (
    CORRELATION_TIME,
    FLICKER,
    GAUSS_MARKOV,
    QUANTIZATION,
    RATE_RANDOM_WALK,
    WHITE,
    Process,
)

BOUNDED: Final = (FLICKER, RATE_RANDOM_WALK, QUANTIZATION)
"""Processes of one parameter besides white noise."""

PARAMETERS: Final = (
    WHITE.size, FLICKER.size, GAUSS_MARKOV.size, CORRELATION_TIME, RATE_RANDOM_WALK.size, QUANTIZATION.size,
)  # fmt: skip
"""Names of all parameters in order."""


@dataclass(frozen=True)
class Statement:
    """Statement of a record on a parameter, in the units of `mcnav.identification.processes`.

    Attributes
    ----------
    name : str
    value : float, optional
        Estimate; none where the record does not identify it.
    low, high : float
        95 % interval; without an estimate, zero and the upper bound, which is infinite where there is none.
    duration_wanted : float, optional
        Length of a record that would show it, s, at its upper bound or, if that is infinite, at its estimate. Infinite
        if none does; none where it is identified or nothing can be said.
    certain : bool
        False where a model without the parameter's process fits the record nearly as well.
    """

    name: str
    value: float | None
    low: float
    high: float
    duration_wanted: float | None = None
    certain: bool = True


def statements(fitted: AxisFit) -> tuple[Statement, ...]:
    """State every parameter."""
    chosen = {estimate.name: estimate for estimate in fitted.estimates}
    bounds = {process.size: _bound(fitted, process) for process in BOUNDED if process.size not in chosen}
    return tuple(
        _of_estimate(chosen[name]) if name in chosen else bounds.get(name, Statement(name, None, 0.0, np.inf))
        for name in PARAMETERS
    )


def _of_estimate(estimate: Estimate) -> Statement:
    if estimate.identified:
        return Statement(estimate.name, estimate.value, estimate.low, estimate.high, certain=estimate.certain)
    return Statement(estimate.name, None, estimate.low, estimate.high, estimate.duration_wanted)


def _bound(fitted: AxisFit, process: Process) -> Statement:
    """Bound a process that the chosen model does not have."""
    wanted = set(fitted.chosen.model.processes) | {process}
    for candidate in fitted.candidates:
        if set(candidate.model.processes) == wanted:
            (estimate,) = candidate.estimates(names=(process.size,))
            return Statement(process.size, None, 0.0, estimate.high, estimate.duration_wanted)
    return Statement(process.size, None, 0.0, np.inf)
