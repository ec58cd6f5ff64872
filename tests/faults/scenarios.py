"""Scenarios of one's own that misbehave in one way each, and the campaigns that fly them."""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap
from pathlib import Path

from mcnav.analysis.comparison import Model
from mcnav.analysis.summed import normalization_of
from mcnav.config.read import Campaign
from mcnav.execution.chunks import ChunkJob, DrawPlan
from mcnav.lincov.polynomial_engine import prepare_engine
from mcnav.sampling.designs import block_length
from mcnav.store.parts import SampleSchema
from mcnav.store.run_folder import RunFolder
from tests.conftest import ROOT
from tests.processes import run_to_end

SINGLE = """
import ctypes, os, time
import numpy as np
from mcnav import *

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
from mcnav import *

class Mine:
    sources = (Source("a", "m", "m", 1.0),)
    outputs = (Output("b", "m", "m"), Output("c", "m", "m"))

    def propagate(self, errors):
        a = errors[:, 0]
        BODY
        return np.column_stack([2.0 * a, a + a**2])
"""


def written(folder: Path, body: str, code: str = SINGLE, samples: int = 100, more: str = "") -> Path:
    """A campaign of the class ``Mine`` whose code has some lines in it."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "mine.py").write_text(
        code.replace("BODY", textwrap.indent(textwrap.dedent(body), " " * 8).strip() or "pass")
    )
    described = f'samples = {samples}\nseed = 1\n{more}\n[scenario]\ntype = "mine.py:Mine"\n[errors]\na = "1 m"\n'
    path = folder / "mine.toml"
    path.write_text(described)
    return path


def work_of(run: Campaign, folder: Path, engine: str | None = None) -> ChunkJob:
    """What a run of a campaign sends to its workers, without the flights on the side."""
    errors, scenario = run.errors, run.scenario
    probes = errors.draw(run.design, run.seed, run.samples, 0, min(64, run.samples))
    prepared = prepare_engine(scenario, engine or scenario.engines[0], probes, errors.mean, errors.standard_deviations)
    linear = scenario.linear_model()
    model = Model(linear.partials, linear.nominal, errors.mean, errors.covariance)
    frame = (
        normalization_of(model, run.samples, block_length(run.design, run.samples)) if run.store == "summary" else None
    )
    (folder / "samples").mkdir(parents=True)
    layout = SampleSchema.of(scenario.sources, scenario.outputs)
    draws = DrawPlan(errors, run.design, run.seed, run.samples)
    return ChunkJob(draws, prepared, RunFolder(folder), "0" * 64, layout, run.sample_timeout, frame)


def environment() -> dict[str, str]:
    """Of a process that runs this tree's program."""
    return os.environ | {"PYTHONPATH": str(ROOT), "COLUMNS": "200"}


def command(*arguments: object) -> list[str]:
    """The program's command line."""
    return [sys.executable, "-m", "mcnav", *map(str, arguments)]


def mcnav(*arguments: object) -> subprocess.CompletedProcess[str]:
    """Run the program to its end."""
    return run_to_end(command(*arguments), env=environment())
