"""What a sample and a chunk cost, in processor time: the figures of ``mcnav docs scaling``.

    python -m tests.benchmarks.scaling

Prints the rows of that page's table. Processor time, not time on the wall: other work then counts little.
"""

from __future__ import annotations

import resource
import tempfile
import time
from pathlib import Path
from unittest.mock import patch

from mcnav.config.read import Campaign, read_campaign
from mcnav.execution.progress import SILENT
from mcnav.runner import dask_cluster as clusters
from mcnav.runner.chunks import SampleRange, simulate_chunk
from mcnav.runner.dask_cluster import connect
from mcnav.runner.runner import run_chunks
from mcnav.store import summaries
from mcnav.store.run_folder import RunFolder
from mcnav.workflow.analyse import analyse
from mcnav.workflow.run import run_campaign
from tests.conftest import ROOT
from tests.faults.scenarios import VECTORISED, chunk_job, write_campaign

FLOWN = (
    ("01_tn_d1772_trajectory_4", "ensemble", 1 << 18),
    ("02_tn_d1772_trajectory_1", "ensemble", 1 << 18),
    ("01_tn_d1772_trajectory_4", "map", 1 << 18),
    ("11_cruise", "ensemble", 1 << 18),
    ("14_polar", "vectorised", 1 << 18),
    ("02_tn_d1772_trajectory_1", "reference", 256),
)
"""Campaigns, engines, and samples of a chunk to be timed."""

TRIVIAL, SMALL = 1_000, 80
"""Chunks of a run that costs nothing else, and of one that is analysed."""


def _summary(name: str, samples: int) -> Campaign:
    return read_campaign(ROOT / "campaigns" / f"{name}.toml", {"samples": samples, "store": "summary"})


def per_sample(name: str, engine: str, samples: int, folder: Path) -> None:
    """Draw, fly, reduce and store one chunk, after one that compiled and warmed up."""
    work = chunk_job(_summary(name, 10**9), folder, engine)
    simulate_chunk(work, SampleRange(1, samples, samples + min(samples, work.engine.chunk)))
    began = time.process_time()
    simulate_chunk(work, SampleRange(2, 2 * samples, 3 * samples))
    seconds = time.process_time() - began
    size = (work.folder.chunk_folder / "part-00002.parquet").stat().st_size
    print(
        f"| {name}, {engine} | {seconds / samples * 1e6:,.2f} µs per sample | {size / 1e3:,.0f} kB per chunk |",
        flush=True,
    )


def per_task_of_a_cluster(folder: Path) -> None:
    """Processor time, for each task, of the process that hands chunks out, with the scheduler in it."""
    code = VECTORISED.replace("def propagate", "chunk = 2\n\n    def propagate")
    work = chunk_job(read_campaign(write_campaign(folder, "", code, samples=2 * TRIVIAL)), folder / "run")
    with connect(None, 2) as (cluster, _), patch.object(clusters, "MOST", 1):
        began = time.process_time()
        run_chunks(work, 2, SILENT, executor=cluster.simulate)
        busy = time.process_time() - began
    print(f"| handing out a task | {busy / TRIVIAL * 1e3:.1f} ms |", flush=True)


def per_chunk_of_the_analysis(folder: Path) -> None:
    """What the analysis takes longer for each chunk."""
    times = []
    with patch.object(summaries, "CHUNK", 8_192):
        for chunks in (SMALL // 2, SMALL):
            place = folder / str(chunks)
            run_campaign(_summary("01_tn_d1772_trajectory_4", 8_192 * chunks), place, None, 2)
            began = time.process_time()
            analyse(RunFolder(place))
            times.append(time.process_time() - began)
    print(f"| analysing a chunk | {(times[1] - times[0]) / (SMALL / 2) * 1e3:.1f} ms |", flush=True)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as name:
        place = Path(name)
        for number, (campaign, engine, samples) in enumerate(FLOWN):
            per_sample(campaign, engine, samples, place / str(number))
        per_chunk_of_the_analysis(place / "analysed")
        per_task_of_a_cluster(place / "trivial")
    print(f"| largest memory of one process | {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6:.2f} GB |")
