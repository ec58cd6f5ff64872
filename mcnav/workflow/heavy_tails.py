"""Outputs that depend on a source with heavy tails, by flights of the same samples with that source moved far out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav._types import Array
from mcnav.analysis.comparison import Model
from mcnav.analysis.heavy_tails import outputs_felt
from mcnav.contract.engine import Engine
from mcnav.contract.samples import Batch
from mcnav.contract.scenario import Scenario
from mcnav.runner.chunks import DrawPlan
from mcnav.runner.soundness import isolated
from mcnav.store.chunk_files import Samples
from mcnav.store.manifest import ModelRecord

SAMPLES: Final = 8
"""Samples that are flown with the source moved."""

PLACES: Final = (-7.0, -3.0, -1.0, 0.0, 1.0, 3.0, 7.0)
"""Where it is moved to: quantiles of its own distribution, as standard normals; 7 is beyond any sample of a run."""


def tail_outputs(
    scenario: Scenario, draws: DrawPlan, engine: Engine, model: Model, timeout: float | None
) -> tuple[str, ...] | None:
    """Name the outputs that depend on a source with heavy tails; none where no source has any.

    ``timeout`` is the limit of one sample, s. Raises `ScenarioError` when the scenario cannot be simulated.
    """
    heavy = draws.errors.heavy_tailed(draws.design)
    if not heavy:
        return None
    columns = [draws.errors.names.index(name) for name in heavy]
    sigmas = np.sqrt(np.diag(model.covariance))[columns]
    depends = np.any(np.abs(model.partials[:, columns]) * sigmas > model.rounding[:, None], axis=1)
    depends |= moved_outputs(isolated(scenario, engine, timeout), draws, columns, model.floor)
    return tuple(output.name for output, own in zip(scenario.outputs, depends, strict=True) if own)


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


def tailed_over_time(record: ModelRecord, heavy: Sequence[str], withheld: Sequence[int]) -> tuple[int, ...]:
    """Return the outputs that depend on a source with heavy tails at the end or, linearly, at any reading."""
    if not heavy or record.development is None:
        return tuple(withheld)
    columns = [[source.name for source in record.sources].index(name) for name in heavy]
    depends = np.asarray(record.development.partials[:, :, columns].any(axis=(0, 2)))
    depends[list(withheld)] = True
    return tuple(np.flatnonzero(depends).tolist())


def withheld_outputs(record: ModelRecord, heavy: tuple[str, ...], model: Model, samples: Samples) -> tuple[int, ...]:
    """Return the outputs of a run that have no verdict, by number: all where their dependence was not examined."""
    if not heavy:
        return ()
    if record.tail_outputs is None:
        return tuple(range(len(record.outputs)))
    depends = np.array([output.name in record.tail_outputs for output in record.outputs])
    finite = np.isfinite(samples.outputs).all(axis=1)
    errors = samples.errors[finite]
    linear = samples.linear[finite] if model.processes else model.nominal + errors @ model.partials.T
    remainders = samples.outputs[finite] - linear
    names = [source.name for source in record.sources]
    for column in (names.index(name) for name in heavy):
        depends |= outputs_felt(errors[:, column] - model.mean[column], remainders, model.floor)
    return tuple(np.flatnonzero(depends).tolist())
