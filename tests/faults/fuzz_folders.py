"""Fuzz run folders: ``python -m tests.faults.fuzz_folders 3000``.

Commands that read run folders are given those of a grammar (`tests.faults.folders`), in child processes, which
are started anew when one hangs. Each command reads the folder, or refuses it in one line that names it. A traceback, a
file outside that is opened, changed or made, code that is executed, more than `LONGEST` seconds, more than `LARGEST`
bytes of memory, and text that would act in a page, a spreadsheet or a terminal, are findings. The number of a folder
makes it again: ``python -m tests.faults.fuzz_folders 1 SEED NUMBER``.
"""

from __future__ import annotations

import csv
import ctypes
import gc
import os
import random
import re
import shutil
import struct
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Final

from mcnav.cli import GARBAGE_THRESHOLD
from mcnav.report.exports.export import FORMULA
from tests.commands import in_process
from tests.faults.folders.make import CHANGES, make_hostile
from tests.faults.folders.runs import Outside, finished_runs
from tests.printed import count_scripts

LONGEST: Final = 10.0
"""Seconds of processor time."""
LARGEST: Final = 2_000_000_000
HANGS: Final = 300.0
"""Seconds without an answer after which a child process is ended."""
TOGETHER: Final = 50
"""Folders of a child process, whose memory grows from one command to the next."""

COMMANDS: Final[dict[str, list[str]]] = {
    "report": ["report", "RUN"],
    "show": ["show", "RUN"],
    "show budget": ["show", "RUN", "--table", "budget", "--format", "csv"],
    "show json": ["show", "RUN", "--format", "json", "--units", "SI"],
    "compare": ["compare", "RUN", "GOOD"],
    "compare csv": ["compare", "RUN", "GOOD", "--format", "csv"],
    "compare two": ["compare", "GOOD", "RUN", "--out", "OUT/compared.html"],
    "compare json": ["compare", "RUN", "GOOD", "--format", "json"],
    "export": ["export", "RUN", "--out", "OUT/export"],
    "figure": ["export", "RUN", "--figure", "scatter", "--out", "OUT/scatter.svg"],
    "replay": ["replay", "RUN", "3"],
    "index": ["report", "--index", "PARENT"],
    "sweep": ["sweep", "RUN", "--vary", "errors.altitude=1..2 km", "--out", "OUT/sweep"],
    "lincov": ["lincov", "RUN", "--out", "OUT/lincov"],
}
"""Commands that are given a hostile folder."""

IN_MODIFY, IN_OPEN, IN_CREATE, IN_DELETE, IN_MOVED, IN_NONBLOCK = 0x2, 0x20, 0x100, 0x200, 0xC0, 0o4000


class Watch:
    """What happens to files of a folder, also by code that Python does not see (inotify)."""

    def __init__(self, folder: Path) -> None:
        libc = ctypes.CDLL(None, use_errno=True)
        self.queue = libc.inotify_init1(IN_NONBLOCK)
        events = IN_OPEN | IN_MODIFY | IN_CREATE | IN_DELETE | IN_MOVED
        for place in (folder, *(path for path in folder.rglob("*") if path.is_dir())):
            libc.inotify_add_watch(self.queue, str(place).encode(), events)

    def seen(self) -> list[str]:
        """Names of the files that were opened, changed, made or deleted since."""
        found = []
        with suppress(BlockingIOError):
            while content := os.read(self.queue, 65_536):
                while content:
                    _, mask, _, length = struct.unpack("iIII", content[:16])
                    found.append(f"{content[16 : 16 + length].rstrip(bytes(1)).decode()} ({mask & 0xFFF:#x})")
                    content = content[16 + length :]
        return found

    def close(self) -> None:
        """Stop."""
        os.close(self.queue)


class Audit:
    """Events of the interpreter while a hostile folder is read: code executed, processes started, objects unpickled."""

    def __init__(self) -> None:
        self.within: Path | None = None
        self.found: list[str] = []
        sys.addaudithook(self._hear)

    def _hear(self, event: str, arguments: tuple[Any, ...]) -> None:
        if self.within is None:
            return
        if event == "exec":
            if (name := getattr(arguments[0], "co_filename", "")).startswith(str(self.within)):
                self.found.append(f"{event} {name}")
        elif event == "import":
            if str(arguments[1] or "").startswith(str(self.within)):
                self.found.append(f"{event} {arguments[1]}")
        elif event in ("os.system", "os.exec", "ctypes.dlopen", "webbrowser.open", "socket.connect"):
            if event != "ctypes.dlopen" or str(arguments[0]).startswith(str(self.within)):
                self.found.append(f"{event} {str(arguments)[:200]}")
        elif event == "open" and isinstance(arguments[0], (str, bytes)):
            name = os.fsdecode(arguments[0])
            if name.startswith(("/etc/passwd", "/dev/zero", "/dev/stdin")):
                self.found.append(f"{event} {name}")

    @contextmanager
    def listening(self, within: Path) -> Iterator[list[str]]:
        """Collect what happens."""
        self.within, self.found = within, []
        try:
            yield self.found
        finally:
            self.within = None


def peak() -> int:
    """Return the largest memory since it was last forgotten, bytes."""
    text = Path("/proc/self/status").read_text()
    found = re.search(r"VmHWM:\s+(\d+) kB", text)
    return 1024 * int(found[1]) if found else 0


def forget_peak() -> None:
    """Let the largest memory be that of now."""
    Path("/proc/self/clear_refs").write_text("5")


def check_output(stdout: str, stderr: str, status: int, folder: Path) -> None:
    """Assert that a command said what it may: results, or one line that names the folder."""
    for line in (stdout + stderr).splitlines():
        assert line.isprintable(), f"not printable: {line[:200]!r}"
    assert status in (0, 1, 2, 4), f"status {status}: {stderr[:300]}"
    told = [line for line in stderr.splitlines() if line.startswith("error: ")]
    if status == 2:
        assert told, f"refused without a word: {stderr[:300]}"
        assert len(told) <= 60, f"{len(told)} lines"
        assert all(len(line) < 2_500 for line in told), "a line without an end"
        of_options = ("error: --table", "error: --figure: the report has no figure")
        named = all(str(folder) in line or line.startswith(of_options) or "and more" in line for line in told)
        assert named, f"no file: {told[0][:300]}"


def check_page(path: Path) -> None:
    """Assert that a page has no markup of a stranger's."""
    page = path.read_text(errors="replace")  # of the hostile folder, it may be anything
    assert count_scripts(page) <= 1, f"{path.name}: a script"
    assert "<img" not in page, f"{path.name}: an image"


def check_table(path: Path) -> None:
    """Assert that no cell of a CSV file is a formula."""
    csv.field_size_limit(10**9)
    with path.open(newline="") as file:
        for row in csv.reader(file):
            for cell in row:
                try:
                    float(cell)
                except ValueError:
                    assert not cell.startswith(FORMULA), f"{path.name}: formula {cell[:100]!r}"


def check_written(place: Path) -> None:
    """Check all pages and tables that commands have written."""
    for path in sorted(place.rglob("*")):
        if path.is_symlink() or not path.is_file():
            continue
        if path.suffix == ".html" and path.name != "secret.html":
            check_page(path)
        elif path.suffix == ".csv" and "out" in path.parts:
            check_table(path)


def try_command(name: str, place: Path, audit: Audit, outside: Outside, good: Path) -> str:
    """Give a command a hostile folder; return what came of it, or raise what should not have happened."""
    words = {"RUN": place / "hostile" / "run", "GOOD": good, "PARENT": place / "hostile", "OUT": place / "out"}
    arguments = [re.sub("RUN|GOOD|PARENT|OUT", lambda found: str(words[found[0]]), each) for each in COMMANDS[name]]
    before = sorted(path.name for path in place.iterdir())
    watch = Watch(outside.folder)
    forget_peak()
    if (held := peak()) > LARGEST // 2:  # left by the commands before, whose processes would have ended
        gc.collect()
        forget_peak()
        held = peak()
    began = time.process_time()
    try:
        with audit.listening(place) as heard:
            done = in_process(*arguments)
        took = time.process_time() - began
        seen = watch.seen()
    finally:
        watch.close()
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    assert not seen, f"outside: {seen[:5]}"
    assert not heard, f"heard: {heard[:5]}"
    assert not outside.mark.exists(), "executed"
    assert sorted(path.name for path in place.iterdir() if path.name != "out") == [
        each for each in before if each != "out"
    ]
    check_output(done.stdout, done.stderr, done.exit_code, words["RUN"])
    assert took < LONGEST, f"took {took:.1f} s"
    assert peak() - min(held, 10**9) < LARGEST, f"{peak():,} bytes of memory"
    return f"{'read' if done.exit_code in (0, 1) else 'refused'}: {took:.2f} s"


def try_folder(
    number: int, seed: int, runs: dict[str, Path], place: Path, audit: Audit, commands: Sequence[str], count: int
) -> Iterator[tuple[str, str, str]]:
    """Make a hostile folder and give it to so many commands: what it is, the command, and what came of it."""
    chance = random.Random(f"{seed} {number}")
    kind, base = list(CHANGES)[number % len(CHANGES)], chance.choice(sorted(runs))
    outside, folder = Outside(place / "outside"), place / "hostile" / "run"
    outside.fill()
    for name in ("hostile", "out"):
        (place / name).mkdir()
    print(f"{number}\t{kind}", flush=True)
    made = make_hostile(chance, kind, runs[base], folder, outside)
    for name in chance.sample(commands, count):  # some write into the folder
        print(f"{number}\t{name}", flush=True)
        try:
            yield made, name, try_command(name, place, audit, outside, runs["summary"])
        except Exception as failure:
            where = traceback.extract_tb(failure.__traceback__)[-1]
            own = [each for each in traceback.extract_tb(failure.__traceback__) if "/mcnav/" in each.filename]
            where = own[-1] if own else where
            told = f"{type(failure).__name__}: {str(failure)[:300]} [{Path(where.filename).name}:{where.lineno}]"
            yield made, name, f"finding: {told!r}"
    try:
        check_written(place)
    except AssertionError as failure:
        yield made, "written", f"finding: {failure}"


def child(first: int, count: int, seed: int, base: Path) -> None:
    """Try folders, and print what came of each."""
    warnings.simplefilter("ignore")
    gc.set_threshold(GARBAGE_THRESHOLD, 50, 50)  # as the program does
    runs = {path.name: path for path in sorted((base / "runs").iterdir())}
    audit = Audit()
    for number in range(first, first + count):
        place = base / "trial"
        shutil.rmtree(place, ignore_errors=True)
        place.mkdir()
        (place / "runs").symlink_to(base / "runs")
        for made, name, outcome in try_folder(
            number, seed, runs, place, audit, list(COMMANDS), 4 if number % 10 else len(COMMANDS)
        ):
            print(f"{number}\t{made}\t{name}\t{outcome}", flush=True)


def main(count: int, seed: int = 1, only: int | None = None) -> int:
    """Try so many folders in child processes; return the number of findings."""
    counted, findings, begin, end = Counter[tuple[str, str]](), 0, only or 0, (only or 0) + count
    with tempfile.TemporaryDirectory(dir="/dev/shm" if Path("/dev/shm").is_dir() else None) as name:
        finished_runs(Path(name))
        while begin < end:
            some = min(TOGETHER, end - begin)
            words = [sys.executable, "-m", "tests.faults.fuzz_folders", "child", begin, some, seed, name]
            with subprocess.Popen(
                [*map(str, words)], stdout=subprocess.PIPE, env=os.environ | {"OPENBLAS_NUM_THREADS": "1"}
            ) as process:
                assert process.stdout is not None
                trying = begin, ""
                os.set_blocking(process.stdout.fileno(), False)
                heard, rest = time.monotonic(), ""
                while True:
                    try:
                        content = os.read(process.stdout.fileno(), 1 << 20).decode()
                    except BlockingIOError:
                        if time.monotonic() - heard > HANGS:
                            process.kill()
                            break
                        time.sleep(0.05)
                        continue
                    if not content:
                        break
                    heard, *lines = time.monotonic(), *(rest + content).split("\n")
                    rest = lines.pop()
                    for line in lines:
                        words = line.split("\t")
                        if len(words) == 2:
                            if (number := int(words[0])) != trying[0] and number % 100 == 0:
                                print(f"up to {number}: {findings} findings", flush=True)
                            trying = number, words[1]
                        elif len(words) == 4:
                            outcome = words[3].partition(":")[0]
                            counted[words[2], outcome] += 1
                            if outcome == "finding":
                                findings += 1
                                print(line, flush=True)
                status = process.wait()
            if status == 0:
                begin += some
                continue
            findings += 1
            print(f"{trying[0]}\t{trying[1]}\tended with status {status}, or did not answer", flush=True)
            begin = trying[0] + 1
    for (command, outcome), number in sorted(counted.items()):
        print(f"{command:12} {outcome:8} {number}")
    print(f"{count} folders, {findings} findings", flush=True)
    return findings


if __name__ == "__main__":
    if sys.argv[1] == "child":
        child(*map(int, sys.argv[2:5]), Path(sys.argv[5]))
    else:
        sys.exit(main(*map(int, sys.argv[1:])) > 0)
