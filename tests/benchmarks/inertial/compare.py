"""Peers measured in turns: each in a process of its own, one run of each in every round."""

from __future__ import annotations

import json
import os
import select
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any, Final

from tests.benchmarks.compare import CORES
from tests.benchmarks.inertial.peers import PEERS
from tests.benchmarks.install import without_paths

LONGEST: Final = 240.0
"""A child that takes longer for an answer (s) is ended and says so."""

ROUNDS: Final = 5
FEWEST_ROUNDS: Final = 3
SLOW: Final = 2.0
"""A run that takes longer (s) is repeated in the first rounds only."""


class Child:
    """A process that answers requests, see `tests.benchmarks.inertial.child`."""

    def __init__(self, folder: Path, peer: str, case: Path, cores: int) -> None:
        orders = folder / f"{peer.replace(' ', '_').replace(',', '')}_{cores}.json"
        spawned = time.clock_gettime(time.CLOCK_MONOTONIC)
        asked = {"peer": peer, "case": str(case), "cores": cores, "spawned": spawned}
        orders.write_text(json.dumps(asked))
        self.said = orders.with_suffix(".said").open("w+b")
        self.process = subprocess.Popen(
            [sys.executable, "-m", "tests.benchmarks.inertial.child", str(orders)],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self.said,
            env={**os.environ, "PYTHONWARNINGS": "ignore"},
        )  # fmt: skip

    def ask(self, **request: Any) -> dict[str, Any]:
        """Send a request and wait for the answer."""
        try:
            if self.process.stdin is not None:
                self.process.stdin.write(json.dumps(request).encode() + b"\n")
                self.process.stdin.flush()
        except BrokenPipeError:
            return self._ended()
        return self.answer()

    def answer(self) -> dict[str, Any]:
        """Wait for an answer; ``failed`` and why, where there is none."""
        output = self.process.stdout
        if output is None or not select.select([output], [], [], LONGEST)[0]:
            self.process.kill()
            return {"failed": f"took longer than {LONGEST:.0f} s"}
        line = output.readline()
        return dict(json.loads(line)) if line else self._ended()

    def _ended(self) -> dict[str, Any]:
        status = self.process.wait()
        self.said.seek(0)
        lines = self.said.read().decode(errors="replace").strip().splitlines()
        return {"failed": without_paths(f"ended with status {status}: {lines[-1] if lines else 'no message'}")[:200]}

    def megabytes(self) -> float:
        """Peak memory so far; zero once the process has ended."""
        try:
            lines = Path(f"/proc/{self.process.pid}/status").read_text().splitlines()
        except OSError:
            return 0.0
        return next((float(line.split()[1]) / 1024 for line in lines if line.startswith("VmHWM")), 0.0)

    def close(self) -> None:
        """End the process."""
        if self.process.stdin is not None:
            self.process.stdin.close()
        try:
            self.process.wait(LONGEST)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        if self.process.stdout is not None:
            self.process.stdout.close()
        self.said.close()


@dataclass(frozen=True)
class Effort:
    """How long peers are measured.

    Attributes
    ----------
    run : float
        Duration of one run, s: more samples are taken by those that are fast.
    rounds : int
    """

    run: float = 0.5
    rounds: int = ROUNDS


def spread(values: Sequence[float]) -> dict[str, float]:
    """Return least, median and largest of some measurements."""
    return {"least": min(values), "median": median(values), "largest": max(values)}


def measure(
    names: Sequence[str], case: Path, folder: Path, effort: Effort, notes: Mapping[str, str],
    report: Callable[[str], None], start: Callable[..., Any] = Child,
) -> list[dict[str, Any]]:  # fmt: skip
    """Return a row for each peer."""
    rows: dict[str, dict[str, Any]] = {
        name: {"peer": name, "package": PEERS[name].package, "method": PEERS[name].method} for name in names
    }
    for name, found in _on_cores(names, case, folder, effort, 1, report, start).items():
        rows[name] |= found
    # one that is measured on a part of the flight is slow enough
    both = [name for name in names if _sound(rows[name]) and rows[name]["share"] == 1.0]
    for name, found in _on_cores(both, case, folder, effort, CORES, report, start).items():
        rows[name]["two_cores"] = found
    for name, row in rows.items():
        package = PEERS[name].package
        if "missing" in row:
            row["missing"] = next((why for each, why in notes.items() if each.startswith(package)), row["missing"])
    return list(rows.values())


def _on_cores(
    names: Sequence[str], case: Path, folder: Path, effort: Effort, cores: int, report: Callable[[str], None],
    start: Callable[..., Any],
) -> dict[str, dict[str, Any]]:  # fmt: skip
    """Start all peers one after the other, then time them in turns."""
    found: dict[str, dict[str, Any]] = {}
    children: dict[str, Any] = {}
    try:
        for name in names:
            child = start(folder, name, case, cores)
            children[name], found[name] = child, child.answer()
            for request in ({"do": "accuracy"},) * (cores == 1) + ({"do": "count", "seconds": effort.run},):
                if _sound(found[name]):
                    found[name] |= child.ask(**request)
            report(f"{name}, {cores} core(s): {_outcome(found[name])}")
        times: dict[str, list[dict[str, float]]] = {name: [] for name in names}
        for number in range(effort.rounds):
            for name in names:
                slow = number >= FEWEST_ROUNDS and times[name] and times[name][0]["wall"] > SLOW
                if _sound(found[name]) and not slow:
                    answer = children[name].ask(do="time", samples=found[name]["samples"], round_number=number)
                    if _sound(answer):
                        times[name].append(answer)
                    else:
                        found[name] |= answer
        for name in names:
            if _sound(found[name]):
                found[name] |= _summary(found[name], times[name])
                found[name]["megabytes"] = children[name].megabytes()
    finally:
        for child in children.values():
            child.close()
    return found


def _summary(found: Mapping[str, Any], times: Sequence[Mapping[str, float]]) -> dict[str, Any]:
    """Return milliseconds a sample of the whole flight, by the processor and on the wall."""
    per_sample = 1e3 / found["samples"] / found["share"]
    return {
        "runs": len(times),
        "processor_milliseconds": spread([per_sample * each["processor"] for each in times]),
        "wall_milliseconds": spread([per_sample * each["wall"] for each in times]),
    }


def _sound(answer: Mapping[str, Any]) -> bool:
    return "failed" not in answer and "missing" not in answer


def _outcome(found: Mapping[str, Any]) -> str:
    if not _sound(found):
        return " ".join(f"{key}: {found[key]}" for key in ("missing", "failed") if key in found)
    error = found.get("error")
    return f"ready after {found['start_up']:.1f} s" + ("" if error is None else f", {error:.1e} of sigma")
