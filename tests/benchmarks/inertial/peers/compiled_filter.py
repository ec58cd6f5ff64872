"""The navigator and its filter written out by hand, as one writes them to be compiled: all functions take scalars.

State errors are indicated less true, in earth-fixed axes: rotation psi, velocity, position, and the biases that are
left of gyros and accelerometers. Along the indicated trajectory (Groves 2013, section 14.2)::

    psi' = C dw - W x psi,   dv' = psi x f + C da - 2 W x dv + G dr,   dr' = dv

Positions and velocities are measured with the same noise along all axes, so that every component is one of the state in
earth-fixed axes, and updates are a sequence of scalar ones.
"""

from __future__ import annotations

from typing import Final

import numba
import numpy as np

from tests.benchmarks.inertial.equations import EARTH_RATE, MU, reading_step

STATES: Final = 15

compiled = numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
inlined = numba.njit(cache=True, nogil=True, error_model="numpy", fastmath=True, inline="always")

read = inlined(reading_step(np))


@inlined
def matrix(a, b, c, d, axes):  # type: ignore[no-untyped-def]
    """Fill the matrix of a quaternion, scalar first."""
    axes[0, 0], axes[0, 1], axes[0, 2] = 1.0 - 2.0 * (c * c + d * d), 2.0 * (b * c - a * d), 2.0 * (b * d + a * c)
    axes[1, 0], axes[1, 1], axes[1, 2] = 2.0 * (b * c + a * d), 1.0 - 2.0 * (b * b + d * d), 2.0 * (c * d - a * b)
    axes[2, 0], axes[2, 1], axes[2, 2] = 2.0 * (b * d - a * c), 2.0 * (c * d + a * b), 1.0 - 2.0 * (b * b + c * c)


@compiled
def strapdown(state, biases, last, dt, readings, noise, first, steps, sums, axes):  # type: ignore[no-untyped-def]
    """Integrate readings over some steps.

    Parameters
    ----------
    state : ndarray, shape (10,)
        Quaternion from body to earth-fixed axes, velocity, position.
    biases : ndarray, shape (6,)
        True less estimated biases of gyros and accelerometers, times ``dt``.
    last : ndarray, shape (6,)
        Reading before.
    readings : ndarray, shape (K, 6)
        Increments of rotation and velocity of perfect instruments.
    noise : ndarray, shape (steps, 6)
        What noise adds to these increments.
    sums : ndarray, shape (6,)
        Receives the integral of the specific force in earth-fixed axes, and the integral of that.
    axes : ndarray, shape (3, 3)
        Receives the axes in the middle.
    """
    now = (state[0], state[1], state[2], state[3], state[4], state[5], state[6], state[7], state[8], state[9])
    before = (last[0], last[1], last[2], last[3], last[4], last[5])
    added = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for k in range(steps):
        reading = (
            readings[first + k, 0] + biases[0] + noise[k, 0],
            readings[first + k, 1] + biases[1] + noise[k, 1],
            readings[first + k, 2] + biases[2] + noise[k, 2],
            readings[first + k, 3] + biases[3] + noise[k, 3],
            readings[first + k, 4] + biases[4] + noise[k, 4],
            readings[first + k, 5] + biases[5] + noise[k, 5],
        )
        now, added = read(now, added, reading, before, dt)
        before = reading
        if 2 * k + 1 == steps or 2 * k + 2 == steps:
            matrix(now[0], now[1], now[2], now[3], axes)
    a, b, c, d = now[0], now[1], now[2], now[3]
    scale = 1.0 / np.sqrt(a * a + b * b + c * c + d * d)
    state[0], state[1], state[2], state[3] = a * scale, b * scale, c * scale, d * scale
    for r in range(6):
        state[4 + r], last[r], sums[r] = now[4 + r], before[r], added[r]


@compiled
def transition(state, duration, sums, axes, phi):  # type: ignore[no-untyped-def]
    """Fill rows of velocity, position and attitude of the transition matrix, shape (9, 15): second order.

    States: psi, velocity, position, gyro biases, accelerometer biases.
    """
    t, rate = duration, EARTH_RATE
    x, y, z = state[7], state[8], state[9]
    inverse = 1.0 / np.sqrt(x * x + y * y + z * z)
    pull = MU * inverse * inverse * inverse
    x, y, z = x * inverse, y * inverse, z * inverse
    phi[:] = 0.0
    phi[0, 0] = phi[1, 1] = phi[2, 2] = 1.0
    phi[0, 1], phi[1, 0] = rate * t, -rate * t
    for block, weight in ((0, 0), (3, 3)):  # -[s x] psi of the integrals of force
        row, first = 3 + block, weight
        phi[row, 1], phi[row, 2] = sums[first + 2], -sums[first + 1]
        phi[row + 1, 0], phi[row + 1, 2] = -sums[first + 2], sums[first]
        phi[row + 2, 0], phi[row + 2, 1] = sums[first + 1], -sums[first]
    gradient = np.empty((3, 3))
    gradient[0, 0], gradient[0, 1], gradient[0, 2] = 3.0 * x * x - 1.0, 3.0 * x * y, 3.0 * x * z
    gradient[1, 0], gradient[1, 1], gradient[1, 2] = 3.0 * x * y, 3.0 * y * y - 1.0, 3.0 * y * z
    gradient[2, 0], gradient[2, 1], gradient[2, 2] = 3.0 * x * z, 3.0 * y * z, 3.0 * z * z - 1.0
    for r in range(3):
        for c in range(3):
            g = pull * gradient[r, c]
            if r == c and r < 2:
                g += rate * rate
            phi[3 + r, 6 + c] = g * t
            phi[3 + r, 3 + c] = 0.5 * g * t * t
            phi[6 + r, 6 + c] = 0.5 * g * t * t
        phi[3 + r, 3 + r] += 1.0
        phi[6 + r, 6 + r] += 1.0
        phi[6 + r, 3 + r] = t
    phi[3, 4] += 2.0 * rate * t
    phi[4, 3] -= 2.0 * rate * t
    phi[6, 4] += rate * t * t
    phi[7, 3] -= rate * t * t
    for c in range(3):
        e, f, g = axes[0, c], axes[1, c], axes[2, c]
        phi[0, 9 + c], phi[1, 9 + c], phi[2, 9 + c] = e * t, f * t, g * t
        # a drift turns the force for half, and displaces for a sixth of the time squared
        for row, first, share in ((3, 0, 0.5 * t), (6, 3, t / 3.0)):
            phi[row, 9 + c] = share * (sums[first + 2] * f - sums[first + 1] * g)
            phi[row + 1, 9 + c] = share * (sums[first] * g - sums[first + 2] * e)
            phi[row + 2, 9 + c] = share * (sums[first + 1] * e - sums[first] * f)
        phi[3, 12 + c], phi[4, 12 + c], phi[5, 12 + c] = e * t, f * t, g * t
        phi[6, 12 + c], phi[7, 12 + c], phi[8, 12 + c] = 0.5 * e * t * t, 0.5 * f * t * t, 0.5 * g * t * t


@compiled
def noise_of_step(duration, sums, gyro, accelerometer, q):  # type: ignore[no-untyped-def]
    """Fill the covariance, shape (9, 9), that white noise of two densities (variances per second) adds in a step."""
    t = duration
    sx, sy, sz = sums[0] / t, sums[1] / t, sums[2] / t
    square = sx * sx + sy * sy + sz * sz
    q[:] = 0.0
    for r in range(3):
        q[r, r] = gyro * t
        q[3 + r, 3 + r] = accelerometer * t + gyro * square * t * t * t / 3.0
        q[6 + r, 6 + r] = accelerometer * t * t * t / 3.0 + gyro * square * t**5 / 20.0
        q[3 + r, 6 + r] = accelerometer * t * t / 2.0 + gyro * square * t**4 / 8.0
        for c in range(3):
            force = (sx, sy, sz)[r] * (sx, sy, sz)[c]
            q[3 + r, 3 + c] -= gyro * force * t * t * t / 3.0
            q[6 + r, 6 + c] -= gyro * force * t**5 / 20.0
            q[3 + r, 6 + c] -= gyro * force * t**4 / 8.0
    for first, share in ((3, gyro * t * t / 2.0), (6, gyro * t * t * t / 6.0)):  # -[s x] of psi's own noise
        q[first, 1], q[first, 2] = share * sz, -share * sy
        q[first + 1, 0], q[first + 1, 2] = -share * sz, share * sx
        q[first + 2, 0], q[first + 2, 1] = share * sy, -share * sx
    for r in range(9):
        for c in range(r):
            if r < 6 or c < 3:
                q[c, r] = q[r, c]
            elif c < 6:
                q[r, c] = q[c, r]


@compiled
def predict(p, phi, q, product):  # type: ignore[no-untyped-def]
    """Propagate the covariance: biases are constant, and rows of attitude depend on attitude and gyros alone."""
    for r in range(9):
        for c in range(STATES):
            product[r, c] = 0.0
        if r < 3:
            for k in (0, 1, 2, 9, 10, 11):
                weight = phi[r, k]
                for c in range(STATES):
                    product[r, c] += weight * p[k, c]
        else:
            for k in range(STATES):
                weight = phi[r, k]
                for c in range(STATES):
                    product[r, c] += weight * p[k, c]
    for r in range(9):
        for c in range(r + 1):
            total = q[r, c]
            for k in range(STATES):
                total += product[r, k] * phi[c, k]
            p[r, c] = p[c, r] = total
        for c in range(9, STATES):
            p[r, c] = p[c, r] = product[r, c]


@compiled
def update(p, innovation, variances, correction, gain):  # type: ignore[no-untyped-def]
    """Take six scalar measurements, of position and velocity, one after the other; the correction adds up."""
    correction[:] = 0.0
    for m in range(6):
        j = 6 + m if m < 3 else m
        scale = 1.0 / (p[j, j] + variances[m])
        left = innovation[m] - correction[j]
        for r in range(STATES):
            gain[r] = p[j, r]
            correction[r] += scale * left * gain[r]
        for r in range(STATES):
            weight = scale * gain[r]
            for c in range(STATES):
                p[r, c] -= weight * gain[c]


@compiled
def feed_back(state, biases, correction, dt):  # type: ignore[no-untyped-def]
    """Correct the navigator by the filter's estimates."""
    b, c, d = -0.5 * correction[0], -0.5 * correction[1], -0.5 * correction[2]
    square = b * b + c * c + d * d
    a = 1.0 - 0.5 * square
    e, f, g, h = state[0], state[1], state[2], state[3]
    state[0] = a * e - b * f - c * g - d * h
    state[1] = a * f + b * e + c * h - d * g
    state[2] = a * g - b * h + c * e + d * f
    state[3] = a * h + b * g - c * f + d * e
    for r in range(6):
        state[4 + r] -= correction[3 + r]
        biases[r] -= dt * correction[9 + r]
