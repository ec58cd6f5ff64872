"""Maps that are true to scale about their middle: azimuthal equidistant, with a coastline and a grid of degrees.

A point at the angle c from the middle, and in the direction a from north, is drawn at the distance R c in that
direction (Snyder, *Map Projections: A Working Manual*, 1987, section 25, sphere). ``data/coastline.txt`` says where the
coastline is from.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Final

import numpy as np

from mcnav.arrays.types import Array

RADIUS: Final = 6371.0
"""Radius of the sphere that is drawn, km: the earth's mean radius."""

STEP: Final = 0.005
"""Unit of the file's whole numbers, deg."""

FARTHEST: Final = 0.9 * np.pi
"""Angle from the middle up to which a map is drawn: near the antipode, directions have no meaning."""

DEGREES: Final = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 15.0, 30.0, 45.0)
"""Distances of the lines of the grid, deg."""

Box = tuple[float, float, float, float]
"""Left, bottom, right and top, km."""


@dataclass(frozen=True)
class Projection:
    """A map about a middle, rad, of a body with a radius, km; ``earth`` says whether it has the earth's coast."""

    latitude: float
    longitude: float
    radius: float = RADIUS
    earth: bool = True

    def __call__(self, latitude: Array, longitude: Array) -> Array:
        """Return points as east and north of the middle, km, shape (..., 2); NaN near the antipode."""
        east = np.asarray(longitude) - self.longitude
        a, b = np.sin(latitude), np.cos(latitude) * np.cos(east)
        sine, cosine = np.sin(self.latitude), np.cos(self.latitude)
        right, up = np.cos(latitude) * np.sin(east), cosine * a - sine * b
        angle = np.arctan2(np.hypot(right, up), sine * a + cosine * b)
        stretch = np.where(angle < FARTHEST, self.radius / np.maximum(np.sinc(angle / np.pi), 1e-9), np.nan)
        return np.stack([right * stretch, up * stretch], axis=-1)

    def directions(self, latitude: Array, longitude: Array) -> Array:
        """Return how a small step to the east, and one to the north, are drawn, as columns, shape (..., 2, 2)."""
        small = 1e-5
        here = self(latitude, longitude)
        moved = (
            self(latitude, longitude + small / np.maximum(np.cos(latitude), 1e-9)) - here,
            self(latitude + small, longitude) - here,
        )
        return np.stack(moved, axis=-1) / (small * self.radius)


@cache
def _coastline() -> tuple[Array, ...]:
    """Read the lines of the coast, each as latitudes and longitudes, rad, shape (points, 2)."""
    with (files("mcnav.report.drawing") / "data" / "coastline.npz").open("rb") as opened, np.load(opened) as known:
        starts, lengths, steps = known["starts"], known["lengths"], known["steps"].astype(np.int64)
    ends = np.cumsum(lengths - 1)
    parts = np.split(steps, ends[:-1])
    lines = (np.cumsum(np.vstack([start, part]), axis=0) for start, part in zip(starts, parts, strict=True))
    return tuple(np.radians(STEP * line[:, ::-1].astype(float)) for line in lines)


def coast(projection: Projection, box: Box, finest: float) -> list[Array]:
    """Return the lines of the coast within a box, km, shape (points, 2) each; points nearer than ``finest`` are one."""
    lines = []
    for known in _coastline() if projection.earth else ():
        lines += _inside(projection(known[:, 0], known[:, 1]), box, finest)
    return lines


def grid(projection: Projection, box: Box, finest: float, most: int = 6) -> list[tuple[Array, str]]:
    """Return lines of equal latitude and longitude within a box, km, each with what it is, such as ``46° N``."""
    left, bottom, right, top = box
    span = np.degrees(max(right - left, top - bottom) / projection.radius)
    step = next((each for each in DEGREES if span <= most * each), DEGREES[-1])
    lines: list[tuple[Array, str]] = []
    middle = np.degrees([projection.latitude, projection.longitude])
    meridian_step = next((each for each in DEGREES if step <= 1.2 * each * np.cos(np.radians(middle[0]))), DEGREES[-1])
    reach = 1.5 * span
    along = np.linspace(-1.0, 1.0, 181)
    parallels = np.arange(np.ceil((middle[0] - reach) / step), np.floor((middle[0] + reach) / step) + 1) * step
    wide = min(180.0, reach / max(np.cos(np.radians(middle[0])), 1e-3))
    for latitude in parallels[np.abs(parallels) < 90.0]:
        points = projection(np.full(181, np.radians(latitude)), np.radians(middle[1] + wide * along))
        lines += [(part, _named(latitude, "N", "S")) for part in _inside(points, box, finest)[:1]]
    turns = wide / meridian_step
    first = np.round(middle[1] / meridian_step)
    for number in np.arange(first - np.floor(turns), first + np.floor(turns) + 1):
        longitude = number * meridian_step
        points = projection(
            np.radians(np.clip(middle[0] + reach * along, -90.0, 90.0)), np.full(181, np.radians(longitude))
        )
        named = _named((longitude + 180.0) % 360.0 - 180.0, "E", "W")
        lines += [(part, named) for part in _inside(points, box, finest)[:1]]
    return lines


def _named(degrees: float, positive: str, negative: str) -> str:
    degrees = round(float(degrees), 6) + 0.0
    beside = "" if degrees in (0.0, -180.0) else f" {positive if degrees > 0.0 else negative}"
    return f"{abs(degrees):g}°{beside}"


def _inside(points: Array, box: Box, finest: float) -> list[Array]:
    """Return the parts of a line whose pieces may cross a box, without points that are nearer than ``finest``."""
    left, bottom, right, top = box
    known = np.asarray(np.isfinite(points).all(axis=1))
    low, high = np.minimum(points[:-1], points[1:]), np.maximum(points[:-1], points[1:])
    with np.errstate(invalid="ignore"):
        crossing = (low[:, 0] <= right) & (high[:, 0] >= left) & (low[:, 1] <= top) & (high[:, 1] >= bottom)
    crossing &= known[:-1] & known[1:]
    edges = np.flatnonzero(np.diff(np.concatenate([[False], crossing, [False]]).astype(np.int8))).reshape(-1, 2)
    return [_thinned(points[begin : end + 1], finest) for begin, end in edges]


def _thinned(points: Array, finest: float) -> Array:
    kept, last = [0], points[0]
    for k in range(1, len(points) - 1):
        if np.hypot(*(points[k] - last)) >= finest:
            kept.append(k)
            last = points[k]
    return points[[*kept, len(points) - 1]]
