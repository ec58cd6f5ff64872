"""Commands of inertial navigation that are interrupted in any phase: one line, no process is left, and resumed runs."""

from __future__ import annotations

import json
import signal
import sys
from pathlib import Path

import pytest

from tests.faults.interrupts import CASES, Ended
from tests.faults.navigation import CHUNKS, run_navigation, undisturbed_chunks
from tests.faults.remains import digests
from tests.faults.scenarios import environment
from tests.processes import run_to_end

STORED = {"first chunk": 2, "amid chunks": CHUNKS, "terminated": CHUNKS, "summary": CHUNKS, "report": CHUNKS}
"""Largest number of chunks that a run has stored when it has ended: two workers may each write one more meanwhile."""


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("interrupted")


@pytest.fixture(scope="module")
def ended(place: Path) -> dict[str, Ended]:
    """Interrupt every command."""
    program = f"from tests.faults.interrupts import interrupt_all; interrupt_all({str(place)!r})"
    done = run_to_end([sys.executable, "-c", program], env=environment())
    assert done.returncode == 0, done.stderr
    return {name: Ended(**found) for name, found in json.loads(done.stdout).items()}


@pytest.mark.parametrize("name", CASES)
def test_an_interrupt_is_one_line(name: str, ended: dict[str, Ended], place: Path) -> None:
    resumes = CASES[name].command[0] in ("run", "sweep") and name != "importing"
    remedy = "; stored samples are kept, and the same command resumes the run" if resumes else ""
    status = {signal.SIGINT: 130, signal.SIGTERM: 143}[CASES[name].number]
    assert ended[name] == Ended(status, f"error: interrupted{remedy}\n", [])
    assert len(digests(place / name / "run")) in range(STORED.get(name, 0) + 1)


@pytest.mark.parametrize("name", STORED)
def test_an_interrupted_run_resumes(name: str, ended: dict[str, Ended], place: Path, tmp_path: Path) -> None:
    """The same bits as of a run that nothing happens to."""
    kind = CASES[name].kind
    before = digests(place / name / "run")
    whole = undisturbed_chunks(kind, tmp_path)
    assert before.items() <= whole.items()
    done = run_navigation(place / name / "navigation.toml", kind, place / name / "run")
    assert digests(place / name / "run") == whole
    assert (done.simulated == 0) == (len(before) == CHUNKS)
