"""What a run folder knows of a filter, and of the smoother behind it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mcnav.analysis.filter_evidence import FilterEvidence, LinearFilter, MeanSquares
from mcnav.analysis.linear_covariance import NOMINAL
from mcnav.arrays.types import Array
from mcnav.contract.power_sums import PowerSums
from mcnav.contract.quantities import Output
from mcnav.statistics.filter_sums import FilterMeans, FilterSums
from mcnav.store.manifest import FilterRecord
from mcnav.workflow.heavy_tails import tailed_over_time
from mcnav.workflow.recorded_model import LinearOverTime, RecordedModel
from mcnav.workflow.stored_run import StoredRun


def filter_evidence(run: StoredRun, failed: int) -> FilterEvidence | None:
    """Collect what is known of the filter of a run, of whose samples so many failed; none without a filter."""
    record, totals = run.manifest.model.filter, run.filters
    if record is None or totals is None:
        return None
    linear = linear_filter(run.model, record, run.model.over_time)
    return _evidence(run, record, totals.filter_sums, totals.power_sums, linear, failed)


def smoother_evidence(run: StoredRun, failed: int) -> FilterEvidence | None:
    """Collect what is known of the smoother of a run, as `filter_evidence` does; none without a smoother."""
    record, totals = run.manifest.model.smoother, run.filters
    if record is None or totals is None:
        return None
    linear = linear_filter(run.model, record.claims, run.model.smoothed)
    evidence = _evidence(run, record.claims, totals.smoother_sums, totals.smoothed_sums, linear, failed)
    return replace(evidence, subject="smoother")


def _evidence(
    run: StoredRun, record: FilterRecord, sums: FilterSums | None, true: PowerSums | None,
    linear: LinearFilter | None, failed: int,
) -> FilterEvidence:  # fmt: skip
    """Put together what is known of a filter, or of a smoother."""
    manifest, end = run.manifest, run.model.end
    outputs, schema = manifest.model.outputs, record.columns
    return FilterEvidence(
        label=record.label,
        times=record.times,
        outputs=tuple(Output(output.name, output.unit, output.shown_in, output.limit) for output in outputs),
        means=FilterMeans.of(schema, sums) if sums is not None and sums.samples else None,
        true=MeanSquares.of(true) if true is not None and true.count else None,
        failed=failed,
        design=manifest.design,
        sampling=run.design,
        linear=linear,
        floor=end.floor,
        withheld=tailed_over_time(manifest.model, manifest.heavy_tailed, end.withheld),
    )


def linear_filter(linear: RecordedModel, record: FilterRecord, over_time: LinearOverTime | None) -> LinearFilter | None:
    """Return what linear analysis says of a filter and of the errors; none where a manifest has nothing of it."""
    model, known = linear.record, record.prediction
    if known is None:
        return None
    contributions: dict[str, Array] = {}
    squared_means: dict[str, Array] = {}
    true = None
    if over_time is not None and over_time.is_at(record.times):
        development, mean, covariance = over_time.record, over_time.mean, over_time.covariance
        partials = development.partials
        true = covariance + mean[:, :, None] * mean[:, None, :]
        by_source = partials * (partials @ model.start_covariance)
        names = [source.name for source in model.sources]
        contributions = {name: by_source[:, :, k] for k, name in enumerate(names) if np.any(by_source[:, :, k])}
        contributions |= development.processes
        by_mean = partials * model.start_mean * mean[:, :, None]
        squared_means = {name: by_mean[:, :, k] for k, name in enumerate(names) if model.start_mean[k]}
        if development.nominal is not None:
            squared_means[NOMINAL] = development.nominal * mean
    believed = {NOMINAL: 0.0} | dict(known.believed)
    return LinearFilter(
        known.covariance, known.state_variance, true, known.state_true, contributions, believed, squared_means,
        tuple(output.unit for output in model.outputs), linear.end.floor, linear.limits,
    )  # fmt: skip
