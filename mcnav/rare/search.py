"""Failures in other places than the linear model chooses: is there another way to fail?

Flights with widened errors (`mcnav.rare.widened`) and points of the event by levels (`mcnav.rare.levels`) that fail
where neither the linear model nor the fitted lines expect it are followed to the point of the event nearest to zero. If
that point is where lines pass anyway, or too far to matter, nothing follows; else space gets another facet.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import special

from mcnav.arrays.types import Array, IndexArray
from mcnav.rare.facets import Facets
from mcnav.rare.flights import Flown, Margins, Places
from mcnav.rare.jumps import jumps_across, nearest_jump
from mcnav.rare.lines import crossings
from mcnav.rare.proposal import Proposal

RELEVANT: Final = 1e-3
"""Share of the probability below which another way to fail is left out: less than the interval's own width."""

BEHIND: Final = 0.5
"""Depth before the half-space at a nearest point from which other failures belong to it."""

FORESEEN: Final = 0.3
"""Distance before the fitted entry of a line from which a failure is foreseen."""

PASSED: Final = 2.0
"""Distance from a line's axis within which the lines of a facet pass a point."""

CLEAR: Final = 0.03
"""Share by which a nearest point is moved out and in to see that flights fail beyond it and not before."""

MOST_STEPS: Final = 24
STEP, CLOSE = 0.05, 0.1
"""Step of differences, and the last step towards a nearest point, in standard deviations."""


@dataclass(frozen=True)
class Search:
    """Result of the search.

    Attributes
    ----------
    facets : Facets
        With those added.
    jumps : bool
        Whether an unforeseen failure lies behind a jump of the margin.
    corner : float
        Distance of the nearest unforeseen failure that has no half-space; infinite where none is.
    far : float
        Distance from which a half-space does not matter.
    """

    facets: Facets
    jumps: bool
    corner: float
    far: float


def search_elsewhere(flown: Flown, facets: Facets, nearest: float, unforeseen: Places, most: int) -> Search:
    """Follow failures that nothing foresees, and add half-spaces for other ways to fail that matter.

    Parameters
    ----------
    flown : callable
        Margins of standard normals, shape (n, d), by flights.
    nearest : float
        Distance of a half-space as probable as the event.
    unforeseen : Places
        Points that fail and lie on no line of the pilot's, or on too few.
    most : int
        Failures that are followed; what is left is for `mcnav.rare.estimate` to count.
    """
    far = float(-special.ndtri(RELEVANT * special.ndtr(-nearest)))
    if not len(unforeseen):
        return Search(facets, jumps=False, corner=math.inf, far=far)
    points, zeros = unforeseen.points, np.zeros(len(unforeseen))
    sizes = np.linalg.norm(points, axis=1)
    rays = points / sizes[:, None]
    entries = crossings(
        flown, unforeseen.noise, np.zeros(points.shape), rays, sizes, zeros, zeros, sizes * (1.0 + 1e-9)
    )
    at = np.minimum(entries.at, sizes)
    jumped = jumps_across(partial(_noisy, flown, unforeseen.noise), at, rays)
    return _follow(flown, facets, far, Places(at[:, None] * rays, unforeseen.noise), jumped, most)


def _noisy(flown: Flown, noise: IndexArray, points: Array) -> Array:
    return flown(points, noise)


def _follow(flown: Flown, facets: Facets, far: float, places: Places, jumped: NDArray[np.bool_], most: int) -> Search:
    """Follow unforeseen failures from the nearest on, and add the facets that lines do not pass."""
    points, corner, jumps = places.points, math.inf, False
    left = np.argsort(np.linalg.norm(points, axis=1), kind="stable")
    for _ in range(most):
        if not len(left):
            break
        i, left = left[0], left[1:]
        margins = flown.with_noise(int(places.noise[i]))
        point, settled = (nearest_jump if jumped[i] else nearest_failure)(margins, points[i])
        size = float(np.linalg.norm(point))
        if settled and size <= far:
            beyond, before = margins(np.array([1.0 + CLEAR, 1.0 - CLEAR])[:, None] * point) > 0.0
            settled = bool(beyond and not before)
            if settled and not passed(point, facets):
                facets = facets.with_facet(point)
        if not settled:
            corner = min(corner, float(np.linalg.norm(points[i])))
            continue
        jumps |= bool(jumped[i]) and size <= far
        left = left[points[left] @ point < size * (size - BEHIND)]
    return Search(facets, jumps, corner, far)


def foreseen(
    points: Array, expected: Callable[[Array], Array], facets: Facets, proposals: Sequence[Proposal]
) -> NDArray[np.bool_]:
    """Return at which points failures are expected, by the half-spaces or by the fit of the lines, shape (n,).

    A linear model that bends, of errors that are not normal, may jump: its own failures are known where they lie in a
    half-space.
    """
    cells = facets.cells(points)
    along = np.einsum("nd,nd->n", points, facets.directions[cells])
    known = along > facets.distances[cells] if facets.bends else expected(points) > 0.0
    by_lines = np.zeros(len(points), dtype=bool)
    for j, proposal in enumerate(proposals[: facets.foreseen]):
        mine = cells == j
        across = points[mine] @ facets.bases[j]
        by_lines[mine] = along[mine] > proposal.entry(across) - FORESEEN
    return np.asarray(known | by_lines)


def passed(point: Array, facets: Facets) -> bool:
    """Return whether the lines of a facet pass a point."""
    along = facets.directions @ point
    across = np.sqrt(np.maximum(float(point @ point) - along**2, 0.0))
    return bool(np.any((across < PASSED) & (along > 0.0)))


def nearest_failure(margins: Margins, point: Array) -> tuple[Array, bool]:
    """Follow the surface of the event to its point nearest to zero.

    Steps are those of `mcnav.rare.facets.nearest_point`, the gradient by differences and then by Broyden's rule.
    Returns the point, and whether it was reached.
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
            return point, False
        better = (float(gradient @ point) - now) / square * gradient
        moved = float(np.linalg.norm(better - point))
        if moved < CLOSE:
            return better, True
        before, last = point, now
        point = point + min(1.0, max(0.5 * float(np.linalg.norm(point)), 1.0) / moved) * (better - point)
    return point, False
