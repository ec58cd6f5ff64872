"""Interpolation between the steps of an integrator: its degree, its bound, its nodes."""

from __future__ import annotations

import numpy as np

from mcnav.numerics.hermite import POSITION_BOUND, VELOCITY_BOUND, interpolation_weights

PLACES = np.linspace(-1.0, 1.0, 201)


def test_polynomials_of_eighth_degree_are_exact() -> None:
    """To rounding, of the size of what is added: 20 for positions, and 100 for velocities."""
    spacing = 3.0
    weights = interpolation_weights(PLACES, spacing)
    for degree in range(9):
        power = np.polynomial.Polynomial.basis(degree)
        first, second = power.deriv(1), power.deriv(2)
        nodes = np.array([-1.0, 0.0, 1.0])
        states = np.column_stack([power(nodes), first(nodes) / spacing, second(nodes) / spacing**2]).ravel()
        np.testing.assert_allclose(weights[:, 0] @ states, power(PLACES), atol=20 * 2e-16 * 9)
        np.testing.assert_allclose(weights[:, 1] @ states * spacing, first(PLACES), atol=100 * 2e-16 * 9)


def test_a_swing_is_off_by_the_bound_at_most() -> None:
    """Whatever its phase; the bound of the position is reached, that of the velocity to a tenth."""
    spacing = 0.6
    weights, nodes = interpolation_weights(PLACES, spacing), spacing * np.array([-1.0, 0.0, 1.0])
    shares = []
    for phase in np.linspace(0.0, np.pi, 13):
        swing, at = np.sin(nodes + phase), spacing * PLACES + phase
        states = np.column_stack([swing, np.cos(nodes + phase), -swing]).ravel()
        position = np.abs(weights[:, 0] @ states - np.sin(at)).max() / (POSITION_BOUND * spacing**9)
        velocity = np.abs(weights[:, 1] @ states - np.cos(at)).max() / (VELOCITY_BOUND * spacing**8)
        shares.append((position, velocity))
    position, velocity = np.max(shares, axis=0)
    assert 0.9 < position <= 1.0
    assert 0.05 < velocity <= 1.0


def test_at_a_node_it_is_the_node() -> None:
    for number, weights in enumerate(interpolation_weights(np.array([-1.0, 0.0, 1.0]), 421.7)):
        expected = np.zeros((2, 9))
        expected[0, 3 * number] = expected[1, 3 * number + 1] = 1.0
        np.testing.assert_array_equal(weights, expected)
