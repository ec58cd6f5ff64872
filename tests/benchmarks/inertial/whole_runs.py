"""Whole runs of the commands, from the campaign's file to the report, each a process of its own."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final, TypeVar

from mcnav.systems.ins.scenario import EPOCHS, EnsembleEngine
from tests.benchmarks.inertial.compare import spread
from tests.benchmarks.inertial.engines import PROBES
from tests.benchmarks.inertial.flight import (
    HOUR,
    Setup,
    draws,
    navigation_of,
    read,
    write_campaign,
    write_trajectory,
)
from tests.benchmarks.spawn import run

Result = TypeVar("Result")

REPEATS: Final = 3
LONGEST: Final = 1_800.0
HIGH_RATE: Final = 100.0
"""Rows a second of the trajectory whose truth is timed."""


def command(arguments: Sequence[str], repeats: int = REPEATS) -> dict[str, Any]:
    """Run a command of mcnav several times, in a folder that is thrown away."""
    walls, processors, most = [], [], 0.0
    for _ in range(repeats):
        with TemporaryDirectory() as folder:
            begin = time.perf_counter()
            full = [sys.executable, "-m", "mcnav", *arguments, "--out", f"{folder}/out"]
            status, memory, processor, said = run(full, longest=LONGEST)
            walls.append(time.perf_counter() - begin)
        if status != 0:
            raise RuntimeError(f"mcnav {arguments[0]} ended with status {status}: {said[-300:]}")
        processors.append(processor)
        most = max(most, memory)
    return {"seconds": spread(walls), "processor_seconds": spread(processors), "megabytes": most, "runs": repeats}


def commands(folder: Path, setup: Setup, sizes: Sequence[int], repeats: int = REPEATS) -> list[dict[str, Any]]:
    """Time ``mcnav run`` with one job and two and more samples, and ``mcnav lincov``."""
    file = str(write_campaign(folder, setup))
    runs = [(setup.samples, 1, "ensemble"), *((size, 2, "ensemble") for size in sizes), (sizes[-1], 2, "shared-gains")]
    rows = []
    for samples, jobs, engine in runs:
        arguments = ["run", file, "--samples", str(samples), "--jobs", str(jobs), "--engine", engine]
        found = command(arguments, repeats if samples <= setup.samples else 1)
        rows.append({"command": "run", "samples": samples, "jobs": jobs, "engine": engine, **found})
    rows.append({"command": "lincov", "samples": None, "jobs": 1, "engine": None, **command(["lincov", file], repeats)})
    return rows


def truth_at_high_rate(folder: Path, free: Setup, aided: Setup, rate: float = HIGH_RATE) -> dict[str, float]:
    """Time what is done once along a trajectory with many rows, after everything has been compiled.

    Reading it; the free ensemble's tables with the steps that it chooses; the aided one's; and all that a run prepares.
    """
    place = folder / "high_rate"
    place.mkdir(exist_ok=True)
    write_trajectory(place / "flight.csv", rate)
    engine = read(place, free).scenario.engine("ensemble", draws(read(place, free), PROBES))
    if not isinstance(engine, EnsembleEngine):
        raise TypeError("expected the ensemble of free navigation")
    steps = len(engine.tables.durations) // EPOCHS
    spent = []

    def timed(work: Callable[[], Result]) -> Result:
        begin = time.perf_counter()
        result = work()
        spent.append(time.perf_counter() - begin)
        return result

    campaign = timed(lambda: read(place, free))
    timed(lambda: navigation_of(campaign).tables(steps))
    timed(lambda: campaign.scenario.engine("ensemble", draws(campaign, PROBES)))
    with_filter = navigation_of(read(place, aided)).aided
    if with_filter is None:
        raise TypeError("expected aided navigation")
    timed(lambda: with_filter.tables(1))
    names = ("read", "tables", "engine", "aided_tables")
    return {"rows": rate * HOUR + 1.0, **dict(zip(names, spent, strict=True))}
