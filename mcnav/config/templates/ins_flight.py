"""The flight of a new campaign of inertial navigation: segments of a template, or a trajectory file of the user's."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array
from mcnav.config.templates import fill_in
from mcnav.entries.context import FileContext
from mcnav.entries.files import is_inside
from mcnav.errors import CampaignError, Problem
from mcnav.systems.ins.earth import WGS84
from mcnav.systems.ins.sensors.velocity import MOST_SPEED
from mcnav.systems.ins.tables.trajectories import read_trajectory
from mcnav.systems.ins.tables.trajectory_file import read_trajectory_file
from mcnav.systems.ins.truth.rows import TrajectoryError, TrajectoryRows

TEMPLATES: Final = "systems/ins/templates"

ROUND: Final = (
    1.0, 2.0, 5.0, 10.0, 15.0, 20.0, 30.0, 60.0, 80.0, 120.0, 150.0, 200.0, 300.0, 600.0, 1200.0, 1800.0, 3600.0,
)  # fmt: skip
"""Intervals and instants to choose from, s."""


@dataclass(frozen=True)
class Flight:
    """Description of a trajectory as a campaign needs it.

    Attributes
    ----------
    rows : TrajectoryRows
    text : str
        Entry of the campaign file.
    longest : float
        Longest navigation along it, s.
    """

    rows: TrajectoryRows
    text: str
    longest: float = np.inf

    @property
    def first(self) -> float:
        """First time, s."""
        return float(self.rows.time[0])

    @property
    def last(self) -> float:
        """End of navigation, s."""
        return min(float(self.rows.time[-1]), self.first + self.longest)

    def resting(self) -> Array:
        """Return up to three instants at which the vehicle is at rest, whole seconds where possible, s."""
        truth, times = self.rows.truth(WGS84), self.rows.time[1:]
        times = times[times <= self.last]

        def at_rest(times: Array) -> NDArray[np.bool_]:
            return np.asarray(np.linalg.norm(truth.earth_fixed(times)[1], axis=1) <= MOST_SPEED)

        times = times[at_rest(times)]
        times = times[np.unique(np.linspace(0, len(times), 5).astype(int))[1:-1]] if len(times) > 4 else times[:3]
        whole = np.maximum(np.floor(times), self.first)
        return np.unique(np.where((whole > self.first) & at_rest(whole), whole, times))

    def at(self, share: float) -> float:
        """Return a round time after a share of the flight, s."""
        duration = self.last - self.first
        step = round_below(duration / 8.0)
        return float(self.first + step * np.floor(share * duration / step))


def round_below(seconds: float) -> float:
    """Return the largest round time that is not longer than another, s."""
    return max((time for time in ROUND if time <= seconds), default=seconds)


def mistake(place: str, message: str) -> CampaignError:
    """Return the error of one mistake."""
    return CampaignError([Problem(place, "", message)])


def segments(name: str) -> Flight:
    """Return the flight of the template."""
    text = fill_in(f"{TEMPLATES}/segments.toml", {})
    context = FileContext(name, Path())
    built = read_trajectory(tomllib.loads(text)["scenario"]["trajectory"], WGS84, context)
    if built is None:
        raise context.error()
    return Flight(built.rows, text)


def from_file(path: Path, columns: Mapping[str, str], folder: Path) -> Flight:
    """Read a trajectory file, which must lie in the folder of the campaign or below it."""
    try:
        rows = read_trajectory_file(path, columns)
    except TrajectoryError as wrong:
        raise mistake(str(path), str(wrong)) from None
    within = path.resolve().is_relative_to(folder.resolve())
    written = path.resolve().relative_to(folder.resolve()).as_posix() if within else ""
    if not within or not is_inside(written):
        remedy = f"write the campaign there with --out {path.parent}"
        raise mistake(str(path), f"must lie in the folder of the campaign, {folder}, or below it; {remedy}")
    first, last = float(rows.time[0]), float(rows.time[-1])
    named = ", ".join(f"{name} = {_quoted(column)}" for name, column in columns.items())
    text = f"trajectory = {_quoted(written)}  # {len(rows.time):,} rows, from {time_text(first)} to {time_text(last)}\n"
    text += f"columns = {{ {named} }}  # names of the file's columns\n" if columns else ""
    return Flight(rows, text)


def time_text(seconds: float) -> str:
    """Write a time as campaign files have it."""
    return f"{seconds:.10g} s"


def _quoted(text: str) -> str:
    """Write a text as TOML does."""
    import tomli_w

    return tomli_w.dumps({"text": text}).partition(" = ")[2].strip()
