"""Results over the flight as tables, a row for each epoch and output, cause, group, state or sensor."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from mcnav._types import Array
from mcnav.analysis.envelopes import Envelopes
from mcnav.analysis.filter_consistency import Band, FilterConsistency, SigmaConsistency
from mcnav.analysis.filter_evidence import independent_share
from mcnav.report.model import RunAnalysis
from mcnav.report.result_table import ResultTable, Units, in_units
from mcnav.store.manifest import Variable

EPOCHS: Final = "epochs"
"""Name of the table of the outputs over time."""


def tables_over_time(content: RunAnalysis, units: Units = "shown") -> dict[str, ResultTable]:
    """Return the tables of results over the flight by name, without those that a run has not."""
    tables = [epochs(content, units), budget_over_time(content, units)]
    if content.filter is not None:
        tables += [_nees(content.filter), _nis(content.filter), _states(content.filter, units)]
    return {table.name: table for table in tables if table is not None and len(table)}


def epochs(content: RunAnalysis, units: Units = "shown") -> ResultTable | None:
    """Tabulate linear and Monte Carlo moments of each output at every epoch; none where the run has no histories.

    Intervals hold at the campaign's confidence at one epoch; they are infinite where the samples allow none. Sigmas are
    about the mean; ``rms``, with a filter, is about zero, as the filter's own sigmas are.
    """
    known = content.envelopes
    if known is None:
        return None
    outputs = content.manifest.model.outputs
    manifest, confidence = content.manifest, content.criterion.confidence
    intervals = known.sigma_intervals(independent_share(manifest.design, manifest.sampling_design), confidence)
    moments = {
        "mean_linear": known.linear_mean, "sigma_linear": known.linear_sigma, "mean_plain": known.mean,
        "sigma_plain": known.sigma, "sigma_plain_from": intervals[:, :, 0], "sigma_plain_to": intervals[:, :, 1],
        **{f"percentile_{level}": values for level, values in known.percentiles.items()},
    }  # fmt: skip
    columns, scale = _by_name(known.label, known.times, "output", outputs, units)
    columns |= {name: (values * scale).ravel() for name, values in moments.items()}
    columns |= _of_filter(content.filter, known, scale)
    return ResultTable(EPOCHS, "Errors over the flight", 2, columns)


def _by_name(
    label: str, times: Array, kind: str, variables: Sequence[Variable], units: Units
) -> tuple[dict[str, NDArray[Any]], Array]:
    """Return the columns that identify rows by time and name, with the unit; and the factors from SI to the units."""
    shown = [in_units(each.unit, each.shown_in, units) for each in variables]
    columns: dict[str, NDArray[Any]] = {
        label: np.repeat(times, len(variables)),
        kind: np.tile(np.array([each.name for each in variables], dtype=object), len(times)),
        "unit": np.tile(np.array([unit for _, unit in shown], dtype=object), len(times)),
    }
    return columns, np.array([factor for factor, _ in shown])


def _of_filter(consistency: FilterConsistency | None, known: Envelopes, scale: Array) -> dict[str, Array]:
    """Return columns that compare the outputs' errors with the filter's sigmas."""
    if consistency is None or len(consistency.times) != len(known.times) or len(consistency.outputs) != len(scale):
        return {}
    columns = {
        "rms": _across([each.true for each in consistency.outputs], scale),
        "sigma_filter": _across([each.filter for each in consistency.outputs], scale),
        **_bands("ratio_filter", [each.ratio for each in consistency.outputs]),
    }
    if all(each.filter_linear is not None for each in consistency.outputs):
        columns["sigma_filter_linear"] = _across([_known(each.filter_linear) for each in consistency.outputs], scale)
    for name, bands in (
        ("within_1_sigma", [each.within_1 for each in consistency.outputs]),
        ("within_3_sigma", [each.within_3 for each in consistency.outputs]),
    ):
        if all(band is not None for band in bands):
            columns |= _bands(name, [band for band in bands if band is not None])
    return columns


def _known(values: Array | None) -> Array:
    return np.empty(0) if values is None else values


def _across(columns: Sequence[Array], scale: Array | float = 1.0) -> Array:
    """Interleave columns of quantities, epoch by epoch."""
    return np.asarray((np.column_stack(columns) * scale).ravel())


def _bands(name: str, bands: Sequence[Band]) -> dict[str, Array]:
    """Return values and intervals of several quantities, epoch by epoch; each interval holds by itself."""
    result = {name: [band.value for band in bands]}
    result |= {f"{name}_{end}": [band.each[:, k] for band in bands] for k, end in enumerate(("from", "to"))}
    return {key: _across(values) for key, values in result.items()}


def budget_over_time(content: RunAnalysis, units: Units = "shown") -> ResultTable | None:
    """Tabulate the linear sigma of each output that each cause makes alone, and its share of the variance.

    Shares lack what correlations between sources contribute.
    """
    known = content.development
    if known is None or not len(known.times):
        return None
    model, outputs = content.model, content.manifest.model.outputs
    names = [source.name for source in content.manifest.model.sources]
    covariance = model.covariance
    parts = {name: (known.partials[:, :, j] ** 2) * covariance[j, j] for j, name in enumerate(names)}
    parts = {name: part for name, part in parts.items() if np.any(part > 0.0)} | dict(known.processes)
    whole = np.einsum("tij,jk,tik->ti", known.partials, covariance, known.partials, optimize=True)
    whole = np.maximum(sum(known.processes.values(), whole), 0.0)
    columns, scale = _by_name(known.label, known.times, "output", outputs, units)
    count = len(parts)
    repeated = {name: np.repeat(values, count) for name, values in columns.items()}
    variances = np.stack(list(parts.values()), axis=2) if parts else np.zeros((*whole.shape, 0))
    with np.errstate(invalid="ignore", divide="ignore"):
        shares = variances / whole[:, :, None]
    label, output, unit = repeated.values()
    table = {
        known.label: label,
        "output": output,
        "cause": np.tile(np.array(list(parts), dtype=object), whole.size),
        "unit": unit,
        "sigma": (np.sqrt(np.maximum(variances, 0.0)) * scale[:, None]).ravel(),
        "share": shares.ravel(),
    }
    return ResultTable("budget_over_time", "Linear error budget over the flight", 3, table)


def _named(consistency: FilterConsistency, kind: str, names: Sequence[str]) -> dict[str, NDArray[Any]]:
    """Return the columns that identify rows by time and name."""
    return {
        consistency.label: np.repeat(consistency.times, len(names)),
        kind: np.tile(np.array(names, dtype=object), len(consistency.times)),
    }


def _nees(consistency: FilterConsistency) -> ResultTable | None:
    """Tabulate the mean NEES of each group of states, and the root of its ratio to the number of states."""
    groups, instants = consistency.groups, len(consistency.times)
    if not groups:
        return None
    columns: dict[str, Any] = _named(consistency, "group", [group.name for group in groups])
    columns["states"] = np.tile([group.size for group in groups], instants)
    columns |= _bands("nees", [group.nees for group in groups])
    for k, end in enumerate(("from", "to")):
        columns[f"nees_bounds_{end}"] = np.tile([group.bounds_each[k] for group in groups], instants)
    columns |= _bands("ratio", [group.ratio for group in groups])
    linear = [np.full(instants, np.nan) if group.linear is None else group.linear for group in groups]
    return ResultTable("nees", "Mean NEES over the flight", 2, columns | {"ratio_linear": _across(linear)})


def _nis(consistency: FilterConsistency) -> ResultTable | None:
    """Tabulate updates and the mean NIS of each sensor since the epoch before."""
    sensors = consistency.sensors
    if not sensors:
        return None
    columns: dict[str, Any] = _named(consistency, "sensor", [sensor.name for sensor in sensors])
    columns["components"] = np.tile([sensor.size for sensor in sensors], len(consistency.times))
    columns["accepted"] = _across([sensor.accepted for sensor in sensors])
    columns["rejected"] = _across([sensor.rejected for sensor in sensors])
    columns |= _bands("nis", [sensor.nis for sensor in sensors])
    for k, end in enumerate(("from", "to")):
        columns[f"nis_bounds_{end}"] = _across([sensor.bounds[:, k] for sensor in sensors])
    return ResultTable("nis", "Mean NIS over the flight", 2, columns)


def _states(consistency: FilterConsistency, units: Units) -> ResultTable | None:
    """Tabulate true and filter sigma of the filter's other states."""
    states: Sequence[SigmaConsistency] = consistency.states
    if not states:
        return None
    columns: dict[str, Any] = _named(consistency, "state", [state.name for state in states])
    shown = [in_units(state.unit, state.shown_in, units) for state in states]
    scale = np.array([factor for factor, _ in shown])
    columns["unit"] = np.tile(np.array([unit for _, unit in shown], dtype=object), len(consistency.times))
    for name, sigmas in _sigmas(states).items():
        columns[name] = _across(sigmas, scale)
    columns |= _bands("ratio_filter", [state.ratio for state in states])
    return ResultTable("filter_states", "Estimated errors over the flight", 2, columns)


def _sigmas(states: Sequence[SigmaConsistency]) -> Mapping[str, list[Array]]:
    """Return the sigmas of states by the names of columns, linear ones where all are known."""
    sigmas = {"rms": [state.true for state in states], "sigma_filter": [state.filter for state in states]}
    for name, values in (
        ("rms_linear", [state.true_linear for state in states]),
        ("sigma_filter_linear", [state.filter_linear for state in states]),
    ):
        if all(each is not None for each in values):
            sigmas[name] = [_known(each) for each in values]
    return sigmas
