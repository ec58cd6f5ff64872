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
import os
import random
import signal
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from itertools import product
from pathlib import Path
from typing import Final
from unittest.mock import patch

from mcnav.execution.progress import Silent
from mcnav.files.whole import write_whole
from mcnav.runner.dask_cluster import connect
from mcnav.store.chunk_files import chunk_name
from tests.compile_once import share_compilation
from tests.faults.kinds import BACKENDS, DASK, KINDS, SCHEDULER, STORES, Case
from tests.faults.remains import left_of, workers_of
from tests.faults.trials import COLUMNS, PAUSE, Place, Trial, Undisturbed, finish, start, start_run
from tests.processes import LONG, wait_for

KILLS: Final = (1, 1, 1, 1, 1, 1, 1, 2, 2, 3)
"""Kills of one run, all equally likely."""


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


def kill_at_random(case: Case, place: Place, whole: Undisturbed, chance: random.Random) -> Trial:
    """Kill a campaign once or more at random moments, and resume it."""
    trial, kills = Trial(case, place, whole), chance.choice(KILLS)
    while trial.counts["kills"] < kills:
        process = start_run(case, place)
        waited = _wait_for_moment(process, place, whole, chance)
        status = trial.kill(process, everything=chance.random() < 0.25) if waited else finish(process)
        if status == -signal.SIGKILL:
            continue
        trial.finished(status)  # sooner than expected
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

        with patch("mcnav.files.whole.os.fsync", end) if path.name == chunk_name(number) else nullcontext():
            write_whole(path, content)

    with patch("mcnav.store.chunk_files.write_whole", write):
        yield


def kill_at_fixed_moments(case: Case, place: Place, whole: Undisturbed, chance: random.Random) -> Trial:
    """Kill a campaign when its first chunk is stored, then amid the writing of its second, and resume it.

    Where other processes write chunks, it is killed when the second is stored. One worker simulates until then, so that
    the number of chunks does not depend on time; one of a user's class also does so afterwards, because a worker takes
    long to start.
    """

    del chance

    def run_until_stored() -> None:
        case.run(place.path, place.folder, 1, _KillWhenStored())

    def run_until_half_written() -> None:
        with _killed_in_writing(1):
            case.run(place.path, place.folder, 1)

    trial, threads = Trial(case, place, whole), not case.in_processes
    for number, run in enumerate((run_until_stored, run_until_half_written if threads else run_until_stored)):
        process = start(place, run)
        trial.look(process, finish(process))
        stored = 1 if threads else number + 1
        trial.check(len(trial.kept) == stored, f"{len(trial.kept)} chunks are stored, not {stored}")
        partial = len(list(place.folder.rglob(".*.tmp")))
        trial.check(partial == (threads and number == 1), f"{partial} half-written files")
    trial.resume(2 if threads else 1)
    return trial


MODES: Final = {"random": kill_at_random, "workers": kill_workers, "fixed": kill_at_fixed_moments}


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


def _known(case: Case, place: Place, known: dict[Case, Undisturbed], measure: bool) -> Undisturbed:
    """Return the undisturbed run of a case, without a cluster unless it is the run's own; it is run if necessary."""
    here = Case(case.kind, case.store)
    measured = case if case.backend == DASK else here
    if measured not in known:
        run_here = not (measured.in_processes or measured.backend == DASK)  # forks would have its tracker
        if run_here:
            known[measured] = Undisturbed.here(measured, place)
        if measure or not run_here:
            known[measured] = Undisturbed.of(measured, place, 2 if measure else 1)
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
    stored = {f"{kind}, {store}": (kind, store) for kind, store in product(KINDS, STORES)}
    parser.add_argument("--cases", nargs="+", choices=list(stored), default=list(stored), metavar="KIND, STORE")
    parser.add_argument("--backends", nargs="+", choices=BACKENDS, default=list(BACKENDS))
    parser.add_argument("--mode", choices=list(MODES), default="random")
    options = parser.parse_args(arguments)
    share_compilation()  # with the tests, if they have started this
    chance, known, counts = (
        random.Random(options.seed),
        dict[Case, Undisturbed](),
        defaultdict[str, Counter[str]](Counter),
    )
    with tempfile.TemporaryDirectory() as path, ExitStack() as stack, suppress(KeyboardInterrupt):
        place, scheduler = Place(Path(path)), None
        if SCHEDULER in options.backends:
            scheduler = stack.enter_context(_running_cluster(Place(place.path / "cluster")))
        chosen = product((stored[name] for name in options.cases), options.backends)
        cases = [Case(*of, backend, scheduler if backend == SCHEDULER else None) for of, backend in chosen]
        cases = [each for each in cases if options.mode != "workers" or each.has_workers]
        for number in range(len(cases) if options.mode == "fixed" else options.count):
            case = cases[number % len(cases)]
            trial = MODES[options.mode](case, place, _known(case, place, known, options.mode != "fixed"), chance)
            counts[str(case)].update(trial.counts)
            told = [f"{count} {name}" for name, count in trial.counts.items() if count and name != "runs"]
            print(f"{number + 1} {case}: {', '.join(told)}", *trial.faults, sep="\n  ", flush=True)
    _print_table(counts)
    return sum(row["wrong"] for row in counts.values())


if __name__ == "__main__":
    sys.exit(main() > 0)
