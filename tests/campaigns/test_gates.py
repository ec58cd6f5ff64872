"""Gates and faults in a campaign: what linear analysis says of them, what samples had, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats

from mcnav.analysis.linear_answer import LinearAnswer
from mcnav.config.read import parse_campaign
from mcnav.contract.samples import Batch
from mcnav.contract.scenario import CovarianceQuestion, has_gates
from mcnav.errors import CampaignError
from mcnav.frames.runs import RunResult
from mcnav.report.document.html import page_html
from mcnav.report.pages.lincov import statements
from mcnav.report.pages.lincov_page import page
from mcnav.report.statements.sweep import remarks
from mcnav.runner.draws import DrawPlan
from mcnav.studies.allocate import allocate
from mcnav.studies.lincov import lincov_table
from mcnav.studies.linear_covariance import linear_covariance
from mcnav.studies.sweep import SweepPlan, run_sweep
from mcnav.workflow.rejections import DoubtAboutGates, rejections_of
from mcnav.workflow.run import run_campaign
from mcnav.workflow.what_if import what_if_of_run

FALSE_ALARM = 1e-4
"""With which a count lies beyond its interval."""


def content(*faults: dict[str, Any], gate: float | None = 0.99, **changes: Any) -> dict[str, Any]:
    """Describe two minutes in a straight line with positions each 5 s, whose filter is matched."""
    straight = {"rate": "1 Hz", "start": {"latitude": "47 deg", "longitude": "9 deg", "altitude": "1 km",
                "speed": "50 m/s"}, "segments": [{"straight": "2 min"}]}  # fmt: skip
    states = ["position", "velocity", "attitude", "accelerometer_bias"]
    gated = {} if gate is None else {"gate": gate}
    return {
        "samples": 800,
        "scenario": {"type": "ins", "trajectory": straight},
        "imu": {"accelerometer": {"bias": "1 mg", "velocity_random_walk": "1 mg/sqrt(Hz)"}},
        "errors": {"position": "10 m", "velocity": "0.5 m/s", "tilt": "1 mrad", "heading": "5 mrad"},
        "aiding": [{"type": "position-fix", "interval": "5 s", "position": "3 m"}],
        "filter": {"estimates": states, **gated},
        **({"faults": list(faults)} if faults else {}),
        **changes,
    }


SPIKE = {"kind": "spike", "sensor": "position_fix", "component": "position_north", "begin": "60 s", "size": "14 m"}
RAMP = {"kind": "ramp", "sensor": "position_fix", "component": "position_east", "begin": "71 s", "end": "100 s",
        "size": "15 m"}  # fmt: skip


def test_what_linear_analysis_says_of_a_gate() -> None:
    """A matched filter: the innovation has the covariance that it believes, and tells nothing of the error after it."""
    campaign = parse_campaign(content(), "mine.toml", "mine")
    scenario, errors = campaign.scenario, campaign.errors
    assert has_gates(scenario)
    (law,) = scenario.gate_laws(errors.mean, errors.covariance)
    believed = law.root @ law.root.T
    np.testing.assert_allclose(law.covariance, believed, rtol=1e-9, atol=1e-9 * believed.max())
    system = scenario.linear()
    true = system.covariance(errors.covariance)[-1]
    sigmas = np.sqrt(np.diag(true))
    assert np.all(np.abs(law.errors - true) <= 1e-9 * np.outer(sigmas, sigmas))
    assert np.all(np.abs(law.cross) <= 1e-7 * np.outer(np.sqrt(np.diag(believed)), sigmas))
    # a measurement moves the position by its gain, P / R, as nothing else is measured then
    np.testing.assert_allclose(np.diag(law.responses)[:3], sigmas[:3] ** 2 / 9.0, rtol=1e-6)
    answer = linear_covariance(campaign)
    rows: Any = lincov_table(answer)["gates"]["stops"]
    assert [row["component"] for row in rows] == ["position_north", "position_east", "position_down"]
    limit = stats.chi2.ppf(0.99, 3)
    stopped = stats.ncx2.sf(limit, 3, rows[0]["spike"] ** 2 * np.linalg.inv(believed)[0, 0])
    # the last bracket is a millionth of a sigma wide, and the density there no more than 0.4
    assert stopped == pytest.approx(0.95, abs=1e-6)
    assert rows[0]["spike_error"] == pytest.approx(rows[0]["spike"] * law.responses[0, 0], rel=1e-9)
    written = page_html(page(answer, {}))
    assert "What the gates stop" in written
    other = parse_campaign(content(gate=None), "mine.toml", "mine")
    assert not has_gates(other.scenario)
    assert "gates" not in lincov_table(linear_covariance(other))
    asked = {**content()["filter"], "stops": {"probability": 0.5, "ramp": "30 s"}}
    half: Any = lincov_table(linear_covariance(parse_campaign(content(filter=asked), "mine.toml", "mine")))["gates"][
        "stops"
    ]
    assert half[0]["spike"] < rows[0]["spike"]
    assert (half[0]["probability"], half[0]["duration"]) == (0.5, 30.0)


def test_counts_of_samples_are_those_that_are_expected(tmp_path: Path) -> None:
    """Rejections of a spike by its exact law, those of a ramp on average, in a run and on its page."""
    campaign = parse_campaign(content(SPIKE, RAMP), "mine.toml", "mine")
    summary = run_campaign(campaign, tmp_path, "ensemble", 1).summary
    spike, ramp = summary["faults"]
    count = campaign.samples
    low, high = stats.binom.ppf([0.5 * FALSE_ALARM, 1.0 - 0.5 * FALSE_ALARM], count, spike["expected"])
    assert 0.2 < spike["expected"] < 0.8
    assert low <= round(spike["rejected"] * count) <= high
    assert spike["measurements"] == 1
    assert spike["alarm"] == pytest.approx(spike["expected"])
    assert spike["rejected_interval"][0] < spike["rejected"] < spike["rejected_interval"][1]
    # six measurements of which each is rejected or not: no sum of them varies more than six times one
    assert ramp["measurements"] == 6
    assert abs(ramp["rejected"] - ramp["expected"]) < stats.norm.isf(0.5 * FALSE_ALARM) * 6.0 * 0.5 / np.sqrt(count)
    assert ramp["expected"] > ramp["alarm"] > 0.1
    assert "Faults of the sensors" in (tmp_path / "report.html").read_text()


def test_both_engines_and_linear_analysis_of_a_fault_without_a_gate() -> None:
    """Samples without errors and noise: the faults alone move them, to first order as in linear analysis.

    A bias until the end is in the position. What is of second order is 1e-4 of it here, the engines' steps are 1e-5.
    """
    faults = (SPIKE, RAMP, {**RAMP, "kind": "bias", "component": "position_down", "begin": "90 s", "end": "120 s"})
    scenario = parse_campaign(content(*faults, gate=None), "mine.toml", "mine").scenario
    assert has_gates(scenario)
    nothing = np.zeros((1, len(scenario.sources)))
    batch = Batch(np.zeros(1, dtype=np.int64), nothing, 0)
    found = [scenario.engine(name, nothing).simulate(batch, noise=False).values for name in ("ensemble", "reference")]
    nominal = scenario.linear().end.nominal
    assert np.abs(nominal[2]) > 5.0
    for values in found:
        np.testing.assert_allclose(values[0, :3], nominal[:3], rtol=1e-3)
    np.testing.assert_allclose(found[0][0, :6], found[1][0, :6], rtol=1e-4)
    question = CovarianceQuestion(scenario, scenario.reading_times, nothing[0], np.zeros((nothing.shape[1],) * 2))
    (readings,) = scenario.covariance_readings([question])
    np.testing.assert_allclose(readings.mean, scenario.linear().nominal, rtol=1e-9, atol=1e-12)


def test_an_outage_is_one_of_aiding() -> None:
    outage = {"kind": "outage", "sensor": "position_fix", "begin": "40 s", "end": "60 s"}
    one = parse_campaign(content(outage), "mine.toml", "mine")
    aided = [{"type": "position-fix", "interval": "5 s", "position": "3 m", "outages": [["40 s", "60 s"]]}]
    other = parse_campaign(content(aiding=aided), "mine.toml", "mine")
    values = []
    for campaign in (one, other):
        draws = DrawPlan(campaign.errors, campaign.design, campaign.seed, 40)
        values.append(campaign.scenario.engine("ensemble", draws.probes()).simulate(draws.batch(0, 40)).values)
    np.testing.assert_array_equal(*values)


@pytest.mark.parametrize(
    ("fault", "told"),
    [
        ({**SPIKE, "sensor": "gps"}, "faults #1.sensor: got 'gps'; no sensor has this name"),
        ({**SPIKE, "component": "altitude"}, "faults #1.component: got 'altitude'; position_fix measures position_n"),
        ({name: each for name, each in SPIKE.items() if name != "component"}, "faults #1.component: is missing; it is"),
        ({**SPIKE, "size": "3 s"}, "faults #1.size: got '3 s', which is a time; expected a length"),
        ({**SPIKE, "size": "0 m"}, "faults #1.size: got '0 m'; expected a size other than zero"),
        ({**SPIKE, "begin": "900 s"}, "faults #1.begin: got '900 s'; position_fix has no measurement then"),
        ({**RAMP, "end": "50 s"}, "faults #1.end: got '50 s'; expected a time after the begin of 71 s"),
        ({**SPIKE, "kind": "step"}, "faults #1.kind: got 'step'"),
        ({**SPIKE, "end": "70 s"}, "faults #1.end: unknown key"),
    ],
)
def test_what_is_refused(fault: dict[str, Any], told: str) -> None:
    with pytest.raises(CampaignError) as refused:
        parse_campaign(content(fault), "mine.toml", "mine")
    assert told in str(refused.value)


def at_rest(gate: float | None, **changes: Any) -> dict[str, Any]:
    """Describe eight and a half minutes with positions each second, whose filter believes the truth."""
    return {
        "samples": 200,
        "scenario": {"type": "ins", "trajectory": {
            "rate": "1 Hz",
            "start": {"latitude": "47 deg", "longitude": "9 deg", "altitude": "500 m", "course": "0 deg",
                      "speed": "50 m/s"},
            "segments": [{"straight": "5 min"}, {"turn": "90 deg"}, {"straight": "3 min"}],
        }},
        "imu": {"gyro": {"angle_random_walk": "0.1 deg/sqrt(h)"},
                "accelerometer": {"velocity_random_walk": "50 ug/sqrt(Hz)"}},
        "errors": {"position": "5 m", "velocity": "0.1 m/s", "tilt": "0.3 mrad", "heading": "2 mrad"},
        "aiding": [{"type": "gnss", "interval": "1 s", "position": {"north": "1 m", "east": "1 m"}}],
        "filter": {"estimates": ["position", "velocity", "attitude"], **({} if gate is None else {"gate": gate})},
        "accept": {"quantile": [{"output": "position_north", "probability": 0.95, "below": "1 m"}]},
        **changes,
    }  # fmt: skip


def once_measured(limit: str) -> dict[str, Any]:
    """Describe an altitude of 5 m that is measured once with 2 m, behind a gate of 99 %."""
    return {
        "samples": 20_000,
        "scenario": {"type": "ins", "trajectory": {
            "rate": "1 Hz", "start": {"latitude": "47 deg", "longitude": "9 deg", "altitude": "500 m"},
            "segments": [{"hold": "10 s"}],
        }},
        "imu": {},
        "errors": {"position_down": "5 m", "position_north": "1 mm"},
        "aiding": [{"type": "altimeter", "instants": ["10 s"], "altitude": "2 m"}],
        "filter": {"estimates": ["position", "velocity", "attitude"], "gate": 0.99},
        "accept": {"quantile": [{"output": "position_down", "probability": 0.99, "below": limit}]},
    }  # fmt: skip


def answered(content: dict[str, Any]) -> tuple[LinearAnswer, Any]:
    """Return the linear answer, and ``lincov.json``."""
    answer = linear_covariance(parse_campaign(content, "mine.toml", "mine"))
    return answer, lincov_table(answer)


def test_a_gate_that_may_lose_the_fixes_withholds_the_verdicts() -> None:
    """Linear analysis is consistent to four digits, while samples have 50 m: it must not say so."""
    answer, table = answered(at_rest(0.9))
    gates = table["gates"]
    assert gates["verdict"] == "refused"
    assert gates["expected_rejections_least"] == pytest.approx(50.9)
    assert gates["accepted_by_all"] == pytest.approx(0.9**509)
    again = [gates["first"][k]["next"] for k in (0, 1, 2, 400)]
    assert again == pytest.approx([0.764, 0.232, 0.163, 0.109], abs=5e-4)
    # the first rejection is forgotten; without a further fix there are some hundred metres
    np.testing.assert_allclose(gates["rms_one_rejection"], answer.sigma, rtol=1e-4)
    assert 400.0 < gates["rms_never_again"][0] < 600.0
    assert table["filter"]["verdict"] == "undecided"
    assert table["requirements"][0]["met"] is None
    said = [words for words, _ in statements(answer)]
    assert "Gates reject about 51 of 509 good measurements in each flight" in said[0]
    assert "rejected too with up to 76 %" in said[0]
    assert not any("is consistent:" in words or "is met" in words for words in said)
    ungated, without = answered(at_rest(None))
    assert without["filter"]["verdict"] == "consistent"
    assert without["requirements"][0]["met"] is True
    assert "gates" not in without
    np.testing.assert_array_equal(answer.sigma, ungated.sigma)


def test_flights_that_begin_with_a_rejection_answer_what_laws_leave_open() -> None:
    """A gate of 0.999: fixes are hardly lost, which laws cannot know, and 1,000 flights show within 5 %."""
    campaign = parse_campaign(at_rest(0.999), "mine.toml", "mine")
    answers = linear_covariance(campaign), linear_covariance(campaign, gates=None)
    assert [answer.rejections.verdict for answer in answers if answer.rejections] == ["refused", "holds"]
    answer = answers[1]
    assert answer.filter is not None
    assert answer.filter.verdict == "consistent"
    gates: Any = lincov_table(answer)["gates"]
    assert gates["by_flights"]["flights"] == 1_000
    np.testing.assert_allclose(gates["by_flights"]["rms"], answer.sigma, rtol=0.05)


def test_flights_that_begin_with_a_rejection_are_those_of_samples() -> None:
    """Mean squares of 6,000 samples of the compiled filter, which reject fixes at a gate of 0.6, within both errors."""
    campaign = parse_campaign(content(gate=0.6), "mine.toml", "mine")
    scenario, errors = campaign.scenario, campaign.errors
    laws = scenario.rejection_laws(errors.mean, errors.covariance, scenario.reading_times[-1:])
    (excess,), (own_error,) = laws.fly(4_000)
    draws = DrawPlan(campaign.errors, "random", 1, 6_000)
    engine = campaign.scenario.engine("ensemble", draws.probes())
    squares = engine.simulate(draws.batch(0, 6_000)).values ** 2
    expected, error = squares.mean(axis=0), squares.std(axis=0) / np.sqrt(len(squares))
    variances = laws.readings[-1].variances
    assert np.all(np.sqrt(expected[:3]) > 1.2 * np.sqrt(variances[:3]))
    apart = np.hypot(error, own_error)
    assert np.all(np.abs(variances + excess - expected) < stats.norm.isf(0.5 * FALSE_ALARM / len(apart)) * apart)


ALPHA = 1e-4
FIXES = (12.0, 14.0, 16.0, 18.0, 20.0, 30.0, 40.0, 50.0, 60.0)


def seldom_lost(samples: int) -> dict[str, Any]:
    """Describe a speed of 0.5 m/s that centimetres measure: a flight whose first fix is rejected rejects them all."""
    trajectory = {"rate": "1 Hz", "start": {"latitude": "47 deg", "longitude": "9 deg", "altitude": "500 m"},
                  "segments": [{"hold": "60 s"}]}  # fmt: skip
    return {
        "samples": samples,
        "scenario": {"type": "ins", "trajectory": trajectory},
        "imu": {},
        "errors": {"velocity_north": "0.5 m/s", "position_east": "1 mm"},
        "aiding": [{"type": "gnss", "instants": [f"{time:g} s" for time in FIXES], "position": {"north": "1 cm"}}],
        "filter": {"estimates": ["position", "velocity", "attitude"], "gate": 1.0 - ALPHA},
    }


def lost_squares(count: int) -> np.ndarray:
    """Return squared positions, m^2, after the last fix by a filter of position and speed whose first fix is rejected.

    Its whitened innovation is drawn from the tail beyond the gate, and the speed by its law given that innovation.
    Gravity changes them by the square of 60 s over the Schuler period's 806 s, less than 1 %.
    """
    rng, limit = np.random.default_rng(3), stats.chi2.isf(ALPHA, 1)
    first, noise, variance = FIXES[0], 1e-4, 0.25
    total = first**2 * variance + noise
    innovations = np.sqrt(total * stats.chi2.isf(ALPHA * rng.random(count), 1)) * rng.choice([-1.0, 1.0], count)
    gain = first * variance / total
    speeds = gain * innovations + np.sqrt(variance - gain**2 * total) * rng.standard_normal(count)
    states = np.column_stack([first * speeds, speeds])  # errors of the filter, which has taken nothing
    covariances = np.tile(variance * np.array([[first**2, first], [first, 1.0]]), (count, 1, 1))
    for step in np.diff(FIXES):
        move = np.array([[1.0, step], [0.0, 1.0]])
        states, covariances = states @ move.T, move @ covariances @ move.T
        innovations = states[:, 0] + np.sqrt(noise) * rng.standard_normal(count)
        totals = covariances[:, 0, 0] + noise
        gains = np.where((innovations**2 > limit * totals)[:, None], 0.0, covariances[:, :, 0] / totals[:, None])
        states -= gains * innovations[:, None]
        covariances -= totals[:, None, None] * gains[:, :, None] * gains[:, None, :]
    return np.asarray(states[:, 0] ** 2)


def test_a_run_says_what_its_samples_are_too_few_to_show(tmp_path: Path) -> None:
    """One flight in ten thousand is lost, which multiplies the rms by 200: 200 samples agree with linear analysis.

    Other first rejections cause less than a thousandth of the mean square. By 400,000 samples of a flight five times as
    long the ratio is 222 (177 to 273), by its flights that begin with a rejection 202.
    """
    campaign = parse_campaign(seldom_lost(200), "mine.toml", "mine")
    summary = run_campaign(campaign, tmp_path, "ensemble", 1).summary
    assert summary["verdict"] == "agrees"
    (remark,) = (remark for remark in summary["remarks"] if "begin with a rejection" in remark)
    assert "linear sigmas do not hold" in remark
    assert "These samples cannot show it: about 0.18 of 200 have a rejection" in remark
    assert remark in (tmp_path / "report.html").read_text(encoding="utf-8")
    _, rejections = rejections_of(campaign.scenario, campaign.errors, campaign.tolerance, fly=None)
    assert rejections is not None
    flown, squares = rejections.by_flights, lost_squares(20_000)
    assert flown is not None
    expected = np.sqrt(ALPHA * squares.mean())
    own_error = 0.5 * expected * squares.std() / squares.mean() / np.sqrt(len(squares))
    apart = stats.norm.isf(0.5 * FALSE_ALARM) * np.hypot(own_error, flown.error[0])
    assert abs(flown.rms[0] - expected) < apart + 0.01 * expected
    assert DoubtAboutGates.of(campaign.with_overrides({"samples": 40_000})).unseen == ()


def test_samples_show_the_lockout_that_linear_analysis_cannot(tmp_path: Path) -> None:
    """Of 40,000 flights of another simulation a filter rejects 12.3 % of good measurements, and errs by 50.6 m (rms).

    One flight in 140 ends without fixes, which multiplies the share it rejects: the share has a standard deviation of
    0.065 from one flight to another.
    """
    campaign = parse_campaign({**at_rest(0.9), "samples": 2_000}, "mine.toml", "mine")
    summary = run_campaign(campaign, tmp_path, "ensemble", 1).summary
    rejected = summary["filter"]["sensors"]["gnss"]["rejected"] / 509
    assert abs(rejected - 0.123) < stats.norm.isf(0.5 * FALSE_ALARM) * 0.065 / np.sqrt(campaign.samples)
    low, high = summary["sigma_ratio_paired_interval"][0]
    assert low < 50.6 / 0.36566 < high
    assert summary["verdict"] != "agrees"
    written = (tmp_path / "report.html").read_text("utf-8")
    assert "linear analysis accepts all" in written


def test_one_measurement_at_a_gate_is_judged_exactly(tmp_path: Path) -> None:
    """Check values of a mixture, and 20,000 samples at a false alarm of 1e-4."""
    answer, table = answered(once_measured("6 m"))
    gates, (required,) = table["gates"], table["requirements"]
    assert gates["verdict"] == "fails"
    assert gates["rms_one_rejection"][2] == pytest.approx(2.2956, abs=5e-5)
    assert gates["rms_never_again"][2] == pytest.approx(2.2956, abs=5e-5)
    assert gates["rms_one_rejection"][2] / answer.sigma[2] == pytest.approx(1.2362, abs=5e-5)
    assert required["exceedance"] == pytest.approx(0.0112, abs=5e-5)
    assert required["met"] is False
    wide = answered(once_measured("8 m"))[1]["requirements"][0]
    assert wide["met"] is True
    assert wide["value"] == required["value"]
    campaign = parse_campaign(once_measured("6 m"), "mine.toml", "mine")
    draws = DrawPlan(campaign.errors, campaign.design, campaign.seed, campaign.samples)
    engine = campaign.scenario.engine("ensemble", draws.probes())
    down = np.abs(engine.simulate(draws.batch(0, campaign.samples)).values[:, 2])
    for size, share in ((6.0, required["exceedance"]), (required["value"], 0.01)):
        low, high = stats.binom.ppf([0.5 * FALSE_ALARM, 1.0 - 0.5 * FALSE_ALARM], campaign.samples, share)
        assert low <= np.sum(down > size) <= high


def test_what_if_of_a_run_judges_no_requirement_where_gates_can_break_it(tmp_path: Path) -> None:
    """Sliders of a run add up linear covariances, which know nothing of rejections; so it is without a note of them."""
    run_campaign(parse_campaign({**once_measured("6 m"), "samples": 200}, "mine.toml", "mine"), tmp_path, "ensemble", 1)
    told = "a single rejection already multiplies the rms of position down by 1.24"
    assert f"{told}. So what you change here" in (tmp_path / "report.html").read_text()
    content = RunResult(tmp_path).content
    for note, words in ((content.manifest.model.gates, told), (None, "An earlier version made this run")):
        model = content.manifest.model.model_copy(update={"gates": note})
        what_if = what_if_of_run(replace(content, manifest=content.manifest.model_copy(update={"model": model})))
        assert what_if is not None
        assert what_if.requirements == ()
        assert words in what_if.gates


def test_a_gate_that_rejects_next_to_nothing_keeps_the_verdicts() -> None:
    short = {
        "type": "ins",
        "trajectory": {**at_rest(None)["scenario"]["trajectory"], "segments": [{"straight": "30 s"}]},
    }
    _, table = answered(at_rest(1.0 - 1e-7, scenario=short))
    assert table["gates"]["verdict"] == "holds"
    assert table["filter"]["verdict"] == "consistent"
    assert table["requirements"][0]["met"] is True


@pytest.mark.parametrize(
    ("changes", "told", "met"),
    [
        ({"filter": {**at_rest(0.9)["filter"], "believes": {"aiding": {"gnss": {"position": "0.5 m"}}}}},
         "The filter is not consistent, so only samples show", None),
        ({"filter": {**at_rest(0.9)["filter"], "considers": ["gyro_bias"]},
          "imu": {"gyro": {"bias": "1 deg/h", "angle_random_walk": "0.1 deg/sqrt(h)"}}},
         "The filter considers errors without estimating them", None),
        ({"faults": [{"kind": "spike", "sensor": "gnss", "component": "position_north", "begin": "60 s",
                      "size": "14 m"}]}, "Sensors have faults", None),
        ({"accept": {"quantile": [{"output": "position_north", "probability": 0.95, "below": "0.5 m"}]}},
         "Linear analysis cannot say", False),
    ],
)  # fmt: skip
def test_what_linear_analysis_does_not_know_of_gates(changes: dict[str, Any], told: str, met: bool | None) -> None:
    """Rejections of good measurements make nothing better: what is not met without them stays so."""
    answer, table = answered(at_rest(0.9, **changes))
    assert table["gates"]["verdict"] == "refused"
    assert told in table["gates"]["line"]
    assert any(told in words for words, _ in statements(answer))
    assert table["requirements"][0]["met"] is met
    assert table["filter"]["verdict"] != "consistent"


def test_other_studies_judge_no_limit_where_a_gate_may_lose_the_fixes() -> None:
    content = at_rest(0.9)
    with pytest.raises(CampaignError, match=r"filter\.gate: Gates reject about 51 of 509 good measurements"):
        allocate(content, confirm=0)
    sweep = run_sweep(content, SweepPlan({"aiding.gnss.position.north": "0.5 m .. 2 m"}, points=2))
    assert np.isnan(sweep.margins).all()
    assert not sweep.just_met
    assert any("Gates reject about 51 of 509 good measurements" in words for words in remarks(sweep))
