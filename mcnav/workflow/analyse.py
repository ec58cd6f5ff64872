"""Analyse the samples of a run folder; write its summary and report. Nothing is simulated."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mcnav.analysis.block_moments import ReducedSamples
from mcnav.analysis.budget import error_budget
from mcnav.analysis.comparison import compare_reduced, reduce_stored, reduce_summary
from mcnav.analysis.failed_samples import failure_bias
from mcnav.analysis.filter_assessment import assess_filter
from mcnav.analysis.requirements_over_time import ErrorHistories
from mcnav.analysis.running_ratios import convergence
from mcnav.analysis.summary import Summary
from mcnav.analysis.tails import tails
from mcnav.analysis.variance_breakdown import split_difference
from mcnav.analysis.vector_sizes import sampled_sizes
from mcnav.errors import reading_file
from mcnav.execution.child_processes import side_threads
from mcnav.execution.threads import one_thread
from mcnav.report.results.failures import Failures, failures_in, grouped
from mcnav.report.results.model import RunAnalysis
from mcnav.store.histories import STORED
from mcnav.store.manifest import Manifest
from mcnav.store.run_files import REPORT
from mcnav.store.run_files import SUMMARY as SUMMARY_FILE
from mcnav.store.run_folder import RunFolder
from mcnav.workflow.filter_evidence import filter_evidence, smoother_evidence
from mcnav.workflow.judged_requirements import Judge
from mcnav.workflow.linear_extremes import beyond_range
from mcnav.workflow.recorded_model import summary_frame
from mcnav.workflow.stored_remedies import stored_remedies
from mcnav.workflow.stored_run import StoredRun, read_run
from mcnav.workflow.what_if import what_if_of_run

if TYPE_CHECKING:
    import pandas as pd


def report_run(path: str | Path) -> dict[str, Any]:
    """Analyse a finished run folder, ``path``, again; write its report and summary, and return the summary.

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
    """Read the samples of a finished run folder, ``path``: a row a sample, their checksums verified.

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
    run = read_run(folder, unfinished)
    model, criterion, outputs, blocks = run.model.end, run.criterion, run.samples.outputs, run.blocks
    histories, smoothed_histories = _histories(run)
    beyond = beyond_range(run.model)
    units = [output.unit for output in run.manifest.model.outputs]
    with side_threads(1) as beside:
        in_tails = beside.submit(tails, model, outputs, blocks, units, criterion)
        reduced, failures = _reduce(run)
        comparison = compare_reduced(model, reduced, criterion, run.design)
    filtered, smoothed = filter_evidence(run, comparison.failed), smoother_evidence(run, comparison.failed)
    judge = Judge(run, comparison, histories, smoothed_histories, beyond)
    return RunAnalysis(
        folder=folder,
        manifest=run.manifest,
        samples=run.samples,
        model=model,
        criterion=criterion,
        comparison=comparison,
        budget=error_budget(model.partials, model.covariance, list(model.processes.values())),
        causes=split_difference(model, reduced.successful.covariance, comparison, run.predicted),
        convergence=convergence(reduced.moments, comparison, run.design, model.withheld),
        tails=in_tails.result(),
        left_out=failure_bias(model, reduced),
        requirements=tuple(map(judge.result, run.requirements)),
        failures=failures,
        filter=None if filtered is None else assess_filter(filtered, criterion),
        smoother=None if smoothed is None else assess_filter(smoothed, criterion),
        beyond=beyond,
        sizes=sampled_sizes(model, outputs, blocks, criterion),
        histories=histories,
        smoothed_histories=smoothed_histories,
    )


def _reduce(run: StoredRun) -> tuple[ReducedSamples, Failures]:
    """Reduce the samples to sums, and group those that failed by reason; where a summary is stored, by its sums."""
    model, samples = run.model.end, run.samples
    frame, whole = summary_frame(run.manifest, model), run.summary
    linear = samples.linear if model.processes else None
    reduced = reduce_stored(model, samples.errors, samples.outputs, run.blocks, linear)
    if frame is None or whole is None:
        return reduced, failures_in(samples.status, samples.index.tolist())
    failures = grouped({reason: (failed.samples, failed.first) for reason, failed in whole.failures.items()})
    return reduce_summary(model, frame, whole.sums, whole.samples, reduced.stored), failures


def _histories(run: StoredRun) -> list[ErrorHistories | None]:
    """Put histories of a run's first samples, and those behind its smoother, beside linear moments at their epochs."""
    histories = list[ErrorHistories | None]()
    for stored, linear in ((run.histories, run.model.over_time), (run.smoothed_histories, run.model.smoothed)):
        if stored is None:
            histories.append(None)
            continue
        known = linear is not None and linear.is_whole and linear.is_at(stored.times)
        mean, covariance = (linear.mean, linear.covariance) if linear is not None and known else (None, None)
        blocks = run.design.blocks(np.arange(len(stored.errors)))
        histories.append(
            ErrorHistories(
                stored.times, stored.errors, blocks, mean, covariance, STORED, run.model.end.sizes, stored.origin
            )
        )
    return histories


def write_results(folder: RunFolder, analysis: RunAnalysis, report: bool = True) -> Summary:
    """Write the summary of an analysed run, and its report or none; return the summary.

    An earlier report, which may be of fewer samples, is deleted when none is written.
    """
    if report:
        from mcnav.report.pages.run.page import render

        page = render(
            replace(analysis, what_if=analysis.what_if or what_if_of_run(analysis), remedies=stored_remedies(folder))
        ).encode()  # refuses a folder without history or campaign before anything is written
    else:
        (folder.path / REPORT).unlink(missing_ok=True)
    summary = analysis.summary.as_stored
    folder.write_json(SUMMARY_FILE, summary.to_json())
    if report:
        folder.write(REPORT, page)
    return summary
