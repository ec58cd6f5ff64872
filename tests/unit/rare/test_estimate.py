"""Probabilities of rare events with known values."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import special, stats

from mcnav.rare.estimate import estimate_probability
from mcnav.rare.facets import linear_facets
from mcnav.rare.interval import ROOTS, tail_index, weights_interval
from mcnav.rare.laid import FEWEST, SCATTERED
from mcnav.rare.limits import Distance, Sides
from mcnav.rare.strata import STRATA, draw_members, strata_of
from mcnav.rare.weigh import WIDER
from tests.calibration.rare_events import (
    CURVED,
    NOISY,
    OVER_TIME,
    Coverage,
    RareEvent,
    both,
    circle,
    curved,
    first,
    jump_back,
    jump_of_another,
    jump_with_it,
    scattered,
    two_sided,
    upper,
)

EXACT = {"d = 10, a = 0.02, c = 4": 9.6099392124e-5, "d = 10, a = 0.02, c = 5": 2.2795200765e-6,
         "d = 10, a = 0.05, c = 5": 1.8987948626e-5}  # fmt: skip


@pytest.mark.parametrize("event", CURVED, ids=lambda event: event.name)
def test_curved_limits_are_estimated_within_five_percent(event):
    assert event.exact == pytest.approx(EXACT[event.name], rel=1e-9, abs=0.0)
    rare = event.estimate(seed=1)
    assert rare.refusal == ""
    assert rare.flights < 50_000
    assert rare.estimate == pytest.approx(event.exact, rel=0.05, abs=0.0)


def test_intervals_hold():
    """At 94 % so few hold in 21 trials with a probability of 1e-4; the measured share is in RARE_EVENTS.md."""
    results = [Coverage.of(event, 7) for event in CURVED]
    assert all(result.refused == 0.0 for result in results)
    assert sum(7 * result.holds for result in results) >= stats.binom.ppf(1e-4, 21, 0.94)


def test_intervals_are_as_wide_as_the_largest_scatter_that_is_stated_needs():
    """Of 120 log-normal weights; 1,500 intervals, within three standard errors of 95 %, and worse without it."""
    weights = np.exp(np.sqrt(SCATTERED) * np.random.default_rng(1).standard_normal((1_500, FEWEST)) - 0.5 * SCATTERED)
    value, low, high = np.transpose([weights_interval(some, np.zeros(FEWEST, dtype=int), 0.95) for some in weights])
    wide = np.mean((value - WIDER * (value - low) <= 1.0) & (value + WIDER * (high - value) >= 1.0))
    assert wide == pytest.approx(0.95, abs=3.0 * np.sqrt(0.95 * 0.05 / 1_500))
    assert np.mean((low <= 1.0) & (high >= 1.0)) < 0.93


@pytest.mark.parametrize("index", [-0.3, 0.2, 0.5, 1.3])
def test_the_tail_index_of_weights(index):
    """Of generalised Pareto weights, by the largest 300 of 10,000: four standard errors, (1 + k) / sqrt(300)."""
    weights = stats.genpareto.rvs(index, size=10_000, random_state=np.random.default_rng(2))
    assert tail_index(weights) == pytest.approx(index, abs=4.0 * (1.0 + abs(index)) / np.sqrt(300.0))
    assert tail_index(weights[:20]) == np.inf


def quiet(outputs):
    """Return flights without noise."""
    return lambda points, noise: outputs(points)


@pytest.mark.parametrize("event", NOISY, ids=lambda event: event.name)
def test_noise_moves_the_entries_of_lines(event):
    """Intervals of 15 seeds, at 94 %: so few hold with a probability of 1e-4; refused are at most 2 % of the trials."""
    result = Coverage.of(event, 15)
    assert 15 * result.refused <= stats.binom.isf(1e-4, 15, 0.02)
    assert 15 * result.wrong <= stats.binom.isf(1e-4, 15, 0.06)
    assert result.most_flights < 1_700


def test_noise_beside_many_errors_is_no_reason_to_refuse():
    """Noise scatters the logarithms by 0.25; the fit of the pilot, of 52 lines for 40 coefficients, by up to 11.

    Half of the runs were refused; so few of ten are with a probability of 1 % then.
    """

    def outputs(points):
        return points[:, :1] * (1.0 + 0.02 * points[:, 20:])

    gains = np.linspace(-8.0, 8.0, 1_601)
    exact = 0.01 * float(2.0 * special.ndtr(-4.9 / np.abs(1.0 + 0.02 * gains)) @ stats.norm.pdf(gains))
    event = RareEvent("noise of the gain", outputs, first, both(4.9), 20, exact, hidden=1)
    refusals = [event.estimate(seed).refusal for seed in range(10)]
    assert refusals.count("noise that the linear model does not see moves the limit too far") <= 1


@pytest.mark.parametrize("event", OVER_TIME, ids=lambda event: event.name)
def test_first_passages_of_noise_have_their_exact_probability(event):
    """As above, with six seeds; the probability is an integral over the density within the limits."""
    result = Coverage.of(event, 6)
    assert result.refused == 0.0
    assert 6 * result.wrong <= stats.binom.isf(1e-4, 6, 0.06)
    assert result.error < 0.15
    assert result.most_flights < (3_000 if event.hidden else 50_000)


def test_epochs_without_correlation_pass_as_if_alone():
    beyond = 2.0 * special.ndtr(-5.0)
    assert OVER_TIME[0].exact == pytest.approx(-np.expm1(24.0 * np.log1p(-beyond)), rel=1e-9, abs=0.0)


def test_members_of_strata_are_drawn_by_their_shares():
    """Of three strata, one of which has two members of 3 and 1 parts: counts within six standard errors."""
    shares, strata = np.array([0.15, 0.5, 0.05, 0.3]), np.array([2, 0, 2, 1])
    stratum = np.repeat([0, 1, 2], 4_000)
    drawn = draw_members(stratum, strata, shares, np.random.default_rng(1))
    np.testing.assert_array_equal(strata[drawn], stratum)
    assert np.count_nonzero(drawn == 0) == pytest.approx(3_000, abs=6.0 * np.sqrt(4_000 * 3.0 / 16.0))
    sums = np.bincount(strata_of(np.full(64, 1.0 / 64.0)), np.full(64, 1.0 / 64.0))
    np.testing.assert_allclose(sums, 1.0 / STRATA)


def test_shares_of_points_add_up_to_one():
    """At any point, over all half-spaces; on lines of each by the feet and by the projections alone."""
    facets = replace(linear_facets(OVER_TIME[2].linear, OVER_TIME[2].limit, 24), shared=True)
    points = 3.0 * np.random.default_rng(4).standard_normal((20, 24))
    each = [facets.shares(np.full(20, j), points) for j in range(len(facets.distances))]
    np.testing.assert_allclose(np.sum(each, axis=0), 1.0, rtol=1e-12)
    masses, _ = facets.expected_masses(points, 0.1)
    feet = points - (points @ facets.directions[0])[:, None] * facets.directions[0]
    at = np.maximum(facets.entries(np.zeros(20, dtype=int), feet) + 0.1, 0.0)
    shares = facets.shares(np.zeros(20, dtype=int), feet + at[:, None] * facets.directions[0])
    assert masses[0] == pytest.approx(np.mean(special.ndtr(-at) * shares), rel=1e-9, abs=0.0)


def test_noise_of_the_output_itself_has_its_exact_value():
    """As a sum over the noise by midpoints, for the integral of the event's definition."""
    h = np.arange(-20.0 + 5e-5, 14.0, 1e-4)
    tail = special.ndtr(-4.5 / np.abs(1.0 + 0.05 * h))
    assert scattered(0.05, 4.5).exact == pytest.approx(1e-4 * float(tail @ stats.norm.pdf(h)), rel=1e-6, abs=0.0)


def test_the_same_seed_gives_the_same_bits_and_another_one_others():
    event = CURVED[1]
    assert event.estimate(3).estimate == event.estimate(3).estimate != event.estimate(4).estimate


def test_the_linear_case_is_exact_but_for_the_tolerance_that_is_stated():
    rare = estimate_probability(quiet(first), first, Sides(np.array([-5.0]), np.array([5.0])), 20, seed=1)
    assert rare.estimate == pytest.approx(2.0 * special.ndtr(-5.0), rel=1e-5, abs=0.0)
    assert rare.low < rare.estimate < rare.high
    assert rare.high / rare.estimate - 1.0 == pytest.approx(WIDER * ROOTS, rel=1e-2)
    assert rare.sides == 2


@pytest.mark.parametrize("event", [two_sided(1), two_sided(5), jump_of_another(4)], ids=lambda e: e.name)
def test_what_the_linear_model_does_not_know_is_estimated(event):
    """Jumps in another direction, a second way to fail, and an unlikely side."""
    rare = event.estimate(seed=5)
    assert rare.refusal == ""
    assert rare.low <= event.exact <= rare.high


def test_both_sides_have_their_exact_value():
    assert two_sided(1).exact == pytest.approx(2.132768443e-6, rel=1e-9, abs=0.0)


def test_a_jump_with_a_corner_is_refused_in_words():
    rare = jump_with_it(4).estimate(seed=5)
    assert "where no failure is expected, by a jump or a gate" in rare.refusal
    assert np.isnan([rare.estimate, rare.low, rare.high]).all()


def test_a_jump_back_beyond_the_limit_is_seen_by_the_flights_beyond():
    """35 % of the tail does not fail: the interval is right, or it is refused, in all but 6 % of the trials.

    More than this in 15 trials has a probability of 1e-4.
    """
    assert Coverage.of(jump_back(10), 15).wrong <= stats.binom.isf(1e-4, 15, 0.06) / 15


def test_a_linear_model_that_points_the_wrong_way_is_corrected():
    rare = estimate_probability(quiet(lambda u: u[:, 3:4] + 0.01 * u[:, :1]), first, upper(5.0), 10, seed=2)
    assert rare.low <= special.ndtr(-5.0 / np.sqrt(1.0001)) <= rare.high


def test_an_output_that_never_reaches_its_limit_is_refused():
    rare = estimate_probability(quiet(lambda u: 4.5 * np.tanh(u[:, :1] / 4.5)), first, upper(5.0), 4, seed=1)
    assert rare.refusal == "no flight fails where the linear model expects it"


def test_a_flight_that_fails_is_refused():
    def fails(u):
        return np.where(u[:, :1] > 4.9, np.nan, u[:, :1])

    assert "flights failed" in estimate_probability(quiet(fails), first, upper(5.0), 4, seed=1).refusal


def test_the_outside_of_a_circle_and_of_a_sphere():
    event = circle(5.0, 4)
    rare = event.estimate(seed=1)
    assert rare.low <= event.exact <= rare.high
    rare = estimate_probability(quiet(lambda u: u), lambda u: u, Distance(5.0, 3), 3, seed=2)
    assert rare.low <= stats.chi2.sf(25.0, 3) <= rare.high


def test_a_heavy_tail_fails_by_one_cause_at_a_time():
    """Of two Student errors and a normal one the largest comes alone; the exact value is a convolution."""

    def student(z):
        return np.sign(z) * np.abs(stats.t.ppf(special.ndtr(-np.abs(z)), 5.0))

    def outputs(u):
        return (student(u[:, 0]) + student(u[:, 1]) + u[:, 2])[:, None]

    rare = estimate_probability(quiet(outputs), outputs, Sides(np.array([-30.0]), np.array([30.0])), 3, seed=1)
    assert rare.sides == 4
    assert rare.estimate == pytest.approx(1.6162382594e-6, rel=0.05, abs=0.0)


def test_curvature_is_left_to_the_fit_in_many_dimensions():
    event = curved(40, 0.01, 5.0)
    assert event.estimate(1).estimate == pytest.approx(event.exact, rel=0.05, abs=0.0)


def test_the_order_of_half_spaces_does_not_depend_on_rounding():
    """Both sides are equally far; which of them rounding puts nearer must not matter."""
    factors = 1.0 + 4e-16 * np.array([-1.0, 0.0, 1.0])
    limits = [Sides(np.array([-5.0]), np.array([5.0 * factor])) for factor in factors]
    first = [linear_facets(lambda u: u[:, :1] + 0.5 * u[:, 1:2], each, 2).directions[0] for each in limits]
    assert all(direction[0] > 0.0 for direction in first)
