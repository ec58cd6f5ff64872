"""Would another filter have been consistent: a campaign with each kind of filter, by samples with the same errors.

Each kind has the engine that ``mcnav run`` takes, and all of them the same noise.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter, thread_time
from typing import Final

import numpy as np

from mcnav.analysis.filter_kinds import KindComparison, KindResult
from mcnav.analysis.sweep import Variable
from mcnav.config.overrides import VariedCampaign
from mcnav.config.read import Campaign
from mcnav.config.sweep_values import read_variables
from mcnav.contract.samples import Batch
from mcnav.contract.scenario import Scenario
from mcnav.errors import CampaignError, Problem, suggestion
from mcnav.execution.pace import Pace
from mcnav.execution.progress import SILENT, Phase, Progress, duration, note
from mcnav.files.whole import indented_json, write_texts
from mcnav.report.document.html import page_html
from mcnav.report.pages import filter_kinds as report
from mcnav.studies.boxed_run import noted_at_worst
from mcnav.systems.ins.filter.model import KINDS
from mcnav.systems.ins.recognition import is_ins
from mcnav.workflow.cost import LONG
from mcnav.workflow.run import run_campaign

POINTS: Final = 5
"""Values of a range."""

RUNS: Final = "runs"
CSV, JSON, PAGE = "filters.csv", "filters.json", "filters.html"


@dataclass(frozen=True)
class FilterPlan:
    """Comparison of kinds of filters.

    Attributes
    ----------
    kinds : sequence of str
        Of `KINDS`; all unless given.
    varied : mapping of str to (str or sequence)
        Values of one key by its path, or nothing.
    samples : int, optional
        Of each run; those of the campaign unless given.
    jobs : int
    """

    kinds: Sequence[str] = ()
    varied: Mapping[str, str | Sequence[object]] = field(default_factory=dict)
    samples: int | None = None
    jobs: int = 2


@dataclass(frozen=True)
class KindPace:
    """Computing time of a sample on one thread, its time on this machine (s), and how many a worker takes at a time."""

    milliseconds: float
    seconds: float
    chunk: int

    def of_workers(self, samples: int, jobs: int) -> float:
        """Return the time that workers take for samples, s."""
        return Pace(0.0, self.seconds).of_workers(samples, self.chunk, jobs)


def compare_filters(
    campaign: str | Path, plan: FilterPlan, folder: Path, progress: Progress = SILENT
) -> tuple[KindComparison, list[Path]]:
    """Run the campaign with each kind, and write ``filters.csv``, ``filters.json`` and, last, a page.

    Runs are in folders of their own below the folder, and are resumed there.

    Raises
    ------
    CampaignError
        When the campaign has no filter of aided inertial navigation, or a kind cannot do what it asks for.
    """
    progress.phase(Phase.PREPARING)
    kinds, variable = _kinds(plan.kinds), _variable(plan.varied)
    varied = VariedCampaign(noted_at_worst(campaign, list(plan.varied)))
    scenario = varied.campaign.scenario
    if not is_ins(scenario) or scenario.navigation.filter is None:
        message = 'has no filter whose kinds could be compared; expected type = "ins" with [[aiding]] and [filter]'
        raise CampaignError([Problem(varied.campaign.file, "", message)])
    samples = {} if plan.samples is None else {"samples": plan.samples}
    points = [(value, kind) for value in ([None] if variable is None else variable.values.tolist()) for kind in kinds]
    campaigns = []
    for value, kind in points:  # all are read before the first runs
        at = {} if variable is None or value is None else {variable.path: variable.written(value)}
        campaigns.append(varied.at({"filter.kind": kind, **at, **samples}))
    paces = [_pace(campaign.scenario) for campaign in campaigns]
    results: list[KindResult] = []
    for number, ((value, kind), each, pace) in enumerate(zip(points, campaigns, paces, strict=True)):
        name = kind if value is None else f"{number // len(kinds) + 1:02d}_{kind}"
        began = perf_counter()
        summary = run_campaign(each, folder / RUNS / name, None, plan.jobs, progress=progress).results
        if number == 0:
            _tell_time(campaigns, paces, plan.jobs, perf_counter() - began)
        results.append(KindResult(kind, value, f"{RUNS}/{name}", summary, pace.milliseconds))
    comparison = KindComparison(varied.campaign.name, kinds, variable, tuple(results))
    progress.phase(Phase.REPORTING)
    texts = {
        CSV: report.frame(comparison).to_csv(index=False, float_format="%.10g"),
        JSON: indented_json(report.table(comparison)) + "\n",
        PAGE: page_html(report.page(comparison)),
    }
    return comparison, write_texts(folder, texts)


def _kinds(asked: Sequence[str]) -> tuple[str, ...]:
    for kind in asked:
        if kind not in KINDS:
            raise CampaignError([Problem("--kind", "", f"unknown kind {kind!r}{suggestion(kind, list(KINDS))}")])
    return tuple(kind for kind in KINDS if not asked or kind in asked)


def _variable(varied: Mapping[str, str | Sequence[object]]) -> Variable | None:
    if not varied:
        return None
    if len(varied) > 1:
        raise CampaignError([Problem("--vary", "", f"got {len(varied)} keys; expected one")])
    return read_variables(varied, POINTS)[0]


def _tell_time(campaigns: Sequence[Campaign], paces: Sequence[KindPace], jobs: int, first: float) -> None:
    """Print how long the runs after the first will take, where that is long: beside their samples, what it has taken.

    Parameters
    ----------
    first : float
        Time of the first run, s.
    """
    samples = [pace.of_workers(campaign.samples, jobs) for campaign, pace in zip(campaigns, paces, strict=True)]
    left = len(campaigns) - 1
    seconds = sum(samples[1:]) + left * max(first - samples[0], 0.0)
    if seconds >= LONG:
        runs = f"{left} more run{'' if left == 1 else 's'} of {campaigns[0].samples:,} samples"
        note(f"{runs}: about {duration(seconds)} with --jobs {jobs}, less what is stored already")


def _pace(scenario: Scenario) -> KindPace:
    """Measure the computing time of a sample without errors: the engine compiles with its first chunk."""
    engine = scenario.engine(scenario.engines[0], np.zeros((1, len(scenario.sources))))
    chunk = Batch(np.arange(engine.chunk), np.zeros((engine.chunk, len(scenario.sources))), 0)
    engine.simulate(chunk, noise=False)
    began, computed = perf_counter(), thread_time()
    engine.simulate(chunk, noise=False)
    computed, seconds = thread_time() - computed, perf_counter() - began
    return KindPace(1000.0 * computed / engine.chunk, seconds / engine.chunk, engine.chunk)
