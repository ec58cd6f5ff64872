"""A system before its samples are simulated: engine, linear model, and corrections to the linear model."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from mcnav._types import Array
from mcnav.analysis.comparison import Model
from mcnav.analysis.linear_samples import doubt_noise
from mcnav.contract.engine import Engine, has_histories
from mcnav.contract.filter_record import FilterPrediction, FilterSchema
from mcnav.contract.history import Epochs, History
from mcnav.contract.quantities import Output, Source
from mcnav.contract.scenario import (
    Scenario,
    ScenarioError,
    can_have_filter,
    can_have_noise,
    is_linear_over_time,
    runs_user_code,
)
from mcnav.errors import CampaignError, Problem
from mcnav.execution.chunks import DrawPlan
from mcnav.execution.processes import IsolatedEngine
from mcnav.execution.soundness import exact_engine, find_doubt, isolated
from mcnav.lincov.nonlinear_corrections import noise_corrections, nonlinear_corrections
from mcnav.lincov.partials import SimulationFailed, partials_throughout
from mcnav.lincov.polynomial import PolynomialFitError
from mcnav.lincov.polynomial_engine import MAP, PolynomialEngine, prepare_engine
from mcnav.lincov.simulated_budget import simulated_budgets
from mcnav.sampling.error_model import ErrorModel
from mcnav.statistics.filter_sums import FilterMeans
from mcnav.store.chunk_files import ChunkFile, Samples
from mcnav.store.filters import filter_columns, filter_table
from mcnav.store.histories import (
    STORED,
    epochs_table,
    histories_table,
)
from mcnav.store.manifest import (
    FilterPredictionRecord,
    FilterRecord,
    ModelRecord,
    PartialsRecord,
    UnsettledRecord,
    Variable,
)
from mcnav.store.run_folder import EPOCHS, FILTER, HISTORIES
from mcnav.store.totals import read_totals
from mcnav.systems.user.soundness import LARGEST, SHARE, Unsettled
from mcnav.systems.user.stochastic_engine import without_linear
from mcnav.systems.user.stochastic_scenario import NOISE, is_users_with_noise

DEVELOPMENT_POINTS: Final = 61
"""Times of the error budget's history, where the scenario has partial derivatives throughout the flight."""

FOLLOWED: Final = 512
"""Samples of a user's class with noise whose histories are stored: they are simulated one by one, and again."""

FEWEST_FOLLOWED: Final = 2
"""Samples with a history, below which there are no moments."""


@dataclass(frozen=True)
class PreparedSystem:
    """A scenario with its errors and its engine.

    Attributes
    ----------
    engine_name : str
    model : ModelRecord
        The linear model.
    unsettled : UnsettledRecord or None
        The partial derivative for which there is no linear model to compare with.
    timeout : float or None
        Time limit of one sample, s.
    file : str
        The campaign file, for messages.
    """

    scenario: Scenario
    draws: DrawPlan
    engine: Engine
    engine_name: str
    model: ModelRecord
    history: History
    unsettled: UnsettledRecord | None
    timeout: float | None
    file: str

    def corrections(self) -> dict[str, Any]:
        """Compute corrections to the linear model from further simulations, as fields of `ModelRecord`.

        Raises `CampaignError` when the scenario or an engine cannot be simulated.
        """
        draws, scenario = self.draws, self.scenario

        def first_engine(probes: Array) -> Engine:
            own = self.engine.exact if isinstance(self.engine, PolynomialEngine) else self.engine
            same = self.engine_name in (MAP, scenario.engines[0]) and np.array_equal(probes, draws.probes())
            return isolated(scenario, own, self.timeout) if same else exact_engine(scenario, probes, self.timeout)

        if can_have_noise(scenario):
            engine = isolated(scenario, self.engine, self.timeout)
            return noise_corrections(engine, draws.errors, self.model.processes or {}, draws.samples)
        with _scenario_errors(self.file):
            budget = simulated_budgets(
                first_engine, draws.errors, self.model.partials, draws.design, draws.seed, draws.samples
            )
            engine = isolated(scenario, self.engine, self.timeout)
            return nonlinear_corrections(scenario, engine, draws.errors) | {"budget": budget}

    def doubt_samples(self, stored: Callable[[], Samples], tolerance: float) -> UnsettledRecord | None:
        """Test stored linear outcomes against the noise covariance that a user's class states; none without doubt."""
        scenario, model = self.scenario, self.model
        if not (is_users_with_noise(scenario) and scenario.gives_noise_covariance):
            return None
        limit, samples = min(LARGEST, SHARE * tolerance), stored()
        known = np.isfinite(samples.outputs).all(axis=1)
        linear = Model(model.partials, model.nominal, model.start_mean, model.start_covariance, model.processes or {})
        doubt = doubt_noise(linear, samples.errors[known], samples.linear[known], limit)
        if doubt is None:
            return None
        named = self.scenario.outputs[doubt.output].name
        return unsettled_record(Unsettled(NOISE, named, doubt.disagreement, limit, True, "noise_covariance"))

    def epoch_tables(self, folder: Path, chunks: Sequence[ChunkFile]) -> dict[str, bytes]:
        """Tabulate moments of all samples at every epoch, with a polynomial of the first ones, and their histories.

        Returns
        -------
        dict
            Content by file name; empty when the engine has no histories.
        """
        engine, errors, outputs = _exact(self.engine), self.draws.errors, self.scenario.outputs
        if engine.epochs is None:
            return {}
        if not has_histories(engine):
            return self._tables_of_followed(engine, engine.epochs, folder, chunks)
        first = self.draws.draw(0, STORED)
        epochs, histories, own = engine.epochs, engine.histories(first), engine.history_sums(first)
        sums = read_totals(own.pivot, None, folder, chunks).power_sums or own
        if sums.count < FEWEST_FOLLOWED:
            return {}
        partials, nominal = partials_throughout(engine, _sizes(self.scenario))
        linear = nominal + partials @ errors.mean, partials @ errors.covariance @ partials.swapaxes(1, 2)
        return {
            EPOCHS: epochs_table(epochs, outputs, sums, linear, histories),
            HISTORIES: histories_table(epochs, outputs, histories),
        }

    def _first_histories(self, engine: Engine, epochs: Epochs) -> Array | None:
        """Simulate the first samples again for their histories, shape (n, m, outputs); fewer of a user's class."""
        if not runs_user_code(self.scenario):
            return engine.simulate(self.draws.batch(0, STORED)).history
        outputs = len(self.scenario.outputs)
        guarded = IsolatedEngine(without_linear(engine), outputs, self.timeout)
        histories = np.full((min(FOLLOWED, self.draws.samples), len(epochs.times), outputs), np.nan)
        for begin in range(0, len(histories), engine.chunk):
            end = min(begin + engine.chunk, len(histories))
            history = guarded.simulate(self.draws.batch(begin, end)).history
            if history is not None:
                histories[begin:end] = history
        return histories

    def _tables_of_followed(
        self, engine: Engine, epochs: Epochs, folder: Path, chunks: Sequence[ChunkFile]
    ) -> dict[str, bytes]:
        """Tabulate what an engine has returned of its samples over time."""
        errors, outputs = self.draws.errors, self.scenario.outputs
        schema, tables, columns = engine.filter, {}, {}
        totals = read_totals(np.zeros((len(epochs.times), len(outputs))), schema, folder, chunks, histories=True)
        sums, histories = totals.power_sums, totals.first
        if histories is None:
            histories = self._first_histories(engine, epochs)
        if schema is not None and totals.filter_sums is not None:
            means = FilterMeans.of(schema, totals.filter_sums)
            tables[FILTER] = filter_table(epochs, outputs, means)
            columns = filter_columns(outputs, means, _filter_prediction(self.scenario, epochs))
        if sums is None or sums.count < FEWEST_FOLLOWED or histories is None:
            return tables
        tables[HISTORIES] = histories_table(epochs, outputs, histories)
        if not is_linear_over_time(self.scenario):
            return tables
        known = self.scenario.linear_over_time(len(epochs.times))
        linear = known.partials @ errors.mean, known.covariance(errors.covariance)
        return {EPOCHS: epochs_table(epochs, outputs, sums, linear, histories, columns), **tables}


def prepare_system(
    scenario: Scenario,
    draws: DrawPlan,
    engine_name: str,
    tolerance: float,
    timeout: float | None,
    file: str,
    force: bool = False,
) -> PreparedSystem:
    """Prepare a scenario and its errors for one of its engines.

    Parameters
    ----------
    tolerance : float
        Relative difference between linear analysis and Monte Carlo that the campaign tolerates.
    timeout : float or None
        Time limit of one sample, s.
    file : str
        The campaign file, for messages.
    force : bool
        Whether to continue when partial derivatives do not converge.

    Raises
    ------
    CampaignError
        When it cannot be simulated, or is no function that a linear model could be compared with.
    """
    errors, probes = draws.errors, draws.probes()
    with _scenario_errors(file):
        doubt = find_doubt(scenario, draws, tolerance, timeout)
        if doubt is not None and not force:
            raise CampaignError([Problem(file, "scenario", str(doubt))])
        engine = prepare_engine(scenario, engine_name, probes, errors.mean, errors.standard_deviations)
        model, history = _linear(scenario, errors, engine), scenario.nominal()
    record = None if doubt is None else unsettled_record(doubt)
    return PreparedSystem(scenario, draws, engine, engine_name, model, history, record, timeout, file)


def unsettled_record(doubt: Unsettled) -> UnsettledRecord:
    """Convert a doubt about the linear model to its record."""
    return UnsettledRecord(**{key: value for key, value in asdict(doubt).items() if (key, value) != ("noise", "")})


@contextmanager
def _scenario_errors(file: str) -> Iterator[None]:
    """Convert errors of scenarios and engines into `CampaignError`."""
    try:
        yield
    except ScenarioError as wrong:
        raise CampaignError([Problem(file, f"scenario.{wrong.key}", str(wrong))]) from None
    except SimulationFailed as wrong:
        raise CampaignError([Problem(file, "scenario", str(wrong))]) from None
    except PolynomialFitError as wrong:
        raise CampaignError([Problem(file, "engine", str(wrong))]) from None


def _linear(scenario: Scenario, errors: ErrorModel, engine: Engine) -> ModelRecord:
    """Compute the linear model, at the end and, where it is known, throughout the flight."""
    linear = scenario.linear().end
    optional: dict[str, Any] = {"processes": dict(linear.processes)} if linear.processes else {}
    if is_linear_over_time(scenario):
        known = scenario.linear_over_time(DEVELOPMENT_POINTS)
        variances = {name: np.diagonal(each, axis1=1, axis2=2) for name, each in known.processes.items()}
        more = _nominal(known.nominal)
        if variances:
            more |= {"processes": variances, "covariance": known.covariance(errors.covariance)}
        optional["development"] = PartialsRecord(label=known.label, times=known.times, partials=known.partials, **more)
    elif has_histories(exact := _exact(engine)) and exact.epochs is not None:
        partials, _ = partials_throughout(exact, _sizes(scenario))
        epochs = exact.epochs
        optional["development"] = PartialsRecord(label=epochs.label, times=epochs.times, partials=partials)
    if engine.filter is not None and engine.epochs is not None:
        optional["filter"] = _filter_record(engine.filter, engine.epochs, scenario, errors)
    return ModelRecord(
        sources=_variables(scenario.sources),
        outputs=_variables(scenario.outputs),
        partials=linear.partials,
        nominal=linear.nominal,
        start_mean=errors.mean,
        start_covariance=errors.covariance,
        **optional,
    )


def _nominal(nominal: Array | None) -> dict[str, Any]:
    """Return the entry of a record for the errors of a system without errors; empty where there are none."""
    return {} if nominal is None or not np.any(nominal) else {"nominal": nominal}


def _exact(engine: Engine) -> Engine:
    """Return the engine to which a polynomial was fitted, or the engine itself."""
    return engine.exact if isinstance(engine, PolynomialEngine) else engine


def _filter_prediction(scenario: Scenario, epochs: Epochs) -> FilterPrediction | None:
    """Return what linear analysis says of the filter at the epochs; none where it says nothing of them."""
    prediction = scenario.filter_prediction() if can_have_filter(scenario) else None
    return prediction if prediction is not None and _same_times(prediction.times, epochs.times) else None


def _same_times(one: Array, other: Array) -> bool:
    return one.shape == other.shape and bool(np.allclose(one, other, rtol=1e-9))


def _filter_record(schema: FilterSchema, epochs: Epochs, scenario: Scenario, errors: ErrorModel) -> FilterRecord:
    """Describe a filter, with what linear analysis says of it and of the truth."""
    filter_prediction = _filter_prediction(scenario, epochs)
    optional: dict[str, Any] = {"considered": schema.considered} if schema.considered else {}
    record = FilterRecord(
        label=epochs.label,
        times=epochs.times,
        groups=dict(schema.groups),
        outputs=schema.outputs,
        states=schema.states,
        units=schema.units,
        sensors=dict(schema.sensors),
        **optional,
    )
    if filter_prediction is None:
        return record
    about_zero = errors.covariance + np.outer(errors.mean, errors.mean)
    state_true = np.einsum(
        "mqk,kl,mql->mq", filter_prediction.state_partials, about_zero, filter_prediction.state_partials
    )
    prediction = FilterPredictionRecord(
        covariance=filter_prediction.covariance,
        state_variance=filter_prediction.state_variance,
        state_true=sum(filter_prediction.state_processes.values(), state_true),
        believed=dict(filter_prediction.believed),
    )
    return record.model_copy(update={"prediction": prediction})


def _variables(entries: Sequence[Source | Output]) -> tuple[Variable, ...]:
    def variable(entry: Source | Output) -> Variable:
        limit = entry.limit if isinstance(entry, Output) else None
        limited = {} if limit is None else {"limit": limit}
        return Variable(name=entry.name, unit=entry.unit, shown_in=entry.shown_in, **limited)

    return tuple(map(variable, entries))


def _sizes(scenario: Scenario) -> Array:
    return np.array([source.nominal for source in scenario.sources])
