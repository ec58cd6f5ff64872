"""Navigation errors of LANES samples from their deviations in inertial axes: exact, not to first order.

Both the true and the indicated local state come from the same instructions, and differences of angles from their sines
and cosines, so that without deviations all errors are exactly zero: what computes them is not contracted.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from mcnav.arrays.types import Array
from mcnav.compiled.jit import allocation_free_part, allocation_free_uncontracted, inlined, uncontracted_subroutine
from mcnav.compiled.lanes import angle_of_half
from mcnav.compiled.vectors import Vector, load, room, store, where
from mcnav.systems.ins.earth import Earth, meridian_sides

LOCAL: Final = 8
"""Numbers of a local state: sine and cosine of the latitude and of the longitude in i, altitude, velocity in n."""


class TrueStates(NamedTuple):
    """The truth at m epochs.

    Attributes
    ----------
    states : ndarray, shape (m, 6)
        Inertial positions and velocities.
    local : ndarray, shape (m, LOCAL)
    radii : ndarray, shape (m, 2)
        Metres of a radian of latitude and of longitude.
    """

    states: Array
    local: Array
    radii: Array


@uncontracted_subroutine
def _locate(constants: Array, state: Array, x: Vector, y: Vector, z: Vector, velocity: Array, out: Array) -> None:
    """Compute the local states of deviations from an inertial position and velocity.

    Parameters
    ----------
    state : ndarray, shape (6,)
    velocity : ndarray, shape (3, LANES)
        Deviations.
    out : ndarray, shape (LOCAL, LANES)
    """
    # r + x, and the velocity over the earth in i, v - W x r
    x, y, z = state[0] + x, state[1] + y, state[2] + z
    u = (state[3] + load(velocity, 0)) + constants[3] * y
    v = (state[4] + load(velocity, 1)) - constants[3] * x
    w = state[5] + load(velocity, 2)
    # latitude from the meridian's normal, longitude from the position
    level = np.sqrt(x * x + y * y)
    up, side = meridian_sides(constants, level, z)
    scale = 1.0 / np.sqrt(up * up + side * side)
    sf, cf = up * scale, side * scale
    away = level > 0.0  # from the axis
    sl, cl = where(away, y / level, 0.0), where(away, x / level, 1.0)
    store(out, 0, sf)
    store(out, 1, cf)
    store(out, 2, sl)
    store(out, 3, cl)
    # altitude; velocity along north, east and down
    store(out, 4, level * cf + z * sf - constants[0] * np.sqrt(1.0 - constants[1] * sf * sf))
    outwards = u * cl + v * sl
    store(out, 5, w * cf - outwards * sf)
    store(out, 6, v * cl - u * sl)
    store(out, 7, -outwards * cf - w * sf)


@inlined
def _angle(sine: Vector, cosine: Vector) -> Vector:
    """Compute an angle from what its sine and cosine are in proportion to."""
    further = cosine + np.sqrt(cosine * cosine + sine * sine)  # the tangent of a half is sine / further
    return 2.0 * angle_of_half(sine / (further + np.sqrt(further * further + sine * sine)))


@uncontracted_subroutine
def read_errors(
    m: int, constants: Array, truth: TrueStates, turn: Array, deviations: Array, local: Array, axes: Array, out: Array
) -> None:
    """Compute the navigation errors at epoch m.

    Parameters
    ----------
    turn : ndarray, shape (4, LANES)
        Quaternions from true to indicated axes, in i.
    deviations : ndarray, shape (6, LANES)
        Of velocity and position.
    local, axes : ndarray, shapes (LOCAL, LANES), (9, LANES)
        Room.
    out : ndarray, shape (9, LANES)
        In the order of `mcnav.systems.ins.imu.instruments.OUTPUTS`.
    """
    _locate(
        constants, truth.states[m], load(deviations, 3), load(deviations, 4), load(deviations, 5), deviations, local
    )
    true = truth.local
    sf, cf, sl, cl = load(local, 0), load(local, 1), load(local, 2), load(local, 3)
    sf0, cf0, sl0, cl0 = true[m, 0], true[m, 1], true[m, 2], true[m, 3]
    # position: differences of angles by their sines and cosines, times the radii of curvature
    store(out, 0, truth.radii[m, 0] * _angle(sf * cf0 - cf * sf0, cf * cf0 + sf * sf0))
    store(out, 1, truth.radii[m, 1] * _angle(sl * cl0 - cl * sl0, cl * cl0 + sl * sl0))
    store(out, 2, true[m, 4] - load(local, 4))
    for i in range(3):
        store(out, 3 + i, load(local, 5 + i) - true[m, 5 + i])
    # the rotation applied to the true local axes
    a, b, c, d = load(turn, 0), load(turn, 1), load(turn, 2), load(turn, 3)
    for j in range(3):
        x = -sf0 * cl0 if j == 0 else (-sl0 if j == 1 else -cf0 * cl0)
        y = -sf0 * sl0 if j == 0 else (cl0 if j == 1 else -cf0 * sl0)
        z = cf0 if j == 0 else (0.0 if j == 1 else -sf0)
        p, q, r = 2.0 * (c * z - d * y), 2.0 * (d * x - b * z), 2.0 * (b * y - c * x)
        store(axes, j, x + (a * p + (c * r - d * q)))
        store(axes, 3 + j, y + (a * q + (d * p - b * r)))
        store(axes, 6 + j, z + (a * r + (b * q - c * p)))
    # along the indicated north, east and down
    nx, ny, nz = -sf * cl, -sf * sl, cf
    ex, ey = -sl, cl
    dx, dy, dz = -cf * cl, -cf * sl, -sf
    # rotation vector of the turn between both: skew part and trace of the matrix
    x = 0.5 * (
        (dx * load(axes, 1) + dy * load(axes, 4) + dz * load(axes, 7)) - (ex * load(axes, 2) + ey * load(axes, 5))
    )
    y = 0.5 * (
        (nx * load(axes, 2) + ny * load(axes, 5) + nz * load(axes, 8))
        - (dx * load(axes, 0) + dy * load(axes, 3) + dz * load(axes, 6))
    )
    z = 0.5 * (
        (ex * load(axes, 0) + ey * load(axes, 3)) - (nx * load(axes, 1) + ny * load(axes, 4) + nz * load(axes, 7))
    )
    trace = (nx * load(axes, 0) + ny * load(axes, 3) + nz * load(axes, 6)) + (
        (ex * load(axes, 1) + ey * load(axes, 4)) + (dx * load(axes, 2) + dy * load(axes, 5) + dz * load(axes, 8))
    )
    size = np.sqrt(x * x + y * y + z * z)
    factor = where(size > 0.0, _angle(size, 0.5 * (trace - 1.0)) / size, 1.0)
    store(out, 6, factor * x)
    store(out, 7, factor * y)
    store(out, 8, factor * z)


@allocation_free_part
def copy_rows(rows: Array, begin: int, size: int, reached: int, out: Array) -> None:
    """Copy rows of lanes, shape (r, LANES), to the samples' values at an epoch, shape (n, m, r)."""
    for i in range(size):
        for r in range(out.shape[2]):
            out[begin + i, reached, r] = rows[r, i]


@allocation_free_part
def copy_linear(linear: Array, begin: int, size: int, out: Array) -> None:
    """Copy linear errors, shape (9, LANES), to those of samples, shape (n, 9)."""
    for i in range(size):
        for r in range(9):
            out[begin + i, r] = linear[r, i]


@allocation_free_uncontracted
def _locate_truth(constants: Array, states: Array, nothing: Array, lanes: Array, out: Array) -> None:
    zero = load(nothing, 0)
    for m in range(len(states)):
        _locate(constants, states[m], zero, zero, zero, nothing, lanes)
        for r in range(LOCAL):
            out[m, r] = lanes[r, 0]


def true_states(earth: Earth, states: Array) -> TrueStates:
    """Compute what the errors at epochs are compared with.

    Parameters
    ----------
    states : ndarray, shape (m, 6)
        True inertial positions and velocities.
    """
    local = np.empty((len(states), LOCAL))
    _locate_truth(earth.constants, np.ascontiguousarray(states), room(3), room(LOCAL), local)
    meridian, prime = earth.curvature_radii(np.arctan2(local[:, 0], local[:, 1]))
    altitude = local[:, 4]
    return TrueStates(states, local, np.stack([meridian + altitude, (prime + altitude) * local[:, 1]], axis=1))
