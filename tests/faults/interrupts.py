"""Commands of inertial navigation interrupted in every phase, as by Ctrl-C at a terminal: in all their processes.

Commands are forks of a process that has everything imported. The signal comes at a call of a function, whatever the
time is.
"""

from __future__ import annotations

import gc
import json
import os
import signal
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, Final
from unittest.mock import patch

from mcnav.__main__ import main
from tests.faults.kinds import small_summaries
from tests.faults.navigation import HALF, write_navigation
from tests.faults.remains import left_of
from tests.worker_server import load_kernels

RUN: Final = ("run", "navigation.toml", "--jobs", "2", "--out", "run")
SWEEP: Final = ("sweep", "navigation.toml", "--vary", "imu.gyro.angle_random_walk=0.01, 0.02 deg/sqrt(h)",
                "--against", "position_horizontal", "--out", "swept")  # fmt: skip


@dataclass(frozen=True)
class Case:
    """A command, and when it is interrupted.

    Attributes
    ----------
    kind : str
        Of `tests.faults.navigation.KINDS`.
    at : str
        Function, with its module.
    call : int
        Number of the call of this function at which the signal comes.
    """

    command: Sequence[str]
    kind: str
    at: str
    call: int = 1
    number: signal.Signals = signal.SIGINT


CASES: Final = {
    "importing": Case(RUN, "free", "mcnav.cli._prepare_process"),
    "reading": Case(RUN, "aided", "mcnav.systems.ins.tables.trajectory_file.read_whole"),
    "compiling": Case(RUN, "aided", "numba.core.typed_passes.type_inference_stage"),
    "tabulating": Case(RUN, "aided", "mcnav.systems.ins.aided.tabulate_aided"),
    "in a finalizer": Case(RUN, "aided", "mcnav.systems.ins.aided.tabulate_aided"),
    "first chunk": Case(RUN, "aided, summary", "mcnav.runner.chunks.simulate_batch"),
    "amid chunks": Case(RUN, "free", "mcnav.runner.chunks.simulate_batch", 2),
    "terminated": Case(RUN, "aided", "mcnav.runner.chunks.write_chunk", 2, signal.SIGTERM),
    "summary": Case(RUN, "aided, summary", "mcnav.workflow.run.analyse"),
    "report": Case(RUN, "aided", "mcnav.report.pages.run.page.render"),
    "lincov": Case(
        ("lincov", "navigation.toml", "--out", "linear"), "aided", "mcnav.studies.linear_answers._linearize"
    ),
    "sweep": Case(SWEEP, "free", "mcnav.studies.sweep_points.LinearPoints._answers", 2),
    "confirming": Case((*SWEEP, "--confirm", "2"), "free", "mcnav.runner.chunks.simulate_batch"),
}


@dataclass(frozen=True)
class Ended:
    """The end of a command that was interrupted."""

    status: int
    errors: str
    left: list[str]


class _Finalized:
    """An object in whose finalizer a signal comes."""

    def __del__(self) -> None:
        os.killpg(0, signal.SIGINT)
        time.sleep(0.0)


def _interrupting(name: str, case: Case, function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that sends the signal to all processes of the command when it is called."""
    calls = [0]

    def call(*arguments: Any, **options: Any) -> Any:
        calls[0] += 1
        if calls[0] == case.call:
            if name == "in a finalizer":
                _Finalized()
            else:
                os.killpg(0, case.number)
        return function(*arguments, **options)

    return call


def _command(name: str, case: Case, folder: Path) -> None:
    """Run a command in this process to its interrupt."""
    os.setsid()
    os.chdir(folder)
    for number, place in enumerate((os.devnull, os.devnull, "errors")):
        os.dup2(os.open(place, os.O_RDWR | os.O_CREAT), number)
    sys.argv = ["mcnav", *case.command]
    module, _, function = case.at.rpartition(".")
    with ExitStack() as patches:
        patches.enter_context(small_summaries(HALF))
        if name == "compiling":  # what is stored on disk is not loaded
            patches.enter_context(patch("mcnav.compiled.objects.Code.load_overload", lambda *_: None))
        owner = _owner(module)
        patches.enter_context(patch.object(owner, function, _interrupting(name, case, getattr(owner, function))))
        main()


def _owner(name: str) -> Any:
    """Import a module, or the class that a name ends with."""
    try:
        return import_module(name)
    except ModuleNotFoundError:
        module, _, attribute = name.rpartition(".")
        return getattr(import_module(module), attribute)


def interrupt(name: str, folder: Path) -> Ended:
    """Run the command of a case in a folder and interrupt it."""
    case = CASES[name]
    write_navigation(folder, case.kind)
    process = os.fork()
    if not process:
        status = 99
        try:
            _command(name, case, folder)
        except SystemExit as end:
            status = int(end.code or 0)
        finally:
            os._exit(status)
    _, status = os.waitpid(process, 0)
    left = left_of(process)  # until then others may write
    return Ended(os.waitstatus_to_exitcode(status), (folder / "errors").read_text(), left)


def interrupt_all(place: str) -> None:
    """Interrupt each case in a folder of its own, and print how it ended."""
    for case in CASES.values():
        _owner(case.at.rpartition(".")[0])
    load_kernels()
    gc.freeze()
    print(json.dumps({name: asdict(interrupt(name, Path(place) / name)) for name in CASES}))
