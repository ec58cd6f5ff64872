"""Small campaigns of every kind of engine, each of several chunks, for tests that interrupt runs."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Final
from unittest.mock import patch

from mcnav.config.read import Campaign, parse_campaign
from mcnav.config.templates import new_scenario
from mcnav.execution.progress import SILENT, Progress
from mcnav.runner.dask_cluster import connect
from mcnav.runner.runner import ChunkExecutor
from mcnav.store import summaries
from mcnav.systems.ins.aided import AidedReferenceEngine
from mcnav.workflow.run import run_campaign
from tests.closed_loops import FILE, tables
from tests.conftest import TWO_ERRORS, content

STORES: Final = ("samples", "summary")
JOBLIB, DASK, SCHEDULER = "joblib", "dask", "scheduler"
BACKENDS: Final = (JOBLIB, DASK, SCHEDULER)
"""This machine's threads and processes; a cluster of a run's own; a cluster that outlives it."""

OWN: Final = "own"
"""Name of the user's files."""

START: Final = {"latitude": "47 deg", "longitude": "9 deg", "course": "80 deg", "speed": "60 m/s"}
FREE: Final = {
    "scenario": {
        "type": "ins",
        "trajectory": {"rate": "1 Hz", "start": START, "segments": [{"turn": "3 deg"}, {"straight": "6 s"}]},
    },
    "imu": {
        "gyro": {"bias": "1 deg/h", "angle_random_walk": "0.1 deg/sqrt(h)"},
        "accelerometer": {"velocity_random_walk": "20 ug/sqrt(Hz)"},
    },
    "errors": {"position": "5 m", "tilt": "0.5 mrad"},
}
"""Some ten seconds of flight; the instruments have noise."""

AIDED: Final = FREE | {
    "aiding": [{"type": "gnss", "interval": "2 s", "position": "3 m"}],
    "filter": {"estimates": ["position", "velocity", "attitude", "gyro_bias"]},
}
STOCHASTIC: Final = {
    "scenario": {"type": f"{OWN}.py:Own", "duration": "1.5 h", "angle_random_walk": "0.003 deg/sqrt(h)"},
    "errors": {"tilt": "10 arcsec", "gyro_drift": "0.01 deg/h"},
}
GUIDED: Final = content(2, errors=TWO_ERRORS) | {
    "scenario": {"type": "reentry", "trajectory": 2, "guidance": {"input": "indicated"}}
}
LOOP: Final = tables("Corrected")


@dataclass(frozen=True)
class Kind:
    """Campaigns of one engine.

    Attributes
    ----------
    content : mapping
        Campaign file, without samples, seed and store.
    chunk : int
        Samples of the engine's chunks; the aided reference engine, which takes longest, has them smaller here.
    chunks : int
        Chunks of the campaign, an even number: one that stores a summary has half as many, of two each.
    in_processes : bool
        Whether the engine simulates in processes of its own.
    """

    engine: str
    content: Mapping[str, Any] = field(repr=False)
    chunk: int
    chunks: int
    in_processes: bool = False


KINDS: Final = {
    "reentry, ensemble": Kind("ensemble", content(1), 8_192, 24),
    "reentry, reference": Kind("reference", content(1, errors=TWO_ERRORS), 32, 6, in_processes=True),
    "free, ensemble": Kind("ensemble", FREE, 2_048, 4),
    "free, reference": Kind("reference", FREE, 8, 8, in_processes=True),
    "aided, own gains": Kind("ensemble", AIDED, 64, 6),
    "aided, shared gains": Kind("shared-gains", AIDED, 256, 6),
    "aided, reference": Kind("reference", AIDED, 2, 4, in_processes=True),
    "guided, ensemble": Kind("ensemble", GUIDED, 2_048, 4),
    "loop, own gains": Kind("vectorised", LOOP, 32, 8, in_processes=True),
    "own, stochastic": Kind("single", STOCHASTIC, 32, 8, in_processes=True),
}


@dataclass(frozen=True)
class Case:
    """Campaign of a kind, by what it stores and what simulates it, with the address of a scheduler."""

    kind: str
    store: str
    backend: str = JOBLIB
    scheduler: str | None = field(default=None, repr=False)

    def __str__(self) -> str:
        return f"{self.kind}, {self.store}, {self.backend}"

    @property
    def in_processes(self) -> bool:
        """Return whether the engine simulates in processes of its own."""
        return KINDS[self.kind].in_processes

    @property
    def has_workers(self) -> bool:
        """Return whether other processes simulate, which end with the run's."""
        return self.backend == DASK or (self.backend == JOBLIB and self.in_processes)

    def campaign(self, place: Path, **changes: Any) -> Campaign:
        """Read the campaign with some entries changed; a user's class is written into a folder."""
        kind = KINDS[self.kind]
        if kind.engine == "single" and not (place / f"{OWN}.py").exists():
            code, _, _ = new_scenario(OWN, place, stochastic=True)
            text = code.read_text()
            code.write_text(text.replace("    settings = {", f"    chunk = {kind.chunk}\n    settings = {{", 1))
        if kind.engine == "vectorised":
            shutil.copy(FILE, place)
        described = {**kind.content, "samples": kind.chunk * kind.chunks, "seed": 1772, "store": self.store}
        return parse_campaign(described | changes, str(place / f"{OWN}.toml"), OWN)

    def run(
        self,
        place: Path,
        folder: Path,
        jobs: int = 2,
        progress: Progress = SILENT,
        executor: ChunkExecutor | None = None,
        **changes: Any,
    ) -> None:
        """Run the campaign, with some entries changed, into a run folder; that of its backend simulates it."""
        campaign, kind = self.campaign(place, **changes), KINDS[self.kind]
        with self._executor(executor) as simulate, small_summaries(kind.chunk), _small_chunks():
            run_campaign(campaign, folder, kind.engine, jobs, progress=progress, executor=simulate, report=False)

    @contextmanager
    def _executor(self, given: ChunkExecutor | None) -> Iterator[ChunkExecutor | None]:
        with ExitStack() as stack:
            own = given is None and self.backend != JOBLIB
            yield stack.enter_context(connect(self.scheduler, 2))[0].simulate if own else given


@contextmanager
def small_summaries(chunk: int) -> Iterator[None]:
    """Let chunks of summaries have two of the engine's: otherwise they have 262,144 samples, of slow engines 1,024.

    Workers are told by the run how many samples a chunk has.
    """
    with patch.multiple(summaries, CHUNK=2 * chunk, SLOW=0):
        yield


@contextmanager
def _small_chunks() -> Iterator[None]:
    """Let chunks of the aided reference engine have two samples: a fifth of a second each; those of closed loops 32."""
    small = partial(AidedReferenceEngine, chunk=KINDS["aided, reference"].chunk)
    with (
        patch("mcnav.systems.ins.scenario.AidedReferenceEngine", small),
        patch("mcnav.systems.closed_loop.scenario.MOST_SAMPLES", KINDS["loop, own gains"].chunk),
    ):
        yield
