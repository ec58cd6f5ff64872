"""One sample of a run flown again: with its own engine, with the reference engine, and with its history."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow.parquet as pq
from threadpoolctl import threadpool_limits

from mcnav.config.read import Campaign, read_campaign
from mcnav.config.scenarios import Kept
from mcnav.errors import CampaignError, Problem, RunFolderError
from mcnav.execution.identity import PROBES, chunk_digest, identity_of
from mcnav.execution.processes import IsolatedEngine, end_workers
from mcnav.files import to_json, write_whole
from mcnav.lincov.polynomial import PolynomialFitError
from mcnav.lincov.polynomial_engine import prepare_engine
from mcnav.report.replay import Outcome, Replay, files
from mcnav.scenarios.protocol import History, Replayable, ScenarioError, SimulationResult
from mcnav.store.inputs import INPUTS, changed_since
from mcnav.store.parts import OK, SampleSchema, part_name, samples_from, tracebacks_in, whole_part
from mcnav.store.run_folder import CAMPAIGN, MANIFEST, RunFolder
from mcnav.store.summaries import KEPT, SUMMARY, summary_chunk

STORED: Final = "stored"


def replay(path: Path, index: int, campaign_file: Path | None = None) -> Replay:
    """Fly one sample of a run again.

    Parameters
    ----------
    path : Path
        Run folder.
    index : int
        Of the sample.
    campaign_file : Path, optional
        The campaign of the run. By default that of the run folder; a scenario of the user's own, which is code, must be
        named here, because nothing that lies in a run folder is executed.

    Raises
    ------
    CampaignError
        When the campaign cannot be read or flown.
    RunFolderError
        When the folder holds no run, another campaign's, or no such sample.
    """
    folder = RunFolder(path)
    manifest = folder.manifest()
    if manifest is None:
        raise RunFolderError(f"{path}: holds no run ({MANIFEST} is missing)")
    campaign, engine = _campaign_of(folder, manifest, campaign_file)
    if not 0 <= index < campaign.samples:
        raise RunFolderError(f"{path}: has no sample {index}; they run from 0 to {campaign.samples - 1}")
    scenario, errors = campaign.scenario, campaign.errors
    layout = SampleSchema.of(scenario.sources, scenario.outputs)
    design, seed, samples = campaign.design, campaign.seed, campaign.samples
    sample = errors.draw(design, seed, samples, index, index + 1)
    with threadpool_limits(1):
        try:
            probes = errors.draw(design, seed, samples, 0, min(PROBES, samples))
            engines = dict.fromkeys((engine, "reference" if "reference" in scenario.engines else engine))
            ready = {
                name: prepare_engine(scenario, name, probes, errors.mean, errors.standard_deviations)
                for name in engines
            }
            linear = scenario.linear_model()
            identity = chunk_digest(manifest["identity"], campaign.design, campaign.samples)
            stored, traceback = _stored(folder, index, campaign, ready[engine].chunk, identity, layout)
            outcomes = [] if stored is None else [stored]
            for name, prepared in ready.items():
                again = IsolatedEngine(prepared, len(scenario.outputs), campaign.sample_timeout).propagate(sample)
                outcomes.append(_outcome(f"again, {name}", again))
                traceback = traceback or again.tracebacks.get(0, "")
        except (ScenarioError, PolynomialFitError) as wrong:
            raise CampaignError([Problem(campaign.file, "scenario", str(wrong))]) from None
        finally:
            end_workers()
        history = scenario.simulate_one(sample[0]) if isinstance(scenario, Replayable) else History()
    return Replay(
        campaign=campaign.name,
        index=index,
        sources=scenario.sources,
        outputs=scenario.outputs,
        errors=sample[0],
        sigmas=errors.standard_deviations,
        linear=linear.nominal + linear.partials @ sample[0],
        outcomes=tuple(outcomes),
        traceback=traceback,
        history=history,
        notes=() if campaign_file is None or campaign_file.parent == path else _notes(folder, campaign),
    )


def write_replay(found: Replay, place: Path) -> list[Path]:
    """Write the page and the table of a replay; their paths."""
    place.mkdir(parents=True, exist_ok=True)
    written = files(found)
    for name, content in written.items():
        write_whole(place / name, content)
    return [place / name for name in written]


def as_stored(found: Replay) -> bool:
    """Whether the run's own engine gave the stored outcome again; true when none is stored.

    To nine digits: a vectorised function of a user's may round otherwise when it is given one sample alone.
    """
    stored, again = found.outcomes[0], found.outcomes[min(1, len(found.outcomes) - 1)]
    if stored.label != STORED:
        return True
    return stored.status == again.status and np.allclose(stored.values, again.values, 1e-9, 0.0, equal_nan=True)


def _campaign_of(folder: RunFolder, manifest: Mapping[str, Any], file: Path | None) -> tuple[Campaign, str]:
    """The campaign of a run and its engine; refused when it is not the one that was flown."""
    flown = manifest["identity"]["campaign"]
    given = {key: flown[key] for key in ("samples", "seed")} | {"store": flown.get("store", "samples")}
    path = folder.path / CAMPAIGN if file is None else file
    listed = manifest.get("files", [])
    kept = {
        record["setting"]: Kept(record["sha256"], folder.kept_input(record) if record["kept"] else None)
        for record in listed
        if record.get("setting") is not None
    }
    campaign = read_campaign(path, given, execute=file is not None, kept=kept)
    engine = str(manifest["identity"]["engine"])
    with threadpool_limits(1):
        now, then = to_json(identity_of(campaign, engine)), manifest["identity"]
    if any(now.get(key) != then.get(key) for key in ("campaign", "code")):
        raise RunFolderError(f"{path}: is not the campaign that was flown in {folder.path}")
    change = changed_since(then.get("files", {}), now.get("files", {}))
    if change is not None:
        raise RunFolderError(f"{path}: reads other files than when {folder.path} was made ({change}); restore the file")
    return campaign, engine


def _notes(folder: RunFolder, campaign: Campaign) -> tuple[str, ...]:
    """Which files of the run take the place of files that have changed since."""
    copies = folder.path / INPUTS
    return tuple(
        f"scenario.{file.setting}: the file is not as it was; the run's own copy {copies / file.name} is used"
        for file in campaign.inputs()
        if file.setting is not None and Path(file.path).parent == copies.absolute()
    )


def _stored(
    folder: RunFolder, index: int, campaign: Campaign, chunk: int, identity: str, layout: SampleSchema
) -> tuple[Outcome | None, str]:
    """What the run folder says of a sample, and its traceback; no outcome when it was not flown yet, or not kept."""
    summary = campaign.store == SUMMARY
    number = index // (summary_chunk(chunk, campaign.samples) if summary else chunk)
    path = folder.parts / part_name(number)
    if whole_part(folder.parts, number, identity, KEPT if summary else None) is None:
        if path.exists():
            raise RunFolderError(f"{path}: is damaged, or of another run; run the campaign again to mend it")
        return None, ""
    table = pq.read_table(path)
    samples = samples_from(table, dataclasses.replace(layout, errors=()))  # a run of before knows no later sources
    rows, traceback = np.flatnonzero(samples.index == index), tracebacks_in(table).get(index, "")
    if len(rows) == 0:
        return None, traceback
    row = int(rows[0])
    return Outcome(STORED, samples.outputs[row], samples.status[row]), traceback


def _outcome(label: str, outcomes: SimulationResult) -> Outcome:
    reason = outcomes.failures.get(0)
    return Outcome(label, outcomes.values[0], OK if reason is None else f"failed: {reason}")
