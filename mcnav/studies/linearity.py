"""Range of linearity: multiples of a campaign's errors at which linear analysis fails, per source and together."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Final

import numpy as np

from mcnav.analysis.comparison import Criterion
from mcnav.analysis.linearity import AloneRange, DispersionRange, alone, decade, together
from mcnav.analysis.model import Model
from mcnav.analysis.sized_outputs import components_of
from mcnav.arrays.types import Array
from mcnav.config.read import Campaign
from mcnav.contract.engine import Engine, scales_noise, without_noise
from mcnav.contract.members import ready_engine
from mcnav.contract.samples import Batch, SimulationResult
from mcnav.errors import CampaignError, Problem
from mcnav.execution.progress import SILENT, Phase, Progress
from mcnav.execution.threads import one_thread
from mcnav.files.whole import write_texts
from mcnav.linear.partials import Propagate
from mcnav.report.document.html import page_html
from mcnav.report.pages import linearity as tables
from mcnav.report.statements.linearity import NoiseUse
from mcnav.runner.draws import PROBES
from mcnav.sampler.designs import SamplingDesign

SAMPLES: Final = 2_000
LARGEST_ALONE: Final = 100.0
LARGEST_TOGETHER: Final = 50.0


@dataclass(frozen=True)
class LinearityStudy:
    """Range of linearity of a campaign, from so many samples at each multiple.

    The multiples refer to ``sizes``, one sigma of each source (the value of a fixed one), shape (sources,), SI, whose
    effect by the linear model is ``contributions``, shape (sources, outputs). ``alone`` has one direction per source,
    then all sources at plus one sigma, without noise. ``noise`` is what becomes of it with all errors together: it is
    ``scaled`` like them, or ``left out``; empty without any. ``sizes_alone`` are outputs, by number, that have no
    linear sigma: sizes that are zero in the nominal.
    """

    tolerance: float
    confidence: float
    sizes: Array
    contributions: Array
    alone: AloneRange
    together: DispersionRange
    samples: int
    noise: NoiseUse
    sizes_alone: tuple[int, ...]


def linearity_study(
    campaign: Campaign,
    tolerance: float | None = None,
    samples: int = SAMPLES,
    largest: float = LARGEST_TOGETHER,
    progress: Progress = SILENT,
) -> LinearityStudy:
    """Find a campaign's range of linearity.

    The tolerance is the campaign's by default; samples are those at each multiple of all errors together, up to the
    largest multiple. Noise is multiplied like the errors where the engine can do so. Elsewhere it is left out: the
    range is that of the constant errors, and `CampaignError` is raised when there is noise and no constant error.
    """
    progress.phase(Phase.PREPARING)
    scenario, errors = campaign.scenario, campaign.errors
    criterion = Criterion(campaign.tolerance if tolerance is None else tolerance, campaign.confidence)
    draws = errors.draw(campaign.design, campaign.seed, samples, 0, samples)
    sizes = np.where(errors.standard_deviations > 0.0, errors.standard_deviations, errors.mean)
    directions = np.vstack([np.diag(sizes), sizes])
    linear = scenario.linear().end
    engines = cache(lambda top: ready_engine(scenario, scenario.engines[0], top * draws[:PROBES]))
    noise: NoiseUse = "" if not linear.processes else "scaled" if scales_noise(engines(1.0)) else "left out"
    if noise == "left out" and not sizes.any():
        message = "has noise and no constant errors, and the range of linearity is that of constant errors"
        raise CampaignError([Problem(campaign.file, "scenario", message)])

    def counted(propagate: Propagate) -> Propagate:
        def propagate_and_count(errors: Array) -> SimulationResult:
            outcomes = propagate(errors)
            progress.advance(len(errors))
            return outcomes

        return propagate_and_count

    processes = linear.processes if noise == "scaled" else {}
    model = Model(linear.partials, linear.nominal, errors.mean, errors.covariance, processes,
                  components_of(scenario.outputs))  # fmt: skip
    with one_thread():
        progress.phase(Phase.SIMULATING, note="each source alone")
        single = alone(
            lambda top: counted(
                without_noise(ready_engine(scenario, scenario.engines[0], top * np.vstack([directions, -directions])))
            ),
            linear, directions, criterion.tolerance, LARGEST_ALONE,
        )  # fmt: skip
        progress.phase(Phase.SIMULATING, note="all errors together")
        dispersion = together(
            lambda multiple: counted(_at_multiple(engines(float(decade(np.array(multiple)))), multiple, campaign.seed)),
            model,
            draws,
            criterion,
            SamplingDesign.of(campaign.design, samples),
            largest,
        )
    effects = (linear.partials * sizes).T
    return LinearityStudy(
        criterion.tolerance, criterion.confidence, sizes, effects, single, dispersion, samples, noise,
        tuple(model.laws_of_sizes),
    )  # fmt: skip


def _at_multiple(engine: Engine, multiple: float, seed: int) -> Propagate:
    """Return the simulation of errors with so many times the noise, or without noise where it cannot be multiplied."""
    if not scales_noise(engine):
        return without_noise(engine)
    noisy = engine.with_noise(multiple)
    return lambda errors: noisy.simulate(Batch(np.arange(len(errors)), errors, seed))


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
    about = tables.About(study.tolerance, study.confidence, study.samples, study.noise, study.sizes_alone)
    page = tables.page(campaign.name, about, study.alone, study.together, study.contributions, sources, outputs)
    files = {
        "linearity.csv": tables.alone_table(study.alone, study.sizes, sources, outputs).to_csv(index=False),
        "linearity_dispersion.csv": tables.dispersion_table(study.together, outputs).to_csv(index=False),
        "linearity.html": page_html(page),
    }
    return study, write_texts(path, files)
