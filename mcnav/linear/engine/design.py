"""A filter's gains and its own covariance along a timeline."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg.lapack import dposv

from mcnav.arrays.products import innovation_covariance, step, update
from mcnav.arrays.types import Array, IndexArray
from mcnav.contract.timeline import Start, Timeline, TimelineFilter, add_up_noise
from mcnav.execution.threads import one_thread
from mcnav.linear.engine.checks import check_gains, check_positions
from mcnav.linear.engine.transitions import bounds


@dataclass(frozen=True)
class Design:
    """A filter's gains for U updates, and its covariance at some positions, r of them.

    Attributes
    ----------
    gains, roots : ndarray, shapes (U, f, M), (U, M, M)
        K, and the Cholesky factor of S; zero before the start and after the last position.
    positions : ndarray of int, shape (r,)
    covariances : ndarray, shape (r, f, f)
        P there.
    """

    gains: Array
    roots: Array
    positions: IndexArray
    covariances: Array


def filter_of(timeline: Timeline) -> TimelineFilter:
    """Return the filter of a timeline; ValueError where there is none."""
    if timeline.filter is None:
        raise ValueError("timeline: has no filter")
    return timeline.filter


def design(
    timeline: Timeline, positions: ArrayLike = (), begin: int = 0, start: Start | None = None,
    gains: Array | None = None,
) -> Design:  # fmt: skip
    """Compute a filter's gains, and its covariance at positions, in any order.

    Parameters
    ----------
    begin : int
        Position of the start.
    start : Start, optional
        The start there, where it is not that of the timeline.
    gains : ndarray, shape (U, f, M), optional
        Gains that are held, whatever the filter's tuning; else they are computed.

    All are NaN from an update on whose innovation has no positive definite covariance.
    """
    wanted = check_positions(timeline, positions, begin)
    filtered = filter_of(timeline)
    check_gains(timeline, gains)
    held, (count, most, size) = gains is not None, filtered.responses.shape
    gains = np.zeros((count, size, most)) if gains is None else gains
    innovations, covariances = np.zeros((count, most, most)), np.zeros((len(wanted), size, size))
    measured = filtered.variances[:, :, None] * np.eye(most)
    given = None if start is None else start.filter_covariance
    covariance = filtered.covariance if given is None else given
    readings = {position: np.flatnonzero(wanted == position) for position in set(wanted.tolist())}
    sizes = np.zeros(0, np.int64) if timeline.updates is None else timeline.updates.sizes
    considers, u = not filtered.corrected.all(), int(timeline.updates_before[begin])
    with one_thread():
        for first, last in bounds(begin, timeline.end):
            steps = filtered.steps(*timeline.steps_before[[first, last]].tolist())
            noise = add_up_noise(steps.noise, filtered.sizes, len(steps.transitions), size)
            number = 0
            for position, is_update in enumerate(timeline.is_update[first:last].tolist(), first):
                if position in readings:
                    covariances[readings[position]] = covariance
                if not is_update:
                    covariance = step(covariance, steps.transitions[number], noise[number])
                    number += 1
                    continue
                m = int(sizes[u])
                response, gain = filtered.responses[u, :m], gains[u, :, :m]
                cross, innovation = innovation_covariance(covariance, response)
                innovation += measured[u, :m, :m]
                innovations[u, :m, :m] = innovation
                if not held:
                    _, solved, failed = dposv(innovation, cross, lower=1)
                    gain[:] = np.nan if failed else solved.T
                    if considers:
                        gain *= filtered.corrected[:, None]
                covariance = update(covariance, cross, gain, response, filtered.variances[u, :m])
                u += 1
    if timeline.end in readings:
        covariances[readings[timeline.end]] = covariance
    reached = np.where(np.arange(count) < timeline.updates_before[begin], 0, sizes)
    return Design(gains, _roots(innovations, reached), wanted, covariances)


def _roots(innovations: Array, sizes: IndexArray) -> Array:
    """Return the Cholesky factors of innovations' covariances, shape (U, M, M), zero beyond their sizes.

    They are NaN where a covariance is not positive definite.
    """
    beyond = np.arange(innovations.shape[1]) >= sizes[:, None]
    added = beyond[:, :, None] * np.eye(innovations.shape[1])
    try:
        return np.asarray(np.linalg.cholesky(innovations + added) - added)
    except np.linalg.LinAlgError:
        if len(innovations) == 1:
            return np.full(innovations.shape, np.nan)
        return np.concatenate([_roots(*one) for one in zip(innovations[:, None], sizes[:, None], strict=True)])


def is_definite(innovations: Array, sizes: IndexArray) -> bool:
    """Return whether all covariances of innovations, shape (U, M, M), are positive definite up to their sizes."""
    return bool(np.isfinite(_roots(innovations, sizes)).all())
