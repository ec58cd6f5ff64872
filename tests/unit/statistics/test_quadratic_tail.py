"""Tails of quadratic functions of normal variables, against closed forms."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy import special, stats

from mcnav.statistics.quadratic_tail import QuadraticForm

RELATIVE = 1e-8
"""Ten digits of the reference values are printed; scipy's noncentral chi-square has about eight in its tail."""


@pytest.mark.parametrize(("d", "a", "c", "exact"), [
    (10, 0.02, 4.0, 9.6099392124e-5), (10, 0.02, 5.0, 2.2795200765e-6), (10, 0.05, 5.0, 1.8987948626e-5),
    (1, 0.02, 5.0, 2.140034725e-6),
])  # fmt: skip
def test_squares_of_normals(d: int, a: float, c: float, exact: float) -> None:
    """``y = x_1 + a (sum x_i^2 - d)`` is a noncentral chi-square variable."""
    form = QuadraticForm(-a * d, np.eye(d)[0], np.full(d, 2.0 * a))
    assert form.above(c) == pytest.approx(exact, rel=RELATIVE)


def test_both_sides_and_the_lower_one() -> None:
    """``P(y < -5)`` of ``x + 0.02 (x^2 - 1)``, whose curvature is towards the other side, is 1.015847084e-8."""
    form = QuadraticForm(-0.02, np.array([1.0]), np.array([0.04]))
    assert form.beyond(5.0) == pytest.approx(2.140034725e-6 + 1.015847084e-8, rel=RELATIVE)


@pytest.mark.parametrize("limit", [-3.0, 0.5, 4.0, 8.0])
def test_noise_adds_its_variance(limit: float) -> None:
    """Without curvature it is a normal variable of unit variance about 0.5, also below its mean."""
    form = QuadraticForm(0.5, np.array([0.48, 0.64]), np.zeros(2), 0.6)
    assert form.above(limit) == pytest.approx(stats.norm.sf(limit - 0.5), rel=RELATIVE)


@pytest.mark.parametrize("curvature", [0.5, -0.06, -0.12])
def test_strong_curvature(curvature: float) -> None:
    """``u + q u^2 / 2`` lies beyond between or outside of the roots of its equation."""

    def beyond(limit: float) -> float:
        roots = np.sort(np.roots([0.5 * curvature, 1.0, -limit]))
        if np.iscomplexobj(roots):
            return 0.0
        inside = stats.norm.sf(roots[0]) - stats.norm.sf(roots[1])
        outside = stats.norm.cdf(roots[0]) + stats.norm.sf(roots[1])
        return float(outside if curvature > 0.0 else inside)

    form = QuadraticForm(0.0, np.ones(1), np.array([curvature]))
    assert form.above(5.0) == pytest.approx(beyond(5.0), rel=RELATIVE)


def test_what_has_no_tail() -> None:
    """``-u^2`` never exceeds one, a constant is where it is, and squares alone are chi-square."""
    assert QuadraticForm(0.0, np.zeros(1), np.array([-2.0])).above(1.0) == 0.0
    assert QuadraticForm(2.0, np.zeros(1), np.zeros(1)).above(1.0) == 1.0
    squares = QuadraticForm(0.0, np.zeros(3), np.full(3, 2.0)).above(30.0)
    assert squares == pytest.approx(stats.chi2.sf(30.0, 3), rel=RELATIVE)


@pytest.mark.parametrize("seed", range(12))
def test_one_curved_axis_with_noise_on_both_sides_of_the_mean(seed: int) -> None:
    """``P(y > c)`` by Gauss and Legendre's rule over the curved axis, between the places at which the noise decides."""
    random = np.random.default_rng(seed)
    slope, curvature = random.standard_normal(2) * 10.0 ** random.uniform(-2.0, 1.0, 2)
    sigma = 10.0 ** random.uniform(-3.0, 0.0)
    form = QuadraticForm(0.0, np.array([slope]), np.array([curvature]), sigma)
    nodes, weights = np.polynomial.legendre.leggauss(60)
    for multiple in (-3.0, -0.5, 0.5, 3.0):
        limit = 0.5 * curvature + multiple * form.scale
        edges = [-12.0, -slope / curvature, 0.0, 12.0]
        for away in (-8.0, -4.0, 0.0, 4.0, 8.0):
            root = slope**2 + 2.0 * curvature * (limit + away * sigma)
            edges += [(side * np.sqrt(root) - slope) / curvature for side in (-1.0, 1.0) if root > 0.0]
        ends, expected = np.unique(np.clip(edges, -12.0, 12.0)), 0.0
        for begin, end in pairwise(ends):
            for low, high in pairwise(np.linspace(begin, end, 5)):
                u = 0.5 * (low + high) + 0.5 * (high - low) * nodes
                above = special.ndtr((slope * u + 0.5 * curvature * u**2 - limit) / sigma)
                expected += 0.5 * (high - low) * float(weights @ (stats.norm.pdf(u) * above))
        assert form.above(limit) == pytest.approx(expected, rel=1e-7, abs=1e-15)
