"""The polynomial through a few simulations: exact for polynomials of its terms, with their moments."""

from __future__ import annotations

import numpy as np

from mcnav.linear.departure_model import DepartureModel, RotatedAxes


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
