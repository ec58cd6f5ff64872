"""Innovations of a filter with any gain: their law, their likelihood, and the sizes that they show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import binom, multivariate_normal, norm

from mcnav.arrays.types import Array
from mcnav.contract.recorded import FilteredRecord
from mcnav.judgement.assessment import LEVEL, Assessment, assess
from mcnav.judgement.likelihood import log_likelihood, whiten, without_corrections
from mcnav.judgement.profile import DROP
from mcnav.judgement.scan import Scan
from mcnav.judgement.simulation import Innovations, respond, simulate
from tests.recorded_flights import scalar_record

GAIN = 0.3
C0, CORRELATION = 3.137254902, 0.381250
"""Variance of the innovations and their correlation from one to the next with q = r = 1 and this gain.

P = ((1 - K)^2 q + K^2 r) / (1 - (1 - K)^2) + q; C0 = P + r, C1 = P - K C0.
"""


def innovations_of(values: Array) -> Innovations:
    """Return innovations of shape (n, R)."""
    return Innovations(tuple(each[None] for each in values), np.zeros((0, 9, values.shape[1])))


def likelihoods(record: FilteredRecord, given: Innovations, factors: list[dict[int, float]]) -> Array:
    return log_likelihood(record, without_corrections(record, given), factors)


def response_matrices(count: int, gain: float) -> tuple[Array, Array]:
    """Return the responses of all innovations to all steps of the walk, and to all measurements' noise."""
    walk, noise = np.zeros((2, count, count))
    errors = np.zeros((2, count))
    for row in range(count):
        errors[0, row] += 1.0
        walk[row], noise[row] = errors
        noise[row, row] += 1.0
        errors[0], errors[1] = errors[0] - gain * walk[row], errors[1] - gain * noise[row]
    return walk, noise


def test_simulated_innovations_have_the_closed_forms_of_a_gain() -> None:
    """Of 4000 records after 60 steps: a variance is known to sqrt(2 / 4000), to four sigmas."""
    record = scalar_record(62, GAIN)
    values = np.array([each[0] for each in simulate(record, 4000, np.random.default_rng(0)).values])
    last, before = values[-1], values[-2]
    assert np.mean(last**2) == pytest.approx(C0, rel=4.0 * np.sqrt(2.0 / 4000))
    correlation = np.mean(last * before) / np.sqrt(np.mean(last**2) * np.mean(before**2))
    assert correlation == pytest.approx(CORRELATION, abs=4.0 * (1.0 - CORRELATION**2) / np.sqrt(4000))


@pytest.mark.parametrize("factors", [{}, {0: 2.0}, {1: 0.4}, {0: 3.0, 1: 1.5}])
def test_log_likelihood_is_that_of_the_whole_normal_vector(factors: dict[int, float]) -> None:
    count = 20
    record, values = scalar_record(count, GAIN), np.random.default_rng(1).standard_normal((count, 3))
    walk, noise = response_matrices(count, GAIN)
    covariance = factors.get(0, 1.0) ** 2 * walk @ walk.T + factors.get(1, 1.0) ** 2 * noise @ noise.T
    expected = multivariate_normal(np.zeros(count), covariance).logpdf(values.T) + 0.5 * count * np.log(2.0 * np.pi)
    np.testing.assert_allclose(likelihoods(record, innovations_of(values), [factors])[0], expected, rtol=1e-10)


def test_whitened_innovations_are_independent_of_the_gain() -> None:
    """The same walk and noise through filters of two gains have the same whitened innovations."""
    count, rng = 30, np.random.default_rng(2)
    walk, noise = rng.standard_normal((2, count, 1))
    results = []
    for gain in (0.1, 0.6):
        of_walk, of_noise = response_matrices(count, gain)
        values = innovations_of(of_walk @ walk + of_noise @ noise)
        record = scalar_record(count, gain)
        results.append([each for (each,), _ in whiten(record, without_corrections(record, values), [{}])])
    np.testing.assert_allclose(results[0], results[1], rtol=0.0, atol=1e-12)


@pytest.mark.parametrize(("cause", "q", "r"), [(0, 4.0, 1.0), (1, 1.0, 2.25)])
def test_variances_come_back_from_innovations_of_a_wrong_gain(cause: int, q: float, r: float) -> None:
    """Of 300 records, as many intervals of the likelihood ratio as a coverage of 93 to 97 % allows hold the factor."""
    record, factor = scalar_record(100, GAIN), np.sqrt(q * r)
    given = simulate(scalar_record(100, GAIN, q, r), 300, np.random.default_rng(3))
    grid = factor * np.geomspace(0.5, 2.0, 21)
    table = likelihoods(record, given, [{cause: float(each)} for each in grid])
    held = int(np.sum(table.max(axis=0) - table[10] <= DROP))
    assert binom.ppf(1e-4, 300, 0.93) <= held <= binom.isf(1e-4, 300, 0.97)
    estimate = Scan(with_innovations(record, given)).factors({cause: DROP})[cause]
    fine = np.geomspace(estimate.low / 1.1, 1.1 * estimate.high, 400)
    (curve,) = likelihoods(record, given.chosen(slice(0, 1)), [{cause: float(each)} for each in fine]).T
    assert estimate.value == pytest.approx(fine[int(np.argmax(curve))], rel=5e-3)
    within = fine[curve >= curve.max() - DROP]
    assert (estimate.low, estimate.high) == pytest.approx((within[0], within[-1]), rel=5e-3)


def with_innovations(record: FilteredRecord, given: Innovations) -> FilteredRecord:
    """Return the record with the innovations of the first of some others."""
    stages = tuple(
        replace(stage, innovation=value[:, 0]) for stage, value in zip(record.stages, given.values, strict=True)
    )
    return replace(record, stages=stages)


def alarms(result: Assessment) -> NDArray[np.bool_]:
    """Return which records are at odds with the campaign, shape (R,)."""
    return np.asarray(result.probability(result.scores.max(axis=0)) <= LEVEL)


def test_false_alarms_are_as_stated() -> None:
    """A share of 1000 records against another 1000, both with a binomial error; false alarm of this test 1e-4."""
    record = scalar_record(60, 0.618033989, believed=2.618033989)
    given = simulate(record, 1000, np.random.default_rng(4))
    share = float(np.mean(alarms(assess(record, given, 1000, 20, 5))))
    assert share == pytest.approx(0.05, abs=float(norm.isf(5e-5)) * np.sqrt(2.0 * 0.05 * 0.95 / 1000))


def test_the_number_that_is_wrong_is_named() -> None:
    """With noise twice as large the noise is named, with steps of the walk three times as large the walk.

    Its time is told once, after the first of two parts.
    """
    record = scalar_record(100, 0.618033989, believed=2.618033989)
    for cause, (q, r) in enumerate([(9.0, 1.0), (1.0, 4.0)]):
        given = simulate(scalar_record(100, 0.618033989, q, r), 200, np.random.default_rng(6))
        told: list[float] = []
        result = assess(record, given, 500, 50, 7, told.append)
        assert len(told) == 1
        assert np.mean(alarms(result) & (result.foremost == cause)) > 0.9


def test_the_power_that_is_predicted_is_that_of_records_with_the_size_changed() -> None:
    """Share found of records with a noise of 1.2 times its size, predicted by 400 and counted in 400 others."""
    record = scalar_record(100, 0.618033989, believed=2.618033989)
    given = simulate(scalar_record(100, 0.618033989, 1.0, 1.44), 400, np.random.default_rng(8))
    result = assess(record, given, 1000, 400, 9)
    predicted = float(np.mean(result.power[1, 0] > result.critical))
    counted = float(np.mean(result.scores[-2:].max(axis=0) > result.critical))
    assert 0.1 < predicted < 0.9
    assert counted == pytest.approx(predicted, abs=float(norm.isf(5e-5)) * np.sqrt(2.0 * 0.25 / 400))


def test_a_start_alone_fades_as_the_gain_says() -> None:
    start = np.zeros((9, 1))
    start[0] = 2.0
    values = [float(each[0, 0]) for each in respond(scalar_record(5, GAIN), start).values]
    np.testing.assert_allclose(values, 2.0 * 0.7 ** np.arange(5), rtol=1e-12)
