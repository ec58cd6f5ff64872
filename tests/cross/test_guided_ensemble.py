"""The ensemble of the guided reentry: against the reference engine, over time, in any order, to its site."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from mcnav.config.read import parse_campaign
from mcnav.contract.engine import has_histories, without_noise
from mcnav.contract.samples import SimulationResult
from mcnav.contract.scenario import Scenario
from mcnav.errors import CampaignError
from mcnav.systems.reentry.guided.scenario import GuidedEngine, GuidedReentry
from mcnav.systems.reentry.scenario import Reentry
from tests.guided import ALL_SIZES, NAMES, errors_of

FOLLOWING = {"law": {"type": "reference", "limit": 0.8}}
DISPERSIONS = errors_of(true_altitude=1e3, true_altitude_rate=5.0, density=0.05, lift_to_drag=0.03, drag=0.03)
"""One sigma of each."""


def _scenario(number: int, guidance: dict[str, Any] | None = None, **options: Any) -> Scenario:
    described: dict[str, Any] = {"type": "reentry", "trajectory": number} | options
    if guidance is not None:
        described["guidance"] = guidance
    return parse_campaign({"scenario": described, "errors": {}}, "test.toml", "test").scenario


def _guided(number: int, guidance: dict[str, Any] | None = None, **options: Any) -> GuidedReentry:
    scenario = _scenario(number, {} if guidance is None else guidance, **options)
    assert isinstance(scenario, GuidedReentry)
    return scenario


def _engine(scenario: GuidedReentry) -> GuidedEngine:
    engine = scenario.engine("ensemble", np.zeros((1, len(NAMES))))
    assert isinstance(engine, GuidedEngine)
    return engine


def _fly(scenario: GuidedReentry, errors: np.ndarray, engine: str = "ensemble") -> SimulationResult:
    return without_noise(scenario.engine(engine, errors))(errors)


def _draw(count: int, seed: int = 7, sizes: np.ndarray = ALL_SIZES) -> np.ndarray:
    return np.asarray(np.random.default_rng(seed).standard_normal((count, len(sizes))) * sizes)


def test_engines_agree_on_samples_and_on_how_they_end() -> None:
    """With usual errors; one that skips out and one that meets the ground fail in both, for the same reason."""
    scenario = _guided(2, {"final": "indicated"})
    errors = np.concatenate([_draw(5), [errors_of(true_altitude=60e3)], [errors_of(altitude_rate=-60.0)]])
    errors = np.concatenate([errors, [errors_of(altitude_rate=15.0)]])
    fast, slow = _fly(scenario, errors), _fly(scenario, errors, "reference")
    assert {row: str(each) for row, each in fast.failures.items()} == {
        row: str(each) for row, each in slow.failures.items()
    }
    assert fast.failures
    flown = np.isfinite(fast.values[:, 0])
    sigma = np.abs(scenario.linear().end.partials * ALL_SIZES).max(axis=1)
    assert (np.abs(fast.values - slow.values)[flown] < 1e-6 * sigma).all()


def test_a_sample_does_not_depend_on_its_neighbours() -> None:
    """Bits are the same alone, in another order, and beside a sample that stays aloft for a day."""
    scenario = _guided(4)
    errors = np.concatenate([_draw(9, sizes=1e-4 * ALL_SIZES), [errors_of(true_altitude_rate=40.0)]])
    together = _fly(scenario, errors)
    assert list(together.failures) == [9]
    assert "skips out" in str(together.failures[9])
    backwards = _fly(scenario, errors[::-1])
    assert np.array_equal(backwards.values[::-1], together.values, equal_nan=True)
    for row in (0, 7):
        assert np.array_equal(_fly(scenario, errors[row : row + 1]).values[0], together.values[row])


def test_without_errors_it_is_the_nominal_flight() -> None:
    scenario = _guided(2)
    values = _fly(scenario, errors_of()[None]).values[0]
    trajectory = scenario.navigation.trajectory
    named = dict(zip([output.name for output in scenario.outputs], values.tolist(), strict=True))
    assert [named[name] for name in ("altitude", "range", "altitude_rate", "range_rate", "true_range")] == [0.0] * 5
    assert named["final_time"] == pytest.approx(trajectory.final_time - trajectory.reentry_time, abs=1e-6)
    times = trajectory.reentry_time + np.linspace(0.0, 200.0, 10_001)
    force = np.linalg.norm(trajectory.forces(times), axis=1).max()
    assert named["peak_deceleration"] == pytest.approx(force, rel=1e-3)
    assert named["peak_deceleration"] >= force


def test_density_and_drag_act_alike() -> None:
    partials = _scenario(2, {}).linear().end.partials
    density, drag = partials[:, NAMES.index("density")], partials[:, NAMES.index("drag")]
    assert density == pytest.approx(drag, rel=1e-9, abs=1e-9)


def test_errors_over_time_end_as_the_samples_do() -> None:
    """The last epoch is each sample's own end, where those stay that have ended before the nominal flight does."""
    scenario = _guided(2)
    engine, errors = _engine(scenario), _draw(6)
    assert has_histories(engine)
    histories = engine.histories(errors)
    time = [output.name for output in scenario.outputs].index("final_time")
    final = _fly(scenario, errors).values
    sigma = np.abs(scenario.linear().end.partials * ALL_SIZES).max(axis=1)
    assert (np.abs(histories[:, -1] - final) < 1e-8 * sigma).all()
    early = final[:, time] < engine.epochs.times[-2] * 60.0
    assert early.any()
    kept = [*range(4), time, time + 1]  # its dispersion is from the nominal flight of the time
    assert np.array_equal(histories[early, -2][:, kept], histories[early, -1][:, kept])
    assert (np.diff(histories[:, :-1, time], axis=1) >= 0.0).all()


def test_linear_analysis_over_time_is_that_of_small_errors() -> None:
    scenario = _guided(2, start="-10 min")
    engine = _engine(scenario)
    known = scenario.linear_over_time()
    assert known.times == pytest.approx(engine.epochs.times, abs=1e-9)
    steps = 1e-4 * ALL_SIZES
    up, down = np.split(engine.histories(np.concatenate([np.diag(steps), -np.diag(steps)])), 2)
    differences = ((up - down) / (2.0 * steps[:, None, None])).transpose(1, 2, 0)
    largest = np.abs(known.partials * ALL_SIZES).max(axis=2)
    apart = np.abs((differences - known.partials) * ALL_SIZES).max(axis=2)
    assert (apart < 1e-5 * largest + 1e-4).all()


def test_a_law_that_follows_the_nominal_flight_reaches_the_landing_site() -> None:
    """Trajectory 4 with its own law spreads over thousands of kilometres; with this one over some kilometres."""
    scenario = _guided(4, FOLLOWING)
    index = [output.name for output in scenario.outputs].index("true_range")
    assert abs(_fly(scenario, errors_of()[None]).values[0, index]) < 1.0
    result = _fly(scenario, _draw(400, sizes=DISPERSIONS))
    assert not result.failures
    assert np.percentile(np.abs(result.values[:, index]), 90.0) < 2e3
    own = _fly(_guided(4), _draw(100, sizes=DISPERSIONS))
    assert np.nanpercentile(np.abs(own.values[:, index]), 50.0) > 1e6


def test_engines_and_variation_agree_on_the_law_to_the_landing_site() -> None:
    scenario = _guided(4, FOLLOWING)
    small = np.where(np.arange(len(NAMES)) < NAMES.index("true_altitude"), 0.01, 0.3) * ALL_SIZES
    errors = _draw(3, sizes=small)
    fast, slow = _fly(scenario, errors).values, _fly(scenario, errors, "reference").values
    linear = scenario.linear().end
    largest = np.abs(linear.partials * small).max(axis=1)
    of_range = [output.name for output in scenario.outputs].index("true_range")
    allowed = 1e-6 * largest
    allowed[of_range] = 1.0  # m: DOP853 leaves the nominal end of this skip by decimetres
    assert (np.abs(fast - slow) < allowed).all()
    steps = 1e-3 * small
    up, down = np.split(_fly(scenario, np.concatenate([np.diag(steps), -np.diag(steps)])).values, 2)
    differences = ((up - down) / (2.0 * steps[:, None])).T
    assert (np.abs((differences - linear.partials) * small).max(axis=1) < 1e-4 * largest).all()


@pytest.mark.parametrize(
    ("guidance", "message"),
    [
        ({"input": "tru"}, "scenario.guidance.input: got 'tru'; expected 'indicated' or 'true'"),
        ({"law": {"type": "reference", "limit": 0.5}}, "lift-to-drag ratio of up to 0.5, and a law that follows it"),
        ({"law": {"type": "reference", "limit": 0.8, "gains": [1, 2]}}, "law.gains: got a list; expected a table"),
        (
            {"law": {"type": "reference", "limit": 0.8, "gains": {"altitude": "0.2 1/km", "altitude_rate": "2 s/km"}}},
            "law.gains.range_rate: is missing",
        ),
        (
            {
                "law": {
                    "type": "reference", "limit": 0.8, "miss": "1 km",
                    "gains": {"altitude": "-0.2 1/km", "altitude_rate": "-20 s/km", "range_rate": "-9 s/km"},
                }
            },
            "law.miss: got with gains, which it would decide about; keep one",
        ),
    ],
)  # fmt: skip
def test_mistakes_are_told_in_one_line(guidance: dict[str, Any], message: str) -> None:
    with pytest.raises(CampaignError) as failed:
        _scenario(4, guidance)
    assert [message in str(problem) for problem in failed.value.problems] == [True]


def test_true_errors_alone_make_each_sample_fly_by_itself() -> None:
    """Without guidance and without such errors it is the reentry of always."""
    plain = {"scenario": {"type": "reentry", "trajectory": 2}, "errors": {"altitude": "1 km"}}
    assert isinstance(parse_campaign(plain, "test.toml", "test").scenario, Reentry)
    dispersed = parse_campaign(plain | {"errors": {"density": "5 %"}}, "test.toml", "test").scenario
    assert isinstance(dispersed, GuidedReentry)
    guidance = dispersed.navigation.guidance
    assert (guidance.input, guidance.final, guidance.navigator_start) == ("true", "true", "truth")
