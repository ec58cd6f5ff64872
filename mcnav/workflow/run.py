"""The way of the data on one page: campaign, flights, run folder, analysis, report."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from threading import Event
from typing import Any, Final

from threadpoolctl import threadpool_limits

from mcnav._subprocess import side_threads
from mcnav.analysis.summed import normalization_of
from mcnav.config.read import Campaign, campaign_from
from mcnav.config.stopping import StoppingRule
from mcnav.errors import CampaignError, Problem, RunFolderError
from mcnav.execution.chunks import ChunkJob, DrawPlan
from mcnav.execution.identity import PROBES, check_no_foreign_files, check_resumable, chunk_digest, identity_of
from mcnav.execution.processes import end_workers_apart
from mcnav.execution.runner import ChunkExecutor, run_chunks
from mcnav.files import to_json
from mcnav.lincov.block_sums import Normalization
from mcnav.lincov.polynomial_engine import engine_names
from mcnav.progress import SILENT, Phase, Progress
from mcnav.sampling.designs import block_length
from mcnav.scenarios.conformance import Check, check_conformance
from mcnav.scenarios.timeouts import stopped_by
from mcnav.statistics.interim_analyses import interim_sizes
from mcnav.store.inputs import check_as_read, check_unchanged, records
from mcnav.store.parts import Part, SampleSchema, part_records
from mcnav.store.provenance import commit
from mcnav.store.run_folder import CAMPAIGN, RunFolder
from mcnav.store.summaries import KEPT, SUMMARY
from mcnav.workflow.analyse import analyse, linear_model, write_results
from mcnav.workflow.prepare import PreparedCampaign, prepare_campaign, write_epochs

FORMAT: Final = 1


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
    campaign: str | Path | Campaign | Mapping[str, Any],
    path: str | Path,
    engine: str | None,
    jobs: int,
    fresh: bool = False,
    progress: Progress = SILENT,
    most_failures: int | None = None,
    flights: ChunkExecutor | None = None,
    force: bool = False,
) -> Run:
    """Fly a campaign into a run folder, analyse it and write its report.

    A run that was broken off goes on where it stopped, and one of fewer samples is extended; chunks that are stored
    whole are not flown again.

    Parameters
    ----------
    campaign : str, Path, Campaign or mapping
        See `mcnav.config.read.campaign_from`.
    path : str or Path
        Run folder.
    engine : str, optional
        One of `mcnav.lincov.polynomial_engine.engine_names` the scenario; by default the first.
    jobs : int
        Workers.
    fresh : bool
        Delete what an earlier run left in the folder.
    progress : Progress
        Told which phase begins, and how many samples have become ready.
    most_failures : int, optional
        Samples that may fail before the run is broken off.
    flights : Flights, optional
        Who flies in place of this machine's threads and processes; see `mcnav.execution.dask_cluster`.
    force : bool
        Go on where partial derivatives are not settled; the summary and the report say so.

    Returns
    -------
    Run

    Raises
    ------
    CampaignError
        When the scenario has no such engine, cannot be flown, or there is no linear model to compare with.
    RunFolderError
        When the folder holds something else, is in use, or cannot be written to.
    TooManyFailures
    """
    campaign, path = campaign_from(campaign), Path(path)
    progress.phase(Phase.PREPARING)
    folder = RunFolder(path)
    engine = engine or campaign.scenario.engines[0]
    if engine not in engine_names(campaign.scenario):
        known = ", ".join(engine_names(campaign.scenario))
        raise CampaignError([Problem(campaign.file, "engine", f"got {engine!r}; this scenario has {known}")])
    check_no_foreign_files(folder)
    with folder.lock(), threadpool_limits(1):
        folder.remove_partial_files()
        identity, inputs = identity_of(campaign, engine), campaign.inputs()
        check_as_read(inputs)
        notices = [] if fresh else check_resumable(folder, identity, campaign.design, campaign.samples)
        draws = DrawPlan(campaign.errors, campaign.design, campaign.seed, campaign.samples)
        probes = campaign.errors.draw(
            campaign.design, campaign.seed, campaign.samples, 0, min(PROBES, campaign.samples)
        )
        system = prepare_campaign(campaign, engine, probes, force)
        if fresh:
            folder.clear([Path(file.path) for file in inputs])
        manifest: dict[str, Any] = {
            "format": FORMAT,
            "campaign": campaign.name,
            "samples": campaign.samples,
            "seed": campaign.seed,
            "design": campaign.design,
            "criterion": {"tolerance": campaign.tolerance, "confidence": campaign.confidence},
            "requirements": campaign.requirements,
            "identity": identity,
            "accuracy": system.engine.accuracy,
            "commit": commit(),
            "started": datetime.now(UTC).isoformat(timespec="seconds"),
            "heavy_tailed": campaign.errors.heavy_tailed(campaign.design),
            "long_tailed": campaign.errors.long_tailed(campaign.design),
            "normal": campaign.errors.normal,
            "store": campaign.store,
            "kept": min(KEPT, campaign.samples) if campaign.store == SUMMARY else None,
            "unsettled": system.unsettled,
            "model": system.model,
            "complete": False,
            "parts": [],
            "files": records(inputs),
        }
        folder.write_tables(campaign.tables)
        folder.write(CAMPAIGN, campaign.to_toml().encode())
        folder.write_history(system.history)
        folder.write_manifest(manifest)
        if campaign.code is not None:
            folder.write(campaign.code.file, campaign.code.text.encode())
        folder.write_inputs(inputs)
        layout = SampleSchema.of(campaign.scenario.sources, campaign.scenario.outputs)
        own = chunk_digest(identity, campaign.design, campaign.samples)
        frame = _frame(campaign, system.model)
        work = ChunkJob(draws, system.engine, folder, own, layout, campaign.sample_timeout, frame, inputs=inputs)
        with _beside(campaign, system) as beyond:
            began = time.perf_counter()
            try:
                parts, flown = _fly_enough(
                    campaign, work, manifest, jobs, progress, notices.append, most_failures, flights
                )
            except OSError as failure:
                raise RunFolderError(
                    f"{path}: cannot be written to: {failure.strerror or failure}; what is stored there is kept"
                ) from None
            seconds = round(time.perf_counter() - began, 3)
            progress.phase(Phase.ANALYSING)
            manifest["model"] = system.model | beyond()
        write_epochs(campaign, system.engine, folder, parts)
        check_unchanged(inputs, path)
        manifest |= {"complete": True, "parts": part_records(parts)}
        manifest["flight"] = {"jobs": jobs, "seconds": seconds, "samples": flown}
        folder.write_manifest(manifest)
        judged = analyse(folder)
        progress.phase(Phase.REPORTING)
        return Run(write_results(folder, judged), flown, tuple(notices))


@contextmanager
def _beside(campaign: Campaign, system: PreparedCampaign) -> Iterator[Callable[[], dict[str, Any]]]:
    """Fly what goes beyond the linear model beside the samples; by a user's own code before them.

    When the samples are broken off, so are these flights, and nothing waits for them.
    """
    if campaign.code is not None:
        try:
            found = system.beyond()
        except BaseException:
            end_workers_apart()
            raise
        yield lambda: found
        return
    unwanted = Event()

    def flown() -> dict[str, Any]:
        with stopped_by(unwanted):
            return system.beyond()

    with side_threads(1) as beside:
        try:
            yield beside.submit(flown).result
        except BaseException:
            unwanted.set()
            raise


def _fly_enough(
    campaign: Campaign,
    work: ChunkJob,
    manifest: dict[str, Any],
    jobs: int,
    progress: Progress,
    notice: Callable[[str], None],
    most_failures: int | None,
    flights: ChunkExecutor | None,
) -> tuple[list[Part], int]:
    """Fly a campaign's samples, or as many as its stopping rule asks for; the manifest is told how many these are."""
    until = campaign.until
    if until is None:
        progress.phase(Phase.SIMULATING, campaign.samples)
        return run_chunks(work, jobs, progress, notice=notice, most_failures=most_failures, elsewhere=flights)
    sizes = interim_sizes(work.engine.chunk, until.at_most)
    manifest["criterion"]["looks"] = len(sizes)
    parts: list[Part] = []
    flown, before = 0, 0
    for look, size in enumerate(sizes, start=1):
        note = f"look {look} of at most {len(sizes)}"
        progress.phase(Phase.SIMULATING, note=note)
        sized = replace(work, draws=replace(work.draws, samples=size))
        more, now = run_chunks(sized, jobs, progress, before, notice, most_failures, flights)
        parts, flown, before = parts + more, flown + now, size
        manifest |= {"samples": size, "parts": part_records(parts)}
        progress.phase(Phase.ANALYSING, note=note)
        precision = _precision(work.folder, manifest, until)
        reached = precision <= until.precision
        manifest["stopping"] = until.described() | {"looks": len(sizes), "found": precision, "reached": reached}
        if reached:
            break
    return parts, flown


def _precision(folder: RunFolder, manifest: Mapping[str, Any], until: StoppingRule) -> float:
    """Half the width of the widest interval of an output's sigma ratio, at the confidence of the stopping rule."""
    asked = {**manifest, "criterion": {**manifest["criterion"], "confidence": until.confidence}}
    outputs = analyse(folder, to_json(asked)).comparison.outputs
    judged = [output.paired if until.quantity.endswith("paired") else output.plain for output in outputs]
    widths = [0.5 * (each.interval[1] - each.interval[0]) for each in judged if each.interval is not None]
    return max(widths, default=math.inf)


def _frame(campaign: Campaign, described: Mapping[str, Any]) -> Normalization | None:
    """How samples are reduced; none when they are stored themselves."""
    if campaign.store != SUMMARY:
        return None
    return normalization_of(linear_model(described), campaign.samples, block_length(campaign.design, campaign.samples))


def engine_of(path: Path, campaign: Path) -> str | None:
    """The engine of the run that a campaign file was stored with; none when it is not a run folder's own file."""
    manifest = RunFolder(path).manifest() if campaign.parent == path and campaign.name == CAMPAIGN else None
    return None if manifest is None else str(manifest["identity"]["engine"])


def check_scenario(described: str | Path | Campaign | Mapping[str, Any]) -> list[Check]:
    """Try out the scenario of a campaign with its errors; see `mcnav.scenarios.conformance`.

    Parameters
    ----------
    described : str, Path, Campaign or mapping
        See `mcnav.config.read.campaign_from`.

    Raises
    ------
    CampaignError
        When the campaign cannot be read.
    """
    campaign = campaign_from(described)
    with threadpool_limits(1):
        return check_conformance(campaign.scenario, campaign.errors.standard_deviations)
