"""A smoother in a campaign: what linear analysis says of it, and what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats

from mcnav.config.campaign import Campaign
from mcnav.config.read import parse_campaign
from mcnav.contract.scenario import ScenarioError
from mcnav.errors import CampaignError
from mcnav.report.columns.tables_over_time import tables_over_time
from mcnav.report.pages.lincov import statements
from mcnav.report.pages.lincov_page import reading_table
from mcnav.runner.draws import DrawPlan
from mcnav.statistics.order_statistics import RankedSizes
from mcnav.store.run_folder import RunFolder
from mcnav.studies.lincov import lincov_table
from mcnav.studies.linear_answers import answer_linearly
from mcnav.studies.sweep_points import campaign_requirements
from mcnav.workflow.analyse import analyse
from mcnav.workflow.index import write_index
from mcnav.workflow.run import run_campaign


def content(**changes: Any) -> dict[str, Any]:
    """Describe two minutes in a straight line with positions each 5 s."""
    straight = {"rate": "1 Hz", "start": {"latitude": "47 deg", "longitude": "9 deg", "altitude": "1 km",
                "speed": "50 m/s"}, "segments": [{"straight": "2 min"}]}  # fmt: skip
    states = ["position", "velocity", "attitude", "accelerometer_bias"]
    return {
        "samples": 100,
        "scenario": {"type": "ins", "trajectory": straight},
        "imu": {"accelerometer": {"bias": "1 mg", "velocity_random_walk": "1 mg/sqrt(Hz)"}},
        "errors": {"position": "10 m", "velocity": "0.5 m/s", "tilt": "1 mrad", "heading": "5 mrad"},
        "aiding": [{"type": "position-fix", "interval": "5 s", "position": "3 m"}],
        "filter": {"estimates": states, "smoother": "fixed-interval", **changes},
    }


def test_a_matched_smoother_claims_what_is_true_and_less_than_its_filter() -> None:
    campaign = parse_campaign(content(), "mine.toml", "mine")
    table = lincov_table(answer_linearly(campaign))
    rows: Any = table["rows"]
    for row in rows:
        np.testing.assert_allclose(row["sigma_smoothed"], row["sigma_smoother"], rtol=1e-9)
        assert np.all(row["sigma_smoothed"] <= row["sigma"] * (1.0 + 1e-9))
        variances = sum(row["smoothed_variance_by_cause"].values())
        np.testing.assert_allclose(np.sqrt(variances), row["sigma_smoothed"], rtol=1e-9)
    middle = rows[len(rows) // 2]
    assert np.all(middle["sigma_smoothed"][:6] < 0.8 * middle["sigma"][:6])
    np.testing.assert_allclose(rows[-1]["sigma_smoothed"], rows[-1]["sigma"], rtol=1e-9)
    said = " ".join(words for words, _ in statements(answer_linearly(campaign)))
    assert "The smoother is consistent" in said
    assert "worse" not in said


def test_times_that_are_asked_for() -> None:
    """Between measurements and at one, where it is the same before and after the update."""
    answer = answer_linearly(parse_campaign(content(), "mine.toml", "mine"), np.array([31.0, 50.0]))
    rows: Any = lincov_table(answer)["rows"]
    assert [(row["time"], row["update"]) for row in rows] == [(31.0, None), (50.0, "before"), (50.0, "after")]
    np.testing.assert_allclose(rows[1]["sigma_smoothed"], rows[2]["sigma_smoothed"], rtol=1e-9)
    assert answer.smoothed is not None
    assert answer.history is not None
    assert len(answer.smoothed.readings.times) == len(answer.history.readings.times)
    assert answer.asked is not None
    assert [row.what for row in reading_table(answer, answer.asked).rows][:4] == [
        "true", "filter's", "smoothed", "smoother's",
    ]  # fmt: skip


def test_a_mismatched_one_is_told() -> None:
    """It believes in a tenth of the noise."""
    campaign = parse_campaign(
        content(believes={"aiding": {"position_fix": {"position": "0.3 m"}}}), "mine.toml", "mine"
    )
    said = " ".join(words for words, _ in statements(answer_linearly(campaign)))
    assert "The smoother is optimistic" in said


def test_samples_of_it_in_a_run(tmp_path: Path) -> None:
    """Of a smoother that believes in a tenth of the noise, by default with gains along the truth."""
    mistaken = content(believes={"aiding": {"position_fix": {"position": "0.3 m"}}}, smoother={"lag": "30 s"})
    limited = {"outputs": ["position_north", "position_east"], "below": "3.2 m", "at": "60 s"}
    accept = {
        "r95": [limited, {**limited, "of": "smoother"}, {**limited, "of": "smoother", "during": ["20 s", "40 s"]}]
    }
    accept["r95"][2].pop("at")
    accept["quantile"] = [
        {"output": "heading", "below": "1 rad", "probability": 0.9999, "of": "smoother", "at": "20 s"}
    ]
    accept["sep"] = [{"outputs": [*limited["outputs"], "position_down"], "below": "9 m", "of": "smoother"}]
    campaign = parse_campaign({**mistaken, "accept": accept}, "mine.toml", "mine")
    summary = run_campaign(campaign, tmp_path, None, 1).summary
    _check_requirements(campaign, summary)
    assert summary["engine"] == "shared-gains"
    assert summary["smoother"]["verdict"] == "optimistic"
    assert summary["smoother_verdict"].startswith("The smoother is optimistic by a factor of")
    analysis = analyse(RunFolder(tmp_path))
    table = tables_over_time(analysis, "si")["smoother"]
    linear = campaign.scenario.smoothed()
    true = np.sqrt(np.diagonal(linear.covariance(campaign.errors.covariance), axis1=1, axis2=2))
    middle = [row for row in table.rows if row["output"] == "position_north"][len(linear.times) // 2]
    assert middle["rms_linear"] == pytest.approx(true[len(linear.times) // 2, 0], rel=1e-12)
    claimed = np.sqrt(linear.own[len(linear.times) // 2, 0, 0])
    assert middle["sigma_smoother"] == pytest.approx(claimed, rel=1e-9)
    assert middle["sigma_smoother_linear"] == pytest.approx(claimed, rel=1e-12)
    # 100 squares: 1e-4
    low, high = np.sqrt(stats.chi2.ppf([5e-5, 1.0 - 5e-5], 100) / 100)
    assert low < middle["rms"] / middle["rms_linear"] < high
    page = (tmp_path / "report.html").read_text()
    assert "Errors behind the smoother" in page
    assert "Smoother claims" in page
    assert ">smoother optimistic</span>" in write_index(tmp_path)[0].read_text()


def _check_requirements(campaign: Campaign, summary: Any) -> None:
    """Compare requirements behind the smoother with samples smoothed apart, and with linear analysis."""
    rare, filtered, smoothed, during, final = summary["requirements"]
    assert final["when"] == "behind the smoother"
    engine = campaign.scenario.engine("shared-gains", np.zeros((1, len(campaign.scenario.sources))))
    draws = DrawPlan(campaign.errors, campaign.design, campaign.seed, campaign.samples)
    history = engine.simulate(draws.batch(0, 100)).smoothed_history
    assert history is not None
    sizes = np.hypot(history[:, :, 0], history[:, :, 1])
    (epoch,) = smoothed["epochs"]
    assert engine.epochs.times[epoch] == pytest.approx(1.0)  # minutes
    assert smoothed["estimate"] == RankedSizes.of(sizes[:, epoch]).estimate(0.95) != filtered["estimate"]
    largest = max(RankedSizes.of(sizes[:, each]).estimate(0.95) for each in during["epochs"])
    assert during["estimate"] == largest
    assert smoothed["samples"] == 100
    linear = answer_linearly(campaign).requirements
    assert [each["linear"] for each in summary["requirements"]] == pytest.approx(
        [each.value for each in linear], rel=1e-9
    )
    assert smoothed["causes"] != filtered["causes"]
    assert rare["exceedance"]["refusal"] == "errors behind a smoother are counted alone"


def test_requirements_of_a_smoother() -> None:
    """A radius at a minute that lies between those of smoother and filter: met by the one, and not by the other."""
    outputs = ["position_north", "position_east"]
    limited = {"outputs": outputs, "below": "3 m", "at": "60 s"}
    accept = {"r95": [limited, {**limited, "of": "smoother"}]}
    described = {**content(), "accept": accept}
    answer = answer_linearly(parse_campaign(described, "mine.toml", "mine"))
    filtered, smoothed = answer.requirements
    assert not filtered.met
    assert smoothed.met
    assert answer.history is not None
    assert answer.smoothed is not None
    ratio = smoothed.value / filtered.value
    at = [int(each.settled[np.argmin(np.abs(each.readings.times[each.settled] - 60.0))])
          for each in (answer.history, answer.smoothed)]  # fmt: skip
    expected = answer.smoothed.sigma[at[1], :2].mean() / answer.history.sigma[at[0], :2].mean()
    assert ratio == pytest.approx(expected, rel=1e-3)  # circles, but for a difference of the two sigmas
    assert answer.requirement_causes(1) != answer.requirement_causes(0)
    without = {**described, "filter": {"estimates": content()["filter"]["estimates"]}}
    with pytest.raises(CampaignError, match="of: got 'smoother'; it needs smoother"):
        parse_campaign(without, "mine.toml", "mine")
    with pytest.raises(CampaignError, match="a sweep has no requirements of a smoother"):
        campaign_requirements(parse_campaign(described, "mine.toml", "mine"))


def test_what_is_refused() -> None:
    considering = content(considers=["accelerometer_scale_factor"])
    for described, told in (
        (considering, "filter.smoother: is not defined with considers"),
        (content(smoother="fixed-lag"), "filter.smoother: got 'fixed-lag'; expected \"fixed-interval\" or { lag"),
        (content(smoother={"lag": "-1 s"}), "filter.smoother.lag: got '-1 s'"),
    ):
        with pytest.raises(CampaignError) as refused:
            parse_campaign(described, "mine.toml", "mine")
        assert told in str(refused.value)
    scenario = parse_campaign(content(), "mine.toml", "mine").scenario
    for engine in ("ensemble", "reference"):
        with pytest.raises(ScenarioError, match=f'got engine = "{engine}"; samples are smoothed with "shared-gains"'):
            scenario.engine(engine, np.zeros((1, len(scenario.sources))))
