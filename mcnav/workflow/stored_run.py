"""A run as its folder holds it: read once, with all that its analysis needs."""

from __future__ import annotations

from dataclasses import dataclass, replace

from mcnav.analysis.comparison import Criterion
from mcnav.analysis.requirements import Requirement, requirements_from, smallest_limits
from mcnav.analysis.variance_breakdown import Predicted, predicted_from
from mcnav.arrays.types import IndexArray
from mcnav.errors import RunFolderError
from mcnav.sampler.designs import SamplingDesign
from mcnav.store.chunk_files import Samples
from mcnav.store.manifest import Manifest
from mcnav.store.run_files import MANIFEST
from mcnav.store.run_folder import RunFolder
from mcnav.store.stored_errors import StoredHistories, read_filter_totals, read_histories
from mcnav.store.summaries import SUMMARY, Summary, collect_summary
from mcnav.store.totals import Totals
from mcnav.workflow.heavy_tails import withheld_outputs
from mcnav.workflow.recorded_model import RecordedModel


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
    names = [output.name for output in manifest.model.outputs]
    try:
        samples = folder.samples(manifest)
        requirements = requirements_from(manifest.requirements, names)
        criterion = Criterion(**manifest.criterion.model_dump())
        predicted = predicted_from(manifest.model.to_json(), len(names))
        model = RecordedModel.of(manifest.model)
    except (KeyError, TypeError, ValueError) as failure:
        raise RunFolderError(f"{folder.path / MANIFEST}: is damaged ({failure}); run with --fresh") from None
    summary = collect_summary(folder.chunk_folder, manifest.chunks) if manifest.store == SUMMARY else None
    filters = read_filter_totals(folder, manifest)
    asked = {bool(requirement.of) for requirement in requirements if requirement.epochs and unfinished is None}
    histories, smoothed = read_histories(folder, manifest, asked)
    end = replace(model.end, limits=smallest_limits(requirements, len(names)))
    end = replace(end, withheld=withheld_outputs(manifest.model, manifest.heavy_tailed, end, samples))
    return StoredRun(
        manifest=manifest,
        requirements=requirements,
        criterion=criterion,
        model=replace(model, end=end),
        predicted=predicted,
        samples=samples,
        summary=summary,
        filters=filters,
        histories=histories,
        smoothed_histories=smoothed,
    )
