"""``mcnav judge``: files of a recorded flight, the verdict on it, one line for each mistake."""

from __future__ import annotations

import json
import tomllib
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import mkdtemp
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from mcnav.cli import app
from mcnav.judgement.findings import CauseVerdict, Finding, OffsetVerdict
from mcnav.judgement.profile import Factor
from mcnav.judgement.verdict import Judgement
from mcnav.report.pages.judged import offset_words, to_paste, verdict
from tests.recorded_flights import SHORT

RUNNER = CliRunner()


@cache
def place() -> Path:
    return Path(mkdtemp(prefix="mcnav-judge-"))


@cache
def recorded(wrong: bool) -> Path:
    """Write a campaign, and the record of a flight that is its own, or one of three times the noise of the velocity."""
    folder = place() / ("wrong" if wrong else "right")
    folder.mkdir()
    (folder / "flight.toml").write_text(SHORT)
    (folder / "flown.toml").write_text(SHORT.replace('"5 cm/s"', '"15 cm/s"') if wrong else SHORT)
    run("judge", folder / "flown.toml", "--record", "--sample", 1, "--rate", 20, "--out", folder)
    return folder


def run(*arguments: object) -> str:
    result = RUNNER.invoke(app, [str(each) for each in arguments])
    assert result.exit_code == 0, result.output
    return result.output


def refused(*arguments: object) -> str:
    result = RUNNER.invoke(app, [str(each) for each in arguments])
    assert result.exit_code == 2
    assert len(result.output.strip().splitlines()) == 1
    return result.output


@cache
def judged(wrong: bool) -> tuple[str, dict[str, Any], str]:
    """Return what the terminal shows, ``judge.json`` and the page."""
    folder = recorded(wrong)
    shown = run(
        "judge", folder / "flight.toml", "--imu", folder / "imu.csv", "--measurements", f"gnss={folder / 'gnss.csv'}",
        "--reference", folder / "reference.csv", "--start", folder / "start.csv", "--records", 300,
        "--out", folder / "judge",
    )  # fmt: skip
    content = json.loads((folder / "judge" / "judge.json").read_text())
    return shown, content, (folder / "judge" / "judge.html").read_text()


def test_a_flight_of_the_campaign_raises_no_alarm() -> None:
    shown, content, page = judged(False)
    assert not content["alarm"]
    assert shown.startswith("Nothing in this record is at odds with the campaign.")
    assert content["findings"] == []
    assert "What to change" not in page


def test_noise_three_times_as_large_is_named_with_its_interval() -> None:
    shown, content, page = judged(True)
    assert content["alarm"]
    assert content["findings"][0]["number"] == "gnss_velocity_noise"
    (noise,) = (each for each in content["causes"] if each["name"] == "gnss_velocity_noise")
    assert noise["factor"]["low"] < 3.0 < noise["factor"]["high"]
    assert shown.startswith("The gnss velocity noise of 5.00 cm/s is ")
    assert "[[aiding]]  # gnss\nvelocity = " in shown
    tabled = tomllib.loads(shown[shown.index("[[aiding]]") : shown.index("Innovations")].partition("note:")[0])
    assert tabled["aiding"][0]["velocity"].endswith(" cm/s")
    assert "What to change" in page


def test_the_measurements_of_a_campaign_s_log_have_its_sigmas_and_its_factor_is_named(tmp_path: Path) -> None:
    """A receiver whose stated sigmas, which vary by five, are 2.5 times too small: 18 fixes of three axes."""
    rows = [f"{time},48.0,11.0,500.0,{s},{s},{2 * s}" for time, s in enumerate((1.0, 5.0) * 20)]
    header = "time [s],latitude [deg],longitude [deg],altitude [m],sigma_north [m],sigma_east [m],sigma_down [m]"
    (tmp_path / "gnss.csv").write_text("\n".join([header, *rows]))
    described = SHORT.replace('interval = "1 s"\nposition = "1 m"', 'log = "gnss.csv"')
    assert described != SHORT
    (tmp_path / "flight.toml").write_text(described)
    (tmp_path / "flown.toml").write_text(described.replace('log = "gnss.csv"', 'log = "gnss.csv"\nlog_factor = 2.5'))
    run("judge", tmp_path / "flown.toml", "--record", "--sample", 2, "--rate", 20, "--out", tmp_path)
    assert "sigma_down [m]" in (tmp_path / "gnss.csv").read_text()  # in place of the one that was read
    files = "--imu", tmp_path / "imu.csv", "--start", tmp_path / "start.csv"
    shown = run("judge", tmp_path / "flight.toml", *files, "--records", 300, "--out", tmp_path / "judge")
    causes = json.loads((tmp_path / "judge" / "judge.json").read_text())["causes"]
    (noise,) = (each for each in causes if each["name"] == "gnss_position_noise")
    assert noise["factor"]["low"] < 2.5 < noise["factor"]["high"]
    assert noise["log_factor"] == 1.0
    assert "[[aiding]]  # gnss\nlog_factor = 2." in shown


def test_a_part_of_a_record_is_judged_and_the_campaign_s_end_counts(tmp_path: Path) -> None:
    """Up to 12 s there are 12 fixes, by the option as by the campaign's end."""
    folder = recorded(False)
    files = (
        "--imu",
        folder / "imu.csv",
        "--measurements",
        f"gnss={folder / 'gnss.csv'}",
        "--start",
        folder / "start.csv",
    )
    ending = tmp_path / "ending.toml"
    ending.write_text(SHORT.replace('type = "ins"', 'type = "ins"\nend = "12 s"'))
    for campaign, option in ((folder / "flight.toml", ("--to", 12)), (ending, ())):
        run("judge", campaign, *files, *option, "--records", 200, "--out", tmp_path / "judge")
        content = json.loads((tmp_path / "judge" / "judge.json").read_text())
        assert content["sensors"][0]["updates"] == 12
    assert any("after 12 s is left out: the campaign ends there" in note for note in content["notes"])


def test_what_is_to_be_pasted_is_one_document_with_each_table_once() -> None:
    """Two numbers of one table, a delay, an arm, and a process that the campaign lacks."""
    walk, bias = (
        CauseVerdict(name, f"[imu.gyro] {key}", 1e-4, unit, shown, Factor(2.0, 1.5, 3.0), 9.0, None, (), (),
                     absent=absent, correlation_time=30.0 if absent else 0.0)
        for name, key, unit, shown, absent in (
            ("gyro_angle_random_walk", "angle_random_walk", "rad/sqrt(s)", "deg/sqrt(h)", False),
            ("gyro_bias_instability", "bias_instability", "rad/s", "deg/h", True),
        )
    )  # fmt: skip
    delay = OffsetVerdict("gnss_delay", "[[aiding]] gnss: delay", ("",), "s", "ms", (0.05,), (0.002,), None, 9.0, ())
    arm = OffsetVerdict(
        "gnss_lever_arm", "[[aiding]] gnss: lever_arm", tuple("xyz"), "m", "cm", (-0.8, 0.0, 0.1), (0.1,) * 3,
        (0.0, 0.0, 0.0), 9.0, (),
    )  # fmt: skip
    found: Any = SimpleNamespace(
        findings=[Finding(number, (), 0.5) for number in (walk, delay, arm, bias)], explained=True
    )
    pasted = tomllib.loads(to_paste(found))
    assert list(pasted["imu"]["gyro"]) == ["angle_random_walk", "bias_instability"]
    assert pasted["imu"]["gyro"]["bias_instability"]["correlation_time"] == "30 s"
    assert pasted["errors"]["gnss_delay"] == {"distribution": "fixed", "value": "50 ms"}
    assert pasted["aiding"][0]["lever_arm"] == ["80 cm", "0 cm", "-10 cm"]
    assert "taken 50.0 ± 3.9 ms before their stamps" in offset_words(delay)
    assert "true are x 80.0 ± 20, " in offset_words(arm)
    scales = OffsetVerdict(
        "gyro_scale_factor", "[imu.gyro] scale_factor", tuple("xyz"), "1", "ppm", (3e-4, 5.0, -4e-4), (1e-5, 0.9, 1e-5),
        None, 9.0, (),
    )  # fmt: skip
    assert scales.seen == (True, False, True)
    assert offset_words(scales).endswith("does not have: x 300 ± 20, z −400 ± 20 ppm")
    alone: Any = SimpleNamespace(findings=[Finding(scales, (), 0.5)], explained=True)
    assert tomllib.loads(to_paste(alone))["imu"]["gyro"]["scale_factor"] == "353.6 ppm"
    clock = OffsetVerdict("gnss_clock_rate", "", ("",), "1", "ppm", (-2e-4,), (5e-5,), None, 9.0, (), at_start=0.0114)
    assert offset_words(clock) == (
        "the gnss clock runs 200 ± 98 ppm slow against the readings: multiply its stamps, counted from the first "
        "reading, by 1.00020004 and subtract 11.40 ms"
    )
    found.findings.append(Finding(clock, (), 0.5))
    assert to_paste(found) == ""  # the stamps have to be corrected first


def test_what_comes_nearest_is_no_verdict_where_it_does_not_explain_the_record() -> None:
    """After three numbers none of 300 records is as unusual: no interval is stated, and nothing is to be pasted."""
    walk = CauseVerdict(
        "gyro_angle_random_walk", "[imu.gyro] angle_random_walk", 1e-4, "rad/sqrt(s)", "deg/sqrt(h)",
        Factor(9.0, 8.0, 10.0), 9.0, None, (), (),
    )  # fmt: skip

    def judged_with(left: float) -> Judgement:
        return Judgement(60.0, 100, 300, 1.0 / 301.0, (Finding(walk, (), left),), (), (), (), (), (), np.zeros((0, 9)))

    nearest = judged_with(1.0 / 301.0)
    assert not nearest.explained
    assert "no number of the campaign explains it" in verdict(nearest).headline
    assert "9.00 times" not in str(verdict(nearest))
    assert to_paste(nearest) == ""
    assert "no single number explains it" in repr(replace(nearest, causes=(walk,)))
    named = judged_with(2.0 / 301.0)
    assert verdict(named).headline.endswith("is 9.00 times too small: 8.00 to 10.0.")
    assert "angle_random_walk = " in to_paste(named)


def test_statistics_of_the_record_are_in_the_file() -> None:
    _, content, _ = judged(True)
    (sensor,) = content["sensors"]
    assert sensor["nis"]["value"] > sensor["nis"]["high"]
    assert {each["group"] for each in content["nees"]} == {"position", "velocity", "attitude"}
    assert len(content["factors"]) == len(content["causes"][0]["found"])


def test_mistakes_are_one_line_each(tmp_path: Path) -> None:
    folder = recorded(False)
    campaign, imu, gnss = folder / "flight.toml", folder / "imu.csv", folder / "gnss.csv"
    assert "mcnav judge needs CAMPAIGN and --imu FILE, or --errors TABLE" in refused("judge", campaign)
    assert "expected --measurements gnss=FILE" in refused("judge", campaign, "--imu", imu)
    named = ("judge", campaign, "--imu", imu, "--measurements")
    assert "error: --measurements: no sensor of the campaign is named 'gps'; expected gnss" in refused(
        *named, f"gps={gnss}"
    )
    assert "expected NAME=VALUE" in refused(*named, "gnss")
    late = tmp_path / "late.csv"
    rows = gnss.read_text().splitlines()
    later = [",".join([f"{float(row.split(',')[0]) + 1e6:.3f}", *row.split(",")[1:]]) for row in rows[1:]]
    late.write_text("\n".join([rows[0], *later]))
    assert "both must have the same clock" in refused(*named, f"gnss={late}")
    week = [",".join([f"{float(row.split(',')[0]) + 604800.0:.3f}", *row.split(",")[1:]]) for row in rows[1:]]
    late.write_text("\n".join([rows[0], *week]))
    assert "they differ by 1 GPS week: seconds of the week" in refused(*named, f"gnss={late}")
    at_once = (*named, f"gnss={gnss}")
    assert "give its state there by --start FILE" in refused(*at_once, "--from", 5)
    assert "has no readings from 900 to" in refused(*at_once, "--from", 900)
    upward = tmp_path / "upward.csv"
    names, *readings = imu.read_text().splitlines()
    turned = ([*row[:5], row[6], str(-float(row[5])), *row[7:]] for row in (each.split(",") for each in readings))
    upward.write_text("\n".join([names, *(",".join(row) for row in turned)]))
    turned_up = ("judge", campaign, "--imu", upward, "--measurements", f"gnss={gnss}")
    for at_start in (("--start", folder / "start.csv"), ()):  # without it the attitude is the trajectory's
        assert "begins along -y, for" in refused(*turned_up, *at_start)
    unaided = tmp_path / "unaided.toml"
    unaided.write_text(SHORT[: SHORT.index("[[aiding]]")])
    assert "there is no filter to be judged" in refused("judge", unaided, "--record")
    assert "they run from 0 to 49" in refused("judge", campaign, "--record", "--sample", 50, "--out", tmp_path)


def test_a_table_of_errors_is_judged_alone(tmp_path: Path) -> None:
    """Errors of 1.5 times the stated sigma, and others as stated; false alarm of this test 1e-4 at most."""
    rng, count = np.random.default_rng(0), 2000
    table = np.column_stack([
        np.arange(count), 3.0 * rng.standard_normal(count), np.full(count, 2.0), rng.standard_normal(count),
        np.ones(count),
    ])  # fmt: skip
    path = tmp_path / "errors.csv"
    header = "time,error_north,sigma_north,innovation_range,innovation_sigma_range"
    np.savetxt(path, table, delimiter=",", header=header, comments="")
    shown = run("judge", "--errors", path, "--out", tmp_path / "judge")
    assert shown.startswith("The sigma of north is 1.")
    content = json.loads((tmp_path / "judge" / "judge.json").read_text())
    north, innovation = (each["size"] for each in content["tests"])
    assert np.sqrt(north["low"]) < 1.5 < np.sqrt(north["high"])
    assert innovation["p_value"] > 1e-4


@pytest.mark.parametrize(
    ("header", "values", "message"),
    [
        ("time,north", "0,1\n1,1", "expected time, error_NAME with sigma_NAME"),
        ("time,error_north", "0,1\n1,1", "has no column sigma_north"),
        ("time,error_north,sigma_north", "0,1,0\n1,1,1", "got 0 in line 2; expected sigmas above zero"),
        ("time,error_north,sigma_north", "1,1,1\n0,1,1", "falls or repeats in line 3"),
    ],
)
def test_a_wrong_table_of_errors_is_refused(tmp_path: Path, header: str, values: str, message: str) -> None:
    path = tmp_path / "errors.csv"
    path.write_text(f"{header}\n{values}\n")
    assert message in refused("judge", "--errors", path)
