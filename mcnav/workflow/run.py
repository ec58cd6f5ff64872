"""Run a campaign: prepare its system, simulate its samples into a run folder, analyse them, write the report."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING, Any, TypeVar

from mcnav.analysis.remedies import Remedies, something_fails
from mcnav.analysis.summary import Summary
from mcnav.compiled.kept import keep
from mcnav.compiled.target import target
from mcnav.config.read import Campaign
from mcnav.config.stopping import StoppingRule
from mcnav.entries.inputs import InputFile
from mcnav.errors import CampaignError, Problem, RunFolderError, did_you_mean, near_names
from mcnav.execution.child_processes import side_threads
from mcnav.execution.progress import SILENT, Phase, Progress, note
from mcnav.execution.stopping import stopped_by
from mcnav.execution.threads import one_thread
from mcnav.files.whole import to_json
from mcnav.linear.polynomial_engine import engine_names
from mcnav.runner.chunks import ChunkJob
from mcnav.runner.identity import DrawnRun, check_no_foreign_files, check_resumable, identity_of
from mcnav.runner.runner import ChunkExecutor
from mcnav.runner.worker_processes import end_workers_apart
from mcnav.store.inputs import check_as_read, check_unchanged, file_records
from mcnav.store.manifest import CriterionRecord, ExecutionRecord, Identity, Manifest
from mcnav.store.provenance import commit
from mcnav.store.run_files import CAMPAIGN, FORMAT
from mcnav.store.run_folder import RunFolder
from mcnav.store.summaries import STORED_ROWS, SUMMARY
from mcnav.workflow.analyse import analyse, write_results
from mcnav.workflow.corrections import compute_corrections
from mcnav.workflow.exceedance import estimate_exceedances
from mcnav.workflow.linear_extremes import range_note
from mcnav.workflow.prepare import PreparedSystem, prepare_system
from mcnav.workflow.recorded_model import RecordedModel, summary_frame
from mcnav.workflow.stopping import Execution
from mcnav.workflow.stored_remedies import keep_remedies
from mcnav.workflow.stored_samples import doubt_samples, tables_over_time
from mcnav.workflow.what_if import what_if_of_run

if TYPE_CHECKING:
    from mcnav.report.results.model import RunAnalysis
    from mcnav.systems.user.conformance import Check

Result = TypeVar("Result")
Advise = Callable[[Campaign, "RunAnalysis"], Remedies | None]


@dataclass(frozen=True)
class Run:
    """The result of `run_campaign`.

    Attributes
    ----------
    results : Summary
        The content of ``summary.json``; ``summary`` is the same by key.
    simulated : int
        Samples that were simulated now; the others were stored already.
    notices : tuple of str
        Damage that was found and mended, a line each.
    """

    results: Summary
    simulated: int
    notices: tuple[str, ...] = ()

    @property
    def summary(self) -> dict[str, Any]:
        """The content of ``summary.json``."""
        return self.results.to_json()


def run_campaign(
    campaign: Campaign,
    path: Path,
    engine: str | None,
    jobs: int,
    fresh: bool = False,
    progress: Progress = SILENT,
    most_failures: int | None = None,
    executor: ChunkExecutor | None = None,
    force: bool = False,
    report: bool = True,
    advise: Advise | None = None,
) -> Run:
    """Run a campaign into a run folder, analyse it and write its report.

    An interrupted run continues where it stopped, and one of fewer samples is extended: chunks that are stored are not
    simulated again. The path is that of the run folder.

    Parameters
    ----------
    engine : str, optional
        One of `mcnav.linear.polynomial_engine.engine_names` of the scenario; by default the first.
    jobs : int
        Workers.
    fresh : bool
        Delete an earlier run in the folder.
    most_failures : int, optional
        Samples that may fail before the run is stopped.
    executor : ChunkExecutor, optional
        Used in place of this machine's threads and processes; see `mcnav.runner.dask_cluster`.
    force : bool
        Continue when partial derivatives do not converge; the summary and the report state it.
    report : bool
        Write the report; without it only the summary, and an earlier report is deleted.
    advise : callable, optional
        What would help a campaign in which something fails: it is kept in the folder, for reports.

    Raises
    ------
    CampaignError
        When the scenario has no such engine, cannot be simulated, or there is no linear model to compare with.
    RunFolderError
        When the folder holds something else, is in use, or cannot be written to.
    TooManyFailures
    """
    folder = RunFolder(path)
    progress.phase(Phase.PREPARING)
    engine_name = _engine_name(campaign, engine)
    check_no_foreign_files(folder)
    with folder.lock(), one_thread():
        folder.remove_partial_files()
        begun = _begin(campaign, folder, engine_name, fresh, force)
        execution = Execution(begun.job, jobs, progress, begun.notices.append, most_failures, executor)
        system, code = begun.system, campaign.code is not None
        with _computed_beside(lambda: _compute_beside(system, begun.manifest.identity), before=code) as beside:
            manifest, record = _simulate(execution, begun.manifest, campaign.until)
            progress.phase(Phase.ANALYSING)
            model = system.model.completed(beside())
        _finish(begun, manifest.model_copy(update={"model": model, "execution": record}))
        analysis = analyse(folder)
        if report:
            progress.phase(Phase.REPORTING)
            analysis = replace(analysis, what_if=what_if_of_run(analysis))
            failing = advise is not None and something_fails(analysis.summary)
            keep_remedies(folder, advise(campaign, analysis) if advise is not None and failing else None)
        return Run(write_results(folder, analysis, report), record.samples, tuple(begun.notices))


@dataclass(frozen=True)
class _Begun:
    """A run whose folder holds its first manifest: ``notices`` are lines about what was mended there."""

    system: PreparedSystem
    manifest: Manifest
    job: ChunkJob
    notices: list[str]


def _begin(campaign: Campaign, folder: RunFolder, engine_name: str, fresh: bool, force: bool) -> _Begun:
    """Identify a run, prepare its system and write its first manifest."""
    inputs = campaign.inputs()
    identity = identity_of(campaign.resolved, engine_name, campaign.code, inputs, campaign.scenario)
    check_as_read(inputs)
    run = DrawnRun(identity, campaign.design, campaign.samples)
    notices, processors = ([], target()) if fresh else check_resumable(folder, run)
    system = prepare_system(campaign, engine_name, force)
    if fresh:
        folder.clear([Path(file.path) for file in inputs])
    manifest = _first_manifest(system, identity, inputs, processors)
    frame = summary_frame(manifest, system.linear)
    if words := range_note(RecordedModel(system.model, system.linear)):
        note(words)
    folder.begin(manifest, system.history, campaign.stored_files(), inputs)
    job = ChunkJob(
        system.draws, system.engine, folder, run.digest, manifest.sample_schema, campaign.sample_timeout, frame,
        inputs=inputs, earlier=run.earlier_digests,
    )  # fmt: skip
    return _Begun(system, manifest, job, notices)


def _compute_beside(system: PreparedSystem, identity: Identity) -> dict[str, object]:
    """Compute what further simulations add to the linear model, as fields of its record.

    Corrections follow from the identity of the run, but for code of a user's, whose own simulations are kept.
    """
    exceedances = estimate_exceedances(system, system.requirements, system.campaign.confidence)

    def corrections() -> dict[str, Any]:
        return dict(to_json(asdict(compute_corrections(system))))

    known = corrections() if identity.code is not None else keep("corrections", identity.to_json(), corrections)
    return known | {"exceedance": exceedances or None}


def _simulate(execution: Execution, manifest: Manifest, rule: StoppingRule | None) -> tuple[Manifest, ExecutionRecord]:
    """Simulate the samples that are not stored; return the manifest with the chunks, and what was done."""
    began, folder = time.perf_counter(), execution.job.folder
    try:
        manifest, simulated = execution.run(manifest, rule)
        folder.remove_partial_files()
    except OSError as failure:
        raise RunFolderError(
            f"{folder.path}: cannot be written to: {failure.strerror or failure}; what is stored there is kept"
        ) from None
    seconds = round(time.perf_counter() - began, 3)
    return manifest, ExecutionRecord(jobs=execution.jobs, seconds=seconds, samples=simulated)


def _finish(begun: _Begun, manifest: Manifest) -> None:
    """Write the tables over time and the manifest of a run whose samples are stored."""
    system, folder = begun.system, begun.job.folder
    tables = tables_over_time(system, folder.chunk_folder, manifest.chunks)
    if manifest.unsettled is None:
        doubt = doubt_samples(system, lambda: folder.samples(manifest))
        manifest = manifest if doubt is None else manifest.model_copy(update={"unsettled": doubt})
    check_unchanged(begun.job.inputs, folder.path)
    folder.finish(manifest.model_copy(update={"complete": True}), tables)


def _engine_name(campaign: Campaign, name: str | None) -> str:
    """Return the name of the engine, by default the scenario's first; `CampaignError` when it has no such engine."""
    known = engine_names(campaign.scenario)
    name = name or known[0]
    if name not in known:
        message = f"got {name!r}; this scenario has {', '.join(known)}{did_you_mean(near_names(name, known))}"
        raise CampaignError([Problem(campaign.file, "engine", message)])
    return name


def _first_manifest(
    system: PreparedSystem, identity: Identity, inputs: Sequence[InputFile], processors: str
) -> Manifest:
    """Describe a run that begins."""
    campaign = system.campaign
    errors, design = campaign.errors, campaign.design
    return Manifest(
        format=FORMAT,
        campaign=campaign.name,
        samples=campaign.samples,
        seed=campaign.seed,
        design=design,
        criterion=CriterionRecord(tolerance=campaign.tolerance, confidence=campaign.confidence),
        requirements=campaign.requirements,
        identity=identity,
        accuracy=system.engine.accuracy,
        processor=processors,
        commit=commit(),
        started=datetime.now(UTC).isoformat(timespec="milliseconds"),
        heavy_tailed=tuple(errors.heavy_tailed(design)),
        long_tailed=tuple(errors.long_tailed(design)),
        normal=bool(errors.normal),
        store=campaign.store,
        stored_rows=min(STORED_ROWS, campaign.samples) if campaign.store == SUMMARY else None,
        unsettled=system.unsettled,
        remarks=system.remarks,
        model=system.model,
        complete=False,
        chunks=(),
        files=file_records(inputs),
    )


@contextmanager
def _computed_beside(compute: Callable[[], Result], before: bool) -> Iterator[Callable[[], Result]]:
    """Compute a result in a thread while the block runs, or before it, as a user's own code must be.

    When the block is interrupted, so are the simulations of the thread, and nothing waits for them.
    """
    if before:
        try:
            result = compute()
        except BaseException:
            end_workers_apart()
            raise
        yield lambda: result
        return
    unwanted = Event()

    def compute_until_unwanted() -> Result:
        with stopped_by(unwanted):
            return compute()

    with side_threads(1) as threads:
        try:
            yield threads.submit(compute_until_unwanted).result
        except BaseException:
            unwanted.set()
            raise


def engine_of(path: Path, campaign: Path) -> str | None:
    """Return the engine of the run that a campaign file was stored with; none when it is not a run folder's own."""
    manifest = RunFolder(path).manifest() if campaign.parent == path and campaign.name == CAMPAIGN else None
    return None if manifest is None else manifest.identity.engine


def check_scenario(campaign: Campaign) -> list[Check]:
    """Check the scenario of a campaign with its errors; see `mcnav.systems.user.conformance`."""
    from mcnav.systems.user.conformance import check_conformance  # which no run needs

    with one_thread():
        return check_conformance(campaign.scenario, campaign.errors.standard_deviations)
