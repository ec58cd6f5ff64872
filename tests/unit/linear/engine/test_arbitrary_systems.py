"""The linear engine on arbitrary systems, against one large linear map of all that drives them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mcnav.linear.engine.adjoint import adjoint
from mcnav.linear.engine.design import design
from mcnav.linear.engine.innovations import innovation_laws, positions_of
from mcnav.linear.engine.propagate import propagate
from mcnav.linear.engine.rejections import WhitenedFilter, rejected_errors
from mcnav.linear.engine.smoother import ends_of_lag, smooth
from mcnav.linear.engine.starts import start_times
from tests.timelines import OneMap, arbitrary, started_anywhere, without_updates

ROUNDING = 1e-10
"""Share of the largest entry; products of 300 transitions of which some are nearly singular."""


def close(computed, expected):
    """Compare tables by their largest entry."""
    np.testing.assert_allclose(computed, expected, rtol=0.0, atol=ROUNDING * max(np.abs(expected).max(), 1e-30))


@pytest.fixture(scope="module")
def system():
    """A system of 300 transitions, two blocks, whose filter believes something else than the truth."""
    timeline = arbitrary(1, 300)
    gains = design(timeline).gains
    return timeline, gains, OneMap.of(timeline, gains)


def test_partials_and_covariance_of_each_process(system):
    timeline, gains, whole = system
    positions = [300, 3, 0, 4, 256, 299]
    read = propagate(timeline, gains, positions)
    outputs = timeline.readout(0, 0.0)
    together = propagate(timeline, gains, positions, by_cause=False)
    for place, position in enumerate(positions):
        rows = outputs @ whole.states[position]
        close(read.partials[place], rows[:, :3])
        close(together.partials[place], rows[:, :3])
        close(together.covariances[place, 0], whole.covariance(rows))
        for number, name in enumerate(timeline.processes):
            close(read.covariances[place, number], whole.covariance(rows, name))


def test_a_bias_may_be_any_of_the_states(system):
    """All states of the one process that has a bias are kept, but in another order."""
    timeline, gains, whole = system
    noise = {"one": timeline.start.noise["one"]}
    updates = replace(timeline.updates, variances={"one": timeline.updates.variances["one"]})
    of = replace(
        timeline, start=replace(timeline.start, noise=noise), updates=updates, processes=("one",),
        biases={"one": np.array([0])}, sizes={"one": timeline.sizes["one"]},
    )  # fmt: skip
    read = propagate(of, gains, [7, 300])
    for covariance, position in zip(read.covariances[:, 0], (7, 300), strict=True):
        close(covariance, whole.covariance(timeline.readout(0, 0.0) @ whole.states[position], "one"))


def test_rows_at_every_position_are_products_of_the_transitions_behind_it(system):
    timeline, gains, _ = system
    outputs, end = timeline.readout(0, 0.0), 262
    rows, expected = adjoint(timeline, gains, end, outputs), outputs
    for position in range(end - 1, end - 12, -1):
        # six starts, an error of one state each, less what comes in without any
        starts = (replace(timeline.start, partials=np.eye(6)[:, half : half + 3]) for half in (0, 3))
        nothing = replace(timeline.start, partials=np.zeros((6, 3)))
        columns = [
            propagate(timeline, gains, [position + 1], begin=position, start=start, maps=lambda _: np.eye(6)).partials[
                0
            ]
            - propagate(
                timeline, gains, [position + 1], begin=position, start=nothing, maps=lambda _: np.eye(6)
            ).partials[0]
            for start in starts
        ]
        expected = expected @ np.concatenate(columns, axis=1)
        close(rows[position], expected)


@pytest.mark.parametrize("filtered", [False, True])
def test_starts_at_many_positions_are_systems_of_their_own(filtered):
    timeline = arbitrary(2, 290)
    timeline = started_anywhere(timeline if filtered else without_updates(timeline))
    positions, outputs = np.array([9, timeline.end, 0, 120, 121]), timeline.readout(0, 0.0)
    read = start_times(timeline, timeline.end, outputs, positions)
    for place, position in enumerate(positions.tolist()):
        start = timeline.begin(position)
        gains = design(timeline, (), position, start).gains if filtered else None
        rows = outputs @ OneMap.of(timeline, gains, position, start).states[-1]
        whole = OneMap.of(timeline, gains, position, start)
        close(read.partials[place], rows[:, :3])
        for number, name in enumerate(timeline.processes):
            close(read.covariances[place, number], whole.covariance(rows, name))


def test_innovations_and_the_errors_after_them(system):
    timeline, gains, whole = system
    updates = np.array([50, 0, 7])
    for u, law in zip(updates.tolist(), innovation_laws(timeline, gains, updates), strict=True):
        position = int(positions_of(timeline, np.array([u]))[0])
        errors = timeline.readout(0, 0.0) @ whole.states[position + 1]
        innovation = whole.innovations[u]
        both = np.concatenate([innovation, errors])
        assert law.size == len(innovation)
        close(law.partials, both[:, :3])
        close(law.noise, whole.covariance(both))


def conditional(rows, given):
    """Return the covariance of rows, given others, of independent standard normals."""
    cross = rows @ given.T
    return rows @ rows.T - cross @ np.linalg.solve(given @ given.T, cross.T)


@pytest.mark.parametrize("lag", [np.inf, 3.0])
def test_a_smoother_that_knows_the_truth_is_the_conditional_expectation(lag):
    timeline = arbitrary(3, 40, knows_truth=True)
    positions = np.arange(41)
    designed = design(timeline, positions)
    whole = OneMap.of(timeline, designed.gains)
    smoothed = smooth(timeline, designed, positions, lag)
    ends, before = ends_of_lag(timeline, positions, lag), timeline.updates_before
    random = whole.process != ""
    for position in positions.tolist():
        rows = whole.padded(whole.states[position])[:, random]
        seen = [whole.padded(whole.innovations[u])[:, random] for u in range(before[ends[position]])]
        expected = conditional(rows, np.concatenate(seen)) if seen else rows @ rows.T
        close(smoothed.claimed[position], expected)
        close(smoothed.covariances[position].sum(axis=0), expected)


def test_true_errors_of_a_smoother_that_knows_another_truth(system):
    timeline, _, whole = system
    positions, end = np.array([280, 256, 20, 281]), 300
    designed = design(timeline, positions)
    smoothed = smooth(timeline, designed, positions)
    for place, position in enumerate(positions.tolist()):
        information = np.zeros((3, len(whole.process)))
        for k in range(end - 1, position - 1, -1):
            if not timeline.is_update[k]:
                number = int(timeline.steps_before[k])
                information = timeline.filter.steps(number, number + 1).transitions[0].T @ information
                continue
            u = int(timeline.updates_before[k])
            m = int(timeline.updates.sizes[u])
            response, gain, root = timeline.filter.responses[u, :m], designed.gains[u, :, :m], designed.roots[u, :m, :m]
            weight = response.T @ np.linalg.inv(root @ root.T)
            information = weight @ whole.padded(whole.innovations[u]) + (np.eye(3) - gain @ response).T @ information
        rows = whole.padded(whole.states[position])[:3] - designed.covariances[place] @ information
        close(smoothed.partials[place], rows[:, :3])
        for number, name in enumerate(timeline.processes):
            close(smoothed.covariances[place, number], whole.covariance(rows, name))


def test_what_cannot_be_answered_is_refused(system):
    timeline, gains, _ = system
    considered = replace(timeline, filter=replace(timeline.filter, corrected=np.array([1.0, 0.0, 1.0])))
    with pytest.raises(ValueError, match="considered states"):
        smooth(considered, design(considered, [0]), [0])
    with pytest.raises(ValueError, match="cannot start later"):
        start_times(timeline, 300, timeline.readout(0, 0.0), np.array([0]))
    with pytest.raises(ValueError, match="gains: got none"):
        propagate(timeline, None, [300])
    with pytest.raises(ValueError, match="from 0 to 300"):
        propagate(timeline, gains, [301])
    with pytest.raises(ValueError, match=r"0\.5 s is not among the instants"):
        timeline.positions(np.array([0.5]))


@pytest.mark.parametrize("ever", [False, True])
def test_rejected_measurements_as_filters_have_them_that_leave_them_out(ever):
    """The covariance after one rejection, or after all from one on; the response is that of the whitened innovation."""
    timeline = arbitrary(7, 120, knows_truth=True)
    designed = design(timeline, [timeline.end])
    whitened = WhitenedFilter.of(timeline, designed)
    updates, size = timeline.updates, 6
    later = np.full(len(updates.sizes), ever)
    positions = np.array([60, 120])
    rejected = rejected_errors(whitened, positions, later)
    outputs = timeline.readout(0, 0.0)[:, :size]
    everything = design(timeline, positions)
    for first in (0, 5, int(timeline.updates_before[60]) - 1, len(updates.sizes) - 1):
        left_out = np.arange(len(later)) >= first if ever else np.arange(len(later)) == first
        blind = replace(timeline.filter, responses=np.where(left_out[:, None, None], 0.0, timeline.filter.responses))
        # a measurement of which the filter sees nothing changes nothing
        own = design(replace(timeline, filter=blind), positions)
        for reading, position in enumerate(positions.tolist()):
            if first >= timeline.updates_before[position]:
                continue
            excess = own.covariances[reading] - everything.covariances[reading]
            variances = np.diag(outputs @ own.covariances[reading] @ outputs.T)
            expected = np.diag(outputs @ excess @ outputs.T)
            np.testing.assert_allclose(
                rejected.excess[reading, first], expected, rtol=0.0, atol=ROUNDING * variances.max()
            )
            m = int(updates.sizes[first])
            response = own_response(timeline, own.gains, first, position) @ designed.gains[first, :, :m]
            close(rejected.responses[reading, first, :, :m], outputs @ response @ designed.roots[first, :m, :m])


def own_response(timeline, gains, first, position):
    """Return the response of a filter's states at a position to those after an update, with gains of its own."""
    begin = int(positions_of(timeline, np.array([first]))[0]) + 1
    return adjoint(timeline, gains, position, np.eye(6))[begin]
