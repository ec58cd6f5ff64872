"""Boxes of campaigns: the worst and the best over ranges against brute grids, and what lincov and run say of them."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Mapping
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w

from mcnav import lincov, tune
from mcnav.analysis.box import Box
from mcnav.analysis.filter_consistency import Honesty
from mcnav.analysis.linear_answer import LinearAnswer
from mcnav.analysis.remedies import DOUBTED
from mcnav.arrays.types import Array
from mcnav.config.documents import UNNAMED
from mcnav.config.overrides import override
from mcnav.config.read import Campaign, campaign_from, parse_campaign
from mcnav.errors import CampaignError
from mcnav.report.pages.tune import verdict
from mcnav.report.statements.box import box_words
from mcnav.report.statements.sweep import remarks
from mcnav.studies import box as box_study
from mcnav.studies import boxed_run
from mcnav.studies import tune as tune_study
from mcnav.studies.allocate import allocate
from mcnav.studies.box import answer_box
from mcnav.studies.boxed_campaign import BoxedCampaign
from mcnav.studies.boxed_run import at_worst, campaign_to_run
from mcnav.studies.lincov import write_lincov
from mcnav.studies.linear_answers import answer_linearly
from mcnav.studies.live import LiveCampaign
from mcnav.studies.sweep import SweepPlan, run_sweep
from tests.commands import invoke

AIDED = tomllib.loads("""
name = "Two minutes at rest"
samples = 20
seed = 1
tolerance = "20 %"

[scenario]
type = "ins"
trajectory = { rate = "1 Hz", start = { latitude = "47 deg", longitude = "9 deg" }, segments = [{ hold = "120 s" }] }

[imu.gyro]
bias = "1 deg/h"
bias_instability = { sigma = "1 deg/h", correlation_time = "60 s" }
angle_random_walk = "0.1 deg/sqrt(h)"

[imu.accelerometer]
bias = "1 mg"
velocity_random_walk = "50 ug/sqrt(Hz)"

[errors]
position = "5 m"
velocity = "0.1 m/s"
tilt = "1 mrad"
heading = "5 mrad"

[[aiding]]
type = "gnss"
interval = "10 s"
outages = [["60 s", "90 s"]]
position = "3 m"
velocity = "0.1 m/s"

[filter]
estimates = ["position", "velocity", "attitude", "gyro_bias", "accelerometer_bias"]

[accept]
r95 = [{ outputs = ["position_north", "position_east"], below = "20 m", during = "outages" }]
quantile = [{ output = "heading", probability = 0.95, below = "20 mrad" }]
""")

SIZES = {
    "imu.gyro.bias": "0.1..2 deg/h",
    "imu.gyro.bias_instability.sigma": "0.2..1 deg/h",
    "imu.gyro.angle_random_walk": "0.05..0.2 deg/sqrt(h)",
    "imu.accelerometer.bias": "0.2..2 mg",
    "imu.accelerometer.velocity_random_walk": "20..100 ug/sqrt(Hz)",
    "errors.position": "1..5 m",
    "errors.tilt": "0.1..1 mrad",
    "errors.heading": "1..10 mrad",
    "aiding.gnss.position": "1..5 m",
    "aiding.gnss.velocity": "0.05..0.2 m/s",
}


def campaign_with(ranges: Mapping[str, Any]) -> Campaign:
    return parse_campaign(override(AIDED, ranges), UNNAMED, UNNAMED)


def measures(answer: LinearAnswer) -> Array:
    """Return sigmas, values of requirements, and the largest ratio of the filter."""
    ratio = 0.0 if answer.filter is None else float(np.nanmax(np.column_stack([answer.filter.ratios])))
    return np.array([*answer.sigma, *(row.value for row in answer.requirements), ratio])


def brute(campaign: Campaign, shares: Mapping[str, tuple[float, ...]]) -> Array:
    """Answer a grid by the engine, campaign by campaign."""
    boxed = BoxedCampaign(campaign)
    points = product(*(shares[spec.path] for spec in boxed.ranges))
    rows = []
    for point in points:
        values = [spec.span.at(share) for spec, share in zip(boxed.ranges, point, strict=True)]
        rows.append(measures(answer_linearly(boxed.at(boxed.setting(values)))))
    return np.array(rows)


def extremes(campaign: Campaign) -> tuple[Array, Array, Any]:
    box = answer_box(campaign, answer_linearly(campaign))
    assert box.filter is not None
    spreads = [*box.outputs, *box.requirements]
    worst = np.array([*(spread.worst.value for spread in spreads), box.filter.ratio.worst.value])
    return worst, np.array([spread.best.value for spread in spreads]), box


def test_ten_sizes_take_a_few_linear_answers_and_are_exact() -> None:
    """Corners of the box, at random, by the engine: none beyond the extremes, which two of them reach to 1e-6."""
    campaign = campaign_with(SIZES)
    worst, best, box = extremes(campaign)
    assert box.exact
    assert box.systems <= 5
    assert set(box.held) == set(SIZES)
    boxed, random = BoxedCampaign(campaign), np.random.default_rng(59)
    corners = [[0.0] * 10, [1.0] * 10, *random.integers(0, 2, (4, 10)).astype(float).tolist()]
    rows = np.array([
        measures(answer_linearly(boxed.at(boxed.setting(
            [spec.span.at(share) for spec, share in zip(boxed.ranges, corner, strict=True)]
        ))))
        for corner in corners
    ])  # fmt: skip
    assert rows.max(axis=0)[:-1] == pytest.approx(worst[:-1], rel=1e-6)
    assert rows.min(axis=0)[:-1] == pytest.approx(best, rel=1e-6)
    assert rows[:, -1].max() <= worst[-1] * (1.0 + 1e-9)
    assert [row.path for row in box.narrowed] == sorted(SIZES, key=[row.path for row in box.narrowed].index)
    assert box.narrowed[0].gain > 0.0


def test_what_is_not_monotone_is_never_below_a_grid(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A correlation time, and the end of an outage, with a size beside them; their cost is told within 1.5 times."""
    monkeypatch.setattr(box_study, "SLOW", 0.0)
    for key, written in (
        ("imu.gyro.bias_instability.correlation_time", "10..1000 s"),
        ("aiding.gnss.outages.1.2", "70..110 s"),
    ):
        ranges: dict[str, Any] = {key: written, "aiding.gnss.position": "1..5 m"}
        if key.endswith(".2"):
            ranges = {"aiding.gnss.outages": [["60 s", written]], "aiding.gnss.position": "1..5 m"}
        campaign = campaign_with(ranges)
        worst, best, box = extremes(campaign)
        assert not box.exact
        (told,) = re.findall(r"some (\d+) linear answers", capsys.readouterr().err)
        assert int(told) / 1.5 <= box.systems <= 1.5 * int(told)
        grid = {key: (0.0, 0.3, 1.0), "aiding.gnss.position": (0.0, 1.0)}
        rows = brute(campaign, grid)
        assert (worst >= rows.max(axis=0) * (1.0 - 1e-9)).all()
        assert (best <= rows.min(axis=0)[:-1] * (1.0 + 1e-9)).all()


def test_an_axis_of_a_list_is_a_size() -> None:
    """Ranges of single axes, one of them of a process: exact with the two systems of the examination besides."""
    bias, walk = ["0.1..2 deg/h", "1 deg/h", "1 deg/h"], ["0.1 deg/sqrt(h)", "0.05..0.2 deg/sqrt(h)", "0.1 deg/sqrt(h)"]
    campaign = campaign_with({"imu.gyro.bias": bias, "imu.gyro.angle_random_walk": walk})
    outputs = lincov(
        override(AIDED, {"imu.gyro.bias": bias, "imu.gyro.angle_random_walk": walk}), examine=False
    ).outputs
    worst, best, box = extremes(campaign)
    scales = np.where(outputs["unit"] == "mrad", 1e3, 1.0)
    assert outputs["sigma_worst"].to_numpy(float) == pytest.approx(worst[: len(outputs)] * scales, rel=1e-12)
    assert outputs["sigma_best"].to_numpy(float) == pytest.approx(best[: len(outputs)] * scales, rel=1e-12)
    assert (box.exact, box.systems) == (True, 3)
    rows = brute(campaign, dict.fromkeys(box.ranges, (0.0, 1.0)))
    assert worst[:-1] == pytest.approx(rows.max(axis=0)[:-1], rel=1e-6)
    assert best == pytest.approx(rows.min(axis=0)[:-1], rel=1e-6)


def test_gates_that_reject_good_measurements_are_the_reason_why_nothing_is_judged() -> None:
    """A gate of 99 % rejects a measurement in nine flights of a hundred: nothing over the ranges is then known."""
    campaign = campaign_with({"aiding.gnss.position": "1..5 m", "filter.gate": 0.99})
    answer = answer_linearly(campaign)
    box = answer_box(campaign, answer)
    assert box.gated == {"aiding.gnss.position": "5.0 m"}
    assert all(np.isnan([spread.worst.value, spread.best.value]).all() for spread in box.requirements)
    assert box.filter is not None
    assert Honesty.CONSISTENT not in (box.filter.optimistic.verdict, box.filter.pessimistic.verdict)
    reason, tone = box_words(replace(answer, box=box))[0]
    assert tone == "undecided"
    assert "gates reject good measurements with aiding.gnss.position = 5.00 m" in reason


def test_settings_of_a_dictionary_have_no_defaults_of_the_upper_ends() -> None:
    """A flight of 100 to 140 s ends with each setting, and not where the longest does."""
    flight = {
        "rate": "1 Hz",
        "start": {"latitude": "47 deg", "longitude": "9 deg"},
        "segments": [{"hold": "100..140 s"}],
    }
    boxed = BoxedCampaign(campaign_with({"scenario.trajectory": flight}))
    ends = [boxed.at(boxed.setting([length])).resolved["scenario"]["end"] for length in (100.0, 140.0)]
    assert ends == ["100.0 s", "140.0 s"]


def test_correlated_sizes_are_searched_without_further_linear_answers() -> None:
    """With a negative correlation a larger error may make the outputs smaller."""
    content = override(AIDED, {"errors.position_north": "1..5 m", "errors.velocity_north": "0.01..0.3 m/s"})
    content["correlations"] = [{"between": ["position_north", "velocity_north"], "coefficient": -0.9}]
    for key in ("aiding", "filter", "accept"):
        content.pop(key)
    campaign = parse_campaign(content, UNNAMED, UNNAMED)
    box = answer_box(campaign, answer_linearly(campaign))
    assert (box.exact, box.systems) == (False, 3)
    boxed = BoxedCampaign(campaign)
    settings = [
        boxed.setting([spec.span.at(share) for spec, share in zip(boxed.ranges, point, strict=True)])
        for point in product(np.linspace(0.0, 1.0, 5), repeat=2)
    ]
    rows = np.array([answer_linearly(boxed.at(setting)).sigma for setting in settings])
    assert (np.array([spread.worst.value for spread in box.outputs]) >= rows.max(axis=0) * (1.0 - 1e-9)).all()
    assert (np.array([spread.best.value for spread in box.outputs]) <= rows.min(axis=0) * (1.0 + 1e-9)).all()


def test_a_box_of_one_point_is_the_campaign_to_the_bit() -> None:
    plain = answer_linearly(campaign_with({}))
    campaign = campaign_with({"aiding.gnss.position": "3..3 m", "imu.gyro.bias": "1..1 deg/h"})
    answer = answer_linearly(campaign)
    box = answer_box(campaign, answer)
    assert [spread.worst.value for spread in box.outputs] == plain.sigma.tolist()
    assert [spread.best.value for spread in box.outputs] == plain.sigma.tolist()
    assert [spread.worst.value for spread in box.requirements] == [row.value for row in plain.requirements]
    assert (box.exact, box.settings, box.systems, box.varies) == (True, 1, 1, False)


def test_beliefs_that_are_stated_are_kept() -> None:
    """Others are held at the upper end, so that the filter is the same at all settings."""
    ranges = {"aiding.gnss.position": "1..5 m", "errors.heading": "1..10 mrad"}
    content = override(AIDED, ranges)
    content["filter"] = {**content["filter"], "believes": {"aiding": {"gnss": {"position": "2 m"}}}}
    boxed = BoxedCampaign(parse_campaign(content, UNNAMED, UNNAMED))
    assert boxed.held == ("errors.heading",)
    low = boxed.content(boxed.setting([spec.span.low for spec in boxed.ranges]))
    assert low["filter"]["believes"]["aiding"] == {"gnss": {"position": "2 m"}}
    assert low["filter"]["believes"]["errors"] == {"heading": "0.01 rad"}
    nominal = answer_linearly(boxed.nominal)
    other = answer_linearly(boxed.at(boxed.setting([spec.span.low for spec in boxed.ranges])))
    assert nominal.history is not None
    assert other.history is not None
    assert nominal.history.sigma_filter == pytest.approx(other.history.sigma_filter, rel=1e-12)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("box")
    ranges = {"aiding.gnss.position": "1..8 m", "imu.gyro.bias_instability.sigma": "0.2..1 deg/h"}
    (path / "box.toml").write_text(tomli_w.dumps(override(AIDED, ranges)), encoding="utf-8")
    return path


def test_lincov_and_run(folder: Path) -> None:
    """lincov.json has the keys; the run says first where it simulates, and its campaign has plain values."""
    answer, _ = write_lincov(campaign_from(folder / "box.toml"), folder / "lincov", examine=False)
    table = json.loads((folder / "lincov" / "lincov.json").read_text(encoding="utf-8"))
    assert table["worst"]["sigma"] == table["sigma"]
    assert table["worst"]["setting"]["heading"] == {
        "imu.gyro.bias_instability.sigma": "1.0 deg/h", "aiding.gnss.position": "8.0 m",
    }  # fmt: skip
    assert table["exact"] is True
    assert table["settings"] >= 4
    assert table["best"]["filter"]["verdict"] == "pessimistic"
    first = table["requirements"][0]
    assert first["best"] < first["worst"] == first["value"]
    assert first["setting"] == table["worst"]["setting"]["heading"]
    page = (folder / "lincov" / "lincov.html").read_text(encoding="utf-8")
    assert "Over the ranges, R95 of position north, position east is" in page
    assert "Exact: every value grows with every range" in page
    done = invoke("run", "box.toml", cwd=folder)
    assert done.returncode == 0
    assert done.stderr.startswith("note: the campaign has ranges; it is simulated at the worst setting")
    first, *_ = (folder / "reports" / "box" / "report.html").read_text(encoding="utf-8").partition("</header>")
    assert "Simulated at the worst setting by linear analysis: " in first
    stored = tomllib.loads((folder / "reports" / "box" / "campaign.toml").read_text(encoding="utf-8"))
    assert stored["aiding"][0]["position"] == "8.0 m"
    assert answer.box is not None
    refused = invoke("run", "../none.toml", "--at", "nominal", cwd=folder)
    assert refused.returncode == 2


def test_at_nominal_and_without_ranges(folder: Path) -> None:
    campaign = campaign_from(folder / "box.toml")
    nominal = campaign_to_run(campaign, "nominal", {})
    assert (nominal.ranges, nominal.resolved) == ((), campaign.resolved)
    assert nominal.remarks[0].startswith("the campaign has ranges; it is simulated at the upper ends: ")
    plain = campaign_with({})
    assert campaign_to_run(plain, None, {}) is plain


EARLY: dict[str, Any] = {"aiding.gnss.outages": [["50..85 s", "90 s"]], "aiding.gnss.position": "1..3 m"}
"""Ranges that are worst at the lower end of one: an outage that begins early."""


@pytest.fixture(scope="module")
def early() -> tuple[Campaign, LinearAnswer, Box]:
    """A campaign of these ranges, its answer, and its box, which is searched once."""
    campaign = campaign_with(EARLY)
    nominal = answer_linearly(campaign)
    return campaign, nominal, answer_box(campaign, nominal)


def test_studies_stand_at_the_worst_setting_and_say_so(
    early: tuple[Campaign, LinearAnswer, Box], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where the upper ends are not the worst: an outage from 50 s on is longer than one from 85 s on."""
    campaign, nominal, box = early
    monkeypatch.setattr(boxed_run, "_box", lambda boxed: box)  # each of the studies would search it again
    document, (remark,) = at_worst(campaign)
    assert document.content["aiding"][0]["outages"] == [["50.0 s", "90 s"]]
    assert "aiding.gnss.outages.1.1 = 50.0 s" in remark
    plain = answer_linearly(
        campaign_with({**EARLY, "aiding.gnss.outages": [["50 s", "90 s"]], "aiding.gnss.position": "3 m"})
    )
    worst = plain.requirements[1].value
    assert worst > 1.5 * nominal.requirements[1].value
    swept = run_sweep(campaign, SweepPlan({"imu.gyro.bias": "1, 2 deg/h"}, (), examine=False))
    assert swept.values[0, 1] == pytest.approx(worst, rel=1e-9)
    assert any(line.startswith("Ranges are at the worst setting") for line in remarks(swept))
    found = allocate(campaign, confirm=0, examine=False)
    assert found.answer.requirements[1].value == pytest.approx(worst, rel=1e-9)
    assert remark in capsys.readouterr().err


def test_live_has_bands_and_the_worst_setting(
    early: tuple[Campaign, LinearAnswer, Box], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Sizes have bands from end to end about the value at which they stand."""
    monkeypatch.setattr(boxed_run, "_box", lambda boxed: early[-1])
    (tmp_path / "box.toml").write_text(tomli_w.dumps(override(AIDED, EARLY)), encoding="utf-8")
    live = LiveCampaign(tmp_path / "box.toml", tmp_path, 1)
    page = live.page()
    assert "worst setting of the tightest requirement by linear analysis: aiding.gnss.outages.1.1 = 50.0 s" in page
    (slider,) = re.findall(r'{"path":"aiding.gnss.position"[^}]*}', page)
    low, high = json.loads(slider)["band"]
    assert (low, high) == pytest.approx((1.0 / 3.0, 1.0))
    live.tune(1, {"aiding.gnss.position": low})
    first, changed = live.state()["settings"]  # type: ignore[misc]
    assert float(changed["sigmas"][0]["shown"]) < float(first["sigmas"][0]["shown"])


def test_tune_bounds_a_memory_that_is_a_range_for_less_than_the_bounding_model(monkeypatch: pytest.MonkeyPatch) -> None:
    """No setting of the box is optimistic, at any reading; an answer by the engine at a setting between agrees.

    Inflations are found to 3 % only, and two correlation times are tried, which halves the filters that are answered.
    """
    monkeypatch.setattr(tune_study, "CLOSE", 1.03)
    monkeypatch.setattr(tune_study, "SHARES", (1.0, 0.5))
    campaign = campaign_with({"imu.gyro.bias_instability.correlation_time": "10..1000 s"})
    tuning = tune(campaign, confirm=False, examine=True)
    assert tuning.chosen is not None
    assert (tuning.chosen.ratio <= 1.0 + 1e-9, tuning.linearity) == (True, "holds")
    bounding = next(candidate for candidate in tuning.candidates if candidate.name == "bounding model")
    assert tuning.chosen.cost < bounding.cost
    assert tuning.closest.startswith("time ")
    assert tuning.box is not None
    assert tuning.box.filter is not None
    assert tuning.box.filter.optimistic.largest[0] == tuning.chosen.ratio
    said = (("", "agrees"), ("undecided", "agrees"), ("pessimistic", "agrees"), ("optimistic", "differs"))
    for confirmed, tone in said:
        assert verdict(replace(tuning, confirmed=confirmed, samples=500)).tone == tone
    believed: dict[str, Any] = {f"filter.believes.{belief.path}": belief.entry for belief in tuning.chosen.beliefs}
    content = override(AIDED, {"imu.gyro.bias_instability.correlation_time": "10..1000 s", **believed})
    boxed = BoxedCampaign(parse_campaign(content, UNNAMED, UNNAMED))
    answer = answer_linearly(boxed.at(boxed.setting([boxed.ranges[0].span.at(0.6)])))
    assert measures(answer)[-1] <= 1.0 + 1e-6


def test_tune_does_not_recommend_where_linear_analysis_is_not_shown_to_hold() -> None:
    """A heading known to 30 degrees: the filter bounds the linear errors, and samples alone can confirm it."""
    tuning = tune(campaign_with({"errors.heading": "5..30 deg"}), confirm=False, examine=True)
    assert tuning.chosen is not None
    assert tuning.linearity in DOUBTED
    said = verdict(tuning)
    assert said.tone == "undecided"
    assert "simulate this filter before you use it" in " ".join(said.sentences)
    assert verdict(replace(tuning, confirmed="consistent", samples=500)).tone == "agrees"
    assert verdict(replace(tuning, confirmed="undecided", samples=500)).tone == "undecided"
    unexamined = tune(campaign_with({"errors.heading": "5..30 deg"}), confirm=False, examine=False)
    assert (unexamined.linearity, unexamined.unexamined) == ("", "")


def test_tune_inflates_where_the_filter_neglects_errors() -> None:
    """Scale factors that are no states make it optimistic by 3.7; the cheapest inflation makes it pessimistic."""
    ranges = {"imu.gyro.scale_factor": "1000..5000 ppm", "imu.accelerometer.scale_factor": "1000..5000 ppm"}
    tuning = tune(campaign_with(ranges), confirm=False)
    assert tuning.before > 3.0
    assert tuning.chosen is not None
    assert tuning.chosen.ratio <= 1.0 + 1e-9
    assert all(belief.factor > 1.0 for belief in tuning.chosen.beliefs)
    assert tuning.believes


def test_tune_refuses_what_it_cannot_tune() -> None:
    with pytest.raises(CampaignError, match="has no ranges"):
        tune(campaign_with({}))
