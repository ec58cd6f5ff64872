"""Interface through which long commands report their progress."""

from __future__ import annotations

from enum import StrEnum
from typing import Final, Protocol

from mcnav._dataclasses import dataclass


class Phase(StrEnum):
    """Phase of a command, as shown."""

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
    """

    functions: int = 0
    begun: int = 0
    stored: bool = True


COMPILATION: Final = Compilation()
