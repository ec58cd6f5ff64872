"""Five filters of the benchmark, which differ in how they define their error and in how they update.

With the estimate's attitude C, velocity v and position r, the truth is, of the filter's error x = (a, b, c)::

    standard          exp(a x) C             v + b                   r + c
    left-invariant    C exp(a x)             v + C J(a) b            r + C J(a) c
    right-invariant   exp(a x) C             exp(a x) v + J(a) b     exp(a x) r + J(a) c

The step C exp(w T), v + (C f + g) T, r + v T + (C f + g) T^2/2 maps an invariant error by a matrix, exactly (Barrau and
Bonnabel 2017, theorem 2), so that sigma points of the invariant filters move as their linear error does. Those of the
standard one have a mean m that is not zero, and a sigma-point covariance has 2 m m^T more (its third parameter is 2)::

    standard          F = [I; A; A T/2 | I; T I | I], A = -(C f) x T          m = (P_aa - tr(P_aa) I) C f T/2 [1; T/2]
    left-invariant    F = diag(exp(-w T)) [the same with A = -f x T]           m = 0
    right-invariant   F = [the same with A = g x T]                            m = 0

The spread of ukfm's sigma points is 1e-3 sigma: what of it is left out here, in propagation, is a millionth of these.
In an update the sigma points are those of ukfm.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.compiled.jit import allocation_free_subroutine as subroutine
from mcnav.compiled.jit import compiled
from mcnav.numerics.extended_poses import exponential, logarithm

STANDARD: Final = 0
LEFT: Final = 1
RIGHT: Final = 2
"""Definitions of the error."""

FLOOR: Final = 1e-9
"""Additions of ukfm to each variance before it takes sigma points, rad^2, m^2/s^2, m^2."""

SPREAD: Final = 1e-3
"""Distance of sigma points as a share of a sigma's, times the square root of the number of states."""

SCORES: Final = 5
"""Scores of an instant: squared errors of attitude and position; their NEES as ukfm computes it; that of position."""


@subroutine
def retract(definition: int, pose: Array, error: Array, rotation: Array, jacobian: Array, out: Array) -> None:
    """Compute the pose that an error, shape (9,), makes of a pose, shape (3, 5): columns of C, v, r."""
    exponential(error, rotation, jacobian)
    for row in range(3):
        for column in range(3):
            value = 0.0
            for k in range(3):
                turned = pose[row, k] * rotation[k, column]
                value += turned if definition == LEFT else rotation[row, k] * pose[k, column]
            out[row, column] = value
    for column in range(2):
        for row in range(3):
            value = error[3 + 3 * column + row] if definition == STANDARD else 0.0
            for k in range(3):
                if definition == LEFT:
                    along = 0.0
                    for j in range(3):
                        along += jacobian[k, j] * error[3 + 3 * column + j]
                    value += pose[row, k] * along
                elif definition == RIGHT:
                    value += jacobian[row, k] * error[3 + 3 * column + k]
            if definition == RIGHT:
                for k in range(3):
                    value += rotation[row, k] * pose[k, 3 + column]
            else:
                value += pose[row, 3 + column]
            out[row, 3 + column] = value


@subroutine
def predict(pose: Array, landmarks: Array, out: Array) -> None:
    """Predict the landmarks in the vehicle's axes, C^T (l - r), shape (9,)."""
    for place in range(len(landmarks)):
        for axis in range(3):
            value = 0.0
            for k in range(3):
                value += pose[k, axis] * (landmarks[place, k] - pose[k, 4])
            out[3 * place + axis] = value


@subroutine
def _cross(vector: Array, factor: float, out: Array) -> None:
    """Write a vector's cross-product matrix, shape (3, 3), times a factor."""
    out[0, 0] = out[1, 1] = out[2, 2] = 0.0
    out[2, 1] = factor * vector[0]
    out[1, 2] = -factor * vector[0]
    out[0, 2] = factor * vector[1]
    out[2, 0] = -factor * vector[1]
    out[1, 0] = factor * vector[2]
    out[0, 1] = -factor * vector[2]


@subroutine
def _sheared(covariance: Array, shear: Array, step: float) -> None:
    """Replace P by F P F^T, F = [I; A; A T/2 | I; T I | I], first by rows, then by columns."""
    for column in range(9):
        for row in range(3):
            value = 0.0
            for k in range(3):
                value += shear[row, k] * covariance[k, column]
            covariance[6 + row, column] += step * (covariance[3 + row, column] + 0.5 * value)
            covariance[3 + row, column] += value
    for row in range(9):
        for column in range(3):
            value = 0.0
            for k in range(3):
                value += shear[column, k] * covariance[row, k]
            covariance[row, 6 + column] += step * (covariance[row, 3 + column] + 0.5 * value)
            covariance[row, 3 + column] += value


@subroutine
def _turned(covariance: Array, rotation: Array, block: Array) -> None:
    """Replace each block B of P, shape (3, 3), by D^T B D with a rotation D."""
    for above in range(0, 9, 3):
        for left in range(0, 9, 3):
            for row in range(3):
                for column in range(3):
                    value = 0.0
                    for k in range(3):
                        value += covariance[above + row, left + k] * rotation[k, column]
                    block[row, column] = value
            for row in range(3):
                for column in range(3):
                    value = 0.0
                    for k in range(3):
                        value += rotation[k, row] * block[k, column]
                    covariance[above + row, left + column] = value


@subroutine
def advance(
    definition: int, sigma_points: bool, pose: Array, covariance: Array, reading: Array, gravity: Array,
    noise: Array, step: float, work: Array,
) -> None:  # fmt: skip
    """Propagate a pose and its covariance over a step.

    Parameters
    ----------
    reading : ndarray, shape (6,)
        Rate, rad/s, and specific force, m/s^2.
    noise : ndarray, shape (2,)
        Sigmas of the readings.
    work : ndarray, shape (4, 3, 3)
    """
    turn, jacobian, shear, block = work[0], work[1], work[2], work[3]
    force, mean = block[0], block[1]
    for row in range(3):
        force[row] = 0.0
        for k in range(3):
            force[row] += pose[row, k] * reading[3 + k]
    if sigma_points:
        for place in range(9):
            covariance[place, place] += FLOOR
    if definition == STANDARD:
        _cross(force, -step, shear)
    elif definition == LEFT:
        _cross(reading[3:], -step, shear)
    else:
        _cross(gravity, step, shear)
    curved = sigma_points and definition == STANDARD
    if curved:  # the mean of the velocities of the sigma points
        trace = covariance[0, 0] + covariance[1, 1] + covariance[2, 2]
        for row in range(3):
            mean[row] = -0.5 * step * trace * force[row]
            for k in range(3):
                mean[row] += 0.5 * step * covariance[row, k] * force[k]
    _sheared(covariance, shear, step)
    if curved:
        for row in range(6):
            for column in range(6):
                share = (0.5 * step if row > 2 else 1.0) * (0.5 * step if column > 2 else 1.0)
                covariance[3 + row, 3 + column] += 2.0 * share * mean[row % 3] * mean[column % 3]
    for row in range(3):
        pose[row, 4] += step * (pose[row, 3] + 0.5 * step * (force[row] + gravity[row]))
        pose[row, 3] += step * (force[row] + gravity[row])
    for k in range(3):
        mean[k] = step * reading[k]
    exponential(mean, turn, jacobian)
    if definition == LEFT:
        _turned(covariance, turn, block)
    for row in range(3):
        for column in range(3):
            jacobian[row, column] = pose[row, column]
    for row in range(3):
        for column in range(3):
            value = 0.0
            for k in range(3):
                value += jacobian[row, k] * turn[k, column]
            pose[row, column] = value
    # white noise is isotropic, so that C Q C^T = Q
    angle, speed = (noise[0] * step) ** 2, (noise[1] * step) ** 2
    for k in range(3):
        covariance[k, k] += angle
        covariance[3 + k, 3 + k] += speed
        covariance[3 + k, 6 + k] += 0.5 * step * speed
        covariance[6 + k, 3 + k] += 0.5 * step * speed
        covariance[6 + k, 6 + k] += 0.25 * step**2 * speed
    if definition == RIGHT:  # columns [I; v x; r x] of the gyros' noise
        for first in range(2):
            for k in range(3):
                force[k] = pose[k, 3 + first]
            _cross(force, angle, shear)
            for row in range(3):
                for column in range(3):
                    covariance[3 + 3 * first + row, column] += shear[row, column]
                    covariance[column, 3 + 3 * first + row] += shear[row, column]
            for second in range(2):
                for k in range(3):
                    force[k] = pose[k, 3 + second]
                _cross(force, 1.0, jacobian)
                for row in range(3):
                    for column in range(3):
                        value = 0.0
                        for k in range(3):
                            value += shear[row, k] * jacobian[column, k]
                        covariance[3 + 3 * first + row, 3 + 3 * second + column] += value


@subroutine
def correct(covariance: Array, cross: Array, innovations: Array, innovation: Array, error: Array) -> None:
    """Compute the error P_xy S^-1 y, and replace P by P - P_xy S^-1 P_xy^T; what it is given is overwritten."""
    size = len(innovation)
    for column in range(size):  # Cholesky factor of S
        for row in range(column, size):
            value = innovations[row, column]
            for k in range(column):
                value -= innovations[row, k] * innovations[column, k]
            innovations[row, column] = np.sqrt(value) if row == column else value / innovations[column, column]
    for row in range(size):
        for k in range(row):
            innovation[row] -= innovations[row, k] * innovation[k]
        innovation[row] /= innovations[row, row]
    for state in range(9):
        error[state] = 0.0
        for row in range(size):
            for k in range(row):
                cross[state, row] -= innovations[row, k] * cross[state, k]
            cross[state, row] /= innovations[row, row]
            error[state] += cross[state, row] * innovation[row]
    for row in range(9):
        for column in range(row + 1):
            value = 0.5 * (covariance[row, column] + covariance[column, row])
            for k in range(size):
                value -= cross[row, k] * cross[column, k]
            covariance[row, column] = value
            covariance[column, row] = value


@subroutine
def linear_response(definition: int, pose: Array, landmarks: Array, work: Array, out: Array) -> None:
    """Compute H, the response of the landmarks in the vehicle's axes to the error, shape (9, 9)."""
    arm, cross_matrix = work[0, 0], work[1]
    for place in range(len(landmarks)):
        for k in range(3):
            arm[k] = landmarks[place, k] - (pose[k, 4] if definition != RIGHT else 0.0)
        _cross(arm, 1.0, cross_matrix)
        for axis in range(3):
            for column in range(3):
                value, turned = 0.0, 0.0
                for k in range(3):
                    value += pose[k, axis] * cross_matrix[k, column]
                    for j in range(3):
                        turned += pose[k, axis] * cross_matrix[k, j] * pose[j, column]
                out[3 * place + axis, column] = turned if definition == LEFT else value
                out[3 * place + axis, 3 + column] = 0.0
                left = -1.0 if axis == column else 0.0
                out[3 * place + axis, 6 + column] = left if definition == LEFT else -pose[column, axis]


@subroutine
def by_linear_response(response: Array, covariance: Array, cross: Array, innovations: Array) -> None:
    """Compute P H^T and H P H^T, shape (9, 9)."""
    for row in range(9):
        for column in range(9):
            cross[row, column] = 0.0
            for k in range(9):
                cross[row, column] += covariance[row, k] * response[column, k]
    for row in range(9):
        for column in range(9):
            innovations[row, column] = 0.0
            for k in range(9):
                innovations[row, column] += response[row, k] * cross[k, column]


@subroutine
def by_sigma_points(
    definition: int, pose: Array, landmarks: Array, covariance: Array, cross: Array, innovations: Array,
    mean: Array, factor: Array, turned: Array, blocks: Array, points: Array,
) -> None:  # fmt: skip
    """Compute the mean, shape (9,), and the covariances of the measurement from 18 sigma points.

    Work is done in a factor, shape (9, 9), a pose, blocks and points, shape (20, 9).
    """
    central, error = points[18], points[19]
    excess = (SPREAD**2 - 1.0) * 9.0
    distance, weight = np.sqrt(9.0 + excess), 0.5 / (9.0 + excess)
    for column in range(9):
        for row in range(column, 9):
            value = covariance[row, column]
            for k in range(column):
                value -= factor[row, k] * factor[column, k]
            factor[row, column] = np.sqrt(value) if row == column else value / factor[column, column]
            if row > column:
                factor[column, row] = 0.0
    predict(pose, landmarks, central)
    for k in range(9):
        mean[k] = excess / (9.0 + excess) * central[k]
    for place in range(18):
        for k in range(9):
            error[k] = factor[k, place % 9] * (distance if place < 9 else -distance)
        retract(definition, pose, error, blocks[0], blocks[1], turned)
        predict(turned, landmarks, points[place])
        for k in range(9):
            mean[k] += weight * points[place, k]
    first = excess / (9.0 + excess) + 3.0 - SPREAD**2
    for row in range(9):
        for column in range(9):
            value = first * (central[row] - mean[row]) * (central[column] - mean[column])
            for place in range(18):
                value += weight * (points[place, row] - mean[row]) * (points[place, column] - mean[column])
            innovations[row, column] = value
            value = 0.0
            for place in range(9):
                value += factor[row, place] * (points[place, column] - points[9 + place, column])
            cross[row, column] = weight * distance * value


@subroutine
def _normalized(covariance: Array, error: Array) -> float:
    """Compute e^T P^-1 e / 3, shape (3, 3) and (3,), by cofactors."""
    a, b, c = covariance[0, 0], covariance[0, 1], covariance[0, 2]
    d, e, f = covariance[1, 1], covariance[1, 2], covariance[2, 2]
    x, y, z = error[0], error[1], error[2]
    first, second, third = d * f - e * e, c * e - b * f, b * e - c * d
    square = first * x * x + (a * f - c * c) * y * y + (a * d - b * b) * z * z
    square += 2.0 * (second * x * y + third * x * z + (b * c - a * e) * y * z)
    return float(square / (3.0 * (a * first + b * second + c * third)))


@subroutine
def _around(position: Array, covariance: Array, sign: float, cross_matrix: Array, out: Array) -> None:
    """Compute the covariance of c + s r x a, shape (3, 3): of the position, in the sense of a sign s; without, of c."""
    _cross(position, sign, cross_matrix)
    for row in range(3):
        for column in range(3):
            value = covariance[6 + row, 6 + column]
            for k in range(3):
                value += cross_matrix[row, k] * covariance[k, 6 + column]
                value += cross_matrix[column, k] * covariance[6 + row, k]
                for j in range(3):
                    value += cross_matrix[row, k] * covariance[k, j] * cross_matrix[column, j]
            out[row, column] = value


@subroutine
def score(definition: int, pose: Array, covariance: Array, position: Array, work: Array, out: Array) -> None:
    """Score an instant, as `SCORES` lists it; the true attitude is the identity.

    ukfm's covariance of the position of a right-invariant filter is that of c + r x a, though the error of the position
    is c - r x a to first order. Its attitude error is in the vehicle's axes, whichever the covariance's are; here both
    are the same, since an estimate's rotation from the identity leaves its own axis where it is.
    """
    vectors, block, cross_matrix = work[0], work[1], work[2]
    turn, off, at = vectors[0], vectors[1], vectors[2]
    logarithm(pose, turn)
    for row in range(3):
        at[row] = pose[row, 4]
        off[row] = position[row] - pose[row, 4]
    out[0] = turn[0] ** 2 + turn[1] ** 2 + turn[2] ** 2
    out[1] = off[0] ** 2 + off[1] ** 2 + off[2] ** 2
    out[2] = _normalized(covariance, turn)
    if definition == LEFT:
        for row in range(3):
            turn[row] = 0.0
            for k in range(3):
                turn[row] += pose[k, row] * off[k]
        for row in range(3):
            off[row] = turn[row]
    sign = 1.0 if definition == RIGHT else 0.0
    _around(at, covariance, sign, cross_matrix, block)
    out[3] = _normalized(block, off)
    _around(at, covariance, -sign, cross_matrix, block)
    out[4] = _normalized(block, off)


@compiled
def simulate(
    definition: int, sigma_points: bool, forces: Array, position: Array, gravity: Array, landmarks: Array, step: float,
    every: int, sigmas: Array, turned: float, start: Array, readings: Array, noise: Array, by_run: Array,
    by_time: Array,
) -> None:  # fmt: skip
    """Simulate runs of one filter along the truth.

    Parameters
    ----------
    forces, position : ndarray
        Of `Truth`.
    every : int
        Steps between measurements.
    sigmas : ndarray, shape (5,)
        Of gyros, accelerometers, landmarks, attitude and position at the start.
    turned : float
        The covariance at the start is that of (a, dr + s r x a), with this s; zero for none.
    start, readings, noise : ndarray
        Of `Draws`.
    by_run : ndarray, shape (n, 5)
        Means of the scores over time, of which the first instant's are zero but for squared errors.
    by_time : ndarray, shape (3000, 5)
        To which the scores of these runs are added.
    """
    pose, moved, covariance = np.empty((3, 5)), np.empty((3, 5)), np.empty((9, 9))
    cross, innovations, response = np.empty((9, 9)), np.empty((9, 9)), np.empty((9, 9))
    blocks, points = np.empty((4, 3, 3)), np.empty((20, 9))
    reading, expected, true_value, error = np.empty(6), np.empty(9), np.empty(9), np.empty(9)
    scores, true_pose = np.empty(SCORES), np.zeros((3, 5))
    for k in range(3):
        true_pose[k, k] = 1.0
    instants = len(position)
    for run in range(len(start)):
        exponential(start[run], blocks[0], blocks[1])
        for row in range(3):
            for column in range(3):
                pose[row, column] = blocks[0, row, column]
            pose[row, 3] = 0.0
            pose[row, 4] = position[0, row] + start[run, 3 + row]
        covariance[:] = 0.0
        for k in range(3):
            covariance[k, k] = sigmas[3] ** 2
            covariance[6 + k, 6 + k] = sigmas[4] ** 2
        if turned != 0.0:
            for k in range(3):
                error[k] = pose[k, 4]
            _cross(error, turned, blocks[2])
            for row in range(3):
                for column in range(3):
                    covariance[6 + row, column] = blocks[2, row, column] * sigmas[3] ** 2
                    covariance[column, 6 + row] = covariance[6 + row, column]
                    for k in range(3):
                        covariance[6 + row, 6 + column] += blocks[2, row, k] * blocks[2, column, k] * sigmas[3] ** 2
        by_run[run] = 0.0
        for instant in range(instants):
            if instant:
                for k in range(6):
                    reading[k] = readings[run, instant - 1, k] + (forces[instant - 1, k - 3] if k > 2 else 0.0)
                advance(definition, sigma_points, pose, covariance, reading, gravity, sigmas, step, blocks)
                if instant % every == 0:
                    for k in range(3):
                        true_pose[k, 4] = position[instant, k]
                    predict(true_pose, landmarks, true_value)
                    if sigma_points:
                        for k in range(9):
                            covariance[k, k] += FLOOR
                        by_sigma_points(
                            definition, pose, landmarks, covariance, cross, innovations, expected, response, moved,
                            blocks, points,
                        )  # fmt: skip
                    else:
                        predict(pose, landmarks, expected)
                        linear_response(definition, pose, landmarks, blocks, response)
                        by_linear_response(response, covariance, cross, innovations)
                    for k in range(9):
                        innovations[k, k] += sigmas[2] ** 2
                        expected[k] = true_value[k] + noise[run, instant // every - 1, k] - expected[k]
                    correct(covariance, cross, innovations, expected, error)
                    retract(definition, pose, error, blocks[0], blocks[1], moved)
                    for row in range(3):
                        for column in range(5):
                            pose[row, column] = moved[row, column]
            score(definition, pose, covariance, position[instant], blocks, scores)
            for k in range(SCORES):
                if instant or k < 2:
                    by_run[run, k] += scores[k] / instants
                    by_time[instant, k] += scores[k]
