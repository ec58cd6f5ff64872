"""What stands for flicker noise in a simulation: a Gauss-Markov process and a rate random walk beside the other noise.

Campaigns have no flicker noise, whose density 1/f has no finite number of states. The model without it, with both other
slow processes added, is fitted to its spectrum: the parameters minimize ``Σ [log λ' + λ/λ']`` over frequencies that are
evenly spaced on a logarithm, from half a period in the record to half the rate of the readings.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.identification.allan import FEWEST, model_variance
from mcnav.identification.choice import SLOW
from mcnav.identification.estimates import Candidate
from mcnav.identification.likelihood import maximize
from mcnav.identification.processes import FLICKER, GAUSS_MARKOV, RATE_RANDOM_WALK, Grid, Model
from mcnav.identification.spectrum import Bands

FREQUENCIES: Final = 200
"""Frequencies at which spectra are compared."""


@dataclass(frozen=True)
class StandIn:
    """A model without flicker noise that is near one with it.

    Attributes
    ----------
    parameters : dict of str to float
        Its parameters by name, SI.
    error : float
        Largest relative difference of the Allan deviations between `shortest` and `longest`.
    shortest, longest : float
        Cluster times, s: the interval, and a quarter of the record.
    """

    parameters: dict[str, float]
    error: float
    shortest: float
    longest: float


def stand_in(candidate: Candidate) -> StandIn | None:
    """Fit a model without flicker noise to one with it; none where there is no flicker noise."""
    own = candidate.model
    if FLICKER not in own.processes:
        return None
    fast = tuple(process for process in own.processes if process not in SLOW)
    model = Model((*fast, RATE_RANDOM_WALK, GAUSS_MARKOV))
    record = candidate.bands.grid
    count = round(record.duration / record.interval)
    grid = Grid(record.interval, count, np.geomspace(1.0, count - 1.0, FREQUENCIES))
    variances = own.variances(grid, candidate.best.logs)[0]
    bands = Bands(grid, np.ones(FREQUENCIES), variances)
    known = candidate.best.logs[: len(fast)]
    flicker = float(candidate.best.logs[own.parameters.index(FLICKER.size)])
    starts = [
        np.array([*known, flicker - 0.5 * np.log(time), flicker, np.log(time)])
        for time in record.duration / np.array([10.0, 100.0, 1000.0])
    ]
    best = min(
        (maximize(model, bands, start, range(len(fast))) for start in starts), key=lambda maximum: maximum.deviance
    )
    times = np.geomspace(record.interval, record.duration / FEWEST, 40)
    ratios = np.sqrt(_allan(model, best.logs, times) / _allan(own, candidate.best.logs, times))
    parameters = dict(zip(model.parameters, np.exp(best.logs).tolist(), strict=True))
    return StandIn(parameters, float(np.abs(ratios - 1.0).max()), float(times[0]), float(times[-1]))


def _allan(model: Model, logs: Array, times: Array) -> Array:
    return np.array([model_variance(model, logs, time) for time in times])
