"""Monte Carlo run of a campaign in a process of its own, which a command looks at while it does other things."""

from __future__ import annotations

import multiprocessing
import os
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Final

from mcnav.config.read import parse_campaign
from mcnav.config.toml import Content
from mcnav.contract.scenario import ScenarioError
from mcnav.errors import CampaignError, RunFolderError
from mcnav.execution.child_processes import end_with_parent, interrupts_blocked
from mcnav.execution.progress import Phase
from mcnav.linear.partials import SimulationFailed
from mcnav.report.pages.live import Confirmation, verdicts
from mcnav.studies.run_remedies import advise_run
from mcnav.workflow.run import run_campaign
from mcnav.workflow.stored_summary import stored_summary

REFUSED: Final = (CampaignError, RunFolderError, ScenarioError, SimulationFailed, OSError, MemoryError)
"""Errors that users can do something about."""


def in_one_line(wrong: BaseException) -> str:
    r"""Return what is wrong in one line, and how many lines there are more.

    >>> in_one_line(ScenarioError("end", "one\ntwo"))
    'one (and 1 more)'
    """
    if isinstance(wrong, MemoryError):
        return "not enough memory"
    if isinstance(wrong, OSError):
        return f"{wrong.filename or 'a file'}: {wrong.strerror or wrong}"
    first, *others = str(wrong).splitlines() or [type(wrong).__name__]
    return f"{first} (and {len(others)} more)" if others else first


class _Told:
    """Progress that is told to another process."""

    def __init__(self, pipe: Connection) -> None:
        self._pipe = pipe
        self._words, self._ready = "", 0
        self._of: int | None = None

    def phase(self, phase: Phase, samples: int | None = None, note: str = "") -> None:
        """Tell of a phase."""
        self._words, self._of, self._ready = f"{phase.value}{f', {note}' if note else ''}", samples, 0
        self._tell()

    def advance(self, samples: int, stored: bool = False) -> None:
        """Tell of samples that are ready."""
        self._ready += samples
        self._tell()

    def _tell(self) -> None:
        counted = "" if self._of is None else f": {self._ready:,} of {self._of:,} samples"
        share = None if self._of is None else self._ready / self._of
        self._pipe.send(Confirmation("running", self._words + counted, share))


def _simulate(content: Content, file: str, folder: Path, jobs: int, parent: int, pipe: Connection) -> None:
    """Run a campaign and tell what is done, in a process of its own."""
    end_with_parent(parent)
    try:
        campaign = parse_campaign(content, file, Path(file).stem)
        run_campaign(campaign, folder, None, jobs, progress=_Told(pipe), advise=advise_run)
        pipe.send(Confirmation("done", verdicts=verdicts(stored_summary(folder))))
    except REFUSED as wrong:
        pipe.send(Confirmation("failed", in_one_line(wrong)))


class RunningCampaign:
    """A run that goes on in a process of its own, which ends with this one.

    Parameters
    ----------
    content : Content
        Of the campaign's file.
    file : str
        Path from which other paths in it start.
    folder : Path
        Run folder.
    jobs : int
        Workers.
    """

    def __init__(self, content: Content, file: str, folder: Path, jobs: int) -> None:
        self._folder = folder
        processes = multiprocessing.get_context("spawn")
        self._pipe, told = processes.Pipe(duplex=False)
        arguments = content, file, folder, jobs, os.getpid(), told
        self._process = processes.Process(target=_simulate, args=arguments)
        with interrupts_blocked():
            self._process.start()
        told.close()
        self._latest = Confirmation("running", "starting")

    def look(self) -> Confirmation:
        """Return what is known of the run by now."""
        try:
            while self._latest.state == "running" and self._pipe.poll():
                self._latest = self._pipe.recv()
        except EOFError:
            self._process.join()
            self._latest = Confirmation("failed", f"the process ended with status {self._process.exitcode}")
        return replace(self._latest, folder=str(self._folder))

    @property
    def running(self) -> bool:
        """True while it goes on."""
        return self.look().state == "running"

    def stop(self) -> None:
        """End it; samples that are stored are kept."""
        if self.running:
            self._process.kill()
            self._process.join()
            self._latest = Confirmation("failed", "stopped; samples are kept, and the same setting continues with them")
