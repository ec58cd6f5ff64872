"""Flights in other places than the linear model chooses: is there another way to fail?

Flown are the points at a distance R on both sides of each axis, one cause alone, and points in random directions farther
out. A failure that neither the linear model nor the fitted lines expect is followed to the point of the event nearest
to zero. If that point is where lines pass anyway, or too far to matter, nothing follows; else space gets another facet.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy import special

from mcnav._types import Array
from mcnav.rare.facets import Facets
from mcnav.rare.lines import Margins, crossings
from mcnav.rare.proposal import Proposal

RELEVANT: Final = 0.02
"""Share of the probability below which another way to fail is left out."""

DIRECTIONS: Final = 96
FARTHEST: Final = 1.8
"""Random directions, and how far out they reach, in distances at which a way to fail is just relevant."""

FOLLOWED: Final = 4
"""Unexpected failures that are followed to the nearest point."""

PASSED: Final = 2.0
"""Distance from a line's axis within which the lines of a facet pass a point."""

MOST_STEPS: Final = 6
STEP: Final = 0.05


@dataclass(frozen=True)
class Search:
    """What the search led to: facets, with those added; flights; why nothing can be stated, or nothing."""

    facets: Facets
    flights: int
    refusal: str = ""


def search_elsewhere(
    margins: Margins, expected: Callable[[Array], Array], facets: Facets, proposals: Sequence[Proposal],
    nearest: float, generator: np.random.Generator,
) -> Search:  # fmt: skip
    """Search for other ways to fail than those of the facets.

    Parameters
    ----------
    margins, expected : callable
        Margins of standard normals, shape (n, d), by flights and by the linear model.
    proposals : sequence of Proposal
        Of the lines of each facet.
    nearest : float
        Distance of a half-space as probable as the event.
    """
    d = facets.directions.shape[1]
    far = float(-special.ndtri(RELEVANT * special.ndtr(-nearest)))
    axes = far * np.vstack([np.eye(d), -np.eye(d)])
    directions = generator.standard_normal((DIRECTIONS, d))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    radii = far * (1.0 + (FARTHEST - 1.0) * generator.random(DIRECTIONS))
    points = np.vstack([axes, radii[:, None] * directions])
    flights = len(points)
    failed = ~(margins(points) <= 0.0) & ~foreseen(points, expected, facets, proposals)
    points = points[failed]
    if not len(points):
        return Search(facets, flights)
    sizes = np.linalg.norm(points, axis=1)
    rays, zeros = points / sizes[:, None], np.zeros(len(points))
    entries = crossings(margins, np.zeros(points.shape), rays, 0.5 * sizes, zeros, zeros, sizes)
    flights += entries.flights
    nearest_first = np.argsort(np.where(np.isfinite(entries.at), entries.at, sizes), kind="stable")
    rays, distances = rays[nearest_first], np.minimum(entries.at, sizes)[nearest_first]
    for ray, distance in list(zip(rays, distances, strict=True))[:FOLLOWED]:
        point, used, settled = nearest_failure(margins, distance * ray)
        flights += used
        size = float(np.linalg.norm(point))
        if passed(point, facets) or (settled and size > far):
            continue
        if not settled:
            reason = f"a flight fails at {distance:.2g} sigma in a direction where no failure is expected: a jump, a gate"
            return Search(facets, flights, reason)
        facets = facets.with_facet(point)
    return Search(facets, flights)


def foreseen(points: Array, expected: Callable[[Array], Array], facets: Facets, proposals: Sequence[Proposal]) -> Array:
    """Return at which points failures are expected, by the linear model or by the fit of the lines, shape (n,)."""
    cells = facets.cells(points)
    along = np.einsum("nd,nd->n", points, facets.directions[cells])
    by_lines = np.zeros(len(points), dtype=bool)
    for j, proposal in enumerate(proposals):
        mine = cells == j
        across = points[mine] @ facets.bases[j]
        by_lines[mine] = along[mine] > proposal.entry(across) - 0.3
    return np.asarray((expected(points) > 0.0) | by_lines)


def passed(point: Array, facets: Facets) -> bool:
    """Return whether the lines of a facet pass a point."""
    along = facets.directions @ point
    across = np.sqrt(np.maximum(float(point @ point) - along**2, 0.0))
    return bool(np.any((across < PASSED) & (along > 0.0)))


def nearest_failure(margins: Margins, point: Array) -> tuple[Array, int, bool]:
    """Follow the surface of the event to its point nearest to zero, by differences (`mcnav.rare.facets.nearest_point`).

    Returns the point, the flights, and whether it was reached.
    """
    d, flights = len(point), 0
    for _ in range(MOST_STEPS):
        ends = margins(np.vstack([point, point + STEP * np.eye(d)]))
        flights += d + 1
        gradient = (ends[1:] - ends[0]) / STEP
        square = float(gradient @ gradient)
        if not (np.isfinite(square) and square > 0.0):
            return point, flights, False
        better = (float(gradient @ point) - float(ends[0])) / square * gradient
        moved = float(np.linalg.norm(better - point))
        size = float(np.linalg.norm(point))
        if moved < 0.1:
            return better, flights, True
        point = point + min(1.0, max(0.5 * size, 1.0) / moved) * (better - point)
    return point, flights, moved < 0.5
