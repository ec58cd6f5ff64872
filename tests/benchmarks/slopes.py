"""What a sample of a whole run costs, from the command to the report, beside the engine alone in the same minutes.

    python -m tests.benchmarks --only whole-runs

The slope between two sizes is what a user pays for each further sample: drawing, simulating, errors at epochs, storing,
reading, statistics and report.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Final

from mcnav.config.read import read_campaign
from mcnav.linear.polynomial_engine import prepare_engine
from mcnav.runner.draws import DrawPlan
from tests.benchmarks import machine
from tests.benchmarks.inertial.whole_runs import command
from tests.benchmarks.markdown import number, table
from tests.benchmarks.timing import fastest

ROOT: Final = Path(__file__).parent.parent.parent
FORMAT: Final = 1
REPEATS: Final = 3

RUNS: Final = (
    ("01_tn_d1772_trajectory_4", 20_000, 500_000),
    ("11_cruise", 20_000, 500_000),
    ("19_flight_with_gnss", 2_048, 6_144),
)
"""Campaigns with the two sizes."""

LONGEST: Final = ("11_cruise", 1_000_000)
"""A run with two jobs, whose time on the wall is told."""

METHOD: Final = """\
    make bench BENCH="--only whole-runs"    # this chapter alone; its record is whole_runs.json

What a user pays for each further sample of a run: the slope of processor time between two sizes, from the command to
the report, with one job and all samples stored, the least of three runs of each. The engine alone: the campaign's first
chunk in one process, the least of several times, of campaigns without noise the final errors only. Load is that of the
machine when a campaign's runs began; other processes on it make both slower.\
"""


def measure(report: Callable[[str], None], runs: Sequence[tuple[str, int, int]] = RUNS) -> dict[str, Any]:
    """Return the record of the chapter."""
    record: dict[str, Any] = {"format": FORMAT, "machine": machine.described(["numba"]), "slopes": []}
    for campaign, few, many in runs:
        record["slopes"].append(slope(campaign, few, many))
        report(f"whole runs of {campaign} measured")
    campaign, samples = LONGEST
    load = os.getloadavg()[0]
    spent = command([*_run(campaign, samples), "--jobs", "2"], 1)
    record["longest"] = {"campaign": campaign, "samples": samples, "jobs": 2, "load": load, **spent}
    report(f"{samples:,} samples of {campaign} measured")
    return record


def slope(campaign: str, few: int, many: int, repeats: int = REPEATS) -> dict[str, Any]:
    """Time runs of two sizes, and the engine alone."""
    load = os.getloadavg()[0]
    command([*_run(campaign, few), "--jobs", "1"], 1)  # what has to be compiled
    small, large = (command([*_run(campaign, count), "--jobs", "1"], repeats) for count in (few, many))
    spent = large["processor_seconds"]["least"] - small["processor_seconds"]["least"]
    return {
        "campaign": campaign,
        "samples": [few, many],
        "load": load,
        "microseconds": 1e6 * spent / (many - few),
        "engine_microseconds": _engine_alone(campaign),
        "processor_seconds": [each["processor_seconds"] for each in (small, large)],
    }


def _run(campaign: str, samples: int) -> list[str]:
    return ["run", str(ROOT / "campaigns" / f"{campaign}.toml"), "--samples", str(samples)]


def _engine_alone(name: str) -> float:
    """Time the engine of a campaign, us of one core a sample."""
    campaign = read_campaign(ROOT / "campaigns" / f"{name}.toml")
    errors, scenario = campaign.errors, campaign.scenario
    draws = DrawPlan(errors, campaign.design, campaign.seed, campaign.samples)
    engine = prepare_engine(scenario, scenario.engines[0], draws.probes(), errors.mean, errors.standard_deviations)
    batch = draws.batch(0, engine.chunk)
    work = partial(engine.simulate, batch, noise=engine.noisy)
    work()
    return 1e6 * fastest(work, 1.0).processor / len(batch.index)


def chapter(record: Mapping[str, Any]) -> list[str]:
    """Return the parts of the chapter."""
    longest = record["longest"]
    head = ["campaign", "samples", "µs of a whole run per sample", "µs of the engine alone", "", "load"]
    rows = [
        [
            row["campaign"],
            f"{row['samples'][0]:,} to {row['samples'][1]:,}",
            number(row["microseconds"], "–"),
            number(row["engine_microseconds"], "–"),
            f"{row['microseconds'] / row['engine_microseconds']:.2f} ×",
            f"{row['load']:.1f}",
        ]
        for row in record["slopes"]
    ]
    return [
        "## Whole runs: what a user pays for a sample",
        METHOD,
        machine.sentence(record["machine"]),
        table(head, rows),
        f"A run of {longest['samples']:,} samples of {longest['campaign']} with {longest['jobs']} jobs takes "
        f"{longest['seconds']['least']:.1f} s from the command to the report, and of processor time "
        f"{longest['processor_seconds']['least']:.1f} s, at a load of {longest['load']:.1f}.",
    ]


def _duration(microseconds: float) -> str:
    return f"{microseconds:.2g} µs" if microseconds < 100.0 else f"{1e-3 * microseconds:.2g} ms"
