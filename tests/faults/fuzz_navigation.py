"""Fuzz campaigns of inertial navigation and trajectory files: ``python -m tests.faults.fuzz_navigation 100000 20000``.

Files of a grammar (`tests.faults.grammar`) are read, and nothing is simulated. Each is read, or refused with lines that
name the file and, within it, a key, a row or a column; anything else, more than `LONGEST` seconds, or more than
`LARGEST` bytes of memory, is a finding, kept with the input that made it.
"""

from __future__ import annotations

import random
import re
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Final

import pyarrow as pa

from mcnav.config.read import read_campaign
from mcnav.errors import CampaignError
from tests.faults import grammar
from tests.processes import largest_memory

LONGEST: Final = 10.0
"""Seconds of processor time."""
LARGEST: Final = 2_000_000_000

OWN: Final = """samples = 100
scenario = { type = "ins", trajectory = "TRAJECTORY" }
errors = { position = "5 m" }
"""
"""Campaign along a fuzzed trajectory."""

WHOLE: Final = ("is not TOML", "is not UTF-8", "cannot be read", "bytes", "nested", "too ")
"""Words of messages about a campaign file as a whole."""


def check_lines(refused: CampaignError, path: Path) -> None:
    """Assert that each line names the file and a key, or tells of the file as a whole."""
    lines = str(refused).splitlines()
    assert lines, "refused without a word"
    assert len(lines) <= 60, "too many lines"
    for line in lines:
        assert line.isprintable(), "a line that is none"
        assert len(line) < 2_000, "a line without an end"
        assert line.startswith(f"{path}: ") or line.startswith("… and ") or "more" in line, f"no file: {line[:200]}"
        rest = line.removeprefix(f"{path}: ")
        named = re.match(r"[^:]+: \S", rest) is not None
        assert named or any(word in rest for word in WHOLE) or "more" in line, f"no key: {line[:200]}"


def read(content: bytes, path: Path) -> str:
    """Read a campaign file: ``read`` or ``refused``; raises when anything else happens.

    One that takes long is read once more: the first use of some equations compiles them.
    """
    path.write_bytes(content)
    for _ in range(2):
        began, outcome = time.process_time(), "read"
        try:
            read_campaign(path)
        except CampaignError as refused:
            check_lines(refused, path)
            outcome = "refused"
        took = time.process_time() - began
        if took < LONGEST:
            return outcome
    raise AssertionError(f"took {took:.1f} s")


def read_trajectory(content: bytes, place: Path) -> str:
    """Read a trajectory file through a campaign; a message names the file, and a row or column or what it is."""
    name = "fuzzed.parquet" if content.startswith(b"PAR1") else "fuzzed.csv"
    (place / name).write_bytes(content)
    try:
        return read(OWN.replace("TRAJECTORY", name).encode(), place / "own.toml")
    finally:
        (place / name).unlink()


def flights(place: Path) -> None:
    """Write the trajectory files that campaigns of the grammar name."""
    rows = grammar.flight(random.Random(4), 121, 1.0)
    (place / "flight.csv").write_bytes(grammar.csv_of(rows, ","))
    (place / "flight.parquet").write_bytes(grammar.parquet_of(pa.table(rows)))


def fuzz(
    count: int,
    seed: int,
    made: Callable[[random.Random], tuple[str, bytes]],
    outcome: Callable[[bytes], str],
    what: str,
) -> tuple[Counter[tuple[str, str]], list[str]]:
    """Read so many files; the numbers of kinds and outcomes, and the findings."""
    chance, counted, findings, slowest = random.Random(seed), Counter[tuple[str, str]](), list[str](), (0.0, "none")
    before = largest_memory(reset=True)
    for number in range(count):
        kind, content = made(chance)
        began = time.process_time()
        try:
            counted[kind, outcome(content)] += 1
            slowest = max(slowest, (time.process_time() - began, f"number {number}, {kind}"))
        except Exception as failure:
            counted[kind, "finding"] += 1
            kept = Path(tempfile.gettempdir()) / f"finding_{what}_{seed}_{number}"
            kept.write_bytes(content)
            findings.append(f"{kept}: {kind}: {type(failure).__name__}: {str(failure)[:300]}")
            print(findings[-1], flush=True)
        if number % 10_000 == 9_999:
            print(f"{number + 1} {what}: {dict(counted)}, {len(findings)} findings", flush=True)
    largest = largest_memory()
    if largest > max(LARGEST, before):
        findings.append(f"{what}: {largest:,} bytes of memory")
    print(f"{count} {what}: {dict(counted)}, slowest {slowest[0]:.2f} s ({slowest[1]}), {largest:,} bytes", flush=True)
    return counted, findings


def main(campaigns: int, trajectories: int, seed: int = 1) -> int:
    """Fuzz so many files of each sort; the number of findings."""
    with tempfile.TemporaryDirectory(dir="/dev/shm" if Path("/dev/shm").is_dir() else None) as name:
        place = Path(name)
        flights(place)
        _, found = fuzz(
            trajectories, seed, grammar.trajectory_file, lambda each: read_trajectory(each, place), "trajectories"
        )
        _, more = fuzz(campaigns, seed, grammar.campaign_file, lambda each: read(each, place / "own.toml"), "campaigns")
    return len(found) + len(more)


if __name__ == "__main__":
    warnings.simplefilter("error")
    sys.exit(main(*map(int, sys.argv[1:])) > 0)
