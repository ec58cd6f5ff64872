"""Statements of a record on each parameter: an estimate with its interval, or a bound and the length that would do.

Parameters of the chosen model are stated with their intervals. Of a process that is not in it, the record has an upper
bound: that of the same model with the process added. With one slow process in the model, the other one has no bound:
they trade shares of the spectrum. Where the record shows both, both are in the model.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav.identification.fit import AxisFit, Estimate
from mcnav.identification.processes import (
    CORRELATION_TIME,
    GAUSS_MARKOV,
    QUANTIZATION,
    RATE_RANDOM_WALK,
    WHITE,
    Process,
)

PARAMETERS: Final = (WHITE.size, GAUSS_MARKOV.size, CORRELATION_TIME, RATE_RANDOM_WALK.size, QUANTIZATION.size)
"""Names of all parameters in order."""

SLOW: Final = (RATE_RANDOM_WALK, GAUSS_MARKOV)


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
    beside : str
        The slow process that stands for this one in the model; empty where there is none.
    """

    name: str
    value: float | None
    low: float
    high: float
    duration_wanted: float | None = None
    beside: str = ""


def statements(fitted: AxisFit) -> tuple[Statement, ...]:
    """State every parameter."""
    chosen = {estimate.name: estimate for estimate in fitted.estimates}
    slow = next((process.size for process in fitted.chosen.model.processes if process in SLOW), "")
    result = []
    for name in PARAMETERS:
        if name in chosen:
            result.append(_of_estimate(chosen[name]))
        elif name == QUANTIZATION.size or (name == RATE_RANDOM_WALK.size and not slow):
            result.append(_bound(fitted, QUANTIZATION if name == QUANTIZATION.size else RATE_RANDOM_WALK))
        else:
            result.append(Statement(name, None, 0.0, np.inf, beside=slow))
    return tuple(result)


def _of_estimate(estimate: Estimate) -> Statement:
    if estimate.identified:
        return Statement(estimate.name, estimate.value, estimate.low, estimate.high)
    return Statement(estimate.name, None, estimate.low, estimate.high, estimate.duration_wanted)


def _bound(fitted: AxisFit, process: Process) -> Statement:
    """Bound a process that the chosen model does not have."""
    wanted = set(fitted.chosen.model.processes) | {process}
    candidate = next(candidate for candidate in fitted.candidates if set(candidate.model.processes) == wanted)
    (estimate,) = (estimate for estimate in candidate.estimates((process.size,)) if estimate.name == process.size)
    return Statement(process.size, None, 0.0, estimate.high, estimate.duration_wanted)
