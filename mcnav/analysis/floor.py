"""The floor: the size below which a difference of two answers says nothing, and counts as agreement.

Two answers, by samples and by linear analysis, or of a truth and of its filter, agree in a sigma when their variances
differ by no more than the square of the floor. It is the largest of what a computer cannot tell from zero and of what
nobody who uses the output could notice:

- `INTEGRATED` of the scale on which the output's system changes, its `Output.limit`: a position on the earth is a
  difference of two vectors of 6.4e6 m, an attitude one of directions;
- `CANCELLED` of the largest term of the linear sum, and of its mean: terms that cancel leave their rounding;
- `STORED` of the largest sigma beside it, for a covariance that a filter keeps. Sigmas in one unit are compared as they
  are, those in different units over the scales of their outputs. Angles count beside angles alone;
- `SIMULATED` of the sigmas of its terms, for a combination of outputs;
- `OWN_SIZE` of the error that sources of fixed value leave in the output: its own size, beside which its dispersion is
  nothing;
- `REQUIRED` of the smallest limit that a requirement sets.

A difference of 10 % in a sigma of ten floors is one of 21 squares of the floor in the variance, and is found.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array

INTEGRATED: Final = 1e-12
"""Relative tolerance of the integrators."""

CANCELLED: Final = 1e-10
"""What is left of terms that cancel, as a share of the largest."""

OWN_SIZE: Final = 1e-4
"""Share of an output's own size, the error that fixed sources leave, that nobody could notice: a practical rule.

A sigma so small changes the root mean square by 5e-9, and the error that one sample in a million exceeds, 4.9 sigmas
out, by 0.05 %: by less than the last of three digits.
"""

REQUIRED: Final = 1e-6
"""Share of a required limit that nobody could notice: of a limit of a kilometre it is a millimetre."""

CLEAR: Final = 10.0
"""Floors from which an output is judged together with others.

There the floor's square is a hundredth of the variance, and leaves a ratio of sigmas as it is but for 0.5 %, a tenth of
the usual tolerance. A mean is judged in sigmas there, and those that are next to nothing would decide it.
"""

SIMULATED: Final = 1e-6
"""Share of an output's sigma to which engines simulate it: two engines of one system differ by up to 9e-7 of it.

A combination of outputs that varies by less of the sigmas of its terms is rounding of what cancels.
"""

STATES: Final = 30
"""States of a filter of position, velocity, attitude and the biases, scale factors and misalignments of an IMU."""

STORED: Final = float(np.sqrt(6.0 * STATES * np.finfo(float).eps))
"""Share of the largest sigma beside it to which a filter's covariance holds a sigma: 2.0e-7.

Of a product of n x n matrices doubles leave n eps of the largest terms (Higham, *Accuracy and Stability of Numerical
Algorithms*, 2002, section 3.5). F P F^T and an update in Joseph's form, (1 - K H) P (1 - K H)^T + K R K^T, take six:
6 n eps of the largest variance. Filters were measured to hold tilts from 9e-8 of 80 m of altitude on.
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
    floor = np.maximum(cancelled(terms, means), OWN_SIZE * np.abs(fixed))
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
    array([9.99600281e-07, 9.99600281e-07, 1.99920056e-13])
    """
    largest = np.maximum(*(np.max(np.nan_to_num(each), axis=0, initial=0.0) for each in (true, own)))
    beside = np.array(
        [max(size for size, other in zip(largest, units, strict=True) if other == unit) for unit in units]
    )
    if scales is not None and np.isfinite(scales).any():
        # an attitude error becomes a position error with time, and is in the position's own sigma then
        spreading = np.array([unit != "rad" for unit in units])
        share = float(np.max(largest[spreading] / scales[spreading], initial=0.0))
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
