"""Tunings of one timeline in one pass, against each by itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mcnav.contract.timeline import Timeline
from mcnav.linear.engine.design import design
from mcnav.linear.engine.propagate import propagate
from mcnav.linear.engine.tunings import TOGETHER, propagate_tunings
from tests.timelines import arbitrary

POSITIONS = np.array([0, 3, 4, 256, 299, 300])

ROUNDING = 1e-10
"""Share of the largest entry, as for all arbitrary systems of 300 transitions."""


def tuned(timeline: Timeline, number: int) -> Timeline:
    """Return another tuning: of all sizes, and of the filter's covariance, noise and measurements."""
    factors = 1.0 + np.random.default_rng(number).uniform(size=6)
    updates, filtered = timeline.updates, timeline.filter
    variances = {name: factors[0] * variances for name, variances in updates.variances.items()}
    return replace(
        timeline, sizes={"one": factors[1], "other": 0.0}, updates=replace(updates, variances=variances),
        filter=replace(
            filtered, covariance=factors[3] * filtered.covariance, variances=factors[4] * filtered.variances,
            sizes={"all": factors[5]},
        ),
    )  # fmt: skip


@pytest.fixture(scope="module")
def base() -> Timeline:
    """A system whose filter does not correct one of its states."""
    timeline = arbitrary(1, 300)
    return replace(timeline, filter=replace(timeline.filter, corrected=np.array([1.0, 1.0, 0.0])))


def test_a_tuning_is_what_gains_and_propagation_by_themselves_say(base):
    timelines = [base, *(tuned(base, number) for number in range(3))]
    answers = propagate_tunings(timelines, POSITIONS, np.array([False, True]))
    for timeline, answer in zip(timelines, answers, strict=True):
        own = design(timeline, POSITIONS)
        alone = propagate(timeline, own.gains, POSITIONS, by_cause=False, maps=lambda _: np.eye(6))
        for computed, expected in (
            (answer.partials, alone.partials[:, :, 1:]),
            (answer.covariances, alone.covariances[:, 0]),
            (answer.own, own.covariances),
        ):
            atol = ROUNDING * np.abs(expected).max(axis=(1, 2), keepdims=True)
            assert (np.abs(computed - expected) <= atol).all()


def test_a_tuning_has_the_same_bits_in_any_company(base):
    timelines = [tuned(base, number) for number in range(TOGETHER + 3)]
    together = propagate_tunings(timelines, POSITIONS, np.ones(2, dtype=bool))
    for number in (0, TOGETHER - 1, TOGETHER, TOGETHER + 2):
        (alone,) = propagate_tunings([timelines[number]], POSITIONS, np.ones(2, dtype=bool))
        for name in ("partials", "covariances", "own"):
            assert np.array_equal(getattr(alone, name), getattr(together[number], name))


def test_a_tuning_without_a_definite_innovation_is_no_number_and_leaves_the_others(base):
    wrong = replace(base, filter=replace(base.filter, variances=-1e6 * base.filter.variances))
    answers = propagate_tunings([base, wrong], POSITIONS, np.ones(2, dtype=bool))
    assert np.isfinite(answers[0].covariances).all()
    assert np.isnan(answers[1].covariances).all()
