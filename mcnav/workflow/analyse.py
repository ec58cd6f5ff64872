"""Analyse the samples of a run folder; write its summary and report. Nothing is simulated."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mcnav.analysis.block_moments import ReducedSamples
from mcnav.analysis.budget import error_budget
from mcnav.analysis.comparison import Criterion, Model, compare_reduced, reduce_stored, reduce_summary
from mcnav.analysis.failed_samples import failure_bias
from mcnav.analysis.filter_assessment import assess_filter
from mcnav.analysis.requirements import (
    requirements_from,
    smallest_limits,
)
from mcnav.analysis.requirements_over_time import ErrorHistories
from mcnav.analysis.running_ratios import convergence
from mcnav.analysis.sized_outputs import components_of
from mcnav.analysis.summary import Summary
from mcnav.analysis.tails import tails
from mcnav.analysis.variance_breakdown import predicted_from, split_difference
from mcnav.analysis.vector_sizes import sampled_sizes
from mcnav.errors import RunFolderError, reading_file
from mcnav.execution.child_processes import side_threads
from mcnav.execution.threads import one_thread
from mcnav.linear.at_epochs import same_times
from mcnav.report.results.failures import Failures, failures_in, grouped
from mcnav.report.results.model import RunAnalysis
from mcnav.sampler.designs import SamplingDesign
from mcnav.store.chunk_files import Samples
from mcnav.store.histories import STORED, origin_in
from mcnav.store.manifest import Manifest
from mcnav.store.run_files import HISTORIES, MANIFEST, REPORT, SMOOTHED
from mcnav.store.run_files import SUMMARY as SUMMARY_FILE
from mcnav.store.run_folder import RunFolder
from mcnav.store.summaries import collect_summary
from mcnav.workflow.filter_evidence import filter_evidence, smoother_evidence
from mcnav.workflow.heavy_tails import withheld_outputs
from mcnav.workflow.judged_requirements import Judge
from mcnav.workflow.linear_extremes import beyond_range
from mcnav.workflow.recorded_model import linear_model, linear_moments, summary_frame
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
        requirements = requirements_from(manifest.requirements, [output.name for output in manifest.model.outputs])
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
    judge = Judge(
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
    frame = summary_frame(manifest, model)
    if frame is None:
        return reduced, failures_in(samples.status, samples.index.tolist())
    whole = collect_summary(folder.chunk_folder, manifest.chunks)
    failures = grouped({reason: (each.samples, each.first) for reason, each in whole.failures.items()})
    return reduce_summary(model, frame, whole.sums, whole.samples, reduced.stored), failures


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
