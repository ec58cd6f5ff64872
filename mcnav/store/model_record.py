"""What linear analysis says of a system, as it is written into the manifest of a run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Protocol

import numpy as np

from mcnav.arrays.products import transformed_variances
from mcnav.arrays.types import Array
from mcnav.contract.engine import Engine, smoother_of
from mcnav.contract.filter_record import FilterPrediction
from mcnav.contract.gates import FaultLaw
from mcnav.contract.linear import LinearModel, LinearSystem
from mcnav.contract.quantities import Output, Source
from mcnav.contract.scenario import Scenario
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
from mcnav.systems.user.soundness import Unsettled


class StoppedFault(Protocol):
    """Expected rejections of the measurements during a fault, and the probability of any."""

    @property
    def rejections(self) -> float:
        """Number."""

    @property
    def alarm(self) -> float:
        """Probability."""


def variables(entries: Sequence[Source | Output]) -> tuple[Variable, ...]:
    """Describe sources or outputs."""

    def variable(entry: Source | Output) -> Variable:
        limit = entry.limit if isinstance(entry, Output) else None
        plain = Variable(name=entry.name, unit=entry.unit, shown_in=entry.shown_in)
        size_of = entry.size_of or None if isinstance(entry, Output) else None
        of = None if entry.of == "navigation" else entry.of
        group = entry.group or None if isinstance(entry, Source) else None
        return plain.completed({"limit": limit, "of": of, "size_of": size_of, "group": group})

    return tuple(map(variable, entries))


def end_record(
    sources: Sequence[Source], outputs: Sequence[Output], end: LinearModel, mean: Array, covariance: Array
) -> ModelRecord:
    """Describe the linear model at the end, for errors of a mean and covariance."""
    record = ModelRecord(
        sources=variables(sources),
        outputs=variables(outputs),
        partials=end.partials,
        nominal=end.nominal,
        start_mean=mean,
        start_covariance=covariance,
    )
    origin = None
    if any(output.of != "navigation" for output in outputs):
        origin = np.zeros(len(outputs)) if end.origin is None else end.origin
    return record.completed({"origin": origin, "processes": dict(end.processes) or None})


def partials_record(
    system: LinearSystem, start_covariance: Array, pairs: Sequence[tuple[int, int]] = ()
) -> PartialsRecord:
    """Describe a linear system over time, with what noise adds between pairs of outputs."""
    record = PartialsRecord(label=system.label, times=system.times, partials=system.partials)
    variances = {name: np.diagonal(added, axis1=1, axis2=2) for name, added in system.processes.items()}
    covariance = system.covariance(start_covariance) if variances else None
    moved = {"nominal": _unless_zero(system.nominal), "origin": _unless_zero(system.origin)}
    record = record.completed({"processes": variances or None, "covariance": covariance, **moved})
    if not (pairs and variances):
        return record
    rows, columns = np.array(pairs).T
    added = {name: process[..., rows, columns] for name, process in system.processes.items()}
    return record.completed({"pairs": tuple(pairs), "process_pairs": added})


def filter_record(
    engine: Engine, prediction: FilterPrediction | None, mean: Array, covariance: Array
) -> FilterRecord | None:
    """Describe the filter of an engine, with what linear analysis says of it with errors of a mean and covariance.

    None without a filter.
    """
    schema, epochs = engine.filter, engine.epochs
    if schema is None or epochs is None:
        return None
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
    about_zero = covariance + np.outer(mean, mean)
    state_true = transformed_variances(prediction.state_partials, about_zero)
    linear = FilterPredictionRecord(
        covariance=prediction.covariance,
        state_variance=prediction.state_variance,
        state_true=sum(prediction.state_processes.values(), state_true),
        believed=dict(prediction.believed),
    )
    return record.completed({"prediction": linear})


def smoother_record(engine: Engine, scenario: Scenario, start_covariance: Array) -> SmootherRecord | None:
    """Describe the smoother of an engine, with what linear analysis says of it; none where it says nothing."""
    schema = smoother_of(engine)
    if schema is None or not scenario.parts.smoother:
        return None
    smoothed = scenario.smoothed()
    if smoothed.own is None:
        return None
    record = FilterRecord(
        label=smoothed.label, times=smoothed.times, groups=dict(schema.groups), outputs=schema.outputs
    )
    no_states = np.zeros((len(smoothed.times), 0))
    linear = FilterPredictionRecord(
        covariance=smoothed.own, state_variance=no_states, state_true=no_states, believed=dict(smoothed.believed)
    )
    errors = partials_record(smoothed, start_covariance)
    return SmootherRecord(claims=record.completed({"prediction": linear}), errors=errors)


def fault_record(law: FaultLaw, stopped: StoppedFault, times: Array) -> FaultRecord:
    """Describe the fault of a sensor, with what its gate is expected to stop of it, at epochs, s."""
    first, last = (int(np.abs(times - time).argmin()) for time in (law.before, law.last))
    return FaultRecord(
        sensor=law.sensor, kind=law.kind, component=law.component, unit=law.unit, shown_in=law.shown_in,
        begin=law.begin, end=law.end, size=law.size, measurements=len(law.means),
        rejections=stopped.rejections, alarm=stopped.alarm, first=first, last=last,
    )  # fmt: skip


def unsettled_record(doubt: Unsettled) -> UnsettledRecord:
    """Describe a doubt about the linear model."""
    return UnsettledRecord(**{key: value for key, value in asdict(doubt).items() if (key, value) != ("noise", "")})


def _unless_zero(values: Array | None) -> Array | None:
    """Return an array of which some are not zero; else none."""
    return values if values is not None and np.any(values) else None
