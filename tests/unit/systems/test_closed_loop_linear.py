"""Linear answers about closed loops by the linear engine: against recursions, closed forms, and each other."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mcnav.arrays.types import Array
from mcnav.config.read import parse_campaign
from mcnav.contract.samples import Batch
from mcnav.contract.scenario import ScenarioError
from mcnav.errors import CampaignError
from mcnav.systems.closed_loop.timeline import entering, entering_steps
from tests.closed_loops import CAMPAIGNS, campaign


def sigmas(described: Any, system: Any) -> Array:
    """Linear sigmas at the readings of a system, shape (r, outputs)."""
    return np.asarray(np.sqrt(np.diagonal(system.covariance(described.errors.covariance), axis1=1, axis2=2)))


def step_by_step(described: Any) -> Array:
    """Sigmas at the end by ``P+ = A P A' + G G'`` along the plan of the samples, with its gains: shape (outputs,)."""
    scenario = described.scenario
    plan, maps, true = scenario.plan, scenario.maps, scenario.sizes.true
    structure = maps.structure
    covariance = structure.start_partials @ described.errors.covariance @ structure.start_partials.T
    covariance[structure.markov.whole, structure.markov.whole] += np.diag(true.markov**2)
    for planned in plan.instants:
        for transition in (*planned.steps, *planned.updates):
            covariance = transition.state @ covariance @ transition.state.T
            driven = [transition.inputs] if transition.kind == "step" else []
            factors = [factor[0] for _, factor in entering_steps(maps, true, driven)]
            for factor in (*factors, *(added for _, added in entering(maps, true, transition))):
                covariance = covariance + factor @ factor.T
    end = plan.instants[plan.end]
    matrix = scenario.readout.partials(end.nominal, plan.steps, plan.end_time)
    return np.sqrt(np.diag(matrix @ covariance @ matrix.T))


@pytest.mark.parametrize("name", ["Pendulum", "Braking", "GuidedLander", "Remembering", "Satellite"])
def test_the_engine_has_the_sigmas_of_a_recursion_with_the_gains_of_samples(name: str) -> None:
    described = campaign(name)
    linear, expected = sigmas(described, described.scenario.linear())[-1], step_by_step(described)
    known = expected > 1e-9 * expected.max()
    assert linear[known] == pytest.approx(expected[known], rel=1e-11)


def test_within_a_step_noise_has_its_exact_covariance() -> None:
    """Half of a step after 10 s: position by p + v / 2 + a / 8, white noise of density q adds q^2 t^3 / 3."""
    described = campaign("DoubleIntegrator")
    system = described.scenario.linear(np.array([10.0, 10.5]))
    assert system.updates == ("before", "after", None)
    names = [output.name for output in described.scenario.outputs]
    rows = [names.index(name) for name in ("true_position", "true_velocity", "command")]
    _, after, half = system.covariance(described.errors.covariance)[:, rows][:, :, rows]
    moved, turned = np.array([1.0, 0.5, 0.125]), np.array([0.0, 1.0, 0.5])
    assert half[0, 0] == pytest.approx(moved @ after @ moved + 0.01 * 0.5**3 / 3.0, rel=1e-10)
    assert half[1, 1] == pytest.approx(turned @ after @ turned + 0.01 * 0.5, rel=1e-10)
    errors = [names.index(name) for name in ("position", "velocity")]
    own, true = system.own[2][np.ix_(errors, errors)], system.covariance(described.errors.covariance)[2]  # type: ignore[index]
    assert own == pytest.approx(true[np.ix_(errors, errors)], rel=1e-9)


def test_times_outside_of_the_flight_are_refused() -> None:
    with pytest.raises(ScenarioError, match="got 201 s; the flight is from 0 s to 200 s"):
        campaign("DoubleIntegrator").scenario.linear(np.array([10.0, 201.0]))


def test_a_smoother_of_a_consistent_filter_claims_its_true_errors() -> None:
    described = campaign("DoubleIntegrator", filter={"smoother": "fixed-interval"})
    scenario: Any = described.scenario
    smoothed, filtered = scenario.smoothed(scenario.reading_times), scenario.linear(scenario.reading_times)
    known = list(smoothed.own_outputs)
    true, own = sigmas(described, smoothed)[:, known], np.sqrt(np.diagonal(smoothed.own, axis1=1, axis2=2))[:, known]
    assert true == pytest.approx(own, rel=1e-9)
    assert np.all(true <= sigmas(described, filtered)[:, known] * (1.0 + 1e-9))
    # of a long record the smoother is better by half in the middle, and the filter itself at the end
    assert true[len(true) // 2, 0] < 0.7 * sigmas(described, filtered)[len(true) // 2, 0]
    assert true[-1] == pytest.approx(sigmas(described, filtered)[-1, known], rel=1e-12)
    lagging: Any = campaign("DoubleIntegrator", filter={"smoother": {"lag": "2 s"}}).scenario
    assert np.all(sigmas(described, lagging.smoothed())[:, known] >= sigmas(described, scenario.smoothed())[:, known])


def test_a_smoother_of_the_orbit_correction_claims_its_true_errors() -> None:
    """Campaign 29 as it is, with a smoother: not a line of its class knows of it.

    Derivatives are differences of fourth order, to some 1e-7 of their size; tens of measurements add them up.
    """
    content = tomllib.loads((CAMPAIGNS / "29_orbit_correction.toml").read_text(encoding="utf-8"))
    content |= {"filter": {"smoother": "fixed-interval"}, "accept": {}}
    described = parse_campaign(content, str(CAMPAIGNS / "x.toml"), "x")
    scenario: Any = described.scenario
    smoothed = scenario.smoothed()
    known = list(smoothed.own_outputs)
    true, own = sigmas(described, smoothed)[:, known], np.sqrt(np.diagonal(smoothed.own, axis1=1, axis2=2))[:, known]
    assert true == pytest.approx(own, rel=1e-5)


def test_a_smoother_with_considered_states_is_refused() -> None:
    with pytest.raises(CampaignError, match="not defined with considers"):
        campaign("Pendulum", filter={"smoother": "fixed-interval"})


def test_tuned_again_derivatives_are_used_again_but_not_by_samples() -> None:
    first: Any = campaign("Pendulum", measurements={"encoder": "5 mrad"}).scenario
    described = campaign("Pendulum", measurements={"encoder": "8 mrad"})
    fresh: Any = described.scenario
    tuned = fresh.along(first)
    assert tuned.linearization is first.linearization
    assert sigmas(described, tuned.linear()) == pytest.approx(sigmas(described, fresh.linear()), rel=1e-9)
    batch = Batch(np.arange(3), np.zeros((3, len(fresh.sources))), 1)
    simulated = [each.engine("vectorised", batch.errors).simulate(batch).values for each in (tuned, fresh)]
    assert np.array_equal(*simulated)
    hundredfold: Any = campaign("Pendulum", errors={"true_angle": "2 rad"}).scenario
    assert hundredfold.along(first) is hundredfold


AT_TIMES = """
import numpy as np
from mcnav import ClosedLoop

class Swung(ClosedLoop):
    truth = {{"x": "m"}}
    step, end = 1.0, 20.0

    def rates(self, truth, time):
        return {{"x": 0.1 * np.sin({time}) * truth.x}}
"""


def test_methods_that_take_all_times_for_the_same_have_right_derivatives(tmp_path: Path) -> None:
    """The nominal is zero, so that it alone would not tell: x = exp(0.1 (1 - cos t)) x_0."""
    partials = []
    for name, time in (("each", "time"), ("first", "time[0]")):
        (tmp_path / f"{name}.py").write_text(AT_TIMES.format(time=time))
        content = {"samples": 8, "seed": 1, "scenario": {"type": f"{name}.py:Swung"}, "errors": {"true_x": "1 m"}}
        described = parse_campaign(content, str(tmp_path / "x.toml"), "x")
        partials.append(described.scenario.linear_over_time(50).partials)  # type: ignore[attr-defined]
    assert np.array_equal(*partials)
    assert partials[0][-1, 1, 0] == pytest.approx(np.exp(0.1 * (1.0 - np.cos(20.0))), rel=1e-4)
