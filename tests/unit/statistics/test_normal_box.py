"""Small normal probabilities: closed forms, and one minus the large probability where this is not small."""

import itertools

import numpy as np
import pytest
from scipy import special, stats

from mcnav.errors import NumericalError
from mcnav.statistics.normal_box import normal_box_probability, probability_beyond_box


@pytest.mark.parametrize("limit", [4.0, 7.0])
def test_boxes_of_independent_variables(limit):
    each = 2.0 * special.ndtr(-limit)
    found = probability_beyond_box(np.zeros(3), np.diag([1.0, 4.0, 9.0]), limit * np.array([1.0, 2.0, 3.0]))
    assert found == pytest.approx(-np.expm1(3.0 * np.log1p(-each)), rel=1e-9, abs=0.0)


@pytest.mark.parametrize("size", [2, 3])
def test_correlated_boxes_are_what_is_left_of_one(size):
    """Where probabilities are not small: scipy's quasi-Monte Carlo, whose error is 1e-6 or less at these settings."""
    generator = np.random.default_rng(size)
    root = generator.standard_normal((size, size))
    covariance, mean = root @ root.T, 0.3 * generator.standard_normal(size)
    limits = 2.0 * np.sqrt(np.diag(covariance))
    inside = stats.multivariate_normal(mean, covariance, seed=1, abseps=1e-7).cdf(limits, lower_limit=-limits)
    assert probability_beyond_box(mean, covariance, limits) == pytest.approx(1.0 - inside, abs=2e-6)
    assert normal_box_probability(mean, covariance, limits) == pytest.approx(inside, abs=2e-6)


@pytest.mark.parametrize("apart", [1e-1, 1e-3, 1e-4, 1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("limit", [1.0, 3.0, 6.0])
def test_two_variables_that_nearly_determine_each_other(apart, limit):
    """Of a correlation 1 - d with equal limits, by polar angle in the plane in which the variables are independent.

    The box is a rhombus about zero, whose sides' normals are ``+-acos(1 - d) / 2`` from an axis, so that ``P = 2 / pi ∫
    exp(-(limit / cos(angle - normal))^2 / 2)`` over a quarter turn.
    """
    half = 0.5 * np.arccos(1.0 - apart)
    nodes, weights = np.polynomial.legendre.leggauss(400)
    angle = 0.25 * np.pi * (1.0 + nodes)
    expected = 0.5 * float(weights @ np.exp(-0.5 * (limit / np.cos(angle - half)) ** 2))
    covariance = np.array([[1.0, 1.0 - apart], [1.0 - apart, 1.0]])
    beyond = probability_beyond_box(np.zeros(2), covariance, np.full(2, limit))
    # rounding of the correlation, 1e-16, moves the share sqrt(d) that the second limit adds
    assert beyond == pytest.approx(expected, rel=1e-9 + 1e-15 / np.sqrt(apart), abs=0.0)


def test_the_order_of_three_variables_that_nearly_lie_in_a_plane_or_on_a_line_does_not_matter():
    """Each order of integration meets other steps."""
    generator = np.random.default_rng(4)
    for thin in (1.0, 1e-2, 1e-4, 1e-6):
        root = generator.standard_normal((3, 3)) * np.array([1.0, generator.choice([1.0, thin]), thin])
        covariance = root @ root.T
        sigmas = np.sqrt(np.diag(covariance))
        mean, limits = 0.5 * sigmas * generator.standard_normal(3), sigmas * generator.uniform(1.0, 5.0, 3)
        beyond = [
            probability_beyond_box(mean[list(order)], covariance[np.ix_(order, order)], limits[list(order)])
            for order in itertools.permutations(range(3))
        ]
        assert beyond == pytest.approx(6 * [beyond[0]], rel=1e-8, abs=0.0)


def test_variables_that_determine_each_other_and_many_of_them():
    beyond = probability_beyond_box(np.zeros(2), np.ones((2, 2)), np.array([4.0, 5.0]))
    assert beyond == pytest.approx(2.0 * special.ndtr(-4.0), rel=1e-12, abs=0.0)
    root = np.array([[0.6, 0.8], [1.0, 0.0], [0.0, 1.0]])
    limits = np.array([1.2, 1.0, 1.1])
    draws = np.random.default_rng(2).standard_normal((1_000_000, 2)) @ root.T
    share = np.mean(np.any(np.abs(draws) > limits, axis=1))
    beyond = probability_beyond_box(np.zeros(3), root @ root.T, limits)
    assert beyond == pytest.approx(share, abs=4.0 * np.sqrt(0.25e-6))  # four standard errors
    assert np.isnan(probability_beyond_box(np.zeros(4), np.eye(4), np.ones(4)))
    four = normal_box_probability(np.zeros(4), np.eye(4), np.ones(4))
    assert four == pytest.approx((1.0 - 2.0 * special.ndtr(-1.0)) ** 4, abs=1e-6)


def test_covariances_of_no_variables_are_refused():
    with pytest.raises(NumericalError, match="of no normal variables"):
        probability_beyond_box(np.zeros(2), np.array([[1.0, 1.1], [1.1, 1.0]]), np.ones(2))


def test_fixed_values_are_within_or_beyond():
    nothing = np.diag([1.0, 0.0])
    assert probability_beyond_box(np.array([0.0, 2.0]), nothing, np.array([1.0, 1.0])) == 1.0
