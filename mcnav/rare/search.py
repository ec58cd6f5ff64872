"""Flights in other places than the linear model chooses: is there another way to fail?

Flown are the points at a distance R on both sides of each axis, one cause alone, and points in random directions
farther out. A failure that neither the linear model nor the fitted lines expect is followed to the point of the event
nearest to zero. If that point is where lines pass anyway, or too far to matter, nothing follows; else space gets
another facet.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import special

from mcnav._dataclasses import dataclass
from mcnav._types import Array
from mcnav.rare.facets import Facets
from mcnav.rare.flights import Flown, Margins, Places
from mcnav.rare.lines import crossings
from mcnav.rare.proposal import Proposal

RELEVANT: Final = 0.02
"""Share of the probability below which another way to fail is left out."""

DIRECTIONS: Final = 120
FARTHEST: Final = 2.0
"""Random directions, and how far out they reach, in distances at which a way to fail is just relevant."""

BEHIND: Final = 0.5
"""Depth before the half-space at a nearest point from which other failures belong to it."""

FOLLOWED: Final = 5
"""Unexpected failures that are followed to the nearest point."""

PASSED: Final = 2.0
"""Distance from a line's axis within which the lines of a facet pass a point."""

CLEAR: Final = 0.03
"""Share by which a nearest point is moved out and in to see that flights fail beyond it and not before."""

MOST_STEPS: Final = 24
STEP, CLOSE = 0.05, 0.1
"""Step of differences, and the last step towards a nearest point, in standard deviations."""

ASIDE: Final = 0.08
"""Angle between rays across a jump."""


@dataclass(frozen=True)
class Search:
    """Result of the search: facets, with those added; flights; why nothing can be stated, or nothing."""

    facets: Facets
    flights: int
    refusal: str = ""


def search_elsewhere(
    flown: Flown, expected: Callable[[Array], Array], facets: Facets, proposals: Sequence[Proposal],
    nearest: float, unexpected: Places, generator: np.random.Generator,
) -> Search:  # fmt: skip
    """Search for other ways to fail than those of the facets.

    Parameters
    ----------
    flown, expected : callable
        Margins of standard normals, shape (n, d), by flights and by the linear model.
    proposals : sequence of Proposal
        Of the lines of each facet.
    nearest : float
        Distance of a half-space as probable as the event.
    unexpected : Places
        Points that failed already where none should.
    """
    far = float(-special.ndtri(RELEVANT * special.ndtr(-nearest)))
    points = other_places(facets, far, generator)
    elsewhere, flights = Places(points, flown.new_noise(len(points))), len(points)
    failed = (flown(elsewhere.points, elsewhere.noise) > 0.0) & ~foreseen(points, expected, facets, proposals)
    unexpected = unexpected.and_also(elsewhere[failed])
    if not len(unexpected):
        return Search(facets, flights)
    points = unexpected.points
    sizes = np.linalg.norm(points, axis=1)
    rays, zeros = points / sizes[:, None], np.zeros(len(points))
    entries = crossings(
        flown, unexpected.noise, np.zeros(points.shape), rays, sizes, zeros, zeros, sizes * (1.0 + 1e-9)
    )
    flights += entries.flights
    distances = np.minimum(entries.at, sizes)
    entered = Places(distances[:, None] * rays, unexpected.noise)
    followed = _follow(flown, facets, far, entered, entries.jumped)
    return Search(followed.facets, flights + followed.flights, followed.refusal)


def _follow(flown: Flown, facets: Facets, far: float, places: Places, jumped: NDArray[np.bool_]) -> Search:
    """Follow unexpected failures from the nearest on, and add the facets that lines do not pass."""
    points = places.points
    left, flights = np.argsort(np.linalg.norm(points, axis=1), kind="stable"), 0
    for _ in range(FOLLOWED):
        if not len(left):
            break
        i, left = left[0], left[1:]
        margins = flown.with_noise(int(places.noise[i]))
        point, used, settled = (nearest_jump if jumped[i] else nearest_failure)(margins, points[i])
        flights += used
        size = float(np.linalg.norm(point))
        if settled and size > far:
            continue
        flights += 2
        inside, outside = margins(np.array([1.0 + CLEAR, 1.0 - CLEAR])[:, None] * point) > 0.0
        if not (settled and inside and not outside):
            where = f"{np.linalg.norm(points[i]):.2g} sigma from the nominal"
            return Search(facets, flights, f"a flight fails {where} where no failure is expected, by a jump or a gate")
        if not passed(point, facets):
            facets = facets.with_facet(point)
        left = left[points[left] @ point < size * (size - BEHIND)]
    return Search(facets, flights)


def other_places(facets: Facets, far: float, generator: np.random.Generator) -> Array:
    """Return where else flights go, shape (n, d): single causes, alone and with the linear direction, and any."""
    d = facets.directions.shape[1]
    axes = np.vstack([np.eye(d), -np.eye(d)])
    tilted = 0.5 * facets.directions[0] + np.sqrt(0.75) * axes
    tilted /= np.maximum(np.linalg.norm(tilted, axis=1), 1e-3)[:, None]
    directions = generator.standard_normal((DIRECTIONS, d))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    radii = far * (1.0 + (FARTHEST - 1.0) * generator.random(DIRECTIONS))
    return np.vstack([far * axes, 1.1 * far * tilted, radii[:, None] * directions])


def foreseen(
    points: Array, expected: Callable[[Array], Array], facets: Facets, proposals: Sequence[Proposal]
) -> NDArray[np.bool_]:
    """Return at which points failures are expected, by the linear model or by the fit of the lines, shape (n,)."""
    cells = facets.cells(points)
    along = np.einsum("nd,nd->n", points, facets.directions[cells])
    by_lines = np.zeros(len(points), dtype=bool)
    for j, proposal in enumerate(proposals[: facets.foreseen]):
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
    """Follow the surface of the event to its point nearest to zero.

    Steps are those of `mcnav.rare.facets.nearest_point`, the gradient by differences and then by Broyden's rule.
    Returns the point, the flights, and whether it was reached.
    """
    d, gradient, before, last = len(point), np.zeros(len(point)), point, 0.0
    for flight in range(MOST_STEPS):
        if flight == 0:
            ends = margins(np.vstack([point, point + STEP * np.eye(d)]))
            now, gradient = float(ends[0]), (ends[1:] - ends[0]) / STEP
        else:
            now, moved_by = float(margins(point[None])[0]), point - before
            gradient = gradient + (now - last - gradient @ moved_by) / float(moved_by @ moved_by) * moved_by
        square = float(gradient @ gradient)
        if not (np.isfinite(square) and square > 0.0):
            return point, d + 1 + flight, False
        better = (float(gradient @ point) - now) / square * gradient
        moved = float(np.linalg.norm(better - point))
        if moved < CLOSE:
            return better, d + 1 + flight, True
        before, last = point, now
        point = point + min(1.0, max(0.5 * float(np.linalg.norm(point)), 1.0) / moved) * (better - point)
    return point, d + MOST_STEPS, False


def nearest_jump(margins: Margins, point: Array) -> tuple[Array, int, bool]:
    """Find the nearest point of a plane across which flights jump, from d more rays that cross it; as above.

    With p_0 ... p_d where rays cross, the normal n solves ``n . p_i = 1``, and the point is ``n / |n|^2``.
    """
    d, size = len(point), float(np.linalg.norm(point))
    rays = point / size + ASIDE * np.eye(d)
    rays /= np.linalg.norm(rays, axis=1)[:, None]
    zeros = np.zeros(d)
    entries = crossings(
        lambda points, noise: margins(points), np.zeros(d, dtype=np.int64), np.zeros((d, d)), rays, np.full(d, size),
        zeros, zeros, np.full(d, 1.5 * size),
    )  # fmt: skip
    if not np.all(np.isfinite(entries.at)):
        return point, entries.flights, False
    normal = np.linalg.lstsq(np.vstack([point, entries.at[:, None] * rays]), np.ones(d + 1), rcond=None)[0]
    return np.asarray(normal / float(normal @ normal)), entries.flights, True
