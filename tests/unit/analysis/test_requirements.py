"""Requirements: judged as their definition says, on systems whose truth is known."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from mcnav.analysis.comparison import Criterion, compare
from mcnav.analysis.model import Model
from mcnav.analysis.requirements import (
    Finding,
    Requirement,
    RequirementResult,
    judge_requirement,
    requirements_from,
)
from mcnav.report.statements import verdicts
from mcnav.statistics.normal_box import normal_box_probability
from mcnav.statistics.normal_size import size_quantile
from mcnav.store.manifest import RequirementRecord
from tests import summaries

MODEL = Model(np.array([[1.0, 0.0], [0.0, 2.0]]), np.zeros(2), np.zeros(2), np.eye(2))
P9973 = 3.0 * 0.99999  # of a standard normal, absolute


def _judged(
    requirement: Requirement,
    count: int = 10_000,
    factor: float = 1.0,
    blocks: np.ndarray | None = None,
    failed: int = 0,
    model: Model = MODEL,
) -> RequirementResult:
    errors = np.random.default_rng(3).standard_normal((count, 2))
    outcomes = factor * errors @ model.partials.T
    outcomes[:failed] = np.nan
    at = np.arange(count) if blocks is None else blocks
    comparison = compare(model, errors, outcomes, Criterion())
    return judge_requirement(requirement, model, outcomes, at, comparison, 0.95)


@pytest.mark.parametrize(("limit", "finding"), [(3.5, Finding.MET), (3.0, Finding.UNDECIDED), (2.6, Finding.NOT_MET)])
def test_a_quantile(limit: float, finding: Finding) -> None:
    found = _judged(Requirement("quantile", (0,), (limit,), 0.9973))
    assert found.finding == finding
    assert found.interval[0] < found.estimate < found.interval[1]
    assert found.linear == pytest.approx(3.0, abs=1e-3)
    assert found.linear_meets == (limit > found.linear)
    assert (found.samples_needed is not None) == (finding == Finding.UNDECIDED)
    assert found.largest_sigmas is not None
    # sigma one of a single source: the limit over the bound of the samples, whatever linear analysis says
    assert found.largest_sigmas[0] == pytest.approx(limit / found.interval[1], rel=1e-6)
    assert found.largest_sigmas[1] == (np.inf if finding == Finding.MET else pytest.approx(np.nan, nan_ok=True))


def test_largest_sigmas_follow_samples_that_linear_analysis_misses() -> None:
    """Errors are 1.5 times the linear ones: what linear analysis allows is divided by that; nothing without a bound."""
    found = _judged(Requirement("quantile", (0,), (6.0,), 0.9973), factor=1.5)
    assert found.largest_sigmas is not None
    assert found.interval[1] > 1.45 * found.linear
    assert found.largest_sigmas[0] == pytest.approx(6.0 / found.interval[1], rel=1e-6)
    assert _judged(Requirement("quantile", (0,), (6.0,), 0.9973), count=500).largest_sigmas is None


def test_samples_needed_without_any_exceedance_are_wilks() -> None:
    found = _judged(Requirement("quantile", (0,), (10.0,), 0.9973), count=500)
    assert (found.finding, found.samples_needed) == (Finding.UNDECIDED, 1109)
    assert found.interval[1] == np.inf


@pytest.mark.parametrize(("factor", "pairs"), [(1.05, 1), (0.95, 1), (1.05, 2)])
def test_the_samples_needed_decide_nine_times_in_ten(factor: float, pairs: int) -> None:
    """Of 400 campaigns of the stated size, 90 % are decided if the true share is the estimated one.

    It is estimated from a campaign of 1,000 whose share is the true one; the bound is four binomial errors.
    """
    limit, count, sets = factor * stats.norm.ppf(0.975), 1_000, 400
    true = 2.0 * stats.norm.sf(limit)
    sizes = np.abs(stats.norm.ppf((np.arange(count) + 0.5) / count))
    requirement, model = (
        Requirement("quantile", (0,), (limit,), 0.95),
        Model(*(np.eye(1), *2 * [np.zeros(1)], np.eye(1))),
    )
    assert np.mean(sizes > limit) == pytest.approx(true, abs=1.0 / count)
    blocks, shown = np.arange(pairs * count) // pairs, np.repeat(sizes, pairs)[:, None]
    comparison = compare(model, shown, shown, Criterion())
    first = judge_requirement(requirement, model, shown, blocks, comparison, 0.95)
    assert first.finding == Finding.UNDECIDED
    assert first.samples_needed is not None
    independent = first.samples_needed // pairs
    draws = np.random.default_rng(12).standard_normal((sets, independent))
    at = np.arange(independent)
    findings = [judge_requirement(requirement, model, each[:, None], at, comparison, 0.95).finding for each in draws]
    decided = sum(finding != Finding.UNDECIDED for finding in findings) / sets
    assert abs(decided - 0.9) <= 4.0 * np.sqrt(0.9 * 0.1 / sets)
    assert independent > 2 * count


def test_at_the_limit_the_number_is_called_rough_or_none() -> None:
    """A share within its standard error of the allowed one promises little; one that equals it nothing."""
    sizes = np.repeat([0.0, 2.0], [9_500, 500])[:, None]
    model = Model(np.eye(1), np.zeros(1), np.zeros(1), np.eye(1))
    comparison = compare(model, sizes, sizes, Criterion())

    def judged(beyond: int) -> RequirementResult:
        outcomes = np.repeat([0.0, 2.0], [10_000 - beyond, beyond])[:, None]
        requirement = Requirement("quantile", (0,), (1.0,), 0.95)
        return judge_requirement(requirement, model, outcomes, np.arange(10_000), comparison, 0.95)

    assert judged(500).samples_needed is None
    assert "5 % of the samples lie beyond the limit and 5 % may: so close" in judged(500).remark
    rough = judged(490)
    assert rough.samples_needed is not None
    assert rough.samples_needed > 100_000
    assert rough.remark.startswith("a rough number: 4.9 % of the samples lie beyond the limit and 5 % may")
    assert judged(470).remark == ""


def test_a_summary_says_that_more_samples_do_not_help() -> None:
    """Of a run that stores a summary, the first 1,000 samples alone are counted."""
    requirement = Requirement("quantile", (0,), (3.0,), 0.9973)
    errors = np.random.default_rng(3).standard_normal((1_000, 2))
    outcomes = errors @ MODEL.partials.T
    comparison = compare(MODEL, errors, outcomes, Criterion())
    found = judge_requirement(requirement, MODEL, outcomes, np.arange(1_000), comparison, 0.95, most=1_000)
    assert (found.finding, found.samples_needed) == (Finding.UNDECIDED, None)
    assert found.remark.startswith("a run that stores a summary has 1,000 samples to count, however many it simulates")


def test_failed_samples_that_decide_are_named() -> None:
    """4.9 % lie beyond the limit and 5 % may; with the failed ones it is more: no number of samples changes that."""
    outcomes = np.repeat([0.0, 2.0, np.nan], [9_460, 490, 50])[:, None]
    model = Model(np.eye(1), np.zeros(1), np.zeros(1), np.eye(1))
    comparison = compare(model, outcomes, outcomes, Criterion())
    for requirement in (Requirement("quantile", (0,), (1.0,), 0.95), Requirement("box", (0,), (1.0,), 0.95)):
        found = judge_requirement(requirement, model, outcomes, np.arange(10_000), comparison, 0.95)
        assert (found.finding, found.samples_needed) == (Finding.UNDECIDED, None)
        assert found.remark.startswith("failed samples decide it")


@pytest.mark.parametrize(("limit", "finding"), [(2.0, Finding.MET), (1.0, Finding.NOT_MET)])
def test_circular_error_probable(limit: float, finding: Finding) -> None:
    found = _judged(Requirement("cep", (0, 1), (limit,), 0.5))
    assert found.finding == finding
    assert found.interval[0] < found.linear < found.interval[1]


@pytest.mark.parametrize(
    ("probability", "finding"), [(0.94, Finding.NOT_MET), (0.88, Finding.MET), (0.911, Finding.UNDECIDED)]
)
def test_a_box(probability: float, finding: Finding) -> None:
    truth = stats.norm.cdf(2.0) - stats.norm.cdf(-2.0)
    found = _judged(Requirement("box", (0, 1), (2.0, 4.0), probability))
    assert found.linear == pytest.approx(truth**2, abs=1e-6)
    assert found.finding == finding
    assert found.interval[0] < truth**2 < found.interval[1]
    assert found.linear_meets == (truth**2 > probability)


@pytest.mark.parametrize(
    ("factor", "finding"), [(1.0, Finding.MET), (1.051, Finding.UNDECIDED), (1.2, Finding.NOT_MET)]
)
def test_sigma_ratios(factor: float, finding: Finding) -> None:
    found = _judged(Requirement("sigma_ratio", (0, 1), (0.05,), None), factor=factor, count=500)
    assert found.finding == finding
    assert found.interval[0] <= found.estimate <= found.interval[1]


def test_failed_samples_never_help() -> None:
    """Thirty failures of 10,000 are more than P99.73 can bear; they do not prove that it is missed either."""
    found = _judged(Requirement("quantile", (0,), (3.5,), 0.9973), failed=30)
    assert found.finding == Finding.UNDECIDED
    assert found.interval[1] > 3.5
    boxed = _judged(Requirement("box", (0,), (5.0,), 0.9973), failed=30)
    assert boxed.finding == Finding.UNDECIDED
    ratios = _judged(Requirement("sigma_ratio", (0, 1), (0.05,), None), failed=30)
    assert (ratios.finding, ratios.remark) == (Finding.UNDECIDED, "too many samples failed")
    none = _judged(Requirement("quantile", (0,), (3.5,), 0.9973), failed=10_000)
    assert none.finding == Finding.UNDECIDED


def test_pairs_give_one_draw_each_and_nets_none() -> None:
    requirement = Requirement("quantile", (0,), (3.5,), 0.9973)
    whole, half = _judged(requirement), _judged(requirement, blocks=np.arange(10_000) // 2)
    assert half.finding == Finding.MET
    assert half.interval != whole.interval
    nets = _judged(requirement, blocks=np.arange(10_000) // 625)
    assert nets.finding == Finding.UNDECIDED
    assert "independent" in nets.remark
    assert nets.interval == (0.0, np.inf)


def test_nothing_to_compare() -> None:
    model = Model(np.zeros((2, 2)), np.array([0.5, 0.0]), np.zeros(2), np.zeros((2, 2)))
    outcomes = np.tile(model.nominal, (2000, 1))
    at = np.arange(2000)
    comparison = compare(model, np.zeros((2000, 2)), outcomes, Criterion())
    found = [
        judge_requirement(requirement, model, outcomes, at, comparison, 0.95).finding
        for requirement in (
            Requirement("sigma_ratio", (0, 1), (0.05,), None),
            Requirement("quantile", (0,), (0.6,), 0.99),
            Requirement("quantile", (0,), (0.4,), 0.99),
            Requirement("cep", (0, 1), (0.6,), 0.5),
            Requirement("box", (0, 1), (0.6, 0.1), 0.99),
        )
    ]
    assert found == [Finding.UNDECIDED, Finding.MET, Finding.NOT_MET, Finding.MET, Finding.MET]


def test_quantile_of_an_absolute_value() -> None:
    for mean, sigma in ((0.0, 1.0), (2.0, 0.5), (-1.0, 3.0)):
        expected = stats.foldnorm(abs(mean) / sigma, scale=sigma).ppf(0.97)
        assert size_quantile(np.array([mean]), np.array([[sigma**2]]), 0.97) == pytest.approx(expected, rel=1e-9)
    assert size_quantile(np.array([-2.0]), np.zeros((1, 1)), 0.9) == 2.0


def test_largest_sigmas_about_a_mean() -> None:
    """A fixed error of half the limit leaves less room; one beyond it none."""
    requirement = Requirement("quantile", (0,), (1.0,), 0.9973)
    errors = 0.1 * np.random.default_rng(3).standard_normal((10_000, 2))
    for shift, has in ((0.5, True), (1.5, False)):
        model = Model(MODEL.partials, np.array([shift, 0.0]), np.zeros(2), 0.01 * np.eye(2))
        outcomes = model.nominal + errors @ model.partials.T
        comparison = compare(model, errors, outcomes, Criterion())
        found = judge_requirement(requirement, model, outcomes, np.arange(len(errors)), comparison, 0.95)
        assert (found.largest_sigmas is not None) == has
        if found.largest_sigmas is not None:
            variance = np.array([[found.largest_sigmas[0] ** 2]])
            allowed = found.linear / found.interval[1]
            assert size_quantile(np.array([0.5]), variance, 0.9973) == pytest.approx(allowed, rel=1e-6)


def test_box_of_a_singular_covariance() -> None:
    line = np.array([[1.0, 2.0], [2.0, 4.0]])
    assert normal_box_probability(np.zeros(2), line, np.array([1.0, 9.0])) == pytest.approx(0.682689, abs=1e-5)
    assert normal_box_probability(np.array([0.0, 3.0]), np.diag([1.0, 0.0]), np.array([1.0, 2.0])) == 0.0
    assert normal_box_probability(np.zeros(2), np.zeros((2, 2)), np.ones(2)) == 1.0


def test_requirements_by_name() -> None:
    entry = RequirementRecord(kind="cep", outputs=("b", "a"), limits=(3.0,), probability=0.5)
    assert requirements_from([entry], ["a", "b"]) == (Requirement("cep", (1, 0), (3.0,), 0.5),)


@pytest.mark.parametrize(
    ("findings", "sentence", "standing"),
    [
        ([], "", "agrees"),
        (["met", "met"], "Requirements: 2 of 2 met.", "agrees"),
        (["not met", "undecided"], "Requirements: 0 of 2 met, 1 not met, 1 undecided.", "partly"),
        (["met", "undecided"], "Requirements: 1 of 2 met, 1 undecided.", "partly"),
    ],
)
def test_requirements_have_a_say_beside_the_verdict(findings: list[str], sentence: str, standing: str) -> None:
    """The headline tells both, the worst first; it is green only when all is well."""
    keys = {
        "verdict_matrix": "agrees",
        "sigma_linear": [1.0, 1.0],
        "outputs": [{"name": "x", "unit": "m"}, {"name": "y", "unit": "m"}],
        "requirements": list(map(summaries.requirement, findings)),
    }
    agrees, differs = (
        summaries.summary(**keys, verdict=verdict, verdicts=[verdict, "agrees"]) for verdict in ("agrees", "differs")
    )
    yes, no = (
        "Every sigma is right, and so is the full covariance matrix.",
        "The linear sigma is wrong for x.",
    )
    worst_first = (sentence, yes)
    assert verdicts.headline(agrees) == " ".join(filter(None, worst_first))
    assert verdicts.standing(agrees) == standing
    assert verdicts.tone(agrees) == "agrees"
    assert verdicts.headline(differs) == " ".join(
        filter(None, (sentence, no) if "not met" in findings else (no, sentence))
    )
    assert verdicts.standing(differs) == "differs"
