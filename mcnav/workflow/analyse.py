"""What a run folder says: its samples judged, its summary and its report. Nothing is flown."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
from threadpoolctl import threadpool_limits

from mcnav._subprocess import side_threads
from mcnav.analysis.budget import ErrorBudget, error_budget
from mcnav.analysis.comparison import Comparison, Criterion, Model, compare, successful
from mcnav.analysis.convergence import Convergence, convergence
from mcnav.analysis.envelopes import envelopes_from
from mcnav.analysis.failed_samples import FailureBias, failure_bias
from mcnav.analysis.requirements import RequirementResult, judge_requirement, requirements_from
from mcnav.analysis.summed import compare_sums, normalization_of
from mcnav.analysis.tails import Quantile, tails
from mcnav.analysis.variance_breakdown import VarianceBreakdown, predicted_from, split_by_covariance, split_difference
from mcnav.errors import RunFolderError, reading_file
from mcnav.files import to_json
from mcnav.report.failures import failures_in, grouped
from mcnav.report.model import Content
from mcnav.report.summary import summarise
from mcnav.sampling.designs import FEWEST_BLOCKS, block_length
from mcnav.scenarios.protocol import PartialsHistory
from mcnav.store.parts import Samples, SampleSchema
from mcnav.store.run_folder import MANIFEST, REPORT, RunFolder
from mcnav.store.run_folder import SUMMARY as SUMMARY_FILE
from mcnav.store.summaries import SUMMARY, collect_summary

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Analysis:
    """A finished run, judged.

    Attributes
    ----------
    manifest : mapping
        What the run says of itself.
    samples : Samples
        Of a run that keeps a summary: the first ones.
    model : Model
    criterion : Criterion
    comparison : Comparison
    budget : ErrorBudget
    causes : VarianceBreakdown or None
    requirements : tuple of RequirementResult
    convergence : Convergence or None
    tails : tuple of Quantile
    left_out : FailureBias or None
    failures : mapping of str to (int, sequence of int)
        By reason: how many samples failed, and the indices of the first of them.
    """

    manifest: Mapping[str, Any]
    samples: Samples
    model: Model
    criterion: Criterion
    comparison: Comparison
    budget: ErrorBudget
    causes: VarianceBreakdown | None
    requirements: tuple[RequirementResult, ...]
    convergence: Convergence | None
    tails: tuple[Quantile, ...]
    left_out: FailureBias | None
    failures: Mapping[str, tuple[int, Sequence[int]]]


def report_run(path: str | Path) -> dict[str, Any]:
    """Analyse a finished run folder again and write its summary and report.

    Raises
    ------
    RunFolderError
        When the folder holds no finished run, or a part of it is damaged.
    """
    folder = RunFolder(Path(path))
    _manifest(folder)
    with folder.lock(), threadpool_limits(1), reading_file(folder.path):
        _finished(folder)
        return write_results(folder, analyse(folder))


def samples_of(path: str | Path) -> pd.DataFrame:
    """The samples of a finished run folder as a table, their checksums verified.

    Columns: ``index``, ``status``, ``error NAME [unit]``, ``output NAME [unit]``; SI units.

    Raises
    ------
    RunFolderError
        When the run is not finished, or a part of it is damaged.
    """
    folder = RunFolder(Path(path))
    manifest = _finished(folder)
    return folder.table(manifest["parts"], kept=manifest.get("kept")).to_pandas()


def summary_of(path: str | Path) -> dict[str, Any]:
    """The summary of a finished run folder.

    Raises
    ------
    RunFolderError
        When there is none, or it is damaged.
    """
    path = Path(path)
    _refuse_nowhere(path)
    summary = RunFolder(path).summary()
    if not {"verdict", "outputs", "sigma_linear", "verdict_matrix", "direction_ratio"} <= summary.keys():
        raise RunFolderError(f"{path / SUMMARY_FILE}: is not a summary of this program; run mcnav report on the folder")
    return summary


def analyse(folder: RunFolder, unfinished: Mapping[str, Any] | None = None) -> Analysis:
    """Judge what a run folder holds; nothing is flown.

    Parameters
    ----------
    folder : RunFolder
    unfinished : mapping, optional
        The manifest of a run that is still going on, in place of the stored one.

    Raises
    ------
    RunFolderError
        When the run is not finished or damaged.
    """
    manifest = _finished(folder) if unfinished is None else unfinished
    try:
        described = manifest["model"]
        model = linear_model(described)
        layout = SampleSchema.of(
            *([SimpleNamespace(**entry) for entry in described[key]] for key in ("sources", "outputs"))
        )
        criterion = Criterion(**manifest["criterion"])
        requirements = requirements_from(manifest.get("requirements", ()), described["outputs"])
        units = [entry["unit"] for entry in described["outputs"]]
        predicted = predicted_from(described, len(model.partials))
        samples = folder.samples(manifest["parts"], layout, unfinished is None, manifest.get("kept"))
        length, fewest = block_length(manifest["design"], manifest["samples"]), FEWEST_BLOCKS[manifest["design"]]
        heavy, normal = manifest["heavy_tailed"], manifest.get("normal", True)
    except (KeyError, TypeError, ValueError) as failure:
        raise RunFolderError(f"{folder.path / MANIFEST}: is damaged ({failure}); run with --fresh") from None
    blocks = samples.index // length
    needed = math.inf if heavy else fewest
    with side_threads(1) as beside:
        in_tails = beside.submit(
            tails, model, samples.outputs, blocks, units, criterion.confidence, criterion.tolerance, criterion.looks
        )
        comparison = compare(model, samples.errors, samples.outputs, blocks, criterion, needed, normal)
    flown = np.asarray(np.isfinite(samples.outputs).all(axis=1))
    if manifest.get("store") == SUMMARY:
        whole = collect_summary(folder.parts, manifest["parts"])
        frame = normalization_of(model, manifest["samples"], length)
        single = manifest["design"] == "random"
        summed = compare_sums(model, frame, whole.sums, whole.samples, comparison, criterion, needed, single, normal)
        comparison, running, left_out = summed.comparison, summed.convergence, summed.left_out
        failures = grouped({reason: (each.samples, each.first) for reason, each in whole.failures.items()})
        causes = split_by_covariance(model, summed.drawn, comparison, predicted)
    else:
        errors, outputs = successful(samples.errors, flown), successful(samples.outputs, flown)
        failures = failures_in(samples.status, samples.index.tolist())
        running = convergence(model, errors, outputs, blocks[flown], comparison, needed)
        causes = split_difference(model, errors, comparison, predicted)
        left_out = failure_bias(model, samples.errors, flown)
    return Analysis(
        manifest=manifest,
        samples=samples,
        model=model,
        criterion=criterion,
        comparison=comparison,
        budget=error_budget(model.partials, model.covariance),
        causes=causes,
        convergence=running,
        tails=in_tails.result(),
        left_out=left_out,
        requirements=tuple(
            judge_requirement(requirement, model, samples.outputs, blocks, comparison, criterion.confidence)
            for requirement in requirements
        ),
        failures=failures,
    )


def content_of(folder: RunFolder, analysis: Analysis) -> Content:
    """All that a report of a judged run shows.

    Raises
    ------
    RunFolderError
        When the folder's history or campaign cannot be read.
    """
    summary = summarise(
        manifest=analysis.manifest,
        failures={reason: count for reason, (count, _) in analysis.failures.items()},
        model=analysis.model,
        criterion=analysis.criterion,
        comparison=analysis.comparison,
        causes=analysis.causes,
        budget=analysis.budget,
        requirements=analysis.requirements,
        tails=analysis.tails,
        left_out=analysis.left_out,
    )
    at_epochs = folder.epochs()
    return Content(
        summary=summary,
        manifest=analysis.manifest,
        model=analysis.model,
        criterion=analysis.criterion,
        comparison=analysis.comparison,
        budget=analysis.budget,
        causes=analysis.causes,
        requirements=analysis.requirements,
        convergence=analysis.convergence,
        tails=analysis.tails,
        outputs=analysis.samples.outputs,
        index=analysis.samples.index,
        failures=analysis.failures,
        history=folder.history(),
        campaign=folder.campaign(),
        development=_development(analysis.manifest["model"].get("development")),
        envelopes=None if at_epochs is None else envelopes_from(*at_epochs, analysis.manifest["model"]["outputs"]),
    )


def write_results(folder: RunFolder, analysis: Analysis) -> dict[str, Any]:
    """Write the summary and the report of a judged run; the summary."""
    content = content_of(folder, analysis)
    folder.write_json(SUMMARY_FILE, content.summary)
    from mcnav.report.page import render

    folder.write(REPORT, render(content).encode())
    return dict(to_json(content.summary))


def linear_model(described: Mapping[str, Any]) -> Model:
    """The linear model of a manifest."""
    keys = ("partials", "nominal", "start_mean", "start_covariance")
    return Model(*(np.array(described[key], dtype=float) for key in keys))


def _refuse_nowhere(path: Path) -> None:
    """Refuse a path where there is no folder."""
    if not path.is_dir():
        raise RunFolderError(f"{path}: holds no run ({'it is a file' if path.exists() else 'there is no such folder'})")


def _manifest(folder: RunFolder) -> dict[str, Any]:
    """Return the manifest of a run, finished or not."""
    _refuse_nowhere(folder.path)
    manifest = folder.manifest()
    if manifest is None:
        raise RunFolderError(f"{folder.path}: holds no run ({MANIFEST} is missing)")
    return manifest


def _finished(folder: RunFolder) -> dict[str, Any]:
    """The manifest of a run that is finished."""
    manifest = _manifest(folder)
    if not manifest.get("complete"):
        raise RunFolderError(
            f"{folder.path}: the run is not finished; run the campaign again, it goes on where it stopped"
        )
    return manifest


def _development(known: Mapping[str, Any] | None) -> PartialsHistory | None:
    """What the manifest keeps of the partial derivatives over time."""
    if known is None:
        return None
    return PartialsHistory(
        known["label"], np.array(known["times"], dtype=float), np.array(known["partials"], dtype=float)
    )
