"""One peer, measured in a process of its own: ``python -m tests.benchmarks.child ORDERS``, a JSON file.

It holds what `tests.benchmarks.spawn` wants measured; the answer is written beside it. First comes one draw, for the
start-up; then every setting: its error on the draws compared, and its time. What a library prints or breaks stays here.
"""

from __future__ import annotations

import json
import math
import os
import sys
import time
from pathlib import Path
from typing import Any, Final

FEWEST_COMPARED: Final = 20
SLOW: Final = 2.0
"""A peer that would take longer (s) for all compared draws is given fewer."""

FINE_ENOUGH: Final = 1e-8
"""Errors below this share of sigma interest nobody here."""

MOST_FLOWN: Final = 1 << 18


def main(orders: Path) -> None:
    """Measure what the orders ask for."""
    order: dict[str, Any] = json.loads(orders.read_text())
    if order["cores"] == 1:
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    # only now what may start threads
    from tests.benchmarks.case import load
    from tests.benchmarks.peers import PEERS

    case = load(Path(order["case"]))
    try:
        peer = PEERS[order["peer"]].load()
    except (ImportError, OSError) as missing:
        answer: dict[str, Any] = {"missing": f"{type(missing).__name__}: {missing}"}
    else:
        settings = order["settings"] or peer.settings
        middle = settings[len(settings) // 2]
        peer.prepare(case, middle, order["cores"])(case.draws(1))
        answer = {"start_up": time.clock_gettime(time.CLOCK_MONOTONIC) - order["spawned"], "knob": peer.knob}
        answer["settings"] = _sweep(peer, case, settings, order["cores"], order["seconds"])
    orders.with_suffix(".answer").write_text(json.dumps(answer))


def _sweep(peer: Any, case: Any, settings: Any, cores: int, seconds: float) -> list[dict[str, Any]]:
    """From rough to fine, until errors are small enough."""
    found = []
    for setting in settings:
        found.append(_measured(peer, case, setting, cores, seconds))
        if (found[-1].get("error") or math.inf) <= FINE_ENOUGH:
            break
    return found


def _measured(peer: Any, case: Any, setting: float, cores: int, seconds: float) -> dict[str, Any]:
    """Error (on one core) and time at one setting; or why there are none."""
    from tests.benchmarks.install import without_paths
    from tests.benchmarks.pool import shared
    from tests.benchmarks.timing import enough, fastest

    try:
        with shared(peer, peer.prepare(case, setting, cores), cores) as fly:
            draws = case.draws(MOST_FLOWN)
            fly(draws[:FEWEST_COMPARED])
            compared = _compared(fly, draws, peer.fewest, len(case.reference)) if cores == 1 else 0
            error = case.error(fly(draws[:compared])) if compared else math.nan
            fewest = cores * peer.fewest
            count = enough(lambda samples: fly(draws[:samples]), fewest, MOST_FLOWN, seconds)
            timed = fastest(lambda: fly(draws[:count]), seconds)
    except Exception as failure:  # any library may fail in its own way, and says so in the table
        return {"setting": setting, "failed": without_paths(f"{type(failure).__name__}: {failure}")[:200]}
    return {
        "setting": setting,
        "error": error if math.isfinite(error) else None,
        "compared": compared,
        "samples": count,
        "runs": timed.runs,
        # one core is this process alone, whose processor time others do not touch; of several, workers have their own
        "microseconds": (timed.processor if cores == 1 else timed.wall) / count * 1e6,
        "wall_microseconds": timed.wall / count * 1e6,
    }


def _compared(fly: Any, draws: Any, fewest: int, most: int) -> int:
    """How many draws a peer's error is measured on: all of them, unless it is too slow."""
    from tests.benchmarks.timing import fastest

    if fewest >= most:
        return most
    each = fastest(lambda: fly(draws[:FEWEST_COMPARED]), 0.0, 1).wall / FEWEST_COMPARED
    return min(most, max(FEWEST_COMPARED, int(SLOW / each)))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
