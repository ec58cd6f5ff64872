"""Refusal of logs that are not at rest, whose readings are those of a motion and not of noise.

Medians of blocks of a second are compared with that of all blocks. At rest they differ by noise and by what biases do:
far less than a degree a second, and than the 50 mg by which 3 degrees of tilt change a specific force.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array
from mcnav.errors import CampaignError, Problem
from mcnav.logs.imu_log import ImuLog
from mcnav.physics.units import conversion

BLOCK: Final = 1.0
"""Length of a block, s, if it has `FEWEST` readings."""

FEWEST: Final = 20
"""Readings of a block, at least."""

LARGEST: Final = {"gyro": 0.02, "accelerometer": 0.5}
"""Change of a block at rest, rad/s and m/s^2, besides its noise."""

SIGMAS: Final = 8.0
"""Sigmas of a block's median that noise is allowed."""

SHOWN: Final = {
    "gyro": ("the angular rate", "rad/s", "deg/s"),
    "accelerometer": ("the specific force", "m/s^2", "m/s^2"),
}
"""Quantity, SI unit and shown unit of each instrument."""

LONG: Final = 1_000
"""Readings of a stretch at rest that is worth naming."""


@dataclass(frozen=True)
class _Blocks:
    """Medians of blocks of an instrument, shape (k, 3), and the change that is none of motion, shape (3,)."""

    medians: Array
    allowed: Array

    @property
    def changes(self) -> Array:
        """Largest change from the median of all blocks over what is allowed, shape (k,)."""
        return np.asarray(np.max(np.abs(self.medians - np.median(self.medians, axis=0)) / self.allowed, axis=1))

    @property
    def steady(self) -> NDArray[np.bool_]:
        """Whether a block is like the one before, shape (k - 1,)."""
        return np.asarray(np.all(np.abs(np.diff(self.medians, axis=0)) < self.allowed, axis=1))


def refuse_motion(path: Path, log: ImuLog, chosen: slice) -> None:
    """Raise `CampaignError` where the chosen part of a log is not at rest, with the longest stretch that is."""
    size = max(round(BLOCK / log.interval), FEWEST)
    vectors = {"gyro": log.gyro, "accelerometer": log.accelerometer}
    blocks = {
        name: _blocks(name, vector[chosen], size) for name, vector in vectors.items()
        if vector is not None and chosen.stop - chosen.start >= 3 * size
    }  # fmt: skip
    moving = [_words(name, own, log, chosen, size) for name, own in blocks.items() if np.any(own.changes > 1.0)]
    if moving:
        message = f"is not at rest: {' and '.join(moving)}{_remedy(blocks, log, chosen, size)}"
        raise CampaignError([Problem(str(path), "", message)])


def _blocks(name: str, readings: Array, size: int) -> _Blocks:
    parts = readings[: len(readings) // size * size].reshape(-1, size, 3)
    noise = np.median(parts.std(axis=1), axis=0) * np.sqrt(np.pi / 2.0 / size)
    return _Blocks(np.median(parts, axis=1), LARGEST[name] + SIGMAS * noise)


def _words(name: str, blocks: _Blocks, log: ImuLog, chosen: slice, size: int) -> str:
    quantity, unit, shown = SHOWN[name]
    worst = int(np.argmax(blocks.changes))
    change = np.abs(blocks.medians[worst] - np.median(blocks.medians, axis=0)).max() * conversion(unit, shown)
    return f"{quantity} changes by {change:.3g} {shown} at {log.time[chosen.start + worst * size]:.4g} s"


def _remedy(blocks: dict[str, _Blocks], log: ImuLog, chosen: slice, size: int) -> str:
    """Name the longest stretch of steady blocks, where it is long and at rest as a whole."""
    steady = np.all([own.steady for own in blocks.values()], axis=0)
    edges = np.concatenate([[-1], np.flatnonzero(~steady), [len(steady)]])
    longest = int(np.argmax(np.diff(edges)))
    first, last = int(edges[longest]) + 1, int(edges[longest + 1])
    at_rest = all(
        np.all(np.ptp(own.medians[first : last + 1], axis=0) < 2.0 * own.allowed) for own in blocks.values()
    )  # fmt: skip
    if not at_rest or (last + 1 - first) * size < LONG:
        return "; record the unit at rest"
    begin, end = (log.time[chosen.start + place] for place in (first * size, (last + 1) * size - 1))
    return f"; the longest stretch at rest is --from {begin:.6g} --to {end:.6g}"
