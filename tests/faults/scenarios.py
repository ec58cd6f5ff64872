"""User-defined scenarios that fail in one way each, and their campaigns."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import active_children
from pathlib import Path

from mcnav.analysis.model import Model
from mcnav.config.read import Campaign
from mcnav.execution.progress import Silent
from mcnav.linear.block_sums import Normalization
from mcnav.linear.polynomial_engine import prepare_engine
from mcnav.runner.chunks import ChunkJob
from mcnav.runner.draws import DrawPlan
from mcnav.sampler.designs import block_length
from mcnav.store.chunk_files import SampleSchema
from mcnav.store.run_folder import RunFolder
from tests.conftest import ROOT
from tests.processes import run_to_end

NOBODY = 65_534

SINGLE = """
import ctypes, os, time
import numpy as np
from mcnav import Output, Source

class Mine:
    sources = (Source("a", "m", "m", 1.0),)
    outputs = (Output("b", "m", "m"), Output("c", "m", "m"))
    chunk = 25

    def fly(self, errors):
        a = errors[0]
        BODY
        return np.array([2.0 * a, a + a**2])
"""

VECTORISED = """
import time
import numpy as np
from mcnav import Output, Source

class Mine:
    sources = (Source("a", "m", "m", 1.0),)
    outputs = (Output("b", "m", "m"), Output("c", "m", "m"))

    def propagate(self, errors):
        a = errors[:, 0]
        BODY
        return np.column_stack([2.0 * a, a + a**2])
"""


def write_campaign(folder: Path, body: str, code: str = SINGLE, samples: int = 100, more: str = "") -> Path:
    """Write a campaign of the class ``Mine`` with the given lines in its code; return its path."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "mine.py").write_text(
        code.replace("BODY", textwrap.indent(textwrap.dedent(body), " " * 8).strip() or "pass")
    )
    described = f'samples = {samples}\nseed = 1\n{more}\n[scenario]\ntype = "mine.py:Mine"\n[errors]\na = "1 m"\n'
    path = folder / "mine.toml"
    path.write_text(described)
    return path


def normalization(model: Model, samples: int, block_length: int) -> Normalization:
    """Normalize the samples of a campaign by its linear model."""
    return Normalization.of(
        model.partials, model.mean, model.outcome_mean, model.outcome_covariance, samples, block_length
    )


def chunk_job(run: Campaign, folder: Path, engine: str | None = None) -> ChunkJob:
    """Build the job that a run sends to its workers."""
    errors, scenario = run.errors, run.scenario
    probes = errors.draw(run.design, run.seed, run.samples, 0, min(64, run.samples))
    prepared = prepare_engine(scenario, engine or scenario.engines[0], probes, errors.mean, errors.standard_deviations)
    linear = scenario.linear().end
    model = Model(linear.partials, linear.nominal, errors.mean, errors.covariance)
    frame = normalization(model, run.samples, block_length(run.design, run.samples)) if run.store == "summary" else None
    (folder / "samples").mkdir(parents=True)
    layout = SampleSchema.of(scenario.sources, scenario.outputs)
    draws = DrawPlan(errors, run.design, run.seed, run.samples)
    return ChunkJob(draws, prepared, RunFolder(folder), "0" * 64, layout, run.sample_timeout, frame)


@dataclass(frozen=True)
class OnAdvance(Silent):
    """Progress that calls a function each time samples have become ready."""

    call: Callable[[], object]

    def advance(self, samples: int, stored: bool = False) -> None:
        """Call it."""
        self.call()


class KillsWorkers(Silent):
    """Progress that kills a worker of each pool in turn, each time samples have become ready."""

    def __init__(self, most: int = 1) -> None:
        self.most = most
        self.killed: list[int] = []
        self._others = set(active_children())

    def advance(self, samples: int, stored: bool = False) -> None:
        """Kill one, unless as many are killed as shall be."""
        pool = [worker.pid for worker in active_children() if worker not in self._others and worker.pid]
        if pool and len(self.killed) < self.most:
            self.killed.append(pool[0])
            os.kill(pool[0], signal.SIGKILL)
            self._others.update(active_children())


@contextmanager
def as_nobody() -> Iterator[None]:
    """Act without the rights of root, who may write anywhere; whoever is not root stays who they are."""
    own = os.geteuid()
    if own == 0:
        os.seteuid(NOBODY)
    try:
        yield
    finally:
        os.seteuid(own)


def environment() -> dict[str, str]:
    """Return the environment of a process that runs this tree's program."""
    return os.environ | {"PYTHONPATH": str(ROOT), "COLUMNS": "200"}


def command(*arguments: object) -> list[str]:
    """Return the command line of the program."""
    return [sys.executable, "-m", "mcnav", *map(str, arguments)]


def mcnav(*arguments: object) -> subprocess.CompletedProcess[str]:
    """Run the program to its end."""
    return run_to_end(command(*arguments), env=environment())
