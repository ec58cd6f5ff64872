"""A filter's gains and its own covariance along a timeline."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mcnav._threads import one_thread
from mcnav._types import Array, IndexArray
from mcnav.contract.timeline import Start, Timeline, TimelineFilter
from mcnav.linear.engine.checks import check_gains, check_positions
from mcnav.linear.engine.transitions import bounds
from mcnav.products import innovation_covariance, step, update


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
    size, most = len(filtered.covariance), filtered.responses.shape[1]
    check_gains(timeline, gains)
    held, count = gains is not None, len(filtered.responses)
    gains = np.zeros((count, size, most)) if gains is None else gains
    roots, covariances = np.zeros((count, most, most)), np.zeros((len(wanted), size, size))
    given = None if start is None else start.filter_covariance
    covariance = filtered.covariance if given is None else given
    readings = {position: np.flatnonzero(wanted == position) for position in set(wanted.tolist())}
    with one_thread():
        for first, last in bounds(begin, timeline.end):
            steps = filtered.steps(*timeline.steps_before[[first, last]].tolist())
            number = 0
            for position in range(first, last):
                if position in readings:
                    covariances[readings[position]] = covariance
                if not timeline.is_update[position]:
                    covariance = step(covariance, steps.transitions[number], steps.noise[number])
                    number += 1
                    continue
                u = int(timeline.updates_before[position])
                covariance = _update(timeline, filtered, u, covariance, gains, roots, held)
    if timeline.end in readings:
        covariances[readings[timeline.end]] = covariance
    return Design(gains, roots, wanted, covariances)


def _update(
    timeline: Timeline, filtered: TimelineFilter, u: int, covariance: Array, gains: Array, roots: Array, held: bool
) -> Array:
    """Compute the covariance after an update, with its gain unless it is held."""
    assert timeline.updates is not None
    m = int(timeline.updates.sizes[u])
    response, variances = filtered.responses[u, :m], filtered.variances[u, :m]
    cross, innovations = innovation_covariance(covariance, response)
    innovations.flat[:: m + 1] += variances
    try:
        roots[u, :m, :m] = np.linalg.cholesky(innovations)
        solved = cross if held else np.linalg.solve(innovations, cross)
    except np.linalg.LinAlgError:
        roots[u, :m, :m], solved = np.nan, np.full_like(cross, np.nan)
    if not held:
        gains[u, :, :m] = solved.T * filtered.corrected[:, None]
    return update(covariance, gains[u, :, :m], response, variances)
