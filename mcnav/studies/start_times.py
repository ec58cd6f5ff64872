"""Start times of navigation: linear dispersion, with Monte Carlo checks at some start times."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from mcnav.analysis.comparison import Comparison, Criterion, compare
from mcnav.analysis.mean_errors import mean_errors, rounding_of_means
from mcnav.analysis.model import Model
from mcnav.analysis.sized_outputs import components_of
from mcnav.arrays.types import Array
from mcnav.config.read import Campaign
from mcnav.contract.engine import Engine
from mcnav.contract.members import ready_engine
from mcnav.contract.samples import Batch
from mcnav.contract.scenario import Scenario, ScenarioError
from mcnav.errors import CampaignError, Problem
from mcnav.execution.progress import SILENT, Phase, Progress
from mcnav.execution.threads import one_thread
from mcnav.files.whole import write_texts
from mcnav.linear.refusals import scenario_errors
from mcnav.linear.start_times import StartTimeStudy, study_start_times, usual_weights
from mcnav.report.document.html import page_html
from mcnav.report.pages import start_times as tables
from mcnav.runner.draws import PROBES
from mcnav.sampler.designs import SamplingDesign

EVENLY: Final = 6
"""Evenly spaced start times checked by default, besides the best ones."""


@dataclass(frozen=True)
class StartTimesFound:
    """Linear study of start times and its Monte Carlo checks by start time, s.

    ``own_rms`` are the linear root mean squares for the campaign's own start and errors, shape (outputs,), SI.
    """

    study: StartTimeStudy
    checks: Mapping[float, Comparison]
    own_rms: Array


def _scenario(campaign: Campaign, axes: str) -> Scenario:
    with scenario_errors(campaign.file, _place):
        campaign.scenario.check_start_axes(axes)
    return campaign.scenario


def _place(key: str) -> str:
    """Return where a campaign gives what a scenario refuses."""
    return "start_times.axes" if key == "axes" else key


def start_time_study(campaign: Campaign, axes: str | None = None, count: int | None = None) -> StartTimeStudy:
    """Run the linear study of a campaign's ``[start_times]``; arguments override its entries.

    Raises `CampaignError` when the scenario has a fixed start time, or not these axes.
    """
    plan, covariance = campaign.start_times, campaign.errors.covariance
    axes, count = axes or plan.axes, count or plan.count
    scenario = _scenario(campaign, axes)
    with scenario_errors(campaign.file, _place):
        study = study_start_times(scenario, covariance, axes, count, plan.schedule, plan.weights)
        means = _mean_errors(campaign, scenario, study)
    if not means.any():
        return study
    study = replace(study, means=means)
    return study if plan.weights is not None else replace(study, weights=usual_weights(scenario, study.rms[0]))


def _mean_errors(campaign: Campaign, scenario: Scenario, study: StartTimeStudy) -> Array:
    """Compute the linear mean errors for each start time, shape (n, outputs); zero of commands and times.

    What a flight without errors leaves is computed for each start if it leaves anything for the earliest one: a later
    start flies through a part of the same.
    """
    multiples = campaign.start_times.schedule.at(study.times, len(scenario.sources))
    of_sources = np.einsum("nos,ns->no", study.partials, multiples * campaign.errors.mean)
    nominal = np.zeros_like(of_sources)
    nominal[0] = _nominal_at(scenario, study, float(study.times[0]))
    if nominal[0].any():
        # nothing is left to be flown at the last time
        nominal[1:-1] = [_nominal_at(scenario, study, time) for time in study.times[1:-1].tolist()]
    means = np.nan_to_num(mean_errors(scenario.outputs, of_sources + nominal, nominal))
    rounding = [
        rounding_of_means(scenario.outputs, scenario.sources, *of_start)
        for of_start in zip(study.partials, means, study.sigma, strict=True)
    ]
    return np.where(np.abs(means) > np.array(rounding), means, 0.0)


def _nominal_at(scenario: Scenario, study: StartTimeStudy, time: float) -> Array:
    """Return the final errors of a flight without errors that starts at a time, shape (outputs,)."""
    return scenario.started_at(time, study.axes).linear().end.nominal


def checked_times(campaign: Campaign, study: StartTimeStudy) -> tuple[float, ...]:
    """Return the start times to check: the campaign's, or else evenly spaced candidates and the best."""
    if campaign.start_times.check:
        return campaign.start_times.check
    latest = 0.0 if study.clock.event else study.times[-1]
    even = np.linspace(study.times[0], max(latest, study.times[0]), EVENLY)
    if study.clock.instants:
        even = study.times[np.abs(study.times[:, None] - even).argmin(axis=0)]
    return tuple(np.unique(np.concatenate([even, study.times[[*study.best, study.best_weighted]]])))


def check_start_time(campaign: Campaign, time: float, axes: str) -> Comparison:
    """Simulate a campaign from a start time, s, with the errors of that time, and compare with the linear model.

    Raises `CampaignError` when the time is not on the trajectory.
    """
    plan, errors, design = campaign.start_times, campaign.errors, campaign.design
    try:
        started = _scenario(campaign, axes).started_at(time, axes)
    except ScenarioError as wrong:
        raise CampaignError([Problem(campaign.file, "start_times.check", str(wrong))]) from None
    multiples = plan.schedule.at(np.array([time]), len(campaign.scenario.sources))[0]
    draws = errors.draw(design, campaign.seed, plan.samples, 0, plan.samples) * multiples
    engine = ready_engine(started, campaign.scenario.engines[0], draws[:PROBES])
    outcomes, linear_outcomes = _simulated(engine, Batch(np.arange(len(draws)), draws, campaign.seed))
    linear = started.linear().end
    covariance = errors.covariance * np.outer(multiples, multiples)
    sizes = components_of(started.outputs)
    model = Model(linear.partials, linear.nominal, errors.mean * multiples, covariance, linear.processes, sizes)
    sampling = SamplingDesign.of(design, plan.samples)
    criterion = Criterion(campaign.tolerance, campaign.confidence)
    return compare(model, draws, outcomes, criterion, sampling, linear_outcomes)


def _simulated(engine: Engine, batch: Batch) -> tuple[Array, Array | None]:
    """Simulate samples, by chunks and with their noise if they have any; return final errors and the linear ones."""
    if not engine.noisy:
        return engine.simulate(batch).values, None
    values, linear = [], []
    for begin in range(0, len(batch.errors), engine.chunk):
        simulated = engine.simulate(batch[begin : begin + engine.chunk])
        values.append(simulated.values)
        linear.append(simulated.linear_values)
    known = [each for each in linear if each is not None]
    return np.concatenate(values), np.concatenate(known) if len(known) == len(values) else None


def write_start_times(
    campaign: Campaign,
    path: Path,
    axes: str | None = None,
    count: int | None = None,
    checks: bool = True,
    progress: Progress = SILENT,
) -> tuple[StartTimesFound, list[Path]]:
    """Write a study of start times, with or without Monte Carlo checks, as tables and a page into a folder.

    Axes and count override the campaign's. The files are ``start_times.csv``, ``start_times_checks.csv`` (with checks)
    and, last, ``start_times.html``.
    """
    sources, outputs = campaign.scenario.sources, campaign.scenario.outputs
    progress.phase(Phase.PREPARING)
    with one_thread():
        study = start_time_study(campaign, axes, count)
        times = checked_times(campaign, study) if checks else ()
        progress.phase(Phase.SIMULATING, len(times) * campaign.start_times.samples)
        times_founds = {}
        for time in times:
            times_founds[time] = check_start_time(campaign, time, study.axes)
            progress.advance(campaign.start_times.samples)
        own = _own_rms(campaign)
    progress.phase(Phase.REPORTING)
    files = {"start_times.csv": tables.table(study, sources, outputs).to_csv(index=False)}
    if times_founds:
        files["start_times_checks.csv"] = tables.check_table(times_founds, outputs).to_csv(index=False)
    files["start_times.html"] = page_html(tables.page(campaign.name, study, times_founds, sources, outputs))
    return StartTimesFound(study, times_founds, own), write_texts(path, files)


def _own_rms(campaign: Campaign) -> Array:
    """Return the linear root mean squares for the campaign's own start and errors, shape (outputs,)."""
    linear, errors = campaign.scenario.linear().end, campaign.errors
    model = Model(linear.partials, linear.nominal, errors.mean, errors.covariance, linear.processes)
    mean = np.nan_to_num(mean_errors(campaign.scenario.outputs, model.outcome_mean, linear.nominal))
    return np.asarray(np.hypot(np.sqrt(np.diag(model.outcome_covariance)), mean))
