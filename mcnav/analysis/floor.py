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
- `STORED` of the largest sigma of the outputs in the same unit, for a covariance that a filter keeps: in doubles it has
  a small sigma beside a large one to the root of 2.2e-16, 1.5e-8, and updates add up.

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

STORED: Final = 1e-7
"""Share of the largest sigma beside it to which a filter's covariance holds a sigma: seven roots of 2.2e-16."""

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


def filter_floor(true: Array, own: Array, units: Sequence[str], floor: Array | None = None) -> Array:
    """Return the floor of each output, or other state, of a filter: shape (outputs,), SI.

    Parameters
    ----------
    true, own : ndarray, shape (m, outputs)
        Sigmas of the errors, and those that the filter computes, over time; NaN where unknown.
    units : sequence of str
        SI units: those of one unit share a covariance.
    floor : ndarray, shape (outputs,), optional
        Of the outputs for samples; by default none.

    >>> filter_floor(np.array([[5.0, 1e-8, 1e-6]]), np.zeros((1, 3)), ("m", "m", "rad"))
    array([5.e-07, 5.e-07, 1.e-13])
    """
    largest = np.maximum(*(np.max(np.nan_to_num(each), axis=0, initial=0.0) for each in (true, own)))
    beside = [max(size for size, other in zip(largest, units, strict=True) if other == unit) for unit in units]
    return np.asarray(np.maximum(STORED * np.array(beside), 0.0 if floor is None else floor))


def within_floor(one: Array, other: Array, floor: Array) -> NDArray[np.bool_]:
    """Return where two sigmas agree to the floor: their variances differ by no more than its square."""
    return np.asarray(np.abs(one**2 - other**2) <= floor**2)


def widened(tolerance: float, share: float) -> float:
    """Return the tolerance of a sigma ratio that the floor, squared over the expected variance, leaves.

    >>> widened(0.05, 0.0), widened(0.05, 0.01), round(widened(0.05, 0.5), 3)
    (0.05, 0.05, 0.293)
    """
    return float(max(tolerance, np.sqrt(1.0 + share) - 1.0, 1.0 - np.sqrt(max(1.0 - share, 0.0))))
