"""A run as its folder holds it: read once, with all that its analysis needs."""

from __future__ import annotations

import zlib
from dataclasses import dataclass, replace

import numpy as np
import pyarrow as pa

from mcnav.analysis.comparison import Criterion
from mcnav.analysis.requirements import Requirement, requirements_from, smallest_limits
from mcnav.analysis.variance_breakdown import Predicted, predicted_from
from mcnav.arrays.types import Array, IndexArray
from mcnav.errors import RunFolderError
from mcnav.sampler.designs import SamplingDesign
from mcnav.store.chunk_files import Samples
from mcnav.store.histories import STORED, origin_in
from mcnav.store.manifest import FilterRecord, Manifest
from mcnav.store.run_files import HISTORIES, MANIFEST, SMOOTHED
from mcnav.store.run_folder import RunFolder
from mcnav.store.summaries import SUMMARY, Summary, collect_summary
from mcnav.store.totals import Totals, read_totals
from mcnav.workflow.heavy_tails import withheld_outputs
from mcnav.workflow.recorded_model import RecordedModel


@dataclass(frozen=True)
class StoredHistories:
    """Errors of a run's first samples at m epochs, shapes (m,) and (n, m, outputs), and what they are measured from."""

    times: Array
    errors: Array
    origin: Array | None


@dataclass(frozen=True)
class StoredRun:
    """What a run folder holds.

    Attributes
    ----------
    model : RecordedModel
        With the limits of requirements, and the outputs that have no verdict.
    predicted : Predicted
        What the manifest says of the variance by error source.
    samples : Samples
        Of a run that stores a summary, the first ones.
    summary : Summary or None
        Sums of all samples, of a run that stores a summary.
    filters : Totals or None
        Sums of the filter's and the smoother's samples; none without a filter.
    histories, smoothed_histories : StoredHistories or None
        There where a requirement holds at epochs.
    """

    manifest: Manifest
    requirements: tuple[Requirement, ...]
    criterion: Criterion
    model: RecordedModel
    predicted: Predicted
    samples: Samples
    summary: Summary | None
    filters: Totals | None
    histories: StoredHistories | None
    smoothed_histories: StoredHistories | None

    @property
    def design(self) -> SamplingDesign:
        """The sampling design."""
        return self.manifest.sampling_design

    @property
    def blocks(self) -> IndexArray:
        """Independent block of each sample, shape (n,)."""
        return self.design.blocks(self.samples.index)


def read_run(folder: RunFolder, unfinished: Manifest | None = None) -> StoredRun:
    """Read a finished run, or an ``unfinished`` one of that manifest, of which histories are not stored yet.

    Raises `RunFolderError` when the run is not finished, or a part of it is damaged.
    """
    manifest = folder.finished_manifest() if unfinished is None else unfinished
    try:
        requirements = requirements_from(manifest.requirements, [output.name for output in manifest.model.outputs])
        model = RecordedModel.of(manifest.model)
        predicted = predicted_from(manifest.model.to_json(), len(model.end.partials))
        criterion = Criterion(**manifest.criterion.model_dump())
        samples = folder.samples(manifest)
    except (KeyError, TypeError, ValueError) as failure:
        raise RunFolderError(f"{folder.path / MANIFEST}: is damaged ({failure}); run with --fresh") from None
    end = replace(model.end, limits=smallest_limits(requirements, len(model.end.nominal)))
    end = replace(end, withheld=withheld_outputs(manifest.model, manifest.heavy_tailed, end, samples))
    record = manifest.model.filter
    behind = {bool(requirement.of) for requirement in requirements if requirement.epochs and unfinished is None}
    return StoredRun(
        manifest=manifest,
        requirements=requirements,
        criterion=criterion,
        model=replace(model, end=end),
        predicted=predicted,
        samples=samples,
        summary=collect_summary(folder.chunk_folder, manifest.chunks) if manifest.store == SUMMARY else None,
        filters=None if record is None else _filter_totals(folder, manifest, record),
        histories=_histories(folder, manifest, HISTORIES) if False in behind else None,
        smoothed_histories=_histories(folder, manifest, SMOOTHED) if True in behind else None,
    )


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


def _histories(folder: RunFolder, manifest: Manifest, file: str) -> StoredHistories | None:
    """Read the histories of a run's first samples; none where the run has none."""
    names = [f"{output.name} [{output.unit}]" for output in manifest.model.outputs]
    histories = folder.histories(STORED, names, file)
    if histories is None:
        return None
    _, times, by_output = histories
    errors = np.stack([by_output[name] for name in names], axis=2)[: manifest.samples]
    moments = folder.epochs()
    return StoredHistories(times, errors, None if moments is None else origin_in(moments[0], names))
