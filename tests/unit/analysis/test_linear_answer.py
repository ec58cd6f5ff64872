"""Linear answers: requirements with closed forms, margins, and moments over time."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import special

from mcnav.analysis.linear_answer import LinearRequirement, causes_at, judge_linearly
from mcnav.analysis.linear_covariance import Moments, covariance_over_time
from mcnav.analysis.model import Model
from mcnav.analysis.requirements import Requirement
from mcnav.contract.linear import LinearSystem

ROOT = 1e-9
"""Relative error of a radius by quadrature, and of roots."""


def model(*sigmas: float) -> Model:
    size = len(sigmas)
    return Model(np.eye(size), np.zeros(size), np.zeros(size), np.diag(np.square(sigmas)))


def judged(
    requirements: list[Requirement], described: Model, history: Moments | None = None
) -> tuple[LinearRequirement, ...]:
    return judge_linearly(
        requirements, described.outcome_mean, described.outcome_covariance, history, nominal=described.nominal
    )


def test_quantile_and_radius_of_normal_errors() -> None:
    """The quantile of |x| is Phi^-1((1 + p) / 2) sigma; the Rayleigh radius is sigma sqrt(-2 ln(1 - p))."""
    requirements = [Requirement("quantile", (0,), (5.0,), 0.95), Requirement("cep", (0, 1), (2.0,), 0.5)]
    one, two = judged(requirements, model(2.0, 2.0))
    assert one.value == pytest.approx(2.0 * special.ndtri(0.975), rel=ROOT)
    assert two.value == pytest.approx(2.0 * np.sqrt(2.0 * np.log(2.0)), rel=ROOT)
    assert (one.met, two.met) == (True, False)
    assert one.margin == pytest.approx(5.0 / one.value)


def test_small_probabilities_beyond_limits_are_stated_of_requirements_that_allow_them() -> None:
    """Of one output, a circle (Rayleigh) and a box, far beyond where one less a probability is rounding."""
    asked = [
        Requirement("quantile", (0,), (14.0,), 1.0 - 1e-6), Requirement("box", (0, 1), (14.0, 16.0), 1.0 - 1e-6),
        Requirement("quantile", (0,), (14.0,), 0.99), Requirement("cep", (0, 1), (14.0,), 0.5),
    ]  # fmt: skip
    one, both, usual, half = judged(asked, model(2.0, 2.0))
    each = 2.0 * special.ndtr([-7.0, -8.0])
    assert one.beyond == pytest.approx(each[0], rel=ROOT, abs=0.0)
    assert both.beyond == pytest.approx(each.sum() - each.prod(), rel=ROOT, abs=0.0)
    assert np.isnan([usual.beyond, half.beyond]).all()


def test_margin_of_a_box() -> None:
    """Of one output: sigma may grow to limit / Phi^-1((1 + p) / 2)."""
    (found,) = judged([Requirement("box", (0,), (3.0,), 0.9)], model(1.0))
    assert found.value == pytest.approx(2.0 * special.ndtr(3.0) - 1.0, rel=ROOT)
    assert found.margin == pytest.approx(3.0 / special.ndtri(0.95), rel=ROOT)
    assert found.met


@pytest.mark.parametrize("kind", ["cep", "box"])
@pytest.mark.parametrize("nominal", [0.0, 0.3])
def test_margin_scales_all_errors_with_their_mean_about_the_nominal(kind: str, nominal: float) -> None:
    requirement = Requirement(kind, (0, 1), (2.0,) if kind == "cep" else (2.0, 3.0), 0.5)
    described = Model(np.eye(2), np.array([nominal, 0.0]), np.array([0.0, 0.4]), np.diag([1.0, 4.0]))
    (found,) = judged([requirement], described)
    k = found.margin
    scaled = Model(np.eye(2), described.nominal, k * described.mean, k**2 * described.covariance)
    (just,) = judged([requirement], scaled)
    assert just.value == pytest.approx(2.0 if kind == "cep" else 0.5, rel=ROOT)


def test_a_time_of_flight_may_be_dispersed_until_its_limit() -> None:
    """At 500 s with a sigma of 1 s, 510 s in 97.725 % (one side, 2 sigma) of flights allow a sigma of 5 s."""
    requirement = Requirement("quantile", (0,), (510.0,), special.ndtr(2.0))
    (found,) = judged([requirement], Model(np.eye(1), np.array([500.0]), np.zeros(1), np.eye(1)))
    assert found.value == pytest.approx(502.0, rel=ROOT)
    assert found.margin == pytest.approx(5.0, rel=1e-7)


@pytest.mark.parametrize(("nominal", "sigma", "margin"), [(511.0, 1.0, 0.0), (500.0, 0.0, np.inf)])
@pytest.mark.parametrize("kind", ["quantile", "box"])
def test_a_nominal_beyond_its_limit_leaves_no_room(kind: str, nominal: float, sigma: float, margin: float) -> None:
    requirement = Requirement(kind, (0,), (510.0,), 0.9)
    (found,) = judged([requirement], Model(np.eye(1), np.array([nominal]), np.zeros(1), np.eye(1) * sigma**2))
    assert found.margin == margin


def test_a_sigma_ratio_needs_monte_carlo() -> None:
    (found,) = judged([Requirement("sigma_ratio", (0,), (0.05,), None)], model(1.0))
    assert not found.judged


def test_requirements_over_time_are_on_readings_after_updates() -> None:
    """Sigma is 1, then 3 before an update and 2 after it: the largest at epochs 0 and 1 is 2, at the time 10."""
    partials = np.array([1.0, 3.0, 2.0])[:, None, None]
    readings = LinearSystem(np.array([0.0, 10.0, 10.0]), partials, updates=(None, "before", "after"))
    history = covariance_over_time(readings, ("x",), np.zeros(1), np.eye(1))
    requirement = Requirement("quantile", (0,), (4.0,), 0.6826894921370859, "", (0, 1))
    (found,) = judged([requirement], model(1.0), history.moments)
    assert found.value == pytest.approx(2.0, rel=1e-9)
    assert found.time == 10.0
    assert found.margin == pytest.approx(2.0, rel=1e-9)


def test_covariance_over_time_adds_up() -> None:
    """Sources that are correlated, a mean, and noise: the diagonal is that of P S P^T + Q."""
    rng = np.random.default_rng(5)
    partials, half = rng.standard_normal((4, 2, 3)), rng.standard_normal((3, 3))
    noise = np.stack([np.eye(2) * k for k in range(4)])
    readings = LinearSystem(np.arange(4.0), partials, processes={"noise": noise})
    sources, mean = half @ half.T, rng.standard_normal(3)
    found = covariance_over_time(readings, ("a", "b", "c"), mean, sources)
    expected = np.stack([each @ sources @ each.T for each in partials]) + noise
    np.testing.assert_allclose(found.covariance, expected, rtol=1e-12)
    np.testing.assert_allclose(found.sigma**2, np.diagonal(expected, axis1=1, axis2=2), rtol=1e-12)
    np.testing.assert_allclose(found.mean, partials @ mean, rtol=1e-12)
    total = found.correlations + sum(found.variances.values())
    np.testing.assert_allclose(total, found.sigma**2, rtol=1e-12)
    np.testing.assert_allclose(sum(found.attributed.values()), found.sigma**2, rtol=1e-12)
    (cause,) = (cause for cause in causes_at(found, 2, 1) if cause.name == "b")
    crossed = sum(partials[2, 1, 1] * sources[1, k] * partials[2, 1, k] for k in range(3))
    assert cause.share == pytest.approx(crossed / expected[2, 1, 1], rel=1e-12)


@pytest.mark.parametrize(("limit", "met"), [(5.5, False), (5.86, True)])
def test_a_burn_along_the_narrow_axis_of_its_covariance(limit: float, met: bool) -> None:
    """The size of 5 m/s with 0.1005 along and 1 across: 99.73 % below 5.8562 m/s, computed elsewhere."""
    covariance = np.diag([1.0001, 0.0101, 0.0101])
    covariance[1, 2] = covariance[2, 1] = 0.0101  # to first order the size is its component along
    mean = np.array([0.0, 5.0, 5.0])
    requirement = Requirement("quantile", (2,), (limit,), 0.9973)
    (judged,) = judge_linearly([requirement], mean, covariance, None, {2: (0, 1)}, mean)
    assert judged.value == pytest.approx(5.8562, abs=5e-5)
    assert judged.met == met
