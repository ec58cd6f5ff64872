"""All kernels compiled beforehand, for images, clusters and wheels: every example is run with few samples."""

from __future__ import annotations

import multiprocessing
import os
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from mcnav.config.read import read_campaign
from mcnav.contract.scenario import ScenarioError
from mcnav.entries.examples import examples, examples_folder
from mcnav.errors import CampaignError
from mcnav.execution.child_processes import end_with_parent, interrupts_blocked
from mcnav.execution.progress import COMPILATION, SILENT
from mcnav.linear.partials import SimulationFailed
from mcnav.linear.polynomial_engine import engine_names
from mcnav.studies.linear_covariance import linear_covariance
from mcnav.studies.start_times import write_start_times
from mcnav.workflow.run import run_campaign

SAMPLES: Final = 40
"""Samples of each example by its first engine: more than are simulated side by side."""

FEWEST: Final = 2
"""Samples by other engines, which take seconds for each."""

DISTINCT: Final = (
    "19_flight_with_gnss", "25_guided_reentry", "01_tn_d1772_trajectory_4", "11_cruise", "15_flight_navigation_grade",
)  # fmt: skip
"""One example of each kind of scenario that has kernels: unless others are named, the only ones that all engines run.

They come first, and the longest of them before the others. The rest need hardly any kernel besides, so that processes
seldom compile the same side by side.
"""

LEFT_OUT: Final = ("26_reentry_to_a_landing_site",)
"""Examples that need no kernel which the distinct ones do not, and take seconds to prepare: left out unless named."""

REFUSALS: Final = (CampaignError, ScenarioError, SimulationFailed)
"""Errors where an example does not suit an engine or so few samples; what it needs by then is compiled."""


@dataclass(frozen=True)
class Compiled:
    """Result of compiling for one example: functions, and processor time of all it did, s."""

    name: str
    functions: int
    seconds: float


def compile_kernels(names: Sequence[str], jobs: int, tell: Callable[[str], None]) -> int:
    """Compile what examples, all unless they are named, need in each engine, in linear analysis and its start times.

    Parameters
    ----------
    jobs : int
        Processes that compile side by side.
    tell : callable
        Told of each example that is done, in a line.

    Returns
    -------
    int
        Functions that were compiled: those that are stored are not compiled again.
    """
    others = () if names else (name for name in examples() if name not in {*DISTINCT, *LEFT_OUT})
    tasks = [*((name, True) for name in names or DISTINCT), *((name, False) for name in others)]
    functions = 0
    results = (compile_for(*task) for task in tasks) if jobs == 1 else _compile_in_processes(tasks, jobs)
    for number, done in enumerate(results, start=1):
        functions += done.functions
        tell(f"{number} of {len(tasks)}: {done.name}: {done.functions} functions, {done.seconds:.1f} s")
    return functions


def compile_for(name: str, every: bool) -> Compiled:
    """Compile what an example needs in linear analysis and in its first engine, or in every engine.

    Requirements are left out: the search for rare events among samples takes half a minute, and no kernel of its own.
    A kernel's parts are not stored by themselves; engines that share them are therefore compiled by one process.
    """
    before, began = COMPILATION.functions, time.process_time()
    file = examples_folder() / f"{name}.toml"
    campaign, short = (replace(read_campaign(file, {"samples": count}), requirements=()) for count in (SAMPLES, FEWEST))
    first, *others = engine_names(campaign.scenario)
    for asked, engine in ((campaign, first), *((short, other) for other in others if every)):
        with TemporaryDirectory() as folder, suppress(*REFUSALS):
            run_campaign(asked, Path(folder), engine, 1, report=False, force=True)
    with TemporaryDirectory() as folder, suppress(*REFUSALS):
        linear_covariance(campaign)
        if "start_times" in campaign.resolved:
            write_start_times(campaign, Path(folder), None, None, False, SILENT)
    return Compiled(name, COMPILATION.functions - before, time.process_time() - began)


def _compile_in_processes(tasks: Sequence[tuple[str, bool]], jobs: int) -> Iterator[Compiled]:
    """Compile for examples, each in one of so many processes; yield what is done."""
    executor = ProcessPoolExecutor(
        min(jobs, len(tasks)), multiprocessing.get_context("spawn"), end_with_parent, (os.getpid(),)
    )
    with interrupts_blocked():
        submitted = [executor.submit(compile_for, *task) for task in tasks]
    try:
        for done in as_completed(submitted):
            yield done.result()
    except BaseException:  # an interrupted command waits for nothing
        for process in multiprocessing.active_children():
            process.kill()
        raise
    finally:
        executor.shutdown(cancel_futures=True)
