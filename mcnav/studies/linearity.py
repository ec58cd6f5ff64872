"""How far linearity reaches: multiples of a campaign's errors, one source alone and all together."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from threadpoolctl import threadpool_limits

from mcnav._types import Array
from mcnav.analysis.comparison import Criterion, Model
from mcnav.analysis.linearity import AloneRange, DispersionRange, alone, together
from mcnav.config.read import Campaign
from mcnav.files import write_whole
from mcnav.lincov.partials import Propagate
from mcnav.progress import SILENT, Phase, Progress
from mcnav.report import linearity as shown
from mcnav.sampling.designs import SamplingDesign
from mcnav.scenarios.protocol import SimulationResult

SAMPLES: Final = 2_000
LARGEST_ALONE: Final = 100.0
LARGEST_TOGETHER: Final = 50.0
PROBES: Final = 64


@dataclass(frozen=True)
class LinearityStudy:
    """What was found.

    Attributes
    ----------
    tolerance, confidence : float
    sizes : ndarray, shape (sources,)
        One sigma of each source (the value of a fixed one), SI: what the multiples multiply.
    contributions : ndarray, shape (sources, outputs)
        What that does to each output by the linear model, SI.
    alone : AloneRange
        One direction a source, then one for all of them at once, each at plus one sigma.
    together : DispersionRange
    samples : int
        Flown at each multiple.
    """

    tolerance: float
    confidence: float
    sizes: Array
    contributions: Array
    alone: AloneRange
    together: DispersionRange
    samples: int


def linearity_study(
    campaign: Campaign,
    tolerance: float | None = None,
    samples: int = SAMPLES,
    largest: float = LARGEST_TOGETHER,
    progress: Progress = SILENT,
) -> LinearityStudy:
    """Find a campaign's range of linearity.

    Parameters
    ----------
    campaign : Campaign
    tolerance : float, optional
        Departure that counts, as a share; the campaign's unless given.
    samples : int
        Flights at each multiple of all errors together.
    largest : float
        Largest multiple of all errors together.
    progress : Progress
    """
    progress.phase(Phase.PREPARING)
    scenario, errors = campaign.scenario, campaign.errors
    allowed = campaign.tolerance if tolerance is None else tolerance
    engine = scenario.engines[0]
    draws = errors.draw(campaign.design, campaign.seed, samples, 0, samples)
    sizes = np.where(errors.standard_deviations > 0.0, errors.standard_deviations, errors.mean)
    directions = np.vstack([np.diag(sizes), sizes])
    linear = scenario.linear_model()

    def by_draws(multiple: float) -> Propagate:
        return _counted(scenario.engine(engine, multiple * draws[:PROBES]).propagate, progress)

    def by_directions(multiple: float) -> Propagate:
        both = multiple * np.vstack([directions, -directions])
        return _counted(scenario.engine(engine, both).propagate, progress)

    with threadpool_limits(1):
        progress.phase(Phase.SIMULATING, note="each source alone")
        single = alone(by_directions, linear, directions, allowed, LARGEST_ALONE)
        progress.phase(Phase.SIMULATING, note="all errors together")
        dispersion = together(
            by_draws,
            Model(linear.partials, linear.nominal, errors.mean, errors.covariance),
            draws,
            Criterion(allowed, campaign.confidence),
            SamplingDesign.of(campaign.design, samples),
            largest,
        )
    contributions = (linear.partials * sizes).T
    return LinearityStudy(allowed, campaign.confidence, sizes, contributions, single, dispersion, samples)


def _counted(propagate: Propagate, progress: Progress) -> Propagate:
    """Propagate, and count what has been."""

    def told(errors: Array) -> SimulationResult:
        outcomes = propagate(errors)
        progress.advance(len(errors))
        return outcomes

    return told


def write_linearity(
    campaign: Campaign,
    path: Path,
    tolerance: float | None = None,
    samples: int = SAMPLES,
    largest: float = LARGEST_TOGETHER,
    progress: Progress = SILENT,
) -> tuple[LinearityStudy, list[Path]]:
    """Write a study of the range of linearity as tables and a page; parameters as for `linearity_study`.

    Returns
    -------
    study : LinearityStudy
    written : list of Path
        ``linearity.csv`` (each source alone), ``linearity_dispersion.csv`` (all together) and ``linearity.html``.
    """
    sources, outputs = campaign.scenario.sources, campaign.scenario.outputs
    study = linearity_study(campaign, tolerance, samples, largest, progress)
    progress.phase(Phase.REPORTING)
    path.mkdir(parents=True, exist_ok=True)
    files = {
        "linearity.csv": shown.alone_table(study.alone, study.sizes, sources, outputs).to_csv(index=False),
        "linearity_dispersion.csv": shown.dispersion_table(study.together, outputs).to_csv(index=False),
        "linearity.html": shown.render(
            campaign.name,
            (study.tolerance, study.confidence, study.samples),
            study.alone,
            study.together,
            study.contributions,
            sources,
            outputs,
        ),
    }
    for name, text in files.items():
        write_whole(path / name, text.encode())
    return study, [path / name for name in files]
