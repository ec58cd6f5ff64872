"""Times of a flight as they are read: in minutes, and in seconds where it is short."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, TypeVar

from mcnav.arrays.types import Array

Times = TypeVar("Times", float, Array)

SHORT: Final = 120.0
"""Duration in s below which a flight is read in seconds."""


@dataclass(frozen=True)
class TimeAxis:
    """Name and unit in which the times of a flight are read.

    Attributes
    ----------
    label : str
        As ``name [unit]``.
    unit : float
        The unit, s.
    """

    label: str
    unit: float

    def read(self, times: Times) -> Times:
        """Return times, s, in the unit."""
        return times / self.unit


def time_axis(name: str, duration: float) -> TimeAxis:
    """Return how times are read that are called by a name, of a flight of so many seconds.

    >>> time_axis("time", 60.0).label, time_axis("time", 5_400.0).label
    ('time [s]', 'time [min]')
    """
    return TimeAxis(f"{name} [s]", 1.0) if duration < SHORT else TimeAxis(f"{name} [min]", 60.0)
