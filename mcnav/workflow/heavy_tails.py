"""Outputs of a run that depend on a source with heavy tails, and have no verdict."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mcnav.analysis.heavy_tails import outputs_felt
from mcnav.analysis.model import Model
from mcnav.store.chunk_files import Samples
from mcnav.store.manifest import ModelRecord


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
