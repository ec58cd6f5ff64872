"""Updates of LANES aided samples by sigma points (`mcnav.systems.ins.ensemble.sigma_points`), samples on trial.

The equations are those of the reference engine (`mcnav.systems.ins.reference.nonlinear_updates`).
"""

from __future__ import annotations

from mcnav.arrays.types import Array
from mcnav.compiled.blocks import THREE, Block, store_block
from mcnav.compiled.jit import allocation_free_part
from mcnav.compiled.vectors import PARTS, load, load_part, store
from mcnav.systems.ins.ensemble.filters import (
    Covariances,
    FilterSteps,
    factor_innovations,
    reduce_projected,
    store_root,
    whiten_projected,
)
from mcnav.systems.ins.ensemble.kept_samples import KeptSamples, keep_samples, take_back_samples
from mcnav.systems.ins.ensemble.sigma_points import (
    PointRooms,
    add_moments,
    average,
    factor_covariances,
    place_point,
)
from mcnav.systems.ins.ensemble.steps import Deviations
from mcnav.systems.ins.ensemble.updates import (
    Estimates,
    UpdateTables,
    feed_back_own,
    innovate,
    judge,
    whiten_by_own,
)


@allocation_free_part
def _project_points(m: int, filters: Covariances, points: PointRooms) -> None:
    """Compute the innovations' covariance and that with the states' errors, from the innovations of the points."""
    apart, count = points.apart, len(points.turn) // 2
    for t in range(PARTS):
        for c in range((m + 2) // THREE):
            for e in range(c + 1):
                zero = 0.0 * load_part(points.shift_parts, (0, t))
                nothing = (zero, zero, zero, zero, zero, zero, zero, zero, zero)
                own = add_moments(points.apart_parts, points.shift_parts, c, e, t, nothing)
                store_root(filters.root_parts, t, c, e, own)
    # -(e_j d_j^T) / 2 of a column and its negative
    for point in range(count):
        for c in range(apart.shape[1]):
            store(apart, (point, c), 0.5 * (load(apart, (point + count, c)) - load(apart, (point, c))))
    for t in range(PARTS):
        for r in range(filters.p.shape[1]):
            for c in range((m + 2) // THREE):
                store_block(filters.cross, (t, r, c), _cross_of_points(t, r, c, count, points))


@allocation_free_part
def _cross_of_points(t: int, r: int, c: int, count: int, points: PointRooms) -> Block:
    """Sum up the products of three rows of L and three of the innovations of its columns."""
    root, apart, zero = points.root_parts, points.apart_parts, 0.0 * load_part(points.shift_parts, (0, t))
    x = (zero, zero, zero, zero, zero, zero, zero, zero, zero)
    for j in range(min(count, THREE * (r + 1))):
        a, b, d = (
            load_part(root, (THREE * r, j, t)), load_part(root, (THREE * r + 1, j, t)),
            load_part(root, (THREE * r + 2, j, t)),
        )  # fmt: skip
        e, f, g = (
            load_part(apart, (j, THREE * c, t)), load_part(apart, (j, THREE * c + 1, t)),
            load_part(apart, (j, THREE * c + 2, t)),
        )  # fmt: skip
        x = (
            x[0] + a * e, x[1] + a * f, x[2] + a * g, x[3] + b * e, x[4] + b * f, x[5] + b * g, x[6] + d * e,
            x[7] + d * f, x[8] + d * g,
        )  # fmt: skip
    return x


@allocation_free_part
def update_by_points(
    u: int, m: int, constants: Array, of_filter: FilterSteps, updates: UpdateTables, samples: Deviations,
    own: Estimates, filters: Covariances, accepted: Array, whitened: Array, cause: Array, kept: KeptSamples,
    points: PointRooms,
) -> None:  # fmt: skip
    """Update samples by what their sigma points predict."""
    factor_covariances(filters, points)
    keep_samples(samples, own, kept)
    innovate(u, m, constants, updates, samples, filters.rows, own)
    for c in range(m):
        store(points.central, c, load(own.innovation, c))
    for point in range(len(points.turn)):
        place_point(point, of_filter.corrected, samples, own, points)
        innovate(u, m, constants, updates, samples, filters.rows, own)
        for c in range(points.apart.shape[1]):
            store(points.apart, (point, c), load(own.innovation, c) - load(points.central, c) if c < m else 0.0)
        take_back_samples(samples, own, kept)
    average(points.apart, points.shift)
    for c in range(m):
        store(own.innovation, c, load(points.central, c) + load(points.shift, c))
    _project_points(m, filters, points)
    factor_innovations(u, m, updates.of_filter.variances, samples.sound, cause, filters)
    whiten_by_own(m, filters.root, filters.inverse, own)
    judge(m, updates.limits[u], updates.lags[u], updates.sensors[u], own)
    for t in range(PARTS):
        whiten_projected(m, t, accepted, whitened, filters)
        reduce_projected(m, t, of_filter, filters)
    feed_back_own(filters.correction, of_filter.corrected, samples, own)
