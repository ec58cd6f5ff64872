"""How whole runs of `mcnav run` grow: with samples, with jobs; and where their time goes.

Every run is a process of its own, into a folder that is thrown away: wall and processor time from start to finished
report, and the peak of its memory.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

from tests.benchmarks.spawn import run

ROOT: Final = Path(__file__).parent.parent.parent
CAMPAIGN: Final = ROOT / "campaigns" / "01_tn_d1772_trajectory_4.toml"
SAMPLES: Final = tuple(10**power for power in range(3, 8))
FULL: Final = 10**8
"""Flown only when it is asked for: minutes."""

JOBS: Final = (1, 2)
STAGED: Final = 10**6
LONGEST: Final = 3_600.0


def flown(samples: int, jobs: int, store: str) -> dict[str, Any]:
    """One run from start to finished report."""
    with TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "mcnav", "run", str(CAMPAIGN), "--out", f"{folder}/run", "--store", store]
        begin = time.perf_counter()
        status, memory, processor, said = run(
            [*command, "--samples", str(samples), "--jobs", str(jobs)], longest=LONGEST
        )
        wall = time.perf_counter() - begin
        stored = sum(path.stat().st_size for path in Path(folder).rglob("*") if path.is_file())
    if status != 0:
        raise RuntimeError(f"mcnav run ended with status {status}: {said[-300:]}")
    return {
        "samples": samples,
        "jobs": jobs,
        "store": store,
        "seconds": wall,
        "processor_seconds": processor,
        "megabytes": memory,
        "stored_megabytes": stored / 1e6,
    }


def by_samples(full: bool) -> list[dict[str, Any]]:
    """Summaries of more and more samples, two jobs."""
    return [flown(samples, JOBS[-1], "summary") for samples in (*SAMPLES, *([FULL] if full else ()))]


def by_jobs() -> list[dict[str, Any]]:
    """A million samples, all of them stored and as a summary, with one job and two."""
    return [flown(STAGED, jobs, store) for store in ("samples", "summary") for jobs in JOBS]
