"""All kernels compiled beforehand, for images, clusters and wheels: every example is run with few samples."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import as_completed
from contextlib import suppress
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from joblib.externals.loky.process_executor import ProcessPoolExecutor

from mcnav._subprocess import end_with_parent, interrupts_blocked
from mcnav.config.campaign import Campaign
from mcnav.config.read import read_campaign
from mcnav.contract.scenario import ScenarioError
from mcnav.entries.examples import examples, examples_folder
from mcnav.errors import CampaignError
from mcnav.lincov.partials import SimulationFailed
from mcnav.lincov.polynomial_engine import engine_names
from mcnav.progress import COMPILATION, SILENT
from mcnav.studies.lincov import linear_covariance
from mcnav.studies.start_times import write_start_times
from mcnav.workflow.run import run_campaign

SAMPLES: Final = 40
"""Samples of each example by its first engine: more than are simulated side by side."""

FEWEST: Final = 2
"""Samples by other engines, which take seconds for each."""

DISTINCT: Final = (
    "19_flight_with_gnss", "25_guided_reentry", "01_tn_d1772_trajectory_4", "11_cruise", "15_flight_navigation_grade",
)  # fmt: skip
"""One example of each kind of scenario that has kernels: the only ones that all engines run, and the first of all.

The longest comes first. Others need hardly any kernel besides, so that processes seldom compile the same side by side.
"""

REFUSALS: Final = (CampaignError, ScenarioError, SimulationFailed)
"""What is raised where an example does not suit an engine or so few samples; what it needs by then is compiled."""


class Part(StrEnum):
    """Part of what is done with an example."""

    RUN = "run"
    OTHERS = "run by other engines"
    LINEAR = "linear analysis"


@dataclass(frozen=True)
class Use:
    """Parts of what is done with an example."""

    example: str
    parts: tuple[Part, ...]

    def __str__(self) -> str:
        return f"{self.example}, {', '.join(self.parts)}"


@dataclass(frozen=True)
class Compiled:
    """What a use of an example has compiled: functions, and processor time of all it did, s."""

    use: Use
    functions: int
    seconds: float


def compile_kernels(names: Sequence[str], jobs: int, tell: Callable[[str], None]) -> int:
    """Compile what examples, all unless they are named, need in each engine, in linear analysis and its start times.

    Parameters
    ----------
    jobs : int
        Processes that compile side by side.
    tell : callable
        Told of each use of an example that is done, in a line.

    Returns
    -------
    int
        Functions that were compiled: those that are stored are not compiled again.
    """
    uses, functions = find_uses(names), 0
    for number, done in enumerate(_compile_in_processes(uses, jobs) if jobs > 1 else map(compile_for, uses), start=1):
        functions += done.functions
        tell(f"{number} of {len(uses)}: {done.use}: {done.functions} functions, {done.seconds:.1f} s")
    return functions


def find_uses(names: Sequence[str]) -> list[Use]:
    """List uses of examples by all engines and in linear analysis; without names, others by their first engine too."""
    uses = [Use(name, (part,)) for part in Part for name in names or DISTINCT]
    others = () if names else (name for name in examples() if name not in DISTINCT)
    return [*uses, *(Use(name, (Part.RUN, Part.LINEAR)) for name in others)]


def compile_for(use: Use) -> Compiled:
    """Compile what a use of an example needs.

    Requirements are left out: the search for rare events among samples takes half a minute, and no kernel of its own.
    """
    before, began = COMPILATION.functions, time.process_time()
    file = examples_folder() / f"{use.example}.toml"
    campaign, short = (replace(read_campaign(file, {"samples": count}), requirements=()) for count in (SAMPLES, FEWEST))
    first, *others = engine_names(campaign.scenario)
    for part in use.parts:
        if part == Part.RUN:
            _run(campaign, first)
        elif part == Part.OTHERS:
            for engine in others:
                _run(short, engine)
        else:
            _analyse(campaign)
    return Compiled(use, COMPILATION.functions - before, time.process_time() - began)


def _run(campaign: Campaign, engine: str) -> None:
    with TemporaryDirectory() as folder, suppress(*REFUSALS):
        run_campaign(campaign, Path(folder), engine, 1, report=False, force=True)


def _analyse(campaign: Campaign) -> None:
    with TemporaryDirectory() as folder, suppress(*REFUSALS):
        linear_covariance(campaign)
        if "start_times" in campaign.resolved:
            write_start_times(campaign, Path(folder), None, None, False, SILENT)


def _compile_in_processes(uses: Sequence[Use], jobs: int) -> Iterator[Compiled]:
    """Compile for all uses, each in one of so many processes; yield what is done."""
    executor = ProcessPoolExecutor(min(jobs, len(uses)), initializer=end_with_parent, initargs=(os.getpid(),))
    with interrupts_blocked():
        submitted = [executor.submit(compile_for, use) for use in uses]
    try:
        for done in as_completed(submitted):
            yield done.result()
    finally:  # an interrupted command waits for nothing
        executor.shutdown(wait=True, kill_workers=True)
