"""One peer in a process of its own: ``python -m tests.benchmarks.inertial.child ORDERS``.

ORDERS is a JSON file with the peer's name, the case's file and the number of cores. Requests come as lines of JSON, and
answers go the same way, so that the peers of a benchmark can be measured in turns. What a library prints goes to
standard error; what it breaks stays here.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np

MOST: Final = 4_096
"""Samples of one measurement."""

SLOW: Final = 4.0
"""If the first samples take longer (s), no more than the fewest are measured; threads only compile so long."""


class Measured:
    """A peer, ready to be measured."""

    def __init__(self, order: dict[str, Any]) -> None:
        from contextlib import ExitStack

        from tests.benchmarks.inertial.case import load
        from tests.benchmarks.inertial.peers import PEERS
        from tests.benchmarks.inertial.pool import shared

        entry = PEERS[order["peer"]]
        self.peer, self.compared = entry.load(), entry.compared
        whole = load(Path(order["case"]))
        self.case = whole if entry.seconds >= whole.seconds else whole.shortened(entry.seconds)
        self.share = self.case.seconds / whole.seconds
        self.cores, self.open = order["cores"], ExitStack()
        simulate = self.peer.prepare(self.case, entry.setting, self.cores)
        self.simulate = self.open.enter_context(shared(self.peer, simulate, self.cores))
        begin = time.perf_counter()
        self.simulate(self.case.drawn(1), 0)
        self.first = time.perf_counter() - begin

    def accuracy(self) -> dict[str, Any]:
        """Compare samples with the reference, with their noise."""
        count = min(self.compared, len(self.case.compared))
        if count == 0:
            return {"compared": 0}
        quiet, found = (self.simulate(samples, 0) for samples in (self.case.quiet, self.case.compared[:count]))
        if found.shape[1] == 0:
            return {"compared": 0}
        errors = found - quiet if self.peer.errors else self.case.errors(found, quiet[0])
        largest, mean = self.case.apart(errors)
        return {"compared": count, "error": _finite(largest), "root_mean_square": _finite(mean)}

    def count(self, seconds: float) -> dict[str, Any]:
        """Find how many samples take some seconds; at least one chunk or process for each core."""
        from tests.benchmarks.timing import enough

        fewest = self.cores * (1 if self.peer.workers == "processes" else self.peer.chunk)
        if self.first > SLOW and self.peer.workers != "threads":
            return {"samples": fewest, "share": self.share}
        self.simulate(self.case.drawn(fewest), 1)  # starts what works on all cores
        count = enough(lambda samples: self.simulate(self.case.drawn(samples), 1), fewest, MOST, seconds)
        return {"samples": count, "share": self.share}

    def time(self, samples: int, round_number: int) -> dict[str, Any]:
        """Time one run: processor and wall, s."""
        drawn = self.case.drawn(samples)
        processor, begin = time.process_time(), time.perf_counter()
        self.simulate(drawn, 2 + round_number)
        return {"wall": time.perf_counter() - begin, "processor": time.process_time() - processor}


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None


def main(orders: Path) -> None:
    """Answer requests until there are none."""
    order: dict[str, Any] = json.loads(orders.read_text())
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)

    def answer(found: dict[str, Any]) -> None:
        answers.write(json.dumps(found) + "\n")
        answers.flush()

    def attempt(work: Callable[[], dict[str, Any]]) -> None:
        from tests.benchmarks.install import without_paths

        try:
            answer(work())
        except (ImportError, OSError) as missing:
            answer({"missing": without_paths(f"{type(missing).__name__}: {missing}")[:200]})
        except Exception as failure:  # any library may fail in its own way, and the table says so
            answer({"failed": without_paths(f"{type(failure).__name__}: {failure}")[:200]})

    if order["cores"] == 1:
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    measured: list[Measured] = []

    def start() -> dict[str, Any]:
        measured.append(Measured(order))
        return {"start_up": time.clock_gettime(time.CLOCK_MONOTONIC) - order["spawned"]}

    attempt(start)
    for line in sys.stdin:
        request: dict[str, Any] = json.loads(line)
        work = {"accuracy": Measured.accuracy, "count": Measured.count, "time": Measured.time}[request.pop("do")]
        attempt(lambda work=work, request=request: work(measured[0], **request))  # type: ignore[misc]
    for each in measured:
        each.open.close()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
