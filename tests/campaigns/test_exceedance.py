"""Requirements beyond counting, from campaign file to report."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats

from mcnav.analysis.exceedance import Event, weigh
from mcnav.analysis.requirements import Exceedance, Finding, Requirement, RequirementResult
from mcnav.config.campaign import Campaign
from mcnav.config.read import parse_campaign, read_campaign
from mcnav.errors import RunFolderError
from mcnav.report.figures.tail import tails
from mcnav.report.pages.lincov import requirement_rows
from mcnav.report.pages.sweep import frame
from mcnav.report.pages.sweep_page import point_table
from mcnav.report.results.model import RunAnalysis
from mcnav.runner.draws import DrawPlan
from mcnav.store.run_folder import RunFolder
from mcnav.studies.linear_covariance import linear_covariance
from mcnav.studies.sweep import SweepPlan, run_sweep
from mcnav.workflow.analyse import analyse, report_run
from mcnav.workflow.check import by_counting
from mcnav.workflow.exceedance import estimate_exceedances
from mcnav.workflow.prepare import PreparedSystem, prepare_system
from mcnav.workflow.replay import replay_failure
from mcnav.workflow.run import run_campaign
from tests.campaigns.test_ins import described
from tests.closed_loops import CAMPAIGNS
from tests.closed_loops import campaign as loop

OF, BEYOND = 475_103_232, {140: 8_108, 150: 1_933, 159: 487, 160: 409}
"""Samples of trajectory 4 beyond so many km of altitude, counted once (`counted_draws`), in 9 minutes of a core."""

FIRST, BEYOND_120_KM = 102_400, 26
"""The first of them, and how many lie beyond 120 km."""

PASSED = 215, 20_480_000
"""Flights of trajectory 4 whose range rate passes 4.4 of its largest linear sigma at any epoch, counted once."""

HOUR_OF, HOUR, HOUR_LIMIT = 3_015_680, 29, 4.8018e-4
"""Flights of campaign 20 with a heading error beyond a limit, rad, counted once.

They are those of ``DrawPlan(errors, "random", 43_000_020, 20_000_000)`` from the first on, simulated by `shared-gains`
in fourteen minutes of a core.
"""

HEADING = 6.640318e-3


def capsule(samples: int = 2_000, **changes: Any) -> dict[str, Any]:
    """Trajectory 4 with the errors of NASA TN D-1772, and a limit that one in a million exceeds."""
    errors = {
        "altitude": "5 km", "range": "0.5 km", "altitude_rate": "0.5 m/s", "range_rate": "0.02 m/s",
        "misalignment": "0.2 mrad", "gyro_drift": "1e-6 rad/s", "bias_x": "9.798597e-4 m/s^2",
        "bias_z": "9.798597e-4 m/s^2", "scale_factor_x": "100 ppm", "scale_factor_z": "100 ppm",
    }  # fmt: skip
    limit = {"output": "altitude", "probability": 0.999_998, "below": "160 km"}
    return {
        "samples": samples, "seed": 1772, "scenario": {"type": "reentry", "trajectory": 4}, "errors": errors,
        "accept": {"quantile": [limit]}, **changes,
    }  # fmt: skip


def counted_draws() -> DrawPlan:
    """Return the samples that were counted, of which the first ``OF`` were simulated."""
    return DrawPlan(parse_campaign(capsule(), "test.toml", "test").errors, "random", 43_000_001, 1_000_000_000)


def run(folder: Path, jobs: int = 1, report: bool = False, **changes: Any) -> dict[str, Any]:
    campaign = parse_campaign(capsule(**changes), "test.toml", "test")
    return dict(run_campaign(campaign, folder, None, jobs, report=report).summary)


def prepared(described: Campaign, seed: int = 1772) -> PreparedSystem:
    """Prepare a campaign with its first engine, without a folder."""
    described = replace(described, design="random", seed=seed, tolerance=0.05, sample_timeout=None)
    return prepare_system(described, described.scenario.engines[0])


def around(count: int, of: int) -> tuple[float, float]:
    """Return the interval of a small probability from a count, which holds with a probability of 99.99 %."""
    return stats.chi2.ppf(0.5e-4, 2 * count) / 2 / of, stats.chi2.isf(0.5e-4, 2 * count + 2) / 2 / of


def test_limits_agree_with_a_count_of_475_million() -> None:
    """At 1.7e-5, 4e-6 and 1e-6 the counts are known to 4, 9 and 18 %; each interval lies within that of the count."""
    system = prepared(parse_campaign(capsule(), "test.toml", "test"))
    altitudes = system.engine.simulate(counted_draws().batch(0, FIRST)).values[:, 0]
    assert np.count_nonzero(np.abs(altitudes) > 120e3) == BEYOND_120_KM
    asked = [Requirement("quantile", (0,), (1e3 * limit,), 1.0 - 1e-8) for limit in BEYOND]
    records = estimate_exceedances(system, asked, 0.95)
    for (limit, count), record in zip(BEYOND.items(), records, strict=True):
        low, high = around(count, OF)
        assert low < record.low < record.high < high, limit


def test_any_epoch_agrees_with_a_count() -> None:
    """28 half-spaces of the range's rate, over a whole flight."""
    system = prepared(parse_campaign(capsule(), "test.toml", "test"))
    assert system.engine.epochs is not None
    last = len(system.engine.epochs.times)
    asked = Requirement("quantile", (3,), (142.27527536924075,), 1.0 - 1e-7, "throughout", tuple(range(1, last)))
    (record,) = estimate_exceedances(system, [asked], 0.95)
    low, high = around(*PASSED)
    assert low < record.low < record.high < high


def test_a_requirement_over_time_is_met_by_flights_from_file_to_replay(tmp_path: Path) -> None:
    """A free navigator with noise, whose errors grow until the end: nearly all failures are at the last epoch."""
    limit = {"output": "position_north", "probability": 0.999_99, "below": "560 m", "after": "200 s"}
    free = described(2_000, errors={"velocity": "0.3 m/s", "tilt": "0.2 mrad"}, accept={"quantile": [limit]})
    summary = run_campaign(parse_campaign(free, "test.toml", "test"), tmp_path / "run", None, 1).summary
    (required,) = summary["requirements"]
    exceedance = required["exceedance"]
    assert required["finding"] == "met"
    assert exceedance["refusal"] == ""
    sigma = np.sqrt(np.array(summary["covariance_linear"])[0, 0])
    assert exceedance["estimate"] == pytest.approx(2.0 * stats.norm.sf(560.0 / sigma), rel=0.02)
    assert exceedance["way"].keys() <= {"velocity_north", "tilt_east", "accelerometer_misalignment_yz"}
    assert "at any epoch" in (tmp_path / "run" / "report.html").read_text(encoding="utf-8")
    flight = replay_failure(tmp_path / "run", 1)
    assert flight.limited.endswith("This flight reaches 1.0000 times the limit.")
    assert re.fullmatch(
        r"noise adds −?-?[\d.e-]+ m to position north at [\d.]+ min, by linear analysis", flight.notes[0]
    )


OWN = """
import numpy as np
from mcnav import Epochs, Output, Source

class Own:
    sources = (Source("a", "m", "m", 1.0),)
    outputs = (Output("b", "m", "m"), Output("c", "m", "m"))
    epochs = Epochs("time [s]", np.arange(9.0))

    def fly(self, errors, noise):
        walk = np.append(0.0, np.cumsum(noise.normal(0.0, 0.5, 8)))
        return np.column_stack([errors[0] + walk, errors[0] + walk + 0.1 * noise.random(9)])

    def fly_linear(self, errors, noise):
        return self.fly(errors, noise)

    def noise_covariance(self):
        found = 0.25 * np.arange(9.0)[:, None, None] * np.ones((2, 2))
        found[:, 1, 1] += 0.01 / 12.0
        return {"walk": found}
"""
"""A random walk of eight steps of 0.5 m about a source of 1 m, seen with uniform noise as well."""


def walked_beyond(limit: float, steps: int = 8, nodes: int = 200) -> float:
    """Integrate the density of the walk within its limits, step by step; what leaves them is added up."""
    x, w = np.polynomial.legendre.leggauss(nodes)
    x, w = limit * x, limit * w
    leaving = stats.norm.sf((limit - x) / 0.5) + stats.norm.sf((limit + x) / 0.5)
    within, passed = stats.norm.pdf(x), 2.0 * stats.norm.sf(limit)
    for _ in range(steps):
        passed += np.sum(w * within * leaving)
        within = (stats.norm.pdf((x[:, None] - x) / 0.5) / 0.5 * w) @ within
    return float(passed)


def test_noise_of_a_class_of_ones_own_is_estimated(tmp_path: Path) -> None:
    """At any epoch, and at the end with noise that no normal is: integrals over the walk and over the uniform noise."""
    (tmp_path / "own.py").write_text(OWN)
    (tmp_path / "own.toml").write_text(
        'samples = 2_000\nseed = 3\n[scenario]\ntype = "own.py:Own"\n[errors]\na = "1 m"\n'
    )
    system, limit = prepared(read_campaign(tmp_path / "own.toml"), 3), 8.5
    asked = [Requirement("quantile", (0,), (limit,), 1.0 - 1e-7, "throughout", tuple(range(9))),
             Requirement("quantile", (1,), (limit,), 1.0 - 1e-7)]  # fmt: skip
    any_epoch, at_end = estimate_exceedances(system, asked, 0.95)
    assert any_epoch.low <= walked_beyond(limit) <= any_epoch.high < 1.3 * any_epoch.low
    moved, sigma = np.linspace(0.0005, 0.0995, 100), np.sqrt(3.0)
    exact = np.mean(stats.norm.sf((limit - moved) / sigma) + stats.norm.sf((limit + moved) / sigma))
    assert at_end.low <= exact <= at_end.high < 1.2 * at_end.low
    sizes = {name: abs(sigmas) for name, sigmas in at_end.way.items()}
    assert sizes == pytest.approx({"walk": limit / sigma * np.sqrt(2.0 / 3.0), "a": limit / 3.0}, abs=0.3)


def test_an_interval_of_any_epoch_shows_nothing_above_what_each_allows() -> None:
    requirement = Requirement("quantile", (0,), (1.0,), 1.0 - 1e-6, "", (0, 1))
    undecided = RequirementResult(requirement, Finding.UNDECIDED, 0.5, (0.0, np.inf), 0.5, True, 10**8)
    event, histories = Event.of(requirement, {}), np.zeros((1_000, 2, 1))
    for low, high, finding in ((0.8e-6, 0.9e-6, Finding.MET), (1.1e-6, 1.2e-6, Finding.UNDECIDED)):
        exceedance = Exceedance(0.5 * (low + high), low, high, 700, power=1.0)
        assert weigh(undecided, exceedance, event, histories, np.arange(1_000), 0.95).finding == finding
    histories[:2, 1] = 2.0
    told = weigh(undecided, Exceedance(8e-7, 7e-7, 9e-7, 700), event, histories, np.arange(1_000), 0.95)
    assert told.exceedance is not None
    assert told.exceedance.refusal.startswith("2 of 1,000 samples lie beyond the limit")


def test_a_closed_loop_with_noise_agrees_with_a_count() -> None:
    """An end by a trigger and a filter: 90 of 1,228,800 lie beyond four linear sigmas, at any epoch 80 of 163,840."""
    system = prepared(loop("Landing", samples=4_000), 101)
    assert system.engine.epochs is not None
    epochs = tuple(range(1, len(system.engine.epochs.times)))
    at_the_end = Requirement("quantile", (3,), (1.0398865668462192,), 1.0 - 1e-7, about="nominal")
    asked = [at_the_end, replace(at_the_end, limits=(1.11141346,), when="throughout", epochs=epochs)]
    records = estimate_exceedances(system, asked, 0.95)
    for record, counted in zip(records, (around(90, 1_228_800), around(80, 163_840)), strict=True):
        low, high = counted
        assert low < record.high
        assert high > record.low
        assert record.high < 2.0 * record.low
        assert set(record.way) <= {"altimeter", "gusts", "altitude", "rate", "true_altitude", "true_rate"}


def test_a_limit_at_one_in_a_million_from_file_to_report(tmp_path: Path) -> None:
    (required,) = run(tmp_path / "run", report=True)["requirements"]
    exceedance = required["exceedance"]
    assert exceedance["from"] < exceedance["estimate"] < exceedance["to"]
    assert exceedance["to"] - exceedance["from"] < 0.1 * exceedance["estimate"]
    assert exceedance["flights"] < 50_000
    assert exceedance["power"] > 0.99
    assert exceedance["method"] == "lines along the linear model"
    assert list(exceedance["way"])[:2] == ["gyro_drift", "bias_x"]
    assert required["finding"] == "met"
    assert required["samples_needed"] is None
    assert required["remark"] == f"decided by {exceedance['flights']:,} chosen flights"
    report = (tmp_path / "run" / "report.html").read_text(encoding="utf-8")
    assert "most likely by gyro drift at" in report
    assert "; flown by mcnav replay RUN --fail 1" in report
    assert "none of 2,000 samples lies beyond; linear analysis expects 8.75e-07, with curvature 8.8" in report
    _flies_to_its_limit(tmp_path / "run", exceedance["way"])
    _has_a_tail(analyse(RunFolder(tmp_path / "run")))
    assert "shown by 1,497,865 samples with none beyond" in report


def _flies_to_its_limit(folder: Path, way: dict[str, float]) -> None:
    """The most likely way to fail reaches its limit by both engines, whose accuracy is 1e-6 of it."""
    result = replay_failure(folder, 1)
    names = [source.name for source in result.sources]
    sigmas = dict(zip(names, result.errors / np.where(result.sigmas > 0.0, result.sigmas, 1.0), strict=True))
    assert sigmas["gyro_drift"] == pytest.approx(way["gyro_drift"], rel=0.02)
    flown = [abs(outcome.values[0]) for outcome in result.outcomes]
    assert 160e3 < flown[0] < 160e3 * (1.0 + 1e-5)
    np.testing.assert_allclose(flown[1], flown[0], rtol=1e-6)
    assert result.limited.endswith("This flight reaches 1.0000 times the limit.")
    with pytest.raises(
        RunFolderError, match=r"requirement 2 has no likeliest failure: .* no such requirement; known of 1$"
    ):
        replay_failure(folder, 2)


def _has_a_tail(content: RunAnalysis) -> None:
    """Its curves are those of the normal law, of the count, and, with curvature, closer to the flights."""
    (curve,) = content.tail_curves
    assert curve is not None
    sigma = float(np.sqrt(content.model.outcome_covariance[0, 0]))
    np.testing.assert_allclose(curve.linear, 2.0 * stats.norm.sf(curve.multiples * 160e3 / sigma), rtol=1e-9)
    beyond = [np.mean(np.abs(content.outputs[:, 0]) > each * 160e3) for each in curve.multiples]
    np.testing.assert_array_equal(np.nan_to_num(curve.counted), beyond)
    np.testing.assert_allclose(curve.high[-1], 1.0 - 0.025 ** (1.0 / 2_000), rtol=1e-9)
    linear, curved = curve.at_limit
    (required,) = content.summary.requirements
    assert required.exceedance is not None
    assert abs(curved - (required.exceedance.estimate or 0.0)) < 0.05 * linear
    figure = tails(content)
    assert figure is not None
    assert [each.name for each in figure.key] == ["counted", "bounds", "linear", "curved", "flights", "allowed"]


def test_bits_do_not_depend_on_jobs_nor_on_interruptions(tmp_path: Path) -> None:
    """A run that is extended, one of several jobs and a report made again state the same exceedance."""
    (first,) = run(tmp_path / "one", samples=1_000)["requirements"]
    (extended,) = run(tmp_path / "one", samples=2_000)["requirements"]
    (of_jobs,) = run(tmp_path / "two", jobs=2)["requirements"]
    assert first["exceedance"] == extended["exceedance"] == of_jobs["exceedance"]
    (again,) = report_run(tmp_path / "two")["requirements"]
    assert again == of_jobs


def test_requirements_that_counting_decides_have_none(tmp_path: Path) -> None:
    limit = {"output": "altitude", "probability": 0.95, "below": "160 km"}
    (required,) = run(tmp_path / "run", accept={"quantile": [limit]})["requirements"]
    assert required["finding"] == "met"
    assert "exceedance" not in required


def test_linear_analysis_and_a_sweep_state_the_tail(tmp_path: Path) -> None:
    """With curvature a run's second derivatives say the same; at the sweep's points it is the normal law's."""
    (row,) = requirement_rows(linear_covariance(capsule(10)))
    run(tmp_path, samples=10)
    (curve,) = analyse(RunFolder(tmp_path)).tail_curves
    assert curve is not None
    assert (row.exceedance, row.exceedance_curved) == pytest.approx(curve.at_limit, rel=1e-9)
    swept = run_sweep(capsule(10), SweepPlan({"errors.gyro_drift": ["1e-6 rad/s", "2e-6 rad/s"]}))
    assert swept.exceedances is not None
    assert swept.exceedances[0, 0] == pytest.approx(row.exceedance, rel=1e-9)
    sigma = swept.values[:, 0] / stats.norm.isf(1e-6)  # two parts in a million are allowed, on two sides
    np.testing.assert_allclose(swept.exceedances[:, 0], 2.0 * stats.norm.sf(160e3 / sigma), rtol=1e-6)
    assert list(frame(swept))[-1] == "quantile(altitude, 0.999998), beyond"
    assert "Beyond the limit" in [column.heading for column in point_table(swept).columns]


def test_a_check_says_how_many_samples_show_it_by_counting() -> None:
    """852 without a failure show 99.73 % at 90 % (consumer's risk); a campaign that has them is not told."""
    limit = {"output": "altitude", "probability": 0.9973, "below": "160 km"}

    def told(samples: int) -> list[str]:
        described = capsule(samples, accept={"quantile": [limit]}, confidence=0.9)
        return by_counting(parse_campaign(described, "test.toml", "test"))

    assert told(851) == ["to show 99.73 % by counting takes 852 samples with none beyond; there are 851"]
    assert told(852) == []


def test_too_few_samples_are_refused_in_a_line(tmp_path: Path) -> None:
    (required,) = run(tmp_path / "run", samples=500)["requirements"]
    refusal = "it takes about 1,000 flights, more than the campaign has samples (500)"
    assert required["exceedance"]["refusal"] == refusal
    assert required["exceedance"]["estimate"] is None
    assert required["finding"] == "undecided"


def aided(samples: int, heading: str) -> dict[str, Any]:
    """Five minutes of flight with GNSS until 40 s before the end, which the heading's error makes bend."""
    gnss = {"type": "gnss", "interval": "5 s", "position": "3 m", "velocity": "0.2 m/s"}
    return described(
        samples,
        aiding=[gnss | {"outages": [["240 s", "400 s"]]}],
        filter={"estimates": ["position", "velocity", "attitude", "gyro_bias", "accelerometer_bias"]},
        errors={"position": "5 m", "velocity": "0.05 m/s", "tilt": "1 mrad", "heading": heading},
    )


def test_noise_that_the_linear_model_misses_is_refused() -> None:
    """An aided flight whose heading bends its errors: noise moves lines away from where the first ones were."""
    system = prepared(parse_campaign(aided(5_000, "5 deg"), "test.toml", "test"), 5)
    asked = Requirement("quantile", (8,), (HEADING,), 0.9998)
    (record,) = estimate_exceedances(system, [asked], 0.95)
    assert "times the probability that the first ones had" in record.refusal


@pytest.mark.slow
def test_an_hour_of_aided_flight_agrees_with_a_count() -> None:
    """Campaign 20 at 1e-5, by the engine whose samples share their gains."""
    described = read_campaign(CAMPAIGNS / "20_flight_with_neglected_errors.toml")
    described = replace(described, design="random", seed=1901, samples=10_000, tolerance=0.2)
    system = prepare_system(described, "shared-gains")
    asked = Requirement("quantile", (8,), (HOUR_LIMIT,), 1.0 - 1e-7)
    (record,) = estimate_exceedances(system, [asked], 0.95)
    low, high = around(HOUR, HOUR_OF)
    assert low < record.low < record.high < high
    assert record.high < 1.03 * record.low


def test_noise_that_is_linear_has_the_normal_probability(tmp_path: Path) -> None:
    """Departures are 5e-4 of a sigma, which moves it by 0.3 %; 1 % is allowed."""
    accept = {"quantile": [{"output": "tilt_north", "probability": 0.999_999, "below": "0.37 mrad"}]}
    campaign = parse_campaign(described(2_000, accept=accept), "test.toml", "test")
    summary = run_campaign(campaign, tmp_path / "run", None, 1, report=False).summary
    (required,) = summary["requirements"]
    sigma = np.sqrt(np.array(summary["covariance_linear"])[6, 6])
    expected = 2.0 * stats.norm.sf(0.37e-3 / sigma)
    assert required["exceedance"]["estimate"] == pytest.approx(expected, rel=0.01)
    flight = replay_failure(tmp_path / "run", 1)
    assert 0.37e-3 < abs(flight.outcomes[0].values[6]) < 0.37e-3 * (1.0 + 1e-5)
    assert flight.linear[6] == pytest.approx(flight.outcomes[0].values[6], rel=1e-3)
    assert re.fullmatch(r"noise adds −?-?[\d.e-]+ mrad to tilt north, by linear analysis", flight.notes[0])


def test_noise_of_other_engines_is_refused_in_a_line(tmp_path: Path) -> None:
    accept = {"quantile": [{"output": "position_north", "probability": 0.999_999, "below": "300 m"}]}
    campaign = parse_campaign(described(4, accept=accept), "test.toml", "test")
    (required,) = run_campaign(campaign, tmp_path / "run", "reference", 1, report=False).summary["requirements"]
    refusal = "flights are chosen with the noise of other engines than reference: ensemble, shared-gains, single"
    assert required["exceedance"]["refusal"] == refusal
    assert required["finding"] == "undecided"


@pytest.mark.parametrize(("low", "high", "finding"), [
    (0.8e-6, 0.9e-6, Finding.MET), (1.1e-6, 1.2e-6, Finding.NOT_MET), (0.9e-6, 1.1e-6, Finding.UNDECIDED),
])  # fmt: skip
def test_an_interval_decides_what_counting_does_not(low: float, high: float, finding: Finding) -> None:
    result = _weighed(low, high, np.zeros(1_000))
    assert result.finding == finding
    assert result.samples_needed is None
    assert "chosen flights" in result.remark


def test_samples_that_contradict_the_flights_are_told() -> None:
    """Two of a thousand lie beyond a limit that one in a million should."""
    outcomes = np.zeros(1_000)
    outcomes[:2] = 2.0
    result = _weighed(0.8e-6, 0.9e-6, outcomes)
    assert result.finding == Finding.UNDECIDED
    assert result.exceedance is not None
    assert result.exceedance.refusal.startswith("2 of 1,000 samples lie beyond the limit")


def _weighed(low: float, high: float, outcomes: np.ndarray[Any, Any], power: float = 1.0) -> RequirementResult:
    """Weigh an exceedance of |output| beyond 1, which one in a million may, against samples."""
    requirement = Requirement("quantile", (0,), (1.0,), 1.0 - 1e-6)
    undecided = RequirementResult(requirement, Finding.UNDECIDED, 0.5, (0.0, np.inf), 0.5, True, 10**8)
    exceedance = Exceedance(0.5 * (low + high), low, high, 700, power=power)
    event = Event.of(requirement, {})
    return weigh(undecided, exceedance, event, outcomes[:, None], np.arange(len(outcomes)), 0.95)


@pytest.mark.parametrize(("power", "words"), [
    (0.89, "a second way to fail as likely would be found in eight of ten runs"),
    (0.04, "a second way to fail as likely would be found in none of ten runs"),
    (np.nan, "how well they look for a second way to fail is not known: run it again"),
])  # fmt: skip
def test_a_weak_search_shows_the_known_ways_alone(power: float, words: str) -> None:
    result = _weighed(0.8e-6, 0.9e-6, np.zeros(1_000), power)
    assert result.finding == "met for the known ways"
    assert result.remark == f"decided by 700 chosen flights; {words}"
    assert _weighed(1.1e-6, 1.2e-6, np.zeros(1_000), power).finding == Finding.NOT_MET


HIDDEN = """
import numpy as np

from mcnav import Output, Source


class Bowl:
    sources = tuple(Source(f"s{i}", "1", "1", 1.0) for i in range(11))
    outputs = (Output("y", "1", "1"),)

    def propagate(self, errors):
        return (errors[:, 0] + np.maximum(0.0, np.sum(errors[:, 1:] ** 2, axis=1) - 40.0))[:, None]


class Sum:
    sources = (Source("s0", "1", "1", 1.0), Source("s1", "1", "1", 1.0))
    outputs = (Output("y", "1", "1"),)

    def propagate(self, errors):
        return errors.sum(axis=1, keepdims=True)
"""
"""Outputs whose linear models, of 2.9e-7 and 1.5e-23 beyond their limits, know nothing of most failures."""


@pytest.mark.parametrize(("name", "limit", "exact"), [("Bowl", 5.0, 2.94e-6), ("Sum", 10.0, 1.0e-4)])
def test_what_the_linear_model_misses_is_not_met(name: str, limit: float, exact: float, tmp_path: Path) -> None:
    """One in a million is allowed beyond the limit: of the ball's outside more, of a table with one value of 20."""
    (tmp_path / "own.py").write_text(HIDDEN)
    (tmp_path / "table.csv").write_text("v\n" + 9_999 * "0\n" + "20\n")
    errors: dict[str, Any] = {f"s{i}": "1" for i in range(11)}
    if name == "Sum":
        errors = {"s0": {"distribution": "table", "file": "table.csv", "column": "v", "unit": "1"}, "s1": "1"}
    content = {"samples": 2_000, "seed": 7, "scenario": {"type": "own.py:" + name}, "errors": errors}
    system = prepared(parse_campaign(content, str(tmp_path / "own.toml"), "test"), 7)
    asked = Requirement("quantile", (0,), (limit,), 0.999_999)
    (record,) = estimate_exceedances(system, [asked], 0.95)
    assert record.low <= exact <= record.high
    assert record.low > 1e-6
