"""Polynomial of departures: its moments are exact for what three nodes integrate, and its axes follow the outputs."""

from __future__ import annotations

import numpy as np

from mcnav.linear.departure_model import DepartureModel, RotatedAxes

COUNT = 4
PARTIALS = np.array([[3.0, 1.0, 0.0, 0.5], [0.0, 2.0, 1.0, -1.0]])


def test_moments_of_a_cubic_map_are_exact() -> None:
    """Against moments by Gauss-Hermite nodes in four dimensions, exact for polynomials of such degree.

    Along two leading axes the map has squares, a product, cubes and a mixed third order; three nodes and the corners
    integrate all of them but the squares of the cubes, which are left out by making them small.
    """
    covariance = np.diag([1.0, 0.25, 0.04, 0.01])
    axes = RotatedAxes.of(PARTIALS, np.ones(COUNT), covariance, np.sqrt(np.diag(PARTIALS @ covariance @ PARTIALS.T)), 3)
    rng = np.random.default_rng(7)
    nominal, slopes, curved, mixed = (rng.standard_normal(shape) for shape in ((1, 2), (COUNT, 2), (COUNT, 2), (3, 2)))
    third = rng.standard_normal(2)

    def departure(x: np.ndarray) -> np.ndarray:
        products = np.stack([x[:, i] * x[:, j] for i, j in axes.pairs], axis=1)
        return np.asarray(
            nominal + x @ slopes + 0.5 * x**2 @ curved + products @ mixed + np.outer(x[:, 0] * x[:, 1] ** 2, third)
        )

    model = DepartureModel.fit(axes, departure(axes.nodes))
    nodes, weights = np.polynomial.hermite_e.hermegauss(5)
    grid = np.stack(np.meshgrid(*[nodes] * COUNT), axis=-1).reshape(-1, COUNT)
    shares = np.prod(np.stack(np.meshgrid(*[weights] * COUNT), axis=-1).reshape(-1, COUNT), axis=1) / (2 * np.pi) ** 2
    values = departure(grid)
    mean = shares @ values
    np.testing.assert_allclose(model.mean, mean, atol=1e-12)
    linear = grid @ axes.slopes.T
    exact = np.einsum("k,ki,kj->ij", shares, linear + values - mean, linear + values - mean)
    beside = np.einsum("k,ki,kj->ij", shares, linear, linear)
    # x_0 (x_1^2 - 1), of variance 2, is the one part that slopes over the errors' range do not hold
    left_out = 2.0 * np.outer(third, third)
    np.testing.assert_allclose(model.added_covariance, exact - beside - left_out, atol=1e-11)


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
