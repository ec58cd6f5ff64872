"""Collocation at three Gauss points of the equations of navigation in earth-fixed axes: order six.

Hairer, Norsett and Wanner (1993), *Solving Ordinary Differential Equations I*, section II.7. The equations are those of
`mcnav.systems.ins.reference.mechanization`; attitude does not depend on velocity and position and is solved first. The
method keeps the length of the quaternion.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav.arrays.types import Array, IndexArray
from mcnav.compiled.jit import compiled
from mcnav.systems.ins.reference.normal_field import normal_gravitation

PASSES: Final = 40
"""Most fixed-point iterations of a step; a few suffice unless the indicated rate is beyond 10 rad in a step."""

TURN_CONVERGED: Final = 4e-16
"""Change of the quaternion at which iteration ends: rounding."""

FORCE_CONVERGED: Final = 1e-11
"""Change of an acceleration (m/s^2) at which iteration ends: a pass divides it by 1e5, as the earth turns so slowly."""

_ROOT: Final = np.sqrt(15.0)
NODES: Final = np.array([0.5 - _ROOT / 10.0, 0.5, 0.5 + _ROOT / 10.0])
"""Gauss points of a step of unit length."""
WEIGHTS: Final = np.array([5.0 / 18.0, 4.0 / 9.0, 5.0 / 18.0])
AT_END: Final = np.array([(5.0 - _ROOT) / 6.0, -2.0 / 3.0, (5.0 + _ROOT) / 6.0])
"""Weights of values at the Gauss points in the value of their interpolating polynomial at the end of a step."""
COUPLING: Final = np.array(
    [
        [5.0 / 36.0, 2.0 / 9.0 - _ROOT / 15.0, 5.0 / 36.0 - _ROOT / 30.0],
        [5.0 / 36.0 + _ROOT / 24.0, 2.0 / 9.0, 5.0 / 36.0 - _ROOT / 24.0],
        [5.0 / 36.0 + _ROOT / 30.0, 2.0 / 9.0 + _ROOT / 15.0, 5.0 / 36.0],
    ]
)
"""Integrals of the interpolating polynomials up to each point."""
TWICE: Final = COUPLING @ COUPLING
"""The same, integrated twice."""
TWICE_WEIGHTS: Final = WEIGHTS @ COUPLING

STATE: Final = 10
"""Numbers of a state: quaternion (scalar first), velocity, position."""

WENT_ON: Final = 0
REASONS: Final = {
    1: "the indicated position came near the earth's centre",
    2: "the indicated attitude turned by more than a step can follow",
    3: "the indicated state ceased to be finite",
}
"""Reasons for which an integration ends before its last step."""


@compiled
def _turned(
    spin: float, duration: float, reading: Array, gyro: Array, noise: Array, state: Array, slopes: Array, points: Array,
    change: Array,
) -> bool:  # fmt: skip
    """Advance the quaternion: its values at the Gauss points and its change; False if iteration does not converge."""
    rate = np.empty((3, 3))
    for point in range(3):
        for axis in range(3):
            # w as measured at a Gauss point: with scale factor, cross axes, g-sensitivity, bias and noise; halved
            measured = reading[point, axis] + gyro[axis, 3] + gyro[axis, 4] * reading[point, 3 + axis] + noise[axis]
            for other in range(3):
                measured += gyro[axis, other] * reading[point, other]
            rate[point, axis] = 0.5 * measured
        points[point, :] = state[:4]
    # q' = (q o w - W o q) / 2, by fixed-point iteration: q at the points = q_0 + h times the integral of q'
    half = 0.5 * spin
    for _ in range(PASSES):
        for point in range(3):
            w, x, y, z = points[point, 0], points[point, 1], points[point, 2], points[point, 3]
            along, right, down = rate[point, 0], rate[point, 1], rate[point, 2]
            slopes[point, 0] = half * z - x * along - y * right - z * down
            slopes[point, 1] = half * y + w * along + y * down - z * right
            slopes[point, 2] = w * right - x * down + z * along - half * x
            slopes[point, 3] = w * down + x * right - y * along - half * w
        largest = 0.0
        for point in range(3):
            for part in range(4):
                inner = 0.0
                for other in range(3):
                    inner += COUPLING[point, other] * slopes[other, part]
                now = state[part] + duration * inner
                largest = max(largest, abs(now - points[point, part]))
                points[point, part] = now
        if largest <= TURN_CONVERGED:
            break
    for part in range(4):
        inner = 0.0
        for other in range(3):
            inner += WEIGHTS[other] * slopes[other, part]
        change[part] = duration * inner
    return largest <= TURN_CONVERGED


@compiled
def _pushed(
    constants: Array, spin: float, duration: float, reading: Array, accelerometer: Array, noise: Array, state: Array,
    low: Array, points: Array, slow: Array, change: Array,
) -> None:  # fmt: skip
    """Advance velocity and position; ``slow``, shape (3, 3), is all but the force, as the last step found it."""
    force, push = np.empty((3, 3)), np.empty((3, 3))
    for point in range(3):
        for axis in range(3):
            # f as measured at a Gauss point, into earth-fixed axes
            true = reading[point, 3 + axis]
            measured = true + accelerometer[axis, 3] + accelerometer[axis, 4] * true * true + noise[axis]
            for other in range(3):
                measured += accelerometer[axis, other] * reading[point, 3 + other]
            force[point, axis] = measured
        w, x, y, z = points[point, 0], points[point, 1], points[point, 2], points[point, 3]
        a, b, c = force[point, 0], force[point, 1], force[point, 2]
        # q o (0, f) o q*: f + 2 w (u x f) + 2 u x (u x f), with u the vector part
        p, q, r = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
        force[point, 0] = a + w * p + (y * r - z * q)
        force[point, 1] = b + w * q + (z * p - x * r)
        force[point, 2] = c + w * r + (x * q - y * p)
        for axis in range(3):
            push[point, axis] = force[point, axis] + slow[point, axis]
    for _ in range(PASSES):
        largest = 0.0
        for point in range(3):
            # velocity and place there by single and double integrals of v' = f + slow
            speed, place = np.empty(3), np.empty(3)
            for axis in range(3):
                once, twice = 0.0, 0.0
                for other in range(3):
                    once += COUPLING[point, other] * push[other, axis]
                    twice += TWICE[point, other] * push[other, axis]
                speed[axis] = state[4 + axis] + duration * once
                inner = duration * (NODES[point] * state[4 + axis] + duration * twice)
                place[axis] = state[7 + axis] + (low[7 + axis] + inner)
            # slow: gravitation, Coriolis and centrifugal acceleration
            x, y, z = normal_gravitation(constants, place[0], place[1], place[2])
            slow[point, 0] = x + spin * (2.0 * speed[1] + spin * place[0])
            slow[point, 1] = y - spin * (2.0 * speed[0] - spin * place[1])
            slow[point, 2] = z
        for point in range(3):
            for axis in range(3):
                now = force[point, axis] + slow[point, axis]
                largest = max(largest, abs(now - push[point, axis]))
                push[point, axis] = now
        if not largest > FORCE_CONVERGED:
            break
    for axis in range(3):
        once, twice = 0.0, 0.0
        for other in range(3):
            once += WEIGHTS[other] * push[other, axis]
            twice += TWICE_WEIGHTS[other] * push[other, axis]
        change[4 + axis] = duration * once
        change[7 + axis] = duration * (state[4 + axis] + (low[4 + axis] + duration * twice))


@compiled
def _stepped(
    constants: Array, spin: float, lowest: float, duration: float, reading: Array, gyro: Array, accelerometer: Array,
    gyro_noise: Array, accelerometer_noise: Array, state: Array, low: Array, slow: Array, slopes: Array, points: Array,
    change: Array,
) -> int:  # fmt: skip
    """Advance a state, and its low-order digits, by one step in place; why not, if it cannot (see `REASONS`)."""
    if not _turned(spin, duration, reading, gyro, gyro_noise, state, slopes, points, change):
        return 2
    _pushed(constants, spin, duration, reading, accelerometer, accelerometer_noise, state, low, points, slow, change)
    square = 0.0
    for part in range(STATE):
        # compensated sum: low holds the digits that the state has no room for
        added = change[part] + low[part]
        total = state[part] + added
        low[part] = added - (total - state[part])
        state[part] = total
        if part >= 7:
            square += total * total
    if not np.isfinite(square):
        return 3
    if square < lowest * lowest:
        return 1
    return WENT_ON


@compiled
def navigate(
    constants: Array, spin: float, lowest: float, step_times: Array, values: Array, epoch_steps: IndexArray,
    epoch_durations: Array, gyro: Array, accelerometer: Array, gyro_noise: Array, accelerometer_noise: Array,
    start: Array, states: Array,
) -> tuple[int, int]:  # fmt: skip
    """Integrate a state, shape (10,), to all epochs; why it ended (see `REASONS`), and at which step."""
    state, low, change = start.copy(), np.zeros(STATE), np.empty(STATE)
    slopes, points, slow, aside = np.empty((3, 4)), np.empty((3, 4)), np.zeros((3, 3)), np.empty((3, 3))
    steps, epoch = len(step_times) - 1, 0
    for step in range(steps):
        while epoch < len(epoch_steps) and epoch_steps[epoch] == step:
            duration = epoch_durations[epoch]
            change[:] = 0.0
            if duration > 0.0:
                reading = values[steps + epoch]
                _turned(spin, duration, reading, gyro, gyro_noise[step], state, slopes, points, change)
                for i in range(3):
                    for j in range(3):
                        aside[i, j] = slow[i, j]
                _pushed(
                    constants, spin, duration, reading, accelerometer, accelerometer_noise[step], state, low, points,
                    aside, change,
                )  # fmt: skip
            for i in range(STATE):
                states[epoch, i] = state[i] + change[i]
            epoch += 1
        outcome = _stepped(
            constants, spin, lowest, step_times[step + 1] - step_times[step], values[step], gyro, accelerometer,
            gyro_noise[step], accelerometer_noise[step], state, low, slow, slopes, points, change,
        )  # fmt: skip
        if outcome != WENT_ON:
            return outcome, step
    return WENT_ON, steps


@compiled
def advance(
    constants: Array, spin: float, lowest: float, durations: Array, readings: Array, state: Array, states: Array
) -> tuple[int, int]:
    """Integrate a state, shape (10,), over n steps from readings without further errors.

    Parameters
    ----------
    readings : ndarray, shape (n, 3, 6)
        Inertial rate and specific force at the Gauss points.
    states : ndarray, shape (n, 10)
        Filled with the states at the ends of the steps.

    Returns
    -------
    tuple of int
        Why it ended (see `REASONS`), and at which step.
    """
    now, low, change, nothing = state.copy(), np.zeros(STATE), np.empty(STATE), np.zeros((3, 5))
    slopes, points, slow = np.empty((3, 4)), np.empty((3, 4)), np.zeros((3, 3))
    for step in range(len(durations)):
        outcome = _stepped(
            constants, spin, lowest, durations[step], readings[step], nothing, nothing, nothing[0, :3], nothing[0, :3],
            now, low, slow, slopes, points, change,
        )  # fmt: skip
        if outcome != WENT_ON:
            return outcome, step
        for i in range(STATE):
            states[step, i] = now[i]
    return WENT_ON, len(durations)
