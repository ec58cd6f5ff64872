"""What a long command tells of its progress: its phases, and samples as they become ready."""

from __future__ import annotations

from enum import StrEnum
from typing import Final, Protocol


class Phase(StrEnum):
    """A part of a command's work, in the words in which it is shown."""

    PREPARING = "preparing"
    SIMULATING = "simulating"
    ANALYSING = "analysing"
    REPORTING = "writing the report"


class Progress(Protocol):
    """Whoever is told."""

    def phase(self, phase: Phase, samples: int | None = None, note: str = "") -> None:
        """Begin a phase.

        Parameters
        ----------
        phase : Phase
        samples : int, optional
            How many samples the phase will make ready, where that is known.
        note : str
            What this phase does of several alike, such as ``look 2 of at most 7``.
        """

    def advance(self, samples: int, stored: bool = False) -> None:
        """Count samples that have become ready: simulated now, or found stored."""


class Silent:
    """Nobody is told."""

    def phase(self, phase: Phase, samples: int | None = None, note: str = "") -> None:
        """Ignore a phase."""

    def advance(self, samples: int, stored: bool = False) -> None:
        """Ignore samples."""


SILENT: Final[Progress] = Silent()
