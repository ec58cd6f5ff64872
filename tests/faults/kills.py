"""Kill a campaign at random moments and see that nothing is ever lost: ``python -m tests.faults.kills 200``.

Each campaign is flown once undisturbed. Then, again and again, it is started, killed with all that a kill leaves
(SIGKILL to the parent alone, so that its workers must notice by themselves) after a random time, now and then twice,
and resumed; half the kills wait for the first chunk. To spare the start of the interpreter, campaigns are flown by
forks of this process, which has everything imported. The chunks must be the same bits as those of the undisturbed
run, and after each kill its processes must all end. The seed makes the moments repeatable as far as a computer's load
is.
"""

from __future__ import annotations

import hashlib
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from mcnav.config.read import read_campaign
from mcnav.workflow.run import run_campaign
from tests.conftest import ROOT
from tests.processes import LONG

CAMPAIGN = ROOT / "campaigns" / "02_tn_d1772_trajectory_1.toml"
ENGINES = {"reference": 128, "ensemble": 200_000}
"""Samples of each."""


def digests(folder: Path) -> dict[str, str]:
    """Chunks of a run folder by name."""
    parts = sorted((folder / "samples").glob("part-*.parquet"))
    return {part.name: hashlib.sha256(part.read_bytes()).hexdigest() for part in parts}


def started(folder: Path, engine: str) -> int:
    """A campaign in a process and session of its own."""
    process = os.fork()
    if process:
        return process
    status = 1
    try:
        os.setsid()
        quiet = os.open(os.devnull, os.O_RDWR)
        for number in range(3):
            os.dup2(quiet, number)
        run_campaign(read_campaign(CAMPAIGN, {"samples": ENGINES[engine]}), folder, engine, 2)
        status = 0
    finally:
        os._exit(status)


def left_of(session: int, seconds: float = LONG) -> list[str]:
    """Processes of a session that are still there after some seconds; returns as soon as there are none."""
    deadline = time.monotonic() + seconds
    while True:
        listed = subprocess.run(["ps", "-o", "pid=,stat=,args=", "--sid", str(session)], capture_output=True, text=True)
        alive = [line for line in listed.stdout.splitlines() if line.split()[1][0] != "Z"]
        if not alive or time.monotonic() > deadline:
            return alive
        time.sleep(0.05)


def finished(folder: Path, engine: str) -> None:
    """Run a campaign to its end."""
    _, status = os.waitpid(started(folder, engine), 0)
    assert status == 0, status


def main(count: int, seed: int = 1) -> int:
    """Kill so many runs, the engines in turn; the number of those that went wrong."""
    chance, wrong = random.Random(seed), 0
    with tempfile.TemporaryDirectory() as place:
        whole, takes = {}, {}
        run_campaign(read_campaign(CAMPAIGN, {"samples": 200}), Path(place) / "warm", "ensemble", 1)
        for name in ENGINES:
            began = time.monotonic()
            finished(Path(place) / name, name)
            whole[name], takes[name] = digests(Path(place) / name), time.monotonic() - began
        amid = 0
        for number in range(count):
            name = list(ENGINES)[number % 2]
            folder = Path(place) / "run"
            shutil.rmtree(folder, ignore_errors=True)
            for _ in range(chance.choice([1, 1, 1, 2])):
                process, part = started(folder, name), folder / "samples" / "part-00000.parquet"
                deadline = time.monotonic() + chance.uniform(0.0, 1.05 * takes[name])
                wait_for_it = chance.random() < 0.5
                while time.monotonic() < deadline and not (wait_for_it and part.exists()):
                    time.sleep(0.002)
                if wait_for_it:
                    time.sleep(chance.uniform(0.0, 0.1 * takes[name]))
                os.kill(process, signal.SIGKILL)
                os.waitpid(process, 0)
                orphans = left_of(process)
                amid += 0 < len(digests(folder)) < len(whole[name])
                if orphans:
                    wrong += 1
                    print(f"{number} {name}: left {orphans}", flush=True)
            finished(folder, name)
            if digests(folder) != whole[name]:
                wrong += 1
                print(f"{number} {name}: other results", flush=True)
            litter = list(folder.rglob(".*.tmp"))
            if litter:
                wrong += 1
                print(f"{number} {name}: litter {litter}", flush=True)
            if number % 10 == 9:
                print(f"{number + 1} killed and resumed, {amid} of the kills amid chunks, {wrong} wrong", flush=True)
    return wrong


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 200) > 0)
