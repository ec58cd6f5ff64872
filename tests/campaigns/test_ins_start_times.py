"""Start times of campaigns of type ins: the linear system for every start, its checks, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import tomli_w

from mcnav.arrays.types import Array
from mcnav.config.campaign import Campaign
from mcnav.config.read import parse_campaign
from mcnav.contract.recorded import MeasurementFile
from mcnav.contract.scenario import ScenarioError
from mcnav.errors import CampaignError
from mcnav.studies.start_times import check_start_time, start_time_study
from mcnav.systems.ins.scenario import SHORTEST, Ins
from tests.commands import in_process

END = 300.0
STARTS = np.array([30.0, 111.7, 250.0])
"""Starts in the hold, in the turn, and after it, s."""

NOISES = {
    "gyro": {
        "angle_random_walk": "0.002 deg/sqrt(h)",
        "bias_instability": {"sigma": "0.003 deg/h", "correlation_time": "200 s"},
        "rate_random_walk": "0.01 deg/h/sqrt(h)",
        "quantization": "1 arcsec",
    },
    "accelerometer": {
        "velocity_random_walk": "0.01 m/s/sqrt(h)",
        "bias_instability": {"sigma": "10 ug", "correlation_time": "100 s"},
    },
}


def described(platform: str = "strapdown", start: str = "20 s", **changes: Any) -> dict[str, Any]:
    """Five minutes of a straight flight with a turn; the instruments have every kind of noise."""
    begin = {"latitude": "47 deg", "longitude": "9 deg", "course": "80 deg", "speed": "60 m/s"}
    flown = {"rate": "1 Hz", "start": begin, "segments": [{"hold": "60 s"}, {"turn": "40 deg"}, {"straight": "20 km"}]}
    scenario = {"type": "ins", "trajectory": flown, "platform": platform, "start": start, "end": f"{END:g} s"}
    return {
        "samples": 300,
        "seed": 5,
        "scenario": scenario,
        "imu": {"grade": "navigation", **NOISES},
        "errors": {"position": "5 m", "velocity": "0.05 m/s", "tilt": "0.05 mrad", "heading": "0.5 mrad"},
        **changes,
    }


def campaign(*args: Any, **changes: Any) -> Campaign:
    return parse_campaign(described(*args, **changes), "test.toml", "test")


def scenario(*args: Any) -> Ins:
    found = campaign(*args).scenario
    assert isinstance(found, Ins)
    return found


def assert_same(found: tuple[Array, Array], other: Ins, known: Campaign) -> None:
    """P and the covariance of noise agree to 1e-9 of each row's largest contribution.

    The gyros' misalignments integrate the roll into the turn, which takes seconds, by steps of a second that begin
    elsewhere: they agree to 1e-8.
    """
    model = other.linear().end
    sizes = np.sqrt(np.diag(known.errors.covariance))
    contributions = np.abs(model.partials * sizes)
    noise = sum(model.processes.values(), np.zeros((9, 9)))
    difference = np.abs((found[0] - model.partials) * sizes)
    allowed = np.array([1e-8 if name.startswith("gyro_misalignment") else 1e-9 for name in known.errors.names])
    assert (difference <= allowed * contributions.max(axis=1)[:, None]).all()
    sigma = np.sqrt(np.diag(noise))
    assert (np.abs(found[1] - noise) <= 1e-9 * np.outer(sigma, sigma)).all()


@pytest.mark.parametrize("platform", ["strapdown", "level", "inertial"])
def test_each_start_is_that_of_a_campaign(platform: str) -> None:
    known = scenario(platform)
    assert known.parts.noise
    partials, noise = known.partials_at(STARTS), known.noise_at(STARTS)
    for row, start in enumerate(STARTS):
        own = campaign(platform, f"{float(start)!r} s")
        assert isinstance(own.scenario, Ins)
        assert_same((partials[row], noise[row]), own.scenario, own)


def test_an_inertial_platform_keeps_the_directions_of_one_instant() -> None:
    """With the axes of the campaign's own start, that start is the campaign, and a later one differs."""
    own = campaign("inertial")
    assert isinstance(own.scenario, Ins)
    times = np.append(own.scenario.navigation.start, STARTS)
    partials, noise = own.scenario.partials_at(times, "trajectory"), own.scenario.noise_at(times, "trajectory")
    assert_same((partials[0], noise[0]), own.scenario, own)
    for row, start in enumerate(times):
        assert_same((partials[row], noise[row]), own.scenario.started_at(float(start), "trajectory"), own)
    aligned_there = own.scenario.partials_at(times, "start")
    assert np.abs(aligned_there[-1] - partials[-1]).max() > 0.1 * np.abs(partials[-1]).max()


def test_a_held_body_does_not_turn() -> None:
    """Its inertial directions are those of the instant, to rounding of products of rotations."""
    truth = scenario().navigation.truth
    held = truth.held(100.0).states(np.array([0.0, 100.0, 280.0]), "strapdown", 0.0)
    own = truth.states(np.array([100.0]), "strapdown", 0.0)
    np.testing.assert_allclose(held.axes, np.broadcast_to(own.axes, (3, 3, 3)), rtol=0.0, atol=1e-14)
    np.testing.assert_allclose(held.rate, 0.0, atol=1e-18)  # 1e-14 of the earth's rate


def test_the_order_of_starts_does_not_matter() -> None:
    known = scenario()
    mixed = np.array([250.0, 30.0, 250.0])
    np.testing.assert_array_equal(known.partials_at(mixed), known.partials_at(np.array([30.0, 250.0]))[[1, 0, 1]])


def test_start_times_leave_room_for_the_shortest_navigation() -> None:
    times = scenario().start_times(5)
    np.testing.assert_allclose(times, np.linspace(20.0, END - SHORTEST, 5), rtol=1e-15)


@pytest.mark.parametrize("end", [300.0, 300.1, -0.3, -0.7, -0.013])
def test_the_latest_start_is_not_too_late_by_rounding(end: float) -> None:
    navigation = replace(scenario().navigation, start=-50.0, end=end)
    assert SHORTEST <= end - navigation.latest_start < SHORTEST + 1e-12


def test_sigmas_and_best_of_a_study() -> None:
    """Dispersion is that of constant errors and noise; all starts are candidates for the best."""
    known = campaign()
    study = start_time_study(known, count=12)
    assert study.before_event == 12
    assert study.noise is not None
    constant = np.sqrt((study.effects**2).sum(axis=2))  # sources are independent
    np.testing.assert_allclose(study.sigma, np.hypot(constant, study.noise), rtol=1e-12)
    np.testing.assert_array_equal(study.best, np.argmin(study.sigma, axis=0))
    assert study.best[0] > 0  # the shorter navigation


@pytest.mark.parametrize(("platform", "axes"), [("strapdown", "start"), ("inertial", "trajectory")])
def test_a_check_simulates_noise_and_agrees(platform: str, axes: str) -> None:
    """Errors of navigation grade are small: with its noise in both, a sample is its linear one to second order."""
    known = campaign(platform, start_times={"samples": 600})
    found = check_start_time(known, 120.0, axes)
    model = known.scenario
    assert isinstance(model, Ins)
    started = model.started_at(120.0, axes).linear().end
    covariance = started.partials @ known.errors.covariance @ started.partials.T + sum(started.processes.values())
    np.testing.assert_allclose([each.sigma_linear for each in found.outputs], np.sqrt(np.diag(covariance)), rtol=1e-9)
    assert found.verdict == "agrees"
    low, high = np.array([each.paired.interval for each in found.outputs]).T
    assert (high - low).max() < 0.1 * 4.0 / np.sqrt(2.0 * 600)  # a tenth of four standard errors of a plain sigma


def written(folder: Path, content: dict[str, Any]) -> Path:
    path = folder / "campaign.toml"
    path.write_text(tomli_w.dumps(content), encoding="utf-8")
    return path


def test_the_command(tmp_path: Path) -> None:
    table = {"samples": 200, "count": 9, "check": ["60 s", "200 s"], "errors": {"heading": [
        ["20 s", "0.5 mrad"], ["200 s", "2 mrad"]]}}  # fmt: skip
    path = written(tmp_path, described(start_times=table))
    finished = in_process("sweep", path, "--vary", "start", "--out", tmp_path / "found")
    assert finished.exit_code == 0, finished.output
    assert "min of the trajectory" in finished.output
    page = (tmp_path / "found" / "start_times.html").read_text(encoding="utf-8")
    assert "reentry" not in page
    assert page.count("<figure") == 11  # the first screen repeats one
    assert "Start, min of the trajectory" in page
    frame = pd.read_csv(tmp_path / "found" / "start_times.csv")
    np.testing.assert_allclose(frame["start [s]"], np.linspace(20.0, END - SHORTEST, 9), rtol=1e-12)
    assert (frame["sigma heading from noise [rad]"] < frame["sigma heading [rad]"]).all()
    checks = pd.read_csv(tmp_path / "found" / "start_times_checks.csv")
    assert sorted(set(checks["start [s]"])) == [60.0, 200.0]


@pytest.mark.parametrize(
    ("errors", "imu", "drawn"),
    [({"position": "5 m"}, {}, "initial position"), ({}, {"grade": "navigation"}, "gyro bias"),
     ({}, {"gyro": {"angle_random_walk": "0.01 deg/sqrt(h)"}}, "noise"),
     ({}, {}, "initial heading")],
)  # fmt: skip
def test_a_page_of_few_sources(tmp_path: Path, errors: dict[str, Any], imu: dict[str, Any], drawn: str) -> None:
    path = written(tmp_path, described(errors=errors, imu=imu))
    command = [
        "sweep",
        str(path),
        "--vary",
        "start",
        "--confirm",
        "0",
        "--points",
        "5",
        "--out",
        str(tmp_path / "found"),
    ]
    finished = in_process(*command)
    assert finished.exit_code == 0, finished.output
    assert drawn in (tmp_path / "found" / "start_times.html").read_text(encoding="utf-8")


SENSOR = {"type": "position-fix", "position": "3 m", "interval": "1 s"}


AIDED = {"aiding": [SENSOR], "filter": {"estimates": ["position", "velocity", "attitude", "gyro_bias"]}}


@pytest.mark.parametrize("platform", ["strapdown", "inertial"])
def test_each_start_of_an_aided_navigation_has_a_filter_of_its_own(platform: str) -> None:
    """It is that of a campaign with this start, whose fixes fall on the same whole seconds."""
    known = campaign(platform, **AIDED).scenario
    assert isinstance(known, Ins)
    starts = np.array([250.0, 30.0, 112.0])
    partials, noise = known.partials_at(starts), known.noise_at(starts)
    for row, start in enumerate(starts):
        own = campaign(platform, f"{float(start)!r} s", **AIDED)
        assert isinstance(own.scenario, Ins)
        assert_same((partials[row], noise[row]), own.scenario, own)
        assert_same((partials[row], noise[row]), known.started_at(float(start), "start"), own)


def test_starts_of_an_aided_navigation_by_the_command(tmp_path: Path) -> None:
    path = written(tmp_path, described(start_times={"count": 9}, **AIDED))
    finished = in_process("sweep", path, "--vary", "start", "--out", tmp_path / "found")
    assert finished.exit_code == 0, finished.output
    frame = pd.read_csv(tmp_path / "found" / "start_times.csv")
    assert (frame["sigma position_north [m]"].iloc[:-1] < 3.0).all()  # all but the navigation of one second


def test_recorded_sensors_are_refused() -> None:
    known = campaign(**AIDED).scenario
    assert isinstance(known, Ins)
    recorded = replace(known.navigation.sensors[0], log=MeasurementFile(Path("fixes.csv")))
    of = Ins(replace(known.navigation, sensors=(recorded,)))
    with pytest.raises(ScenarioError, match="got a file of measurements of position_fix; start times need sensors"):
        of.check_start_axes("start")


def test_axes_of_one_instant_need_an_inertial_platform() -> None:
    with pytest.raises(CampaignError, match=r"start_times\.axes: got 'trajectory' with a strapdown navigator"):
        campaign(start_times={"axes": "trajectory"})
    with pytest.raises(CampaignError, match=r"start_times\.axes: got 'trajectory' with a level navigator"):
        start_time_study(campaign("level"), "trajectory")


def test_a_check_outside_the_navigation() -> None:
    with pytest.raises(CampaignError, match=r"start_times\.check: got 299\.5 s; navigation starts from 0 s to 299 s"):
        check_start_time(campaign(), 299.5, "start")
