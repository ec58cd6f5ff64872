"""The range of linear analysis, and causes of mean squares."""

from __future__ import annotations

import numpy as np
import pytest

from mcnav.analysis.causes import causes_of
from mcnav.analysis.linear_range import BeyondRange, find_beyond, first_beyond, limits_of
from mcnav.analysis.requirement_causes import causes_of_requirement
from mcnav.analysis.requirements import Requirement

TIMES = np.array([0.0, 60.0, 120.0])


def test_the_first_output_beyond_its_limit_ends_the_range() -> None:
    """A mean counts: sqrt(3^2 + 4^2) = 5 is the limit and within it, and 5.0001 is beyond."""
    limits = limits_of([None, 5.0])
    mean = np.array([[0.0, 0.0], [0.0, 3.0], [0.0, 3.0]])
    sigma = np.array([[1e30, 1.0], [1e30, 4.0], [1e30, 4.0002]])
    assert first_beyond(limits, TIMES[:2], mean[:2], sigma[:2]) is None
    assert first_beyond(limits, TIMES, mean, sigma) == BeyondRange((1,), 120.0)


def test_what_is_no_number_is_beyond_and_the_end_counts_without_a_history() -> None:
    limits = limits_of([1.0])
    assert first_beyond(limits, TIMES[:1], np.zeros((1, 1)), np.full((1, 1), np.nan)) == BeyondRange((0,), 0.0)
    assert find_beyond(limits, np.zeros(1), np.array([2.0]), None) == BeyondRange((0,), None)
    assert find_beyond(limits, np.zeros(1), np.array([0.5]), None) is None


def test_causes_add_up_to_the_mean_square() -> None:
    """Variances 3 and 1, and means 2 and -1 of two sources, whose sum is 1: the mean square is 5."""
    variances = {"a": np.array([3.0]), "noise": np.array([1.0])}
    found = causes_of(variances, {"a": np.array([2.0]), "b": np.array([-1.0])}, 5.0)
    assert {cause.name: cause.share for cause in found} == pytest.approx(
        {"a": 0.6, "mean_of_a": 0.4, "noise": 0.2, "mean_of_b": -0.2}, rel=1e-15
    )
    assert found[0].name == "a"


def test_causes_of_a_requirement_are_of_its_outputs_in_multiples_of_a_boxs_limits() -> None:
    variances = {"a": np.array([4.0, 0.0, 100.0]), "b": np.array([0.0, 1.0, 0.0])}
    covariance, mean = np.diag([4.0, 1.0, 100.0]), np.zeros(3)
    radius = causes_of_requirement(Requirement("cep", (0, 1), (1.0,), 0.5), variances, {}, covariance, mean)
    assert [(cause.name, cause.share) for cause in radius] == [("a", 0.8), ("b", 0.2)]
    box = causes_of_requirement(Requirement("box", (0, 1), (2.0, 0.5), 0.9), variances, {}, covariance, mean)
    assert [(cause.name, cause.share) for cause in box] == [("b", 0.8), ("a", 0.2)]
