"""Many samples of the navigator: the nonlinear errors and the linear ones of the same draws, noise included.

The truth is shared, so that a sample is a deviation from it (`mcnav.systems.ins.linear.response`)::

    R' = R [C dw]x        v' = (R - I) C f + R C df + g(r + x) - g(r)        x' = v

Of a step, what is linear in the sample is computed by the tables, exactly. What is left is of second order, and changes
slowly: over a step the rotation R at its beginning is applied to the truth's force and to the step's own linear
response, the products of errors within the step are taken from their means, and the remainder of gravity by Simpson's
rule. The linear errors of the same draws are a sum over the steps (`mcnav.systems.ins.ensemble.adjoint`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mcnav.arrays.types import Array, IndexArray
from mcnav.compiled.jit import allocation_free, compiled
from mcnav.compiled.shapes import check_shapes
from mcnav.compiled.vectors import LANES, Store, load, room, store
from mcnav.sampler.normals import draw_normals
from mcnav.systems.ins.ensemble.adjoint import Adjoint, add_linear, adjoint_of_free
from mcnav.systems.ins.ensemble.deviations import StartingPoint, deviate, starting_point
from mcnav.systems.ins.ensemble.readout import LOCAL, TrueStates, copy_linear, copy_rows, read_errors, true_states
from mcnav.systems.ins.ensemble.sample_groups import STEPS_OF_BLOCK, SampleGroups, put_aside, sample_groups, take_back
from mcnav.systems.ins.ensemble.steps import (
    Deviations,
    StepTables,
    add_given,
    advance,
    deviations_of,
    place,
    respond,
    start,
)
from mcnav.systems.ins.filter.model import NAVIGATION
from mcnav.systems.ins.imu.instruments import CONSTANTS, GYRO, IMU_STREAM, Imu
from mcnav.systems.ins.linear.covariance import output_map, process_systems
from mcnav.systems.ins.linear.response import StepResponses
from mcnav.systems.ins.linear.response_blocks import Responses
from mcnav.systems.ins.truth.trajectory import Platform, Truth


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
    responses : Responses
        Of which those to the constant errors of the instruments are taken.
    biases, decays : ndarray, shape (K, b, 9), (K, b)
        Responses to the biases of processes at the beginning, and what is left of these at the end.
    sizes : ndarray, shape (b,)
        Sigmas of the biases at the start.
    factors : ndarray, shape (K, 9 + b, 9 + b)
        Cholesky factors of the covariance that processes add.
    places, fields, gradients : ndarray, shape (2 K + 1, 3), (2 K + 1, 3), (2 K + 1, 3, 3)
        True position, gravitation and its gradient at the ends and the middles of steps.
    curvatures : ndarray, shape (K, 3, 6)
        Of the field in the middles, as `mcnav.systems.ins.earth.Earth.zonal_curvature` has it.
    start : StartingPoint
    start_map, output_maps : ndarray, shape (9, 9), (m, 9, 9)
        From initial errors to psi, v, x, and from these to outputs, to first order.
    truth : TrueStates
        At the epochs.
    """

    epochs: IndexArray
    durations: Array
    motion: Array
    force: Array
    thrust: Array
    responses: Responses
    biases: Array
    decays: Array
    sizes: Array
    factors: Array
    places: Array
    fields: Array
    gradients: Array
    curvatures: Array
    start: StartingPoint
    start_map: Array
    output_maps: Array
    truth: TrueStates

    @cached_property
    def adjoint(self) -> Adjoint:
        """Responses of the linear errors at the last epoch of a navigator without aiding."""
        return adjoint_of_free(self.motion, int(self.epochs[-1]), self.output_maps[-1])

    def inputs(self, active: IndexArray) -> Array:
        """Return the responses to constant errors of the instruments, by their numbers, shape (K, p, 9)."""
        of_gyro = active < len(GYRO)
        table = np.zeros((len(self.durations), len(active), NAVIGATION))
        if len(active):
            for block, responses in self.responses.blocks():
                table[block, of_gyro] = responses.gyro[:, active[of_gyro]]
                table[block, ~of_gyro, 3:] = responses.accelerometer[:, active[~of_gyro] - len(GYRO)]
        return table

    def steps(self, active: IndexArray, adjoint: Adjoint) -> StepTables:
        """Return what compiled code takes of it.

        Parameters
        ----------
        active : ndarray of int, shape (p,)
            Numbers of the constant errors of the instruments that are not zero.
        """
        return StepTables(
            self.start.constants, self.durations, self.motion, self.force, self.thrust,
            self.inputs(active), int(np.count_nonzero(active < len(GYRO))), self.biases,
            self.decays, self.factors, self.places, self.fields, self.gradients, self.curvatures, adjoint.steps,
        )  # fmt: skip

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
            truth=TrueStates(*(each[-1:] for each in self.truth)),
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
            # L_jj^2 = P_jj - sum of L_jc^2
            pivot = correlation[k, j, j]
            for c in range(j):
                pivot -= factor[k, j, c] * factor[k, j, c]
            if pivot <= 1e-12:
                continue
            root = np.sqrt(pivot)
            factor[k, j, j] = root
            for i in range(j + 1, size):
                # L_ij = (P_ij - sum of L_ic L_jc) / L_jj
                value = correlation[k, i, j]
                for c in range(j):
                    value -= factor[k, i, c] * factor[k, j, c]
                factor[k, i, j] = value / root
    return factor


def tabulate(truth: Truth, platform: Platform, responses: Responses, imu: Imu, epochs: IndexArray) -> EnsembleTables:
    """Prepare the tables for samples from the responses over the steps."""
    times = responses.times
    steps = len(times) - 1
    systems = process_systems(responses.between(0, 1), imu)
    biased = {name: float(variance) for name, (response, _, variance) in systems.items() if response.any()}
    width = NAVIGATION + len(biased)
    at = truth.states(times[epochs], platform, float(times[0]))
    tables = EnsembleTables(
        epochs=epochs,
        durations=np.diff(times),
        motion=np.empty((steps, 6, 9)),
        force=np.empty((steps, 6, 9)),
        thrust=np.empty((steps, 6)),
        responses=responses,
        biases=np.empty((steps, len(biased), 9)),
        decays=np.empty((steps, len(biased))),
        sizes=np.sqrt(np.array(list(biased.values()))),
        factors=np.empty((steps, width, width)),
        places=np.empty((2 * steps + 1, 3)),
        fields=np.empty((2 * steps + 1, 3)),
        gradients=np.empty((2 * steps + 1, 3, 3)),
        curvatures=np.empty((steps, 3, 6)),
        start=starting_point(truth, float(times[0])),
        start_map=np.asarray(np.linalg.inv(output_map(truth, float(times[0]))), dtype=float),
        output_maps=np.stack([output_map(truth, float(time)) for time in times[epochs]]),
        truth=true_states(truth.earth, np.hstack([at.position, at.velocity])),
    )
    for block, of_block in responses.blocks():
        _fill_steps(tables, block, of_block, process_systems(of_block, imu), tuple(biased))
        _fill_places(tables, block, of_block.times, truth, platform)
    return tables


def _fill_places(tables: EnsembleTables, block: slice, times: Array, truth: Truth, platform: Platform) -> None:
    """Fill in the true places at the ends and the middles of a block's steps, and the field there."""
    halves, where = np.empty(2 * len(times) - 1), slice(2 * block.start, 2 * block.stop + 1)
    halves[0::2], halves[1::2] = times, 0.5 * (times[:-1] + times[1:])
    places = truth.states(halves, platform, float(tables.responses.times[0])).position
    tables.places[where], tables.fields[where] = places, truth.earth.gravitation(places)
    tables.gradients[where] = truth.earth.gravity_gradient(places)
    tables.curvatures[block] = truth.earth.zonal_curvature(places[1::2])


def _fill_steps(
    tables: EnsembleTables, block: slice, responses: StepResponses, systems: Mapping[str, tuple[Array, Array, Array]],
    biased: tuple[str, ...],
) -> None:  # fmt: skip
    """Fill in the steps of a block.

    Parameters
    ----------
    systems : mapping
        Processes over these steps, as `process_systems` has them.
    biased : tuple of str
        Those that are biases.
    """
    tables.motion[block, :, :3], tables.motion[block, :, 3:] = responses.attitude, responses.motion
    tables.force[block] = responses.force.reshape(-1, 6, 9)
    tables.thrust[block] = np.einsum("krii->kr", responses.force)  # N is the identity
    width = NAVIGATION + len(biased)
    covariance = np.zeros((len(responses.force), width, width))
    for _, noise, _ in systems.values():
        covariance[:, :NAVIGATION, :NAVIGATION] += noise[:, :NAVIGATION, :NAVIGATION]
    for number, name in enumerate(biased):
        response, noise, _ = systems[name]
        tables.biases[block, number], tables.decays[block, number] = response[:, :NAVIGATION], response[:, NAVIGATION]
        covariance[:, NAVIGATION + number, :NAVIGATION] = noise[:, NAVIGATION, :NAVIGATION]
        covariance[:, :NAVIGATION, NAVIGATION + number] = noise[:, :NAVIGATION, NAVIGATION]
        covariance[:, NAVIGATION + number, NAVIGATION + number] = noise[:, NAVIGATION, NAVIGATION]
    tables.factors[block] = semidefinite_factor(covariance)


@dataclass(frozen=True)
class EnsembleErrors:
    """Navigation errors of n samples at m epochs.

    Attributes
    ----------
    values : ndarray, shape (n, m, 9)
    linear : ndarray, shape (n, 9)
        At the last epoch, by the linear system from the same draws.
    valid : ndarray of bool, shape (n,)
        Whether a sample stayed where the scheme holds.
    """

    values: Array
    linear: Array
    valid: NDArray[np.bool_]


class _LaneRooms(NamedTuple):
    """Room for LANES samples at work, and for all of them between two blocks of steps."""

    samples: Deviations
    normals: Array
    numbers: NDArray[np.uint64]
    local: Array
    axes: Array
    errors: Array
    groups: SampleGroups


def simulate(tables: EnsembleTables, errors: Array, seed: int, samples: IndexArray) -> EnsembleErrors:
    """Simulate samples with noise of their own.

    Parameters
    ----------
    errors : ndarray, shape (n, 39)
        Constant errors in the order of `mcnav.systems.ins.imu.instruments.CONSTANTS`.
    samples : ndarray of int, shape (n,)
        Indices, which together with the seed make the noise.
    """
    noisy = bool(tables.factors.any() or tables.sizes.any())
    return _simulate(tables, errors, np.uint64(seed), samples.astype(np.uint64), np.empty((0, 0)), noisy)


def simulate_given(tables: EnsembleTables, errors: Array, added: Array) -> EnsembleErrors:
    """Simulate samples of which the noise is given, as what it adds to psi, v, x and the biases in each step.

    Parameters
    ----------
    errors : ndarray, shape (n, 39)
    added : ndarray, shape (n, K, 9 + b)
    """
    given = np.ascontiguousarray(added.reshape(len(errors), -1))
    return _simulate(tables, errors, np.uint64(0), np.zeros(len(errors), np.uint64), given, True)


def _simulate(
    tables: EnsembleTables, errors: Array, seed: np.uint64, samples: NDArray[np.uint64], given: Array, noisy: bool
) -> EnsembleErrors:
    errors, width = np.ascontiguousarray(errors, dtype=float), tables.factors.shape[1]
    check_shapes((
        ("errors", errors, (None, len(CONSTANTS))),
        ("samples", samples, (len(errors),)),
        ("added", given, (len(errors), len(tables.durations) * width) if given.size else (0, 0)),
    ))  # fmt: skip
    state = deviate(tables.start, errors[:, :9])
    active = np.flatnonzero(errors[:, 9:].any(axis=0))
    # a matrix product rounds by a row's place
    linear = np.einsum("nj,ij->ni", errors[:, :9], tables.adjoint.start @ tables.start_map)
    values, predicted = np.empty((len(errors), len(tables.epochs), 9)), np.empty((len(errors), 9))
    sound = np.empty(len(errors), dtype=np.bool_)
    keep = Store()
    lanes = _LaneRooms(
        deviations_of(len(active), len(tables.sizes), keep, keep), room(max(STEPS_OF_BLOCK * width, len(tables.sizes))),
        np.zeros((1, LANES), dtype=np.uint64), room(LOCAL), room(9), room(9),
        sample_groups(len(errors), keep),
    )  # fmt: skip
    _run(
        tables.steps(active, tables.adjoint), tables.epochs, tables.truth, tables.sizes,
        np.ascontiguousarray(errors[:, 9 + active]), state, linear, seed, samples, given, noisy, lanes, values,
        predicted, sound,
    )  # fmt: skip
    return EnsembleErrors(values, predicted, sound & np.isfinite(values).all(axis=(1, 2)))


@allocation_free
def _run(
    tables: StepTables, epochs: IndexArray, truth: TrueStates, sizes: Array, equipment: Array, state: Array,
    linear: Array, seed: np.uint64, indices: NDArray[np.uint64], given: Array, noisy: bool,
    lanes: _LaneRooms, values: Array, predicted: Array, valid: NDArray[np.bool_],
) -> None:  # fmt: skip
    """Simulate all samples, LANES at a time: each group over a block of steps, whose tables stay in the cache."""
    samples, normals, steps, count = lanes.samples, lanes.normals, len(tables.durations), len(sizes)
    groups, passed, width = len(lanes.groups.others), 0, tables.factors.shape[1]
    drawing = noisy and given.shape[1] == 0
    for block in range(0, steps + 1, STEPS_OF_BLOCK):
        end = min(block + STEPS_OF_BLOCK, steps + 1)
        reached, drawn = passed, (min(end, steps) - block) * width
        for group in range(groups):
            begin = group * LANES
            size, reached = min(LANES, len(state) - begin), passed
            # a group's samples; the last one fills what is left of the lanes
            for i in range(LANES):
                lanes.numbers[0, i] = indices[begin + min(i, size - 1)]
            # at the start: deviations, and biases of processes by their sigmas
            if block == 0:
                for i in range(LANES):
                    row = begin + min(i, size - 1)
                    place(i, equipment[row], linear[row], state[row], samples)
                start(0, tables, samples)
                if drawing:
                    draw_normals(seed, lanes.numbers, IMU_STREAM, 0, count, normals)
                for q in range(count):
                    store(samples.bias, q, sizes[q] * load(normals, q) if drawing else 0.0 * load(normals, q))
            elif groups > 1:
                take_back(group, lanes.groups)
            if drawing:
                draw_normals(seed, lanes.numbers, IMU_STREAM, count + block * width, drawn, normals)
            for k in range(block, end):
                # errors at an epoch
                if reached < len(epochs) and epochs[reached] == k:
                    read_errors(
                        reached, tables.constants, truth, samples.turn, samples.moved, lanes.local, lanes.axes,
                        lanes.errors,
                    )  # fmt: skip
                    copy_rows(lanes.errors, begin, size, reached, values)
                    reached += 1
                    if reached == len(epochs):
                        copy_linear(samples.linear, begin, size, predicted)
                if k == steps:
                    break
                # a step: the response to errors, its part of the linear errors, the deviations
                respond(k, tables, drawing, normals, (k - block) * width, samples)
                if noisy and not drawing:
                    for i in range(LANES):
                        add_given(given[begin + min(i, size - 1), k * width : (k + 1) * width], i, samples)
                add_linear(tables.adjoint, k, 9, samples.response, samples.linear)
                advance(k, tables, samples)
            if end > steps:
                for i in range(size):
                    valid[begin + i] = samples.sound[0, i] > 0.0
            elif groups > 1:
                put_aside(group, lanes.groups)
        passed = reached
