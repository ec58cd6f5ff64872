"""Our statistics and linear algebra against scipy, filterpy and OpenTURNS."""

from __future__ import annotations

import numpy as np
import openturns as ot
import pytest
from filterpy.kalman import MerweScaledSigmaPoints, unscented_transform
from filterpy.stats import NEES
from scipy import optimize, stats

from mcnav.analysis.comparison import Criterion, compare
from mcnav.analysis.model import Model
from mcnav.contract.engine import without_noise
from mcnav.contract.samples import SimulationResult
from mcnav.linear.covariance import propagated_covariance
from mcnav.linear.sobol import POINTS, REPLICATES, estimate_sobol_indices
from mcnav.linear.unscented import unscented_covariance
from mcnav.sampler.distributions import Distribution, Normal, StudentT, Triangular, TruncatedNormal, Uniform
from mcnav.sampler.error_model import ErrorModel
from mcnav.sampler.sobol_net import scrambled_net
from mcnav.statistics.estimates import blocked_mean
from tests.calibration.rare_events import curved
from tests.conftest import campaign, reentry

PAIRS = [
    (Normal(2.0), stats.norm(scale=2.0)),
    (Uniform(3.0), stats.uniform(-3.0, 6.0)),
    (Triangular(3.0), stats.triang(0.5, -3.0, 6.0)),
    (TruncatedNormal(2.0, 3.0), stats.truncnorm(-1.5, 1.5, scale=2.0)),
    (TruncatedNormal(2.0, 0.02), stats.truncnorm(-0.01, 0.01, scale=2.0)),
    (StudentT(2.0, 5.0), stats.t(5.0, scale=2.0 * np.sqrt(3.0 / 5.0))),
]


@pytest.mark.parametrize(("ours", "theirs"), PAIRS, ids=lambda value: type(value).__name__)
def test_distributions_against_scipy(ours: Distribution, theirs: stats.rv_continuous) -> None:
    """Quantiles at normal variates out to 6 sigma, and the standard deviation."""
    normal = np.linspace(-6.0, 6.0, 61)
    below = np.minimum(normal, 0.0)  # scipy's quantiles lose digits in the upper tail
    np.testing.assert_allclose(ours.transform(below), theirs.ppf(stats.norm.cdf(below)), rtol=1e-7, atol=1e-12)
    np.testing.assert_array_equal(ours.transform(normal), -ours.transform(-normal))
    assert ours.standard_deviation == pytest.approx(theirs.std(), rel=1e-6)


def test_nees_against_filterpy() -> None:
    run = campaign(1, 3.0)
    errors = run.errors.draw("random", 1, 400, 0, 400)
    outcomes = without_noise(run.scenario.engine("ensemble", errors[:64]))(errors).values
    linear = run.scenario.linear().end
    model = Model(linear.partials, linear.nominal, run.errors.mean, run.errors.covariance)
    found = compare(model, errors, outcomes, Criterion()).ellipsoid
    assert found is not None
    scale = 1.0 / np.sqrt(np.diag(model.outcome_covariance))
    scaled = model.outcome_covariance * np.outer(scale, scale)
    # filterpy inverts the covariance as it is; in units of sigma that costs few digits
    expected = NEES(outcomes * scale, np.zeros_like(outcomes), [scaled] * len(outcomes))
    np.testing.assert_allclose(found.values, expected, rtol=1e-8)
    assert found.nees.value == pytest.approx(np.mean(expected), rel=1e-8)


def test_covariance_against_openturns() -> None:
    """OpenTURNS' Taylor expansion of a linear function is P S P^T."""
    run = campaign(4, correlations=[{"between": ["altitude", "altitude_rate"], "coefficient": -0.6}])
    scenario = reentry(4)
    present = np.flatnonzero(run.errors.standard_deviations)
    sigma = run.errors.standard_deviations[present]
    partials = scenario.linear().end.partials[:, present] * sigma  # OpenTURNS wants a correlation of order one
    correlation = run.errors.covariance[np.ix_(present, present)] / np.outer(sigma, sigma)
    function = ot.LinearFunction([0.0] * len(sigma), [0.0] * 4, ot.Matrix(partials.tolist()))
    distribution = ot.Normal([0.0] * len(sigma), [1.0] * len(sigma), ot.CorrelationMatrix(correlation.tolist()))
    expansion = ot.TaylorExpansionMoments(ot.CompositeRandomVector(function, ot.RandomVector(distribution)))
    expected = np.array(expansion.getCovariance())
    ours = propagated_covariance(scenario.linear().end.partials, run.errors.covariance)
    np.testing.assert_allclose(ours, expected, rtol=1e-9)


def test_unscented_transform_is_exact_for_a_quadratic() -> None:
    """Mean of y = x + a x^2 in several normal dimensions: a sigma^2 each; sigma points of order two give it exactly."""
    sigma = np.array([2.0, 0.5, 0.0])
    correlation = 0.3
    covariance = np.diag(sigma**2)
    covariance[0, 1] = covariance[1, 0] = correlation * sigma[0] * sigma[1]

    def propagate(errors: np.ndarray) -> SimulationResult:
        return SimulationResult(
            np.column_stack([errors[:, 0] + 0.1 * errors[:, 0] ** 2, errors[:, 1] - errors[:, 0] * 0.5])
        )

    mean, found = unscented_covariance(propagate, np.zeros(3), covariance)
    np.testing.assert_allclose(mean, [0.1 * 4.0, 0.0], atol=1e-12)
    assert found[1, 1] == pytest.approx(0.25 + 0.25 * 4.0 - correlation * 2.0 * 0.5, rel=1e-12)


def test_unscented_transform_without_dispersion() -> None:
    """The outcome of the mean, and no covariance."""
    mean, found = unscented_covariance(
        lambda errors: SimulationResult(np.exp(errors)), np.array([0.0, 1.0]), np.zeros((2, 2))
    )
    np.testing.assert_array_equal(mean, np.exp([0.0, 1.0]))
    np.testing.assert_array_equal(found, np.zeros((2, 2)))


def test_unscented_transform_is_filterpys() -> None:
    """Bit for bit, with the modules as the package has them: for independent unit sigmas no factor intervenes."""
    points = MerweScaledSigmaPoints(2, alpha=1.0, beta=2.0, kappa=0.0)
    sigmas = points.sigma_points(np.zeros(2), np.eye(2))
    expected = unscented_transform(np.exp(sigmas), points.Wm, points.Wc)
    mean, found = unscented_covariance(lambda errors: SimulationResult(np.exp(errors)), np.zeros(2), np.eye(2))
    np.testing.assert_array_equal(mean, expected[0])
    np.testing.assert_array_equal(found, expected[1])


@pytest.mark.parametrize("dimensions", [1, 2, 24, 50])
@pytest.mark.parametrize(("begin", "end"), [(0, 1), (0, 512), (5, 9), (1_000, 1_023), (8_192, 16_384)])
def test_sobol_nets_are_scipys(dimensions: int, begin: int, end: int) -> None:
    net = stats.qmc.Sobol(dimensions, rng=np.random.default_rng(84))
    if begin:
        net.fast_forward(begin)
    expected = net.random(1 << (end - begin - 1).bit_length())[: end - begin]
    np.testing.assert_array_equal(scrambled_net(np.random.default_rng(84), dimensions, begin, end), expected)


def test_sobol_indices_are_scipys() -> None:
    """To rounding, 1e-12: the same nets of 64 bits and estimators, by `scipy.stats.sobol_indices`."""

    def bent(errors: np.ndarray) -> np.ndarray:
        a, b, c = errors[:, :3].T
        return np.column_stack([a + a * b, b - c**2, np.ones_like(a)])

    errors = ErrorModel(["a", "b", "c"], {"a": Normal(1.0), "b": Uniform(0.5), "c": Normal(2.0)})
    found = estimate_sobol_indices(lambda rows: SimulationResult(bent(rows)), errors, 5)
    laws = [stats.norm(), stats.uniform(-0.5, 1.0), stats.norm(scale=2.0)]
    one = [
        stats.sobol_indices(
            func=lambda rows: bent(rows.T).T, n=POINTS, dists=laws,
            rng=np.random.default_rng(np.random.SeedSequence(5, spawn_key=(replicate,))),
        )
        for replicate in range(REPLICATES)
    ]  # fmt: skip
    first, total = (
        np.mean([getattr(found, order) for found in one], axis=0) for order in ("first_order", "total_order")
    )
    np.testing.assert_allclose(found.first_order, first, atol=1e-12)
    np.testing.assert_allclose(found.total, total, atol=1e-12)


def test_standard_error_of_independent_blocks_is_the_textbooks() -> None:
    values = np.random.default_rng(3).standard_normal(50) ** 2
    found = blocked_mean(values, np.arange(50))
    _, high = stats.t.interval(0.95, 49, loc=values.mean(), scale=stats.sem(values))
    assert found.value + found.half_width(0.95) == pytest.approx(high, rel=1e-12)


def test_interval_of_skewed_blocks_is_halls_where_that_is_wider() -> None:
    """Hall's ends by root-finding on his transformation, with scipy's skewness; Student's on the other side."""
    values = np.random.default_rng(3).standard_normal(50) ** 2
    found = blocked_mean(values, np.arange(50))
    low, _ = stats.t.interval(0.95, 49, loc=values.mean(), scale=stats.sem(values))
    asymmetry = stats.skew(values) / np.sqrt(50.0)

    def transformed(studentised: float) -> float:
        a = asymmetry
        return studentised + a * studentised**2 / 3.0 + a**2 * studentised**3 / 27.0 + a / 6.0

    quantile = stats.t.ppf(0.975, 49)
    farthest = optimize.brentq(lambda studentised: transformed(studentised) + quantile, -50.0, 0.0, xtol=1e-14)
    expected = values.mean() - farthest * stats.sem(values)
    assert found.interval(0.95) == pytest.approx((low, expected), rel=1e-12)


def test_a_rare_event_against_openturns() -> None:
    """OpenTURNS samples about the design point: 2,561 flights have a standard error of 5 %.

    The difference is within four of both standard errors. Ours has the narrower interval: its flights are cheap, and
    most of them look for other ways to fail.
    """
    event = curved(10, 0.02, 5.0)
    ot.RandomGenerator.SetSeed(43)
    squares = " + ".join(f"x{i}^2" for i in range(10))
    outputs = ot.SymbolicFunction([f"x{i}" for i in range(10)], [f"x0 + 0.02 * ({squares} - 10)"])
    beyond = ot.ThresholdEvent(ot.CompositeRandomVector(outputs, ot.RandomVector(ot.Normal(10))), ot.Greater(), 5.0)
    search = ot.AbdoRackwitz()
    search.setStartingPoint([0.0] * 10)
    form = ot.FORM(search, beyond)
    form.run()
    sampling = ot.PostAnalyticalImportanceSampling(form.getResult())
    sampling.setMaximumOuterSampling(2_561)
    sampling.setMaximumCoefficientOfVariation(0.0)
    sampling.run()
    other, ours = sampling.getResult(), event.estimate(seed=43)
    error = np.hypot(np.sqrt(other.getVarianceEstimate()), (ours.high - ours.low) / 4.0)
    assert abs(ours.estimate - other.getProbabilityEstimate()) < 4.0 * error
    assert ours.high - ours.low < np.sqrt(other.getVarianceEstimate())
