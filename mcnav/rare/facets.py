"""The event by the linear model: a union of half-spaces, and the division of space among them.

In standard normals u a half-space is ``alpha_j . u > beta_j`` with a unit vector alpha_j. Space is divided by which
of ``alpha_j . u - beta_j`` is the largest. On a line ``u = w + t alpha_j`` with w perpendicular to alpha_j, the cell
of j is ``t > t_0(w)``,

    t_0 = max_k (beta_j + alpha_k . w - beta_k) / (1 - alpha_k . alpha_j),

so that every point of space is on one half-line of one cell, and

    P = sum_j E_w [ integral over t > t_0 of phi(t) 1(event at w + t alpha_j) ].

Of many half-spaces, such as those of correlated epochs, cells are thin, and most lines miss their own. Points then
belong to all half-spaces, in shares that add up to one,

    pi_j(u) = exp(kappa (alpha_j . u - beta_j)) / sum_k exp(kappa (alpha_k . u - beta_k)),
    P = sum_j E_w [ integral over t of phi(t) pi_j 1(event at w + t alpha_j) ],

with kappa the nearest distance: shifts of the density to the half-spaces would be weighted so (the balance heuristic;
Veach and Guibas, 1995). With indicators in place of exponentials these are the shares of ALOE (Owen, Maximov and
Chertkov, 2019); these here are not zero where an event has moved away from the linear one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np
from scipy import special

from mcnav.arrays.types import Array, IndexArray
from mcnav.rare.limits import AnyEpoch, Limit

Outputs = Callable[[Array], Array]
"""Function of standard normals, shape (n, d), that returns outputs, shape (n, outputs)."""

SAME: Final = 0.995
"""Cosine of the angle of two half-spaces above which they are one."""

OFF: Final = 4.0
"""Distance along each axis from which nearest points of a model that bends are looked for, besides from zero."""

MOST_STARTS: Final = 64
"""Dimensions up to which the nearest points of a model that bends are looked for from each axis."""

MOST_STEPS: Final = 100

TURNED_AWAY: Final = 0.05
"""Cosine with a line below which it does not enter a half-space where it matters."""

DIGITS: Final = 9
"""Digits after the point of distances that are compared with each other."""

BEHIND: Final = 3.5
"""Distance beyond the nearest half-space from which others are left out: 1e-6 of its probability and less."""


@dataclass(frozen=True)
class Facets:
    """Half-spaces ``alpha_j . u > beta_j``: unit vectors, shape (facets, d), and distances, shape (facets,).

    ``turned`` are orthonormal bases of the planes perpendicular to the first directions, shape (some, d, d - 1).
    ``shared`` are those whose points belong to all of them.
    """

    directions: Array
    distances: Array
    foreseen: int
    """Half-spaces of the linear model, which come first; the others are the opposite side and those of a search."""

    turned: Array | None = None
    shared: bool = False
    bends: bool = False
    """Whether the linear model is no linear function of standard normals: of errors that are not normal."""

    @cached_property
    def bases(self) -> Array:
        """Orthonormal bases of the planes perpendicular to the directions, shape (facets, d, d - 1)."""
        known = [] if self.turned is None else list(self.turned)
        return np.array(known + [_across(direction) for direction in self.directions[len(known) :]])

    def with_bases(self, bases: Array) -> Facets:
        """Return the same with other bases."""
        return replace(self, turned=bases)

    def points(self, facet: IndexArray, across: Array, along: Array) -> Array:
        """Return ``B_j v + t alpha_j``, shape (n, d), from v, shape (n, d - 1), and t, shape (n,)."""
        return self.feet(facet, across) + along[:, None] * self.directions[facet]

    def feet(self, facet: IndexArray, across: Array) -> Array:
        """Return ``w = B_j v``, shape (n, d)."""
        return np.asarray(np.einsum("nij,nj->ni", self.bases[facet], across))

    def feet_of(self, j: int, across: Array) -> Array:
        """Return ``w = B_j v`` of lines of one facet."""
        basis = np.broadcast_to(self.bases[j], (len(across), *self.bases[j].shape))
        return np.asarray(np.einsum("nij,nj->ni", basis, across))

    def starts(self, facet: IndexArray, feet: Array) -> Array:
        """Return t_0 of lines through their feet w, shape (n,); minus infinity of a single facet.

        Where points are shared it is zero: before it, the share of a line's own half-space is negligible.
        """
        if self.shared:
            return np.zeros(len(feet))
        if len(self.distances) == 1:
            return np.full(len(feet), -np.inf)
        cosines = (self.directions @ self.directions.T)[facet]
        reach = self.distances[facet][:, None] + feet @ self.directions.T - self.distances
        others = np.arange(len(self.distances)) != facet[:, None]
        return np.asarray(np.max(np.where(others, reach / np.where(others, 1.0 - cosines, 1.0), -np.inf), axis=1))

    def cells(self, points: Array) -> IndexArray:
        """Return the cell of each point, shape (n,)."""
        return np.asarray(np.argmax(points @ self.directions.T - self.distances, axis=1))

    def entries(self, facet: IndexArray, feet: Array) -> Array:
        """Return where lines through their feet enter the first half-space by the linear model, shape (n,)."""
        cosines = (self.directions @ self.directions.T)[facet]
        reached = np.divide(self.distances - feet @ self.directions.T, cosines, out=np.full(cosines.shape, np.inf),
                            where=cosines > TURNED_AWAY)  # fmt: skip
        return np.asarray(np.min(reached[:, : max(self.foreseen, 1)], axis=1))

    def shares(self, facet: IndexArray, points: Array) -> Array:
        """Return pi_j of points on lines of some facets, shape (n,); one in a cell of its own."""
        if not self.shared:
            return np.ones(len(points))
        depths = float(np.min(self.distances)) * (points @ self.directions.T - self.distances)
        own = np.take_along_axis(depths, facet[:, None], axis=1)
        return np.asarray(1.0 / np.sum(np.exp(np.minimum(depths - own, 700.0)), axis=1))

    def expected_masses(self, normal: Array, shift: float) -> tuple[Array, Array]:
        """Return the probability of each half-space's share by the linear model, whose entries are shifted.

        And the squared coefficient of variation of its lines; both of shape (facets,).

        Parameters
        ----------
        normal : ndarray, shape (n, d)
            Standard normals, of which lines are laid.
        """
        cosines, projected = self.directions @ self.directions.T, normal @ self.directions.T
        steep, masses, variations = float(np.min(self.distances)), *np.zeros((2, len(self.distances)))
        for j, cosine in enumerate(cosines):
            reach = projected - projected[:, j : j + 1] * cosine  # alpha_k . w
            entered = cosine[: max(self.foreseen, 1)] > TURNED_AWAY
            ways = np.flatnonzero(entered)
            if not len(ways):  # the linear model has no entry on the side opposite to all of its ways to fail
                continue
            first = np.min((self.distances - reach)[:, ways] / cosine[ways], axis=1)
            at = np.maximum(first + shift, 0.0)[:, None]
            depths = steep * (reach + at * cosine - self.distances)
            share = 1.0 / np.sum(np.exp(np.minimum(depths - depths[:, j : j + 1], 700.0)), axis=1)
            mass = special.ndtr(-at[:, 0]) * share
            masses[j] = np.mean(mass)
            variations[j] = np.var(mass) / masses[j] ** 2 if masses[j] > 0.0 else 0.0
        return masses, variations

    def with_facet(self, point: Array) -> Facets:
        """Return the half-spaces with one more, beyond the plane through a point perpendicular to its position."""
        distance = float(np.linalg.norm(point))
        directions = np.vstack([self.directions, point / distance])
        return replace(self, directions=directions, distances=np.append(self.distances, distance))


def linear_facets(linear: Outputs, limit: Limit, dimensions: int, jumps: Sequence[tuple[Array, float]] = ()) -> Facets:
    """Return the half-spaces of the linear model, and behind the nearest one the opposite side of space.

    Parameters
    ----------
    linear : callable
        The model, exact where the sources are normal; with other distributions it bends, and each half-space touches
        it in the point nearest to zero.
    jumps : sequence of (ndarray, float)
        Directions and distances of further planes, across which it jumps.
    """
    zero, axes = np.zeros((1, dimensions)), OFF * np.vstack([np.eye(dimensions), -np.eye(dimensions)])
    ends = linear(np.vstack([zero, axes, 0.5 * axes])) - linear(zero)
    bends = not np.allclose(0.5 * ends[1 : 2 * dimensions + 1], ends[2 * dimensions + 1 :], rtol=1e-9, atol=0.0)
    if isinstance(limit, AnyEpoch) and not bends:
        gradient = (ends[1 : dimensions + 1] - ends[dimensions + 1 : 2 * dimensions + 1]).T / (2.0 * OFF)
        points = half_spaces(limit, linear(zero)[0], gradient)
    else:
        starts = np.vstack([zero, axes]) if bends and dimensions <= MOST_STARTS else zero
        points = [point for n, c in zip(limit.normals, limit.offsets, strict=True) for start in starts
                  if (point := nearest_point(linear, n, float(c), start)) is not None]  # fmt: skip
    points += jumps
    directions, distances = np.zeros((0, dimensions)), np.zeros(0)
    nearest = min((beta for _, beta in points), default=np.inf)
    # two sides of one output are equally far, but for rounding: they keep the order of the limit on every machine
    for alpha, beta in sorted(points, key=lambda point: round(point[1], DIGITS)):
        if beta < nearest + BEHIND and not np.any(directions @ alpha > SAME):
            directions, distances = np.vstack([directions, alpha]), np.append(distances, beta)
    foreseen = len(distances)
    if len(distances) and not np.any(directions @ directions[0] < -SAME):
        directions, distances = np.vstack([directions, -directions[0]]), np.append(distances, distances[0])
    return Facets(directions, distances, foreseen, bends=bends)


def half_spaces(limit: Limit, mean: Array, gradient: Array) -> list[tuple[Array, float]]:
    """Return the directions and distances of all sides that a linear model reaches.

    Parameters
    ----------
    mean, gradient : ndarray, shapes (outputs,), (outputs, d)
        Of the outputs ``mean + gradient u``.
    """
    slopes, left = limit.normals @ gradient, limit.offsets - limit.normals @ mean
    sizes = np.sqrt(np.sum(slopes**2, axis=1))
    return [(slopes[k] / sizes[k], float(left[k] / sizes[k])) for k in np.flatnonzero(sizes > 0.0)]


def nearest_point(linear: Outputs, normal: Array, offset: float, start: Array) -> tuple[Array, float] | None:
    """Find the direction and distance of the point of ``n . y = c`` that is nearest to zero, from a start, shape (d,).

    None without a gradient, or where it is not reached.

    u is replaced by ``(grad . u - m) / |grad|^2 grad`` with m = n . y - c (Hasofer and Lind, 1974; Rackwitz and
    Fiessler, 1978), which is exact at once where the model is linear.
    """
    point, dimensions, step = start, len(start), 1e-4
    for _ in range(MOST_STEPS):
        ends = linear(np.vstack([point, point + step * np.eye(dimensions), point - step * np.eye(dimensions)])) @ normal
        gradient = (ends[1 : dimensions + 1] - ends[dimensions + 1 :]) / (2.0 * step)
        square = float(gradient @ gradient)
        if not square > 0.0:
            return None
        better = (float(gradient @ point) - (float(ends[0]) - offset)) / square * gradient
        moved = float(np.linalg.norm(better - point))
        point = better if moved < 1e-6 else point + min(1.0, 3.0 / moved) * (better - point)
        if moved < 1e-6:
            break
    else:
        return None
    # the sign of the distance: a nominal that is beyond the limit already has a negative one
    along = gradient / np.sqrt(square)
    return along, float(along @ point)


def _across(direction: Array) -> Array:
    """Return an orthonormal basis of the plane perpendicular to a unit vector a, shape (d, d - 1).

    Columns 2 to d of Householder's ``I - 2 w w^T / (w . w)`` with ``w = a + sign(a_1) e_1``: they depend smoothly on a,
    also where components of a are rounding, so that the same lines are laid on every machine.
    """
    mirror = direction.copy()
    mirror[0] += np.copysign(1.0, direction[0])
    return np.asarray((np.eye(len(mirror)) - np.outer(mirror, 2.0 * mirror / (mirror @ mirror)))[:, 1:])
