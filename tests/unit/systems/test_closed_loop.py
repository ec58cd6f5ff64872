"""Closed loops: samples follow their linear system where errors are small, and are the same wherever they are."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mcnav.arrays.types import Array
from mcnav.config.campaign import Campaign
from mcnav.contract.samples import Batch, SimulationResult
from mcnav.systems.closed_loop.maps import Maps
from mcnav.systems.closed_loop.noise import Noise
from mcnav.systems.closed_loop.sizes import LoopSizes, Sizes
from tests.closed_loops import campaign

LOOPS = (
    "DoubleIntegrator", "Nominal", "Continuous", "Pendulum", "Corrected", "Rendezvous", "Descent", "Landing",
    "Satellite", "Kicked", "Braking", "Remembering", "Lander", "GuidedLander",
)  # fmt: skip


def scaled(sizes: Sizes, share: float) -> Sizes:
    return replace(
        sizes,
        start=share**2 * sizes.start,
        white=share * sizes.white,
        markov=share * sizes.markov,
        measurements=tuple(share * each for each in sizes.measurements),
        corrections=tuple(share * each for each in sizes.corrections),
    )


def simulated(described: Campaign, count: int, share: float = 1.0) -> tuple[SimulationResult, Array, Array]:
    """Samples with a share of all errors and noise, their linear outcomes, and the linear sigmas of the whole."""
    scenario: Any = described.scenario
    small = LoopSizes(scaled(scenario.sizes.true, share), scenario.sizes.believed)
    errors = share * described.errors.draw("random", 5, count, 0, count)
    engine = replace(scenario.engine("vectorised", errors), sizes=small)
    result = engine.simulate(Batch(np.arange(count), errors, 5))
    model = scenario.linear().end
    linear = result.linear_values
    if linear is None:
        linear = model.nominal + errors @ model.partials.T
    return result, linear, np.sqrt(np.diag(scenario.linear().covariance(described.errors.covariance)[0]))


@pytest.mark.parametrize("name", LOOPS)
def test_small_errors_follow_the_linear_system(name: str) -> None:
    """Departures are of second order: a hundredth of the errors departs by a tenth as much of sigma as a tenth."""
    described, departures = campaign(name), []
    for share in (0.1, 0.01):
        result, linear, sigma = simulated(described, 40, share)
        assert not result.failures
        size = np.where(sigma > 1e-9, sigma, np.inf)
        departures.append(np.abs(result.values - linear).max(axis=0) / (share * size))
    assert np.all(departures[0] < 0.5)
    assert np.all(departures[1] < 0.15 * departures[0] + 1e-7)


@pytest.mark.parametrize("name", LOOPS)
def test_a_sample_is_the_same_alone(name: str) -> None:
    described = campaign(name)
    errors = described.errors.draw("random", 5, 9, 0, 9)
    engine = described.scenario.engine("vectorised", errors)
    whole = Batch(np.arange(9), errors, 5)
    together, alone = engine.simulate(whole), engine.simulate(whole[np.array([6])])
    np.testing.assert_allclose(together.values[6], alone.values[0], atol=1e-12, rtol=1e-12)  # sums of a library
    assert np.array_equal(together.values, engine.simulate(whole).values)


@pytest.mark.parametrize("name", ["DoubleIntegrator", "Landing"])
def test_dispersions_follow_linear_analysis(name: str) -> None:
    """Sigmas of 1,000 samples: by chance, one in 10,000 departs by 3.9 standard errors.

    Of the landings one in fifty ends before the last command and the last update.
    """
    result, linear, sigma = simulated(campaign(name, samples=1_000), 1_000)
    moving = sigma > 1e-9
    ratios = linear.std(axis=0)[moving] / sigma[moving]
    assert np.all(np.abs(ratios - 1.0) < 3.9 / np.sqrt(2_000.0))
    assert np.all(np.abs(result.values.std(axis=0)[moving] / linear.std(axis=0)[moving] - 1.0) < 0.1)


def test_filter_of_each_sample_is_that_of_linear_analysis_where_errors_are_small() -> None:
    described = campaign("Pendulum")
    scenario: Any = described.scenario
    result, _, _ = simulated(described, 10, 1e-4)
    schema = scenario.filter_schema
    known = np.array(schema.known)
    assert schema.considered == ("drag",)
    assert result.filter_values is not None
    own = schema.covariance(result.filter_values)[:, :, known[:, None], known]
    stated = scenario.filter_prediction().covariance[:, known[:, None], known]
    np.testing.assert_allclose(own, np.broadcast_to(stated, own.shape), rtol=1e-4, atol=1e-12)


def test_nees_and_nis_of_a_matched_filter() -> None:
    """Means of 1,000 samples at the end: two degrees of freedom, and one; 3.9 standard errors."""
    described = campaign("DoubleIntegrator")
    scenario: Any = described.scenario
    result, _, _ = simulated(described, 1_000)
    places, records = scenario.filter_schema.places, result.filter_values
    assert records is not None
    assert records[:, -1, places["nees"]].mean() == pytest.approx(2.0, abs=3.9 * 2.0 / np.sqrt(1_000.0))
    nis, accepted, *_ = records[:, :, places["sensor:ranging"]].sum(axis=1).mean(axis=0)
    assert accepted == 200.0
    assert nis / accepted == pytest.approx(1.0, abs=3.9 * np.sqrt(2.0 / 200_000.0))


def test_events_lie_on_the_trigger() -> None:
    """A straight descent reaches the ground at h / vz; x is vx times it."""
    described = campaign("Descent")
    errors = described.errors.draw("random", 5, 50, 0, 50)
    outcome = described.scenario.engine("vectorised", errors).simulate(Batch(np.arange(50), errors, 5))
    of = {output.name: outcome.values[:, number] for number, output in enumerate(described.scenario.outputs)}
    started = {source.name: errors[:, number] for number, source in enumerate(described.scenario.sources)}
    falls = (1_000.0 + started["true_altitude"]) / (20.0 + started["true_vz"])
    np.testing.assert_allclose(of["final_time"], falls, rtol=1e-12)
    np.testing.assert_allclose(of["true_altitude"], 0.0, atol=1e-10)
    x = started["true_x"] + (60.0 + started["true_vx"]) * falls - 3_000.0
    np.testing.assert_allclose(of["true_x"], x, atol=1e-9)


def test_a_sample_that_meets_no_trigger_fails_with_that_reason() -> None:
    described = campaign("Descent")
    errors = np.zeros((2, len(described.scenario.sources)))
    errors[1, 3] = -19.0  # true_vz: one metre a second down
    result = described.scenario.engine("vectorised", errors).simulate(Batch(np.arange(2), errors, 5))
    assert {row: str(failure) for row, failure in result.failures.items()} == {1: "meets no trigger by 100 s"}
    assert np.isfinite(result.values[0]).all()


def test_corrections_by_trigger_happen_at_each_samples_own_instant() -> None:
    """The kick is commanded where 400 m are left; the rest is a straight line."""
    described = campaign("Kicked")
    errors = described.errors.draw("random", 5, 50, 0, 50)
    outcome = described.scenario.engine("vectorised", errors).simulate(Batch(np.arange(50), errors, 5), noise=False)
    of = {output.name: outcome.values[:, number] for number, output in enumerate(described.scenario.outputs)}
    started = {source.name: errors[:, number] for number, source in enumerate(described.scenario.sources)}
    down, along = 20.0 + started["true_vz"], 60.0 + started["true_vx"]
    np.testing.assert_allclose(of["kick_time"], (600.0 + started["true_altitude"]) / down, rtol=1e-12)
    np.testing.assert_allclose(of["kick"], 0.5 * (along + started["vx"]), rtol=1e-12)
    falls = (1_000.0 + started["true_altitude"]) / down
    x = started["true_x"] + along * falls + of["kick"] * 400.0 / down - (3_000.0 + 600.0)
    np.testing.assert_allclose(of["true_x"], x, atol=1e-9)


@pytest.mark.parametrize(
    ("name", "error", "told"),
    [("Kicked", -13.0, "kick: meets no trigger by 80 s"), ("Kicked", -10.5, "meets no trigger by 100 s")],
)
def test_a_sample_that_misses_an_event_says_which(name: str, error: float, told: str) -> None:
    """At 7 and at 9.5 metres a second: 440 m are left after 80 s, and 50 m after 100 s."""
    described = campaign(name)
    errors = np.zeros((2, len(described.scenario.sources)))
    errors[1, 3] = error  # true_vz
    result = described.scenario.engine("vectorised", errors).simulate(Batch(np.arange(2), errors, 5))
    assert {row: str(failure) for row, failure in result.failures.items()} == {1: told}
    assert np.isfinite(result.values[0]).all()
    assert np.isnan(result.values[1]).all()


def test_a_trigger_that_is_passed_at_the_start_happens_at_once() -> None:
    """Started at 390 m, the sample has passed the trigger: it is kicked at once."""
    described = campaign("Kicked")
    errors = np.zeros((1, len(described.scenario.sources)))
    errors[0, 1] = -610.0  # true_altitude
    result = described.scenario.engine("vectorised", errors).simulate(Batch(np.arange(1), errors, 5))
    names = [output.name for output in described.scenario.outputs]
    assert result.values[0, names.index("kick_time")] == 0.0
    assert result.values[0, names.index("kick")] == 30.0


def test_noise_is_drawn_by_sample_and_stream() -> None:
    whole, one = Noise(3, np.array([5, 8])), Noise(3, np.array([8]))
    first = [whole.draw(1, 300), whole.draw(1, 7)]
    one.draw(2, 11)  # another stream
    np.testing.assert_array_equal(np.concatenate(first)[:, 1], one.draw(1, 307)[:, 0])


@pytest.mark.parametrize("name", ["Pendulum", "Braking"])
def test_derivatives_of_truth_and_navigator_apart_are_those_of_both(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    described = campaign(name)
    scenario: Any = described.scenario
    assert scenario.maps.apart
    errors = described.errors.draw("random", 5, 20, 0, 20)

    def outcome() -> SimulationResult:
        result: SimulationResult = scenario.engine("vectorised", errors).simulate(Batch(np.arange(20), errors, 5))
        return result

    apart = outcome()
    monkeypatch.setattr(Maps, "apart", False)
    both = outcome()
    np.testing.assert_array_equal(apart.values, both.values)
    np.testing.assert_array_equal(apart.filter_values, both.filter_values)
