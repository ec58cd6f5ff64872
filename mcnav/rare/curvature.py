"""Curvature of the outputs, by which the axes across a line are turned: products of two errors become squares.

With second differences of the outputs y about zero, H_ij of the causes u_i and u_j, the margin of a half-space
``n . y > c`` has the curvature ``n . H``. Across the direction alpha, in an orthonormal basis B, the entries of lines
are ``t*(v) = t*(0) - v^T B^T H B v / (2 alpha . grad) + ...``; in the axes of this matrix there are no products left,
and the fit of a proposal, of squares alone, describes it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.rare.facets import Facets
from mcnav.rare.limits import Limit, side_towards

STEP: Final = 1.5
"""Step of differences, in standard deviations: as far as lines that matter are from each other."""

ALL_PAIRS: Final = 16
"""Dimensions up to which each pair of causes is looked at."""

PROBES: Final = 4
"""Random combinations of causes that each cause is paired with in more dimensions: products of as many are seen."""

PRODUCT: Final = 0.01
"""Product in a curvature, times the distance of the half-space, that is turned away."""

SWEEPS: Final = 12


@dataclass(frozen=True)
class Curvature:
    """First and second differences of the outputs about zero, shapes (outputs, d) and (outputs, d, d)."""

    gradient: Array
    curvature: Array

    @classmethod
    def measure(cls, fly: Callable[[Array], Array], dimensions: int, generator: np.random.Generator) -> Curvature:
        """Measure them by flights: ``fly`` returns outputs of standard normals, shape (n, d)."""
        return cls(*(all_pairs if dimensions <= ALL_PAIRS else probed)(fly, dimensions, generator))

    def turned(self, facets: Facets, limit: Limit) -> Facets:
        """Turn the axes across the lines of each half-space to those of its curvature.

        Where a flight failed, and where there is one axis or none, nothing is turned.
        """
        gradient, curvature = self.gradient, self.curvature
        if facets.directions.shape[1] < 3 or not (np.isfinite(curvature).all() and np.isfinite(gradient).all()):
            return facets
        bases = facets.bases.copy()
        for j, (direction, distance) in enumerate(zip(facets.directions, facets.distances, strict=True)):
            normal = side_towards(limit, gradient @ direction)
            slope = float(normal @ gradient @ direction)
            if not slope > 0.0:
                continue
            across = np.einsum("o,oij->ij", normal, curvature)
            across = -0.5 * np.einsum("ia,ij,jb->ab", bases[j], across, bases[j]) / slope
            bases[j] = np.einsum("ia,ab->ib", bases[j], axes_of(across, PRODUCT / max(distance, 1.0)))
        return facets.with_bases(bases)


def all_pairs(fly: Callable[[Array], Array], dimensions: int, generator: np.random.Generator) -> tuple[Array, Array]:
    """Return first and second differences by each pair of causes, shapes (outputs, d) and (outputs, d, d)."""
    return along(fly, STEP * np.eye(dimensions))


def probed(fly: Callable[[Array], Array], dimensions: int, generator: np.random.Generator) -> tuple[Array, Array]:
    """Return the same from pairs of each cause with a few random combinations of them (Halko and others, 2011).

    With W an orthonormal basis of ``H X``, of random X, the curvature is ``W W^T H W W^T``.
    """
    axes, probes = STEP * np.eye(dimensions), generator.standard_normal((PROBES, dimensions))
    probes *= STEP / np.linalg.norm(probes, axis=1)[:, None]
    outputs = fly(np.vstack([np.zeros(dimensions), axes, -axes, probes, *(axes + probe for probe in probes)]))
    here, ahead, behind, at_probes, rest = np.split(outputs, np.cumsum([1, dimensions, dimensions, PROBES]))
    both = rest.reshape(PROBES, dimensions, -1)
    products = (both - ahead - at_probes[:, None] + here) / STEP**2
    curvature = np.empty((outputs.shape[1], dimensions, dimensions))
    for o in range(outputs.shape[1]):
        basis = np.linalg.qr(products[:, :, o].T)[0]
        inner = along(fly, STEP * basis.T)[1][o]
        curvature[o] = np.einsum("ia,ab,jb->ij", basis, inner, basis)
    return (ahead - behind).T / (2.0 * STEP), curvature


def along(fly: Callable[[Array], Array], axes: Array) -> tuple[Array, Array]:
    """Return first and second differences along k axes of length `STEP`, shapes (outputs, k) and (outputs, k, k)."""
    count, pairs = len(axes), list(combinations(range(len(axes)), 2))
    outputs = fly(np.vstack([0.0 * axes[:1], axes, -axes, *(axes[i] + axes[j] for i, j in pairs)]))
    here, ahead, behind = outputs[0], outputs[1 : count + 1], outputs[count + 1 : 2 * count + 1]
    curvature = np.empty((outputs.shape[1], count, count))
    for k, change in enumerate((ahead - 2.0 * here + behind) / STEP**2):
        curvature[:, k, k] = change
    for (i, j), both in zip(pairs, outputs[2 * count + 1 :], strict=True):
        curvature[:, i, j] = curvature[:, j, i] = (both - ahead[i] - ahead[j] + here) / STEP**2
    return (ahead - behind).T / (2.0 * STEP), curvature


def axes_of(matrix: Array, least: float) -> Array:
    """Return axes in which a symmetric matrix, shape (n, n), has no product larger than ``least``, as columns.

    Jacobi's rotations, each in the plane of one product. Products that are smaller turn nothing, and equal squares are
    left as they are: axes depend smoothly on the matrix, so that they are the same on every machine.
    """
    matrix, axes = matrix.copy(), np.eye(len(matrix))
    for _ in range(SWEEPS):
        large = np.argwhere(np.triu(np.abs(matrix), 1) > least)
        if not len(large):
            break
        for i, j in large:
            if abs(matrix[i, j]) <= least:
                continue
            angle = 0.5 * np.arctan2(2.0 * matrix[i, j], matrix[i, i] - matrix[j, j])
            turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
            plane = [i, j]
            matrix[plane] = np.einsum("ba,bn->an", turn, matrix[plane])
            matrix[:, plane] = np.einsum("nb,ba->na", matrix[:, plane], turn)
            axes[:, plane] = np.einsum("nb,ba->na", axes[:, plane], turn)
    return axes
