"""Definitions of the error of attitude, velocity and position, which differ only where a filter corrects a navigator.

Indicated attitude, velocity and position X^ = (C^, v^, r^) and true ones X are elements of the group SE_2(3)
(`mcnav.numerics.extended_poses`), in earth-fixed axes. The errors are (Barrau and Bonnabel 2017, *The invariant
extended Kalman filter as a stable observer*)::

    ekf               C^ = exp(psi x) C     dv = v^ - v     dr = r^ - r
    left-invariant    X^ = X exp(z)         z = C^T (psi, dv, dr) to first order
    right-invariant   X^ = exp(x) X         x = (psi, dv - psi x (v^ - v_0), dr - psi x (r^ - r_0)) to first order

Another origin (v_0, r_0) of the group changes a right-invariant error by a constant matrix, and the filter not at all.
At an estimate each is an invertible matrix times (psi, dv, dr), the identity with the origin there (of the left one a
rotation), so that gains agree; and between updates the covariances are those of one linear system along the indicated
trajectory. What differs:

1. The correction c = (a, b, d) of invariant errors is by the exponential of the group, with its left Jacobian J::

       C^ <- exp(-a x) C^        v^ <- v^ - J(-a) b        r^ <- r^ - J(-a) d

2. The covariance is one of errors about the *corrected* estimate. That of an invariant error does not change as the
   estimate does, and in psi, dv, dr it becomes, with the velocity and position that were taken away, v and r::

       ekf               P
       left-invariant    D P D^T, D = exp(-a x) of each of psi, dv, dr
       right-invariant   D P D^T, D = [I | v x, I | r x, 0, I], so that dv and dr swing with psi about the correction

An error-state filter takes the second to be of no account: it is of second order, correction times attitude error.
"""

from __future__ import annotations

import numpy as np

from mcnav.arrays.types import Array
from mcnav.numerics.extended_poses import exponential
from mcnav.systems.ins.filter.model import LEFT, RIGHT
from mcnav.systems.ins.reference.axes import ATTITUDE, POSITION, VELOCITY, cross_matrix


def retracted(kind: str, change: Array) -> Array:
    """Return a correction of the filter's states, shape (9 + q,), as the group's exponential has it."""
    if kind not in (LEFT, RIGHT):
        return change
    turn, jacobian = np.empty((3, 3)), np.empty((3, 3))
    exponential(-change[ATTITUDE], turn, jacobian)
    result = change.copy()
    for part in (VELOCITY, POSITION):
        result[part] = jacobian @ change[part]
    return result


def carried_over(kind: str, covariance: Array, change: Array) -> Array:
    """Return a covariance, shape (9 + q, 9 + q), about the estimate from which a change was taken away."""
    if kind not in (LEFT, RIGHT):
        return covariance
    carried = np.eye(len(covariance))
    if kind == RIGHT:
        for part in (VELOCITY, POSITION):
            carried[part, ATTITUDE] = cross_matrix(change[part])
    else:
        turn, jacobian = np.empty((3, 3)), np.empty((3, 3))
        exponential(-change[ATTITUDE], turn, jacobian)
        for part in (ATTITUDE, VELOCITY, POSITION):
            carried[part, part] = turn
    return np.asarray(carried @ covariance @ carried.T)
