"""How often intervals of rare events hold, row by row, and how often a limit would be called met wrongly.

``python -m tests.calibration.rare_trials FILE SEEDS`` adds the runs that a file of runs lacks, and prints
the table of `mcnav docs rare-events`. Each run is written as soon as its chunk is done: a run that is stopped goes on
where it was.
"""

from __future__ import annotations

import csv
import os
import re
import sys
from collections.abc import Callable, Sequence
from dataclasses import astuple, dataclass, fields
from functools import cache, partial
from pathlib import Path
from typing import Final

import numpy as np
from joblib import Parallel, delayed
from scipy import stats

from mcnav.analysis.exceedance import POWER
from mcnav.execution.child_processes import end_with_parent, interrupts_blocked
from mcnav.execution.threads import one_thread
from tests.calibration.cells import Cell, Tally
from tests.calibration.rare_events import EVENTS, FLIGHTS, RareEvent
from tests.calibration.rare_random import DIMENSIONS, RANDOM
from tests.calibration.rare_shapes import SHAPES

SEED: Final = 80_000
"""First seed: nothing was chosen by this one and those that follow."""

RARE: Final = "rare"
"""Beginning of the names of the systems."""

HOLDS: Final = "probability of a rare event, where it is stated"
MET: Final = "a limit is not called met wrongly"
SECOND: Final = "a second way to fail is found by few flights"
"""Statements: the interval holds; it does not end below the exact value, or is refused or qualified; as it says."""

CSV: Final = "rare_events.csv"
"""File of the runs."""

CHUNK: Final = 10
"""Seeds of a row after which its runs are written."""

FEW: Final = ", few flights"
"""End of the names of rows whose flights are dear."""

HELD, WRONG = 0.94, 0.05
"""Share of the stated intervals that should hold at least, and of the runs that may be wrong at most."""

VARIANT: Final = re.compile(r"(?: [\d.]+)?, d = \d+|, correlation [\d.]+(?=$)")
"""Part of a name by which rows of one family differ."""

LEVEL: Final = 0.01
"""Probability with which a row that is just as good as that is called worse."""


@dataclass(frozen=True)
class Run:
    """One estimate of one row: with NaN, and a reason, where it is refused."""

    row: str
    seed: int
    exact: float
    estimate: float
    low: float
    high: float
    power: float
    sides: int
    flights: int
    refusal: str

    @classmethod
    def read(cls, values: dict[str, str]) -> Run:
        """Read a line of a file of runs."""
        kinds = {"str": str, "int": int, "float": float}
        return cls(**{field.name: kinds[str(field.type)](values[field.name]) for field in fields(cls)})

    @property
    def holds(self) -> bool:
        """Whether the interval contains the exact value; not of one that is refused."""
        return self.low <= self.exact <= self.high

    @property
    def met_wrongly(self) -> bool:
        """Whether some limit would be called met without a qualification, and is not: the interval ends too low."""
        return self.high < self.exact and self.power >= POWER


@cache
def rows() -> dict[str, Callable[[int], RareEvent]]:
    """Return how the event of a row is made from a seed, by the names of the rows."""
    fixed: dict[str, Callable[[int], RareEvent]] = {event.name: partial(_always, event) for event in EVENTS}
    drawn: dict[str, Callable[[int], RareEvent]] = {
        draw(dimensions, 0).name: partial(draw, dimensions) for draw in RANDOM for dimensions in DIMENSIONS
    }
    drawn |= {draw(0).name: draw for draw in SHAPES}
    return fixed | drawn | {name + FEW: made for name, made in drawn.items()}


def _always(event: RareEvent, seed: int) -> RareEvent:
    return event


def measure(record: Path, seeds: int, jobs: int, names: Sequence[str] = ()) -> list[Run]:
    """Make the runs of so many seeds of each row, or of some, that a file lacks, and return all that it has."""
    known = {(run.row, run.seed) for run in read_runs(record)}
    chunks = [
        (name, chunk)
        for begin in range(SEED, SEED + seeds, CHUNK)
        for name in names or rows()
        if (chunk := [seed for seed in range(begin, min(begin + CHUNK, SEED + seeds)) if (name, seed) not in known])
    ]
    with interrupts_blocked():
        parts = Parallel(
            n_jobs=jobs, return_as="generator_unordered", backend="loky", initializer=end_with_parent,
            initargs=(os.getpid(),),
        )(delayed(_runs)(*chunk) for chunk in chunks)  # fmt: skip
    with record.open("a", newline="") as file:
        writer = csv.writer(file)
        if not record.stat().st_size:
            writer.writerow([field.name for field in fields(Run)])
        for part in parts:
            writer.writerows([f"{value:.6g}" if isinstance(value, float) else value for value in astuple(run)]
                             for run in part)  # fmt: skip
            file.flush()
    return read_runs(record)


def read_runs(record: Path) -> list[Run]:
    """Read the runs of a file; none where there is no file."""
    if not record.is_file():
        return []
    with record.open(newline="") as file:
        return [Run.read(line) for line in csv.DictReader(file)]


def _runs(name: str, seeds: Sequence[int]) -> list[Run]:
    """Make the runs of some seeds of one row."""
    made, runs = rows()[name], []
    with one_thread():
        for seed in seeds:
            event = made(seed)
            rare = event.estimate(seed, cheap=not name.endswith(FEW))
            runs.append(Run(
                name, seed, event.exact, rare.estimate, rare.low, rare.high, rare.power, rare.sides, rare.flights,
                rare.refusal,
            ))  # fmt: skip
    return runs


def run_rare_trials(trials: int, jobs: int, record: Path, names: Sequence[str] = ()) -> Tally:
    """Count the statements of so many seeds of each row, or of some."""
    result = Tally()
    for run in measure(record, trials, jobs, names):
        system = f"{RARE}, {run.row}"
        if not run.refusal:
            result.add(Cell("coverage", system, HOLDS, "normal", "random", FLIGHTS), run.holds)
        result.add(Cell("coverage", system, MET, "normal", "random", FLIGHTS), not run.met_wrongly)
        if "second half-space" in run.row and run.row.endswith(FEW):
            found = bool(run.refusal) or run.sides > 1
            result.add(Cell("power", system, SECOND, "normal", "random", FLIGHTS), found)
    return result


@dataclass(frozen=True)
class Row:
    """The runs of one row, counted: those stated, their intervals that hold, and runs that call a limit met wrongly."""

    runs: list[Run]

    @property
    def stated(self) -> list[Run]:
        """Runs that are not refused."""
        return [run for run in self.runs if not run.refusal]

    @property
    def held(self) -> int:
        """Intervals that hold."""
        return sum(run.holds for run in self.stated)

    @property
    def wrong(self) -> int:
        """Runs with a limit that would be called met wrongly."""
        return sum(run.met_wrongly for run in self.runs)

    @property
    def holds_less(self) -> bool:
        """Whether so few intervals hold with a probability below `LEVEL` where `HELD` of them do."""
        return bool(stats.binom.cdf(self.held, len(self.stated), HELD) < LEVEL)

    @property
    def errs_more(self) -> bool:
        """Whether so many runs are wrong with a probability below `LEVEL` where `WRONG` of them are."""
        return bool(stats.binom.sf(self.wrong - 1, len(self.runs), WRONG) < LEVEL)

    def cells(self) -> list[str]:
        """Return the cells of the table but for the name; what is worse than promised has a star."""
        stated, exact = self.stated, sorted({run.exact for run in self.runs})
        errors = np.array([run.estimate / run.exact - 1.0 for run in stated])
        return [
            f"{exact[0]:.3g}" if len(exact) == 1 else f"{exact[0]:.0e} to {exact[-1]:.0e}",
            f"{len(self.runs)}",
            f"{len(self.runs) - len(stated)}",
            f"{self.held} of {len(stated)}" + " *" * self.holds_less,
            f"{self.wrong}" + " *" * self.errs_more,
            f"{100.0 * np.sqrt(np.mean(errors**2)):.1f} %" if stated else "–",
            f"{np.mean([run.flights for run in self.runs]):,.0f}",
        ]


def counted(runs: Sequence[Run]) -> dict[str, Row]:
    """Return the rows of runs, by name."""
    return {name: Row(mine) for name in rows() if (mine := [run for run in runs if run.row == name])}


def families(runs: Sequence[Run]) -> dict[str, Row]:
    """Return the rows of runs that differ in more than the number of errors, a curvature or a correlation."""
    found: dict[str, list[Run]] = {}
    for name, row in counted(runs).items():
        found.setdefault(VARIANT.sub("", name), []).extend(row.runs)
    return {name: Row(mine) for name, mine in found.items()}


def table(runs: Sequence[Run]) -> list[str]:
    """Tabulate runs, one family of rows each."""
    head = ["event", "exact", "runs", "refused", "intervals that hold", "wrong", "error, rms", "samples, mean"]
    lines = [head, ["---"] * len(head), *([name, *row.cells()] for name, row in families(runs).items())]
    return [f"| {' | '.join(line)} |" for line in lines]


def main(file: str, seeds: str, jobs: str = "1") -> None:
    """Measure, and print the table."""
    print("\n".join(table(measure(Path(file), int(seeds), int(jobs)))))


if __name__ == "__main__":
    from tests.calibration import rare_trials  # by whose name worker processes find it

    rare_trials.main(*sys.argv[1:])
