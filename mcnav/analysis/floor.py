"""The floor: the size below which a difference of two answers says nothing, and counts as agreement.

Two answers, by samples and by linear analysis, or of a truth and of its filter, agree in a sigma when their variances
differ by no more than the square of the floor. It is the largest of five sizes, of which each is a number that a
computer, or a campaign, cannot tell from zero:

- `INTEGRATED` of the scale on which the output's system changes, its `Output.limit`: a position on the earth is a
  difference of two vectors of 6.4e6 m, an attitude one of directions;
- `CANCELLED` of the largest term of the linear sum, and of its mean: terms that cancel leave their rounding;
- `SECOND_ORDER` of the mean error that errors of fixed value leave: what a dispersion changes of it is the dispersion
  times the error, and a share so small of an error is of no use to anybody;
- `REQUIRED` of the smallest limit that a requirement sets;
- `STORED` of the largest sigma beside it, for a covariance that a filter keeps: in doubles it has a small sigma beside
  a large one to the root of 2.2e-16, 1.5e-8, and updates add up. Sigmas in one unit are compared as they are, those in
  different units over the scales of their outputs.

A difference of 10 % in a sigma ten times the floor is a difference of 21 squares of the floor in the variance, and is
found.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav._types import Array

INTEGRATED: Final = 1e-12
"""Relative tolerance of the integrators."""

CANCELLED: Final = 1e-10
"""What is left of terms that cancel, as a share of the largest."""

SECOND_ORDER: Final = 1e-4
"""Share of a fixed error below which its dispersion is of second order: that of 600 m of position on the earth."""

REQUIRED: Final = 1e-6
"""Share of a required limit."""

STORED: Final = 2e-7
"""Share of the largest sigma beside it to which a filter's covariance holds a sigma: 13 roots of 2.2e-16.

Of 80 m of altitude alone, filters were measured to hold tilts from 9e-8 of 80 m over the earth's radius on.
"""

COMBINED: Final = 1e-3
"""Share of the sigmas of its terms below which the dispersion of a combination of outputs counts as none.

What depends on such a combination is an inverse of a singular covariance: it has no use that a thousandth of a sigma
would change.
"""


def cancelled(terms: Array, means: Array) -> Array:
    """Return the sigma that cancelling terms may leave in each output, shape (outputs,); see `agreement_floor`."""
    return np.asarray(CANCELLED * np.maximum(terms.max(axis=1, initial=0.0), np.abs(means)))


def agreement_floor(
    terms: Array, means: Array, fixed: Array, scales: Array | None = None, limits: Array | None = None
) -> Array:
    """Return the floor of each output for samples beside a linear model, shape (outputs,), SI.

    Parameters
    ----------
    terms : ndarray, shape (outputs, k)
        Sigmas that each source contributes.
    means : ndarray, shape (outputs,)
        Mean of the output, with what a flight without errors has.
    fixed : ndarray, shape (outputs,)
        Mean error that sources of fixed value leave.
    scales, limits : ndarray, shape (outputs,), optional
        `Output.limit`, and smallest limits of requirements; infinite without one.

    >>> agreement_floor(np.array([[3.0]]), np.zeros(1), np.zeros(1), np.array([6.4e6]))
    array([6.4e-06])
    """
    floor = np.maximum(cancelled(terms, means), SECOND_ORDER * np.abs(fixed))
    for share, sizes in ((INTEGRATED, scales), (REQUIRED, limits)):
        if sizes is not None:
            floor = np.maximum(floor, share * np.where(np.isfinite(sizes), sizes, 0.0))
    return np.asarray(floor)


def filter_floor(
    true: Array, own: Array, units: Sequence[str], floor: Array | None = None, scales: Array | None = None
) -> Array:
    """Return the floor of each output, or other state, of a filter: shape (outputs,), SI.

    Parameters
    ----------
    true, own : ndarray, shape (m, outputs)
        Sigmas of the errors, and those that the filter computes, over time; NaN where unknown.
    units : sequence of str
        SI units: those of one unit share a covariance.
    floor : ndarray, shape (outputs,), optional
        Of the outputs for samples; by default none.
    scales : ndarray, shape (outputs,), optional
        `Output.limit`, infinite without one.

    >>> filter_floor(np.array([[5.0, 1e-8, 1e-6]]), np.zeros((1, 3)), ("m", "m", "rad"))
    array([1.e-06, 1.e-06, 2.e-13])
    """
    largest = np.maximum(*(np.max(np.nan_to_num(each), axis=0, initial=0.0) for each in (true, own)))
    beside = np.array(
        [max(size for size, other in zip(largest, units, strict=True) if other == unit) for unit in units]
    )
    if scales is not None and np.isfinite(scales).any():
        share = float(np.max(largest / scales))
        beside = np.maximum(beside, share * np.where(np.isfinite(scales), scales, 0.0))
    return np.asarray(np.maximum(STORED * beside, 0.0 if floor is None else floor))


def negligible(true: Array, own: Array, floor: Array | float) -> NDArray[np.bool_]:
    """Return where a filter's sigma beside the true one says nothing: one is no more than the floor.

    The other is not either, or the variances differ by no more than the floor's square.

    >>> negligible(np.array([0.5, 1.1, 0.0, 11.0]), np.array([0.0, 0.9, 1.5, 10.0]), 1.0)
    array([ True,  True, False, False])
    """
    return np.asarray((np.minimum(true, own) <= floor) & (np.abs(true**2 - own**2) <= np.square(floor)))


def widened(tolerance: float, share: float) -> float:
    """Return the tolerance of a sigma ratio that the floor, squared over the expected variance, leaves.

    >>> widened(0.05, 0.0), widened(0.05, 0.01), round(widened(0.05, 0.5), 3)
    (0.05, 0.05, 0.293)
    """
    return float(max(tolerance, np.sqrt(1.0 + share) - 1.0, 1.0 - np.sqrt(max(1.0 - share, 0.0))))
