"""Kill campaigns at random moments and see that nothing is ever lost: ``python -m tests.faults.kills 200``.

Each of `tests.faults.kinds` is run undisturbed. Then, again and again, it is started, killed with SIGKILL at a random
moment, three in ten twice or more, and resumed. Moments are within what precedes the first chunk, after a chunk, or
anywhere. Mostly the run's own process alone is killed, so that its workers must notice by themselves; one in four times
all of its processes are, as when a machine stops.

After each kill its processes must end, and leave nothing in the folder of temporary files. Chunks that are stored must
be those of the undisturbed run, and a resumed run must keep them. Finally every file of the run folder must be the
same, bit for bit, except for times in the manifest, and there must be no other. The bits are those of a run without a
cluster also where dask simulates, on a cluster of the run's own (``dask``) or on one that outlives it
(``scheduler``).

With ``--mode workers`` it is single worker processes that are killed, of campaigns that have any; with ``--mode fixed``
each campaign is killed twice at moments that do not depend on time.

To spare the start of the interpreter, campaigns are run by forks of this process, which has everything imported and
compiled. The seed makes the moments repeatable as far as a computer's load is.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Final
from unittest.mock import patch

from mcnav.execution.dask_cluster import connect
from mcnav.files import write_whole
from mcnav.progress import Silent
from mcnav.store.chunk_files import chunk_name
from tests.faults.kinds import BACKENDS, DASK, KINDS, SCHEDULER, STORES, Case
from tests.processes import LONG, wait_for

TIMES: Final = ("started", "flight", "checksum")
"""Entries of a manifest that differ from run to run."""

KILLS: Final = (1, 1, 1, 1, 1, 1, 1, 2, 2, 3)
"""Kills of one run, all equally likely."""

PAUSE: Final = 0.004
"""Seconds between looks at a run."""

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


def digests(folder: Path) -> dict[str, str]:
    """Digest the chunks of a run folder, by name."""
    parts = sorted((folder / "samples").glob("part-*.parquet"))
    return {part.name: hashlib.sha256(part.read_bytes()).hexdigest() for part in parts}


def contents(folder: Path) -> dict[str, str]:
    """Digest all files of a finished run, by path; the manifest without times."""
    found = {}
    for path in sorted(folder.rglob("*")):
        content = path.read_bytes() if path.is_file() else b"folder"
        if path.name == "manifest.json":
            entries = json.loads(content).items()
            content = json.dumps({key: entry for key, entry in entries if key not in TIMES}).encode()
        found[str(path.relative_to(folder))] = hashlib.sha256(content).hexdigest()
    return found


def workers_of(session: int) -> list[int]:
    """List the worker processes of a session, of joblib and of dask."""
    listed = subprocess.run(["ps", "-ww", "-o", "pid=,args=", "--sid", str(session)], capture_output=True, text=True)
    lines = [line for line in listed.stdout.splitlines() if "LokyProcess" in line or "spawn_main" in line]
    return [int(line.split()[0]) for line in lines]


def left_of(session: int, seconds: float = LONG) -> list[str]:
    """List processes of a session that are still there after some seconds; return as soon as there are none."""
    deadline = time.monotonic() + seconds
    while True:
        listed = subprocess.run(["ps", "-o", "pid=,stat=,args=", "--sid", str(session)], capture_output=True, text=True)
        alive = [line for line in listed.stdout.splitlines() if line.split()[1][0] != "Z"]
        if not alive or time.monotonic() > deadline:
            return alive
        time.sleep(0.05)


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


def start_run(case: Case, place: Place) -> int:
    """Run a campaign in a process of its own; return the process."""
    return start(place, lambda: case.run(place.path, place.folder))


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
    def of(cls, case: Case, place: Place) -> Undisturbed:
        """Run a campaign to its end."""
        place.clear()
        began, times = time.monotonic(), list[float]()
        process = start_run(case, place)
        while (ended := os.waitpid(process, os.WNOHANG))[0] == 0:
            times += [time.monotonic() - began] * (len(place.kept()) - len(times))
            time.sleep(PAUSE)
        if ended[1] != 0:
            raise RuntimeError(f"{case}: an undisturbed run ended with {ended[1]}: {place.printed.read_text()}")
        chunks, seconds = digests(place.folder), time.monotonic() - began
        times += [seconds] * (len(chunks) - len(times))
        return cls(contents(place.folder), chunks, times[0], (times[-1] - times[0]) / len(times), seconds)


def _wait_for_moment(process: int, place: Place, whole: Undisturbed, chance: random.Random) -> bool:
    """Wait until a random moment of a run; return whether it goes on."""
    stored, began = len(place.kept()), time.monotonic()
    moment = chance.choice(("beginning", "chunk", "chunk", "anywhere"))
    limit = {"beginning": whole.first, "chunk": LONG, "anywhere": whole.seconds}[moment]
    wanted = stored + chance.randint(1, max(1, len(whole.chunks) - stored - 1)) if moment == "chunk" else None
    until = began + chance.uniform(0.0, limit) if wanted is None else began + limit
    while time.monotonic() < until:
        if os.waitid(os.P_PID, process, os.WEXITED | os.WNOHANG | os.WNOWAIT) is not None:
            return False
        if wanted is not None and len(place.kept()) >= wanted:
            wanted, until = None, time.monotonic() + chance.uniform(0.0, whole.spacing)
        time.sleep(PAUSE)
    return True


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

    def kill(self, process: int, everything: bool = False) -> None:
        """Kill a run, and look at what is left of it."""
        with suppress(ProcessLookupError):
            (os.killpg if everything else os.kill)(process, signal.SIGKILL)
        self.look(process, finish(process), everything)

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
            litter += [path.name for path in Path("/dev/shm").glob(f"*-{process}-*")]
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

    def resume(self) -> None:
        """Run the campaign to its end, and compare its files with those of the undisturbed run."""
        self.finished(finish(start_run(self.case, self.place)))

    def finished(self, status: int) -> None:
        """Compare the files of a finished run with those of the undisturbed run."""
        self.check(status == 0, f"ended with status {status}: {self.place.printed.read_text()[-2000:]}")
        self._check_kept()
        found = contents(self.place.folder)
        other = sorted(name for name, _ in found.items() ^ self.whole.files.items())
        self.check(not other, f"other files than those of the undisturbed run: {other[:5]}")


def kill_at_random(case: Case, place: Place, whole: Undisturbed, chance: random.Random) -> Trial:
    """Kill a campaign once or more at random moments, and resume it."""
    trial, kills = Trial(case, place, whole), chance.choice(KILLS)
    while trial.counts["kills"] < kills:
        process = start_run(case, place)
        if _wait_for_moment(process, place, whole, chance):
            trial.kill(process, everything=chance.random() < 0.25)
            continue
        trial.finished(finish(process))  # sooner than expected
        if trial.counts["kills"]:
            return trial
        trial = Trial(case, place, whole)
    trial.resume()
    return trial


def kill_workers(case: Case, place: Place, whole: Undisturbed, chance: random.Random) -> Trial:
    """Kill one worker of a campaign, up to three times at random moments; the campaign goes on by itself.

    A run that is refused says why in one line, and is resumed.
    """
    trial, process = Trial(case, place, whole), start_run(case, place)
    for _ in range(chance.randint(1, 3)):
        if not _wait_for_moment(process, place, whole, chance):
            break
        if workers := workers_of(process):
            with suppress(ProcessLookupError):
                os.kill(chance.choice(workers), signal.SIGKILL)
            trial.counts["workers"] += 1
    status, orphans = finish(process), left_of(process)
    trial.check(not orphans, f"left {orphans}")
    *_, last = ["", *place.printed.read_text().splitlines()]
    if status == 1 and last.startswith("mcnav.errors."):
        print(f"{case}: {last}", flush=True)
        trial.counts["refused"] = 1
        trial.resume()
    else:
        trial.finished(status)
    return trial


class _KillWhenStored(Silent):
    """Progress that kills its process as soon as a chunk is stored."""

    def advance(self, samples: int, stored: bool = False) -> None:
        if not stored:
            os.kill(os.getpid(), signal.SIGKILL)


@contextmanager
def _killed_in_writing(number: int) -> Iterator[None]:
    """Kill this process when half of a chunk's bytes are on the disk."""

    def write(path: Path, content: bytes) -> None:
        def end(file: int) -> None:
            os.ftruncate(file, len(content) // 2)
            os.kill(os.getpid(), signal.SIGKILL)

        with patch("mcnav.files.os.fsync", end) if path.name == chunk_name(number) else nullcontext():
            write_whole(path, content)

    with patch("mcnav.store.chunk_files.write_whole", write):
        yield


def kill_at_fixed_moments(case: Case, place: Place, whole: Undisturbed, chance: random.Random) -> Trial:
    """Kill a campaign when its first chunk is stored, then amid the writing of its second, and resume it.

    A user's class, whose chunks other processes write, is killed when the second is stored. One worker simulates until
    then, so that the number of chunks does not depend on time.
    """

    del chance

    def run_until_stored() -> None:
        case.run(place.path, place.folder, 1, _KillWhenStored())

    def run_until_half_written() -> None:
        with _killed_in_writing(1):
            case.run(place.path, place.folder, 1)

    trial, threads = Trial(case, place, whole), KINDS[case.kind].engine != "single"
    for number, run in enumerate((run_until_stored, run_until_half_written if threads else run_until_stored)):
        process = start(place, run)
        trial.look(process, finish(process))
        stored = 1 if threads else number + 1
        trial.check(len(trial.kept) == stored, f"{len(trial.kept)} chunks are stored, not {stored}")
        partial = len(list(place.folder.rglob(".*.tmp")))
        trial.check(partial == (threads and number == 1), f"{partial} half-written files")
    trial.resume()
    return trial


MODES: Final = {"random": kill_at_random, "workers": kill_workers, "fixed": kill_at_fixed_moments}


def _warm_up(kinds: Sequence[str], place: Path) -> None:
    """Compile, so that forks need not."""
    for kind in kinds:
        if KINDS[kind].engine != "single":
            Case(kind, STORES[0]).run(place, place / "warm", 1, samples=2 * KINDS[kind].chunk)
            shutil.rmtree(place / "warm")


@contextmanager
def _running_cluster(place: Place) -> Iterator[str]:
    """Start a cluster in a process of its own, and yield its scheduler's address; both end with the context."""
    address = place.path / "address"
    place.clear()

    def serve() -> None:
        with connect(None, 2) as (cluster, _):
            address.write_text(cluster.address + "\n")
            signal.pause()

    process = start(place, serve)
    try:
        wait_for(lambda: address.exists() and address.read_text().endswith("\n"))
        yield address.read_text().strip()
    finally:
        os.kill(process, signal.SIGKILL)
        finish(process)


def _known(case: Case, place: Place, known: dict[Case, Undisturbed]) -> Undisturbed:
    """Return the undisturbed run of a case, without a cluster unless it is the run's own; it is run if necessary."""
    here = Case(case.kind, case.store)
    measured = case if case.backend == DASK else here
    if measured not in known:
        known[measured] = Undisturbed.of(measured, place)
        if here in known and known[measured].files != known[here].files:
            raise RuntimeError(f"{measured}: files differ from those without a cluster")
    return known[measured]


def _print_table(counts: Mapping[str, Counter[str]]) -> None:
    width = max(map(len, counts))
    print(" " * width, *COLUMNS, sep="  ")
    for name, row in sorted(counts.items()):
        print(name.ljust(width), *(str(row[column]).rjust(len(column)) for column in COLUMNS), sep="  ")
    total: Counter[str] = sum(counts.values(), Counter())
    print("all".ljust(width), *(str(total[column]).rjust(len(column)) for column in COLUMNS), sep="  ", flush=True)


def main(arguments: Sequence[str] | None = None) -> int:
    """Kill so many runs, the cases in turn; return the number of those that went wrong. Ctrl-C ends it early."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("count", type=int, nargs="?", default=200, help="runs")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kinds", nargs="+", choices=list(KINDS), default=list(KINDS), metavar="KIND")
    parser.add_argument("--backends", nargs="+", choices=BACKENDS, default=list(BACKENDS))
    parser.add_argument("--mode", choices=list(MODES), default="random")
    options = parser.parse_args(arguments)
    chance, known, counts = (
        random.Random(options.seed),
        dict[Case, Undisturbed](),
        defaultdict[str, Counter[str]](Counter),
    )
    with tempfile.TemporaryDirectory() as path, ExitStack() as stack, suppress(KeyboardInterrupt):
        place, scheduler = Place(Path(path)), None
        _warm_up(options.kinds, place.path)
        if SCHEDULER in options.backends:
            scheduler = stack.enter_context(_running_cluster(Place(place.path / "cluster")))
        chosen = product(options.kinds, STORES, options.backends)
        cases = [Case(*each, scheduler if each[-1] == SCHEDULER else None) for each in chosen]
        cases = [each for each in cases if options.mode != "workers" or each.has_workers]
        for number in range(len(cases) if options.mode == "fixed" else options.count):
            case = cases[number % len(cases)]
            trial = MODES[options.mode](case, place, _known(case, place, known), chance)
            counts[str(case)].update(trial.counts)
            told = [f"{count} {name}" for name, count in trial.counts.items() if count and name != "runs"]
            print(f"{number + 1} {case}: {', '.join(told)}", *trial.faults, sep="\n  ", flush=True)
    _print_table(counts)
    return sum(row["wrong"] for row in counts.values())


if __name__ == "__main__":
    sys.exit(main() > 0)
