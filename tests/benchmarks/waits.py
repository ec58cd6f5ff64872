"""What users wait for: the processor time of whole commands, in units of what their packages take to import.

    python -m tests.benchmarks --only waits

A machine's speed and load cancel in this unit as far as they are the same for both; it is measured before and after
each command.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final
from unittest.mock import patch

from tests.benchmarks import machine
from tests.benchmarks.markdown import number, table
from tests.benchmarks.spawn import run

FORMAT: Final = 1
LONGEST: Final = 1_200.0
CAMPAIGNS: Final = Path(__file__).parent.parent.parent / "campaigns"
IMPORTS: Final = "import numpy, scipy.stats, pandas, numba, pyarrow"


@dataclass(frozen=True)
class Wait:
    """A command that is measured.

    Attributes
    ----------
    name : str
    wanted : float
        Processor time that it may take, in imports.
    words : tuple of str
        The command, in a folder of its own with the campaigns.
    before : tuple of tuple of str
        Commands that make its files.
    first : bool
        Whether it begins with nothing compiled.
    """

    name: str
    wanted: float
    words: tuple[str, ...]
    before: tuple[tuple[str, ...], ...] = ()
    first: bool = False


GNSS: Final = "campaigns/19_flight_with_gnss.toml"
DESCENT: Final = "campaigns/27_powered_descent.toml"
LOG: Final = ("--imu", "log/imu.csv", "--measurements", "gnss=log/gnss.csv", "--start", "log/start.csv")
WAITS: Final = (
    Wait("`filters` of campaign 32, 100 samples, fast kinds", 20.0, (
        "filters", "campaigns/32_alignment_in_motion.toml", "--samples", "100", "--kind", "ekf", "--kind", "iterated",
        "--kind", "left-invariant", "--kind", "right-invariant",
    )),
    Wait("`judge` of a flight of 11 minutes", 22.0, ("judge", "flown.toml", *LOG, "--reference", "log/reference.csv"), (
        ("new", "ins", "flown", "--imu", "tactical", "--aid", "gnss"),
        ("judge", "flown.toml", "--record", "--sample", "3", "--out", "log"),
    )),
    Wait("`run` of campaign 27", 13.0, ("run", DESCENT, "--fresh")),
    Wait("`lincov` of campaign 27", 4.0, ("lincov", DESCENT)),
    Wait("`allocate` of campaign 19, linear", 4.0, ("allocate", GNSS, "--confirm", "0")),
    Wait("`brief` of a run of campaign 19", 5.0, ("brief", "ran"), (("run", GNSS, "--out", "ran"),)),
    Wait("`check` of campaign 19", 2.0, ("check", GNSS)),
    Wait("`run` of campaign 19, 500 samples", 2.5, ("run", GNSS, "--samples", "500", "--fresh")),
    Wait("first `run` of campaign 19", 15.0, ("run", GNSS), first=True),
    Wait("first `lincov` of campaign 19", 5.0, ("lincov", GNSS), first=True),
)  # fmt: skip

METHOD: Final = """\
    make bench BENCH="--only waits"    # this chapter alone; its record is waits.json

Processor time of whole commands, with all their processes, in B: what importing numpy, scipy.stats, pandas, numba and
pyarrow takes, measured before and after each. Each command has run once before, but the first runs, which begin with
nothing compiled. Memory is the peak of the command's own process.\
"""


def measure(report: Callable[[str], None], waits: Sequence[Wait] = WAITS) -> dict[str, Any]:
    """Return the record of the chapter."""
    record: dict[str, Any] = {"format": FORMAT, "machine": machine.described(["numba"]), "waits": []}
    for wait in waits:
        record["waits"].append(_wait(wait))
        report(f"{wait.name} measured")
    return record


def _wait(wait: Wait) -> dict[str, Any]:
    """Measure a command in a folder of its own."""
    load = os.getloadavg()[0]
    with TemporaryDirectory() as place:
        folder = Path(place)
        (folder / "campaigns").symlink_to(CAMPAIGNS)
        caches = {"NUMBA_CACHE_DIR": str(folder / "code"), "XDG_CACHE_HOME": str(folder / "cache")}
        kept = {"PYTHONDONTWRITEBYTECODE": ""}  # modules are compiled once, as where nobody has set it
        with patch.dict(os.environ, kept | caches if wait.first else kept):
            for words in (*wait.before, *(() if wait.first else (wait.words,))):
                _command(words, folder)
            before = _imports()
            processor, memory = _command(wait.words, folder)
            unit = 0.5 * (before + _imports())
    return {
        "name": wait.name,
        "wanted": wait.wanted,
        "processor_seconds": processor,
        "imports_seconds": unit,
        "megabytes": memory,
        "load": load,
    }


def _command(words: Sequence[str], folder: Path) -> tuple[float, float]:
    """Run a command of mcnav: processor time (s) and peak memory (MB).

    Exit status 1 is an answer: a requirement that is not met.
    """
    program = f"import os; os.chdir({str(folder)!r}); from mcnav.cli import main; main()"
    status, memory, processor, output = run([sys.executable, "-c", program, *words], LONGEST)
    if status not in (0, 1):
        raise RuntimeError(f"mcnav {' '.join(words)} ended with status {status}: {output[-300:]}")
    return processor, memory


def _imports() -> float:
    """Measure B, the processor time of the imports (s)."""
    return run([sys.executable, "-c", IMPORTS])[2]


def chapter(record: Mapping[str, Any]) -> list[str]:
    """Return the parts of the chapter."""
    head = ["command", "processor time", "in B", "wanted, B", "memory", "load"]
    rows = [
        [
            row["name"],
            number(row["processor_seconds"], "–", " s"),
            f"{row['processor_seconds'] / row['imports_seconds']:.1f}",
            f"{row['wanted']:g}",
            f"{row['megabytes']:.0f} MB",
            f"{row['load']:.1f}",
        ]
        for row in record["waits"]
    ]
    return ["## What users wait for", METHOD, machine.sentence(record["machine"]), table(head, rows)]
