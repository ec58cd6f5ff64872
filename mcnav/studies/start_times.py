"""When to start navigation: the linear study of start times, checked by Monte Carlo at some of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from threadpoolctl import threadpool_limits

from mcnav._types import Array
from mcnav.analysis.comparison import Comparison, Criterion, Model, compare
from mcnav.config.read import Campaign
from mcnav.errors import CampaignError, Problem
from mcnav.files import write_whole
from mcnav.lincov.covariance import propagated_covariance
from mcnav.lincov.start_times import StartTimeStudy, study_start_times
from mcnav.progress import SILENT, Phase, Progress
from mcnav.report import start_times as shown
from mcnav.sampling.designs import SamplingDesign
from mcnav.scenarios.protocol import ScenarioError, VariableStart

EVENLY: Final = 6
"""Start times that are checked when a campaign names none, besides the best ones: so many up to the event."""

PROBES: Final = 64
"""Samples on which the engine's accuracy is settled at each start time."""


@dataclass(frozen=True)
class StartTimesFound:
    """What came of a study of start times.

    Attributes
    ----------
    study : StartTimeStudy
    checks : mapping of float to Comparison
        Monte Carlo by start time, s.
    own_sigma : ndarray, shape (outputs,)
        Linear dispersion of the campaign as it stands, with its own start and stated errors, SI.
    """

    study: StartTimeStudy
    checks: Mapping[float, Comparison]
    own_sigma: Array


@dataclass(frozen=True)
class Check:
    """Monte Carlo at one start time (s from the scenario's event)."""

    time: float
    comparison: Comparison


def start_time_study(campaign: Campaign, axes: str | None = None, count: int | None = None) -> StartTimeStudy:
    """The linear study that a campaign's ``[start_times]`` describes; arguments take the place of its entries.

    Raises
    ------
    CampaignError
        When the scenario has no start times to choose from.
    """
    plan = campaign.start_times
    if not isinstance(campaign.scenario, VariableStart):
        raise CampaignError([Problem(campaign.file, "scenario", "has no start times to choose from")])
    return study_start_times(
        campaign.scenario,
        campaign.errors.covariance,
        axes or plan.axes,
        count or plan.count,
        plan.schedule,
        plan.weights,
    )


def checked_times(campaign: Campaign, study: StartTimeStudy) -> tuple[float, ...]:
    """The start times to check: those that the campaign names, else some even ones up to the event and the best."""
    if campaign.start_times.check:
        return campaign.start_times.check
    even = np.linspace(study.times[0], max(0.0, study.times[0]), EVENLY)
    return tuple(np.unique(np.concatenate([even, study.times[[*study.best, study.best_weighted]]])))


def check_start_time(campaign: Campaign, time: float, axes: str) -> Check:
    """Fly a campaign's errors, as large as they are at a start time, from there, and compare with the linear model.

    Raises
    ------
    CampaignError
        When the time is not on the trajectory.
    """
    plan, errors, scenario = campaign.start_times, campaign.errors, campaign.scenario
    if not isinstance(scenario, VariableStart):
        raise CampaignError([Problem(campaign.file, "scenario", "has no start times to choose from")])
    try:
        started = scenario.started_at(time, axes)
    except ScenarioError as wrong:
        raise CampaignError([Problem(campaign.file, "start_times.check", str(wrong))]) from None
    multiples = plan.schedule.at(np.array([time]), len(scenario.sources))[0]
    draws = errors.draw(campaign.design, campaign.seed, plan.samples, 0, plan.samples) * multiples
    outcomes = started.engine(scenario.engines[0], draws[:PROBES]).propagate(draws).values
    linear = started.linear_model()
    covariance = errors.covariance * np.outer(multiples, multiples)
    model = Model(linear.partials, linear.nominal, errors.mean * multiples, covariance)
    design = SamplingDesign.of(campaign.design, plan.samples)
    criterion = Criterion(campaign.tolerance, campaign.confidence)
    return Check(time, compare(model, draws, outcomes, criterion, design))


def write_start_times(
    campaign: Campaign,
    path: Path,
    axes: str | None = None,
    count: int | None = None,
    checks: bool = True,
    progress: Progress = SILENT,
) -> tuple[StartTimesFound, list[Path]]:
    """Write a study of start times as tables and a page.

    Parameters
    ----------
    campaign : Campaign
    path : Path
        Folder.
    axes, count
        In place of the campaign's.
    checks : bool
        Whether Monte Carlo checks the linear dispersion.
    progress : Progress

    Returns
    -------
    found : StartTimesFound
    written : list of Path
        ``start_times.csv``, ``start_times_checks.csv`` (with checks) and ``start_times.html``.
    """
    sources, outputs = campaign.scenario.sources, campaign.scenario.outputs
    progress.phase(Phase.PREPARING)
    with threadpool_limits(1):
        study = start_time_study(campaign, axes, count)
        times = checked_times(campaign, study) if checks else ()
        progress.phase(Phase.SIMULATING, len(times) * campaign.start_times.samples)
        found = {}
        for time in times:
            found[time] = check_start_time(campaign, time, study.axes).comparison
            progress.advance(campaign.start_times.samples)
        own = propagated_covariance(campaign.scenario.linear_model().partials, campaign.errors.covariance)
    progress.phase(Phase.REPORTING)
    written = {"start_times.csv": shown.table(study, sources, outputs).to_csv(index=False)}
    if found:
        written["start_times_checks.csv"] = shown.check_table(found, outputs).to_csv(index=False)
    written["start_times.html"] = shown.render(campaign.name, study, found, sources, outputs)
    path.mkdir(parents=True, exist_ok=True)
    for name, text in written.items():
        write_whole(path / name, text.encode())
    sigma = np.sqrt(np.maximum(np.diag(own), 0.0))
    return StartTimesFound(study, found, sigma), [path / name for name in written]
