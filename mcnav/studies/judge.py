"""A recorded flight judged by its campaign, and a table of errors of somebody else's filter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from mcnav.config.documents import Description
from mcnav.config.read import Campaign, campaign_from
from mcnav.contract.recorded import FilteredRecord, Recording, RecordingError
from mcnav.contract.scenario import ScenarioError
from mcnav.errors import CampaignError, Problem
from mcnav.execution.progress import duration, note
from mcnav.execution.threads import one_thread
from mcnav.files.whole import indented_json, to_json, write_texts
from mcnav.judgement.error_table import ErrorVerdict, judge_errors
from mcnav.judgement.low_pass import low_pass_remarks
from mcnav.judgement.plain_files import IMU, START, find_fault
from mcnav.judgement.verdict import SIMULATED, TRIALS, Judgement, judge
from mcnav.logs.log_error import LogError
from mcnav.report.document.html import page_html
from mcnav.report.pages import judged
from mcnav.report.pages import judged_errors as errors_report
from mcnav.report.pages.judge_page import page
from mcnav.studies.campaign_units import in_campaign_units
from mcnav.studies.error_tables import read_error_table
from mcnav.studies.recordings import RecordingFiles, moved_back, read_recording, recordable
from mcnav.workflow.cost import LONG

JSON, PAGE = "judge.json", "judge.html"


def judge_recording(
    campaign: Description, files: RecordingFiles, simulated: int = SIMULATED,
    seed: int = 0,
) -> Judgement:  # fmt: skip
    """Take the filter of a campaign through a recorded flight, and judge the record.

    Parameters
    ----------
    campaign : path, Campaign or mapping
        Campaign file, `Campaign`, or a dictionary shaped like a file.
    files : RecordingFiles
        Of the recorded flight.
    simulated : int
        Simulated records that it is compared with.
    seed : int
        Of these.

    Raises
    ------
    CampaignError
        When a file cannot be read, or the filter cannot go through the record.

    Examples
    --------
    >>> import mcnav as mc
    >>> mc.judge({"scenario": {"type": "reentry", "trajectory": 1}}, mc.RecordingFiles("imu.csv"))  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    ...
    mcnav.errors.CampaignError: campaign: scenario.type: its flights cannot be recorded; expected type = "ins" ...
    """
    return _judged(campaign_from(campaign), files, simulated, seed)[1]


def _judged(campaign: Campaign, files: RecordingFiles, simulated: int, seed: int) -> tuple[FilteredRecord, Judgement]:
    recording, notes = read_recording(campaign, files)
    scenario = recordable(campaign)
    _refuse_faults(campaign, files, recording)
    mean, covariance = np.asarray(campaign.errors.mean), campaign.errors.covariance

    def filtered(delays: Mapping[str, tuple[float, float]]) -> FilteredRecord:
        record = scenario.filter_recording(moved_back(recording, delays), mean, covariance)
        return in_campaign_units(record, campaign)

    try:
        with one_thread():
            record = filtered({})
            trials, tell = min(TRIALS, simulated), partial(_tell_time, simulated)
            judgement = judge(record, simulated, trials, seed, tell, filtered)
    except RecordingError as problem:
        raise LogError(files.imu, str(problem)) from None
    except ScenarioError as problem:
        raise CampaignError([Problem(campaign.file, problem.key, str(problem))]) from None
    remarks = tuple(f"{files.imu.name}: {remark}" for remark in low_pass_remarks(recording))
    return record, replace(judgement, notes=(*notes, *remarks, *judgement.notes))


def _refuse_faults(campaign: Campaign, files: RecordingFiles, recording: Recording) -> None:
    """Refuse files that are not what they say, as they are seen without a filter."""
    sigmas = dict(
        zip(
            (source.name for source in campaign.scenario.sources),
            campaign.errors.standard_deviations.tolist(),
            strict=False,
        )
    )
    position = max(sigmas.get(f"position_{axis}", 0.0) for axis in ("north", "east", "down"))
    scale = max((sigma for name, sigma in sigmas.items() if "_scale_factor_" in name), default=0.0)
    fault = find_fault(recording, position, sigmas.get("heading", 0.0), scale)
    if fault is None:
        return
    of_sensors = {**{name: file.path for name, file in recordable(campaign).logs.items()}, **files.measurements}
    file = files.imu if fault.subject == IMU else files.start if fault.subject == START else of_sensors[fault.subject]
    raise LogError(file or files.imu, fault.message)


def _tell_time(simulated: int, seconds: float) -> None:
    """Print how long a judgement will take, where that is long."""
    if seconds >= LONG:
        note(f"judging by {simulated:,} simulated records: about {duration(seconds)}, longer where numbers are named")


def write_judgement(
    campaign: Campaign, files: RecordingFiles, folder: Path, simulated: int = SIMULATED, seed: int = 0
) -> tuple[Judgement, list[Path]]:
    """Judge a recorded flight; write its page and ``judge.json``."""
    record, judgement = _judged(campaign, files, simulated, seed)
    texts = {
        JSON: indented_json(to_json({"campaign": campaign.name, **judged.content(judgement)})),
        PAGE: page_html(page(campaign.name, record, judgement)),
    }
    return judgement, write_texts(folder, texts)


def write_error_judgement(table: Path, folder: Path) -> tuple[Sequence[ErrorVerdict], list[Path]]:
    """Judge a table of errors, sigmas and innovations; write its page and ``judge.json``."""
    errors = read_error_table(table)
    with one_thread():
        verdicts = judge_errors(errors)
    texts = {
        JSON: indented_json(to_json({"table": table.name, **errors_report.content(verdicts)})),
        PAGE: page_html(errors_report.page(table.name, errors, verdicts)),
    }
    return verdicts, write_texts(folder, texts)
