"""Results over the flight as tables, a row for each epoch and output, cause, group, state or sensor."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from mcnav.analysis.envelopes import Envelopes
from mcnav.analysis.filter_consistency import (
    Band,
    FilterConsistency,
    GroupConsistency,
    SensorConsistency,
    SigmaConsistency,
)
from mcnav.analysis.filter_evidence import independent_share
from mcnav.arrays.products import transformed_variances
from mcnav.arrays.types import Array
from mcnav.report.columns.over_time import OverTime, TimeColumn
from mcnav.report.columns.result_table import ResultTable, Units, in_units
from mcnav.report.results.model import RunAnalysis

EPOCHS: Final = "epochs"
"""Name of the table of the outputs over time."""

Of = Callable[[SigmaConsistency], Array | None]
Bands = Callable[[SigmaConsistency], Band | None]


def _stacked(values: Sequence[Array | None]) -> Array | None:
    """Put the values of quantities beside each other, shape (epochs, quantities); none unless all are known."""
    known = [value for value in values if value is not None]
    return np.column_stack(known) if known and len(known) == len(values) else None


def _ends(bands: Sequence[Band | None]) -> Array:
    """Return the intervals of quantities that hold each by itself, shape (epochs, quantities, 2)."""
    return np.stack([band.each for band in bands if band is not None], axis=1)


def _sigma(name: str, of: Of) -> TimeColumn[Sequence[SigmaConsistency]]:
    return TimeColumn(name, lambda all_of: _stacked([of(over_flight) for over_flight in all_of]), scaled=True)


def _band(name: str, of: Bands) -> TimeColumn[Sequence[SigmaConsistency]]:
    def value(all_of: Sequence[SigmaConsistency]) -> Array | None:
        return _stacked([None if (band := of(over_flight)) is None else band.value for over_flight in all_of])

    return TimeColumn(name, value, lambda all_of: _ends([of(over_flight) for over_flight in all_of]))


RMS: Final = (_sigma("rms", lambda row: row.true), _sigma("sigma_filter", lambda row: row.filter))
RMS_LINEAR: Final = _sigma("rms_linear", lambda row: row.true_linear)
FILTER_LINEAR: Final = _sigma("sigma_filter_linear", lambda row: row.filter_linear)
RATIO: Final = _band("ratio_filter", lambda row: row.ratio)
WITHIN: Final = (
    _band("within_1_sigma", lambda row: row.within_1),
    _band("within_3_sigma", lambda row: row.within_3),
)

OF_FILTER: Final = (*RMS, RATIO, FILTER_LINEAR, *WITHIN)
"""Columns that compare the outputs' errors with the filter's sigmas."""

STATES: Final = (*RMS, RMS_LINEAR, FILTER_LINEAR, RATIO)
"""Columns of the filter's other states."""


SMOOTHED: Final = (
    RMS[0], _sigma("sigma_smoother", lambda row: row.filter), RMS_LINEAR,
    _sigma("sigma_smoother_linear", lambda row: row.filter_linear), _band("ratio_smoother", lambda row: row.ratio),
)  # fmt: skip
"""Columns that compare the outputs' errors behind a smoother with what it claims."""


def _moments(content: RunAnalysis, known: Envelopes) -> list[TimeColumn[Envelopes]]:
    """Return the columns of linear and Monte Carlo moments."""
    manifest, confidence = content.manifest, content.criterion.confidence
    sampling = manifest.sampling_design
    enough = known.samples // sampling.block_length >= sampling.fewest_blocks  # as of the same sigma at the end
    share = independent_share(manifest.design, sampling) if enough else 0.0
    withheld = list(content.model.withheld)

    def intervals(envelopes: Envelopes) -> Array:
        known = envelopes.sigma_intervals(share, confidence)
        known[:, withheld] = envelopes.sigma_intervals(0.0, confidence)[:, withheld]
        return known

    return [
        TimeColumn("mean_linear", lambda row: row.linear_mean, scaled=True),
        TimeColumn("sigma_linear", lambda row: row.linear_sigma, scaled=True),
        TimeColumn("mean_plain", lambda row: row.mean, scaled=True),
        TimeColumn("sigma_plain", lambda row: row.sigma, intervals, True),
        *(_percentile(level) for level in known.percentiles),
    ]


def _percentile(level: str) -> TimeColumn[Envelopes]:
    return TimeColumn(f"percentile_{level}", lambda row: row.percentiles[level], scaled=True)


def _nees_bound(end: str, k: int) -> TimeColumn[Sequence[GroupConsistency]]:
    def value(groups: Sequence[GroupConsistency]) -> Array:
        return np.column_stack([np.full(len(group.nees.value), group.bounds_each[k]) for group in groups])

    return TimeColumn(f"nees_bounds_{end}", value)


NEES: Final[tuple[TimeColumn[Sequence[GroupConsistency]], ...]] = (
    TimeColumn("nees", lambda groups: _stacked([group.nees.value for group in groups]),
               lambda groups: _ends([group.nees for group in groups])),
    _nees_bound("from", 0), _nees_bound("to", 1),
    TimeColumn("ratio", lambda groups: _stacked([group.ratio.value for group in groups]),
               lambda groups: _ends([group.ratio for group in groups]), variable="nees_ratio"),
    TimeColumn("ratio_linear", lambda groups: np.column_stack([
        np.full(len(group.nees.value), np.nan) if group.linear is None else group.linear for group in groups
    ]), variable="nees_ratio_linear"),
)  # fmt: skip
"""Mean NEES of each group of states, and the root of its ratio to the number of states."""

NIS: Final[tuple[TimeColumn[Sequence[SensorConsistency]], ...]] = (
    TimeColumn("accepted", lambda sensors: _stacked([sensor.accepted for sensor in sensors])),
    TimeColumn("rejected", lambda sensors: _stacked([sensor.rejected for sensor in sensors])),
    TimeColumn("nis", lambda sensors: _stacked([sensor.nis.value for sensor in sensors]),
               lambda sensors: _ends([sensor.nis for sensor in sensors])),
    TimeColumn("nis_bounds_from", lambda sensors: _stacked([sensor.bounds[:, 0] for sensor in sensors])),
    TimeColumn("nis_bounds_to", lambda sensors: _stacked([sensor.bounds[:, 1] for sensor in sensors])),
)  # fmt: skip
"""Updates and the mean NIS of each sensor since the epoch before."""


def over_time(content: RunAnalysis, units: Units = "shown") -> list[OverTime]:
    """Return results over the flight, without those that a run has not."""
    known = [epochs(content, units), budget_over_time(content, units)]
    if content.filter is not None:
        known += [_nees(content.filter), _nis(content.filter), _states(content.filter, units)]
    if content.smoother is not None:
        known.append(_smoothed(content.smoother, units))
    return [over_flight for over_flight in known if over_flight is not None]


def tables_over_time(content: RunAnalysis, units: Units = "shown") -> dict[str, ResultTable]:
    """Return them as tables by name, without those that have no rows."""
    tables = [over_flight.table for over_flight in over_time(content, units)]
    return {table.name: table for table in tables if len(table)}


def epochs(content: RunAnalysis, units: Units = "shown") -> OverTime | None:
    """Return linear and Monte Carlo moments of each output at every epoch; none where the run has no histories.

    Intervals hold at the campaign's confidence at one epoch; they are infinite where the samples allow none. Sigmas are
    about the mean; ``rms``, with a filter, is about zero, as the filter's own sigmas are.
    """
    known, result, outputs = content.envelopes, content.filter, content.manifest.model.outputs
    if known is None:
        return None
    shown = [in_units(output.unit, output.shown_in, units) for output in outputs]
    compared = result is not None and len(result.times) == len(known.times) and len(result.outputs) == len(outputs)
    return OverTime.of_columns(
        EPOCHS, "Errors over the flight", (known.label, known.times), {"output": [output.name for output in outputs]},
        {"unit": [unit for _, unit in shown]}, (_moments(content, known), known),
        *([(OF_FILTER, result.outputs)] if result is not None and compared else []),
        scale=np.array([factor for factor, _ in shown]),
    )  # fmt: skip


def budget_over_time(content: RunAnalysis, units: Units = "shown") -> OverTime | None:
    """Return the linear sigma of each output that each cause makes alone, and its share of the variance.

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
    whole = transformed_variances(known.partials, covariance)
    whole = np.maximum(sum(known.processes.values(), whole), 0.0)
    variances = np.stack(list(parts.values()), axis=2) if parts else np.zeros((*whole.shape, 0))
    with np.errstate(invalid="ignore", divide="ignore"):
        shares = variances / whole[:, :, None]
    shown = [in_units(output.unit, output.shown_in, units) for output in outputs]
    scale = np.array([factor for factor, _ in shown])
    return OverTime(
        "budget_over_time", "Linear error budget over the flight", known.label, known.times,
        {"output": [output.name for output in outputs], "cause": list(parts)}, {"unit": [unit for _, unit in shown]},
        {"sigma": np.sqrt(np.maximum(variances, 0.0)) * scale[:, None], "share": shares}, {},
    )  # fmt: skip


def _nees(result: FilterConsistency) -> OverTime | None:
    groups = result.groups
    return None if not groups else OverTime.of_columns(
        "nees", "Mean NEES over the flight", (result.label, result.times), {"group": [group.name for group in groups]},
        {"states": [group.size for group in groups]}, (NEES, groups),
    )  # fmt: skip


def _nis(result: FilterConsistency) -> OverTime | None:
    sensors = result.sensors
    return None if not sensors else OverTime.of_columns(
        "nis", "Mean NIS over the flight", (result.label, result.times),
        {"sensor": [sensor.name for sensor in sensors]}, {"components": [sensor.size for sensor in sensors]},
        (NIS, sensors),
    )  # fmt: skip


def _states(result: FilterConsistency, units: Units) -> OverTime | None:
    states = result.states
    shown = [in_units(state.unit, state.shown_in, units) for state in states]
    return None if not states else OverTime.of_columns(
        "filter_states", "Estimated errors over the flight", (result.label, result.times),
        {"state": [state.name for state in states]}, {"unit": [unit for _, unit in shown]}, (STATES, states),
        scale=np.array([factor for factor, _ in shown]), prefix="state_",
    )  # fmt: skip


def _smoothed(result: FilterConsistency, units: Units) -> OverTime | None:
    outputs = result.outputs
    shown = [in_units(output.unit, output.shown_in, units) for output in outputs]
    return None if not outputs else OverTime.of_columns(
        "smoother", "Errors behind the smoother over the flight", (result.label, result.times),
        {"output": [output.name for output in outputs]}, {"unit": [unit for _, unit in shown]}, (SMOOTHED, outputs),
        scale=np.array([factor for factor, _ in shown]), prefix="smoothed_",
    )  # fmt: skip
