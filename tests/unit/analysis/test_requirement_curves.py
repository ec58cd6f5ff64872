"""Curves of requirements: which epochs they have, and that bounds hold what they say of a known distribution."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from mcnav.analysis.requirement_curves import MOST, drawn_epochs, requirement_curve
from mcnav.analysis.requirements import Requirement
from mcnav.analysis.requirements_over_time import ErrorHistories

EPOCHS, SAMPLES = 5, 2_000


def histories(blocks: int = 1) -> ErrorHistories:
    """Return normal errors whose sigma grows with time, in two outputs."""
    sigma = np.arange(1.0, EPOCHS + 1.0)
    errors = np.random.default_rng(3).standard_normal((SAMPLES, EPOCHS, 2)) * sigma[:, None]
    covariance = sigma[:, None, None] ** 2 * np.eye(2)
    owner = np.arange(SAMPLES) // blocks
    return ErrorHistories(np.arange(float(EPOCHS)), errors, owner, np.zeros((EPOCHS, 2)), covariance, SAMPLES)


def test_the_curve_of_r95_is_that_of_rayleighs_distribution() -> None:
    """Linear: sigma sqrt(-2 ln 0.05). Of five epochs an interval of 99.9 % each side misses once in 100 runs."""
    requirement = Requirement("r95", (0, 1), (10.0,), 0.95, epochs=(1, 3))
    curve = requirement_curve(requirement, histories(), 0.999)
    exact = np.arange(1.0, EPOCHS + 1.0) * stats.rayleigh.ppf(0.95)
    assert curve.linear == pytest.approx(exact, rel=1e-6)
    assert curve.holds.tolist() == [False, True, False, True, False]
    assert np.all((curve.bounds[:, 0] <= exact) & (exact <= curve.bounds[:, 1]))
    assert np.all((curve.bounds[:, 0] <= curve.estimate) & (curve.estimate <= curve.bounds[:, 1]))


def test_without_independent_samples_there_are_no_bounds() -> None:
    curve = requirement_curve(Requirement("quantile", (0,), (1.0,), 0.9, epochs=(0,)), histories(blocks=500), 0.95)
    assert curve.bounds.tolist() == [[0.0, np.inf]] * EPOCHS
    assert np.isfinite(curve.estimate).all()


def test_all_of_few_epochs_are_drawn_and_of_many_those_that_count() -> None:
    """One in the middle of ten thousand is there; the curve stays short enough for a page."""
    assert drawn_epochs(Requirement("r95", (0, 1), (1.0,), 0.95, epochs=(2,)), 5).tolist() == [0, 1, 2, 3, 4]
    many = drawn_epochs(Requirement("r95", (0, 1), (1.0,), 0.95, epochs=(4_999,)), 10_000)
    assert 4_999 in many
    assert len(many) <= MOST + 1
    throughout = drawn_epochs(Requirement("r95", (0, 1), (1.0,), 0.95, epochs=tuple(range(10_000))), 10_000)
    assert len(throughout) <= 2 * MOST
