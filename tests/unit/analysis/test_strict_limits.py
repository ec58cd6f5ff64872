"""``below`` is strict: a sample exactly at a limit, such as a saturated command, is not below it.

A normal variable limited to one has P(|y| = 1) = 0.3173, so that P(|y| < 1) = 0.6827: less than any requirement here
asks for, while P(|y| <= 1) = 1.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import stats

from mcnav.analysis.comparison import Criterion, compare
from mcnav.analysis.linear_answer import judge_linearly
from mcnav.analysis.model import Model
from mcnav.analysis.requirements import Finding, Requirement, RequirementResult, judge_requirement
from mcnav.analysis.requirements_over_time import ErrorHistories, judge_over_time
from mcnav.analysis.tail_curves import tail_curve
from mcnav.rare.limits import AnyEpoch, Distance, Sides
from mcnav.statistics.normal_box import normal_box_probability, probability_beyond_box
from mcnav.statistics.normal_size import NormalSize

COUNT = 2_000
SHARE = 0.682689492137  # of a standard normal within one
MODEL = Model(np.eye(3), np.zeros(3), np.zeros(3), np.eye(3))


def _clipped() -> np.ndarray:
    """Return saturated outputs, shape (n, 3), of which 31.7 % lie exactly at one; the other two are zero."""
    outcomes = np.zeros((COUNT, 3))
    outcomes[:, 0] = np.clip(stats.norm.ppf((np.arange(COUNT) + 0.5) / COUNT), -1.0, 1.0)
    return outcomes


def _judged(requirement: Requirement) -> RequirementResult:
    outcomes = _clipped()
    comparison = compare(MODEL, outcomes, outcomes, Criterion())
    return judge_requirement(requirement, MODEL, outcomes, np.arange(COUNT), comparison, 0.95)


REQUIREMENTS: dict[str, Any] = {
    "quantile": ("quantile", (0,), (1.0,), 0.95),
    "r95": ("r95", (0, 1), (1.0,), 0.95),
    "sphere": ("quantile", (0, 1, 2), (1.0,), 0.8),
    "box": ("box", (0, 1), (1.0, 1.0), 0.95),
}


@pytest.mark.parametrize("kind", REQUIREMENTS)
def test_samples_at_the_limit_are_not_below_it(kind: str) -> None:
    kind, outputs, limits, probability = REQUIREMENTS[kind]
    assert _judged(Requirement(kind, outputs, limits, probability)).finding == Finding.NOT_MET
    a_little_wider = tuple(np.nextafter(limit, 2.0) for limit in limits)
    assert _judged(Requirement(kind, outputs, a_little_wider, probability)).finding == Finding.MET


def test_the_samples_needed_count_those_at_the_limit_as_beyond() -> None:
    """Of 2,000 samples 68.3 % are below: with 68 % required, neither bound decides; no share beyond is none at all."""
    result = _judged(Requirement("quantile", (0,), (1.0,), 0.68))
    assert result.finding == Finding.UNDECIDED
    assert result.samples_needed is not None
    assert result.samples_needed > 10_000  # 0.3173 against 0.32


def test_over_time_as_well() -> None:
    errors = np.stack([0.5 * _clipped(), _clipped()], axis=1)
    histories = ErrorHistories(np.arange(2.0), errors, np.arange(COUNT), None, None, COUNT)
    required = Requirement("quantile", (0,), (1.0,), 0.95, "at 1 s", (0, 1))
    assert judge_over_time(required, histories, 0.95).finding == Finding.NOT_MET


def test_a_tail_curve_counts_them() -> None:
    curve = tail_curve(Requirement("quantile", (0,), (1.0,), 0.95), MODEL, None, _clipped(), np.arange(COUNT), 0.95)
    assert curve.beyond / curve.samples == pytest.approx(1.0 - SHARE, abs=1.0 / COUNT)


@pytest.mark.parametrize(
    ("limit", "at", "within"),
    [
        (Sides(np.array([-1.0]), np.array([1.0])), [1.0], [0.5]),
        (Sides(np.array([-1.0]), np.array([1.0])), [-1.0], [-0.5]),
        (Sides(np.array([-1.0, -2.0]), np.array([1.0, 2.0])), [0.0, 2.0], [0.0, 1.0]),
        (Distance(5.0, 2), [3.0, 4.0], [3.0, 3.0]),
        (AnyEpoch(Sides(np.array([-1.0]), np.array([1.0])), 2), [0.0, 1.0], [0.0, 0.5]),
    ],
)
def test_a_rare_event_includes_its_limit(
    limit: Sides | Distance | AnyEpoch, at: list[float], within: list[float]
) -> None:
    assert (limit.margin(np.array([at, within])) > 0.0).tolist() == [True, False]


def test_what_is_fixed_at_its_limit_does_not_meet_it() -> None:
    """Linear analysis knows the error exactly: it is the limit, and not below."""
    mean, covariance = np.array([1.0, 0.0, 0.0]), np.diag([0.0, 0.0, 0.0])
    for kind, outputs, limits, probability in REQUIREMENTS.values():
        (judged,) = judge_linearly([Requirement(kind, outputs, limits, probability)], mean, covariance, None)
        assert not judged.met
        wider = tuple(2.0 * limit for limit in limits)
        (judged,) = judge_linearly([Requirement(kind, outputs, wider, probability)], mean, covariance, None)
        assert judged.met


def test_probabilities_of_what_is_fixed() -> None:
    point, zero = np.array([3.0, 4.0, 0.0]), np.zeros((3, 3))
    law = NormalSize.of(point, zero)
    assert (law.probability(5.0), law.beyond(5.0)) == (0.0, 1.0)
    assert normal_box_probability(point, zero, np.array([3.0, 5.0, 1.0])) == 0.0
    assert probability_beyond_box(point, zero, np.array([3.0, 5.0, 1.0])) == 1.0
