"""The way of the data on one page: campaign, flights, run folder, analysis, report."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from threadpoolctl import threadpool_limits

from mcnav.analysis.budget import ErrorBudget, error_budget
from mcnav.analysis.comparison import Comparison, Criterion, Model, compare
from mcnav.campaign.file import Campaign
from mcnav.campaign.files import plain, write_whole
from mcnav.campaign.folder import CAMPAIGN, MANIFEST, REPORT, SUMMARY, RunFolder
from mcnav.campaign.identity import digest, identity_of, refuse_changed, refuse_foreign
from mcnav.campaign.parts import Layout, Samples, as_records, samples_from
from mcnav.campaign.problems import CampaignError, Problem, RunFolderError
from mcnav.campaign.runner import Draws, Progress, Work, fly
from mcnav.linear.partials import FlightFailed
from mcnav.linear.start_times import study_start_times
from mcnav.linear.unscented import unscented
from mcnav.report.content import Content
from mcnav.report.page import render
from mcnav.report.summary import summarise
from mcnav.sampling.designs import FEWEST_BLOCKS, block_length
from mcnav.scenarios.protocol import Prepared, StartTimes

if TYPE_CHECKING:
    import pandas as pd

PROBES: Final = 64
"""Samples on which an engine's accuracy is settled: the first of the campaign itself."""

FORMAT: Final = 1


@dataclass(frozen=True)
class Analysis:
    """A finished run, judged.

    Attributes
    ----------
    manifest : mapping
        What the run says of itself.
    samples : Samples
    model : Model
    criterion : Criterion
    comparison : Comparison
    budget : ErrorBudget
    """

    manifest: Mapping[str, Any]
    samples: Samples
    model: Model
    criterion: Criterion
    comparison: Comparison
    budget: ErrorBudget


@dataclass(frozen=True)
class Run:
    """What came of running a campaign.

    Attributes
    ----------
    summary : dict
        The content of ``summary.json``.
    flown : int
        Samples that were flown now; the others were stored already.
    """

    summary: dict[str, Any]
    flown: int


def run_campaign(
    campaign: Campaign,
    path: Path,
    engine: str,
    jobs: int,
    fresh: bool = False,
    progress: Progress = lambda samples: None,
) -> Run:
    """Fly a campaign into a run folder, analyse it and write its report.

    A run that was broken off goes on where it stopped; chunks that are stored whole are not flown again.

    Parameters
    ----------
    campaign : Campaign
    path : Path
        Run folder.
    engine : str
        One of the scenario's engines.
    jobs : int
        Workers.
    fresh : bool
        Delete what an earlier run left in the folder.
    progress : callable
        Told how many samples have become ready.

    Returns
    -------
    Run

    Raises
    ------
    RunFolderError
        When the folder holds something else, is in use, or cannot be written to.
    """
    folder = RunFolder(path)
    identity = identity_of(campaign, engine)
    refuse_foreign(folder)
    with folder.held(), threadpool_limits(1):
        folder.sweep()
        if fresh:
            folder.clear()
        refuse_changed(folder, identity)
        draws = Draws(campaign.errors, campaign.design, campaign.seed, campaign.samples)
        probes = campaign.errors.draw(
            campaign.design, campaign.seed, campaign.samples, 0, min(PROBES, campaign.samples)
        )
        prepared = campaign.scenario.prepared(engine, probes)
        manifest: dict[str, Any] = {
            "format": FORMAT,
            "campaign": campaign.name,
            "samples": campaign.samples,
            "seed": campaign.seed,
            "design": campaign.design,
            "criterion": {"tolerance": campaign.tolerance, "confidence": campaign.confidence},
            "identity": identity,
            "accuracy": prepared.accuracy,
            "started": datetime.now(UTC).isoformat(timespec="seconds"),
            "heavy_tailed": campaign.errors.heavy_tailed,
            "model": _model(campaign, prepared),
            "complete": False,
            "parts": [],
        }
        folder.write(CAMPAIGN, campaign.to_toml().encode())
        folder.write_history(campaign.scenario.history())
        folder.write_manifest(manifest)
        layout = Layout.of(campaign.scenario.sources, campaign.scenario.outputs)
        began = time.perf_counter()
        try:
            parts, flown = fly(Work(draws, prepared, folder, digest(identity), layout), jobs, progress)
        except OSError as failure:
            raise RunFolderError(
                f"{path}: cannot be written to: {failure.strerror or failure}; what is stored there is kept"
            ) from None
        seconds = round(time.perf_counter() - began, 3)
        manifest |= {"complete": True, "parts": as_records(parts)}
        manifest["flight"] = {"jobs": jobs, "seconds": seconds, "samples": flown}
        folder.write_manifest(manifest)
        return Run(_finish(folder, analyse(folder)), flown)


def report_run(path: Path) -> dict[str, Any]:
    """Analyse a finished run folder again and write its summary and report.

    Raises
    ------
    RunFolderError
        When the folder holds no finished run, or a part of it is damaged.
    """
    folder = RunFolder(path)
    if folder.manifest() is None:
        raise RunFolderError(f"{path}: holds no run ({MANIFEST} is missing)")
    with folder.held(), threadpool_limits(1):
        return _finish(folder, analyse(folder))


def _model(campaign: Campaign, prepared: Prepared) -> dict[str, Any]:
    """The linear model and what goes with it, as the manifest keeps it."""
    scenario, errors = campaign.scenario, campaign.errors
    linear = scenario.linearised()
    model: dict[str, Any] = {
        "sources": [
            {"name": source.name, "unit": source.unit, "shown_in": source.shown_in} for source in scenario.sources
        ],
        "outputs": [
            {"name": output.name, "unit": output.unit, "shown_in": output.shown_in} for output in scenario.outputs
        ],
        "partials": linear.partials,
        "nominal": linear.nominal,
        "start_mean": errors.mean,
        "start_covariance": errors.covariance,
    }
    try:
        mean, covariance = unscented(prepared.propagate, errors.mean, errors.covariance)
        model["unscented"] = {"mean": mean, "covariance": covariance}
    except FlightFailed as failure:
        model["unscented"] = {"failed": str(failure)}
    return model


def _finished(folder: RunFolder) -> dict[str, Any]:
    """The manifest of a run that is finished."""
    manifest = folder.manifest()
    if manifest is None or not manifest.get("complete"):
        raise RunFolderError(
            f"{folder.path}: the run is not finished; run the campaign again, it goes on where it stopped"
        )
    return manifest


def samples_of(path: Path) -> pd.DataFrame:
    """The samples of a finished run folder as a table, their checksums verified.

    Columns: ``index``, ``status``, ``error NAME [unit]``, ``output NAME [unit]``; SI units.

    Raises
    ------
    RunFolderError
        When the run is not finished, or a part of it is damaged.
    """
    folder = RunFolder(path)
    return folder.table(_finished(folder)["parts"]).to_pandas()


def analyse(folder: RunFolder) -> Analysis:
    """Judge what a run folder holds; nothing is flown.

    Raises
    ------
    RunFolderError
        When the run is not finished or damaged.
    """
    manifest = _finished(folder)
    try:
        described = manifest["model"]
        model = Model(
            *(
                np.array(described[key], dtype=float)
                for key in ("partials", "nominal", "start_mean", "start_covariance")
            )
        )
        layout = Layout.of(*([SimpleNamespace(**entry) for entry in described[key]] for key in ("sources", "outputs")))
        criterion = Criterion(**manifest["criterion"])
        samples = samples_from(folder.table(manifest["parts"]), layout)
        length, fewest = block_length(manifest["design"], manifest["samples"]), FEWEST_BLOCKS[manifest["design"]]
    except (KeyError, TypeError, ValueError) as failure:
        raise RunFolderError(f"{folder.path / MANIFEST}: is damaged ({failure}); run with --fresh") from None
    comparison = compare(model, samples.errors, samples.outputs, samples.index // length, criterion, fewest)
    return Analysis(manifest, samples, model, criterion, comparison, error_budget(model.partials, model.covariance))


def _finish(folder: RunFolder, analysis: Analysis) -> dict[str, Any]:
    summary = summarise(
        analysis.manifest, analysis.samples.status, analysis.model, analysis.criterion, analysis.comparison
    )
    folder.write_json(SUMMARY, summary)
    content = Content(
        summary=summary,
        manifest=analysis.manifest,
        model=analysis.model,
        criterion=analysis.criterion,
        comparison=analysis.comparison,
        budget=analysis.budget,
        outputs=analysis.samples.outputs,
        index=analysis.samples.index,
        status=analysis.samples.status,
        history=folder.history(),
        campaign=folder.campaign(),
    )
    folder.write(REPORT, render(content).encode())
    return dict(plain(summary))


def summary_of(path: Path) -> dict[str, Any]:
    """The summary of a finished run folder.

    Raises
    ------
    RunFolderError
        When there is none, or it is damaged.
    """
    summary = RunFolder(path).summary()
    if not {"verdict", "outputs", "sigma_linear", "verdict_matrix", "direction_ratio"} <= summary.keys():
        raise RunFolderError(f"{path / SUMMARY}: is not a summary of this program; run mcnav report on the folder")
    return summary


def engine_of(path: Path, campaign: Path) -> str | None:
    """The engine of the run that a campaign file was stored with; none when it is not a run folder's own file."""
    manifest = RunFolder(path).manifest() if campaign.parent == path and campaign.name == CAMPAIGN else None
    return None if manifest is None else str(manifest["identity"]["engine"])


def write_start_times(campaign: Campaign, path: Path, axes: str, count: int) -> tuple[Path, Path]:
    """Write partial derivatives and dispersion against the start time, as ``start_times.csv`` and ``start_times.html``.

    Parameters
    ----------
    campaign : Campaign
        Its errors are taken to be those at whatever time navigation starts.
    path : Path
        Folder.
    axes : str
        ``start`` or ``trajectory``; see `mcnav.linear.start_times.study_start_times`.
    count : int
        Start times.

    Returns
    -------
    table, page : Path
    """
    from mcnav.report import start_times as shown  # pandas, for those who ask for a table

    scenario, errors = campaign.scenario, campaign.errors
    if not isinstance(scenario, StartTimes):
        raise CampaignError([Problem(campaign.name, "scenario", "has no start times to choose from")])
    with threadpool_limits(1):
        study = study_start_times(scenario, errors.covariance, axes, count)
    path.mkdir(parents=True, exist_ok=True)
    table, page = path / "start_times.csv", path / "start_times.html"
    write_whole(table, shown.table(study, scenario.sources, scenario.outputs).to_csv(index=False).encode())
    text = shown.render(campaign.name, study, scenario.sources, scenario.outputs, errors.standard_deviations)
    write_whole(page, text.encode())
    return table, page
