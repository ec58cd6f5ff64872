"""Soak: a long campaign that stores a summary, with its memory, open files and disk over time.

    python -m tests.benchmarks.soak free 100000000
    python -m tests.benchmarks.soak aided 1000000

``constant`` is an hour of free navigation with constant errors only, ``free`` with the noise of its instruments as
well, ``aided`` the same hour with GNSS once a second and a filter of 15 states with shared gains
(`tests.benchmarks.inertial.flight`). ``mcnav run`` is a process of its own, which is looked at from outside. The last
lines say whether its memory has grown, and whether the moments of its summary are those of linear covariance but for
chance; the exit status is 1 when not.
"""

from __future__ import annotations

import argparse
import math
import os
import re
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np
import pyarrow.parquet as pq
from scipy import stats

from mcnav.store.run_folder import RunFolder
from tests.benchmarks.inertial.flight import FREE, Setup, write_campaign

EVERY: Final = 5.0
"""Seconds between two looks."""

RECORD: Final = 4_096
"""Bytes that a chunk may leave in memory for good: its record in the manifest, half a kilobyte as text."""

BLOCKS: Final = 12
"""Means of so many parts of a run are taken for independent; looks at short distances are not."""

ALARM: Final = 1e-4
"""Probability of each of the three false alarms."""


@dataclass(frozen=True)
class Look:
    """State of a run at one time.

    Attributes
    ----------
    seconds : float
        Since its start.
    samples : int
        Stored.
    parent, workers : int
        Resident memory, bytes.
    processes, files : int
        Numbers of processes and of their open files.
    disk : int
        Bytes of the run folder.
    """

    seconds: float
    samples: int
    parent: int
    workers: int
    processes: int
    files: int
    disk: int

    def line(self, before: Look | None) -> str:
        """Return a line of the table."""
        passed = self.seconds - (before.seconds if before else 0.0)
        rate = (self.samples - (before.samples if before else 0)) / max(passed, 1e-9)
        memory = f"{self.parent / 1e6:10.1f} {self.workers / 1e6:10.1f} {self.processes:9} {self.files:6}"
        return f"{self.seconds:9.1f} {self.samples:13,} {rate:11,.0f} {memory} {self.disk / 1e6:8.2f}"


HEADING: Final = "  seconds       samples    a second  parent MB workers MB processes  files  disk MB"


def _tree(process: int) -> list[int]:
    """Return a process and those that it has started."""
    found = [process]
    with suppress(OSError):
        for task in Path(f"/proc/{process}/task").iterdir():
            found += [each for child in (task / "children").read_text().split() for each in _tree(int(child))]
    return found


def _resident(process: int) -> int:
    with suppress(OSError, IndexError):
        return int(Path(f"/proc/{process}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    return 0


def _open_files(process: int) -> int:
    with suppress(OSError):
        return len(list(Path(f"/proc/{process}/fd").iterdir()))
    return 0


def look(process: int, seconds: float, folder: Path, chunk: int) -> Look:
    """Look at a run whose chunks have so many samples."""
    processes = _tree(process)
    stored, disk = 0, 0
    for path in folder.rglob("*"):
        with suppress(OSError):
            disk += path.stat().st_size
            stored += path.name.startswith("part-")
    return Look(
        seconds, stored * chunk, _resident(process), sum(map(_resident, processes[1:])), len(processes),
        sum(map(_open_files, processes)), disk,
    )  # fmt: skip


def _chunk(folder: Path) -> int:
    """Return the samples of a chunk; 0 before the first is stored."""
    part = folder / "samples" / "part-00000.parquet"
    return int((pq.read_schema(part).metadata or {})[b"mcnav.samples"]) if part.exists() else 0


def growth(looks: Sequence[Look], samples: int) -> tuple[float, float]:
    """Return how much memory grew from the first tenth of a run to its end, bytes, and the standard error.

    The slope of a least-squares line through the means of `BLOCKS` parts, times the samples.
    """
    known = [each for each in looks if 0.1 * samples <= each.samples < samples]
    if len(known) < 2 * BLOCKS:
        return math.nan, math.nan
    parts = [
        (np.mean([each.samples for each in part]), np.mean([each.parent + each.workers for each in part]))
        for part in (known[at[0] : at[-1] + 1] for at in np.array_split(np.arange(len(known)), BLOCKS))
    ]
    found = stats.linregress(*np.array(parts).T)
    return float(found.slope) * samples, float(found.stderr) * samples


def check_growth(looks: Sequence[Look], samples: int, chunks: int) -> tuple[bool, str]:
    """Judge whether memory grew by more than the records of the chunks; the probability of a false alarm is `ALARM`."""
    found, error = growth(looks, samples)
    if not math.isfinite(found):
        return True, f"memory: fewer than {2 * BLOCKS} looks, so that its growth is not known"
    allowed, deviations = float(RECORD * chunks), float(stats.t.ppf(1.0 - ALARM, BLOCKS - 2))
    measured = f"{found / 1e6:+.2f} MB over the run, standard error {error / 1e6:.2f} MB"
    told = f"memory: {measured}; allowed {allowed / 1e6:.2f} MB"
    return found - deviations * error <= allowed, told


def check_moments(summary: Mapping[str, Any]) -> tuple[bool, list[str]]:
    """Judge the sampling errors of sigmas and means: plain less paired estimates are those of the linear system alone.

    Its outcomes are normal, so that a sigma of n samples has the relative standard error 1/sqrt(2 n), a mean
    sigma/sqrt(n). The probability of a false alarm is `ALARM` for all sigmas together, and for all means.
    """
    count, lines, good = summary["samples"] - summary["failed"], list[str](), True
    deviations = float(stats.norm.isf(ALARM / (2 * len(summary["outputs"]))))
    for i, output in enumerate(summary["outputs"]):
        sigma = summary["sigma_linear"][i]
        scale = (summary["sigma_ratio"][i] / summary["sigma_ratio_paired"][i] - 1.0) * math.sqrt(2.0 * count)
        mean = summary["mean_sample"][i] - summary["mean_linear"][i] - summary["bias"][i]
        place = mean / sigma * math.sqrt(count)
        good = good and abs(scale) < deviations and abs(place) < deviations
        lines.append(
            f"{output['name']:16} sigma over linear {summary['sigma_ratio'][i]:.6f}, paired "
            f"{summary['sigma_ratio_paired'][i]:.8f}; sampling errors of sigma and mean {scale:+.2f} and {place:+.2f} "
            f"standard errors (at most {deviations:.1f})"
        )
    return good, lines


def campaign_of(kind: str, folder: Path) -> tuple[Path, str]:
    """Write a campaign of a kind into a folder; return its file and its engine."""
    if kind == "aided":
        return write_campaign(folder, Setup()), "shared-gains"
    path = write_campaign(folder, FREE)
    if kind == "constant":
        constants = '[imu.gyro]\nbias = "0.008 deg/h"\nscale_factor = "5 ppm"\n[imu.accelerometer]\nbias = "25 ug"\n'
        path.write_text(re.sub(r"(?s)\[imu\].*(?=\[errors\])", constants, path.read_text()))
    return path, "ensemble"


def main(kind: str, samples: int, jobs: int, every: float, place: Path) -> int:
    """Run a campaign and print what is seen of it; return the number of checks that fail."""
    campaign, engine = campaign_of(kind, place)
    folder, looks, chunk = place / "run", list[Look](), 0
    words = ["run", campaign, "--engine", engine, "--samples", samples, "--jobs", jobs, "--store", "summary"]
    command = [sys.executable, "-m", "mcnav", *map(str, words), "--out", str(folder)]
    print(f"{kind}: {samples:,} samples, {engine}, {jobs} jobs\n{HEADING}", flush=True)
    began = time.monotonic()
    with (place / "output").open("wb") as output, subprocess.Popen(command, stdout=output, stderr=output) as process:
        while process.poll() is None:
            with suppress(subprocess.TimeoutExpired):
                process.wait(every)
            chunk = chunk or _chunk(folder)
            looks.append(look(process.pid, time.monotonic() - began, folder, chunk))
            if process.poll() is None:
                print(looks[-1].line(looks[-2] if len(looks) > 1 else None), flush=True)
    text = (place / "output").read_text()
    if process.returncode != 0:
        print(f"mcnav run ended with status {process.returncode}: {text[-2_000:]}")
        return 1
    summary = RunFolder(folder).summary()
    chunks = len(RunFolder(folder).finished_manifest().chunks)
    steady, grown = check_growth(looks, samples, chunks)
    sound, lines = check_moments(summary)
    largest, files = max(each.parent + each.workers for each in looks), max(each.files for each in looks)
    took = f"{summary['samples']:,} samples in {looks[-1].seconds:,.0f} s, {chunks} chunks, {summary['failed']} failed"
    print(f"{took}; at most {largest / 1e6:,.0f} MB and {files} open files; {looks[-1].disk / 1e6:.2f} MB on disk")
    print(f"{grown}: {'as it should be' if steady else 'GROWS'}")
    print("\n".join(lines))
    print(
        f"moments: {'those of linear covariance but for chance' if sound else 'DIFFER'}; verdict {summary['verdict']}"
    )
    return (not steady) + (not sound)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kind", choices=("constant", "free", "aided"))
    parser.add_argument("samples", type=int)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--every", type=float, default=EVERY, help="seconds between two looks")
    asked = parser.parse_args()
    with TemporaryDirectory() as name:
        sys.exit(main(asked.kind, asked.samples, asked.jobs, asked.every, Path(name)) > 0)
