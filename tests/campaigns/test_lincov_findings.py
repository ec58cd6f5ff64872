"""What `mcnav lincov` says first: filter, mean errors, range of linear analysis, and causes at their own instants."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from mcnav import linear_covariance
from mcnav.config.read import Campaign, parse_campaign, read_campaign
from mcnav.report.document.terminal_parts import printed
from mcnav.report.format import number
from mcnav.report.pages.lincov import statements
from mcnav.report.pages.lincov_page import terminal
from mcnav.report.statements import verdicts
from mcnav.report.terminal.terminal import comparison
from mcnav.studies.lincov import write_lincov
from mcnav.workflow.run import run_campaign

CAMPAIGNS = Path(__file__).parents[2] / "campaigns"

GNSS: dict[str, Any] = {
    "name": "Straight flight with GNSS",
    "samples": 100,
    "tolerance": "20 %",
    "scenario": {
        "type": "ins",
        "platform": "level",
        "trajectory": {
            "rate": "0.5 Hz",
            "start": {"latitude": "40 deg", "longitude": "-75 deg", "altitude": "0 m", "course": "60 deg",
                      "speed": "30 m/s"},
            "segments": [{"straight": "6 km"}],
        },
    },
    "imu": {
        "gyro": {"bias": "0.01 deg/h", "angle_random_walk": "0.002 deg/sqrt(h)"},
        "accelerometer": {"bias": "100 ug", "velocity_random_walk": "20 ug/sqrt(Hz)"},
    },
    "errors": {"position": "5 m", "velocity": "0.1 m/s", "tilt": "0.1 mrad", "heading": "1 mrad"},
    "aiding": [{"type": "gnss", "interval": "1 s", "position": "1 m", "velocity": "0.1 m/s",
                "lever_arm": ["1 m", "0 m", "0 m"]}],
    "filter": {"estimates": ["position", "velocity", "attitude", "gyro_bias", "accelerometer_bias"]},
}  # fmt: skip


def described(**changes: Any) -> Campaign:
    return parse_campaign(GNSS | changes, "gnss.toml", "gnss")


def adrift(hours: float, **changes: Any) -> Campaign:
    """Return a campaign of an unaided flight at 10 m/s."""
    trajectory = GNSS["scenario"]["trajectory"]
    flight = {**trajectory, "rate": "0.05 Hz", "start": {**trajectory["start"], "speed": "10 m/s"},
              "segments": [{"straight": f"{36.0 * hours} km"}]}  # fmt: skip
    imu = {"gyro": {"bias": "0.01 deg/h"}, "accelerometer": {"bias": "100 ug"}}
    entries = {key: value for key, value in GNSS.items() if key not in ("aiding", "filter")}
    scenario = {**GNSS["scenario"], "trajectory": flight}
    return parse_campaign(entries | {"scenario": scenario, "imu": imu} | changes, "adrift.toml", "adrift")


def shown(found: Any) -> str:
    console = Console(width=400)
    with console.capture() as captured:
        console.print(printed(terminal(found)))
    return captured.get()


def test_an_optimistic_filter_comes_first_with_factor_time_and_cause(tmp_path: Path) -> None:
    """Factor and time are those of the largest ratio of the two sigmas of the rows in the file."""
    found, (table, page) = write_lincov(read_campaign(CAMPAIGNS / "20_flight_with_neglected_errors.toml"), tmp_path)
    stored = json.loads(table.read_text())
    ratios = np.array([row["sigma"] for row in stored["rows"]]) / [row["sigma_filter"] for row in stored["rows"]]
    times = np.array([row["time"] for row in stored["rows"]])
    judged = stored["filter"]
    place = stored["outputs"].index(judged["output"])
    assert judged["verdict"] == "optimistic"
    assert judged["factor"] == pytest.approx(ratios[times == judged["worst"], place].max(), rel=1e-12)
    assert judged["factor"] >= 0.99 * ratios.max()
    assert judged["begin"] == times[(ratios > 1.2).any(axis=1)][0]
    assert judged["causes"][0]["name"].startswith("gyro_misalignment")
    words, tone = statements(found)[0]
    assert tone == "differs"
    assert words.startswith(
        "The filter is optimistic by a factor of 13 from 1 min on. It is worst in tilt east, at 34 min. "
    )
    assert "Largest unmodelled errors: gyro misalignment" in words
    assert shown(found).startswith(words)
    assert f'<p class="headline">{words}.</p>' in page.read_text()


def test_a_matched_filter_is_consistent_at_every_reading(tmp_path: Path) -> None:
    found, (table, _) = write_lincov(described(), tmp_path)
    assert json.loads(table.read_text())["filter"]["verdict"] == "consistent"
    assert found.filter is not None
    assert found.filter.factor == pytest.approx(1.0, abs=1e-6)  # the two covariances agree to 1e-9
    assert any(words.startswith("The filter is consistent") for words, _ in statements(found))


def test_a_wrong_lever_arm_shows_as_a_mean_error(tmp_path: Path) -> None:
    """The arm is 1 m longer downwards than the navigator knows, who estimates the position 1 m too high."""
    campaign = described(errors=GNSS["errors"] | {"gnss_lever_arm_z": {"distribution": "fixed", "value": "1 m"}})
    found, (table, page) = write_lincov(campaign, tmp_path)
    stored = json.loads(table.read_text())
    down = stored["outputs"].index("position_down")
    mean = stored["rows"][-1]["mean"][down]
    assert mean == pytest.approx(-1.0, abs=0.01)
    assert stored["rows"][-1]["mean_by_cause"]["gnss_lever_arm_z"][down] == pytest.approx(mean, rel=1e-12)
    assert stored["mean_by_cause"]["gnss_lever_arm_z"][down] == pytest.approx(mean, rel=1e-9)
    assert stored["filter"]["verdict"] == "optimistic"
    assert stored["filter"]["output"] == "position_down"
    assert stored["filter"]["causes"][0]["name"] == "mean_of_gnss_lever_arm_z"
    row = next(row for row in stored["rows"] if row["time"] == stored["filter"]["worst"] and row["update"] != "before")
    true = np.hypot(row["sigma"][down], row["mean"][down])
    assert stored["filter"]["factor"] == pytest.approx(true / row["sigma_filter"][down], rel=0.01)
    for text in (shown(found), page.read_text()):
        assert "The mean error of position down is −1.000 m, 4.94 times its sigma of 0.202 m" in text
        assert "Causes: mean of gnss lever arm z 100 %" in text


def test_causes_are_those_of_the_number_beside_them(tmp_path: Path) -> None:
    """Before the first fix the position error is the initial one; at the end it is noise of GNSS."""
    found, (table, page) = write_lincov(described(), tmp_path)
    text = page.read_text()
    end, largest = shown(found).split("Largest over time")
    (line,) = (line for line in largest.splitlines() if line.startswith("position north"))
    assert "initial position north 100 %" in line
    (line,) = (line for line in end.splitlines() if line.startswith("position north"))
    assert "gnss position noise north" in line
    assert "initial position north 100\N{NO-BREAK SPACE}%" in text
    stored = json.loads(table.read_text())
    row, north = stored["rows"][0], stored["outputs"].index("position_north")
    assert row["sigma"][north] == max(each["sigma"][north] for each in stored["rows"])
    assert row["variance_by_cause"]["position_north"][north] == pytest.approx(row["sigma"][north] ** 2, rel=1e-12)


@pytest.fixture(scope="module")
def run_of_19(tmp_path_factory: pytest.TempPathFactory) -> tuple[Campaign, Path]:
    """Campaign 19 with few samples, and the folder of its run with a report."""
    entries = tomllib.loads((CAMPAIGNS / "19_flight_with_gnss.toml").read_text())
    campaign = parse_campaign(entries | {"samples": 16}, str(CAMPAIGNS / "again.toml"), "again")
    folder = tmp_path_factory.mktemp("19") / "run"
    run_campaign(campaign, folder, None, 1)
    return campaign, folder


def test_causes_of_a_requirement_are_at_its_tightest_instant(run_of_19: tuple[Campaign, Path], tmp_path: Path) -> None:
    """Over an outage: shares in the variance of that instant, in `lincov` and in `run` alike."""
    campaign, folder = run_of_19
    found, (table, _) = write_lincov(campaign, tmp_path)
    stored = json.loads(table.read_text())
    tight = stored["requirements"][0]
    row = [row for row in stored["rows"] if row["time"] == tight["time"]][-1]
    outputs = [stored["outputs"].index(name) for name in tight["outputs"]]
    total = sum(row["sigma"][output] ** 2 for output in outputs)
    for cause in tight["causes"]:
        share = sum(row["variance_by_cause"][cause["name"]][output] for output in outputs) / total
        assert cause["share"] == pytest.approx(share, rel=1e-9)
    at_the_end = [found.budget.shares[outputs[0], found.causes.index(cause["name"])] for cause in tight["causes"][:1]]
    assert tight["causes"][0]["share"] > 2.0 * at_the_end[0]
    summary = json.loads((folder / "summary.json").read_text())
    for own, entry in zip(stored["requirements"], summary["requirements"], strict=True):
        if np.isclose(entry["time"] * 60.0, own["time"]):  # the samples' largest quantile may be at another epoch
            assert [each["name"] for each in entry["causes"]] == [each["name"] for each in own["causes"]]
            np.testing.assert_allclose(
                [each["share"] for each in entry["causes"]], [each["share"] for each in own["causes"]], rtol=1e-6
            )
    assert summary["requirements"][0]["causes"]


def test_a_report_has_the_causes_of_the_largest_sigma_beside_it(run_of_19: tuple[Campaign, Path]) -> None:
    """At the end of the outage of campaign 19 the north position error is of the gyros, at the end of GNSS."""
    campaign, folder = run_of_19
    page = (folder / "report.html").read_text()
    row = page.partition('class="answers filtered"')[2].partition("position north")[2].partition("</tr>")[0]
    at_the_end, _, largest = row.rpartition("<small>")
    history = linear_covariance(campaign).history
    assert history is not None
    worst = 1 + int(np.argmax(history.sigma[1:, 0]))
    shares = {name: values[worst, 0] / history.sigma[worst, 0] ** 2 for name, values in history.variances.items()}
    name = max(shares, key=lambda cause: shares[cause])
    assert name.startswith("gyro_angle_random_walk")
    assert f"{name.replace('_', ' ')}\N{NO-BREAK SPACE}{100.0 * shares[name]:.0f}\N{NO-BREAK SPACE}%" in largest
    assert "gnss position noise north" in at_the_end


def test_linear_analysis_finds_one_wrong_sigma_of_a_filter_of_ones_own(tmp_path: Path) -> None:
    """Of two outputs with unit sigma the filter states 1 and 1 / 1.2; one has a limit of 0.5 in another campaign."""
    code = """
import numpy as np
from mcnav import Epochs, Simulated, Output, Source


class Two:
    sources = (Source("a", "m", "m", 1.0), Source("b", "m", "m", 1.0))
    outputs = (Output("x", "m", "m"), Output("y", "m", "m", LIMIT))
    epochs = Epochs("time [min]", np.arange(3.0))

    def fly(self, errors, noise):
        noise.standard_normal()
        covariance = np.diag([1.0, 1.0 / 1.44])
        return Simulated(np.tile(errors, (3, 1)), np.tile(covariance, (3, 1, 1)))

    def noise_covariance(self):
        return np.zeros((3, 2, 2))

    def partials(self):
        return np.tile(np.eye(2), (3, 1, 1))
"""
    for limit, name in (("None", "two"), ("0.5", "limited")):
        (tmp_path / f"{name}.py").write_text(code.replace("LIMIT", limit))
    entries = {"errors": {"a": "1 m", "b": "1 m"}, "tolerance": "5 %"}
    two, limited = (
        linear_covariance(
            parse_campaign(entries | {"scenario": {"type": f"{name}.py:Two"}}, str(tmp_path / f"{name}.toml"), name)
        )
        for name in ("two", "limited")
    )
    assert two.filter is not None
    assert (two.filter.verdict.value, two.filter.output) == ("optimistic", "y")
    assert two.filter.factor == pytest.approx(1.2, rel=1e-9)
    assert limited.beyond is not None
    assert limited.beyond.outputs == (1,)
    assert "beyond linear range" in shown(limited)


def test_numbers_beyond_the_range_of_linear_analysis_are_not_shown(tmp_path: Path) -> None:
    """An unaided altitude grows as exp(sqrt(2 g / R) t): 100 ug reach the earth's radius within 2 h.

    A requirement at an epoch before is judged, one at the end is not.
    """
    pair = ["position_north", "position_east"]
    accept = {"cep": [{"outputs": pair, "below": "50 km"}, {"outputs": pair, "below": "50 km", "at": "2880 s"}]}
    found, (table, page) = write_lincov(adrift(24.0, accept=accept), tmp_path)
    stored = json.loads(table.read_text())
    down = stored["outputs"].index("position_down")
    first = next(row for row in stored["rows"] if row["beyond_range"])
    before = stored["rows"][stored["rows"].index(first) - 1]
    assert stored["beyond_range"]["begin"] == first["time"]
    assert "position_down" in stored["beyond_range"]["outputs"]
    assert before["sigma"][down] <= 6_378_140.0 < first["sigma"][down]
    assert all(row["beyond_range"] == (row["time"] >= first["time"]) for row in stored["rows"])
    assert stored["sigma"][down] > 1e60  # files keep the numbers, and say that they have no meaning
    assert [each["met"] for each in stored["requirements"]] == [None, True]
    words, tone = statements(found)[0]
    assert (words[:59], tone) == ("Errors are beyond the range of linear analysis from 120 min", "differs")
    for text in (shown(found), page.read_text()):
        assert "beyond linear range" in text
        assert not re.search(r"\de\+[1-9]|10[¹²³⁴⁵⁶⁷⁸⁹][⁰¹²³⁴⁵⁶⁷⁸⁹]", text)  # no number of 10^10 or more
    asked = linear_covariance(adrift(24.0), np.array([3600.0, 80_000.0]))
    assert "beyond linear range" in shown(asked)


def test_a_run_beyond_the_range_of_linear_analysis_says_no(tmp_path: Path) -> None:
    campaign = adrift(3.0, samples=16)
    summary = run_campaign(campaign, tmp_path / "run", None, 1).results
    page = (tmp_path / "run" / "report.html").read_text()
    begin = linear_covariance(campaign).beyond
    assert begin is not None
    assert begin.time is not None
    assert summary.beyond_range is not None
    assert summary.beyond_range.begin is not None
    assert summary.beyond_range.begin * 60.0 == pytest.approx(begin.time)
    said = f"No: errors are beyond the range of linear analysis from {begin.time / 60.0:.3g} min on (velocity down)."
    assert verdicts.headline(summary) == said
    assert said in page
    down = summary.sigma_linear[2]
    assert down > 6_378_140.0
    console = Console(width=400)
    with console.capture() as captured:
        console.print(comparison({"": summary}))
    for text in (captured.get(), page):
        assert number(down, 5) not in text
        assert f"{down:.5g}" not in text


def test_errors_within_the_range_are_shown() -> None:
    found = linear_covariance(adrift(0.5))
    assert found.beyond is None
    assert "beyond" not in shown(found)
