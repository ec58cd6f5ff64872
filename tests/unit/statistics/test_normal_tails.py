"""Small normal probabilities: closed forms, and one minus the large probability where this is not small."""

import numpy as np
import pytest
from scipy import special, stats

from mcnav.analysis.requirements import normal_box_probability, normal_share
from mcnav.statistics.normal_tails import probability_beyond_box, probability_beyond_distance


@pytest.mark.parametrize("size", [1, 2, 3])
@pytest.mark.parametrize("radius", [3.0, 6.0, 9.0])
def test_spheres(size, radius):
    """Chi-squared; the rule of 240 nodes resolves roots at the edge to 1e-5."""
    found = probability_beyond_distance(np.zeros(size), 4.0 * np.eye(size), 2.0 * radius)
    assert found == pytest.approx(stats.chi2.sf(radius**2, size), rel=1e-5, abs=0.0)


def test_a_distance_from_another_centre():
    """A noncentral chi-squared."""
    found = probability_beyond_distance(np.array([0.6, -0.8]), np.eye(2), 6.0)
    assert found == pytest.approx(stats.ncx2.sf(36.0, 2, 1.0), rel=1e-5, abs=0.0)


@pytest.mark.parametrize("limit", [4.0, 7.0])
def test_boxes_of_independent_variables(limit):
    each = 2.0 * special.ndtr(-limit)
    found = probability_beyond_box(np.zeros(3), np.diag([1.0, 4.0, 9.0]), limit * np.array([1.0, 2.0, 3.0]))
    assert found == pytest.approx(-np.expm1(3.0 * np.log1p(-each)), rel=1e-9, abs=0.0)


def test_correlated_boxes_and_ellipses_are_what_is_left_of_one():
    """Where probabilities are not small: the box is known to 1e-7, the ellipse to 1e-9."""
    generator = np.random.default_rng(1)
    for size in (2, 3):
        root = generator.standard_normal((size, size))
        covariance, mean = root @ root.T, 0.3 * generator.standard_normal(size)
        limits = 2.0 * np.sqrt(np.diag(covariance))
        expected = 1.0 - normal_box_probability(mean, covariance, limits)
        assert probability_beyond_box(mean, covariance, limits) == pytest.approx(expected, abs=1e-6)
        expected = 1.0 - normal_share(mean, covariance, float(limits.max()))
        assert probability_beyond_distance(mean, covariance, float(limits.max())) == pytest.approx(expected, abs=1e-6)


def test_variables_that_determine_each_other_and_many_of_them_have_none():
    assert np.isnan(probability_beyond_box(np.zeros(2), np.ones((2, 2)), np.ones(2)))
    assert np.isnan(probability_beyond_box(np.zeros(4), np.eye(4), np.ones(4)))
    assert np.isnan(probability_beyond_distance(np.zeros(4), np.eye(4), 1.0))


def test_fixed_values_are_within_or_beyond():
    nothing = np.diag([1.0, 0.0])
    assert probability_beyond_box(np.array([0.0, 2.0]), nothing, np.array([1.0, 1.0])) == 1.0
    found = probability_beyond_distance(np.array([0.0, 3.0]), nothing, 5.0)
    assert found == pytest.approx(2.0 * special.ndtr(-4.0), rel=1e-9, abs=0.0)
    assert probability_beyond_distance(np.array([0.0, 3.0]), 0.0 * nothing, 5.0) == 0.0
