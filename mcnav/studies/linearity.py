"""Range of linearity: multiples of a campaign's errors at which linear analysis fails, per source and together."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from mcnav._threads import one_thread
from mcnav._types import Array
from mcnav.analysis.comparison import Criterion, Model
from mcnav.analysis.linearity import AloneRange, DispersionRange, alone, together
from mcnav.config.read import Campaign
from mcnav.contract.engine import without_noise
from mcnav.contract.members import ready_engine
from mcnav.contract.samples import SimulationResult
from mcnav.errors import CampaignError, Problem
from mcnav.execution.chunks import PROBES
from mcnav.files import write_texts
from mcnav.lincov.partials import Propagate
from mcnav.progress import SILENT, Phase, Progress
from mcnav.report import linearity as tables
from mcnav.report.html import page_html
from mcnav.sampling.designs import SamplingDesign

SAMPLES: Final = 2_000
LARGEST_ALONE: Final = 100.0
LARGEST_TOGETHER: Final = 50.0


@dataclass(frozen=True)
class LinearityStudy:
    """Range of linearity of a campaign, from so many samples at each multiple.

    The multiples refer to ``sizes``, one sigma of each source (the value of a fixed one), shape (sources,), SI, whose
    effect by the linear model is ``contributions``, shape (sources, outputs). ``alone`` has one direction per source,
    then all sources at plus one sigma. Where the scenario has noise it is left out, and ``without_noise`` is true.
    """

    tolerance: float
    confidence: float
    sizes: Array
    contributions: Array
    alone: AloneRange
    together: DispersionRange
    samples: int
    without_noise: bool


def linearity_study(
    campaign: Campaign,
    tolerance: float | None = None,
    samples: int = SAMPLES,
    largest: float = LARGEST_TOGETHER,
    progress: Progress = SILENT,
) -> LinearityStudy:
    """Find a campaign's range of linearity.

    The tolerance is the campaign's by default; samples are those at each multiple of all errors together, up to the
    largest multiple. Noise is left out: the range is that of the constant errors. Raises `CampaignError` when there is
    noise and no constant error.
    """
    progress.phase(Phase.PREPARING)
    scenario, errors = campaign.scenario, campaign.errors
    criterion = Criterion(campaign.tolerance if tolerance is None else tolerance, campaign.confidence)
    draws = errors.draw(campaign.design, campaign.seed, samples, 0, samples)
    sizes = np.where(errors.standard_deviations > 0.0, errors.standard_deviations, errors.mean)
    directions = np.vstack([np.diag(sizes), sizes])
    linear = scenario.linear().end
    if linear.processes and not sizes.any():
        message = "has noise and no constant errors, and the range of linearity is that of constant errors"
        raise CampaignError([Problem(campaign.file, "scenario", message)])

    def counted(probes: Array) -> Propagate:
        propagate = without_noise(ready_engine(scenario, scenario.engines[0], probes))

        def propagate_and_count(errors: Array) -> SimulationResult:
            outcomes = propagate(errors)
            progress.advance(len(errors))
            return outcomes

        return propagate_and_count

    with one_thread():
        progress.phase(Phase.SIMULATING, note="each source alone")
        single = alone(
            lambda multiple: counted(multiple * np.vstack([directions, -directions])),
            linear, directions, criterion.tolerance, LARGEST_ALONE,
        )  # fmt: skip
        progress.phase(Phase.SIMULATING, note="all errors together")
        dispersion = together(
            lambda multiple: counted(multiple * draws[:PROBES]),
            Model(linear.partials, linear.nominal, errors.mean, errors.covariance),
            draws,
            criterion,
            SamplingDesign.of(campaign.design, samples),
            largest,
        )
    effects = (linear.partials * sizes).T
    return LinearityStudy(
        criterion.tolerance, criterion.confidence, sizes, effects, single, dispersion, samples, bool(linear.processes)
    )


def write_linearity(
    campaign: Campaign,
    path: Path,
    tolerance: float | None = None,
    samples: int = SAMPLES,
    largest: float = LARGEST_TOGETHER,
    progress: Progress = SILENT,
) -> tuple[LinearityStudy, list[Path]]:
    """Write the range of linearity as tables and a page; for the parameters see `linearity_study`.

    The files are ``linearity.csv`` (each source alone), ``linearity_dispersion.csv`` (all together) and, last,
    ``linearity.html``.
    """
    sources, outputs = campaign.scenario.sources, campaign.scenario.outputs
    study = linearity_study(campaign, tolerance, samples, largest, progress)
    progress.phase(Phase.REPORTING)
    about = (study.tolerance, study.confidence, study.samples, study.without_noise)
    page = tables.page(campaign.name, about, study.alone, study.together, study.contributions, sources, outputs)
    files = {
        "linearity.csv": tables.alone_table(study.alone, study.sizes, sources, outputs).to_csv(index=False),
        "linearity_dispersion.csv": tables.dispersion_table(study.together, outputs).to_csv(index=False),
        "linearity.html": page_html(page),
    }
    return study, write_texts(path, files)
