"""Outputs that depend on a source with heavy tails, by flights of the same samples with that source moved far out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav.analysis.model import Model
from mcnav.arrays.types import Array
from mcnav.contract.engine import Engine
from mcnav.contract.quantities import Output
from mcnav.contract.samples import Batch
from mcnav.runner.draws import DrawPlan

SAMPLES: Final = 8
"""Samples that are flown with the source moved."""

PLACES: Final = (-7.0, -3.0, -1.0, 0.0, 1.0, 3.0, 7.0)
"""Where it is moved to: quantiles of its own distribution, as standard normals; 7 is beyond any sample of a run."""


def tail_outputs(outputs: Sequence[Output], draws: DrawPlan, engine: Engine, model: Model) -> tuple[str, ...] | None:
    """Name the outputs that depend on a source with heavy tails; none where no source has any."""
    heavy = draws.errors.heavy_tailed(draws.design)
    if not heavy:
        return None
    columns = [draws.errors.names.index(name) for name in heavy]
    sigmas = np.sqrt(np.diag(model.covariance))[columns]
    depends = np.any(np.abs(model.partials[:, columns]) * sigmas > model.rounding[:, None], axis=1)
    depends |= moved_outputs(engine, draws, columns, model.floor)
    return tuple(output.name for output, own in zip(outputs, depends, strict=True) if own)


def moved_outputs(engine: Engine, draws: DrawPlan, columns: list[int], floor: Array) -> NDArray[np.bool_]:
    """Return which outputs move by more than a floor with sources, given by number, shape (outputs,).

    Where a flight fails, all do.
    """
    batch = draws.batch(0, SAMPLES)
    unmoved = engine.simulate(batch).values
    moved = np.zeros(unmoved.shape[1], dtype=bool)
    for column in columns:
        for place in PLACES:
            errors = batch.errors.copy()
            errors[:, column] = draws.errors.distributions[column].transform(np.full(1, place))[0]
            change = np.abs(engine.simulate(Batch(batch.index, errors, batch.seed)).values - unmoved)
            moved |= ~np.all(change <= floor, axis=0)
    return moved
