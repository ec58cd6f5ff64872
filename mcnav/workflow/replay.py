"""One sample of a run simulated again: by its own engine, by the reference engine, and with its history."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from mcnav.analysis.requirements import requirements_from
from mcnav.arrays.types import Array
from mcnav.config.read import Campaign
from mcnav.contract.engine import Engine, without_noise
from mcnav.contract.failure import OK
from mcnav.contract.history import Epochs, History
from mcnav.contract.quantities import Output
from mcnav.contract.samples import Batch, SimulationResult
from mcnav.contract.scenario import Scenario, ScenarioError, can_replay
from mcnav.errors import CampaignError, Problem, RunFolderError
from mcnav.execution.threads import one_thread
from mcnav.files.parquet_reading import read_table
from mcnav.files.whole import INPUTS, write_whole
from mcnav.linear.at_epochs import linear_at_epochs
from mcnav.linear.polynomial import PolynomialFitError
from mcnav.linear.polynomial_engine import exact_part, prepare_engine
from mcnav.physics.units import conversion
from mcnav.report.columns.requirements import NamedRequirement, stated
from mcnav.report.names import humanize
from mcnav.report.pages.replay import Outcome, Replay, files
from mcnav.runner.draws import DrawPlan
from mcnav.runner.identity import DrawnRun
from mcnav.runner.processes import IsolatedEngine
from mcnav.runner.soundness import isolated
from mcnav.runner.worker_processes import end_workers
from mcnav.store.chunk_files import (
    STATUS,
    chunk_name,
    samples_from,
    tracebacks_in,
    verify_chunk,
)
from mcnav.store.manifest import ExceedanceRecord, Manifest
from mcnav.store.run_folder import RunFolder
from mcnav.store.summaries import STORED_ROWS, SUMMARY, summary_chunk
from mcnav.systems.histories import with_errors
from mcnav.workflow.event_normals import has_noise
from mcnav.workflow.failing_flight import fly_way_to_fail
from mcnav.workflow.recorded_model import linear_model
from mcnav.workflow.stored_campaign import campaign_of

STORED: Final = "stored"


def replay(path: Path, index: int, campaign_file: Path | None = None) -> Replay:
    """Simulate one sample of a run again.

    Parameters
    ----------
    path : Path
        Run folder.
    campaign_file : Path, optional
        The campaign of the run, by default that of the run folder; needed for a user-defined scenario, because nothing
        in a run folder is executed.

    Raises
    ------
    CampaignError
        When the campaign cannot be read or simulated.
    RunFolderError
        When the folder holds no run, another campaign's, or no such sample.
    """
    folder = RunFolder(path)
    manifest = folder.existing_manifest()
    campaign, engine_name = campaign_of(folder, manifest, campaign_file)
    if not 0 <= index < campaign.samples:
        raise RunFolderError(f"{path}: has no sample {index}; they run from 0 to {campaign.samples - 1}")
    scenario, errors = campaign.scenario, campaign.errors
    draws = DrawPlan(errors, campaign.design, campaign.seed, campaign.samples)
    sample = draws.batch(index, index + 1)
    with one_thread():
        try:
            engines = _engines(scenario, engine_name, draws)
            linear = scenario.linear().end
            stored, traceback = _stored(folder, manifest, draws, index, engines[engine_name].chunk)
            again = [_simulate_again(name, engine, campaign, sample) for name, engine in engines.items()]
        except (ScenarioError, PolynomialFitError) as wrong:
            raise CampaignError([Problem(campaign.file, "scenario", str(wrong))]) from None
        finally:
            end_workers()
        history = next((replay.history for replay in reversed(again) if replay.history is not None), History())
        if can_replay(scenario):
            history = scenario.simulate_one(sample.errors[0])
    predicted = linear.nominal + linear.partials @ sample.errors[0]
    of_inputs = () if campaign_file is None or campaign_file.parent == path else _notes(folder, campaign)
    return Replay(
        campaign=campaign.name,
        index=index,
        sources=scenario.sources,
        outputs=scenario.outputs,
        errors=sample.errors[0],
        sigmas=errors.standard_deviations,
        linear=next((replay.linear for replay in reversed(again) if replay.linear is not None), predicted),
        outcomes=(*(() if stored is None else (stored,)), *(replay.outcome for replay in again)),
        traceback=next(filter(None, (traceback, *(replay.traceback for replay in again))), ""),
        history=history,
        notes=_revision_note(manifest, campaign) + of_inputs,
    )


def replay_failure(path: Path, number: int, campaign_file: Path | None = None) -> Replay:
    """Fly the most likely way to fail a requirement of a run, just beyond its limit.

    Parameters
    ----------
    path, campaign_file
        As for `replay`.
    number : int
        Of the requirement, from one, in the order of the report.

    Raises
    ------
    CampaignError, RunFolderError
        As `replay`; also when no way to fail is known.
    """
    folder = RunFolder(path)
    manifest = folder.existing_manifest()
    record = _way_to_fail(path, manifest, number)
    campaign, engine_name = campaign_of(folder, manifest, campaign_file)
    scenario, draws = campaign.scenario, DrawPlan(campaign.errors, campaign.design, campaign.seed, campaign.samples)
    outputs = [output.name for output in manifest.model.outputs]
    requirement = requirements_from(campaign.requirements, outputs)[number - 1]
    with one_thread():
        try:
            engines = _engines(scenario, engine_name, draws)
            own = isolated(scenario, exact_part(engines[engine_name]), campaign.sample_timeout)
            model = linear_model(manifest.model)
            throughout = linear_at_epochs(scenario, engines[engine_name]) if requirement.epochs else None
            noisy = has_noise(scenario, engines[engine_name])
            flight = fly_way_to_fail(own, noisy, campaign.errors, campaign.seed, model, requirement, record, throughout)
            others = [
                _outcome(name, without_noise(engine)(flight.errors[None]))
                for name, engine in engines.items()
                if name != engine_name
            ]
        except (ScenarioError, PolynomialFitError) as wrong:
            raise CampaignError([Problem(campaign.file, "scenario", str(wrong))]) from None
        finally:
            end_workers()
        history = scenario.simulate_one(flight.errors) if can_replay(scenario) else History()
    result, shown = flight.result, [output.shown_in for output in scenario.outputs]
    units = {output.name: (conversion(output.unit, output.shown_in), output.shown_in) for output in scenario.outputs}
    names = list(units)
    predicted = model.nominal + model.partials @ flight.errors
    if flight.epoch is None and len(flight.added):
        predicted[list(flight.outputs)] += flight.added
    at = _at(engines[engine_name].epochs, flight.epoch)
    noise = [
        f"noise adds {added * units[names[i]][0]:.4g} {shown[i]} to {humanize(names[i])}{at}, by linear analysis"
        for i, added in zip(flight.outputs, flight.added, strict=False)
    ]
    limits = NamedRequirement(
        requirement.kind,
        [names[i] for i in requirement.outputs],
        requirement.limits,
        requirement.probability,
        requirement.when,
        requirement.about,
    )
    return Replay(
        campaign=campaign.name,
        index=None,
        sources=scenario.sources,
        outputs=scenario.outputs,
        errors=flight.errors,
        sigmas=campaign.errors.standard_deviations,
        linear=predicted if result.linear_values is None else result.linear_values[0],
        outcomes=(_outcome(engine_name, result), *others),
        traceback=result.failures[0].traceback if result.failures else "",
        history=history,
        notes=(*_revision_note(manifest, campaign), *noise),
        requirement=number,
        limited=f"Required: {stated(limits, units)}. This flight reaches {flight.reached:.4f} times the limit.",
    )


def _at(epochs: Epochs | None, epoch: int | None) -> str:
    """Say when an epoch is; nothing of the end."""
    if epochs is None or epoch is None:
        return ""
    unit = epochs.label.rpartition("[")[2].rstrip("]") if "[" in epochs.label else ""
    return f" at {epochs.times[epoch]:.4g} {unit}".rstrip()


def _way_to_fail(path: Path, manifest: Manifest, number: int) -> ExceedanceRecord:
    """Return the record of a requirement's most likely way to fail; refuse where there is none."""
    records = {record.requirement + 1: record for record in manifest.model.exceedance or ()}
    known = [key for key, record in records.items() if record.point is not None]
    which = f"; known of {', '.join(map(str, known))}" if known else ""
    if number not in records:
        reason = "flights were chosen for no such requirement" if records else "no requirement is beyond counting"
        raise RunFolderError(f"{path}: requirement {number} has no likeliest failure: {reason}{which}")
    if number not in known:
        reason = records[number].refusal or "the run was made by an earlier version; run the campaign with --fresh"
        raise RunFolderError(f"{path}: requirement {number} has no likeliest failure: {reason}{which}")
    return records[number]


@dataclass(frozen=True)
class _Again:
    """A sample simulated again: its outcome, and what its engine knows of it.

    ``linear``, its linear outcome with its noise, shape (outputs,), is that of an engine with noise, and ``history`` of
    one with epochs.
    """

    outcome: Outcome
    linear: Array | None
    history: History | None
    traceback: str


def _engines(scenario: Scenario, engine_name: str, draws: DrawPlan) -> dict[str, Engine]:
    """Prepare the run's own engine, and the reference engine, unless it has noise of its own."""
    others = () if scenario.parts.noise else ("reference",)
    names = dict.fromkeys((engine_name, *(name for name in others if name in scenario.engines)))
    errors = draws.errors
    return {
        name: prepare_engine(scenario, name, draws.probes(), errors.mean, errors.standard_deviations) for name in names
    }


def _simulate_again(name: str, engine: Engine, campaign: Campaign, sample: Batch) -> _Again:
    outputs = campaign.scenario.outputs
    result = IsolatedEngine(engine, len(outputs), campaign.sample_timeout).simulate(sample)
    return _Again(
        outcome=_outcome(f"again, {name}", result),
        linear=None if result.linear_values is None else result.linear_values[0],
        history=None if engine.epochs is None else _history(engine.epochs, result, outputs),
        traceback=result.failures[0].traceback if result.failures else "",
    )


def write_replay(result: Replay, place: Path) -> list[Path]:
    """Write the page and the table of a replay; return their paths."""
    place.mkdir(parents=True, exist_ok=True)
    written = files(result)
    for name, content in written.items():
        write_whole(place / name, content)
    return [place / name for name in written]


def as_stored(result: Replay) -> bool:
    """Return whether the run's own engine gives the stored outcome again; true when none is stored.

    To nine digits: a user's vectorised function may round differently when it is given one sample alone.
    """
    stored, again = result.outcomes[0], result.outcomes[min(1, len(result.outcomes) - 1)]
    if stored.label != STORED:
        return True
    return stored.status == again.status and np.allclose(stored.values, again.values, 1e-9, 0.0, equal_nan=True)


def _revision_note(manifest: Manifest, campaign: Campaign) -> tuple[str, ...]:
    """State that a run was stored when its scenario computed samples with other last digits."""
    then, now = manifest.identity.revision or 1, getattr(campaign.scenario, "revision", None) or 1
    if then == now:
        return ()
    return (f"the run is of revision {then} of its scenario; samples of revision {now} have other last digits",)


def _notes(folder: RunFolder, campaign: Campaign) -> tuple[str, ...]:
    """List the copies in the run folder that replace files that have changed since."""
    copies = folder.path / INPUTS
    return tuple(
        f"scenario.{file.setting}: the file is not as it was; the run's own copy {copies / file.name} is used"
        for file in campaign.inputs()
        if file.setting is not None and Path(file.path).parent == copies.absolute()
    )


def _stored(
    folder: RunFolder, manifest: Manifest, draws: DrawPlan, index: int, engine_chunk: int
) -> tuple[Outcome | None, str]:
    """Read the outcome of a sample and its traceback; no outcome when it is not stored."""
    summary = manifest.store == SUMMARY
    number = index // (summary_chunk(engine_chunk, draws.samples) if summary else engine_chunk)
    path = folder.chunk_folder / chunk_name(number)
    identity = DrawnRun(manifest.identity, draws.design, draws.samples).digest
    if verify_chunk(folder.chunk_folder, number, identity, STORED_ROWS if summary else None) is None:
        if path.exists():
            raise RunFolderError(f"{path}: is damaged, or of another run; run the campaign again to mend it")
        return None, ""
    try:
        table = read_table(path, text=STATUS)
        samples = samples_from(table, manifest.sample_schema)
    except (OSError, LookupError, TypeError, ValueError):
        raise RunFolderError(f"{path}: does not have this run's columns; run the campaign again") from None
    rows, traceback = np.flatnonzero(samples.index == index), tracebacks_in(table).get(index, "")
    if len(rows) == 0:
        return None, traceback
    row = int(rows[0])
    return Outcome(STORED, samples.outputs[row], samples.status[row]), traceback


def _history(epochs: Epochs, again: SimulationResult, outputs: Sequence[Output]) -> History:
    """Return the errors of one sample at the epochs; nothing of a sample that failed."""
    if again.history is None or not np.isfinite(again.history).all():
        return History()
    return with_errors(History({epochs.label: epochs.times}), again.history[0], outputs)


def _outcome(label: str, result: SimulationResult) -> Outcome:
    failure = result.failures.get(0)
    return Outcome(label, result.values[0], OK if failure is None else failure.status)
