"""Analyse the samples of a run folder; write its summary and report. Nothing is simulated."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from mcnav._subprocess import side_threads
from mcnav._threads import one_thread
from mcnav._types import Array, IndexArray
from mcnav.analysis.block_moments import ReducedSamples
from mcnav.analysis.budget import error_budget
from mcnav.analysis.comparison import Comparison, Criterion, Model, compare_reduced, reduce_stored, reduce_summary
from mcnav.analysis.exceedance import Event, weigh
from mcnav.analysis.failed_samples import failure_bias
from mcnav.analysis.filter_assessment import assess_filter
from mcnav.analysis.filter_evidence import FilterEvidence, LinearFilter, MeanSquares
from mcnav.analysis.linear_covariance import NOMINAL
from mcnav.analysis.linear_range import BeyondRange, limits_of
from mcnav.analysis.requirements import (
    LEVELS,
    METHOD,
    Exceedance,
    Requirement,
    RequirementResult,
    judge_requirement,
    requirements_from,
    smallest_limits,
)
from mcnav.analysis.requirements_over_time import ErrorHistories, judge_over_time
from mcnav.analysis.running_ratios import convergence
from mcnav.analysis.summary import Summary
from mcnav.analysis.tails import tails
from mcnav.analysis.variance_breakdown import predicted_from, split_difference
from mcnav.analysis.vector_sizes import components_of, sampled_sizes
from mcnav.contract.power_sums import PowerSums
from mcnav.contract.quantities import Output
from mcnav.errors import RunFolderError, reading_file
from mcnav.linear.block_sums import Normalization
from mcnav.report.results.failures import Failures, failures_in, grouped
from mcnav.report.results.model import RunAnalysis
from mcnav.sampler.designs import SamplingDesign
from mcnav.statistics.filter_sums import FilterMeans, FilterSums
from mcnav.store.chunk_files import Samples
from mcnav.store.histories import STORED, origin_in
from mcnav.store.manifest import FilterRecord, Manifest, ModelRecord, PartialsRecord
from mcnav.store.run_files import HISTORIES, MANIFEST, REPORT, SMOOTHED
from mcnav.store.run_files import SUMMARY as SUMMARY_FILE
from mcnav.store.run_folder import RunFolder
from mcnav.store.summaries import STORED_ROWS, SUMMARY, collect_summary
from mcnav.store.totals import Totals, read_totals
from mcnav.workflow.heavy_tails import tailed_over_time, withheld_outputs
from mcnav.workflow.linear_extremes import beyond_range, explain, linear_moments
from mcnav.workflow.what_if import what_if_of_run

if TYPE_CHECKING:
    import pandas as pd


def report_run(path: str | Path) -> dict[str, Any]:
    """Analyse a finished run folder again and write its summary and report.

    Raises `RunFolderError` when the folder holds no finished run, or a part of it is damaged.

    Examples
    --------
    >>> import mcnav as mc
    >>> mc.report_run("reports/first")["samples"]
    200
    """
    folder = RunFolder(Path(path))
    folder.existing_manifest()
    with folder.lock(), one_thread(), reading_file(folder.path):
        folder.finished_manifest()
        return write_results(folder, analyse(folder)).to_json()


def samples_of(path: str | Path) -> pd.DataFrame:
    """Read the samples of a finished run folder as a table, their checksums verified.

    Columns: ``index``, ``status``, ``error NAME [unit]``, ``output NAME [unit]`` and, of samples with noise,
    ``linear NAME [unit]``, with a filter ``filter NAME [unit]`` and ``nees``; SI units.

    Raises `RunFolderError` when the run is not finished, or a part of it is damaged.

    Examples
    --------
    >>> import mcnav as mc
    >>> mc.samples_of("reports/first").shape[0]
    200
    """
    import pandas as pd

    folder = RunFolder(Path(path))
    manifest = folder.finished_manifest()
    samples, names = folder.samples(manifest), manifest.sample_schema
    columns = {"index": samples.index, "status": samples.status}
    columns |= dict(zip(names.errors, samples.errors.T, strict=True))
    columns |= dict(zip(names.outputs, samples.outputs.T, strict=True))
    columns |= dict(zip(names.linear, samples.linear.T, strict=True))
    return pd.DataFrame(columns | dict(zip(names.filter, samples.filter.T, strict=True)))


def analyse(folder: RunFolder, unfinished: Manifest | None = None) -> RunAnalysis:
    """Analyse the samples of a run folder.

    Parameters
    ----------
    unfinished : Manifest, optional
        Manifest of a run in progress, in place of the stored one.

    Raises
    ------
    RunFolderError
        When the run is not finished or damaged.
    """
    manifest = folder.finished_manifest() if unfinished is None else unfinished
    try:
        model = linear_model(manifest.model)
        criterion = Criterion(**manifest.criterion.model_dump())
        described = manifest.to_json()["model"]
        requirements = requirements_from([entry.model_dump() for entry in manifest.requirements], described["outputs"])
        model = replace(model, limits=smallest_limits(requirements, len(model.nominal)))
        units = [output.unit for output in manifest.model.outputs]
        predicted = predicted_from(described, len(model.partials))
        samples = folder.samples(manifest)
    except (KeyError, TypeError, ValueError) as failure:
        raise RunFolderError(f"{folder.path / MANIFEST}: is damaged ({failure}); run with --fresh") from None
    model = replace(model, withheld=withheld_outputs(manifest.model, manifest.heavy_tailed, model, samples))
    design = manifest.sampling_design
    blocks = design.blocks(samples.index)
    with side_threads(1) as beside:
        in_tails = beside.submit(tails, model, samples.outputs, blocks, units, criterion)
        reduced, failures = _reduce(folder, manifest, model, samples)
        comparison = compare_reduced(model, reduced, criterion, design)
        filtered = filter_evidence(folder, manifest, comparison.failed, model.floor, model.withheld)
        smoothed = smoother_evidence(folder, manifest, comparison.failed, model.floor, model.withheld)
    histories, smoothed_histories = (
        error_histories(folder, manifest, design, smoothed)
        if unfinished is None and any(each.epochs and bool(each.of) == smoothed for each in requirements) else None
        for smoothed in (False, True)
    )  # fmt: skip
    beyond = beyond_range(manifest.model, model)
    judge = _Judge(
        manifest, requirements, model, criterion, comparison, samples.outputs, blocks, histories, smoothed_histories,
        beyond,
    )  # fmt: skip
    return RunAnalysis(
        folder=folder,
        manifest=manifest,
        samples=samples,
        model=model,
        criterion=criterion,
        comparison=comparison,
        budget=error_budget(model.partials, model.covariance, list(model.processes.values())),
        causes=split_difference(model, reduced.successful.covariance, comparison, predicted),
        convergence=convergence(reduced.moments, comparison, design, model.withheld),
        tails=in_tails.result(),
        left_out=failure_bias(model, reduced),
        requirements=tuple(map(judge.result, requirements)),
        failures=failures,
        filter=None if filtered is None else assess_filter(filtered, criterion),
        smoother=None if smoothed is None else assess_filter(smoothed, criterion),
        beyond=beyond,
        sizes=sampled_sizes(model, samples.outputs, blocks, criterion),
        histories=histories,
        smoothed_histories=smoothed_histories,
    )


def _reduce(folder: RunFolder, manifest: Manifest, model: Model, samples: Samples) -> tuple[ReducedSamples, Failures]:
    """Reduce the samples to sums, and group those that failed by reason; where a summary is stored, by its sums."""
    linear = samples.linear if model.processes else None
    blocks = manifest.sampling_design.blocks(samples.index)
    reduced = reduce_stored(model, samples.errors, samples.outputs, blocks, linear)
    frame = summary_frame(manifest)
    if frame is None:
        return reduced, failures_in(samples.status, samples.index.tolist())
    whole = collect_summary(folder.chunk_folder, manifest.chunks)
    failures = grouped({reason: (each.samples, each.first) for reason, each in whole.failures.items()})
    return reduce_summary(model, frame, whole.sums, whole.samples, reduced.stored), failures


@dataclass(frozen=True)
class _Judge:
    """Numbers by which requirements are judged."""

    manifest: Manifest
    requirements: tuple[Requirement, ...]
    model: Model
    criterion: Criterion
    comparison: Comparison
    outputs: Array
    blocks: IndexArray
    histories: ErrorHistories | None
    smoothed_histories: ErrorHistories | None
    beyond: BeyondRange | None

    def result(self, requirement: Requirement) -> RequirementResult:
        """Judge a requirement, and add what linear analysis says of it."""
        confidence = self.criterion.confidence
        if requirement.epochs:
            histories = self.smoothed_histories if requirement.of else self.histories
            result = judge_over_time(requirement, histories, confidence)
            if histories is not None and max(requirement.epochs) < len(histories.times):
                result = self._with_exceedance(result, requirement, histories.errors, histories.blocks)
        else:
            most = STORED_ROWS if self.manifest.store == SUMMARY else None
            result = judge_requirement(
                requirement, self.model, self.outputs, self.blocks, self.comparison, confidence, most
            )
            result = self._with_exceedance(result, requirement, self.outputs, self.blocks)
        return explain(result, self.manifest.model, self.model, self.beyond)

    def _with_exceedance(
        self, result: RequirementResult, requirement: Requirement, outcomes: Array, blocks: IndexArray
    ) -> RequirementResult:
        """Add what flights chosen with the linear model say of a requirement, where there are some."""
        number = self.requirements.index(requirement)
        for record in self.manifest.model.exceedance or ():
            if record.requirement == number:
                exceedance = Exceedance(
                    record.estimate, record.low, record.high, record.flights, record.refusal, record.way, record.sides,
                    record.power, LEVELS if record.by_levels else METHOD,
                )  # fmt: skip
                origin = self.model.origin
                if requirement.epochs:
                    origin = None if self.histories is None else self.histories.origin
                event, confidence = Event.of(requirement, self.model.sizes, origin), self.criterion.confidence
                return weigh(result, exceedance, event, outcomes, blocks, confidence)
        return result


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
    found = _evidence(manifest, record, totals.filter_sums, totals.power_sums, linear, failed, floor)
    return replace(found, withheld=tailed_over_time(manifest.model, manifest.heavy_tailed, withheld))


def smoother_evidence(
    folder: RunFolder, manifest: Manifest, failed: int, floor: Array | None = None, withheld: Sequence[int] = ()
) -> FilterEvidence | None:
    """Collect what is known of the smoother of a run, as `filter_evidence` does; none without a smoother."""
    record, filtered = manifest.model.smoother, manifest.model.filter
    if record is None or filtered is None:
        return None
    totals = _filter_totals(folder, manifest, filtered)
    linear = linear_filter(manifest.model, record.claims, record.errors, floor)
    found = _evidence(manifest, record.claims, totals.smoother_sums, totals.smoothed_sums, linear, failed, floor)
    tailed = tailed_over_time(manifest.model, manifest.heavy_tailed, withheld)
    return replace(found, subject="smoother", withheld=tailed)


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


def error_histories(
    folder: RunFolder, manifest: Manifest, design: SamplingDesign, smoothed: bool = False
) -> ErrorHistories | None:
    """Read the histories of a run's first samples, with the linear moments where these are known at the same epochs.

    ``smoothed`` are those behind the smoother.
    """
    model, development = manifest.model, manifest.model.development
    if smoothed:
        development = None if model.smoother is None else model.smoother.errors
    names = [f"{output.name} [{output.unit}]" for output in model.outputs]
    histories = folder.histories(STORED, names, SMOOTHED if smoothed else HISTORIES)
    if histories is None:
        return None
    _, times, by_output = histories
    errors = np.stack([by_output[name] for name in names], axis=2)[: manifest.samples]
    known = development is not None and same_times(development.times, times)
    if development is not None and development.processes and development.covariance is None:
        known = False  # an earlier manifest, without the covariance that noise adds
    mean, covariance = linear_moments(model, development) if development is not None and known else (None, None)
    sizes, blocks = components_of(model.outputs), design.blocks(np.arange(len(errors)))
    moments = folder.epochs()
    origin = None if moments is None else origin_in(moments[0], names)
    return ErrorHistories(times, errors, blocks, mean, covariance, STORED, sizes, origin)


def same_times(one: Array, other: Array) -> bool:
    """Return whether two lists of times are the same."""
    return one.shape == other.shape and bool(np.allclose(one, other, rtol=1e-9))


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


def write_results(folder: RunFolder, analysis: RunAnalysis, report: bool = True) -> Summary:
    """Write the summary of an analysed run, and its report or none; return the summary.

    An earlier report, which may be of fewer samples, is deleted when none is written.
    """
    if report:
        from mcnav.report.pages.run.page import render

        page = render(
            replace(analysis, what_if=what_if_of_run(analysis))
        ).encode()  # refuses a folder without history or campaign before anything is written
    else:
        (folder.path / REPORT).unlink(missing_ok=True)
    summary = analysis.summary.as_stored
    folder.write_json(SUMMARY_FILE, summary.to_json())
    if report:
        folder.write(REPORT, page)
    return summary


def summary_frame(manifest: Manifest) -> Normalization | None:
    """Return how the samples of a run are reduced to sums; none when all are stored."""
    if manifest.store != SUMMARY:
        return None
    model, length = linear_model(manifest.model), manifest.sampling_design.block_length
    return Normalization.of(
        model.partials, model.mean, model.outcome_mean, model.outcome_covariance, manifest.samples, length
    )


def linear_model(record: ModelRecord) -> Model:
    """Return the linear model of a manifest."""
    processes = record.processes or {}
    return Model(
        record.partials,
        record.nominal,
        record.start_mean,
        record.start_covariance,
        processes,
        components_of(record.outputs),
        limits_of(output.limit for output in record.outputs),
        origin=record.origin,
    )
