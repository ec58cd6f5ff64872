"""Children: a process for each peer and number of cores, its peak memory, and what became of it."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

LONGEST: Final = 180.0
"""A child that takes longer (s) is ended and says so."""


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
    """Run a command: exit status, peak memory of its largest process (MB), its processor time (s), what it said."""
    environment = {**os.environ, "PYTHONWARNINGS": "ignore"}
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, env=environment) as process:
        watch = threading.Timer(longest, process.kill)
        watch.start()
        assert process.stdout is not None
        said = process.stdout.read().decode(errors="replace")
        _, status, used = os.wait4(process.pid, 0)
        watch.cancel()
        process.returncode = os.waitstatus_to_exitcode(status)
    return process.returncode, used.ru_maxrss / 1024, used.ru_utime + used.ru_stime, said
