"""Normalized errors of samples in lanes: quadratic forms, by covariances of their own and by shared ones."""

from __future__ import annotations

import numpy as np
import pytest

from mcnav.arrays.types import Array
from mcnav.compiled.vectors import LANES
from mcnav.systems.ins.ensemble.normalization import (
    NormalizationRooms,
    normalization_rooms,
    normalize_by_own,
    normalize_by_shared,
    share_covariances,
)

STATES = 6
SIZE = 9 + STATES
CHOSEN = np.arange(12)
"""The last three states are considered."""


def covariances() -> Array:
    """Return a covariance for each lane, shape (LANES, 9 + q, 9 + q)."""
    factor = np.random.default_rng(5).standard_normal((LANES, SIZE, SIZE))
    return np.asarray(factor @ factor.transpose(0, 2, 1))


def in_lanes(covariance: Array) -> Array:
    """Arrange covariances for the kernel."""
    return np.ascontiguousarray(np.moveaxis(covariance, 0, 2))


def rooms_with_errors() -> NormalizationRooms:
    """Return rooms with errors of all states."""
    rooms = normalization_rooms(STATES)
    rooms.errors[:] = np.random.default_rng(6).standard_normal((SIZE, LANES))
    return rooms


MAP = np.random.default_rng(7).standard_normal((9, 9))


def test_by_own_covariances_they_are_quadratic_forms() -> None:
    """All estimated states, navigation, groups of outputs, and the other estimated states, of every lane."""
    rooms, covariance = rooms_with_errors(), covariances()
    normalize_by_own(in_lanes(covariance), CHOSEN, MAP, rooms)
    for lane in range(LANES):
        error, matrix = rooms.errors[:, lane], covariance[lane]
        mapped, outputs = MAP @ matrix[:9, :9] @ MAP.T, MAP @ error[:9]
        groups = [(matrix, error, CHOSEN), (matrix, error, np.arange(9))]
        groups += [(mapped, outputs, np.arange(begin, begin + 3)) for begin in (0, 3, 6)]
        groups.append((matrix, error, CHOSEN[9:]))
        for found, (of, vector, states) in zip(rooms.nees[:, lane], groups, strict=True):
            block = of[np.ix_(states, states)]
            expected = vector[states] @ np.linalg.solve(block, vector[states])
            assert found == pytest.approx(expected, rel=1e-13 * np.linalg.cond(block))


@pytest.mark.parametrize("states", [STATES, 0])
def test_by_shared_covariances_they_are_those_by_own_ones(states: int) -> None:
    size = 9 + states
    covariance, chosen = covariances()[:2, :size, :size], CHOSEN[: 9 + min(states, 3)]
    shared = share_covariances(covariance, chosen, np.stack([MAP, MAP]))
    for epoch, each in enumerate(covariance):
        own, others = normalization_rooms(states), normalization_rooms(states, own=False)
        own.errors[:] = others.errors[:] = rooms_with_errors().errors[:size]
        normalize_by_own(in_lanes(np.repeat(each[None], LANES, axis=0)), chosen, MAP, own)
        normalize_by_shared(epoch, shared, chosen, MAP, others)
        np.testing.assert_allclose(others.nees, own.nees, rtol=1e-13 * np.linalg.cond(each))
        lower = np.tril_indices(9)
        np.testing.assert_allclose(shared.mapped[epoch], own.mapped[*lower, 0], rtol=0.0, atol=1e-13 * own.mapped.max())
        np.testing.assert_array_equal(shared.variances[epoch], np.diag(each)[9:])


def test_outputs_that_a_filter_believes_free_of_error_have_no_variance() -> None:
    """The first three states are linear in the last three, so that one group of outputs is zero but for rounding.

    Its errors are of second order in those of the states, far beyond what rounding leaves of its sigma.
    """
    rng = np.random.default_rng(8)
    turn, factor = 1e-7 * rng.standard_normal((3, 3)), rng.standard_normal((6, 6))
    whole = np.vstack([np.hstack([np.zeros((3, 3)), turn]), np.eye(6)])
    covariance = whole @ factor @ factor.T @ whole.T
    to_outputs = np.eye(9)
    to_outputs[:3, 6:] = -turn
    rooms = normalization_rooms(0)
    rooms.errors[:] = whole @ factor @ rng.standard_normal((6, LANES))
    rooms.errors[:3] += 1e-14
    normalize_by_own(in_lanes(np.repeat(covariance[None], LANES, axis=0)), np.arange(9), to_outputs, rooms)
    shared = share_covariances(covariance[None], np.arange(9), to_outputs[None])
    assert not rooms.mapped[:3].any()
    assert not rooms.mapped[:, :3].any()
    assert not rooms.nees[2].any()
    assert not shared.mapped[0, :6].any()
    np.testing.assert_array_equal(rooms.mapped[3:, 3:, 0] != 0.0, np.tril(np.ones((6, 6), dtype=bool)))
    scale = np.linalg.cond(factor) ** 2 * np.linalg.cond(turn)
    expected = np.sum(np.linalg.solve(factor, rooms.errors[3:]) ** 2, axis=0)
    np.testing.assert_allclose(rooms.nees[1], expected, rtol=1e-7 * scale)


def test_states_without_any_variance_have_none_in_the_outputs() -> None:
    """A filter that knows its position exactly: numbers throughout, and zero where there is nothing to normalize."""
    factor = np.random.default_rng(9).standard_normal((6, 6))
    covariance = np.zeros((9, 9))
    covariance[:6, :6] = factor @ factor.T
    rooms = normalization_rooms(0)
    rooms.errors[:] = 0.0
    rooms.errors[:6] = factor @ np.random.default_rng(10).standard_normal((6, LANES))
    normalize_by_own(in_lanes(np.repeat(covariance[None], LANES, axis=0)), np.arange(9), np.eye(9), rooms)
    np.testing.assert_allclose(rooms.mapped[..., 0], np.tril(covariance), rtol=1e-15)
    assert not rooms.nees[4].any()
    for group in (0, 1):
        rows = slice(3 * group, 3 * group + 3)
        solved = np.linalg.solve(covariance[rows, rows], rooms.errors[rows])
        expected = np.sum(rooms.errors[rows] * solved, axis=0)
        np.testing.assert_allclose(rooms.nees[2 + group], expected, rtol=1e-13 * np.linalg.cond(covariance[rows, rows]))
