"""All kernels compiled beforehand, for images, clusters and wheels: every example is run with few samples."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from mcnav.config.read import read_campaign
from mcnav.contract.scenario import ScenarioError
from mcnav.entries.examples import examples, examples_folder
from mcnav.errors import CampaignError
from mcnav.lincov.partials import SimulationFailed
from mcnav.lincov.polynomial_engine import engine_names
from mcnav.progress import COMPILATION, SILENT, Phase, Progress
from mcnav.studies.lincov import linear_covariance
from mcnav.workflow.run import run_campaign

SAMPLES: Final = 40
"""Samples of each example by its first engine: more than are simulated side by side."""

FEWEST: Final = 2
"""Samples by other engines, which take seconds for each; they are run in one example of each class of scenarios."""

REFUSALS: Final = (CampaignError, ScenarioError, SimulationFailed)
"""What is raised where an example does not suit an engine or so few samples; what it needs by then is compiled."""


def compile_kernels(names: Sequence[str] = (), progress: Progress = SILENT) -> int:
    """Compile what examples, all unless they are named, need in each engine and in linear analysis.

    Returns
    -------
    int
        Functions that were compiled: those that are stored are not compiled again.
    """
    before, done = COMPILATION.functions, set[tuple[type, str]]()
    with TemporaryDirectory() as folder:
        for name in names or examples():
            progress.phase(Phase.PREPARING, note=name)
            file = examples_folder() / f"{name}.toml"
            campaign, short = (read_campaign(file, {"samples": count}) for count in (SAMPLES, FEWEST))
            first, *others = engine_names(campaign.scenario)
            kinds = {(type(campaign.scenario), engine) for engine in others} - done
            done |= kinds
            for asked, engine in ((campaign, first), *((short, engine) for _, engine in sorted(kinds, key=str))):
                with suppress(*REFUSALS):
                    run_campaign(asked, Path(folder, name, engine), engine, 1, report=False, force=True)
            with suppress(*REFUSALS):
                linear_covariance(campaign)
    return COMPILATION.functions - before
