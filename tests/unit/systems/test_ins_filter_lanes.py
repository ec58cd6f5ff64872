"""Covariances of filters in lanes: steps and updates against matrix algebra, and the digits of Joseph's form."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mcnav.arrays.types import Array, IndexArray
from mcnav.compiled.blocks import blocks_of
from mcnav.compiled.vectors import LANES, PARTS, parts_of, room
from mcnav.systems.ins.ensemble.filters import (
    Covariances,
    FilterSteps,
    FilterUpdates,
    covariances_in_lanes,
    covariances_of,
    factor_innovations,
    filter_steps,
    filter_updates,
    project_along_samples,
    project_along_truth,
    update_covariances,
)
from mcnav.systems.ins.ensemble.propagation import propagate_covariances

STATES, COMPONENTS = 7, 4
SIZE = 9 + STATES
CORRECTED = np.array([1.0] * 12 + [0.0] * 4)
ALL = np.array([[0, 9]])
LONG = np.array([10.0])


def set_covariances(filters: Covariances, covariances: Array) -> None:
    """Let filters have covariances, shape (LANES, 9 + q, 9 + q)."""
    blocks = blocks_of(covariances)
    filters.p[:] = np.moveaxis(blocks.reshape(PARTS, -1, *blocks.shape[1:]), 1, -1)


def covariances(filters: Covariances) -> Array:
    """Return the covariances of filters, shape (LANES, 9 + q, 9 + q)."""
    size = len(filters.correction) if filters.p.shape[1] == 3 else SIZE
    found = room(size, size)
    covariances_in_lanes(filters, parts_of(found))
    lower = np.tril(np.moveaxis(found, 2, 0))
    return lower + np.tril(lower, -1).transpose(0, 2, 1)


def make(prior: float = 1.0) -> tuple[Covariances, Array, Array, Array, Array]:
    """Return filters whose lanes differ, rows of their innovations, and the measurements' variances."""
    rng = np.random.default_rng(5)
    filters = covariances_of(STATES)
    factor = prior * rng.standard_normal((LANES, SIZE, SIZE))
    covariance = factor @ factor.transpose(0, 2, 1)
    set_covariances(filters, covariance)
    rows = rng.standard_normal((LANES, COMPONENTS, SIZE))
    filters.rows[:COMPONENTS, :SIZE] = np.moveaxis(rows, 0, 2)
    return filters, covariance, rows, rows[:1, :, 9:], 1.0 + rng.random((1, COMPONENTS))


def still(corrected: Array = CORRECTED) -> FilterSteps:
    """Return tables of one step in which nothing happens."""
    motion = np.eye(6, 9, 3)[None]
    return filter_steps(
        LONG,
        motion,
        np.zeros((1, 6)),
        np.zeros((1, 9, STATES)),
        np.ones((1, STATES)),
        blocks_of(np.zeros((1, SIZE, SIZE))),
        corrected,
        np.zeros(STATES),
        1.0,
    )


def tables(
    others: Array, variances: Array, joseph: bool = False, rows: Array | None = None, bounds: IndexArray = ALL
) -> FilterUpdates:
    """Return tables of one update; its components have bounds of their own or all the same."""
    shape = (*variances.shape, 2)
    navigation = np.zeros((*variances.shape, 9)) if rows is None else rows
    careful, along = np.array([joseph]), np.array([rows is not None])
    return filter_updates(
        navigation, others, np.broadcast_to(bounds, shape), variances, along, careful, np.full((1, 1), -1)
    )


def update(
    filters: Covariances, others: Array, variances: Array, joseph: bool, accepted: float = 1.0,
    corrected: Array = CORRECTED,
) -> Array:  # fmt: skip
    """Return the covariances after an update, shape (LANES, 9 + q, 9 + q); innovations are 1, 2 and so on."""
    known, cause = tables(others, variances, joseph), room(1)
    project_along_samples(0, COMPONENTS, known, filters)
    factor_innovations(0, COMPONENTS, known.variances, np.ones((1, LANES)), cause, filters)
    assert not cause.any()
    whitened = room(6)
    for lane in range(LANES):
        root = np.tril(filters.root[:COMPONENTS, :COMPONENTS, lane])
        whitened[:COMPONENTS, lane] = np.linalg.solve(root, np.arange(1.0, 1.0 + COMPONENTS))
    share = np.full((1, LANES), accepted)
    update_covariances(0, COMPONENTS, parts_of(share), parts_of(whitened), still(corrected), known, filters)
    return covariances(filters)


def gains(covariance: Array, rows: Array, variances: Array) -> Array:
    """Compute the gains of one filter."""
    innovations = rows @ covariance @ rows.T + np.diag(variances)
    return np.asarray(covariance @ rows.T @ np.linalg.inv(innovations))


def josephs(covariance: Array, rows: Array, variances: Array) -> Array:
    """Compute one covariance after an update in Joseph's form; considered states have no gain."""
    gain = CORRECTED[:, None] * gains(covariance, rows, variances)
    kept = np.eye(SIZE) - gain @ rows
    return np.asarray(kept @ covariance @ kept.T + gain @ np.diag(variances) @ gain.T)


def crosses(vector: Array) -> Array:
    """Return the matrix of ``psi x vector`` as a function of psi."""
    return np.asarray(np.cross(np.eye(3), vector).T)


class Step(NamedTuple):
    """Tables of one step, and the samples that take it."""

    motion: Array
    thrust: Array
    coupling: Array
    decay: Array
    noise: Array
    rotations: Array
    response: Array


def random_step() -> Step:
    """Return a step in which everything happens; psi responds to two of the other states."""
    rng = np.random.default_rng(11)
    coupling, factor = rng.standard_normal((1, 9, STATES)), rng.standard_normal((SIZE, SIZE))
    coupling[0, :3, 2:] = 0.0
    response = room(9)
    response[:] = rng.standard_normal((9, LANES))
    return Step(
        rng.standard_normal((1, 6, 9)), rng.standard_normal((1, 6)), coupling, rng.random((1, STATES)),
        (factor @ factor.T)[None], Rotation.from_rotvec(rng.standard_normal((LANES, 3))).as_matrix(), response,
    )  # fmt: skip


def propagate(durations: Array, step: Step, filters: Covariances) -> Array:
    """Return the covariances after a step, shape (LANES, 9 + q, 9 + q)."""
    turned = room(9)
    turned[:] = (step.rotations - np.eye(3)).reshape(LANES, 9).T
    noises = blocks_of(step.noise)
    steps = filter_steps(
        durations, step.motion, step.thrust, step.coupling, step.decay, noises, CORRECTED, np.ones(STATES), 1.0
    )
    propagate_covariances(0, steps, parts_of(step.response), parts_of(turned), filters)
    return covariances(filters)


def indicated_error(step: Step, lane: int, half: int) -> Array:
    """Compute the error of the force's integral, with psi of the step's end, in the axes that a sample indicates."""
    share, force = (1 / 2, 1 / 3)[half], step.thrust[0, 3 * half : 3 * half + 3]
    response = step.response[:, lane]
    error = response[3 + 3 * half : 6 + 3 * half] - share * np.cross(response[:3], force)
    return np.asarray(step.rotations[lane] @ error)


def compare(found: Array, covariance: Array, step: Step, transitions: list[Array]) -> None:
    """Compare with ``Phi P Phi^T + Q`` to 1e-13 of the largest entry, for sums of 16 products of products."""
    for lane, rotation in enumerate(step.rotations):
        turn = np.eye(SIZE)
        turn[:9, :9] = np.kron(np.eye(3), rotation)
        expected = transitions[lane] @ covariance[lane] @ transitions[lane].T + turn @ step.noise[0] @ turn.T
        np.testing.assert_allclose(found[lane], expected, rtol=0.0, atol=1e-13 * np.abs(expected).max())


def test_a_long_step_is_that_of_matrix_algebra() -> None:
    """With tables turned to each sample's attitude, and the force that it indicates."""
    filters, covariance, *_ = make()
    step, transitions = random_step(), []
    for lane, rotation in enumerate(step.rotations):
        transition = np.eye(SIZE)
        transition[3:9, 3:9] = step.motion[0, :, 3:]
        transition[:9, 9:] = np.kron(np.eye(3), rotation) @ step.coupling[0]
        transition[9:, 9:] = np.diag(step.decay[0])
        for half in range(2):
            at = slice(3 + 3 * half, 6 + 3 * half)
            of_psi = rotation @ step.motion[0, 3 * half : 3 * half + 3, :3] @ rotation.T
            transition[at, :3] = of_psi + crosses(indicated_error(step, lane, half))
        transitions.append(transition)
    compare(propagate(LONG, step, filters), covariance, step, transitions)


def test_a_short_step_is_that_of_matrix_algebra() -> None:
    """Half a step of the position, one of the velocity, the other half, and psi."""
    filters, covariance, *_ = make()
    step, transitions, duration = random_step(), [], 0.7
    for lane, rotation in enumerate(step.rotations):
        of_force = [crosses(rotation @ step.thrust[0, 3 * half : 3 * half + 3] + indicated_error(step, lane, half))
                    for half in range(2)]  # fmt: skip
        coupling = np.kron(np.eye(3), rotation) @ step.coupling[0]
        first, middle, last, end = np.eye(SIZE), np.eye(SIZE), np.eye(SIZE), np.eye(SIZE)
        first[6:9, 3:6] = last[6:9, 3:6] = 0.5 * duration * np.eye(3)
        middle[3:6, :3], middle[3:6, 6:9], middle[3:6, 9:] = of_force[0], step.motion[0, :3, 6:], coupling[3:6]
        last[6:9, :3] = of_force[1] - 0.5 * duration * of_force[0]
        last[6:9, 9:] = coupling[6:] - 0.5 * duration * coupling[3:6]
        end[:3, 9:], end[9:, 9:] = coupling[:3], np.diag(step.decay[0])
        transitions.append(end @ last @ middle @ first)
    compare(propagate(np.array([duration]), step, filters), covariance, step, transitions)


def test_a_step_without_anything_changes_nothing() -> None:
    filters, covariance, *_ = make()
    propagate_covariances(0, still(), parts_of(room(9)), parts_of(room(9)), filters)
    np.testing.assert_array_equal(covariances(filters), covariance)


def test_filters_of_navigation_alone() -> None:
    """Ten seconds of uncertain velocity, of which a measured position of variance 2 takes nearly all.

    Of 101, rounded some times by 1e-16 of it, 2 is left.
    """
    filters = covariances_of(0)
    set_covariances(filters, np.broadcast_to(np.diag([1e-6] * 3 + [1.0] * 6), (LANES, 9, 9)))
    motion, none = np.eye(6, 9, 3)[None], np.zeros((1, 0))
    motion[0, 3:, 3:6] = 10.0 * np.eye(3)
    steps = filter_steps(
        LONG, motion, np.zeros((1, 6)), np.zeros((1, 9, 0)), none, np.zeros((1, 3, 3, 9)), np.ones(9), np.zeros(0), 1.0
    )
    propagate_covariances(0, steps, parts_of(room(9)), parts_of(room(9)), filters)
    np.testing.assert_allclose(covariances(filters)[:, 6, 6], 101.0, rtol=1e-15)
    rows = np.eye(3, 9, 6)[None]
    known = tables(np.zeros((1, 3, 0)), np.full((1, 3), 2.0), False, rows, np.array([[6, 9]]))
    project_along_truth(0, 3, known, filters)
    factor_innovations(0, 3, known.variances, np.ones((1, LANES)), room(1), filters)
    update_covariances(0, 3, parts_of(np.ones((1, LANES))), parts_of(room(6)), steps, known, filters)
    np.testing.assert_allclose(covariances(filters)[:, 8, 8], 101.0 * 2.0 / 103.0, rtol=1e-13)


@pytest.mark.parametrize("joseph", [False, True])
def test_an_update_is_that_of_matrix_algebra(joseph: bool) -> None:
    """To 1e-12 of the prior's variances: 1e-16 times the innovations' condition number, below 1e4 here."""
    filters, covariance, rows, others, variances = make()
    found = update(filters, others, variances, joseph)
    for lane in range(LANES):
        innovations = rows[lane] @ covariance[lane] @ rows[lane].T + np.diag(variances[0])
        assert np.linalg.cond(innovations) < 1e4
        expected, size = josephs(covariance[lane], rows[lane], variances[0]), np.abs(covariance[lane]).max()
        np.testing.assert_allclose(found[lane], expected, rtol=0.0, atol=1e-12 * size)
        correction = gains(covariance[lane], rows[lane], variances[0]) @ np.arange(1.0, 1.0 + COMPONENTS)
        np.testing.assert_allclose(filters.correction[:SIZE, lane], correction, rtol=0.0, atol=1e-12 * size)


@pytest.mark.parametrize("components", [1, 2, 3, 4, 5, 6])
def test_responses_along_the_truth_are_those_of_samples_that_are_all_the_same(components: int) -> None:
    """Some entries are zero, and do not count where the bounds leave them out."""
    filters, *_ = make()
    rng = np.random.default_rng(9)
    rows, others = rng.standard_normal((1, components, 9)), rng.standard_normal((1, components, STATES))
    others[..., 1::2] = 0.0
    bounds = np.array([[[3 * (c % 3), 9] for c in range(components)]])
    for c in range(components):
        rows[0, c, : bounds[0, c, 0]] = 0.0
    filters.rows[:] = 0.0
    filters.rows[:components, :SIZE] = np.concatenate([rows, others], axis=2)[0, :, :, None]
    known = tables(others, np.ones((1, components)), False, rows, bounds)
    project_along_samples(0, components, known, filters)
    cross, root = filters.cross.copy(), filters.root.copy()
    used = -(-components // 3)
    filters.cross[:] = filters.root[:] = np.nan
    project_along_truth(0, components, known, filters)
    np.testing.assert_allclose(filters.cross[:, :, :used], cross[:, :, :used], rtol=1e-13, atol=1e-12)
    lower = np.tril_indices(components)
    np.testing.assert_allclose(filters.root[lower], root[lower], rtol=1e-13, atol=1e-12)


@pytest.mark.parametrize("components", [1, 2, 3, 4, 5, 6])
def test_an_update_along_the_truth_is_that_of_matrix_algebra(components: int) -> None:
    filters, covariance, *_ = make()
    rng = np.random.default_rng(10)
    rows, others = rng.standard_normal((1, components, 9)), np.zeros((1, components, STATES))
    known = tables(others, 1.0 + rng.random((1, components)), False, rows)
    project_along_truth(0, components, known, filters)
    factor_innovations(0, components, known.variances, np.ones((1, LANES)), room(1), filters)
    nothing, accepted = parts_of(room(6)), parts_of(np.ones((1, LANES)))
    update_covariances(0, components, accepted, nothing, still(np.ones(SIZE)), known, filters)
    found = covariances(filters)
    response = np.concatenate([rows[0], others[0]], axis=1)
    for lane in range(LANES):
        gain = gains(covariance[lane], response, known.variances[0, :components])
        expected = covariance[lane] - gain @ response @ covariance[lane]
        np.testing.assert_allclose(found[lane], expected, rtol=0.0, atol=1e-12 * np.abs(covariance[lane]).max())


@pytest.mark.parametrize("joseph", [False, True])
def test_a_rejected_measurement_changes_nothing(joseph: bool) -> None:
    filters, covariance, _, others, variances = make()
    np.testing.assert_array_equal(update(filters, others, variances, joseph, accepted=0.0), covariance)
    assert not filters.correction.any()


def test_josephs_form_keeps_the_digits_of_a_large_reduction() -> None:
    """The variances of four states that are measured directly, for priors 1e12 times the measurement's variance.

    Rounding of the prior, 1e-16 of it, is an error of 1e-4 and more of the variance after the update in the short form;
    Joseph's form multiplies it by ``(I - K H)``. Exact is ``R - R S^-1 R`` with the innovations' covariance S.
    """
    errors = []
    for joseph in (False, True):
        filters, covariance, _, others, variances = make(prior=1e6)
        filters.rows[:COMPONENTS] = np.eye(*filters.rows.shape[:2])[:COMPONENTS, :, None]
        found = update(filters, 0.0 * others, variances, joseph, corrected=np.ones(SIZE))
        noise = np.diag(variances[0])
        exact = [
            np.diag(noise - noise @ np.linalg.solve(prior[:COMPONENTS, :COMPONENTS] + noise, noise))
            for prior in covariance
        ]
        after = np.diagonal(found, axis1=1, axis2=2)[:, :COMPONENTS]
        errors.append(float(np.max(np.abs(after / np.array(exact) - 1.0))))
    assert errors[0] > 1e-5
    assert errors[1] < 1e-4 * errors[0]
