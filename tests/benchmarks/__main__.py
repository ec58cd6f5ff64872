"""Measure everything and write `reports/benchmarks/`: ``python -m tests.benchmarks`` (`make bench`)."""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from tests.benchmarks import growth, kernel, machine, slopes, stages, waits
from tests.benchmarks.build import COMPARED, case_of, disagreement
from tests.benchmarks.case import TIME, Case
from tests.benchmarks.compare import measure_all
from tests.benchmarks.figure import work_precision
from tests.benchmarks.inertial import chapter
from tests.benchmarks.inertial.peers import PEERS as INERTIAL_PEERS
from tests.benchmarks.peers import PEERS
from tests.benchmarks.readme import records
from tests.benchmarks.tables import markdown

FORMAT = 1
CHAPTERS = ("waits", "whole-runs", "reentry", "inertial")
REFERENCE = "the reference engine (scipy's DOP853 at 1e-12, polar equations)"
PACKAGES = ("joblib", "numba", "jax", *(entry.package for entry in PEERS.values()))


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks", description=__doc__)
    parser.add_argument("trajectories", nargs="*", type=int, default=[3, 4], help="of Table I [default: 3 4]")
    parser.add_argument("--peers", nargs="+", choices=list(PEERS), default=list(PEERS), help="[default: all]")
    parser.add_argument("--seconds", type=float, default=0.3, help="for which a measurement is repeated [default: 0.3]")
    parser.add_argument("--full", action="store_true", help="fly 10^8 samples as well, and 10^5 aided ones")
    parser.add_argument("--only", choices=CHAPTERS, help="one chapter; the page keeps what is known of the others")
    parser.add_argument(
        "--inertial-peers", nargs="*", choices=list(INERTIAL_PEERS), default=list(INERTIAL_PEERS), help="[default: all]"
    )
    parser.add_argument("--no-growth", action="store_true", help="leave out whole runs")
    parser.add_argument("--out", type=Path, default=Path("reports/benchmarks"), help="[default: reports/benchmarks]")
    return parser.parse_args()


def _described(case: Case) -> dict[str, Any]:
    return {
        "trajectory": case.number,
        "minutes": float(case.ends[-1]) * TIME / 60.0,
        "stretches": len(case.ends),
        "compared": len(case.reference),
        "reference": REFERENCE,
        "disagreement": disagreement(case),
    }


def _reentry(asked: argparse.Namespace, told: Callable[[str], None]) -> dict[str, Any]:
    """Measure the chapter of reentries."""
    record: dict[str, Any] = {"format": FORMAT, "machine": machine.described(PACKAGES)}
    with TemporaryDirectory() as folder:
        cases = {number: case_of(number, COMPARED) for number in asked.trajectories}
        files = {number: Path(folder) / f"case_{number}.npz" for number in cases}
        for number, case in cases.items():
            case.save(files[number])
        record["cases"] = [_described(case) for case in cases.values()]
        told("truths and references flown")
        record["peers"] = measure_all(files, Path(folder), asked.peers, asked.seconds, told)
    record["kernel"] = [kernel.measure(case) for case in cases.values()]
    told("kernel measured")
    record["growth"] = {} if asked.no_growth else {"samples": growth.by_samples(asked.full), "jobs": growth.by_jobs()}
    record["stages"] = [] if asked.no_growth else [stages.measured(store) for store in ("samples", "summary")]
    return record


def _inertial(asked: argparse.Namespace, told: Callable[[str], None]) -> dict[str, Any]:
    """Measure the chapter of inertial navigation in three dimensions."""
    sizes = () if asked.no_growth else (*chapter.SAMPLES, *([chapter.FULL] if asked.full else ()))
    return chapter.measure(chapter.Plan(peers=asked.inertial_peers, sizes=sizes), told)


def main() -> None:
    """Measure and write."""
    asked, began = _arguments(), time.perf_counter()

    def told(line: str) -> None:
        print(f"{time.perf_counter() - began:5.0f} s  {line}", flush=True)

    asked.out.mkdir(parents=True, exist_ok=True)
    for name, measure, file in (
        ("waits", lambda _, told: waits.measure(told), "waits"),
        ("whole-runs", lambda _, told: slopes.measure(told), "whole_runs"),
        ("reentry", _reentry, "benchmarks"),
        ("inertial", _inertial, "inertial"),
    ):
        if asked.only in (None, name):
            (asked.out / f"{file}.json").write_text(json.dumps(measure(asked, told), indent=1) + "\n")
    if (asked.out / "benchmarks.json").exists():
        record, *further = records(asked.out)
        (asked.out / "benchmarks.md").write_text(markdown(record, *further), encoding="utf-8")
        if asked.only in (None, "reentry"):
            (asked.out / "work_precision.svg").write_text(work_precision(record))
    told(f"written to {asked.out}")


if __name__ == "__main__":
    main()
