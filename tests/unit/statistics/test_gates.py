"""What gates let pass: case I, the noncentral chi-square, and a filter that is wrong about its innovations."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy import integrate, optimize, special, stats

from mcnav.analysis.gates import answer_gates
from mcnav.contract.gates import GateLaw, GateQuestion
from mcnav.errors import NumericalError
from mcnav.statistics.gates import (
    GatedError,
    acceptance,
    check_stopped,
    largest_of,
    rejected_again,
    rejected_square,
    smallest_stopped,
)

GAIN, VARIANCE, BEFORE = 0.5 * (np.sqrt(5.0) - 1.0), 0.5 * (np.sqrt(5.0) - 1.0), 0.5 * (np.sqrt(5.0) + 1.0)
"""Of a random walk with q = r = 1: K, P, and P before the update; S is one more."""

S, LIMIT = BEFORE + 1.0, 10.827566170662733


def test_case_i() -> None:
    """A spike of 6 in one measurement: digits of the check value, which was computed elsewhere."""
    means, errors, sigma = np.array([[-6.0 / np.sqrt(S)]]), np.array([6.0 * GAIN]), float(np.sqrt(VARIANCE))
    law = GatedError(LIMIT, means, np.eye(1), np.zeros(1), errors, sigma)
    assert pytest.approx(2.618034, abs=1e-6) == S
    assert acceptance(LIMIT, means, law.covariance)[0] == pytest.approx(0.338092, abs=1e-6)
    assert errors[0] == pytest.approx(3.708204, abs=1e-6)
    assert law.unnoticed_beyond(4.0 * sigma)[0] == pytest.approx(0.2580601, abs=1e-7)


def test_answers_of_its_gate() -> None:
    """The smallest spike by a root of the closed form, the worst one by scipy's minimum, and a ramp of one step."""
    one = np.ones((1, 1))
    law = GateLaw(
        "sensor", 100.0, (("position", "m", "m"),), LIMIT, np.sqrt(S) * one, np.zeros(1), S * one, np.zeros((1, 1)),
        np.zeros(1), VARIANCE * one, GAIN * one, 1.0, -one[None] / np.sqrt(S), GAIN * one,
    )  # fmt: skip
    (answer,) = answer_gates([law], GateQuestion(0.99, 1.0), [])

    def accepted(spike: float) -> float:
        reach, shift = np.sqrt(LIMIT), spike / np.sqrt(S)
        return float(special.ndtr(reach - shift) - special.ndtr(-reach - shift))

    def risk(spike: float) -> float:
        sigma = np.sqrt(VARIANCE)
        return accepted(spike) * float(stats.norm.sf((4.0 * sigma - GAIN * spike) / sigma)
                                       + stats.norm.sf((4.0 * sigma + GAIN * spike) / sigma))  # fmt: skip

    spike = optimize.brentq(lambda b: accepted(b) - 0.01, 1.0, 30.0, xtol=1e-12)
    assert answer.spike == pytest.approx(spike, rel=1e-6)  # as the bracket is wide
    assert answer.spike_error == pytest.approx(GAIN * spike, rel=1e-6)
    assert answer.limit == pytest.approx(4.0 * np.sqrt(VARIANCE), rel=1e-12)
    worst = optimize.minimize_scalar(lambda b: -risk(b), bounds=(0.0, 20.0), method="bounded")
    assert answer.risk == pytest.approx(-worst.fun, rel=1e-6)  # flat at the top
    assert answer.worst == pytest.approx(worst.x, rel=1e-3)
    assert risk(6.0) < answer.risk
    # the usual rejections do not count: one measurement of 0.001
    ramp = optimize.brentq(lambda b: accepted(b) / accepted(0.0) - 0.01, 1.0, 30.0, xtol=1e-12)
    assert answer.ramp == pytest.approx(ramp, rel=1e-6)
    assert answer.ramp_error == pytest.approx(GAIN * ramp, rel=1e-6)


def test_three_components_as_scipy_has_them() -> None:
    mean = np.array([1.0, -2.0, 0.5])
    means = np.stack([mean, 2.0 * mean, 0.0 * mean])
    expected = stats.ncx2.cdf(9.0, 3, np.sum(means**2, axis=1))
    assert acceptance(9.0, means, np.eye(3)) == pytest.approx(expected, rel=1e-9)
    assert acceptance(9.0, means, np.eye(3), rough=True) == pytest.approx(expected, rel=2e-6)
    assert np.all(acceptance(np.inf, means, np.eye(3)) == 1.0)


@pytest.mark.parametrize("size", [0.0, 0.8, 4.0])
def test_an_innovation_that_is_correlated_with_the_error(size: float) -> None:
    """Against scipy's bivariate normal, good to 1e-5, where the innovation is twice as large as believed."""
    covariance, cross, sigma, mean, error = 4.0, 0.9, 0.7, 1.2, -0.3
    law = GatedError(6.0, np.array([[mean]]), np.array([[covariance]]), np.array([cross]), np.array([error]), sigma)
    both = stats.multivariate_normal([mean, error], [[covariance, cross], [cross, sigma**2]])
    reach = np.sqrt(6.0)

    def rectangle(low: float, high: float) -> float:
        corners = [both.cdf([n, e]) * sign for n, one in ((reach, 1), (-reach, -1)) for e, sign in
                   ((high, one), (low, -one))]  # fmt: skip
        return float(sum(corners))

    expected = rectangle(size, 50.0) + rectangle(-50.0, -size)
    assert law.unnoticed_beyond(size)[0] == pytest.approx(expected, abs=2e-5)


def test_where_nothing_is_stopped() -> None:
    assert smallest_stopped(lambda size: 1.0, 0.9) == np.inf
    assert smallest_stopped(lambda size: 0.05, 0.9) == 0.0
    assert largest_of(lambda x: np.cos(x - 0.3), 2.0) == pytest.approx(0.3, abs=1e-6)
    with pytest.raises(NumericalError, match=r"should accept with 0\.05 is accepted with 0\.06"):
        check_stopped(0.06, 0.95)


@pytest.mark.parametrize(("variance", "correlation"), [(25.0, 0.999), (400.0, 0.99), (1e6, 0.9)])
def test_a_gate_that_is_open_for_few_of_the_errors(variance: float, correlation: float) -> None:
    """Of an innovation that the error nearly determines: by the law of the error given the innovation, in the gate."""
    limit, mean, error, sigma, size = 6.0, 3.0, 0.1, 0.7, 0.3
    cross = correlation * np.sqrt(variance) * sigma
    law = GatedError(limit, np.array([[mean]]), np.array([[variance]]), np.array([cross]), np.array([error]), sigma)
    nodes, weights = np.polynomial.legendre.leggauss(400)
    innovation = np.sqrt(limit) * nodes
    density = np.sqrt(limit) * weights * stats.norm.pdf(innovation, mean, np.sqrt(variance))
    centre, spread = error + cross / variance * (innovation - mean), sigma * np.sqrt(1.0 - correlation**2)
    beyond = special.ndtr((-size - centre) / spread) + special.ndtr((centre - size) / spread)
    assert law.unnoticed_beyond(size)[0] == pytest.approx(float(density @ beyond), rel=1e-6)


@pytest.mark.parametrize("rejected", [0.1, 1e-3])
@pytest.mark.parametrize("size", [1, 2, 6])
def test_mean_square_of_what_is_rejected(rejected: float, size: int) -> None:
    limit = stats.chi2.isf(rejected, size)
    mean = integrate.quad(lambda x: x * stats.chi2.pdf(x, size), limit, np.inf)[0] / rejected / size
    assert rejected_square(limit, size) == pytest.approx(mean, rel=1e-8)


@pytest.mark.parametrize("rejected", [0.1, 1e-2, 1e-4])
@pytest.mark.parametrize("correlation", [0.0, 0.3, 0.9, 0.99])
def test_rejected_again_by_quadrature(rejected: float, correlation: float) -> None:
    """One component: the conditional normal probability over the tail of the first."""
    limit, left = float(stats.chi2.isf(rejected, 1)), np.sqrt(1.0 - correlation**2)
    reach = np.sqrt(limit)

    def density(x: float) -> float:
        beyond = special.ndtr((correlation * x - reach) / left) + special.ndtr((-correlation * x - reach) / left)
        return 2.0 * stats.norm.pdf(x) * float(beyond)

    ends = [reach, reach + left, reach + 4.0 * left, reach + 10.0]
    joint = sum(integrate.quad(density, *each, epsabs=1e-15, epsrel=1e-12)[0] for each in pairwise(ends))
    again = rejected_again(limit, np.array([[correlation]]))[0]
    assert again == pytest.approx(joint / rejected, rel=1e-7)


def test_rejected_again_near_one() -> None:
    """The expansion is cut there: the error is at most half of what is left, and none for equal innovations."""
    limit = float(stats.chi2.isf(0.05, 2))
    again = rejected_again(limit, np.array([[1.0, 1.0], [1.0 - 1e-9, 1.0 - 1e-9], [0.9999, 0.9999]]))
    assert again[0] == 1.0
    assert np.all(np.diff(again) < 0.0)
    # two components alike: the noncentral chi-square over the exponential tail of the first
    share = 0.9999**2
    tail = integrate.quad(
        lambda x: 0.5 * np.exp(-0.5 * (x - limit)) * stats.ncx2.sf(limit / (1.0 - share), 2, share * x / (1.0 - share)),
        limit, limit + 60.0, limit=500, points=[limit + 0.1, limit + 0.5],
    )[0]  # fmt: skip
    assert again[2] == pytest.approx(tail, abs=5e-3)


def test_rejected_again_of_unlike_components() -> None:
    """Three canonical correlations by a simulation of the tail; false alarm 1e-4."""
    rejected, correlations, count = 1e-3, np.array([0.9, 0.5, 0.1]), 400_000
    limit, generator = float(stats.chi2.isf(rejected, 3)), np.random.default_rng(53)
    sizes = np.sqrt(stats.chi2.isf(rejected * generator.random(count), 3))
    first = generator.standard_normal((count, 3))
    first *= (sizes / np.linalg.norm(first, axis=1))[:, None]
    second = correlations * first + np.sqrt(1.0 - correlations**2) * generator.standard_normal((count, 3))
    again = int(np.sum(np.sum(second**2, axis=1) > limit))
    low, high = stats.binom.ppf([5e-5, 1.0 - 5e-5], count, rejected_again(limit, correlations[None])[0])
    assert low <= again <= high


def test_cases_at_once_are_those_alone_and_those_of_samples() -> None:
    """Three components, two cases, an innovation that differs from what the filter believes; false alarm 1e-4."""
    covariance, cross = np.array([[3.0, 0.5, 0.0], [0.5, 1.5, 0.2], [0.0, 0.2, 0.8]]), np.array([0.6, -0.2, 0.1])
    means, errors, sigma, size = np.array([[1.0, -2.0, 0.5], [0.0, 0.0, 3.0]]), np.array([0.4, -0.2]), 0.6, 1.0
    at_once = GatedError(9.0, means, covariance, cross, errors, sigma).unnoticed_beyond(size)
    root = np.linalg.cholesky(np.block([[covariance, cross[:, None]], [cross, np.array([[sigma**2]])]]))
    draws = np.random.default_rng(53).standard_normal((200_000, 4)) @ root.T
    for case, (mean, error) in enumerate(zip(means, errors, strict=True)):
        law = GatedError(9.0, mean[None], covariance, cross, error[None], sigma)
        assert law.unnoticed_beyond(size)[0] == pytest.approx(at_once[case], rel=1e-9)
        assert law.unnoticed_beyond(size, rough=True)[0] == pytest.approx(at_once[case], rel=2e-4)
        unnoticed = (np.sum((draws[:, :3] + mean) ** 2, axis=1) <= 9.0) & (np.abs(draws[:, 3] + error) > size)
        low, high = stats.binom.ppf([5e-5, 1.0 - 5e-5], len(draws), at_once[case])
        assert low <= unnoticed.sum() <= high
