"""The way of the data on one page: campaign, flights, run folder, analysis, report."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from importlib import import_module
from pathlib import Path
from threading import Thread
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from mcnav.analysis.budget import ErrorBudget, error_budget
from mcnav.analysis.causes import Causes, predicted_from, split_by_covariance, split_difference
from mcnav.analysis.comparison import Comparison, Criterion, Model, compare, rows
from mcnav.analysis.convergence import Convergence, convergence
from mcnav.analysis.envelopes import envelopes_from
from mcnav.analysis.excluded import Excluded, excluded
from mcnav.analysis.requirements import Judged, judge_requirement, requirements_from
from mcnav.analysis.summed import compare_sums, frame_of
from mcnav.analysis.tails import Quantile, tails
from mcnav.campaign import epochs
from mcnav.campaign.file import Campaign, read_campaign
from mcnav.campaign.files import parquet_bytes, plain
from mcnav.campaign.folder import CAMPAIGN, EPOCHS, HISTORIES, MANIFEST, REPORT, RunFolder
from mcnav.campaign.folder import SUMMARY as SUMMARY_FILE
from mcnav.campaign.identity import PROBES, admit, chunk_digest, identity_of, refuse_foreign
from mcnav.campaign.origin import commit
from mcnav.campaign.parts import Layout, Part, Samples, as_records, samples_from
from mcnav.campaign.problems import CampaignError, Problem, RunFolderError, as_written
from mcnav.campaign.processes import Guarded
from mcnav.campaign.reduced import KEPT, SUMMARY, gathered
from mcnav.campaign.runner import Flights, Progress, fly
from mcnav.campaign.until import Until
from mcnav.campaign.work import Draws, Work
from mcnav.linear.beyond import beyond_linear, flown_budget
from mcnav.linear.conformance import Check, conformance
from mcnav.linear.map_engine import MapEngine, engines_of, prepared_by
from mcnav.linear.partials import partials_throughout
from mcnav.linear.polynomial import MapRefused
from mcnav.linear.reduction import Frame
from mcnav.report.content import Content
from mcnav.report.failures import failures_in, grouped
from mcnav.report.summary import summarise
from mcnav.sampling.designs import FEWEST_BLOCKS, block_length
from mcnav.scenarios.own import Own
from mcnav.scenarios.protocol import Development, Followed, History, OverTime, Prepared, ScenarioError
from mcnav.statistics.stopping import looks

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]

DEVELOPMENT_POINTS: Final = 61
"""Times at which the error budget is shown, where the scenario knows it throughout the flight."""

FEWEST_FOLLOWED: Final = 2
"""Samples followed throughout the flight, below which there are no moments."""

FORMAT: Final = 1


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
    causes : Causes or None
    requirements : tuple of Judged
    convergence : Convergence or None
    tails : tuple of Quantile
    left_out : Excluded or None
    failures : mapping of str to (int, sequence of int)
        By reason: how many samples failed, and the indices of the first of them.
    """

    manifest: Mapping[str, Any]
    samples: Samples
    model: Model
    criterion: Criterion
    comparison: Comparison
    budget: ErrorBudget
    causes: Causes | None
    requirements: tuple[Judged, ...]
    convergence: Convergence | None
    tails: tuple[Quantile, ...]
    left_out: Excluded | None
    failures: Mapping[str, tuple[int, Sequence[int]]]


@dataclass(frozen=True)
class Run:
    """What came of running a campaign.

    Attributes
    ----------
    summary : dict
        The content of ``summary.json``.
    flown : int
        Samples that were flown now; the others were stored already.
    notices : tuple of str
        What was found damaged and mended, a line each.
    """

    summary: dict[str, Any]
    flown: int
    notices: tuple[str, ...] = ()


def run_campaign(
    campaign: Campaign,
    path: Path,
    engine: str | None,
    jobs: int,
    fresh: bool = False,
    progress: Progress = lambda samples: None,
    most_failures: int | None = None,
    flights: Flights | None = None,
) -> Run:
    """Fly a campaign into a run folder, analyse it and write its report.

    A run that was broken off goes on where it stopped, and one of fewer samples is extended; chunks that are stored
    whole are not flown again.

    Parameters
    ----------
    campaign : Campaign
    path : Path
        Run folder.
    engine : str, optional
        One of `mcnav.linear.map_engine.engines_of` the scenario; by default the first.
    jobs : int
        Workers.
    fresh : bool
        Delete what an earlier run left in the folder.
    progress : callable
        Told how many samples have become ready.
    most_failures : int, optional
        Samples that may fail before the run is broken off.
    flights : Flights, optional
        Who flies in place of this machine's threads and processes; see `mcnav.campaign.cluster`.

    Returns
    -------
    Run

    Raises
    ------
    CampaignError
        When the scenario has no such engine, or cannot be flown.
    RunFolderError
        When the folder holds something else, is in use, or cannot be written to.
    TooManyFailures
    """
    folder = RunFolder(path)
    engine = engine or campaign.scenario.engines[0]
    if engine not in engines_of(campaign.scenario):
        known = ", ".join(engines_of(campaign.scenario))
        raise CampaignError([Problem(campaign.name, "engine", f"got {engine!r}; this scenario has {known}")])
    identity = identity_of(campaign, engine)
    refuse_foreign(folder)
    with folder.held(), threadpool_limits(1):
        folder.sweep()
        if fresh:
            folder.clear()
        notices = admit(folder, identity, campaign.design, campaign.samples)
        draws = Draws(campaign.errors, campaign.design, campaign.seed, campaign.samples)
        probes = campaign.errors.draw(
            campaign.design, campaign.seed, campaign.samples, 0, min(PROBES, campaign.samples)
        )
        prepared, model, history = _flyable(campaign, engine, probes)
        manifest: dict[str, Any] = {
            "format": FORMAT,
            "campaign": campaign.name,
            "samples": campaign.samples,
            "seed": campaign.seed,
            "design": campaign.design,
            "criterion": {"tolerance": campaign.tolerance, "confidence": campaign.confidence},
            "requirements": campaign.requirements,
            "identity": identity,
            "accuracy": prepared.accuracy,
            "commit": commit(),
            "started": datetime.now(UTC).isoformat(timespec="seconds"),
            "heavy_tailed": campaign.errors.heavy_tailed(campaign.design),
            "long_tailed": campaign.errors.long_tailed(campaign.design),
            "normal": campaign.errors.normal,
            "store": campaign.store,
            "kept": min(KEPT, campaign.samples) if campaign.store == SUMMARY else None,
            "model": model,
            "complete": False,
            "parts": [],
        }
        folder.write_tables(campaign.tables)
        folder.write(CAMPAIGN, campaign.to_toml().encode())
        folder.write_history(history)
        folder.write_manifest(manifest)
        if campaign.code is not None:
            folder.write(campaign.code.file, campaign.code.text.encode())
        layout = Layout.of(campaign.scenario.sources, campaign.scenario.outputs)
        began = time.perf_counter()
        own = chunk_digest(identity, campaign.design, campaign.samples)
        work = Work(draws, prepared, folder, own, layout, campaign.sample_timeout, _frame(campaign, model))
        _load_drawing()
        try:
            parts, flown = _fly_enough(campaign, work, manifest, jobs, progress, notices.append, most_failures, flights)
        except OSError as failure:
            raise RunFolderError(
                f"{path}: cannot be written to: {failure.strerror or failure}; what is stored there is kept"
            ) from None
        seconds = round(time.perf_counter() - began, 3)
        _write_epochs(campaign, prepared, folder, parts)
        manifest |= {"complete": True, "parts": as_records(parts)}
        manifest["flight"] = {"jobs": jobs, "seconds": seconds, "samples": flown}
        folder.write_manifest(manifest)
        return Run(_finish(folder, analyse(folder)), flown, tuple(notices))


def _fly_enough(
    campaign: Campaign,
    work: Work,
    manifest: dict[str, Any],
    jobs: int,
    progress: Progress,
    notice: Callable[[str], None],
    most_failures: int | None,
    flights: Flights | None,
) -> tuple[list[Part], int]:
    """Fly a campaign's samples, or as many as its stopping rule asks for; the manifest is told how many these are."""
    until = campaign.until
    if until is None:
        return fly(work, jobs, progress, notice=notice, most_failures=most_failures, elsewhere=flights)
    sizes = looks(work.prepared.chunk, until.at_most)
    manifest["criterion"]["looks"] = len(sizes)
    parts: list[Part] = []
    flown, before = 0, 0
    for size in sizes:
        sized = replace(work, draws=replace(work.draws, samples=size))
        more, now = fly(sized, jobs, progress, before, notice, most_failures, flights)
        parts, flown, before = parts + more, flown + now, size
        manifest |= {"samples": size, "parts": as_records(parts)}
        precision = _precision(work.folder, manifest, until)
        reached = precision <= until.precision
        manifest["stopping"] = until.described() | {"looks": len(sizes), "found": precision, "reached": reached}
        if reached:
            break
    return parts, flown


def _precision(folder: RunFolder, manifest: Mapping[str, Any], until: Until) -> float:
    """Half the width of the widest interval of an output's sigma ratio, at the confidence of the stopping rule."""
    asked = {**manifest, "criterion": {**manifest["criterion"], "confidence": until.confidence}}
    outputs = analyse(folder, plain(asked)).comparison.outputs
    judged = [output.paired if until.quantity.endswith("paired") else output.plain for output in outputs]
    widths = [0.5 * (each.interval[1] - each.interval[0]) for each in judged if each.interval is not None]
    return max(widths, default=math.inf)


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
    with folder.held(), threadpool_limits(1), as_written(path):
        _load_drawing()
        return _finish(folder, analyse(folder))


def _flyable(campaign: Campaign, engine: str, probes: Array) -> tuple[Prepared, dict[str, Any], History]:
    """The engine, the linear model and the history of a campaign's scenario."""
    try:
        errors = campaign.errors
        prepared = prepared_by(campaign.scenario, engine, probes, errors.mean, errors.standard_deviations)
        return prepared, _model(campaign, prepared), campaign.scenario.history()
    except ScenarioError as wrong:
        raise CampaignError([Problem(campaign.name, f"scenario.{wrong.key}", str(wrong))]) from None
    except MapRefused as wrong:
        raise CampaignError([Problem(campaign.name, "engine", str(wrong))]) from None


def _model(campaign: Campaign, prepared: Prepared) -> dict[str, Any]:
    """The linear model and what goes with it, as the manifest keeps it."""
    scenario, errors = campaign.scenario, campaign.errors

    def guard(engine: Prepared) -> Prepared:
        """A user's flight may end its process, but not this one."""
        at_risk = isinstance(scenario, Own) and (engine.parallel == "processes" or campaign.sample_timeout is not None)
        return Guarded(engine, len(scenario.outputs), campaign.sample_timeout) if at_risk else engine

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
    followed = _followed(prepared)
    if isinstance(scenario, OverTime):
        known = scenario.development(DEVELOPMENT_POINTS)
        model["development"] = {"label": known.label, "times": known.times, "partials": known.partials}
    elif followed is not None:
        throughout, _ = partials_throughout(followed, np.array([source.nominal for source in scenario.sources]))
        known_at = followed.epochs
        model["development"] = {"label": known_at.label, "times": known_at.times, "partials": throughout}
    flown = flown_budget(scenario, errors, linear.partials, campaign.design, campaign.seed, campaign.samples, guard)
    return model | beyond_linear(scenario, guard(prepared), errors) | {"budget": flown}


def _linear(described: Mapping[str, Any]) -> Model:
    """The linear model of a manifest."""
    keys = ("partials", "nominal", "start_mean", "start_covariance")
    return Model(*(np.array(described[key], dtype=float) for key in keys))


def _frame(campaign: Campaign, described: Mapping[str, Any]) -> Frame | None:
    """How samples are reduced; none when they are stored themselves."""
    if campaign.store != SUMMARY:
        return None
    return frame_of(_linear(described), campaign.samples, block_length(campaign.design, campaign.samples))


def _followed(prepared: Prepared) -> Followed | None:
    """The engine that knows errors throughout the flight, if there is one: a map's is the one it was fitted to."""
    engine = prepared.exact if isinstance(prepared, MapEngine) else prepared
    return engine if isinstance(engine, Followed) else None


def _write_epochs(campaign: Campaign, prepared: Prepared, folder: RunFolder, parts: list[Part]) -> None:
    """Histories of the first samples; moments of all of them, or with a map of the first, at every epoch."""
    followed = _followed(prepared)
    if followed is None:
        return
    scenario, errors = campaign.scenario, campaign.errors
    first = errors.draw(campaign.design, campaign.seed, campaign.samples, 0, min(epochs.STORED, campaign.samples))
    histories = followed.histories(first)
    sums = epochs.gathered(prepared, folder.parts, parts) or followed.history_sums(first)
    if sums.count < FEWEST_FOLLOWED:
        return
    partials, nominal = partials_throughout(followed, np.array([source.nominal for source in scenario.sources]))
    linear = nominal + partials @ errors.mean, partials @ errors.covariance @ partials.swapaxes(1, 2)
    known = followed.epochs
    table = epochs.epochs_table(known, scenario.outputs, sums, linear, histories)
    folder.write(EPOCHS, parquet_bytes(table))
    folder.write(HISTORIES, parquet_bytes(epochs.histories_table(known, scenario.outputs, histories)))


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
    manifest = _finished(folder)
    return folder.table(manifest["parts"], kept=manifest.get("kept")).to_pandas()


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
        model = _linear(described)
        layout = Layout.of(*([SimpleNamespace(**entry) for entry in described[key]] for key in ("sources", "outputs")))
        criterion = Criterion(**manifest["criterion"])
        requirements = requirements_from(manifest.get("requirements", ()), described["outputs"])
        units = [entry["unit"] for entry in described["outputs"]]
        predicted = predicted_from(described, len(model.partials))
        samples = samples_from(folder.table(manifest["parts"], unfinished is None, manifest.get("kept")), layout)
        length, fewest = block_length(manifest["design"], manifest["samples"]), FEWEST_BLOCKS[manifest["design"]]
        heavy, normal = manifest["heavy_tailed"], manifest.get("normal", True)
    except (KeyError, TypeError, ValueError) as failure:
        raise RunFolderError(f"{folder.path / MANIFEST}: is damaged ({failure}); run with --fresh") from None
    blocks = samples.index // length
    needed = math.inf if heavy else fewest
    with ThreadPoolExecutor(1) as beside:
        in_tails = beside.submit(tails, model, samples.outputs, blocks, units, criterion.confidence)
        comparison = compare(model, samples.errors, samples.outputs, blocks, criterion, needed, normal)
    flown = np.asarray(np.isfinite(samples.outputs).all(axis=1))
    if manifest.get("store") == SUMMARY:
        whole = gathered(folder.parts, manifest["parts"])
        frame = frame_of(model, manifest["samples"], length)
        single = manifest["design"] == "random"
        summed = compare_sums(model, frame, whole.sums, whole.samples, comparison, criterion, needed, single, normal)
        comparison, running, left_out = summed.comparison, summed.convergence, summed.left_out
        failures = grouped({reason: (each.samples, each.first) for reason, each in whole.failures.items()})
        causes = split_by_covariance(model, summed.drawn, comparison, predicted)
    else:
        errors, outputs = rows(samples.errors, flown), rows(samples.outputs, flown)
        failures = failures_in(samples.status, samples.index.tolist())
        running = convergence(model, errors, outputs, blocks[flown], comparison, needed)
        causes = split_difference(model, errors, comparison, predicted)
        left_out = excluded(model, samples.errors, flown)
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


def _development(known: Mapping[str, Any] | None) -> Development | None:
    """What the manifest keeps of the partial derivatives over time."""
    if known is None:
        return None
    return Development(known["label"], np.array(known["times"], dtype=float), np.array(known["partials"], dtype=float))


def _load_drawing() -> None:
    """Load what draws the report while others work: it takes as long as analysing a hundred thousand samples."""
    Thread(target=import_module, args=("mcnav.report.page",)).start()


def _finish(folder: RunFolder, analysis: Analysis) -> dict[str, Any]:
    content = content_of(folder, analysis)
    folder.write_json(SUMMARY_FILE, content.summary)
    from mcnav.report.page import render

    folder.write(REPORT, render(content).encode())
    return dict(plain(content.summary))


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


def summary_of(path: Path) -> dict[str, Any]:
    """The summary of a finished run folder.

    Raises
    ------
    RunFolderError
        When there is none, or it is damaged.
    """
    summary = RunFolder(path).summary()
    if not {"verdict", "outputs", "sigma_linear", "verdict_matrix", "direction_ratio"} <= summary.keys():
        raise RunFolderError(f"{path / SUMMARY_FILE}: is not a summary of this program; run mcnav report on the folder")
    return summary


def engine_of(path: Path, campaign: Path) -> str | None:
    """The engine of the run that a campaign file was stored with; none when it is not a run folder's own file."""
    manifest = RunFolder(path).manifest() if campaign.parent == path and campaign.name == CAMPAIGN else None
    return None if manifest is None else str(manifest["identity"]["engine"])


def check_scenario(path: Path) -> list[Check]:
    """Try out the scenario of a campaign file with its errors; see `mcnav.linear.conformance`.

    Raises
    ------
    CampaignError
        When the file cannot be read.
    """
    campaign = read_campaign(Path(path))
    with threadpool_limits(1):
        return conformance(campaign.scenario, campaign.errors.standard_deviations)
