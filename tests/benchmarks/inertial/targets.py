"""What must hold, beside what was measured."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from tests.benchmarks.inertial.peers import LOOP, OWN, PYINS, SHARED

ACCURACY: Final = 1e-5
"""Largest error of free navigation, share of sigma."""

RATES: Final = {
    "free, without noise": 200_000.0,
    "free, with noise": 50_000.0,
    "aided, own gains": 1_000.0,
    "aided, shared gains": 10_000.0,
}
"""Samples a second of an hour's navigation on two cores."""

TIMES_PYINS, TIMES_LOOP = 1_000.0, 20.0
RUN_SECONDS, LINCOV_SECONDS, TRUTH_SECONDS = 5.0, 2.0, 1.0
SPEED_UP: Final = 1.8


@dataclass(frozen=True)
class Target:
    """A figure that must hold.

    Attributes
    ----------
    name : str
    wanted, measured : float
        The measured one is NaN where there is none.
    unit : str
    at_least : bool
        Whether more is better.
    """

    name: str
    wanted: float
    measured: float
    unit: str
    at_least: bool = True

    @property
    def holds(self) -> bool:
        """Whether it does; a figure that was not measured does not hold."""
        return self.measured >= self.wanted if self.at_least else self.measured <= self.wanted


def fastest_accurate(rows: Sequence[Mapping[str, Any]], name: str) -> Mapping[str, Any] | None:
    """Return the row of an engine that takes the most samples a second: of free ones, those accurate enough."""
    limit = ACCURACY if name.startswith("free") else float("inf")
    good = [row for row in rows if row["name"] == name and row["error"] <= limit]
    return max(good, key=lambda row: row["two_threads_per_second"]["median"], default=None)


def targets(record: Mapping[str, Any]) -> Iterator[Target]:
    """Yield all targets of a record."""
    nothing = float("nan")
    for name, wanted in RATES.items():
        row = fastest_accurate(record["engines"], name)
        accuracy = f" at {ACCURACY:.0e} of sigma" if name.startswith("free") else ""
        measured = nothing if row is None else row["two_threads_per_second"]["median"]
        yield Target(f"an hour, {name}{accuracy}, two cores", wanted, measured, "samples/s")
    peers = {row["peer"]: row.get("processor_milliseconds", {}).get("least", nothing) for row in record["peers"]}
    for ours, gains in ((OWN, "own gains"), (SHARED, "shared gains")):
        for other, wanted in ((PYINS, TIMES_PYINS), (LOOP, TIMES_LOOP)):
            times = peers.get(other, nothing) / peers.get(ours, nothing)
            yield Target(f"ten minutes, {gains}, against {other}", wanted, times, "×")
    for command, wanted in (("run", RUN_SECONDS), ("lincov", LINCOV_SECONDS)):
        found = [
            row for row in record["commands"]
            if row["command"] == command and (command == "lincov" or (row["samples"], row["jobs"]) == (1_000, 2))
            and row["engine"] in (None, "ensemble")
        ]  # fmt: skip
        samples = " of 1,000 aided samples of an hour" if command == "run" else " of the same campaign"
        yield Target(
            f"mcnav {command}{samples}", wanted, found[0]["seconds"]["median"] if found else nothing, "s", False
        )
    for name in RATES:
        row = fastest_accurate(record["engines"], name)
        measured = nothing if row is None else row["speed_up"]["median"]
        yield Target(f"an hour, {name}, two cores against one", SPEED_UP, measured, "×")
    truth = record["truth"]
    for name, key in (("free", "tables"), ("aided", "aided_tables")):
        yield Target(
            f"tables of an hour at 100 rows a second, {name}", TRUTH_SECONDS, truth.get(key, nothing), "s", False
        )
