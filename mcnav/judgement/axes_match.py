"""Readings against each other and a track: axes of gyros that are not those of accelerometers, and wrong scales.

Gyros and accelerometers whose axes are not the same turn a specific force the wrong way, and no rotation brings it to
the track. Of 47 other orders and signs of the gyros' axes, and of 24 mirrored ones of the accelerometers' (the others
are the gyros' once more), the one is named that does. So is a scale of either. That both have the same axes, but not
forward, right and down, is seen by gravity when files are read.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import permutations, product
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.recorded import Recording
from mcnav.judgement.chance import is_clear
from mcnav.judgement.clocks import EXPLAINED, TIMES_WORSE
from mcnav.judgement.force_match import FEWEST, ForceMatch

STEP: Final = 0.1
"""Mean readings over which axes are tried, s."""

SCALES: Final = np.geomspace(0.7, 1.4, 15)
"""Scales of the readings that are tried."""

OFF_SCALE: Final = 0.03
"""Departure of a scale from one that no instrument has; a smaller one is a scale factor, which innovations tell."""

BEGIN: Final = 2.0
"""Time in which a vehicle keeps its attitude at the start, s."""

UPRIGHT: Final = 0.5
"""Share of the specific force that must point up at the start: less is 60 deg, or another axis."""


@dataclass(frozen=True)
class Axes:
    """Another order of axes, and their signs: axis k of the vehicle is ``signs[k]`` times reading ``order[k]``."""

    order: tuple[int, ...]
    signs: tuple[float, ...]

    @property
    def matrix(self) -> Array:
        """From the readings to the vehicle's axes."""
        return np.asarray(np.eye(3)[list(self.order)] * np.array(self.signs)[:, None])

    @property
    def mirrored(self) -> bool:
        """Return whether they are left-handed."""
        return bool(np.linalg.det(self.matrix) < 0.0)

    @property
    def changed(self) -> int:
        """Number of axes that are not as named, exchanged ones first."""
        return sum(3 * (place != number) + (sign < 0.0) for number, (place, sign) in enumerate(self._columns))

    @property
    def _columns(self) -> list[tuple[int, float]]:
        return list(zip(self.order, self.signs, strict=True))

    def describe(self, instrument: str) -> str:
        """Say how the readings of an instrument are not the vehicle's.

        >>> Axes((0, 1, 2), (1.0, -1.0, -1.0)).describe("gyro")
        'gyro_y and gyro_z have the wrong sign'
        >>> Axes((1, 0, 2), (1.0, -1.0, 1.0)).describe("gyro")
        'gyro_x, gyro_y, gyro_z should be gyro_y, -gyro_x, gyro_z'
        """
        if self.order == (0, 1, 2):
            wrong = [f"{instrument}_{axis}" for axis, sign in zip("xyz", self.signs, strict=True) if sign < 0.0]
            first = ", ".join(wrong[:-1])
            return f"{first} and {wrong[-1]} have the wrong sign" if first else f"{wrong[0]} has the wrong sign"
        named = ", ".join(f"{instrument}_{axis}" for axis in "xyz")
        true = ", ".join(f"{'-' * (sign < 0.0)}{instrument}_{'xyz'[place]}" for place, sign in self._columns)
        return f"{named} should be {true}"


def _all_axes() -> Iterator[Axes]:
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        yield Axes(order, signs)


def apart_fault(recording: Recording, match: ForceMatch) -> str:
    """Say that gyros and accelerometers have not the same axes, where others bring the readings to the track."""
    if match.independent < FEWEST:
        return ""
    coarse = _averaged(recording)
    as_named = match.with_readings(coarse).left(0.0)[0]
    left = dict[tuple[str, Axes], float]()
    for axes in _all_axes():
        if axes.changed:
            other = replace(coarse, gyro=coarse.gyro @ axes.matrix.T)
            left["gyro", axes] = match.with_readings(other).left(0.0)[0]
        if axes.mirrored:
            other = replace(coarse, accelerometer=coarse.accelerometer @ axes.matrix.T)
            left["accelerometer", axes] = match.with_readings(other).left(0.0)[0]
    least = min(left.values())
    clear = as_named > TIMES_WORSE * least and is_clear(as_named, least, match.freedom, len(left))
    if not clear or least > EXPLAINED * match.moved:
        return ""
    near = [axes for axes, squares in left.items() if not is_clear(squares, least, match.freedom, len(left))]
    near.sort(key=lambda key: key[1].changed)
    told = [_described(*key, recording) for key in near if key[1].changed == near[0][1].changed]
    more = "" if len(near) == len(told) else ", or more axes are not as named"
    return f"gyros and accelerometers do not have the same axes: {' or '.join(told)}{more}"


def scale_fault(recording: Recording, match: ForceMatch, sigma: float) -> str:
    """Say that readings of an instrument are clearly too large or too small, where another scale fits the track.

    Parameters
    ----------
    sigma : float
        Of the campaign's scale factors, the largest.
    """
    if match.independent < FEWEST:
        return ""
    coarse = _averaged(recording)
    as_named = match.with_readings(coarse).left(0.0)[0]
    for instrument in ("gyro", "accelerometer"):
        left = {float(scale): _scaled(match, coarse, instrument, float(scale)) for scale in SCALES}
        best = min(left, key=lambda scale: left[scale])
        finer = best * np.linspace(0.975, 1.025, 11)
        left |= {float(scale): _scaled(match, coarse, instrument, float(scale)) for scale in finer}
        best = min(left, key=lambda scale: left[scale])
        if abs(best - 1.0) < OFF_SCALE + 4.0 * sigma:
            continue
        clear = as_named > TIMES_WORSE * left[best] and is_clear(as_named, left[best], match.freedom, 2 * len(left))
        if clear and left[best] < EXPLAINED * match.moved:
            return (
                f"{instrument} readings are {1.0 / best:.2f} times as large as the motion of the track: they are in "
                "another unit, or of another full scale"
            )
    return ""


def _scaled(match: ForceMatch, recording: Recording, instrument: str, scale: float) -> float:
    """Return what is left of squares with the readings of an instrument multiplied."""
    readings = {instrument: scale * getattr(recording, instrument)}
    return match.with_readings(replace(recording, **readings)).left(0.0)[0]


def _described(instrument: str, axes: Axes, recording: Recording) -> str:
    """Describe axes; of right-handed ones those of the accelerometers may be wrong as well, if gravity is."""
    up = upward_share(recording)
    if instrument == "accelerometer" or axes.mirrored:
        return axes.describe(instrument)
    matrix = axes.matrix.T
    order = tuple(int(place) for place in np.argmax(np.abs(matrix), axis=1))
    inverse = Axes(order, tuple(float(matrix[row, place]) for row, place in enumerate(order)))
    if up is None:
        return f"{axes.describe('gyro')}, or {inverse.describe('accelerometer')}"
    return axes.describe("gyro") if up > UPRIGHT else inverse.describe("accelerometer")


def upward_share(recording: Recording) -> float | None:
    """Return which share of the specific force is upward at the start, by its attitude; none without it."""
    if recording.start is None or recording.start.attitude is None:
        return None
    force = np.mean(recording.accelerometer[recording.ends <= max(BEGIN, float(recording.ends[0]))], axis=0)
    return -float((_to_level(recording.start.attitude[0]) @ force)[2] / max(np.linalg.norm(force), 1e-9))


def _to_level(attitude: Array) -> Array:
    """Return the matrix from the body's axes to north, east, down."""
    (sr, sp, sh), (cr, cp, ch) = np.sin(attitude), np.cos(attitude)
    return np.array([
        [cp * ch, sr * sp * ch - cr * sh, cr * sp * ch + sr * sh],
        [cp * sh, sr * sp * sh + cr * ch, cr * sp * sh - sr * ch],
        [-sp, sr * cp, cr * cp],
    ])  # fmt: skip


def _averaged(recording: Recording) -> Recording:
    """Return means of the readings over `STEP`."""
    widths = np.diff(recording.ends, prepend=0.0)
    count = max(round(STEP / float(np.median(widths))), 1)
    starts = np.arange(0, len(widths), count)
    times = np.add.reduceat(widths, starts)
    gyro, force = (
        np.add.reduceat(values * widths[:, None], starts, axis=0) / times[:, None]
        for values in (recording.gyro, recording.accelerometer)
    )
    return replace(recording, ends=np.cumsum(times), gyro=gyro, accelerometer=force)
