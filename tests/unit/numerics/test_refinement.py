"""Steps settled by measurement, on outcomes whose error is known."""

from __future__ import annotations

import numpy as np
import pytest

from mcnav.numerics.refinement import largest_share, refined_steps

PROBES = np.column_stack([np.linspace(-2.0, 2.0, 33), np.zeros(33)])
SIGMA = PROBES[:, 0].std()


@pytest.mark.parametrize("order", [4, 8])
@pytest.mark.parametrize("tolerance", [1e-3, 1e-6])
def test_the_stated_error_is_exact_for_a_pure_power(order: int, tolerance: float) -> None:
    """Of outcomes y (1 + c / steps^p) the error is c / steps^p of the largest probe; refined by a tenth too many."""

    def simulate(steps: int) -> tuple[np.ndarray, np.ndarray]:
        return PROBES * (1.0 + 7.0 * float(steps) ** -order), np.ones(len(PROBES), dtype=bool)

    steps, error = refined_steps(simulate, 2, 10_000, order, tolerance)
    finer = 1.0 + 7.0 * float(2 * steps) ** -order  # the sigma of reference is that of twice the steps
    assert error == pytest.approx(7.0 * float(steps) ** -order * 2.0 / SIGMA / finer, rel=1e-6)
    assert error <= tolerance
    sufficient = (7.0 * 2.0 / SIGMA / tolerance) ** (1.0 / order)
    assert steps <= max(2, np.ceil(1.2 * sufficient) + 1)


def test_the_most_steps_end_the_search() -> None:
    found = refined_steps(lambda steps: (PROBES * (1.0 + 1.0 / steps), np.ones(33, dtype=bool)), 2, 64, 8, 1e-12)
    assert found[0] == 64
    assert found[1] > 1e-12


def test_probes_that_are_not_valid_and_outputs_that_are_zero_do_not_count() -> None:
    def simulate(steps: int) -> tuple[np.ndarray, np.ndarray]:
        values = PROBES.copy()
        values[0] = steps
        return values, np.arange(33) > 0

    assert refined_steps(simulate, 2, 64, 8, 1e-12) == (2, 0.0)
    assert largest_share(np.ones((3, 2)), np.array([[1.0, 0.0]] * 3)) == 0.0
    assert largest_share(np.full((3, 1), 1.5), np.ones((3, 1))) == 0.5
