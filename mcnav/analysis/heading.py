"""Heading of a vehicle against its track over the ground: a heading that was not recorded reads as zeros."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.contract.history import History

APART: Final = 45.0
"""Angle between heading and track, deg, beyond any that wind or current explains."""

MOST: Final = 0.5
"""Share of the time in motion with such an angle from which it is remarked on."""

STILL: Final = 1.0
"""Range of a heading, deg, that does not turn."""

TURNS: Final = 60.0
"""Range of the track, deg, with which a vehicle turns."""

SLOW: Final = 0.05
"""Share of the largest speed over the ground below which a vehicle is not taken for moving."""

SHORT: Final = 1e-5
"""Distance from the start, as an angle at the centre of the earth, rad, below which there is no track: 60 m."""

STEEP: Final = 60.0
"""Pitch or roll, deg, beyond which heading says little about the direction of motion."""

LEVEL: Final = 0.5
"""Share of the time in motion with a smaller one from which heading and track are compared: others fly by thrust."""

COARSE: Final = 60.0
"""Turn within a step, deg, beyond which its mean heading means nothing."""

COLUMNS: Final = ("latitude [deg]", "longitude [deg]", "heading [deg]", "pitch [deg]")
ROLL: Final = "roll [deg]"


@dataclass(frozen=True)
class HeadingAndTrack:
    """Comparison of the heading with the track, over the time in motion.

    Attributes
    ----------
    apart : float
        Share of the time with more than `APART` between them.
    heading, track : float
        Ranges over which they turn, deg.
    """

    apart: float
    heading: float
    track: float

    @property
    def doubtful(self) -> bool:
        """Return whether the heading can hardly belong to the track."""
        return self.apart > MOST or (self.heading < STILL and self.track > TURNS)


def compare_with_track(history: History) -> HeadingAndTrack | None:
    """Compare heading and track between neighbouring instants; none where nothing moves, or without an attitude.

    Nor of a vehicle that is tilted steeply most of the time, as a lander that brakes: it does not fly along its axis.

    The track of a step is ``atan2(cos(lat) dlon, dlat)``, and its heading the mean of its ends.
    """
    if not history.columns or any(name not in history.columns for name in COLUMNS):
        return None
    time = next(iter(history.columns.values()))
    latitude, longitude, heading, pitch = (np.asarray(history.columns[name]) for name in COLUMNS)
    angles = np.radians(latitude), np.radians(longitude), np.unwrap(np.radians(heading))
    north, east = np.diff(angles[0]), np.cos(angles[0][1:]) * np.diff(np.unwrap(angles[1]))
    length, step = np.hypot(north, east), np.diff(time)
    if not len(step) or not np.hypot(np.cumsum(north), np.cumsum(east)).max() > SHORT:
        return None
    speed = length / step
    roll = np.asarray(history.columns.get(ROLL, np.zeros_like(pitch)))
    tilt = np.maximum(np.abs(pitch), np.abs((roll + 180.0) % 360.0 - 180.0))
    level, moving = np.maximum(tilt[1:], tilt[:-1]) < STEEP, speed > SLOW * speed.max()
    slow_turn = np.abs(np.diff(angles[2])) < np.radians(COARSE)
    used = moving & level & slow_turn & np.isfinite(heading[1:] + heading[:-1])
    if not used.any() or step[moving & level].sum() < LEVEL * step[moving].sum():
        return None
    track = np.arctan2(east, north)[used]
    middle = (0.5 * (angles[2][1:] + angles[2][:-1]))[used]
    difference = np.abs((track - middle + np.pi) % (2.0 * np.pi) - np.pi)
    apart = float(step[used][difference > np.radians(APART)].sum() / step[used].sum())
    return HeadingAndTrack(apart, _range(middle), _range(np.unwrap(track)))


def _range(angles: Array) -> float:
    return float(np.degrees(np.ptp(angles)))


def heading_remark(history: History) -> str:
    """Say that a heading can hardly belong to its track, and what to do; empty where it may."""
    remark = compare_with_track(history)
    if remark is None or not remark.doubtful:
        return ""
    if remark.apart > MOST:
        what = f"is more than {APART:g}° off the track over the ground for {100.0 * remark.apart:.0f} % of the motion"
    else:
        what = f"does not turn, while the track over the ground turns by {remark.track:.0f}°"
    return (
        f"The heading {what}. Attitudes that were not recorded often stand as zeros, and the axes of the instruments "
        "follow from them: check the column heading and its unit, or take the track for the heading. Leave it as it is "
        "where the vehicle moves sideways or backwards."
    )
