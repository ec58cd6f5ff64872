"""Children: a process for each peer and number of cores, its peak memory, and what became of it."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any, Final

LONGEST: Final = 180.0
"""A child that takes longer (s) is ended and says so."""

PAUSE: Final = 0.005
"""Between two looks at a child, s."""


def measured(
    folder: Path, peer: str, case: Path, cores: int, seconds: float, settings: Sequence[float] = ()
) -> dict[str, Any]:
    """What `tests.benchmarks.child` answers, with the peak of its memory (MB), or ``missing`` or ``failed`` and why."""
    orders = folder / f"{peer.replace(' ', '_')}_{case.stem}_{cores}.json"
    spawned = time.clock_gettime(time.CLOCK_MONOTONIC)
    asked = {
        "peer": peer,
        "case": str(case),
        "cores": cores,
        "seconds": seconds,
        "settings": list(settings),
        "spawned": spawned,
    }
    orders.write_text(json.dumps(asked))
    status, memory, _, said = run([sys.executable, "-m", "tests.benchmarks.child", str(orders)])
    answer = orders.with_suffix(".answer")
    if not answer.exists():
        last = said.strip().splitlines()[-1] if said.strip() else "no message"
        return {
            "failed": f"took longer than {LONGEST:.0f} s" if status == -9 else f"ended with status {status}: {last}"
        }
    return {**json.loads(answer.read_text()), "megabytes": memory}


def run(command: Sequence[str], longest: float = LONGEST) -> tuple[int, float, float, str]:
    """Run a command: exit status, peak memory (MB), processor time with all its processes (s), what it said.

    Memory is the kernel's own high-water mark, read every few milliseconds: what `wait4` tells of it begins with the
    memory of whoever started the process.
    """
    environment = {**os.environ, "PYTHONWARNINGS": "ignore"}
    peak, until = 0.0, time.monotonic() + longest
    with TemporaryFile() as said:
        process = subprocess.Popen(command, stdout=said, stderr=subprocess.STDOUT, env=environment)
        while not (ended := os.wait4(process.pid, os.WNOHANG))[0]:
            peak = max(peak, _high_water(process.pid))
            if time.monotonic() > until:
                process.kill()
            time.sleep(PAUSE)
        _, status, used = ended
        process.returncode = os.waitstatus_to_exitcode(status)
        said.seek(0)
        return process.returncode, peak, used.ru_utime + used.ru_stime, said.read().decode(errors="replace")


def _high_water(process: int) -> float:
    """The largest memory that a process has had so far, MB; zero once it has none."""
    try:
        told = Path(f"/proc/{process}/status").read_text()
    except OSError:
        return 0.0
    return next((float(line.split()[1]) / 1024 for line in told.splitlines() if line.startswith("VmHWM")), 0.0)
