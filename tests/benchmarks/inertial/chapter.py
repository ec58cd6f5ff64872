"""All measurements of the chapter, in order."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

from tests.benchmarks import machine
from tests.benchmarks.compare import installation_notes
from tests.benchmarks.inertial import bounds, engines, growth, whole_runs
from tests.benchmarks.inertial.build import case_of, own_sigma, reference_of
from tests.benchmarks.inertial.compare import Effort
from tests.benchmarks.inertial.compare import measure as measure_peers
from tests.benchmarks.inertial.flight import FREE, PEERS, Setup
from tests.benchmarks.inertial.peers import PEERS as EVERY_PEER

FORMAT: Final = 1
PACKAGES: Final = ("joblib", "jaxlib", *(entry.package for entry in EVERY_PEER.values()))
SAMPLES: Final = (100, 1_000, 10_000)
FULL: Final = 100_000
"""Samples of a run that is made only when it is asked for."""


@dataclass(frozen=True)
class Plan:
    """What is measured, and for how long.

    Attributes
    ----------
    peers : sequence of str
    effort : Effort
        Of the peers.
    case, free, aided : Setup
        Of the peers, and of the engines.
    compared : int
        Samples of the reference.
    seconds : float
        Of one run of an engine.
    sizes : sequence of int
        Samples of whole runs; none for no whole runs and no growth.
    repeats : int
        Of whole runs of up to a thousand samples.
    high_rate : float
        Rows a second of the trajectory whose truth is timed.
    """

    peers: Sequence[str] = tuple(EVERY_PEER)
    effort: Effort = field(default_factory=Effort)
    case: Setup = PEERS
    free: Setup = FREE
    aided: Setup = field(default_factory=Setup)
    compared: int = engines.COMPARED
    seconds: float = 0.7
    sizes: Sequence[int] = SAMPLES
    repeats: int = whole_runs.REPEATS
    high_rate: float = whole_runs.HIGH_RATE


def measure(plan: Plan, report: Callable[[str], None]) -> dict[str, Any]:
    """Return the record of the chapter."""
    record: dict[str, Any] = {"format": FORMAT, "machine": machine.described(PACKAGES)}
    with TemporaryDirectory() as name:
        folder = Path(name)
        places = [folder / each for each in ("peers", "engines", "runs")]
        for place in places:
            place.mkdir()
        reference = reference_of(places[0], plan.compared, plan.case)
        case = case_of(reference, own_sigma(reference))
        case.save(folder / "case.npz")
        record["case"] = {"seconds": case.seconds, "updates": len(case.updates), "epochs": len(case.epochs)}
        report("reference samples simulated")
        record["peers"] = measure_peers(
            plan.peers, folder / "case.npz", folder, plan.effort, installation_notes(), report
        )
        works = [
            *engines.free(places[1], plan.free, plan.compared),
            *engines.aided(places[1], plan.aided, plan.compared),
        ]
        report("engines prepared")
        record["engines"] = engines.measure(works, plan.seconds)
        record["hour"] = plan.aided.end - plan.aided.start
        report("engines measured")
        record["bounds"] = bounds.measure(places[1], plan.aided, plan.free)
        report("bounds measured")
        record["growth"], record["commands"], record["truth"] = [], [], {}
        if plan.sizes:
            record["growth"] = growth.measure(places[1], plan.aided, report)
            record["commands"] = whole_runs.commands(places[2], plan.aided, plan.sizes, plan.repeats)
            report("whole runs measured")
            record["truth"] = whole_runs.truth_at_high_rate(places[2], plan.free, plan.aided, plan.high_rate)
            report("truth at a high rate measured")
    return record
