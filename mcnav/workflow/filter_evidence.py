"""What a run folder knows of a filter, and of the smoother behind it."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pyarrow as pa

from mcnav.analysis.filter_evidence import FilterEvidence, LinearFilter, MeanSquares
from mcnav.analysis.linear_covariance import NOMINAL
from mcnav.analysis.linear_range import limits_of
from mcnav.arrays.types import Array
from mcnav.contract.power_sums import PowerSums
from mcnav.contract.quantities import Output
from mcnav.errors import RunFolderError
from mcnav.linear.at_epochs import same_times
from mcnav.statistics.filter_sums import FilterMeans, FilterSums
from mcnav.store.manifest import FilterRecord, Manifest, ModelRecord, PartialsRecord
from mcnav.store.run_folder import RunFolder
from mcnav.store.totals import Totals, read_totals
from mcnav.workflow.heavy_tails import tailed_over_time
from mcnav.workflow.recorded_model import linear_moments


def filter_evidence(
    folder: RunFolder, manifest: Manifest, failed: int, floor: Array | None = None, withheld: Sequence[int] = ()
) -> FilterEvidence | None:
    """Collect what is known of the filter of a run, of whose samples so many failed; none without a filter.

    ``withheld`` are the outputs that depend on a source with heavy tails at the end.

    Raises `RunFolderError` when a chunk's sums are damaged.
    """
    record = manifest.model.filter
    if record is None:
        return None
    totals = _filter_totals(folder, manifest, record)
    linear = linear_filter(manifest.model, record, manifest.model.development, floor)
    evidence = _evidence(manifest, record, totals.filter_sums, totals.power_sums, linear, failed, floor)
    return replace(evidence, withheld=tailed_over_time(manifest.model, manifest.heavy_tailed, withheld))


def smoother_evidence(
    folder: RunFolder, manifest: Manifest, failed: int, floor: Array | None = None, withheld: Sequence[int] = ()
) -> FilterEvidence | None:
    """Collect what is known of the smoother of a run, as `filter_evidence` does; none without a smoother."""
    record, filtered = manifest.model.smoother, manifest.model.filter
    if record is None or filtered is None:
        return None
    totals = _filter_totals(folder, manifest, filtered)
    linear = linear_filter(manifest.model, record.claims, record.errors, floor)
    evidence = _evidence(manifest, record.claims, totals.smoother_sums, totals.smoothed_sums, linear, failed, floor)
    tailed = tailed_over_time(manifest.model, manifest.heavy_tailed, withheld)
    return replace(evidence, subject="smoother", withheld=tailed)


def _filter_totals(folder: RunFolder, manifest: Manifest, record: FilterRecord) -> Totals:
    """Read the sums of filters and smoothers; `RunFolderError` where they are damaged."""
    outputs, smoother, chunks = manifest.model.outputs, manifest.model.smoother, manifest.chunks
    behind = None if smoother is None else smoother.claims.columns
    try:
        pivot = np.zeros((len(record.times), len(outputs)))
        totals = read_totals(pivot, record.columns, folder.chunk_folder, chunks, smoother=behind)
        sums = totals.filter_sums
        if sums is not None and len(sums.counts) != len(record.times) + 1:
            raise ValueError(f"{len(sums.counts) - 1} epochs in place of {len(record.times)}")
    except (OSError, ValueError, OverflowError, pa.ArrowException, zlib.error) as failure:
        raise RunFolderError(f"{folder.chunk_folder}: sums of filters are damaged ({failure})") from None
    return totals


def _evidence(
    manifest: Manifest, record: FilterRecord, sums: FilterSums | None, true: PowerSums | None,
    linear: LinearFilter | None, failed: int, floor: Array | None,
) -> FilterEvidence:  # fmt: skip
    """Put together what is known of a filter, or of a smoother."""
    outputs, schema = manifest.model.outputs, record.columns
    return FilterEvidence(
        label=record.label,
        times=record.times,
        outputs=tuple(Output(each.name, each.unit, each.shown_in, each.limit) for each in outputs),
        means=FilterMeans.of(schema, sums) if sums is not None and sums.samples else None,
        true=MeanSquares.of(true) if true is not None and true.count else None,
        failed=failed,
        design=manifest.design,
        sampling=manifest.sampling_design,
        linear=linear,
        floor=floor,
    )


def linear_filter(
    model: ModelRecord, record: FilterRecord, development: PartialsRecord | None, floor: Array | None = None
) -> LinearFilter | None:
    """Return what linear analysis says of a filter and of the errors; none where a manifest has nothing of it."""
    known = record.prediction
    if known is None:
        return None
    contributions: dict[str, Array] = {}
    squared_means: dict[str, Array] = {}
    true = None
    if development is not None and same_times(development.times, record.times):
        partials, mean, covariance = development.partials, *linear_moments(model, development)
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
        tuple(output.unit for output in model.outputs), floor, limits_of(output.limit for output in model.outputs),
    )  # fmt: skip
