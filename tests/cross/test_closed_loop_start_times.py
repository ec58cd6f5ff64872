"""Start times of closed loops: recomputed covariances, closed forms, and samples of each start."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import stats

from mcnav.arrays.types import Array
from mcnav.config.campaign import Campaign
from mcnav.contract.samples import Batch
from mcnav.contract.scenario import ScenarioError
from mcnav.errors import CampaignError
from mcnav.studies.start_times import start_time_study, write_start_times
from mcnav.systems.closed_loop.scenario import ClosedLoopScenario
from tests.closed_loops import campaign

EXACT = 1e-9
"""Share of a sigma: differences of fourth order of linear maps, and some hundred steps."""

FALSE_ALARM = 1e-6
"""Probability with which one of the intervals of a test misses by chance."""


def loop(name: str, **changes: Any) -> tuple[Campaign, ClosedLoopScenario]:
    described = campaign(name, **changes)
    scenario = described.scenario
    assert isinstance(scenario, ClosedLoopScenario)
    return described, scenario


def covariance_at(described: Campaign, scenario: ClosedLoopScenario, time: float) -> Array:
    times = np.array([time])
    partials, noise = scenario.partials_at(times)[0], scenario.noise_at(times)[0]
    return np.asarray(partials @ described.errors.covariance @ partials.T + noise)


def recomputed(start: int, end: int = 200) -> Array:
    """Covariance of [position, velocity, true position, true velocity] of the double integrator, update by update.

    The truth falls freely until the start, with q = 0.01 m^2/s^3; then its navigator knows it to within 3 m and 0 m/s,
    measures to within 2 m and commands.
    """
    a, b = np.array([[1.0, 1.0], [0.0, 1.0]]), np.array([0.5, 1.0])
    w = 0.01 * np.array([[1.0 / 3.0, 0.5], [0.5, 1.0]])
    law = np.array([0.213023288, 0.652722433])
    truth = np.diag([100.0, 0.0])
    for _ in range(start):
        truth = a @ truth @ a.T + w
    filtered = np.diag([9.0, 0.0])
    both = np.block([[truth, truth], [truth, truth + filtered]])  # of [x, x_hat]
    h = np.array([1.0, 0.0])
    for second in range(start, end + 1):
        if second > start:
            fed = np.outer(b, law)
            step = np.block([[a, -fed], [np.zeros((2, 2)), a - fed]])
            both = step @ both @ step.T
            both[:2, :2] += w
            filtered = a @ filtered @ a.T + w
        if second > 0:  # the first measurement is after one interval
            gain = filtered @ h / (h @ filtered @ h + 4.0)
            update = np.eye(4)
            update[2:, :2], update[2:, 2:] = np.outer(gain, h), np.eye(2) - np.outer(gain, h)
            both = update @ both @ update.T
            both[2:, 2:] += 4.0 * np.outer(gain, gain)
            filtered = filtered - np.outer(gain, h @ filtered)
    read = np.block([[-np.eye(2), np.eye(2)], [np.eye(2), np.zeros((2, 2))]])
    return np.asarray(read @ both @ read.T)


@pytest.mark.parametrize("start", [0, 1, 60, 195, 199])
def test_covariance_of_a_start_is_that_recomputed_update_by_update(start: int) -> None:
    described, scenario = loop("DoubleIntegrator")
    expected, covariance = recomputed(start), covariance_at(described, scenario, float(start))[:4, :4]
    sigmas = np.sqrt(np.diag(expected))
    assert np.abs(covariance - expected).max() <= EXACT * np.outer(sigmas, sigmas).max()
    np.testing.assert_allclose(np.sqrt(np.diag(covariance)), sigmas, rtol=1e-7)


def test_a_navigator_that_starts_at_the_burn_misses_by_its_errors_since_then() -> None:
    """Clohessy and Wiltshire: P(end) = Phi P0 Phi^T + q times the integral of Phi Phi^T over the 900 s."""
    from campaigns.rendezvous import ARRIVAL, BURN, transition

    described, scenario = loop("Rendezvous")
    named = {source.name: number for number, source in enumerate(scenario.sources)}
    of = [named[f"{name}_{axis}"] for name in ("position", "velocity") for axis in "xyz"]
    start = described.errors.covariance[np.ix_(of, of)]
    nodes, weights = np.polynomial.legendre.leggauss(20)
    length = ARRIVAL - BURN
    ages = 0.5 * length * (nodes + 1.0)
    noise = sum(
        0.5 * length * weight * transition(age)[:3, 3:] @ transition(age)[:3, 3:].T
        for age, weight in zip(ages, weights, strict=True)
    )
    of_navigator = transition(length) @ start @ transition(length).T
    expected = (
        of_navigator[:3, :3] + 4.8e-10 * noise + 2.5e-7 * transition(length)[:3, 3:] @ transition(length)[:3, 3:].T
    )
    true = [number for number, output in enumerate(scenario.outputs) if output.name.startswith("true_position")]
    covariance = covariance_at(described, scenario, BURN)[np.ix_(true, true)]
    np.testing.assert_allclose(covariance, expected, rtol=1e-6, atol=1e-6 * np.diag(expected).max())


@pytest.mark.parametrize("name", ["Nominal", "Continuous", "Pendulum", "Braking", "Satellite"])
def test_a_start_with_the_flight_is_the_loop_itself(name: str) -> None:
    described, scenario = loop(name)
    end = scenario.linear().end
    whole = end.partials @ described.errors.covariance @ end.partials.T + sum(end.processes.values())
    covariance = covariance_at(described, scenario, 0.0)
    assert np.abs(covariance - whole).max() <= EXACT * np.abs(whole).max()


@pytest.mark.parametrize(("name", "time"), [("Pendulum", 9.0), ("OrbitCorrection", 900.0), ("Satellite", 270.0)])
def test_a_filter_that_starts_later_knows_its_errors(name: str, time: float) -> None:
    """What it begins with is believed of the flight until there; all beliefs are true, and so is what it ends with."""
    described, scenario = loop(name)
    started = scenario.started_at(time, "start")
    states, schema = started.judged, started.filter_schema
    assert states is not None
    assert schema is not None
    own = started.plan.instants[started.plan.end].covariance[: states.estimated, : states.estimated]
    known = np.array(schema.known)
    covariance = covariance_at(described, scenario, time)[np.ix_(known, known)]
    np.testing.assert_allclose(np.diag(own), np.diag(covariance), rtol=1e-5)


@pytest.mark.parametrize(
    ("name", "time"), [("Continuous", 29.5), ("Pendulum", 14.0), ("Kicked", 12.0), ("Satellite", 270.0)]
)
def test_samples_of_a_start_follow_its_linear_system(name: str, time: float) -> None:
    """With a hundredth of all errors and noise; their variances are those of so many normal samples."""
    small = 0.01
    described, scenario = loop(name)
    started = scenario.started_at(time, "start")
    draws = small * described.errors.draw(described.design, 3, 400, 0, 400)
    engine = started.engine("vectorised", draws).with_noise(small)  # type: ignore[attr-defined]
    result = engine.simulate(Batch(np.arange(400), draws, 3))
    sigma = small * np.sqrt(np.diag(covariance_at(described, scenario, time)))
    moved = sigma > 1e-3 * sigma.max() * np.array([output.of != "time" for output in started.outputs])
    moved &= sigma > 1e-9
    assert np.abs(result.values - result.linear_values)[:, moved].max() < 0.02 * sigma[moved].max()
    assert np.abs((result.values - result.linear_values) / np.where(moved, sigma, np.inf)).max() < 0.05
    chi2 = np.sum((result.linear_values - started.linear().end.nominal)[:, moved] ** 2, axis=0) / sigma[moved] ** 2
    bounds = stats.chi2(400).ppf([0.5 * FALSE_ALARM / moved.sum(), 1.0 - 0.5 * FALSE_ALARM / moved.sum()])
    assert np.all((chi2 > bounds[0]) & (chi2 < bounds[1]))


def test_starts_end_with_the_first_event_by_trigger() -> None:
    """Braking triggers within the 19th second; corrections at given times are among the starts."""
    _, braking = loop("Braking")
    assert 18.0 <= braking.start_times(500)[-1] <= braking.plan.event_times["brake"]
    _, rendezvous = loop("Rendezvous")
    assert 156.7 in rendezvous.start_times(3)


def test_a_start_without_meaning_is_refused_in_a_line() -> None:
    _, scenario = loop("Remembering")
    with pytest.raises(ScenarioError, match="memory whose values at a later start are not known"):
        scenario.check_start_axes("start")
    _, scenario = loop("DoubleIntegrator")
    with pytest.raises(ScenarioError, match="axes of its own"):
        scenario.check_start_axes("trajectory")
    with pytest.raises(ScenarioError, match=r"got 60.4 s; .* the nearest is 60 s"):
        scenario.started_at(60.4, "start")
    with pytest.raises(CampaignError, match="innovation of ranging is not zero without errors"):
        start_time_study(campaign("Biased"))


def test_the_study_finds_the_last_start_before_guidance_is_needed(tmp_path: Any) -> None:
    """Later the truth has drifted too far; checks lie at instants of the loop, and agree."""
    described, _ = loop("DoubleIntegrator")
    study, files = write_start_times(described, tmp_path, count=9)
    assert {path.name for path in files} == {"start_times.csv", "start_times_checks.csv", "start_times.html"}
    assert set(study.checks) <= set(study.study.times)
    weighted = study.study.weights > 0.0
    assert [output.name for output, counts in zip(described.scenario.outputs, weighted, strict=True) if counts] == [
        "true_position", "true_velocity",
    ]  # fmt: skip
    assert study.study.sigma[-1][weighted].min() > 10.0 * study.study.sigma[0][weighted].max()
    assert "the smallest weighted true dispersion" in (tmp_path / "start_times.html").read_text()
