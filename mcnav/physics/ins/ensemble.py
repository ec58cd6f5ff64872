"""Many samples of the navigator: the nonlinear errors and the linear ones of the same draws, noise included.

The truth is shared, so that a sample is a deviation from it (`mcnav.physics.ins.response`)::

    R' = R [C dw]x        v' = (R - I) C f + R C df + g(r + x) - g(r)        x' = v

Its linear part is carried by the tables of the steps, exactly. What is left is of second order, and changes slowly:
over a step the rotation R at its beginning is applied to the truth's force and to the step's own linear response, the
products of errors within the step are taken from their means, and the remainder of gravity by Simpson's rule.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav._types import Array, IndexArray
from mcnav.physics.ins.covariance import output_map, process_systems
from mcnav.physics.ins.deviations import deviate, locate, navigation_errors
from mcnav.physics.ins.earth import gravitation
from mcnav.physics.ins.instruments import Imu
from mcnav.physics.ins.noise import IMU_STREAM, draw_normals
from mcnav.physics.ins.response import StepResponses
from mcnav.physics.ins.truth import Platform, Truth
from mcnav.physics.jit import compiled, inlined, uncontracted

LANES: Final = 16
LARGEST_TURN: Final = 0.5
"""Largest rotation by the gyros' errors within a step, rad: beyond it a sample leaves the engine's validity."""

SMALLEST_RADIUS: Final = 0.5
"""Smallest distance from the earth's centre, as a share of the earth's radius."""


@dataclass(frozen=True)
class EnsembleTables:
    """All that samples share, for K steps and m epochs.

    Attributes
    ----------
    epochs : ndarray of int, shape (m,)
        Numbers of the times at which errors are read out.
    durations : ndarray, shape (K,)
    motion : ndarray, shape (K, 6, 9)
        Responses of v and x to psi, v and x at the beginning.
    force : ndarray, shape (K, 6, 9)
        As `StepResponses.force`, flat.
    thrust : ndarray, shape (K, 6)
        Integral of the force, and that integral's.
    inputs : ndarray, shape (K, 30, 9)
        Responses to the constant errors of the instruments.
    biases, decays : ndarray, shape (K, b, 9), (K, b)
        Responses to the biases of processes at the beginning, and what is left of these at the end.
    sizes : ndarray, shape (b,)
        Sigmas of the biases at the start.
    factors : ndarray, shape (K, 9 + b, 9 + b)
        Cholesky factors of the covariance that processes add.
    places, fields, gradients : ndarray, shape (2 K + 1, 3), (2 K + 1, 3), (2 K + 1, 3, 3)
        True position, gravitation and its gradient at the ends and the middles of steps.
    start_map, output_maps : ndarray, shape (9, 9), (m, 9, 9)
        From initial errors to psi, v, x, and from these to outputs, to first order.
    truth : ndarray, shape (m, 15)
        True local states.
    states : ndarray, shape (m, 6)
        True inertial positions and velocities.
    angles : ndarray, shape (m,)
        By which the earth has turned, rad.
    """

    epochs: IndexArray
    durations: Array
    motion: Array
    force: Array
    thrust: Array
    inputs: Array
    biases: Array
    decays: Array
    sizes: Array
    factors: Array
    places: Array
    fields: Array
    gradients: Array
    start_map: Array
    output_maps: Array
    truth: Array
    states: Array
    angles: Array

    def without_noise(self) -> EnsembleTables:
        """Return the same tables without processes."""
        steps = len(self.durations)
        return replace(
            self,
            biases=np.zeros((steps, 0, 9)),
            decays=np.zeros((steps, 0)),
            sizes=np.zeros(0),
            factors=np.zeros((steps, 9, 9)),
        )

    def at_the_end(self) -> EnsembleTables:
        """Return the same tables with the last epoch alone."""
        return replace(
            self,
            epochs=self.epochs[-1:],
            output_maps=self.output_maps[-1:],
            truth=self.truth[-1:],
            states=self.states[-1:],
            angles=self.angles[-1:],
        )


def semidefinite_factor(covariance: Array) -> Array:
    """Factor covariances, shape (K, d, d), as ``L L^T`` with lower triangular L; directions without variance are zero.

    The covariances are scaled to unit variances first; pivots below 1e-12 are rounding.
    """
    sigma = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    inverse = np.divide(1.0, sigma, out=np.zeros_like(sigma), where=sigma > 0.0)
    return np.asarray(sigma[:, :, None] * _factor(inverse[:, :, None] * covariance * inverse[:, None, :]))


@compiled
def _factor(correlation: Array) -> Array:
    factor = np.zeros_like(correlation)
    size = correlation.shape[1]
    for k in range(len(correlation)):
        for j in range(size):
            pivot = correlation[k, j, j]
            for c in range(j):
                pivot -= factor[k, j, c] * factor[k, j, c]
            if pivot <= 1e-12:
                continue
            root = np.sqrt(pivot)
            factor[k, j, j] = root
            for i in range(j + 1, size):
                value = correlation[k, i, j]
                for c in range(j):
                    value -= factor[k, i, c] * factor[k, j, c]
                factor[k, i, j] = value / root
    return factor


def tabulate(
    truth: Truth, platform: Platform, responses: StepResponses, imu: Imu, epochs: IndexArray
) -> EnsembleTables:
    """Prepare the tables for samples from the responses over the steps."""
    times = responses.times
    steps = len(times) - 1
    systems = process_systems(responses, imu)
    biased = [(response, noise, variance) for response, noise, variance in systems.values() if response.any()]
    covariance = np.zeros((steps, 9 + len(biased), 9 + len(biased)))
    biases, decays = np.zeros((steps, len(biased), 9)), np.zeros((steps, len(biased)))
    for _, noise, _ in systems.values():
        covariance[:, :9, :9] += noise[:, :9, :9]
    for number, (response, noise, _) in enumerate(biased):
        biases[:, number], decays[:, number] = response[:, :9], response[:, 9]
        covariance[:, 9 + number, :9] = noise[:, 9, :9]
        covariance[:, :9, 9 + number] = noise[:, :9, 9]
        covariance[:, 9 + number, 9 + number] = noise[:, 9, 9]
    halves = np.empty(2 * steps + 1)
    halves[0::2], halves[1::2] = times, 0.5 * (times[:-1] + times[1:])
    earth = truth.earth
    around = truth.states(halves, platform, float(times[0]))
    at = truth.states(times[epochs], platform, float(times[0]))
    angles = earth.rotation_rate * (times[epochs] - truth.times[0])
    states = np.hstack([at.position, at.velocity])
    inputs = np.zeros((steps, 30, 9))
    inputs[:, :15] = responses.gyro
    inputs[:, 15:, 3:] = responses.accelerometer
    return EnsembleTables(
        epochs=epochs,
        durations=np.diff(times),
        motion=np.concatenate([responses.attitude, responses.motion], axis=2),
        force=responses.force.reshape(steps, 6, 9),
        thrust=np.einsum("krii->kr", responses.force),  # N is the identity
        inputs=inputs,
        biases=biases,
        decays=decays,
        sizes=np.sqrt(np.array([float(variance) for *_, variance in biased])),
        factors=semidefinite_factor(covariance),
        places=around.position,
        fields=earth.gravitation(around.position),
        gradients=earth.gravity_gradient(around.position),
        start_map=np.asarray(np.linalg.inv(output_map(truth, float(times[0]))), dtype=float),
        output_maps=np.stack([output_map(truth, float(time)) for time in times[epochs]]),
        truth=locate(earth.constants, angles, states, np.zeros((1, len(epochs), 6)))[0],
        states=states,
        angles=angles,
    )


@dataclass(frozen=True)
class EnsembleErrors:
    """Navigation errors of n samples at m epochs.

    Attributes
    ----------
    values, linear : ndarray, shape (n, m, 9)
        Nonlinear, and by the linear system from the same draws.
    valid : ndarray of bool, shape (n,)
        Whether a sample stayed where the scheme holds.
    """

    values: Array
    linear: Array
    valid: NDArray[np.bool_]


def simulate(
    truth: Truth, start: float, tables: EnsembleTables, errors: Array, seed: int, samples: IndexArray
) -> EnsembleErrors:
    """Simulate samples with noise of their own.

    Parameters
    ----------
    errors : ndarray, shape (n, 39)
        Constant errors in the order of `mcnav.physics.ins.instruments.CONSTANTS`.
    samples : ndarray of int, shape (n,)
        Indices, which together with the seed make the noise.
    """
    noisy = bool(tables.factors.any() or tables.sizes.any())
    return _simulate(truth, start, tables, errors, np.uint64(seed), samples.astype(np.uint64), np.empty((0, 0)), noisy)


def simulate_given(truth: Truth, start: float, tables: EnsembleTables, errors: Array, added: Array) -> EnsembleErrors:
    """Simulate samples of which the noise is given, as what it adds to psi, v, x and the biases in each step.

    Parameters
    ----------
    errors : ndarray, shape (n, 39)
    added : ndarray, shape (n, K, 9 + b)
    """
    given = np.ascontiguousarray(added.reshape(len(errors), -1))
    return _simulate(truth, start, tables, errors, np.uint64(0), np.zeros(len(errors), np.uint64), given, True)


def _simulate(
    truth: Truth,
    start: float,
    tables: EnsembleTables,
    errors: Array,
    seed: np.uint64,
    samples: NDArray[np.uint64],
    given: Array,
    noisy: bool,
) -> EnsembleErrors:
    errors = np.ascontiguousarray(errors, dtype=float)
    turn, velocity, position = deviate(truth, start, errors[:, :9])
    state = np.hstack([turn, velocity, position])
    linear = np.einsum("nj,ij->ni", errors[:, :9], tables.start_map)  # a matrix product rounds by a row's place
    active = np.flatnonzero(errors[:, 9:].any(axis=0))
    shape = (len(errors), len(tables.epochs), 9)
    turns, deviations = np.empty((*shape[:2], 4)), np.empty((*shape[:2], 6))
    predicted, sound = np.empty(shape), np.empty(len(errors), dtype=np.bool_)
    constants = truth.earth.constants
    _run(
        constants, tables.epochs, tables.durations, tables.motion, tables.force, tables.thrust,
        np.ascontiguousarray(tables.inputs[:, active]), tables.biases, tables.decays, tables.sizes, tables.factors,
        tables.places, tables.fields, tables.gradients, tables.output_maps, np.ascontiguousarray(errors[:, 9 + active]),
        state, linear, seed, samples, given, noisy, turns, deviations, predicted, sound,
    )  # fmt: skip
    indicated = locate(constants, tables.angles, tables.states, deviations)
    values = navigation_errors(constants, tables.truth, indicated, turns)
    return EnsembleErrors(values, predicted, sound & np.isfinite(values).all(axis=(1, 2)))


@uncontracted
def bend(constants: Array, place: Array, field: Array, gradient: Array, x: Array, out: Array) -> None:
    """Compute the change of gravitation by deviations, shape (3, LANES), beyond its linear part.

    Without deviations it is exactly zero: not contracted, as the field of the truth.
    """
    for i in range(LANES):
        gx, gy, gz = gravitation(constants, place[0] + x[0, i], place[1] + x[1, i], place[2] + x[2, i])
        a, b, c = x[0, i], x[1, i], x[2, i]
        out[0, i] = (gx - field[0]) - (gradient[0, 0] * a + gradient[0, 1] * b + gradient[0, 2] * c)
        out[1, i] = (gy - field[1]) - (gradient[1, 0] * a + gradient[1, 1] * b + gradient[1, 2] * c)
        out[2, i] = (gz - field[2]) - (gradient[2, 0] * a + gradient[2, 1] * b + gradient[2, 2] * c)


@inlined
def room() -> tuple[Array, Array, Array, Array, Array, Array, Array, Array]:
    """Allocate what `advance` works in: R - I, the same without its linear part, and deviations within a step."""
    return (
        np.zeros((9, LANES)), np.zeros((9, LANES)), np.zeros((6, LANES)), np.zeros((6, LANES)), np.zeros((9, LANES)),
        np.zeros((3, LANES)), np.zeros((3, LANES)), np.zeros((3, LANES)),
    )  # fmt: skip


@inlined
def advance(
    k: int, constants: Array, durations: Array, motion: Array, force: Array, thrust: Array, places: Array,
    fields: Array, gradients: Array, local: Array, z: Array, turn: Array, d: Array, first: Array, here: Array,
    scratch: tuple[Array, Array, Array, Array, Array, Array, Array, Array], sound: NDArray[np.bool_],
) -> None:  # fmt: skip
    """Take LANES samples over step k, with the linear response ``local`` to their errors in it.

    A sample is its rotation ``turn``, a linear deviation ``z`` (psi, v, x) and what v and x have beyond it, ``d``. The
    remainder of gravity at the deviation ``here`` is ``first``.
    """
    over, beyond, extra, moved, moved_linear, middle, last, there = scratch
    floor = (SMALLEST_RADIUS * constants[0]) ** 2
    h = durations[k]
    for i in range(LANES):
        a, b, c, e = turn[0, i], turn[1, i], turn[2, i], turn[3, i]
        over[0, i], over[4, i], over[8, i] = (
            -2.0 * (c * c + e * e), -2.0 * (b * b + e * e), -2.0 * (b * b + c * c)
        )  # fmt: skip
        over[1, i], over[2, i] = 2.0 * (b * c - a * e), 2.0 * (b * e + a * c)
        over[3, i], over[5, i] = 2.0 * (b * c + a * e), 2.0 * (c * e - a * b)
        over[6, i], over[7, i] = 2.0 * (b * e - a * c), 2.0 * (c * e + a * b)
    for r in range(9):
        for i in range(LANES):
            beyond[r, i] = over[r, i]
    for i in range(LANES):
        beyond[1, i] += z[2, i]
        beyond[2, i] -= z[1, i]
        beyond[3, i] -= z[2, i]
        beyond[5, i] += z[0, i]
        beyond[6, i] += z[1, i]
        beyond[7, i] -= z[0, i]
    # products of errors within the step, of which the rotation grows evenly
    for half in range(2):
        of_force, of_input = (1.0 / 6.0, 0.5) if half == 0 else (1.0 / 12.0, 1.0 / 3.0)
        for i in range(LANES):
            ax, ay, az = local[0, i], local[1, i], local[2, i]
            fx, fy, fz = thrust[k, 3 * half], thrust[k, 3 * half + 1], thrust[k, 3 * half + 2]
            tx, ty, tz = ay * fz - az * fy, az * fx - ax * fz, ax * fy - ay * fx
            lx, ly, lz = local[3 + 3 * half, i], local[4 + 3 * half, i], local[5 + 3 * half, i]
            # of the step's linear response, what is not turned force; the force turns by a half on average
            share = 0.5 if half == 0 else 1.0 / 3.0
            ux, uy, uz = lx - share * tx, ly - share * ty, lz - share * tz
            px = of_force * (ay * tz - az * ty) + of_input * (ay * uz - az * uy)
            py = of_force * (az * tx - ax * tz) + of_input * (az * ux - ax * uz)
            pz = of_force * (ax * ty - ay * tx) + of_input * (ax * uy - ay * ux)
            qx, qy, qz = px + lx, py + ly, pz + lz
            extra[3 * half, i] = px + (over[0, i] * qx + over[1, i] * qy + over[2, i] * qz)
            extra[3 * half + 1, i] = py + (over[3, i] * qx + over[4, i] * qy + over[5, i] * qz)
            extra[3 * half + 2, i] = pz + (over[6, i] * qx + over[7, i] * qy + over[8, i] * qz)
    for r in range(6):
        for c in range(9):
            weight = force[k, r, c]
            for i in range(LANES):
                extra[r, i] += weight * beyond[c, i]
        for i in range(LANES):
            moved[r, i] = extra[r, i]
            moved_linear[3 + r, i] = local[3 + r, i]
        for c in range(9):
            weight = motion[k, r, c]
            for i in range(LANES):
                moved_linear[3 + r, i] += weight * z[c, i]
        for c in range(6):
            weight = motion[k, r, 3 + c]
            for i in range(LANES):
                moved[r, i] += weight * d[c, i]
    for r in range(3):
        for i in range(LANES):
            moved_linear[r, i] = z[r, i] + local[r, i]
            there[r, i] = moved_linear[6 + r, i] + moved[3 + r, i] + (0.5 * h * h) * first[r, i]
            change = (z[3 + r, i] + d[r, i]) - (moved_linear[3 + r, i] + moved[r, i] + h * first[r, i])
            here[r, i] = 0.5 * (here[r, i] + there[r, i]) + 0.125 * h * change
    bend(constants, places[2 * k + 1], fields[2 * k + 1], gradients[2 * k + 1], here, middle)
    bend(constants, places[2 * k + 2], fields[2 * k + 2], gradients[2 * k + 2], there, last)
    # Simpson's rule for the remainder, and for what its velocity and position change in gravity
    for i in range(LANES):
        for r in range(3):
            pushed = pulled = 0.0
            for c in range(3):
                gradient = gradients[2 * k + 1, r, c]
                pushed += gradient * (first[c, i] + middle[c, i])
                pulled += gradient * (2.0 * first[c, i] + middle[c, i])
            d[r, i] = moved[r, i] + h * (
                (first[r, i] + 4.0 * middle[r, i] + last[r, i]) / 6.0 + (h * h / 12.0) * pushed
            )
            d[3 + r, i] = moved[3 + r, i] + h * h * ((first[r, i] + 2.0 * middle[r, i]) / 6.0 + (h * h / 72.0) * pulled)
    for r in range(3):
        for i in range(LANES):
            first[r, i] = last[r, i]
    for r in range(9):
        for i in range(LANES):
            z[r, i] = moved_linear[r, i]
    for i in range(LANES):
        for r in range(3):
            here[r, i] = z[6 + r, i] + d[3 + r, i]
        x, y, w = local[0, i], local[1, i], local[2, i]
        square = x * x + y * y + w * w
        t = 0.25 * square
        cosine = 1.0 - t * (1 / 2 - t * (1 / 24 - t * (1 / 720 - t * (1 / 40320 - t / 3628800))))
        sine = 0.5 * (1.0 - t * (1 / 6 - t * (1 / 120 - t * (1 / 5040 - t * (1 / 362880 - t / 39916800)))))
        x, y, w = sine * x, sine * y, sine * w
        a, b, c, e = turn[0, i], turn[1, i], turn[2, i], turn[3, i]
        turn[0, i] = a * cosine - (b * x + c * y + e * w)
        turn[1, i] = b * cosine + (a * x + c * w - e * y)
        turn[2, i] = c * cosine + (a * y + e * x - b * w)
        turn[3, i] = e * cosine + (a * w + b * y - c * x)
        sound[i] &= square < LARGEST_TURN * LARGEST_TURN
        total = 0.0
        for r in range(3):
            total += (places[2 * k + 2, r] + here[r, i]) ** 2
        sound[i] &= total > floor


@compiled
def _run(
    constants: Array, epochs: IndexArray, durations: Array, motion: Array, force: Array, thrust: Array, inputs: Array,
    biases: Array, decays: Array, sizes: Array, factors: Array, places: Array, fields: Array, gradients: Array,
    output_maps: Array, equipment: Array, state: Array, linear: Array, seed: np.uint64, samples: NDArray[np.uint64],
    given: Array, noisy: bool, turns: Array, deviations: Array, predicted: Array, valid: NDArray[np.bool_],
) -> None:  # fmt: skip
    steps, count, width = len(durations), len(sizes), factors.shape[1]
    normals = np.zeros((LANES, (count + steps * width) if noisy else 0))
    theta = np.zeros((inputs.shape[1], LANES))
    z, turn, d = np.zeros((9, LANES)), np.zeros((4, LANES)), np.zeros((6, LANES))
    bias, drawn, normal = np.zeros((count, LANES)), np.zeros((width, LANES)), np.zeros(LANES)
    local, first, here = np.zeros((9, LANES)), np.zeros((3, LANES)), np.zeros((3, LANES))
    scratch = room()
    sound = np.zeros(LANES, dtype=np.bool_)
    for begin in range(0, len(state), LANES):
        lanes = min(LANES, len(state) - begin)
        for i in range(LANES):
            row = begin + min(i, lanes - 1)
            sound[i] = True
            for p in range(len(theta)):
                theta[p, i] = equipment[row, p]
            for r in range(9):
                z[r, i] = linear[row, r]
            for r in range(4):
                turn[r, i] = state[row, r]
            for r in range(6):
                d[r, i] = state[row, 4 + r] - z[3 + r, i]
            if noisy and given.shape[1] == 0:
                draw_normals(seed, samples[row], IMU_STREAM, normals[i])
            for b in range(count):
                bias[b, i] = sizes[b] * normals[i, b] if noisy and given.shape[1] == 0 else 0.0
        for r in range(3):
            for i in range(LANES):
                here[r, i] = z[6 + r, i] + d[3 + r, i]
        bend(constants, places[0], fields[0], gradients[0], here, first)
        reached = 0
        for k in range(steps + 1):
            if reached < len(epochs) and epochs[reached] == k:
                for i in range(lanes):
                    for r in range(4):
                        turns[begin + i, reached, r] = turn[r, i]
                    for r in range(6):
                        deviations[begin + i, reached, r] = z[3 + r, i] + d[r, i]
                    for r in range(9):
                        total = 0.0
                        for c in range(9):
                            total += output_maps[reached, r, c] * z[c, i]
                        predicted[begin + i, reached, r] = total
                reached += 1
            if k == steps:
                break
            local[:] = 0.0
            for p in range(len(theta)):
                for r in range(9):
                    weight = inputs[k, p, r]
                    for i in range(LANES):
                        local[r, i] += weight * theta[p, i]
            for b in range(count):
                for r in range(9):
                    weight = biases[k, b, r]
                    for i in range(LANES):
                        local[r, i] += weight * bias[b, i]
                for i in range(LANES):
                    bias[b, i] *= decays[k, b]
            if noisy:
                if given.shape[1] > 0:
                    for r in range(width):
                        for i in range(LANES):
                            drawn[r, i] = given[begin + min(i, lanes - 1), k * width + r]
                else:
                    drawn[:] = 0.0
                    for c in range(width):
                        for i in range(LANES):
                            normal[i] = normals[i, count + k * width + c]
                        for r in range(c, width):
                            weight = factors[k, r, c]
                            for i in range(LANES):
                                drawn[r, i] += weight * normal[i]
                for r in range(9):
                    for i in range(LANES):
                        local[r, i] += drawn[r, i]
                for b in range(count):
                    for i in range(LANES):
                        bias[b, i] += drawn[9 + b, i]
            advance(
                k, constants, durations, motion, force, thrust, places, fields, gradients, local, z, turn, d, first,
                here, scratch, sound,
            )  # fmt: skip
        for i in range(lanes):
            valid[begin + i] = sound[i]
