"""Range of linear analysis: from when on an output is larger than the size at which it loses its meaning."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array

if TYPE_CHECKING:
    from mcnav.analysis.linear_covariance import LinearCovariance


@dataclass(frozen=True)
class BeyondRange:
    """The place where linear errors leave the range in which they mean anything.

    Attributes
    ----------
    outputs : tuple of int
        Those whose root mean square is beyond `Output.limit` at the first such reading.
    time : float or None
        Of this reading; none of a linear model at the end alone.
    """

    outputs: tuple[int, ...]
    time: float | None


def limits_of(limits: Iterable[float | None]) -> Array:
    """Return the limits of outputs, shape (outputs,); infinite without one."""
    return np.array([np.inf if limit is None else limit for limit in limits])


def outputs_beyond(limits: Array, mean: Array, sigma: Array) -> NDArray[np.bool_]:
    """Return which outputs are beyond their limits, shape (..., outputs), for means and sigmas of that shape."""
    return np.asarray(~(np.hypot(mean, sigma) <= limits))


def first_beyond(limits: Array, times: Array, mean: Array, sigma: Array) -> BeyondRange | None:
    """Find the first of some rising times at which an output is beyond its limit; none where all are within.

    Parameters
    ----------
    limits : ndarray, shape (outputs,)
    times : ndarray, shape (r,)
    mean, sigma : ndarray, shape (r, outputs)
    """
    beyond = outputs_beyond(limits, mean, sigma)
    if not beyond.any():
        return None
    reading = int(np.argmax(beyond.any(axis=1)))
    return BeyondRange(tuple(np.flatnonzero(beyond[reading]).tolist()), float(times[reading]))


def find_beyond(
    limits: Array, mean: Array, sigma: Array, over_time: tuple[Array, Array, Array] | None
) -> BeyondRange | None:
    """Find where errors leave the range of linear analysis: over time, else at the end.

    Parameters
    ----------
    mean, sigma : ndarray, shape (outputs,)
        Of the final errors.
    over_time : (ndarray, ndarray, ndarray) or None
        Times, means and sigmas as in `first_beyond`.
    """
    beyond = None if over_time is None else first_beyond(limits, *over_time)
    if beyond is not None:
        return beyond
    at_the_end = outputs_beyond(limits, mean, sigma)
    return BeyondRange(tuple(np.flatnonzero(at_the_end).tolist()), None) if at_the_end.any() else None


def readings_beyond(limits: Array, covariance: LinearCovariance, since: float | None) -> NDArray[np.bool_]:
    """Return at which readings linear errors have no meaning, shape (r,): from the first output beyond its limit on.

    The outputs share one linearization: once one is beyond its limit, later values of the others have no meaning.
    """
    late = np.zeros(len(covariance.readings.times), dtype=bool) if since is None else covariance.readings.times >= since
    beyond = outputs_beyond(limits, covariance.mean, covariance.sigma).any(axis=1)
    return np.asarray(late | np.logical_or.accumulate(beyond))


def picked(covariance: LinearCovariance, at: NDArray[np.bool_]) -> LinearCovariance:
    """Return the same at some of the readings."""
    return replace(
        covariance,
        readings=covariance.readings.at(at),
        mean=covariance.mean[at],
        covariance=covariance.covariance[at],
        sigma=covariance.sigma[at],
        sigma_filter=None if covariance.sigma_filter is None else covariance.sigma_filter[at],
        variances={name: values[at] for name, values in covariance.variances.items()},
        correlations=covariance.correlations[at],
        means={name: values[at] for name, values in covariance.means.items()},
        attributed={name: values[at] for name, values in covariance.attributed.items()},
    )
