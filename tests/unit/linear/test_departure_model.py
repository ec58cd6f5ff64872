"""The polynomial through a few simulations is exact for polynomials of its terms; its axes follow the outputs."""

from __future__ import annotations

import numpy as np

from mcnav.linear.departure_model import DepartureModel, RotatedAxes

COUNT = 4
PARTIALS = np.array([[3.0, 1.0, 0.0, 0.5], [0.0, 2.0, 1.0, -1.0]])


def test_polynomials_and_their_moments() -> None:
    """Moments by the Gauss-Hermite rule of nine points in each of three axes, exact to degree seventeen."""
    slopes = np.array([[1.0, -0.5, 0.3], [0.2, 0.7, -1.0]])
    axes = RotatedAxes(np.zeros(3), np.eye(3), slopes, 2)

    def departure(x: np.ndarray) -> np.ndarray:
        a, b, c = x.T
        first = 0.3 + 0.5 * a**2 + 0.2 * b**3 + 0.1 * a * b + 0.3 * a * b**2 + 0.05 * a**2 * b**2 + 0.4 * c**2
        return np.column_stack([first, b - 0.2 * a**2 * b + 0.02 * a**4 - c])

    fitted = DepartureModel.fit(axes, departure(axes.nodes))
    nodes, weights = np.polynomial.hermite_e.hermegauss(9)
    x = np.array(np.meshgrid(nodes, nodes, nodes)).reshape(3, -1).T
    w = np.prod(np.meshgrid(weights, weights, weights), axis=0).ravel() / weights.sum() ** 3
    d = departure(x)
    np.testing.assert_allclose(fitted.at(x), d, atol=1e-9)
    np.testing.assert_allclose(fitted.mean, w @ d, atol=1e-12)
    about = d - w @ d + x @ slopes.T
    np.testing.assert_allclose(fitted.added_covariance, (about.T * w) @ about - slopes @ slopes.T, atol=1e-11)


def test_axes_are_those_of_the_outputs() -> None:
    covariance = np.array([[4.0, 1.0, 0.0, 0.0], [1.0, 9.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 0.0]])
    linear = PARTIALS @ covariance @ PARTIALS.T
    axes = RotatedAxes.of(PARTIALS, np.zeros(COUNT), covariance, np.sqrt(np.diag(linear)), 3)
    assert axes.rank == 3  # one source has no dispersion
    np.testing.assert_allclose(axes.loadings @ axes.loadings.T, covariance, atol=1e-12)
    np.testing.assert_allclose(axes.slopes @ axes.slopes.T, linear, atol=1e-12)
    np.testing.assert_allclose(axes.slopes[:, 2], 0.0, atol=1e-12)  # two outputs vary along two axes
    normals = np.random.default_rng(1).standard_normal((5, 3))
    np.testing.assert_allclose(axes.normals_of(axes.errors_at(normals)), normals, atol=1e-12)
