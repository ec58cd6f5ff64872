"""Verdict of linear analysis on a filter: by closed forms of two scalar errors."""

from __future__ import annotations

import numpy as np
import pytest

from mcnav.analysis.filter_consistency import Honesty
from mcnav.analysis.linear_covariance import LinearCovariance, covariance_over_time
from mcnav.analysis.linear_filter import LinearVerdict, judge_filter
from mcnav.arrays.types import Array
from mcnav.contract.linear import LinearSystem

NAMES = ("position_north", "position_east")
TIMES = np.array([0.0, 10.0, 20.0, 30.0])
TOLERANCE = 0.05
ROUNDING = 1e-12


def covariance(own: Array, mean: tuple[float, float] = (0.0, 0.0), sigmas: tuple[float, float] = (1.0, 2.0)) -> (
    LinearCovariance
):  # fmt: skip
    """Return two errors of constant sigma; ``own`` is the filter's covariance at each time, shape (4, 2, 2)."""
    readings = LinearSystem(TIMES, np.tile(np.eye(2), (len(TIMES), 1, 1)), own=own, believed={"a": 0.25, "b": 1.0})
    return covariance_over_time(readings, ("a", "b"), np.array(mean), np.diag(np.square(sigmas)))


def judged(found: LinearCovariance, sigmas: tuple[float, float] = (1.0, 2.0)) -> LinearVerdict:
    verdict = judge_filter([found], NAMES, {"all": 2, "position": 2}, ("a", "b"), np.diag(np.square(sigmas)), TOLERANCE)
    assert verdict is not None
    return verdict


def stated(north: float = 1.0, east: float = 2.0, correlation: float = 0.0) -> Array:
    """Return the covariance that a filter states at all times."""
    product = correlation * north * east
    return np.tile(np.array([[north**2, product], [product, east**2]]), (len(TIMES), 1, 1))


def test_a_filter_that_states_the_true_covariance_is_consistent() -> None:
    found = judged(covariance(stated()))
    assert (found.verdict, found.output, found.group, found.begin) == (Honesty.CONSISTENT, "", "", None)
    assert found.factor == pytest.approx(1.0, rel=ROUNDING)


def test_one_output_suffices_and_is_named_with_its_neglected_error() -> None:
    """The filter believes a quarter of the variance of ``a`` from 10 s on: its sigma is half the true one."""
    own = stated()
    own[1:, 0, 0] = 0.25
    found = judged(covariance(own))
    assert (found.verdict, found.output) == (Honesty.OPTIMISTIC, "position_north")
    assert found.factor == pytest.approx(2.0, rel=ROUNDING)
    assert (found.begin, found.worst, found.end, found.throughout) == (10.0, 30.0, 30.0, True)
    (cause,) = found.neglected
    assert cause.name == "a"
    assert cause.share == pytest.approx(1.0, rel=ROUNDING)
    assert (cause.true, cause.believed) == pytest.approx((1.0, 0.25), rel=ROUNDING)


def test_two_outputs_that_cancel_in_the_group_are_found() -> None:
    """With variances 0.9^2 and 1.136^2 of the truth the mean of the inverse ratios is one: the NEES shows nothing."""
    low = 0.9
    high = 1.0 / np.sqrt(2.0 - 1.0 / low**2)
    found = judged(covariance(stated(low, 2.0 * high)))
    np.testing.assert_allclose(found.groups["position"], 1.0, rtol=1e-12)
    assert (found.verdict, found.output) == (Honesty.OPTIMISTIC, "position_north")
    assert found.factor == pytest.approx(1.0 / low, rel=ROUNDING)


def test_a_wrong_correlation_shows_in_the_group_alone() -> None:
    """The NEES of independent errors in a filter that states the correlation r is 2 / (1 - r^2)."""
    correlation = 0.8
    found = judged(covariance(stated(correlation=correlation)))
    assert (found.verdict, found.output, found.group) == (Honesty.OPTIMISTIC, "", "position")
    assert found.factor == pytest.approx(1.0 / np.sqrt(1.0 - correlation**2), rel=1e-12)


def test_a_mean_error_counts_and_is_its_own_cause() -> None:
    """A mean of 3 sigma: the root mean square is sqrt(10) of what the filter states, nine tenths of it by the mean."""
    found = judged(covariance(stated(), mean=(3.0, 0.0)))
    assert found.factor == pytest.approx(np.sqrt(10.0), rel=ROUNDING)
    assert found.neglected[0].name == "mean_of_a"


def test_a_pessimistic_filter_and_one_that_believes_in_no_error() -> None:
    pessimistic = judged(covariance(stated(east=4.0)))
    assert (pessimistic.verdict, pessimistic.output) == (Honesty.PESSIMISTIC, "position_east")
    assert pessimistic.factor == pytest.approx(0.5, rel=ROUNDING)
    own = stated()
    own[2, 1, 1] = 0.0
    overlooked = judged(covariance(own))
    assert (overlooked.output, overlooked.factor, overlooked.worst) == ("position_east", np.inf, 20.0)


def test_a_departure_at_some_epochs_is_not_throughout() -> None:
    own = stated()
    own[[0, 3], 0, 0] = 0.25
    found = judged(covariance(own))
    assert (found.begin, found.end, found.departing, found.throughout) == (0.0, 30.0, (0, 3), False)


def test_without_a_filter_there_is_no_verdict() -> None:
    readings = LinearSystem(TIMES, np.tile(np.eye(2), (len(TIMES), 1, 1)))
    found = covariance_over_time(readings, ("a", "b"), np.zeros(2), np.eye(2))
    assert judge_filter([found], NAMES, {"position": 2}, ("a", "b"), np.eye(2), TOLERANCE) is None


def test_all_states_decide_where_no_group_is_of_navigation() -> None:
    """So they do for samples: a loop's filter has one group."""
    found = covariance(stated(correlation=0.8))
    verdict = judge_filter([found], NAMES, {"all": 2}, ("a", "b"), np.diag([1.0, 4.0]), TOLERANCE)
    assert verdict is not None
    assert (verdict.verdict, verdict.group) == (Honesty.OPTIMISTIC, "all")
    beyond_outputs = judge_filter([found], NAMES, {"all": 3}, ("a", "b"), np.diag([1.0, 4.0]), TOLERANCE)
    assert beyond_outputs is not None
    assert beyond_outputs.verdict == Honesty.CONSISTENT


def test_a_group_that_is_farther_off_than_the_output_named_is_said_too() -> None:
    """NEES of two sigmas stated as 0.9 of the true ones and the correlation r: 2 / (0.81 (1 - r^2))."""
    low, correlation = 0.9, 0.6
    found = judged(covariance(stated(low, 2.0 * low, correlation)))
    assert found.factor == pytest.approx(1.0 / low, rel=ROUNDING)
    assert found.together is not None
    assert found.together == ("position", pytest.approx(1.0 / (low * np.sqrt(1.0 - correlation**2)), rel=1e-12))
    assert judged(covariance(stated(low, 2.0 * low))).together is None
