"""Faults of a recorded file: one line that names it, the row or column, what came, and what would do."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from mcnav.errors import CampaignError, Problem
from mcnav.physics.units import printable

SHOWN: Final = 12
"""Columns that a message lists."""


class LogError(CampaignError):
    """A recorded file that cannot be read as asked."""

    def __init__(self, path: Path, message: str, place: str = "") -> None:
        super().__init__([Problem(str(path), place, message)])


def listed(names: Sequence[str]) -> str:
    """List names of columns or topics for a message.

    >>> listed(["a", "b"])
    'a, b'
    """
    shown = ", ".join(printable(name, 40) for name in names[:SHOWN])
    return f"{shown} and {len(names) - SHOWN} more" if len(names) > SHOWN else shown
