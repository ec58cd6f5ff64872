"""Linear response of the navigation errors over the steps of a grid, computed once and shared by all samples.

In inertial axes, with the rotation psi from true to indicated axes, deviations v and x of velocity and position, C from
instruments' axes to inertial ones, F = C f, and the gravity gradient G::

    psi' = C dw        v' = psi x F + C df + G x        x' = v

The errors of the instruments, dw and df, are linear in the constant errors, so that their response over a step is a
table; for white noise and the biases it drives it is a covariance. The tables are integrals over the truth at its own
rate, whatever the length of the step: a backward recursion of the response at the step's end, by the two-stage Gauss
method on intervals in which the truth is smooth (order 4).

Quantization is white noise n of the accumulated angle, dw = n', and m of the accumulated velocity, df = m'. Without
the errors C n and C m of the present readings, the deviations have no derivative of noise in them (Savage 2002,
*Analytical modeling of sensor quantization in strapdown inertial navigation error equations*)::

    (psi - C n)' = -C (w x n)        (v - C m)' = (C n) x F - C (w x m) + ...        x' = (v - C m) + C m

so that n and m drive them like white noise of density Q^2 times the interval between readings.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from mcnav.arrays.types import Array, IndexArray
from mcnav.compiled.jit import allocation_free_loop, allocation_free_part
from mcnav.systems.ins.imu.instruments import CROSS_AXES, Imu
from mcnav.systems.ins.linear.gravity_response import GravityResponses, respond_to_gravity
from mcnav.systems.ins.linear.quadrature import (
    AHEAD,
    LATER,
    LONGEST_INTERVAL,
    NODE,
    SHARE_OF_CORRELATION,
    advance_motion,
    intervals_of,
)
from mcnav.systems.ins.truth.trajectory import Platform, Truth

_ROW: Final = np.array(["xyz".index(pair[0]) for pair in CROSS_AXES])
_COLUMN: Final = np.array(["xyz".index(pair[1]) for pair in CROSS_AXES])


COVARIANCES: Final = slice(10, 18)
"""Covariances among the fields of `StepResponses`."""


class StepResponses(NamedTuple):
    """Responses over K steps: of psi, v, x (9 rows), or of v, x alone (6 rows), at the end of a step.

    Attributes
    ----------
    times : ndarray, shape (K + 1,)
    attitude : ndarray, shape (K, 6, 3)
        To psi at the beginning, which itself does not change.
    motion : ndarray, shape (K, 6, 6)
        To v and x at the beginning.
    force : ndarray, shape (K, 6, 3, 3)
        To a velocity changing by ``N F`` with a constant matrix N, by its elements.
    gyro : ndarray, shape (K, 15, 9)
        To constant errors in the order of `mcnav.systems.ins.imu.instruments.GYRO`.
    accelerometer : ndarray, shape (K, 15, 6)
    gyro_state, gyro_walk : ndarray, shape (K, 3, 9)
        To the Gauss-Markov bias, and to the rate random walk's, at the beginning, by axis.
    accelerometer_state, accelerometer_walk : ndarray, shape (K, 3, 6)
    gyro_white, accelerometer_white : ndarray, shape (K, 3, 9, 9), (K, 3, 6, 6)
        Covariance from white noise of unit density, by axis.
    gyro_driven, gyro_walked : ndarray, shape (K, 3, 10, 10)
        Covariance, together with the bias, from white noise of unit density that drives the Gauss-Markov bias, and the
        rate random walk.
    accelerometer_driven, accelerometer_walked : ndarray, shape (K, 3, 7, 7)
    gyro_quantized, accelerometer_quantized : ndarray, shape (K, 3, 9, 9), (K, 3, 6, 6)
        Covariance from quantization of unit density without that of the readings at both ends; zero if no instrument
        has any.
    axes : ndarray, shape (K + 1, 3, 3)
        From instruments' to inertial axes at the times.
    gravity : GravityResponses
        To gravity disturbances.
    """

    times: Array
    attitude: Array
    motion: Array
    force: Array
    gyro: Array
    accelerometer: Array
    gyro_state: Array
    gyro_walk: Array
    accelerometer_state: Array
    accelerometer_walk: Array
    gyro_white: Array
    accelerometer_white: Array
    gyro_driven: Array
    gyro_walked: Array
    accelerometer_driven: Array
    accelerometer_walked: Array
    gyro_quantized: Array
    accelerometer_quantized: Array
    axes: Array
    gravity: GravityResponses


def respond(truth: Truth, platform: Platform, times: Array, imu: Imu, start: float | None = None) -> StepResponses:
    """Compute the responses over the steps between rising times.

    Parameters
    ----------
    start : float, optional
        Of navigation, s; none where that is the first of the times.
    """
    start = float(times[0]) if start is None else start
    constants = np.array([imu.gyro.correlation_time, imu.accelerometer.correlation_time])
    longest = min(LONGEST_INTERVAL, SHARE_OF_CORRELATION * float(constants.min()))
    bounds = intervals_of(truth, times, longest)
    lengths = np.diff(bounds)
    nodes = np.stack([bounds[:-1] + NODE * lengths, bounds[1:] - NODE * lengths], axis=1)
    states = truth.states(nodes.ravel(), platform, start)
    gradient = truth.earth.gravity_gradient(0.5 * (states.position[0::2] + states.position[1::2]))
    at_times = truth.states(times, platform, start)
    responses = _rooms_for(times, at_times.axes, respond_to_gravity(truth, times, imu.gravity))
    quadrature = _Quadrature(
        np.searchsorted(bounds, times), lengths, states.axes.reshape(-1, 2, 3, 3), states.force.reshape(-1, 2, 3),
        states.rate.reshape(-1, 2, 3), gradient,
    )  # fmt: skip
    _respond(quadrature, _Instruments(constants, _ROW, _COLUMN, imu.quantized), _work(), responses)
    for covariances in responses[COVARIANCES]:  # of which the lower triangles are known
        row, column = np.tril_indices(covariances.shape[-1], -1)
        covariances[..., column, row] = covariances[..., row, column]
    return responses


def responses_between(responses: StepResponses, first: int, last: int) -> StepResponses:
    """Return the responses over the steps from the first to before the last, in the same memory."""
    times, *tables, axes, gravity = responses
    of_gravity = GravityResponses._make(table[first:last] for table in gravity)
    of_steps = (table[first:last] for table in tables)
    return StepResponses._make((times[first : last + 1], *of_steps, axes[first : last + 1], of_gravity))


def join_responses(blocks: Sequence[StepResponses]) -> StepResponses:
    """Return the responses over the steps of blocks that follow one another."""
    if len(blocks) == 1:
        return blocks[0]
    times, *tables, axes, gravity = zip(*blocks, strict=True)
    of_times, of_axes = (np.concatenate([each[0], *(more[1:] for more in each[1:])]) for each in (times, axes))
    of_gravity = GravityResponses._make(np.concatenate(table) for table in zip(*gravity, strict=True))
    return StepResponses._make((of_times, *map(np.concatenate, tables), of_axes, of_gravity))


def _rooms_for(times: Array, axes: Array, gravity: GravityResponses) -> StepResponses:
    """Return responses over the steps between times, which are zero but for those to gravity disturbances."""
    shapes = (
        (6, 3), (6, 6), (6, 3, 3), (15, 9), (15, 6), (3, 9), (3, 9), (3, 6), (3, 6),
        (3, 9, 9), (3, 6, 6), (3, 10, 10), (3, 10, 10), (3, 7, 7), (3, 7, 7), (3, 9, 9), (3, 6, 6),
    )  # fmt: skip
    return StepResponses._make((times, *(np.zeros((len(times) - 1, *shape)) for shape in shapes), axes, gravity))


class _Quadrature(NamedTuple):
    """The truth at the nodes of J intervals, of which K steps consist.

    Attributes
    ----------
    begins : ndarray of int, shape (K + 1,)
        First interval of each step.
    lengths : ndarray, shape (J,)
    axes, forces, rates : ndarray, shapes (J, 2, 3, 3), (J, 2, 3), (J, 2, 3)
        C, f and w at the nodes.
    gradients : ndarray, shape (J, 3, 3)
        G, in the middle.
    """

    begins: IndexArray
    lengths: Array
    axes: Array
    forces: Array
    rates: Array
    gradients: Array


class _Instruments(NamedTuple):
    """Correlation times, shape (2, 3), axes that are mixed by cross-axis errors, and whether there is quantization."""

    correlation: Array
    row: IndexArray
    column: IndexArray
    quantized: bool


class _Work(NamedTuple):
    """Responses at the end of a step, of v and x, 6 rows, or of psi, v, x, to what happens in an interval before.

    Attributes
    ----------
    of_psi, of_v, of_x : ndarray, shape (6, 3)
        To psi, v and x at the end of the interval.
    along, apart : ndarray, shape (2, 6, 3)
        To v and to x at the nodes.
    turning : ndarray, shape (2, 6, 3)
        To psi through the force there, per second.
    to_gyro, to_accelerometer : ndarray, shapes (2, 3, 9), (2, 3, 6)
        To the error of a reading at the nodes, per second, by axis.
    inertial : ndarray, shape (3,)
        The force F at a node.
    node : ndarray, shape (10,)
        A response at a node, with that of a bias.
    """

    of_psi: Array
    of_v: Array
    of_x: Array
    along: Array
    apart: Array
    turning: Array
    to_gyro: Array
    to_accelerometer: Array
    inertial: Array
    node: Array


def _work() -> _Work:
    shapes = ((6, 3), (6, 3), (6, 3), (2, 6, 3), (2, 6, 3), (2, 6, 3), (2, 3, 9), (2, 3, 6), (3,), (10,))
    return _Work(*(np.zeros(shape) for shape in shapes))


@allocation_free_part
def _add_products(total: Array, vector: Array, weight: float, size: int) -> None:
    """Add a weighted outer product to the lower triangle."""
    for i in range(size):
        scaled = weight * vector[i]
        for j in range(i + 1):
            total[i, j] += scaled * vector[j]


@allocation_free_loop
def _respond(quadrature: _Quadrature, instruments: _Instruments, work: _Work, out: StepResponses) -> None:
    """Go through the intervals of each step from the last to the first."""
    for k in range(len(quadrature.begins) - 1):
        _begin_at_the_end(work)
        remaining = 0.0  # from the end of the interval to that of the step
        for j in range(quadrature.begins[k + 1] - 1, quadrature.begins[k] - 1, -1):
            _respond_at_nodes(k, j, quadrature, work, out)
            _respond_to_readings(j, quadrature, work)
            _add_constant_errors(k, j, quadrature, instruments, work, out)
            for a in range(3):
                _drive(
                    out.gyro_state[k, a], out.gyro_walk[k, a], out.gyro_driven[k, a], out.gyro_walked[k, a],
                    work.to_gyro[0, a], work.to_gyro[1, a], work.node, 9, quadrature.lengths[j], remaining,
                    instruments.correlation[0, a],
                )  # fmt: skip
                _drive(
                    out.accelerometer_state[k, a], out.accelerometer_walk[k, a], out.accelerometer_driven[k, a],
                    out.accelerometer_walked[k, a], work.to_accelerometer[0, a], work.to_accelerometer[1, a], work.node,
                    6, quadrature.lengths[j], remaining, instruments.correlation[1, a],
                )  # fmt: skip
            if instruments.quantized:
                _add_quantization(k, j, quadrature, work, out)
            _go_back(j, quadrature, work)
            remaining += quadrature.lengths[j]
        for r in range(6):
            for m in range(3):
                out.attitude[k, r, m] = work.of_psi[r, m]
                out.motion[k, r, m], out.motion[k, r, 3 + m] = work.of_v[r, m], work.of_x[r, m]


@allocation_free_part
def _begin_at_the_end(work: _Work) -> None:
    """Let the responses be those at the end of a step: v and x to themselves."""
    for r in range(6):
        for m in range(3):
            work.of_psi[r, m] = 0.0
            work.of_v[r, m] = 1.0 if r == m else 0.0
            work.of_x[r, m] = 1.0 if r == 3 + m else 0.0


@allocation_free_part
def _respond_at_nodes(k: int, j: int, quadrature: _Quadrature, work: _Work, out: StepResponses) -> None:
    """Take the responses to v and x back to the nodes; with ``v' = psi x F`` they are those to psi and to N F."""
    along, turning, inertial = work.along, work.turning, work.inertial
    h, gradient, axes, forces = quadrature.lengths[j], quadrature.gradients[j], quadrature.axes, quadrature.forces
    weight = 0.5 * h
    for i in range(2):
        advance_motion(work.of_v, work.of_x, gradient, LATER[i] * h, along[i], work.apart[i])
        # F = C f
        for r in range(3):
            inertial[r] = 0.0
            for m in range(3):
                inertial[r] += axes[j, i, r, m] * forces[j, i, m]
        # rows of the response to v, times [F]x; integral of v' = N F
        for r in range(6):
            x, y, z = along[i, r, 0], along[i, r, 1], along[i, r, 2]
            turning[i, r, 0] = inertial[1] * z - inertial[2] * y
            turning[i, r, 1] = inertial[2] * x - inertial[0] * z
            turning[i, r, 2] = inertial[0] * y - inertial[1] * x
            for m in range(3):
                for n in range(3):
                    out.force[k, r, m, n] += weight * along[i, r, m] * inertial[n]


@allocation_free_part
def _respond_to_readings(j: int, quadrature: _Quadrature, work: _Work) -> None:
    """Compute the responses to errors of the readings at the nodes: ``psi' = C dw`` and ``v' = C df``."""
    along, turning, h, axes = work.along, work.turning, quadrature.lengths[j], quadrature.axes
    for i in range(2):
        for a in range(3):
            for r in range(3):
                work.to_gyro[i, a, r] = axes[j, i, r, a]
            for r in range(6):
                total, pushed = 0.0, 0.0
                for m in range(3):
                    # psi acts on v from the node to the end of the interval, and after it
                    turn = work.of_psi[r, m] + h * (AHEAD[i][0] * turning[0, r, m] + AHEAD[i][1] * turning[1, r, m])
                    total += turn * axes[j, i, m, a]
                    pushed += along[i, r, m] * axes[j, i, m, a]
                work.to_gyro[i, a, 3 + r] = total
                work.to_accelerometer[i, a, r] = pushed


@allocation_free_part
def _add_constant_errors(
    k: int, j: int, quadrature: _Quadrature, instruments: _Instruments, work: _Work, out: StepResponses
) -> None:
    """Add an interval's part of the responses to constant errors of the readings, and of white noise's covariance.

    Readings have errors 1, w, w of another axis and f (gyros); 1, f, f of another axis and f^2 (accelerometers).
    """
    to_gyro, to_accelerometer, row, column = work.to_gyro, work.to_accelerometer, instruments.row, instruments.column
    forces, rates, weight = quadrature.forces, quadrature.rates, 0.5 * quadrature.lengths[j]
    for i in range(2):
        for a in range(3):
            f, w = forces[j, i, a], rates[j, i, a]
            # bias, scale factor, g-sensitivity
            for r in range(9):
                size = weight * to_gyro[i, a, r]
                out.gyro[k, a, r] += size
                out.gyro[k, 3 + a, r] += w * size
                out.gyro[k, 12 + a, r] += f * size
            # bias, scale factor, nonlinearity
            for r in range(6):
                size = weight * to_accelerometer[i, a, r]
                out.accelerometer[k, a, r] += size
                out.accelerometer[k, 3 + a, r] += f * size
                out.accelerometer[k, 12 + a, r] += f * f * size
            # white noise of unit density: integral of (response)(response)^T
            _add_products(out.gyro_white[k, a], to_gyro[i, a], weight, 9)
            _add_products(out.accelerometer_white[k, a], to_accelerometer[i, a], weight, 6)
        # cross-axis errors: a reading along one axis of what is along another
        for p in range(6):
            w, f = weight * rates[j, i, column[p]], weight * forces[j, i, column[p]]
            for r in range(9):
                out.gyro[k, 6 + p, r] += w * to_gyro[i, row[p], r]
            for r in range(6):
                out.accelerometer[k, 6 + p, r] += f * to_accelerometer[i, row[p], r]


@allocation_free_part
def _add_quantization(k: int, j: int, quadrature: _Quadrature, work: _Work, out: StepResponses) -> None:
    """Add an interval's part of the covariance from quantization: responses to n and m (module docstring)."""
    node, axes, rates, weight = work.node, quadrature.axes, quadrature.rates, 0.5 * quadrature.lengths[j]
    for i in range(2):
        for a in range(3):
            # psi' = -C (w x n), v' = (C n) x F
            _turn_back(node, work.to_gyro[i], rates[j, i], a, 9)
            for r in range(6):
                for m in range(3):
                    node[3 + r] += work.turning[i, r, m] * axes[j, i, m, a]
            _add_products(out.gyro_quantized[k, a], node, weight, 9)
            # v' = -C (w x m), x' = C m
            _turn_back(node, work.to_accelerometer[i], rates[j, i], a, 6)
            for r in range(6):
                for m in range(3):
                    node[r] += work.apart[i, r, m] * axes[j, i, m, a]
            _add_products(out.accelerometer_quantized[k, a], node, weight, 6)


@allocation_free_part
def _go_back(j: int, quadrature: _Quadrature, work: _Work) -> None:
    """Take the responses to psi, v and x from the end of an interval to its beginning."""
    weight, turning, of_v, of_x = 0.5 * quadrature.lengths[j], work.turning, work.along[0], work.along[1]
    for r in range(6):
        for m in range(3):
            work.of_psi[r, m] += weight * (turning[0, r, m] + turning[1, r, m])
            of_v[r, m], of_x[r, m] = work.of_v[r, m], work.of_x[r, m]
    advance_motion(of_v, of_x, quadrature.gradients[j], quadrature.lengths[j], work.of_v, work.of_x)


@allocation_free_part
def _turn_back(out: Array, responses: Array, rate: Array, a: int, size: int) -> None:
    """Compute the response to -(w x e_a) from the responses to readings along the three axes, shape (3, size)."""
    b, c = (a + 1) % 3, (a + 2) % 3
    for r in range(size):
        out[r] = rate[b] * responses[c, r] - rate[c] * responses[b, r]


@allocation_free_part
def _drive(
    state: Array, walk: Array, driven: Array, walked: Array, first: Array, second: Array, node: Array, size: int,
    h: float, remaining: float, correlation: float,
) -> None:  # fmt: skip
    """Take the responses to a Gauss-Markov bias and to a random walk back by one interval, with their noise.

    Parameters
    ----------
    first, second : ndarray, shape (size,)
        Responses to the error of a reading at the nodes, per second.
    node : ndarray, shape (10,)
        Room.
    remaining : float
        From the end of the interval to that of the step, s.
    correlation : float
        Correlation time, s.
    """
    root = np.sqrt(3.0) / 6.0
    weight = 0.5 * h
    between = np.exp(-2.0 * root * h / correlation)  # decay from the first node to the second
    to_end = (np.exp(-(0.5 + root) * h / correlation), np.exp(-(0.5 - root) * h / correlation))
    whole = np.exp(-remaining / correlation)
    for i in range(2):
        # integrals from the node to the end, of readings at both, and how a bias fades between them
        one, other = (0.25, 0.25 + root) if i == 0 else (0.25 - root, 0.25)
        early, late = (1.0, between) if i == 0 else (1.0 / between, 1.0)
        # to a Gauss-Markov bias driven at the node: through readings from there on, and of the bias itself at the end
        for r in range(size):
            node[r] = to_end[i] * state[r] + h * (one * early * first[r] + other * late * second[r])
        node[size] = whole * to_end[i]
        _add_products(driven, node, weight, size + 1)
        # the same of a random walk
        for r in range(size):
            node[r] = walk[r] + h * (one * first[r] + other * second[r])
        node[size] = 1.0
        _add_products(walked, node, weight, size + 1)
    from_start = (np.exp(-(0.5 - root) * h / correlation), np.exp(-(0.5 + root) * h / correlation))
    all_of_it = np.exp(-h / correlation)
    # to a bias at the beginning of the interval
    for r in range(size):
        state[r] = all_of_it * state[r] + weight * (from_start[0] * first[r] + from_start[1] * second[r])
        walk[r] += weight * (first[r] + second[r])
