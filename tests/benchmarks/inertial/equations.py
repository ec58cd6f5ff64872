"""The strapdown equations of one reading, written once for scalars to be compiled and for arrays of any library.

The navigator is in earth-fixed axes (Groves 2013, section 5.3), with corrections for coning and sculling from the
reading before (Savage 1998) and gravity in the middle of the step.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

EARTH_RATE: Final = 7.292115e-5
MU: Final = 3.986004418e14
RADIUS: Final = 6_378_137.0
J2: Final = 1.082629821e-3
J4: Final = -2.37091e-6
"""World Geodetic System 1984."""


def reading_step(xp: Any) -> Callable[..., Any]:
    """Make the function of one reading for an array library, which may be numpy with scalars."""

    def step(state, sums, reading, last, dt):  # type: ignore[no-untyped-def]
        """Return state and sums after a reading.

        Parameters
        ----------
        state : tuple of ten
            Quaternion from body to earth-fixed axes, scalar first; velocity over the earth, position.
        sums : tuple of six
            Integral of the specific force in earth-fixed axes, and the integral of that.
        reading, last : tuple of six
            Increments of rotation and velocity, and those before.
        """
        a, b, c, d, u, v, w, x, y, z = state
        sp, sq, sr, tp, tq, tr = sums
        p, q, r, e, f, g = reading
        lp, lq, lr, lu, lv, lw = last
        half = 0.5 * EARTH_RATE * dt
        # velocity: half the rotation within the step, and sculling
        hp, hq, hr = 0.5 * p + lp / 12.0, 0.5 * q + lq / 12.0, 0.5 * r + lr / 12.0
        ex = e + hq * g - hr * f + (lv * r - lw * q) / 12.0
        fx = f + hr * e - hp * g + (lw * p - lu * r) / 12.0
        gx = g + hp * f - hq * e + (lu * q - lv * p) / 12.0
        ip, iq, ir = 2.0 * (c * gx - d * fx), 2.0 * (d * ex - b * gx), 2.0 * (b * fx - c * ex)
        ex, fx, gx = ex + a * ip + c * ir - d * iq, fx + a * iq + d * ip - b * ir, gx + a * ir + b * iq - c * ip
        ex, fx = ex + half * fx, fx - half * ex  # the earth turns by half a step on the average
        mx, my, mz = x + 0.5 * dt * u, y + 0.5 * dt * v, z + 0.5 * dt * w
        inverse = 1.0 / xp.sqrt(mx * mx + my * my + mz * mz)
        square = inverse * inverse
        s2, pull = mz * mz * square, -MU * square * inverse
        second, fourth = 1.5 * J2 * RADIUS * RADIUS * square, 0.625 * J4 * RADIUS**4 * square * square
        level = 1.0 + second * (1.0 - 5.0 * s2) - fourth * (3.0 + s2 * (63.0 * s2 - 42.0))
        polar = 1.0 + second * (3.0 - 5.0 * s2) - fourth * (15.0 + s2 * (63.0 * s2 - 70.0))
        outward = pull * level + EARTH_RATE * EARTH_RATE
        gravity_x, gravity_y, gravity_z = outward * mx, outward * my, pull * polar * mz
        mu, mv = u + 0.5 * (ex + gravity_x * dt), v + 0.5 * (fx + gravity_y * dt)  # in the middle, but for Coriolis
        nu = u + ex + (gravity_x + 2.0 * EARTH_RATE * mv) * dt
        nv = v + fx + (gravity_y - 2.0 * EARTH_RATE * mu) * dt
        nw = w + gx + gravity_z * dt
        nx, ny, nz = x + 0.5 * dt * (u + nu), y + 0.5 * dt * (v + nv), z + 0.5 * dt * (w + nw)
        # attitude: rotation vector with coning, its quaternion to fifth order
        rp, rq, rr = p + (lq * r - lr * q) / 12.0, q + (lr * p - lp * r) / 12.0, r + (lp * q - lq * p) / 12.0
        square = 0.25 * (rp * rp + rq * rq + rr * rr)
        scale = 0.5 - square * (1.0 / 12.0 - square / 240.0)
        ca, cb, cc, cd = 1.0 - square * (0.5 - square / 24.0), scale * rp, scale * rq, scale * rr
        na = a * ca - b * cb - c * cc - d * cd
        nb = a * cb + b * ca + c * cd - d * cc
        nc = a * cc - b * cd + c * ca + d * cb
        nd = a * cd + b * cc - c * cb + d * ca
        turned = (na + half * nd, nb + half * nc, nc - half * nb, nd - half * na)
        added = (
            sp + ex, sq + fx, sr + gx,
            tp + dt * (sp + 0.5 * ex), tq + dt * (sq + 0.5 * fx), tr + dt * (sr + 0.5 * gx),
        )  # fmt: skip
        return (*turned, nu, nv, nw, nx, ny, nz), added

    return step
