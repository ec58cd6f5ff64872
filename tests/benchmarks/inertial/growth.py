"""How the engines of aided navigation grow: with duration, update rate and the filter's states."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from tests.benchmarks.inertial.engines import Work, aided
from tests.benchmarks.inertial.flight import Setup
from tests.benchmarks.timing import fastest

DURATIONS: Final = (600.0, 1_800.0, 3_600.0)
INTERVALS: Final = (10.0, 2.0, 0.5)
"""Between updates, s; once a second is among the durations."""

STATES: Final = (9, 15, 21)
SHORT: Final = 600.0
"""Duration with other update rates and numbers of states, s."""


def setups(whole: Setup) -> list[tuple[str, Setup]]:
    """Return what is varied, and the campaigns."""
    short = replace(whole, end=min(whole.start + SHORT, whole.end))
    times = sorted({min(each, whole.end - whole.start) for each in DURATIONS})
    return [
        *(("duration", replace(whole, end=whole.start + each)) for each in times),
        *(("interval", replace(short, interval=each)) for each in INTERVALS),
        *(("states", replace(short, states=each)) for each in STATES if each != whole.states),
    ]


def measure(folder: Path, whole: Setup, report: Callable[[str], None], seconds: float = 0.5) -> list[dict[str, Any]]:
    """Time one chunk of both engines on each campaign."""
    rows: list[dict[str, Any]] = []
    for varied, setup in setups(whole):
        described = {
            "varied": varied,
            "seconds": setup.end - setup.start,
            "interval": setup.interval,
            "states": setup.states,
        }
        rows += [
            {**described, "engine": work.name, "microseconds": _microseconds(work, seconds)}
            for work in aided(folder, setup, compared=0, most=256)
        ]
        report(f"growth with {varied}: {setup.end - setup.start:g} s, {setup.interval:g} s, {setup.states} states")
    return rows


def _microseconds(work: Work, seconds: float) -> float:
    rows = work.errors[: work.chunk]
    work.simulate(0, rows)
    return 1e6 * fastest(lambda: work.simulate(0, rows), seconds).processor / len(rows)
