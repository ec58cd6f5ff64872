"""Requirements at several epochs: judged on the largest quantile, with bounds that hold at the stated rate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from mcnav.analysis.accuracy_measures import requirement_measures
from mcnav.analysis.requirements import Finding, Requirement, requirements_from
from mcnav.analysis.requirements_over_time import ErrorHistories, judge_over_time, largest_linear_quantile
from mcnav.analysis.samples_needed import Counting, samples_needed
from mcnav.arrays.types import Array
from mcnav.contract.linear import CovarianceReadings
from mcnav.contract.quantities import Output
from mcnav.store.manifest import RequirementRecord

SIGMAS = np.array([1.0, 2.0, 3.0, 2.0])
"""Of each of three outputs at four epochs."""


def histories(samples: int = 2_000, seed: int = 1, sigmas: Array = SIGMAS) -> ErrorHistories:
    errors = np.random.default_rng(seed).standard_normal((samples, len(sigmas), 3)) * sigmas[:, None]
    covariance = sigmas[:, None, None] ** 2 * np.eye(3)
    times = np.arange(float(len(sigmas)))
    return ErrorHistories(times, errors, np.arange(samples), np.zeros((len(sigmas), 3)), covariance, 2_000)


@pytest.mark.parametrize(("limit", "finding"), [(6.6, Finding.MET), (5.88, Finding.UNDECIDED), (5.2, Finding.NOT_MET)])
def test_a_quantile_at_its_largest(limit: float, finding: Finding) -> None:
    """The largest is at epoch 2: 1.96 sigma of 3; 2,000 samples bound it to about ±5 %."""
    found = judge_over_time(Requirement("quantile", (1,), (limit,), 0.95, "always", (0, 1, 2, 3)), histories(), 0.95)
    assert found.finding == finding
    assert (found.time, found.samples) == (2.0, 2_000)
    assert found.interval[0] < found.estimate < found.interval[1]
    assert found.linear == pytest.approx(3.0 * stats.norm.ppf(0.975), rel=1e-12)
    assert found.linear_meets == (limit > found.linear)
    if finding == Finding.UNDECIDED:
        assert found.samples_needed is None  # more than have histories
        assert found.remark == "errors over time are stored of the first 2,000 samples alone; about 14,000 would decide"
    early = judge_over_time(Requirement("quantile", (1,), (limit,), 0.95, "early", (0, 1)), histories(), 0.95)
    assert early.finding == Finding.MET
    assert early.time == 1.0


@pytest.mark.parametrize(
    ("kind", "outputs", "probability", "linear"),
    [
        ("cep", (0, 2), 0.5, stats.chi(2).ppf(0.5)),
        ("r95", (0, 2), 0.95, stats.chi(2).ppf(0.95)),
        ("sep", (0, 1, 2), 0.5, stats.chi(3).ppf(0.5)),
    ],
)
def test_circles_and_spheres(kind: str, outputs: tuple[int, ...], probability: float, linear: float) -> None:
    """Radii of circular and spherical normal errors; 500 samples give them within 15 %: five errors of a median."""
    found = judge_over_time(Requirement(kind, outputs, (100.0,), probability, "", (1, 2)), histories(500), 0.95)
    assert found.finding == Finding.MET
    assert found.linear == pytest.approx(3.0 * linear, rel=1e-9)
    assert found.estimate == pytest.approx(3.0 * linear, rel=0.15)


def test_few_samples_can_ask_for_more() -> None:
    found = judge_over_time(Requirement("quantile", (0,), (6.6,), 0.95, "", (2,)), histories(40), 0.95)
    assert found.finding == Finding.UNDECIDED
    assert found.interval[1] == np.inf
    assert found.samples_needed is not None
    assert 40 < found.samples_needed <= 2_000


def test_the_samples_needed_decide_nine_times_in_ten() -> None:
    """With as many, 90 % of 300 sets or more are decided: three independent epochs of one size, 5 % of errors allowed.

    The bound is four binomial errors, and one-sided: probabilities that are added are more than that of any.
    """
    requirement, sets = Requirement("quantile", (0,), (2.2,), 0.95, "", (0, 1, 2)), 300
    first = judge_over_time(requirement, replace(histories(200, 7, np.ones(3)), most=10_000), 0.95)
    assert first.finding == Finding.UNDECIDED
    share = 2.0 * stats.norm.sf(2.2)
    needed, _ = samples_needed([share] * 3, [share] * 3, 0.05, (0.95, 0.98), Counting(200, 200, 10_000))
    assert needed is not None
    found = [judge_over_time(requirement, histories(needed, seed, np.ones(3)), 0.95).finding for seed in range(sets)]
    assert sum(finding == Finding.MET for finding in found) / sets >= 0.9 - 4.0 * np.sqrt(0.09 / sets)


def test_bounds_of_the_largest_quantile_hold() -> None:
    """Four epochs of one size, 400 sets: the upper bound fails in at most 5 %, so does the lower one."""
    requirement = Requirement("quantile", (0,), (1.0,), 0.9, "", (0, 1, 2, 3))
    true, sets = stats.norm.ppf(0.95), 400
    intervals = [judge_over_time(requirement, histories(200, seed, np.ones(4)), 0.95).interval for seed in range(sets)]
    most = stats.binom(sets, 0.05).ppf(0.999)
    assert sum(high < true for _, high in intervals) <= most
    assert sum(low > true for low, _ in intervals) <= most


def test_what_cannot_be_judged_has_a_remark() -> None:
    requirement = Requirement("quantile", (0,), (6.6,), 0.95, "", (2,))
    given = histories(500)
    lost = np.full_like(given.errors, np.nan)
    cases = {
        "this run has no histories of errors": None,
        "every sample failed": replace(given, errors=lost),
        "the design has too few independent replicates": replace(given, blocks=np.arange(500) // 100),
    }
    for words, case in cases.items():
        found = judge_over_time(requirement, case, 0.95)
        assert found.finding == Finding.UNDECIDED
        assert found.remark.startswith(words)
    beyond = judge_over_time(replace(requirement, epochs=(9,)), given, 0.95)
    assert beyond.remark == "this run has no histories of errors"


def test_failed_samples_count_against_it() -> None:
    """A tenth failed: the 95 % quantile has no upper bound."""
    given = histories(500)
    given.errors[:50] = np.nan
    found = judge_over_time(Requirement("quantile", (0,), (100.0,), 0.95, "", (0, 2)), given, 0.95)
    assert found.finding == Finding.UNDECIDED
    assert found.interval[1] == np.inf


def test_linear_quantile_with_a_mean_and_without_a_model() -> None:
    """The largest sigma need not be the largest error: at epoch 0 the mean is ten."""
    given = histories(10)
    assert given.mean is not None
    given.mean[0, 0] = 10.0
    assert largest_linear_quantile(given, (0,), (0, 1, 2, 3), 0.5) == pytest.approx(10.0, rel=1e-6)
    assert np.isnan(largest_linear_quantile(replace(given, mean=None), (0,), (0,), 0.5))


def test_epochs_come_from_the_manifest() -> None:
    entry = RequirementRecord(kind="sep", outputs=("a",), limits=(3.0,), probability=0.5, when="at 5 s", epochs=(1, 2))
    (found,) = requirements_from([entry], ["a"])
    assert (found.when, found.epochs) == ("at 5 s", (1, 2))


def test_a_size_over_time_has_its_exact_law() -> None:
    """|N| of three axes at its largest, by scipy's chi; the output's own linear variance says nothing of it."""
    given = histories(500)
    sized = np.concatenate([given.errors, np.linalg.norm(given.errors, axis=2, keepdims=True)], axis=2)
    assert given.covariance is not None
    covariance = np.zeros((len(SIGMAS), 4, 4))
    covariance[:, :3, :3] = given.covariance
    known = replace(given, errors=sized, mean=np.zeros((len(SIGMAS), 4)), covariance=covariance, sizes={3: (0, 1, 2)})
    found = judge_over_time(Requirement("quantile", (3,), (100.0,), 0.9973, "always", (0, 1, 2, 3)), known, 0.95)
    assert found.linear == pytest.approx(3.0 * stats.chi(3).ppf(0.9973), rel=1e-6)
    assert found.estimate == pytest.approx(found.linear, rel=0.2)


def test_sweeps_of_a_size_have_its_exact_law() -> None:
    """Rice's distribution, of a nominal of 3 and four axes of sigma 1: more axes than a radius has."""
    outputs = [Output(f"n_{axis}", "m/s", "m/s", of="control") for axis in range(4)]
    size = Output("n_size", "m/s", "m/s", of="control", size_of=tuple(output.name for output in outputs))
    requirement = Requirement("quantile", (4,), (9.0,), 0.99, "", ())
    (measure,) = requirement_measures([requirement], [*outputs, size])
    covariance = np.diag([1.0, 1.0, 1.0, 1.0, 0.0])
    readings = CovarianceReadings(np.zeros(1), np.array([[3.0, 0.0, 0.0, 0.0, 3.0]]), covariance[None], None)
    exact = np.sqrt(stats.ncx2(4, 9.0).ppf(0.99))
    assert replace(measure, readings=(0,)).value(readings) == pytest.approx(exact, rel=1e-6)
    assert np.isnan(measure.own_value(replace(readings, own=np.full((1, 5, 5), np.nan))))  # no filter states it
