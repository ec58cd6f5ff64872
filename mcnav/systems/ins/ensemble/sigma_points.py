"""Sigma points of the filters of LANES aided samples: they take the samples' steps, and see their measurements.

A sigma point is a sample with the same errors of the instruments, at another state and with other estimates: the
kernels of the samples take it over a step, and predict its measurements. The equations are those of the reference
engine (`mcnav.systems.ins.reference.nonlinear_updates`), in inertial axes. Points begin where updates or epochs end,
with the covariance P, and end at the next of these; between them ``filters.p`` is what process noise has added.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any, Final, NamedTuple

import numpy as np
from numba import typeof
from numpy.typing import NDArray

from mcnav.arrays.types import Array
from mcnav.compiled.blocks import THREE, Block, count_threes, load_block, scale, store_block, store_symmetric
from mcnav.compiled.jit import allocation_free_by_address, allocation_free_part
from mcnav.compiled.numba_private import ADDRESSES, address_of, call_by_address, has
from mcnav.compiled.vectors import (
    PARTS,
    Rooms,
    load,
    load_part,
    parts_of,
    room,
    store,
    where,
)
from mcnav.systems.ins.ensemble.estimate_steps import EstimateSteps, subtract_estimates
from mcnav.systems.ins.ensemble.filters import (
    Covariances,
    covariances_in_lanes,
    room_for,
)
from mcnav.systems.ins.ensemble.kept_samples import KeptSamples, keep_samples, take_back_samples
from mcnav.systems.ins.ensemble.steps import (
    SHORT,
    DeviationParts,
    Deviations,
    StepTables,
    advance,
    advance_short,
    deviations_of,
    multiply_turns,
    parts_of_deviations,
    start,
)
from mcnav.systems.ins.ensemble.updates import (
    Estimates,
    feed_back_own,
)
from mcnav.systems.ins.filter.model import NAVIGATION, SINGULAR, UKF
from mcnav.systems.ins.sensors.innovation import rotation_vectors


class PointRooms(NamedTuple):
    """Sigma points of LANES filters, and room for what they do; the last axis is the lanes, or those of a part.

    With n blocks a row of the covariance, 3 n states are at work; points belong to the 9 + q that there are.

    Attributes
    ----------
    root : ndarray, shape (3 n, 3 n, LANES)
        L with ``P = L L^T``.
    turn, moved, others : ndarray, shapes (2 (9 + q), 4, LANES), (2 (9 + q), 6, LANES), (2 (9 + q), q, LANES)
        Points on their way; of the estimates, what they have besides the samples'.
    errors : ndarray, shape (2 (9 + q), 3 n, LANES)
        Errors of the samples' states at the points.
    apart : ndarray, shape (2 (9 + q), 3 C, LANES)
        Innovations of the points less those of the samples.
    error, mean : ndarray, shape (3 n, LANES)
        Error of one point, and the mean of all.
    central, shift : ndarray, shape (3 C, LANES)
        Innovations of the samples, and the mean of `apart`.
    estimate, rotation, sound : ndarray, shapes (q, LANES), (3, LANES), (1, LANES)
        Of one point; whether all have been sound.
    travelling : Deviations
        One point over a step.
    root_parts, errors_parts, apart_parts, mean_parts, shift_parts, travelling_parts
        The same memory, by parts.
    """

    root: Array
    turn: Array
    moved: Array
    others: Array
    errors: Array
    apart: Array
    error: Array
    mean: Array
    central: Array
    shift: Array
    estimate: Array
    rotation: Array
    sound: Array
    travelling: Deviations
    root_parts: Array
    errors_parts: Array
    apart_parts: Array
    mean_parts: Array
    shift_parts: Array
    travelling_parts: DeviationParts


def point_rooms(states: int, most: int, wanted: bool, keep: Rooms) -> PointRooms:
    """Return room for the points of filters with a number of states besides those of navigation, if it is wanted.

    Parameters
    ----------
    most : int
        Components of the largest measurement.
    keep : callable
        Makes the rooms that outlast a step.
    """
    q, points, size = states * wanted, count_points(states) * wanted, room_for(most) * wanted
    rows = THREE * (THREE + count_threes(states)) * wanted
    root, errors, apart, mean, shift = (
        room(rows, rows), room(points, rows), room(points, size), room(rows), room(size),
    )  # fmt: skip
    travelling = deviations_of(0, 0)
    return PointRooms(
        root, keep(points, 4), keep(points, 6), keep(points, q), errors, apart, room(rows), mean, room(size), shift,
        room(q), room(THREE), room(1), travelling, parts_of(root), parts_of(errors), parts_of(apart), parts_of(mean),
        parts_of(shift), parts_of_deviations(travelling),
    )  # fmt: skip


def count_points(states: int) -> int:
    """Return how many points a filter with a number of states besides those of navigation has."""
    return 2 * (NAVIGATION + states)


@allocation_free_part
def factor_covariances(filters: Covariances, points: PointRooms) -> None:
    """Compute the Cholesky factors of the covariances; a state whose own share is rounding has a column of zeros."""
    root = points.root
    covariances_in_lanes(filters, points.root_parts)
    for c in range(len(root)):
        variance = load(root, (c, c))
        own = variance
        for j in range(c):
            own -= load(root, (c, j)) * load(root, (c, j))
        good = own > SINGULAR * variance
        inverse = where(good, 1.0 / np.sqrt(where(good, own, 1.0)), 0.0)
        store(root, (c, c), where(good, own, 0.0) * inverse)
        for r in range(c + 1, len(root)):
            x = load(root, (r, c))
            for j in range(c):
                x -= load(root, (r, j)) * load(root, (c, j))
            store(root, (r, c), x * inverse)


@allocation_free_part
def place_point(point: int, corrected: Array, samples: Deviations, own: Estimates, points: PointRooms) -> None:
    """Correct samples by the error of a point: the columns of L, then their negatives."""
    count = len(points.turn) // 2
    column, sign = point % count, 1.0 if point < count else -1.0
    for r in range(len(points.error)):
        store(points.error, r, sign * load(points.root, (r, column)))
    feed_back_own(points.error, corrected, samples, own)


@allocation_free_part
def draw_points(
    corrected: Array, samples: Deviations, own: Estimates, filters: Covariances, kept: KeptSamples, points: PointRooms
) -> None:
    """Place the points about the samples, which are as before, and let the covariances be zero."""
    factor_covariances(filters, points)
    keep_samples(samples, own, kept)
    store(points.sound, 0, load(kept.sound, 0))
    for point in range(len(points.turn)):
        place_point(point, corrected, samples, own, points)
        for r in range(4):
            store(points.turn, (point, r), load(samples.turn, r))
        for r in range(6):
            store(points.moved, (point, r), load(samples.moved, r))
        for s in range(len(own.estimate)):
            store(points.others, (point, s), load(points.error, NAVIGATION + s))
        store(points.sound, 0, where(load(samples.sound, 0) > 0.0, load(points.sound, 0), 0.0))
        take_back_samples(samples, own, kept)
    store(samples.sound, 0, load(points.sound, 0))
    for t in range(PARTS):
        for r in range(filters.p.shape[1]):
            for c in range(r + 1):
                store_block(filters.p, (t, r, c), scale(load_block(filters.p, (t, r, c)), 0.0))


@allocation_free_part
def advance_points(
    k: int, steps: StepTables, estimated: EstimateSteps, samples: Deviations, points: PointRooms
) -> None:
    """Take the points over step k, with the samples' response to the errors of the instruments less their own."""
    travelling = points.travelling
    store(travelling.sound, 0, load(samples.sound, 0))
    for point in range(len(points.turn)):
        for r in range(4):
            store(travelling.turn, r, load(points.turn, (point, r)))
        for r in range(6):
            store(travelling.moved, r, load(points.moved, (point, r)))
        for r in range(9):
            store(travelling.response, r, load(samples.response, r))
        for s in range(len(points.estimate)):
            store(points.estimate, s, load(points.others, (point, s)))
        subtract_estimates(k, estimated, travelling.response, points.estimate)
        if steps.durations[k] <= SHORT:
            advance_short(k, steps, travelling, points.travelling_parts, False)
        else:
            start(k, steps, travelling)
            advance(k, steps, travelling)
        for r in range(4):
            store(points.turn, (point, r), load(travelling.turn, r))
        for r in range(6):
            store(points.moved, (point, r), load(travelling.moved, r))
        for s in range(len(points.estimate)):
            store(points.others, (point, s), load(points.estimate, s))
    store(samples.sound, 0, load(travelling.sound, 0))


@allocation_free_part
def _add_outer(x: Block, rows: Array, point: int, r: int, c: int, t: int) -> Block:
    """Add the product of three rows of a point and three others."""
    a, b, d = (
        load_part(rows, (point, THREE * r, t)), load_part(rows, (point, THREE * r + 1, t)),
        load_part(rows, (point, THREE * r + 2, t)),
    )  # fmt: skip
    e, f, g = (
        load_part(rows, (point, THREE * c, t)), load_part(rows, (point, THREE * c + 1, t)),
        load_part(rows, (point, THREE * c + 2, t)),
    )  # fmt: skip
    return (
        x[0] + a * e, x[1] + a * f, x[2] + a * g, x[3] + b * e, x[4] + b * f, x[5] + b * g, x[6] + d * e,
        x[7] + d * f, x[8] + d * g,
    )  # fmt: skip


@allocation_free_part
def add_moments(rows: Array, mean: Array, r: int, c: int, t: int, x: Block) -> Block:
    """Add to X half of the sum of the products of points' rows, shape (points, rows, PARTS, PART), and ``m m^T``."""
    zero = 0.0 * load_part(mean, (0, t))
    y = (zero, zero, zero, zero, zero, zero, zero, zero, zero)
    for point in range(len(rows)):
        y = _add_outer(y, rows, point, r, c, t)
    a, b, d = load_part(mean, (THREE * r, t)), load_part(mean, (THREE * r + 1, t)), load_part(mean, (THREE * r + 2, t))
    e, f, g = load_part(mean, (THREE * c, t)), load_part(mean, (THREE * c + 1, t)), load_part(mean, (THREE * c + 2, t))
    return (
        x[0] + (0.5 * y[0] + a * e), x[1] + (0.5 * y[1] + a * f), x[2] + (0.5 * y[2] + a * g),
        x[3] + (0.5 * y[3] + b * e), x[4] + (0.5 * y[4] + b * f), x[5] + (0.5 * y[5] + b * g),
        x[6] + (0.5 * y[6] + d * e), x[7] + (0.5 * y[7] + d * f), x[8] + (0.5 * y[8] + d * g),
    )  # fmt: skip


@allocation_free_part
def average(rows: Array, mean: Array) -> None:
    """Compute half of the sum over points of their rows, shape (points, rows, LANES)."""
    for r in range(len(mean)):
        total = 0.0 * load(rows, (0, r))
        for point in range(len(rows)):
            total += load(rows, (point, r))
        store(mean, r, 0.5 * total)


@allocation_free_part
def gather_points(samples: Deviations, filters: Covariances, points: PointRooms) -> None:
    """Add to the covariances the moments of the samples' errors at the points."""
    turn, moved, travelling = samples.turn, samples.moved, points.travelling
    for point in range(len(points.turn)):
        w, x, y, z = multiply_turns(
            load(turn, 0), load(turn, 1), load(turn, 2), load(turn, 3), load(points.turn, (point, 0)),
            -load(points.turn, (point, 1)), -load(points.turn, (point, 2)), -load(points.turn, (point, 3)),
        )  # fmt: skip
        store(travelling.turn, 0, w)
        store(travelling.turn, 1, x)
        store(travelling.turn, 2, y)
        store(travelling.turn, 3, z)
        rotation_vectors(travelling.turn, points.rotation)
        for r in range(THREE):
            store(points.errors, (point, r), load(points.rotation, r))
        for r in range(6):
            store(points.errors, (point, THREE + r), load(moved, r) - load(points.moved, (point, r)))
        for s in range(points.others.shape[1]):
            store(points.errors, (point, NAVIGATION + s), load(points.others, (point, s)))
    average(points.errors, points.mean)
    for t in range(PARTS):
        for r in range(filters.p.shape[1]):
            for c in range(r + 1):
                added = load_block(filters.p, (t, r, c))
                added = add_moments(points.errors_parts, points.mean_parts, r, c, t, added)
                store_symmetric(filters.p, t, r, c, added)


def take_points(
    k: int, ends: bool, stops: NDArray[np.bool_], steps: StepTables, estimated: EstimateSteps, samples: Deviations,
    own: Estimates, filters: Covariances, kept: KeptSamples, points: PointRooms,
) -> int:  # fmt: skip
    """Take the points over step k, or gather them as it ends, and return k."""
    if ends:
        if stops[k + 1]:
            gather_points(samples, filters, points)
    else:
        if stops[k]:
            draw_points(estimated.corrected, samples, own, filters, kept, points)
        advance_points(k, steps, estimated, samples, points)
    return k


def _call_by_number() -> Any:
    """Return compiled `take_points` with a number before its arguments."""
    take = allocation_free_part(take_points)

    @allocation_free_part
    def call(
        number: int, k: int, ends: bool, stops: NDArray[np.bool_], steps: StepTables, estimated: EstimateSteps,
        samples: Deviations, own: Estimates, filters: Covariances, kept: KeptSamples, points: PointRooms,
    ) -> int:  # fmt: skip
        return take(k, ends, stops, steps, estimated, samples, own, filters, kept, points)

    return call


POINTS: Final[Any] = call_by_address() if has(ADDRESSES) else _call_by_number()
"""Function `take_points`, called with the number that `points_of` returns and its own arguments."""


def points_of(kind: str, given: tuple[Any, ...]) -> int:
    """Return what tells `POINTS`, in this process, where the code of points is; zero for filters without.

    Parameters
    ----------
    given : tuple
        Arguments of `take_points`.
    """
    if kind != UKF:
        return 0
    return address_of(_compiled(), tuple(map(typeof, given))) if has(ADDRESSES) else 1


@cache
def _compiled() -> Callable[..., int]:
    """Return the compiled function, which must last as long as its address is used."""
    return allocation_free_by_address(take_points)
