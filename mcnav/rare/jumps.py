"""Jumps: ways to fail of which no gradient knows, such as a rare value of a table or of a discrete error.

The linear model takes no flights. Where errors are not normal, it is asked at many points with widened errors; those
beyond the limit behind a jump get the half-space of the jump's plane, as `mcnav.rare.facets` has those of gradients.
"""

from __future__ import annotations

from functools import partial
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array, IndexArray
from mcnav.rare.facets import Facets, Outputs, linear_facets
from mcnav.rare.flights import Margins
from mcnav.rare.limits import Limit
from mcnav.rare.lines import crossings
from mcnav.rare.widened import draw_widened

ASIDE: Final = 0.08
"""Angle between rays across a jump."""

ASKED: Final = 20_000
"""Points at which the linear model is asked."""

MOST_PLANES: Final = 16
FAILURES: Final = 400
"""Planes of jumps that are looked for, in so many failures, the nearest first."""

CLOSE: Final = 0.01
"""Distance to both sides of a crossing, and a tenth of it, over which a jump is as large, and a slope a tenth."""

SEED: Final = 53


def known_facets(linear: Outputs, limit: Limit, dimensions: int) -> Facets:
    """Return the half-spaces of the linear model (`mcnav.rare.facets.linear_facets`), with those of its jumps."""
    facets = linear_facets(linear, limit, dimensions)
    if not facets.bends:
        return facets
    planes = jump_planes(lambda points: limit.margin(linear(points)), dimensions)
    return linear_facets(linear, limit, dimensions, planes) if planes else facets


def jump_planes(margins: Margins, dimensions: int) -> list[tuple[Array, float]]:
    """Return the directions and distances of planes at which a model jumps beyond its limit."""
    points = draw_widened(ASKED, dimensions, np.random.Generator(np.random.Philox(SEED)))
    points = points[margins(points) > 0.0]
    points = points[np.argsort(np.linalg.norm(points, axis=1), kind="stable")[:FAILURES]]
    sizes, zeros = np.linalg.norm(points, axis=1), np.zeros(len(points))
    rays = points / sizes[:, None]
    known = crossings(
        partial(_quiet, margins), np.zeros(len(points), dtype=np.int64), np.zeros(points.shape), rays, sizes, zeros,
        zeros, sizes * (1.0 + 1e-9),
    )  # fmt: skip
    at = np.minimum(known.at, sizes)
    jumped = jumps_across(margins, at, rays)
    left, planes = (at[:, None] * rays)[jumped], []
    for _ in range(MOST_PLANES):
        if not len(left):
            break
        point, settled = nearest_jump(margins, left[0])
        left = left[1:]
        size = float(np.linalg.norm(point))
        if settled and size > 0.0:
            planes.append((point / size, size))
            left = left[left @ point < size * (size - 0.5)]
    return planes


def jumps_across(margins: Margins, at: Array, rays: Array) -> NDArray[np.bool_]:
    """Return along which rays the margin jumps where it crosses the limit, shape (n,)."""
    changes = [
        margins((at + step)[:, None] * rays) - margins((at - step)[:, None] * rays) for step in (CLOSE, 0.3 * CLOSE)
    ]
    return np.asarray(changes[1] > 0.65 * changes[0])


def _quiet(margins: Margins, points: Array, noise: IndexArray) -> Array:
    return margins(points)


def nearest_jump(margins: Margins, point: Array) -> tuple[Array, bool]:
    """Find the nearest point of a plane across which flights jump, from d more rays that cross it; as above.

    With p_0 ... p_d where rays cross, the normal n solves ``n . p_i = 1``, and the point is ``n / |n|^2``.
    """
    d, size = len(point), float(np.linalg.norm(point))
    rays = point / size + ASIDE * np.eye(d)
    rays /= np.linalg.norm(rays, axis=1)[:, None]
    zeros = np.zeros(d)
    entries = crossings(
        partial(_quiet, margins), np.zeros(d, dtype=np.int64), np.zeros((d, d)), rays, np.full(d, size),
        zeros, zeros, np.full(d, 1.5 * size),
    )  # fmt: skip
    if not np.all(np.isfinite(entries.at)):
        return point, False
    normal = np.linalg.lstsq(np.vstack([point, entries.at[:, None] * rays]), np.ones(d + 1), rcond=None)[0]
    return np.asarray(normal / float(normal @ normal)), True
