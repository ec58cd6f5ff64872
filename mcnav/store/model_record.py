"""What linear analysis says of a system, as it is written into the manifest of a run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict

import numpy as np

from mcnav._types import Array
from mcnav.contract.filter_record import FilterPrediction, FilterSchema
from mcnav.contract.gates import FaultLaw
from mcnav.contract.history import Epochs
from mcnav.contract.linear import LinearSystem
from mcnav.contract.quantities import Output, Source
from mcnav.store.manifest import (
    FaultRecord,
    FilterPredictionRecord,
    FilterRecord,
    PartialsRecord,
    SmootherRecord,
    UnsettledRecord,
    Variable,
)
from mcnav.systems.user.soundness import Unsettled


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


def origin_of(outputs: Sequence[Output], origin: Array | None) -> Array | None:
    """Return what outputs are measured from; none where all are navigation errors."""
    if all(output.of == "navigation" for output in outputs):
        return None
    return np.zeros(len(outputs)) if origin is None else origin


def partials_record(system: LinearSystem, start_covariance: Array) -> PartialsRecord:
    """Describe a linear system over time."""
    record = PartialsRecord(label=system.label, times=system.times, partials=system.partials)
    variances = {name: np.diagonal(added, axis1=1, axis2=2) for name, added in system.processes.items()}
    covariance = system.covariance(start_covariance) if variances else None
    moved = {"nominal": _unless_zero(system.nominal), "origin": _unless_zero(system.origin)}
    return record.completed({"processes": variances or None, "covariance": covariance, **moved})


def filter_record(
    schema: FilterSchema, epochs: Epochs, prediction: FilterPrediction | None, mean: Array, covariance: Array
) -> FilterRecord:
    """Describe a filter, with what linear analysis says of it with errors of some mean and covariance, or nothing."""
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
    state_true = np.einsum("mqk,kl,mql->mq", prediction.state_partials, about_zero, prediction.state_partials)
    linear = FilterPredictionRecord(
        covariance=prediction.covariance,
        state_variance=prediction.state_variance,
        state_true=sum(prediction.state_processes.values(), state_true),
        believed=dict(prediction.believed),
    )
    return record.completed({"prediction": linear})


def smoother_record(schema: FilterSchema, smoothed: LinearSystem, start_covariance: Array) -> SmootherRecord | None:
    """Describe a smoother, with what linear analysis says of it; none where it claims nothing."""
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


def fault_record(law: FaultLaw, rejections: float, alarm: float, times: Array) -> FaultRecord:
    """Describe the fault of a sensor, with the expected rejections and the probability of any, at epochs, s."""
    first, last = (int(np.abs(times - time).argmin()) for time in (law.before, law.last))
    return FaultRecord(
        sensor=law.sensor, kind=law.kind, component=law.component, unit=law.unit, shown_in=law.shown_in,
        begin=law.begin, end=law.end, size=law.size, measurements=len(law.means), rejections=rejections,
        alarm=alarm, first=first, last=last,
    )  # fmt: skip


def unsettled_record(doubt: Unsettled) -> UnsettledRecord:
    """Describe a doubt about the linear model."""
    return UnsettledRecord(**{key: value for key, value in asdict(doubt).items() if (key, value) != ("noise", "")})


def _unless_zero(values: Array | None) -> Array | None:
    """Return an array of which some are not zero; else none."""
    return values if values is not None and np.any(values) else None
