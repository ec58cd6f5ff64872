"""The polynomial map: as near the flights as it says, refused where it is not, and the same bits in any chunks."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from mcnav.contract.engine import without_noise
from mcnav.contract.samples import Batch, SimulationResult
from mcnav.linear.polynomial import PolynomialFitError, fit
from mcnav.linear.polynomial_engine import TOLERANCE, PolynomialEngine, fit_polynomial_engine
from mcnav.systems.reentry.table_i import ALL_ERRORS, COLUMNS, ERRORS, among_all
from tests.conftest import reentry

Draw = Callable[[int, float], np.ndarray]
DRAWS = 20_000


@pytest.fixture(autouse=True)
def _one_thread() -> Iterator[None]:
    with threadpool_limits(1):
        yield


@lru_cache
def _map(number: int) -> PolynomialEngine:
    probes = among_all(np.random.default_rng(7).standard_normal((64, len(ERRORS))) * ERRORS)
    return fit_polynomial_engine(reentry(number).engine("ensemble", probes), np.zeros(len(ALL_ERRORS)), ALL_ERRORS)


@pytest.mark.parametrize("number", range(1, 8))
def test_every_draw_is_within_the_tolerance_of_its_flight(number: int, draws: Draw) -> None:
    """At the report's errors, 20,000 draws: 1e-4 of each output's dispersion in the worst of them."""
    engine, errors = _map(number), draws(DRAWS, 1.0)
    flown, mapped_ = without_noise(engine.exact)(errors).values, without_noise(engine)(errors)
    assert (np.abs(mapped_.values - flown).max(axis=0) / flown.std(axis=0)).max() <= TOLERANCE
    assert mapped_.fallback_count <= 2
    assert engine.polynomial.error <= TOLERANCE


def test_far_samples_are_flown(draws: Draw) -> None:
    """Beyond the fitted points the flight itself is returned, bit for bit, and counted."""
    engine, errors = _map(4), draws(50, 1.0)
    errors[[3, 17]] *= 3.0 * engine.polynomial.reach / np.sqrt(len(ERRORS))
    outcomes = without_noise(engine)(errors)
    far = np.flatnonzero(((errors[:, COLUMNS] / ERRORS) ** 2).sum(axis=1) > engine.polynomial.reach**2)
    assert {3, 17} <= set(far.tolist())
    assert outcomes.fallback_count == len(far)
    assert np.array_equal(outcomes.values[far], without_noise(engine.exact)(errors[far]).values)


def test_samples_within_reach_are_not_flown() -> None:
    """The exact engine, which may take long for none as well, is not called."""

    class Grounded:
        accuracy, parallel, chunk, epochs, noisy, filter = "", "threads", 1, None, False, None

        def simulate(self, batch: Batch, noise: bool = True) -> SimulationResult:
            raise AssertionError(f"{len(batch.errors)} samples are simulated")

    engine = replace(_map(4), exact=Grounded())
    assert without_noise(engine)(np.zeros((5, len(ALL_ERRORS)))).fallback_count == 0


@pytest.mark.parametrize(("multiple", "last"), [(4.0, 4), (100.0, 2)])
def test_refused_where_no_polynomial_holds(multiple: float, last: int, draws: Draw) -> None:
    """The message says how near each order came; where the first is hopeless, no further one is tried."""
    prepared = reentry(4).engine("ensemble", draws(64, multiple))
    with pytest.raises(
        PolynomialFitError, match=rf"no polynomial represents .* within 0\.0001 .* with order {last}; use the"
    ):
        fit_polynomial_engine(prepared, np.zeros(len(ALL_ERRORS)), multiple * ALL_ERRORS)


def test_bits_do_not_depend_on_chunks(draws: Draw) -> None:
    engine, errors = _map(1), draws(5_003, 1.0)
    whole = without_noise(engine)(errors).values
    parts = [without_noise(engine)(part).values for part in np.split(errors, [1, 18, 1_000, 3_333])]
    assert np.array_equal(whole, np.concatenate(parts))


def test_derivatives_are_those_of_a_known_system() -> None:
    """A quadratic is found again, and a source without dispersion takes no part."""
    gradient, hessian = np.array([1.0, -3.0]), np.array([[0.3, 0.1], [0.1, -0.4]])

    def quadratic(errors: np.ndarray) -> SimulationResult:
        s = errors[:, :2]
        return SimulationResult((s @ gradient + 0.5 * np.einsum("ni,ij,nj->n", s, hessian, s))[:, None])

    found = fit(quadratic, np.zeros(3), np.array([2.0, 0.5, 0.0]), 3)
    derivatives = {
        tuple(row): value for row, value in zip(found.exponents.tolist(), found.coefficients[:, 0], strict=True)
    }
    scale = found.scale
    for i, first in enumerate(np.eye(3, dtype=int)[:2]):
        assert derivatives[tuple(first)] / scale[i] == pytest.approx(gradient[i], abs=1e-10)
        for j, second in enumerate(np.eye(3, dtype=int)[: i + 1]):
            value = derivatives[tuple(first + second)] / (scale[i] * scale[j])
            assert value * (2.0 if i == j else 1.0) == pytest.approx(hessian[i, j], abs=1e-10)
    assert found.error < 1e-10


def test_terms_that_one_output_needs_are_kept_and_no_others() -> None:
    """Two outputs with a cubic each: terms of order three that neither has are left out, the others found again."""

    def cubics(errors: np.ndarray) -> SimulationResult:
        x, y = errors.T
        return SimulationResult(np.stack([2.0 * x + 0.5 * x**3, y - 0.25 * y**3], axis=1))

    found = fit(cubics, np.zeros(2), np.ones(2), 3, 1e-6)
    coefficients = dict(zip(map(tuple, found.exponents.tolist()), found.coefficients.tolist(), strict=True))
    assert {term for term in coefficients if sum(term) == 3} == {(3, 0), (0, 3)}
    assert coefficients[3, 0] == pytest.approx([0.5, 0.0], abs=1e-12)
    assert coefficients[0, 3] == pytest.approx([0.0, -0.25], abs=1e-12)
    assert found.error < 1e-12
