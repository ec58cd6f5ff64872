"""Interface through which long commands report their progress."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from enum import StrEnum
from typing import Final, Protocol


class Phase(StrEnum):
    """Phase of a command, as shown."""

    CHECKING = "checking"
    PREPARING = "preparing"
    SIMULATING = "simulating"
    ANALYSING = "analysing"
    REPORTING = "writing the report"


class Progress(Protocol):
    """Receiver of progress."""

    def phase(self, phase: Phase, samples: int | None = None, note: str = "") -> None:
        """Begin a phase.

        Parameters
        ----------
        samples : int, optional
            Number of samples in the phase, where known.
        note : str
            Detail that distinguishes similar phases, such as ``look 2 of at most 7``.
        """

    def advance(self, samples: int, stored: bool = False) -> None:
        """Count samples that are ready: simulated now, or found stored."""


class Silent:
    """Progress that nobody sees."""

    def phase(self, phase: Phase, samples: int | None = None, note: str = "") -> None:
        """Ignore a phase."""

    def advance(self, samples: int, stored: bool = False) -> None:
        """Ignore samples."""


SILENT: Final[Progress] = Silent()


@dataclass
class Compilation:
    """Compilation in this process.

    Attributes
    ----------
    functions : int
        That are compiled.
    begun : int
        Functions, each called by the one before, of which none is finished.
    stored : bool
        Whether they are stored for the commands that follow.
    refused : bool
        Whether a function that would have to be compiled raises `NotCompiled` instead.
    """

    functions: int = 0
    begun: int = 0
    stored: bool = True
    refused: bool = False

    @contextmanager
    def refusing(self) -> Iterator[None]:
        """Compile nothing: a function whose code is not stored raises `NotCompiled`."""
        self.refused = True
        try:
            yield
        finally:
            self.refused = False


TOGETHER: Final = 2.0
"""Time of some hundred simulations in one call over that of one, of classes among the examples at most."""


class TooLong(Exception):
    """Raised in place of simulations that would take more than they may: ``seconds``."""

    def __init__(self, seconds: float) -> None:
        super().__init__(seconds)
        self.seconds = seconds


class NotCompiled(BaseException):
    """Raised where a function would have to be compiled and is not to be; no failure of the sample that needs it."""


COMPILATION: Final = Compilation()


@dataclass
class Measurement:
    """Measurement of the covariance of a class's noise in this process.

    Attributes
    ----------
    total : int
        Simulations; zero while nothing is measured.
    done : int
        Of them.
    began : float
        Time of the clock, s.
    """

    total: int = 0
    done: int = 0
    began: float = 0.0

    @contextmanager
    def of(self, total: int) -> Iterator[None]:
        """Measure by so many simulations."""
        self.total, self.done, self.began = total, 0, time.monotonic()
        try:
            yield
        finally:
            self.total = 0

    @property
    def seconds_left(self) -> float:
        """Seconds that are left at the pace so far; NaN before the first simulation is done."""
        return (time.monotonic() - self.began) * (self.total - self.done) / self.done if self.done else float("nan")


MEASUREMENT: Final = Measurement()


def note(text: str) -> None:
    """Print a note of one line beside the results of a command."""
    print(f"note: {text}", file=sys.stderr)


def duration(seconds: float) -> str:
    """Format a duration.

    >>> duration(3.4), duration(75.0), duration(7_260.0)
    ('3 s', '1 min 15 s', '2 h 1 min')
    """
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3_600:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3_600} h {whole % 3_600 // 60} min"
