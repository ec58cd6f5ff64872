"""What the linear engine is given: an empty question has an empty answer, and a mistake is said in one line."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from mcnav.contract.timeline import Start, Steps, Updates
from mcnav.linear.engine.adjoint import adjoint
from mcnav.linear.engine.design import design
from mcnav.linear.engine.innovations import innovation_laws, measurement_errors
from mcnav.linear.engine.propagate import propagate
from mcnav.linear.engine.rejections import WhitenedFilter, next_correlations, rejected_errors
from mcnav.linear.engine.smoother import smooth
from mcnav.linear.engine.starts import start_times
from tests.timelines import arbitrary, constant_velocity, started_anywhere, timeline_of, without_updates

FLOWN = arbitrary(3, 40, knows_truth=True)
BARE = without_updates(FLOWN)
GAINS = design(FLOWN).gains
CONSIDERED = replace(FLOWN, filter=replace(FLOWN.filter, corrected=np.array([1.0, 1.0, 1.0, 1.0, 0.0, 1.0])))
OUTPUTS, NONE = np.eye(2, 6), np.zeros(0, dtype=np.int64)
UNMEASURED = replace(
    BARE, updates=Updates.none(6, 2),
    filter=replace(FLOWN.filter, responses=np.zeros((0, 0, 6)), variances=np.zeros((0, 0))),
)  # fmt: skip


def test_no_readings_no_starts_and_no_updates_are_empty_answers():
    for timeline, gains in ((FLOWN, GAINS), (BARE, None)):
        assert propagate(timeline, gains, []).partials.shape == (0, 2, 3)
        assert propagate(timeline, gains, []).covariances.shape == (0, 3, 2, 2)
        assert propagate(timeline, gains, [], by_cause=False).covariances.shape == (0, 1, 2, 2)
        starts = start_times(started_anywhere(timeline), timeline.end, OUTPUTS, NONE)
        assert starts.partials.shape == (0, 2, 3)
        assert starts.covariances.shape == (0, 3, 2, 2)
    assert smooth(FLOWN, design(FLOWN), []).claimed.shape == (0, 6, 6)
    assert innovation_laws(FLOWN, GAINS, NONE) == []
    of_innovations, of_outputs = measurement_errors(FLOWN, GAINS, np.zeros((len(GAINS), 2, 1)), NONE, 40)
    assert (of_innovations.shape, of_outputs.shape) == ((0, 2, 1), (2, 1))
    whitened = WhitenedFilter.of(FLOWN, design(FLOWN))
    assert rejected_errors(whitened, NONE, np.zeros(len(GAINS), dtype=bool)).excess.shape == (0, len(GAINS), 2)
    assert next_correlations(whitened, NONE, NONE).shape == (0, 2)


@pytest.mark.parametrize("updates", [UNMEASURED.updates, None])
def test_a_filter_without_measurements_keeps_its_own_propagation(updates):
    timeline = replace(UNMEASURED, updates=updates)
    end, own = timeline.end, timeline.filter.covariance
    for steps in [timeline.filter.steps(0, end)]:
        for transition, noise in zip(steps.transitions, steps.noise["all"].covariances, strict=True):
            own = transition @ own @ transition.T + noise
    designed = design(timeline, [0, end])
    np.testing.assert_allclose(designed.covariances[1], own, rtol=1e-12, atol=1e-12 * np.abs(own).max())
    np.testing.assert_allclose(smooth(timeline, designed, [0, end]).claimed, designed.covariances)


def test_a_timeline_without_transitions_is_its_start():
    start = Start(np.array([[2.0, 0.5]]))
    still = timeline_of(Steps(np.zeros((0, 1, 1)), np.zeros((0, 1, 2))), start, (), np.array([[3.0]]))
    np.testing.assert_array_equal(propagate(still, None, [0]).partials[0], [[6.0, 1.5]])


def test_a_singular_innovation_leaves_no_numbers_from_there_on():
    """Perfect fixes of a perfect start: S is zero at the first, whose gain nobody knows."""
    perfect = constant_velocity(4, 1.0, 0.0, 0.0, np.zeros((2, 2)))
    designed = design(perfect, [1, 8])
    assert np.array_equal(np.isnan(designed.covariances).all(axis=(1, 2)), [False, True])
    assert np.isnan(propagate(perfect, designed.gains, [8]).partials).all()
    assert np.isnan(smooth(perfect, designed, [1, 8]).claimed).all()
    whitened = WhitenedFilter.of(perfect, designed)
    assert np.isnan(rejected_errors(whitened, np.array([8]), np.zeros(4, dtype=bool)).excess).all()


@pytest.mark.parametrize(
    ("ask", "told"),
    [
        (lambda: propagate(FLOWN, GAINS, [-1]), "positions: got -1, expected whole numbers from 0 to 40"),
        (lambda: propagate(FLOWN, GAINS, [1.5]), "positions: got 1.5, expected whole numbers from 0 to 40"),
        (lambda: propagate(FLOWN, GAINS, [3], begin=5), "positions: got 3, expected whole numbers from 5 to 40"),
        (lambda: propagate(FLOWN, None, [40]), "gains: got none, expected those of the updates of the timeline"),
        (lambda: propagate(FLOWN, GAINS[:2], [3]), "gains: got shape (2, 6, 2), expected (17, 6, 2)"),
        (lambda: propagate(FLOWN, GAINS, [3], start=Start(np.zeros((5, 3)))), "start.partials: got shape (5, 3)"),
        (lambda: propagate(FLOWN, GAINS, [3], start=Start(np.zeros((6, 3)), {"one": np.eye(2)})), "noise of one: got"),
        (lambda: propagate(FLOWN, GAINS, [3], maps=lambda _: np.eye(4)), "outputs: got shape (4, 4), expected (out"),
        (lambda: design(FLOWN, [41]), "positions: got 41, expected whole numbers from 0 to 40"),
        (lambda: design(FLOWN, [2], begin=5), "positions: got 2, expected whole numbers from 5 to 40"),
        (lambda: design(FLOWN, gains=GAINS[:3]), "gains: got shape (3, 6, 2), expected (17, 6, 2)"),
        (lambda: design(BARE), "timeline: has no filter"),
        (lambda: adjoint(FLOWN, GAINS, 41, OUTPUTS), "positions: got 41, expected whole numbers from 0 to 40"),
        (lambda: adjoint(FLOWN, GAINS, 40, np.eye(3)), "outputs: got shape (3, 3), expected (outputs, 6)"),
        (lambda: start_times(started_anywhere(BARE), 3, OUTPUTS, [5]), "positions: got 5, expected whole numbers fr"),
        (lambda: start_times(started_anywhere(FLOWN), 30, OUTPUTS, [-1]), "positions: got -1, expected whole number"),
        (lambda: start_times(BARE, 3, OUTPUTS, [1]), "begin: got none, and the timeline has none; its navigator can"),
        (lambda: smooth(BARE, design(FLOWN, [1]), [1]), "timeline: has no filter"),
        (lambda: smooth(FLOWN, design(FLOWN, [1]), [2]), "designed: expected the filter's covariance at the position"),
        (lambda: smooth(FLOWN, design(FLOWN, [1]), [1], -5.0), "lag: got -5 s, expected none that is negative"),
        (lambda: smooth(CONSIDERED, design(CONSIDERED, [1]), [1]), "smoother: expected a filter without considered"),
        (lambda: WhitenedFilter.of(CONSIDERED, design(CONSIDERED)), "rejections: expected a filter without considered"),
        (lambda: innovation_laws(BARE, GAINS, NONE), "timeline: has no updates"),
        (lambda: innovation_laws(FLOWN, GAINS, np.array([17])), "updates: got 17; the timeline has 17, from 0 on"),
        (lambda: replace(FLOWN, start=Start(np.zeros((6, 7)))), "updates.disturbances: got shape (17, 2, 3), expected"),
        (lambda: Steps(np.zeros((2, 3, 4)), np.zeros((2, 3, 1))), "steps.transitions: got shape (2, 3, 4), expected"),
    ],
)  # fmt: skip
def test_each_mistake_is_one_line(ask, told):
    with pytest.raises(ValueError, match=re.escape(told)) as failed:
        ask()
    assert "\n" not in str(failed.value)
