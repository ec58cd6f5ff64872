"""Factors of the covariances of a step's noise."""

from __future__ import annotations

import numpy as np

from mcnav.systems.ins.ensemble.free import semidefinite_factor


def test_factors_are_lower_triangular_and_give_the_covariances() -> None:
    """Of full rank, of rank two, and without a third of the directions; units differ by a factor of a million."""
    chance = np.random.default_rng(5)
    units = np.array([1.0, 1e-3, 1e3, 1.0, 1e-3, 1e3])
    roots = [chance.standard_normal((6, rank)) for rank in (6, 2, 6)]
    roots[2][1::3] = 0.0
    covariance = np.array([np.outer(units, units) * (root @ root.T) for root in roots])
    factor = semidefinite_factor(covariance)
    assert (np.triu(factor, 1) == 0.0).all()
    found = factor @ factor.transpose(0, 2, 1)
    # a pivot that is taken as rounding leaves an error of a millionth
    np.testing.assert_allclose(found / np.outer(units, units), covariance / np.outer(units, units), atol=1e-6)
