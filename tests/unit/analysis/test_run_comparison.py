"""Two runs beside each other: identities on common draws, coverage of the intervals."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from mcnav.analysis.decision_rule import ratio_interval, spread_of
from mcnav.analysis.model import Model
from mcnav.analysis.run_comparison import SampleSet, change
from mcnav.report.pages.comparison import inputs
from mcnav.sampler.designs import SamplingDesign
from mcnav.statistics.estimates import Estimate
from mcnav.store.run_folder import RunFolder
from mcnav.workflow.analyse import analyse
from mcnav.workflow.compare import compare_runs, same_draws
from mcnav.workflow.run import run_campaign
from tests.conftest import campaign

PARTIALS = np.array([[1.0, 0.5]])


def _flights(seed: int, count: int, curvature: float, sigma: float = 1.0, begin: int = 0) -> SampleSet:
    """y = x1 + x2 / 2 + c x1^2, whose variance is 1.25 sigma^2 + 2 c^2 sigma^4."""
    draws = np.random.default_rng(seed).standard_normal((begin + count, 2))[begin:] * sigma
    outputs = draws @ PARTIALS.T + curvature * draws[:, :1] ** 2
    index = np.arange(begin, begin + count)
    model = Model(PARTIALS, np.zeros(1), np.zeros(2), np.diag([sigma**2] * 2))
    return SampleSet(model, index, draws, outputs, SamplingDesign())


def _variance(curvature: float, sigma: float = 1.0) -> float:
    return 1.25 * sigma**2 + 2.0 * curvature**2 * sigma**4


def test_the_same_run_has_not_changed() -> None:
    found = change(_flights(1, 500, 0.2), _flights(1, 500, 0.2), (0, 0), True, 0.95)
    assert found.ratio == pytest.approx(1.0, abs=1e-14)
    assert found.interval == pytest.approx((1.0, 1.0), abs=1e-12)
    assert found.mean.value == pytest.approx(0.0, abs=1e-14)
    assert found.mean.standard_error == pytest.approx(0.0, abs=1e-14)


def test_a_linear_change_is_known_exactly() -> None:
    """Without curvature nothing is left to chance, common draws or not."""
    for common in (True, False):
        found = change(_flights(1, 500, 0.0), _flights(2, 300, 0.0, sigma=1.5), (0, 0), common, 0.95)
        assert found.ratio == pytest.approx(1.5, rel=1e-12)
        assert found.interval == pytest.approx((1.5, 1.5), rel=1e-9)
        assert found.certain


def test_too_few_claim_nothing() -> None:
    found = change(_flights(1, 50, 0.2), _flights(1, 50, 0.3), (0, 0), True, 0.95)
    assert found.interval[1] > 1e100
    assert not found.certain


def test_without_dispersion_there_is_no_ratio() -> None:
    found = change(_flights(1, 500, 0.0, sigma=0.0), _flights(1, 500, 0.0), (0, 0), True, 0.95)
    assert np.isnan(found.ratio)


def _noisy(seed: int, count: int, gain: float) -> SampleSet:
    """y = x1 + x2 / 2 + g w with a variance of 1.25 + g^2, and the linear outcome of the same draws."""
    generator = np.random.default_rng(seed)
    draws, noise = generator.standard_normal((count, 2)), gain * generator.standard_normal((count, 1))
    outputs = draws @ PARTIALS.T + noise
    model = Model(PARTIALS, np.zeros(1), np.zeros(2), np.eye(2), {"walk": np.array([[gain**2]])})
    return SampleSet(model, np.arange(count), draws, outputs, SamplingDesign(), outputs.copy())


def test_noise_is_in_the_linear_outcomes() -> None:
    """A linear system with noise is known exactly: variances 1.25 + 1 and 1.25 + 4."""
    for common in (True, False):
        found = change(_noisy(1, 500, 1.0), _noisy(2, 300, 2.0), (0, 0), common, 0.95)
        assert (found.before**2, found.after**2) == pytest.approx((2.25, 5.25), rel=1e-12)
        assert found.interval == pytest.approx((np.sqrt(5.25 / 2.25),) * 2, rel=1e-9)


@pytest.mark.parametrize(
    ("common", "begin", "count"), [(True, 0, 400), (True, 0, 250), (True, 200, 400), (False, 0, 400)], ids=str
)
def test_intervals_cover(common: bool, begin: int, count: int) -> None:
    """Of 300 pairs of runs, common, partly common and separate, those that a binomial law of 95 % allows (1e-5)."""
    truth, trials = np.sqrt(_variance(0.3) / _variance(0.2)), 300
    covered = 0
    for trial in range(trials):
        other = trial if common else trial + trials
        found = change(_flights(trial, 400, 0.2), _flights(other, count, 0.3, begin=begin), (0, 0), common, 0.95)
        covered += found.interval[0] <= truth <= found.interval[1]
    low, high = stats.binom.ppf([5e-6, 1 - 5e-6], trials, 0.95)
    assert low <= covered <= high


def test_common_draws_are_worth_something() -> None:
    """A small change of curvature shows on common draws, and drowns in separate ones."""
    together = change(_flights(1, 1000, 0.20), _flights(1, 1000, 0.24), (0, 0), True, 0.95)
    apart = change(_flights(1, 1000, 0.20), _flights(2, 1000, 0.24), (0, 0), False, 0.95)
    assert np.diff(together.interval)[0] < 0.5 * np.diff(apart.interval)[0]


@pytest.mark.slow
def test_runs_beside_each_other(tmp_path_factory: pytest.TempPathFactory) -> None:
    place = tmp_path_factory.mktemp("between")
    run_campaign(campaign(4, samples=300), place / "a", "ensemble", 1)
    run_campaign(campaign(4, multiple=1.5, samples=200), place / "b", "ensemble", 1)
    run_campaign(campaign(4, samples=300, seed=2), place / "c", "ensemble", 1)
    one, two, three = (analyse(RunFolder(place / name)) for name in "abc")
    assert same_draws(one, two)
    assert not same_draws(one, three)
    found = compare_runs([place / "a", place / "b", place / "c"])
    assert [(row.run, row.output) for row in found.rows[:4]] == [
        (1, "altitude"), (1, "range"), (1, "altitude_rate"), (1, "range_rate")
    ]  # fmt: skip
    assert [row.change.common for row in found.rows if row.change] == [True] * 4 + [False] * 4
    assert found.rows[0].change is not None
    assert found.rows[0].change.ratio == pytest.approx(1.5, rel=0.01)
    assert [row.words for row in found.rows[:4]] == ["larger"] * 4
    changed = inputs(found.manifests)
    assert list(changed.loc["samples"]) == ["300", "200", "300"]
    assert list(changed.loc["seed"]) == ["1772", "1772", "2"]
    assert sum(str(key).startswith("errors.") for key in changed.index) == 10
    assert found.page == compare_runs([place / "a", place / "b", place / "c"]).page
    assert found.page.count("<figure") > 1


def test_a_few_samples_have_no_interval() -> None:
    """An error that is not known is not one of e^700: the interval is unbounded, and nothing is certain."""
    rng = np.random.default_rng(5)
    errors = rng.standard_normal((2, 4, 1))
    model = Model(np.eye(1), np.zeros(1), np.zeros(1), np.eye(1))
    few = [SampleSet(model, np.arange(4), each, each + 0.1 * each**2, SamplingDesign()) for each in errors]
    for common in (True, False):
        result = change(few[0], few[1], (0, 0), common, 0.95)
        assert result.interval[1] == np.inf
        assert not result.certain


def test_an_interval_that_says_nothing_is_unbounded() -> None:
    """Three digits of a factor at most; beyond, an end would be a number of hundreds of digits."""
    assert spread_of(np.log(999.0)) == pytest.approx(999.0)
    assert spread_of(np.log(1001.0)) == np.inf
    estimate = Estimate(1e-8, 1.0, 99.0)
    ratio, (low, high) = ratio_interval(estimate, 1.0, 0.95)
    assert (low, high) == (0.0, np.inf)
    assert ratio == pytest.approx(1e-4)
