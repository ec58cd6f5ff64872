"""Beams fixed to the body: where they point, and where they meet the ground.

A sensor has one to three beams, each along a unit vector b of the body's axes, forward, right and down. Its boresight
errors e are the rotation vector, about these axes, of the beams that the navigator takes less the true ones, the same
for all beams of the sensor: the navigator's are ``b + e x b``.

The ground is the ellipsoid whose axes are longer by an altitude. Along a beam of direction d from the place r it is at
the distance s ::

    |S (r + s d)| = 1        S = diag(1 / A, 1 / A, 1 / B)

which is the smaller root of a quadratic equation.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from pydantic import ValidationError

from mcnav.arrays.types import Array
from mcnav.entries.axes import AxisSizes
from mcnav.entries.context import FileContext
from mcnav.systems.ins.earth import Earth
from mcnav.systems.ins.imu.instruments import AXES
from mcnav.systems.ins.sensors.quantity import FurtherKey
from mcnav.systems.ins.truth.trajectory import Truth

MOST_BEAMS: Final = 3

DOWN: Final = ((0.0, 0.0, 1.0),)
"""The beam of a sensor that has no others: down."""

NO_ARM: Final = np.zeros(3)
ARM: Final = AxisSizes("m", AXES, lambda size: "")

FURTHER: Final = {
    "beams": FurtherKey("Directions of one to three beams, each forward, right and down.", form=list[list[float]]),
    "reach": FurtherKey("Longest distance along a beam at which a sensor measures.", "m"),
    "ground": FurtherKey("Altitude of the ground that beams meet; 0 unless given.", "m"),
}


def read_beams(entry: Mapping[str, Any], truth: Truth, key: str, context: FileContext) -> Array:
    """Return the beams of a sensor, shape (n, 4): unit vectors, and the altitude of the ground, m."""
    given = entry.get("beams", DOWN)
    beams = given if isinstance(given, Sequence) and not isinstance(given, str) else ()
    expected = "expected one to three beams such as [[0.38, 0.0, 0.92], [-0.38, 0.0, 0.92]]"
    try:
        vectors = np.array(beams, dtype=float)
        sizes = np.linalg.norm(vectors.reshape(-1, 3), axis=1)
    except (ValueError, TypeError):
        sizes = np.zeros(0)
    if not 1 <= len(sizes) <= MOST_BEAMS or not np.all((sizes > 0.0) & np.isfinite(sizes)):
        context.problem(f"{key}.beams", f"got {given!r}; {expected}")
        return np.array([[*DOWN[0], 0.0]])
    ground = context.quantity(entry["ground"], "m", f"{key}.ground") if "ground" in entry else 0.0
    heights = np.full((len(sizes), 1), 0.0 if ground is None else ground)
    return np.concatenate([vectors.reshape(-1, 3) / sizes[:, None], heights], axis=1)


def ground_scales(earth: Earth, altitude: float) -> Array:
    """Return 1 / A, 1 / A, 1 / B of the ground at an altitude, 1/m."""
    equator, pole = earth.radius + altitude, earth.radius * (1.0 - earth.flattening) + altitude
    return np.array([1.0 / equator, 1.0 / equator, 1.0 / pole])


def beam_range(scales: Array, position: Array, direction: Array) -> tuple[Array, Array]:
    """Compute the distance to the ground along directions, shape (n, 3), and the normals of the ground there.

    Returns
    -------
    distance : ndarray, shape (n,)
        m; NaN where a beam misses the ground.
    normal : ndarray, shape (n, 3)
        Not of size one: ``S^2`` times the place.
    """
    place, along = scales * position, scales * direction
    square, half = np.sum(along**2, axis=-1), np.sum(along * place, axis=-1)
    with np.errstate(invalid="ignore"):
        root = np.sqrt(half**2 - square * (np.sum(place**2, axis=-1) - 1.0))
        # the smaller root without the cancellation of -half - root, where half is below zero
        distance = (np.sum(place**2, axis=-1) - 1.0) / (root - half)
    distance = np.where(half < 0.0, distance, np.nan)
    return np.asarray(distance), np.asarray(scales**2 * (position + distance[..., None] * direction))


def distances(truth: Truth, times: Array, beams: Array, lever_arm: Array = NO_ARM) -> Array:
    """Compute the distances to the ground along a sensor's beams at instants, m, shape (n, beams); NaN for none."""
    body = truth.attitude(times).as_matrix()
    position = truth.earth_fixed(times)[0] + body @ lever_arm
    return np.stack(
        [beam_range(ground_scales(truth.earth, beam[3]), position, body @ beam[:3])[0] for beam in beams], axis=1
    )


def _lever_arm(entry: Mapping[str, Any]) -> Array:
    """Return the lever arm of a sensor, shape (3,), m; none where it cannot be read, which is told elsewhere."""
    try:
        return np.nan_to_num(ARM.read(entry["lever_arm"])) if "lever_arm" in entry else NO_ARM
    except ValidationError:
        return NO_ARM


def select(entry: Mapping[str, Any], times: Array, truth: Truth, key: str, context: FileContext) -> Array:
    """Leave out the instants at which a beam misses the ground, or meets it out of reach."""
    reach = context.quantity(entry["reach"], "m", f"{key}.reach") if "reach" in entry else np.inf
    silent = FileContext(context.file, context.folder)
    beams = read_beams(entry, truth, key, silent)
    if reach is None or not len(times) or silent.problems:
        return times
    farthest = distances(truth, times, beams, _lever_arm(entry)).max(axis=1)
    meets = farthest <= reach
    if meets.any():
        return np.asarray(times[meets])
    if np.isfinite(farthest).any():
        context.problem(
            f"{key}.reach", f"got {entry['reach']!r}; the beams are {np.nanmin(farthest):.6g} m long at least"
        )
    else:
        context.problem(f"{key}.beams", "miss the ground at all instants of the sensor")
    return times
