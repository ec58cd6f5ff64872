"""Campaigns that are killed and resumed, and what is looked at."""

from __future__ import annotations

import gc
import os
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from tests.faults.kinds import Case
from tests.faults.remains import contents, digests, left_of, processes_of

PAUSE: Final = 0.004
"""Seconds between looks at a run."""

SHARED: Final = Path("/dev/shm")
"""Folder of semaphores and shared memory, whose names have the number of the process that made them."""

BEFORE, AMID, AFTER = "before the first chunk", "amid chunks", "after the last chunk"
COLUMNS: Final = (
    "runs",
    "kills",
    BEFORE,
    AMID,
    AFTER,
    "while resuming",
    "all processes",
    "workers",
    "refused",
    "wrong",
)


@dataclass(frozen=True)
class Place:
    """Where a campaign is run: its run folder, its temporary files, and what it prints."""

    path: Path

    @property
    def folder(self) -> Path:
        """Run folder."""
        return self.path / "run"

    @property
    def scratch(self) -> Path:
        """Folder of temporary files."""
        return self.path / "scratch"

    @property
    def printed(self) -> Path:
        """File of what runs print."""
        return self.path / "printed"

    def clear(self) -> None:
        """Delete everything but the user's class."""
        shutil.rmtree(self.folder, ignore_errors=True)
        shutil.rmtree(self.scratch, ignore_errors=True)
        self.scratch.mkdir(parents=True)
        self.printed.write_text("")

    def kept(self) -> dict[str, tuple[int, int]]:
        """Identify the files of chunks, to see whether they are written again."""
        parts = (self.folder / "samples").glob("part-*.parquet")
        return {part.name: (part.stat().st_ino, part.stat().st_mtime_ns) for part in parts}


def start(place: Place, run: Callable[[], None]) -> int:
    """Call a function in a process and session of its own; return the process."""
    process = os.fork()
    if process:
        return process
    gc.freeze()  # what this process has imported is not looked at again
    status = 1
    try:
        os.setsid()
        os.dup2(os.open(os.devnull, os.O_RDWR), 0)
        printed = os.open(place.printed, os.O_WRONLY | os.O_APPEND | os.O_CREAT)
        os.dup2(printed, 1)
        os.dup2(printed, 2)
        os.environ["TMPDIR"] = os.environ["JOBLIB_TEMP_FOLDER"] = str(place.scratch)
        tempfile.tempdir = None
        run()
        status = 0
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        os._exit(status)


def start_run(case: Case, place: Place, jobs: int = 2) -> int:
    """Run a campaign in a process of its own; return the process."""
    return start(place, lambda: case.run(place.path, place.folder, jobs))


def finish(process: int) -> int:
    """Wait for a run; return its exit status, negative for a signal."""
    return os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])


@dataclass(frozen=True)
class Undisturbed:
    """A run that nothing happened to: its files, and the seconds to its first chunk, between chunks, and to its end."""

    files: dict[str, str]
    chunks: dict[str, str]
    first: float
    spacing: float
    seconds: float

    @classmethod
    def here(cls, case: Case, place: Place) -> Undisturbed:
        """Run a campaign in this process; forks need not compile then, and no time is measured."""
        place.clear()
        case.run(place.path, place.folder)
        return cls(contents(place.folder), digests(place.folder), 0.0, 0.0, 0.0)

    @classmethod
    def of(cls, case: Case, place: Place, jobs: int = 2) -> Undisturbed:
        """Run a campaign in a process of its own."""
        place.clear()
        began, times = time.monotonic(), list[float]()
        process = start_run(case, place, jobs)
        while (ended := os.waitpid(process, os.WNOHANG))[0] == 0:
            times += [time.monotonic() - began] * (len(place.kept()) - len(times))
            time.sleep(PAUSE)
        if ended[1] != 0:
            raise RuntimeError(f"{case}: an undisturbed run ended with {ended[1]}: {place.printed.read_text()}")
        chunks, seconds = digests(place.folder), time.monotonic() - began
        times += [seconds] * (len(chunks) - len(times))
        return cls(contents(place.folder), chunks, times[0], (times[-1] - times[0]) / len(times), seconds)


class Trial:
    """One campaign, killed and resumed.

    Attributes
    ----------
    counts : Counter
        By `COLUMNS`.
    faults : list of str
    """

    def __init__(self, case: Case, place: Place, whole: Undisturbed) -> None:
        self.case, self.place, self.whole = case, place, whole
        self.counts: Counter[str] = Counter(runs=1)
        self.faults: list[str] = []
        self.kept: dict[str, tuple[int, int]] = {}
        place.clear()

    def check(self, sound: bool, fault: str) -> None:
        """Note a fault."""
        if not sound:
            self.faults.append(f"{self.case}: {fault}")
            self.counts["wrong"] = 1

    def kill(self, process: int, everything: bool = False) -> int:
        """Kill a run, and look at what is left of it; return its exit status, which tells whether it ended before."""
        killed = processes_of(process) if everything else []
        with suppress(ProcessLookupError):
            (os.killpg if everything else os.kill)(process, signal.SIGKILL)
        status = finish(process)
        if status == -signal.SIGKILL:
            self.look(process, status, everything)
        for path in [path for each in killed for path in SHARED.glob(f"*-{each}-*")]:
            path.unlink(missing_ok=True)  # nobody is left to do so, and numbers of processes come again
        return status

    def look(self, process: int, status: int, everything: bool = False) -> None:
        """Look at what is left of a run that was killed."""
        self.check(status == -signal.SIGKILL, f"ended with status {status}: {self.place.printed.read_text()[-2000:]}")
        orphans = left_of(process)
        self.check(not orphans, f"left {orphans}")
        if everything:
            shutil.rmtree(self.place.scratch)
            self.place.scratch.mkdir()
        else:
            litter = [path.name for path in self.place.scratch.iterdir()]
            litter += [path.name for path in SHARED.glob(f"*-{process}-*")]
            self.check(not litter, f"left temporary files {litter}")
        stored = digests(self.place.folder)
        self.check(stored.items() <= self.whole.chunks.items(), "a chunk is not that of the undisturbed run")
        self._check_kept()
        self.counts["while resuming"] += self.counts["kills"] > 0
        self.counts["kills"] += 1
        self.counts["all processes"] += everything
        self.counts[BEFORE if not stored else AMID if len(stored) < len(self.whole.chunks) else AFTER] += 1

    def _check_kept(self) -> None:
        now = self.place.kept()
        self.check(self.kept.items() <= now.items(), "a stored chunk was simulated again")
        self.kept = now

    def resume(self, jobs: int = 2) -> None:
        """Run the campaign to its end, and compare its files with those of the undisturbed run."""
        self.finished(finish(start_run(self.case, self.place, jobs)))

    def finished(self, status: int) -> None:
        """Compare the files of a finished run with those of the undisturbed run."""
        self.check(status == 0, f"ended with status {status}: {self.place.printed.read_text()[-2000:]}")
        self._check_kept()
        found = contents(self.place.folder)
        other = sorted(name for name, _ in found.items() ^ self.whole.files.items())
        self.check(not other, f"other files than those of the undisturbed run: {other[:5]}")
