"""A system before its samples are simulated: engine, linear model, and corrections to the linear model."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from typing import Final

import numpy as np

from mcnav._types import Array
from mcnav.analysis.comparison import Model
from mcnav.analysis.gates import predict_fault
from mcnav.analysis.mean_errors import rounding_of_means
from mcnav.analysis.what_if import entries_of, picked_entries
from mcnav.contract.engine import Engine, has_histories, smoother_of
from mcnav.contract.filter_record import FilterPrediction, FilterSchema
from mcnav.contract.history import Epochs, History
from mcnav.contract.linear import LinearSystem
from mcnav.contract.quantities import Output, Source
from mcnav.contract.scenario import (
    Scenario,
    ScenarioError,
    has_gates,
)
from mcnav.errors import CampaignError, Problem
from mcnav.linear.partials import SimulationFailed, partials_throughout
from mcnav.linear.polynomial import PolynomialFitError
from mcnav.linear.polynomial_engine import PolynomialEngine, prepare_engine
from mcnav.runner.chunks import DrawPlan
from mcnav.runner.soundness import find_doubt
from mcnav.sampler.error_model import ErrorModel
from mcnav.store.manifest import (
    FaultRecord,
    FilterPredictionRecord,
    FilterRecord,
    ModelRecord,
    PartialsRecord,
    SmootherRecord,
    UnsettledRecord,
    Variable,
)
from mcnav.systems.histories import check_history
from mcnav.systems.user.soundness import Unsettled
from mcnav.workflow.rejections import doubt_about_gates

DEVELOPMENT_POINTS: Final = 61
"""Times of the error budget's history, where the scenario has partial derivatives throughout the flight."""


@dataclass(frozen=True)
class LinearHistory:
    """Partial derivatives at the epochs of an engine, shape (m, outputs, sources), and the errors of a perfect system.

    ``nominal`` has shape (m, outputs); SI. ``processes`` are the covariances that each process of noise adds, shape
    (m, outputs, outputs), where they were asked for. ``origin`` is that of a linear system.
    """

    epochs: Epochs
    partials: Array
    nominal: Array
    processes: Mapping[str, Array] = field(default_factory=dict)
    origin: Array | None = None


@dataclass(frozen=True)
class PreparedSystem:
    """A scenario with its errors and its engine.

    Attributes
    ----------
    engine_name : str
    model : ModelRecord
        The linear model.
    throughout : LinearHistory or None
        None where the engine has no histories.
    unsettled : UnsettledRecord or None
        The partial derivative for which there is no linear model to compare with.
    remarks : tuple of str
        What the scenario notices of itself.
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
    throughout: LinearHistory | None
    history: History
    unsettled: UnsettledRecord | None
    remarks: tuple[str, ...]
    timeout: float | None
    file: str


def prepare_system(
    scenario: Scenario,
    draws: DrawPlan,
    engine_name: str,
    tolerance: float,
    timeout: float | None,
    file: str,
    force: bool = False,
    together: Sequence[Sequence[str]] = (),
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
    together : sequence of sequence of str
        Outputs that requirements over time limit together.

    Raises
    ------
    CampaignError
        When it cannot be simulated, or is no function that a linear model could be compared with.
    """
    errors, probes = draws.errors, draws.probes()
    with scenario_errors(file):
        doubt = find_doubt(scenario, draws, tolerance, timeout)
        if doubt is not None and not force:
            raise CampaignError([Problem(file, "scenario", str(doubt))])
        engine = prepare_engine(scenario, engine_name, probes, errors.mean, errors.standard_deviations)
        throughout = linear_history(scenario, engine)
        model = _linear(scenario, errors, engine, throughout, together, tolerance)
        history = drawable_history(scenario.nominal(), file)
        remarks = scenario.remarks_on(errors.mean, errors.covariance)
    record = None if doubt is None else unsettled_record(doubt)
    return PreparedSystem(
        scenario, draws, engine, engine_name, model, throughout, history, record, remarks, timeout, file
    )


def drawable_history(history: History, file: str) -> History:
    """Check the history of the truth before samples are simulated: the run's report reads and draws it afterwards."""
    try:
        return check_history(history)
    except (TypeError, ValueError) as wrong:
        raise CampaignError([Problem(file, "scenario", f"has no history that can be drawn: {wrong}")]) from None


def unsettled_record(doubt: Unsettled) -> UnsettledRecord:
    """Convert a doubt about the linear model to its record."""
    return UnsettledRecord(**{key: value for key, value in asdict(doubt).items() if (key, value) != ("noise", "")})


@contextmanager
def scenario_errors(file: str) -> Iterator[None]:
    """Convert errors of scenarios and engines into `CampaignError`."""
    try:
        yield
    except ScenarioError as wrong:
        raise CampaignError([Problem(file, f"scenario.{wrong.key}", str(wrong))]) from None
    except SimulationFailed as wrong:
        raise CampaignError([Problem(file, "scenario", str(wrong))]) from None
    except PolynomialFitError as wrong:
        raise CampaignError([Problem(file, "engine", str(wrong))]) from None


def _linear(
    scenario: Scenario, errors: ErrorModel, engine: Engine, throughout: LinearHistory | None,
    together: Sequence[Sequence[str]], tolerance: float,
) -> ModelRecord:  # fmt: skip
    """Compute the linear model, at the end and, where it is known, throughout the flight."""
    linear = scenario.linear().end
    record = ModelRecord(
        sources=_variables(scenario.sources),
        outputs=_variables(scenario.outputs),
        partials=linear.partials,
        nominal=linear.nominal,
        start_mean=errors.mean,
        start_covariance=errors.covariance,
    )
    whole = Model(linear.partials, linear.nominal, errors.mean, errors.covariance, linear.processes)
    moments = whole.outcome_mean, np.sqrt(np.diag(whole.outcome_covariance))
    return record.completed(
        {
            "origin": _origin(scenario.outputs, linear.origin),
            "mean_rounding": rounding_of_means(scenario.outputs, scenario.sources, linear.partials, *moments),
            "processes": dict(linear.processes) or None,
            "development": _development(scenario, errors, throughout, together),
            "filter": _filter_record(engine.filter, engine.epochs, scenario, errors),
            "smoother": _smoother_record(engine, scenario, errors),
            "faults": _fault_records(scenario, errors) or None,
            "gates": doubt_about_gates(scenario, errors, tolerance),
        }
    )


def _development(
    scenario: Scenario, errors: ErrorModel, throughout: LinearHistory | None, together: Sequence[Sequence[str]]
) -> PartialsRecord | None:
    """Return partial derivatives throughout the flight; none where they are not known."""
    if scenario.parts.readings != "end":
        known = scenario.linear_over_time(DEVELOPMENT_POINTS)
        record = _partials_record(known, errors)
        pairs = _pairs(scenario.outputs, together) if record.processes else ()
        if not pairs:
            return record
        added = {name: picked_entries(each, pairs) for name, each in known.processes.items()}
        return record.completed({"pairs": pairs, "process_pairs": added})
    if throughout is None:
        return None
    epochs = throughout.epochs
    return PartialsRecord(label=epochs.label, times=epochs.times, partials=throughout.partials)


def _partials_record(known: LinearSystem, errors: ErrorModel) -> PartialsRecord:
    """Describe a linear system over time."""
    record = PartialsRecord(label=known.label, times=known.times, partials=known.partials)
    variances = {name: np.diagonal(each, axis1=1, axis2=2) for name, each in known.processes.items()}
    covariance = known.covariance(errors.covariance) if variances else None
    moved = {"nominal": _some(known.nominal), "origin": _some(known.origin)}
    return record.completed({"processes": variances or None, "covariance": covariance, **moved})


def _origin(outputs: Sequence[Output], origin: Array | None) -> Array | None:
    """Return what outputs are measured from; none where all are navigation errors."""
    if all(output.of == "navigation" for output in outputs):
        return None
    return np.zeros(len(outputs)) if origin is None else origin


def _some(values: Array | None) -> Array | None:
    """Return an array of which some are not zero; else none."""
    return values if values is not None and np.any(values) else None


def _smoother_record(engine: Engine, scenario: Scenario, errors: ErrorModel) -> SmootherRecord | None:
    """Describe a smoother, with what linear analysis says of it; none without one."""
    schema = smoother_of(engine)
    if schema is None or not scenario.parts.smoother:
        return None
    known = scenario.smoothed()
    record = FilterRecord(label=known.label, times=known.times, groups=dict(schema.groups), outputs=schema.outputs)
    none, own = np.zeros((len(known.times), 0)), known.own
    if own is None:
        return None
    linear = FilterPredictionRecord(covariance=own, state_variance=none, state_true=none, believed=dict(known.believed))
    return SmootherRecord(claims=record.completed({"prediction": linear}), errors=_partials_record(known, errors))


def _fault_records(scenario: Scenario, errors: ErrorModel) -> tuple[FaultRecord, ...]:
    """Describe the faults of sensors, with what linear analysis expects of their gates."""
    if not has_gates(scenario):
        return ()
    times, records = scenario.reading_times, []
    for law in scenario.fault_laws(errors.mean, errors.covariance):
        expected = predict_fault(law)
        first, last = (int(np.abs(times - time).argmin()) for time in (law.before, law.last))
        record = FaultRecord(
            sensor=law.sensor, kind=law.kind, component=law.component, unit=law.unit, shown_in=law.shown_in,
            begin=law.begin, end=law.end, size=law.size, measurements=len(law.means), rejections=expected.rejections,
            alarm=expected.alarm, first=first, last=last,
        )  # fmt: skip
        records.append(record)
    return tuple(records)


def _pairs(outputs: Sequence[Output], together: Sequence[Sequence[str]]) -> tuple[tuple[int, int], ...]:
    """Return the pairs of outputs that requirements limit together; the size of some stands for them."""
    places = {output.name: place for place, output in enumerate(outputs)}
    groups = [
        [places[each] for each in (outputs[places[names[0]]].size_of or names if len(names) == 1 else names)]
        for names in together
    ]
    return entries_of(len(outputs), groups)[len(outputs) :]


def linear_history(scenario: Scenario, engine: Engine) -> LinearHistory | None:
    """Compute partial derivatives at the epochs of an engine by differences; none where it has no histories."""
    exact = exact_part(engine)
    if not has_histories(exact) or exact.epochs is None:
        return None
    partials, nominal = partials_throughout(exact, np.array([source.nominal for source in scenario.sources]))
    return LinearHistory(exact.epochs, partials, nominal)


def exact_part(engine: Engine) -> Engine:
    """Return the engine to which a polynomial was fitted, or the engine itself."""
    return engine.exact if isinstance(engine, PolynomialEngine) else engine


def filter_prediction(scenario: Scenario, epochs: Epochs) -> FilterPrediction | None:
    """Return what linear analysis says of the filter at the epochs; none where it says nothing of them."""
    prediction = scenario.filter_prediction()
    return prediction if prediction is not None and same_times(prediction.times, epochs.times) else None


def same_times(one: Array, other: Array) -> bool:
    """Return whether the times of epochs are the same but for rounding."""
    return one.shape == other.shape and bool(np.allclose(one, other, rtol=1e-9))


def _filter_record(
    schema: FilterSchema | None, epochs: Epochs | None, scenario: Scenario, errors: ErrorModel
) -> FilterRecord | None:
    """Describe a filter, with what linear analysis says of it and of the truth; none without one."""
    if schema is None or epochs is None:
        return None
    prediction = filter_prediction(scenario, epochs)
    record = FilterRecord(
        label=epochs.label,
        times=epochs.times,
        groups=dict(schema.groups),
        outputs=schema.outputs,
        states=schema.states,
        units=schema.units,
        sensors=dict(schema.sensors),
    )
    record = record.completed({"considered": schema.considered or None, "own_outputs": schema.own_outputs or None})
    if prediction is None:
        return record
    about_zero = errors.covariance + np.outer(errors.mean, errors.mean)
    state_true = np.einsum("mqk,kl,mql->mq", prediction.state_partials, about_zero, prediction.state_partials)
    linear = FilterPredictionRecord(
        covariance=prediction.covariance,
        state_variance=prediction.state_variance,
        state_true=sum(prediction.state_processes.values(), state_true),
        believed=dict(prediction.believed),
    )
    return record.completed({"prediction": linear})


def _variables(entries: Sequence[Source | Output]) -> tuple[Variable, ...]:
    def variable(entry: Source | Output) -> Variable:
        limit = entry.limit if isinstance(entry, Output) else None
        plain = Variable(name=entry.name, unit=entry.unit, shown_in=entry.shown_in)
        size_of = entry.size_of or None if isinstance(entry, Output) else None
        of = None if entry.of == "navigation" else entry.of
        group = entry.group or None if isinstance(entry, Source) else None
        return plain.completed({"limit": limit, "of": of, "size_of": size_of, "group": group})

    return tuple(map(variable, entries))
