"""Covariances of filters in lanes: updates against matrix algebra, and the digits that Joseph's form keeps."""

from __future__ import annotations

import numpy as np
import pytest

from mcnav._types import Array
from mcnav.physics.ins.filter_lanes import (
    Covariances,
    covariances_of,
    factor_innovations,
    project_along_samples,
    project_along_truth,
    reduce_by_joseph,
    reduce_covariances,
    whiten,
)
from mcnav.physics.vectors import LANES, room

STATES, COMPONENTS = 6, 4
SIZE = 9 + STATES
CORRECTED = np.array([1.0] * 12 + [0.0] * 3)


def make(prior: float = 1.0) -> tuple[Covariances, Array, Array, Array, Array]:
    """Return filters whose lanes differ, rows of their innovations, and the measurements' variances."""
    rng = np.random.default_rng(5)
    filters = covariances_of(STATES)
    factor = prior * rng.standard_normal((LANES, SIZE, SIZE))
    covariance = factor @ factor.transpose(0, 2, 1)
    filters.p[:] = np.moveaxis(covariance, 0, 2)
    navigation = rng.standard_normal((LANES, COMPONENTS, 9))
    filters.rows[:COMPONENTS] = np.moveaxis(navigation, 0, 2)
    others = rng.standard_normal((1, COMPONENTS, STATES))
    rows = np.concatenate([navigation, np.repeat(others, LANES, axis=0)], axis=2)
    return filters, covariance, rows, others, 1.0 + rng.random((1, COMPONENTS))


def update(
    filters: Covariances, others: Array, variances: Array, joseph: bool, accepted: float = 1.0,
    corrected: Array = CORRECTED,
) -> Array:  # fmt: skip
    """Return the covariances after an update, shape (LANES, 9 + q, 9 + q)."""
    bounds = np.full((1, COMPONENTS, 2), [0, 9])
    linked, sound, cause, share = np.arange(STATES), np.ones((1, LANES)), room(1), np.full((1, LANES), accepted)
    project_along_samples(0, COMPONENTS, bounds, others, linked, filters)
    factor_innovations(0, COMPONENTS, variances, sound, cause, filters)
    assert not cause.any()
    whiten(COMPONENTS, share, filters)
    if joseph:
        reduce_by_joseph(0, COMPONENTS, corrected, bounds, others, linked, variances, filters)
    else:
        reduce_covariances(COMPONENTS, corrected, filters)
    lower = np.tril(np.moveaxis(filters.p, 2, 0))
    return lower + np.tril(lower, -1).transpose(0, 2, 1)


def josephs(covariance: Array, rows: Array, variances: Array) -> Array:
    """Compute one covariance after an update in Joseph's form; considered states have no gain."""
    innovations = rows @ covariance @ rows.T + np.diag(variances)
    gain = CORRECTED[:, None] * (covariance @ rows.T @ np.linalg.inv(innovations))
    kept = np.eye(SIZE) - gain @ rows
    return np.asarray(kept @ covariance @ kept.T + gain @ np.diag(variances) @ gain.T)


@pytest.mark.parametrize("joseph", [False, True])
def test_an_update_is_that_of_matrix_algebra(joseph: bool) -> None:
    """To 1e-12 of the prior's variances: 1e-16 times the innovations' condition number, below 1e4 here."""
    filters, covariance, rows, others, variances = make()
    found = update(filters, others, variances, joseph)
    for lane in range(LANES):
        innovations = rows[lane] @ covariance[lane] @ rows[lane].T + np.diag(variances[0])
        assert np.linalg.cond(innovations) < 1e4
        expected = josephs(covariance[lane], rows[lane], variances[0])
        np.testing.assert_allclose(found[lane], expected, rtol=0.0, atol=1e-12 * np.abs(covariance[lane]).max())


@pytest.mark.parametrize("components", [1, 2, 3, 4, 5, 6])
def test_responses_along_the_truth_are_those_of_samples_that_are_all_the_same(components: int) -> None:
    """Some entries are zero; products are summed in the same order, and zeros are added to those along the truth."""
    filters, *_ = make()
    rng = np.random.default_rng(9)
    rows, others = rng.standard_normal((1, components, 9)), rng.standard_normal((1, components, STATES))
    bounds = np.array([[[3 * (c % 3), 9] for c in range(components)]])
    for c in range(components):
        rows[0, c, : bounds[0, c, 0]] = 0.0
    filters.rows[:components] = rows[0, :, :, None]
    linked = np.arange(0, STATES, 2)
    project_along_samples(0, components, bounds, others, linked, filters)
    cross, root = filters.cross.copy(), filters.root.copy()
    filters.cross[:] = filters.root[:] = np.nan
    project_along_truth(0, components, rows, bounds, others, linked, filters)
    np.testing.assert_allclose(filters.cross[:, :components], cross[:, :components], rtol=1e-13, atol=1e-12)
    lower = np.tril_indices(components)
    np.testing.assert_allclose(filters.root[lower], root[lower], rtol=1e-13, atol=1e-12)


@pytest.mark.parametrize("components", [1, 2, 3, 4, 5, 6])
def test_whitened_responses_times_their_transposes_are_the_reduction(components: int) -> None:
    filters, covariance, *_ = make()
    rng = np.random.default_rng(10)
    rows, others = rng.standard_normal((1, components, 9)), np.zeros((1, components, STATES))
    variances, share = 1.0 + rng.random((1, components)), np.ones((1, LANES))
    bounds, none = np.full((1, components, 2), [0, 9]), np.zeros(0, dtype=np.int64)
    project_along_truth(0, components, rows, bounds, others, none, filters)
    factor_innovations(0, components, variances, np.ones((1, LANES)), room(1), filters)
    whiten(components, share, filters)
    response = np.concatenate([rows[0], others[0]], axis=1)
    for lane in range(LANES):
        cross = covariance[lane] @ response.T
        innovations = response @ cross + np.diag(variances[0])
        white = filters.white[:, :, lane]
        expected = cross @ np.linalg.solve(innovations, cross.T)
        np.testing.assert_allclose(white @ white.T, expected, rtol=0.0, atol=1e-12 * np.abs(covariance[lane]).max())


@pytest.mark.parametrize("joseph", [False, True])
def test_a_rejected_measurement_changes_nothing(joseph: bool) -> None:
    filters, covariance, _, others, variances = make()
    np.testing.assert_array_equal(update(filters, others, variances, joseph, accepted=0.0), covariance)


def test_josephs_form_keeps_the_digits_of_a_large_reduction() -> None:
    """The variances of four states that are measured directly, for priors 1e12 times the measurement's variance.

    Rounding of the prior, 1e-16 of it, is an error of 1e-4 and more of the variance after the update in the short form;
    Joseph's form multiplies it by ``(I - K H)``. Exact is ``R - R S^-1 R`` with the innovations' covariance S.
    """
    errors = []
    for joseph in (False, True):
        filters, covariance, _, others, variances = make(prior=1e6)
        filters.rows[:COMPONENTS] = np.eye(COMPONENTS, 9)[:, :, None]
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
