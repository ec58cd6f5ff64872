"""Answers of a run's stored samples: tables over time, and tests of the linear model of a user's class."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from mcnav.analysis.linear_samples import doubt_noise
from mcnav.arrays.types import Array
from mcnav.contract.engine import Engine, has_histories, smoother_of
from mcnav.contract.history import Epochs
from mcnav.contract.scenario import runs_user_code
from mcnav.linear.polynomial_engine import exact_part
from mcnav.numerics.power_sums import sum_powers_about_zero
from mcnav.runner.processes import IsolatedEngine
from mcnav.statistics.filter_sums import FilterMeans
from mcnav.store.chunk_files import ChunkFile, Samples
from mcnav.store.filters import filter_columns, filter_table
from mcnav.store.histories import STORED, epochs_table, histories_table
from mcnav.store.manifest import UnsettledRecord
from mcnav.store.model_record import unsettled_record
from mcnav.store.run_files import EPOCHS, FILTER, HISTORIES, SMOOTHED
from mcnav.store.totals import read_totals
from mcnav.systems.user.soundness import LARGEST, SHARE, Unsettled
from mcnav.systems.user.stochastic_engine import without_linear
from mcnav.systems.user.stochastic_scenario import NOISE, is_users_with_noise
from mcnav.workflow.prepare import PreparedSystem

FOLLOWED: Final = 512
"""Samples of a user's class with noise whose histories are stored: they are simulated one by one, and again."""

FEWEST_FOLLOWED: Final = 2
"""Samples with a history, below which there are no moments."""


def doubt_samples(system: PreparedSystem, stored: Callable[[], Samples]) -> UnsettledRecord | None:
    """Test stored linear outcomes against the noise covariance that a user's class states; none without doubt."""
    scenario = system.scenario
    if not (is_users_with_noise(scenario) and scenario.gives_noise_covariance):
        return None
    limit, samples = min(LARGEST, SHARE * system.campaign.tolerance), stored()
    finite = np.isfinite(samples.outputs).all(axis=1)
    doubt = doubt_noise(system.linear, samples.errors[finite], samples.linear[finite], limit)
    if doubt is None:
        return None
    output = scenario.outputs[doubt.output].name
    return unsettled_record(Unsettled(NOISE, output, doubt.disagreement, limit, True, "noise_covariance"))


def tables_over_time(system: PreparedSystem, folder: Path, chunks: Sequence[ChunkFile]) -> dict[str, bytes]:
    """Tabulate moments of all samples at every epoch, with a polynomial of the first ones, and their histories.

    Returns
    -------
    dict
        Content by file name; empty when the engine has no histories.
    """
    engine, errors, outputs = exact_part(system.engine), system.draws.errors, system.scenario.outputs
    known = system.differenced
    if engine.epochs is None:
        return {}
    if known is None or not has_histories(engine):
        return _tables_of_followed(system, engine, engine.epochs, folder, chunks)
    first = system.draws.draw(0, STORED)
    epochs, histories = engine.epochs, engine.histories(first)
    perfect = engine.history_sums(first[:1]).pivot  # errors of a perfect system, whatever the samples
    sums = read_totals(perfect, None, folder, chunks).power_sums or engine.history_sums(first)
    if sums.count < FEWEST_FOLLOWED:
        return {}
    linear = known.mean(errors.mean), known.covariance(errors.covariance)
    return {
        EPOCHS: epochs_table(epochs, outputs, sums, linear, histories),
        HISTORIES: histories_table(epochs, outputs, histories),
    }


def _first_histories(system: PreparedSystem, engine: Engine, epochs: Epochs) -> Array | None:
    """Simulate the first samples again for their histories, shape (n, m, outputs); fewer of a user's class."""
    if not runs_user_code(system.scenario):
        return engine.simulate(system.draws.batch(0, STORED)).history
    outputs = len(system.scenario.outputs)
    guarded = IsolatedEngine(without_linear(engine), outputs, system.timeout)
    histories = np.full((min(FOLLOWED, system.draws.samples), len(epochs.times), outputs), np.nan)
    for begin in range(0, len(histories), engine.chunk):
        end = min(begin + engine.chunk, len(histories))
        history = guarded.simulate(system.draws.batch(begin, end)).history
        if history is not None:
            histories[begin:end] = history
    return histories


def _tables_of_followed(
    system: PreparedSystem, engine: Engine, epochs: Epochs, folder: Path, chunks: Sequence[ChunkFile]
) -> dict[str, bytes]:
    """Tabulate what an engine has returned of its samples over time."""
    errors, outputs = system.draws.errors, system.scenario.outputs
    schema, tables, columns = engine.filter, {}, {}
    pivot, smoother = np.zeros((len(epochs.times), len(outputs))), smoother_of(engine)
    totals = read_totals(pivot, schema, folder, chunks, histories=True, smoother=smoother)
    sums, histories = totals.power_sums, totals.first
    if histories is None:
        histories = _first_histories(system, engine, epochs)
    if schema is not None and totals.filter_sums is not None:
        means = FilterMeans.of(schema, totals.filter_sums)
        tables[FILTER] = filter_table(epochs, outputs, means)
        columns = filter_columns(outputs, means, system.prediction)
    if totals.first_smoothed is not None:
        tables[SMOOTHED] = histories_table(epochs, outputs, totals.first_smoothed)
    if sums is None and histories is not None:  # those of a map are of the samples that are simulated for it
        sums = sum_powers_about_zero(histories)
    if sums is None or sums.count < FEWEST_FOLLOWED or histories is None:
        return tables
    tables[HISTORIES] = histories_table(epochs, outputs, histories)
    if system.scenario.parts.readings == "end":
        return tables
    known = system.scenario.linear_over_time()
    linear = known.mean(errors.mean), known.covariance(errors.covariance)
    return {EPOCHS: epochs_table(epochs, outputs, sums, linear, histories, columns, known.origin), **tables}
