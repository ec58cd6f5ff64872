"""Tests of somebody else's filter by a table of errors: levels, intervals, refusals."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import binom

from mcnav.arrays.types import Array
from mcnav.judgement.error_table import ErrorTable, effective_number, judge_errors, judge_size, whiteness


def correlated(rng: np.random.Generator, count: int, phi: float, columns: int) -> Array:
    """Return autoregressive errors of variance one, shape (count, columns)."""
    driven = rng.standard_normal((count + 500, columns)) * np.sqrt(1.0 - phi**2)
    return np.asarray(lfilter([1.0], [1.0, -phi], driven, axis=0)[500:])


@pytest.mark.parametrize(("phi", "count"), [(0.0, 200), (0.5, 200), (0.9, 1000)])
def test_right_sigmas_raise_alarms_as_often_as_stated(phi: float, count: int) -> None:
    """At 5 %: of 400 records between 3 % and 8 %, within binomial bounds of 1e-4."""
    errors = correlated(np.random.default_rng(0), count, phi, 400)
    results = [judge_size(column[:, None]) for column in errors.T]
    alarms = sum(result is None or result.p_value < 0.05 for result in results)
    assert binom.ppf(5e-5, 400, 0.04) <= alarms <= binom.isf(5e-5, 400, 0.07)


@pytest.mark.parametrize("phi", [0.0, 0.5, 0.9])
def test_effective_number_is_that_of_an_autoregression(phi: float) -> None:
    """``n (1 - phi^2) / (1 + phi^2)``, to what a record of 20,000 tells of phi."""
    values = correlated(np.random.default_rng(1), 20_000, phi, 1)[:, 0]
    assert effective_number(values) == pytest.approx(20_000 * (1.0 - phi**2) / (1.0 + phi**2), rel=0.1)


def test_a_factor_of_the_sigma_comes_back_within_its_interval() -> None:
    errors = correlated(np.random.default_rng(2), 2000, 0.8, 100) * 1.5
    results = [judge_size(column[:, None]) for column in errors.T]
    held = sum(result is not None and result.low <= 2.25 <= result.high for result in results)
    assert held >= binom.ppf(1e-4, 100, 0.94)


def test_a_record_of_few_independent_values_says_nothing() -> None:
    assert judge_size(correlated(np.random.default_rng(3), 200, 0.995, 1)) is None
    assert judge_size(np.ones((10, 1))) is None
    assert whiteness(np.ones(10)) is None


def test_a_covariance_is_judged_as_a_whole() -> None:
    """Errors correlated as stated have the mean square one, and another one where the correlation is left out."""
    rng = np.random.default_rng(4)
    root = np.array([[1.0, 0.0], [0.9, np.sqrt(1.0 - 0.81)]])
    values = rng.standard_normal((4000, 2)) @ root.T
    errors = {name: (column, np.ones(4000)) for name, column in zip("ab", values.T, strict=True)}
    covariance = np.broadcast_to(root @ root.T, (4000, 2, 2))
    table = ErrorTable(np.arange(4000.0), errors, {"a and b": (("a", "b"), covariance)}, {})
    verdicts = {each.name: each.size for each in judge_errors(table)}
    whole = verdicts["a and b"]
    assert whole is not None
    assert whole.ratio == pytest.approx(1.0, abs=4.0 * np.sqrt(1.0 / 4000))
    wrong = ErrorTable(table.times, errors, {"a and b": (("a", "b"), np.tile(np.diag([0.5, 0.5]), (4000, 1, 1)))}, {})
    doubled = next(each.size for each in judge_errors(wrong) if each.name == "a and b")
    assert doubled is not None
    assert doubled.low > 1.5


def test_correlated_innovations_are_noticed() -> None:
    values = correlated(np.random.default_rng(5), 500, 0.3, 1)[:, 0]
    table = ErrorTable(np.arange(500.0), {}, {}, {"range": (values, np.ones(500))})
    (verdict,) = judge_errors(table)
    assert verdict.whiteness is not None
    assert verdict.whiteness.p_value < 1e-4
    assert verdict.whiteness.autocorrelation == pytest.approx(0.3, abs=4.0 / np.sqrt(500))
