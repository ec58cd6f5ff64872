"""Allocation: closed forms, real answers with every number proposed, grades of the catalogue, the command."""

from __future__ import annotations

import json
import math
import re
import shutil
import tomllib
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
from scipy import special

import mcnav
from mcnav.analysis.allocation import Allocation, Goal
from mcnav.analysis.linear_answer import LinearRequirement
from mcnav.config.data_sheet import data_sheet_numbers, next_grade, round_down
from mcnav.studies.allocate import allocate, write_allocation
from mcnav.validation.reproduce.story_of_84_minutes import schuler
from tests.commands import invoke
from tests.runs import vary

CAMPAIGNS = Path(__file__).parents[2] / "campaigns"

RADIUS, GRAVITY, DURATION = 6.371e6, 9.8, 5_000.0
DEGREE_PER_HOUR = math.radians(1.0) / 3600.0

Entries = dict[str, Any]


def hover(limit: str) -> Entries:
    """Return a platform at rest whose gyro alone drifts, with a requirement on the range at 95 %."""
    return {
        "scenario": {
            "type": "hover", "duration": f"{DURATION} s", "altitude_channel": "slaved", "platform": "level",
            "earth_radius": f"{RADIUS} m", "gravity": f"{GRAVITY} m/s^2",
        },
        "errors": {"gyro_drift": "0.1 deg/h"},
        "accept": {"quantile": [{"output": "range", "probability": 0.95, "below": limit}]},
    }  # fmt: skip


def fixed(limit: str) -> Entries:
    """Return a vehicle at rest whose position is known to 100 m and measured once, to 10 m, after 2 s."""
    return {
        "scenario": {
            "type": "ins",
            "trajectory": {
                "start": {"latitude": "47 deg", "longitude": "9 deg"}, "segments": [{"hold": "120 s"}], "rate": "1 Hz",
            },
        },
        "errors": {"position": "100 m"},
        "aiding": [{"type": "position-fix", "name": "fix", "instants": ["2 s"], "position": "10 m"}],
        "filter": {"estimates": ["position", "velocity", "attitude"]},
        "accept": {"quantile": [{"output": "position_east", "probability": 0.9, "below": limit, "at": "2 s"}]},
    }  # fmt: skip


def entries(number: int) -> Entries:
    (path,) = CAMPAIGNS.glob(f"{number}_*.toml")
    return tomllib.loads(path.read_text(encoding="utf-8"))


def factor_of(goal: Goal, label: str) -> float:
    return next(change.factor for change in goal.changes if change.label == label)


def worst(found: tuple[LinearRequirement, ...], goal: Goal) -> LinearRequirement:
    return min((found[number] for number in goal.requirements), key=lambda each: each.margin)


def constant_sigma(constant: float) -> float:
    """Return the true sigma of `ranging.py` after 120 s: a drift of 2 m and 60 s, taken for 1 m and 20 s."""
    fade, believed = math.exp(-1.0 / 60.0), math.exp(-1.0 / 20.0)
    claimed, true = np.diag([constant**2, 1.0]), np.diag([constant**2, 4.0, 0.0])  # of the constant's error, the drift,
    for _ in range(120):  # and its estimate
        claimed = np.diag([1.0, believed]) @ claimed @ np.diag([1.0, believed]) + np.diag([0.0, 1.0 - believed**2])
        moved = np.diag([1.0, fade, believed])
        true = moved @ true @ moved + np.diag([0.0, 4.0 * (1.0 - fade**2), 0.0])
        gain = claimed.sum(axis=1) / (claimed.sum() + 1.0)
        claimed = claimed - np.outer(gain, claimed.sum(axis=0))
        added = np.array([gain[0], 0.0, gain[1]])
        update = np.eye(3) + np.outer(added, [-1.0, 1.0, -1.0])
        true = update @ true @ update.T + np.outer(added, added)
    return math.sqrt(true[0, 0])


def test_numbers_of_a_loop_tune_its_filter(tmp_path: Path) -> None:
    """A constant of 100 m has to be known to 0.75 m: held gains would not heed that it is, and call it in vain."""
    content: Entries = {
        "scenario": {"type": "ranging.py:Ranging"},
        "errors": {"constant": "100 m"},
        "processes": {"drift": {"sigma": "2 m", "correlation_time": "60 s"}},
        "measurements": {"range": "1 m"},
        "filter": {"believes": {"processes": {"drift": {"sigma": "1 m", "correlation_time": "20 s"}}}},
        "accept": {"quantile": [{"output": "constant", "probability": 0.95, "below": "2 m"}]},
    }
    shutil.copy(CAMPAIGNS / "ranging.py", tmp_path)
    path = tmp_path / "ranging.toml"
    path.write_text(tomli_w.dumps(content), encoding="utf-8")
    (goal,) = allocate(path, confirm=0).goals
    needed = 100.0 * factor_of(goal, "errors.constant")
    assert 1.99 < float(special.ndtri(0.975)) * constant_sigma(needed) <= 2.0  # three digits of the number
    assert math.isnan(factor_of(goal, "measurements.range"))
    assert "filter.believes.processes.drift" in {change.label for change in goal.changes}


def test_a_sweep_is_named_where_it_makes_the_same_change() -> None:
    """It is none of a mean that changes with its sigma, nor of a kind of errors with an axis of its own."""
    content: Entries = {
        "scenario": {"type": "reentry", "trajectory": 4},
        "errors": {"bias_x": {"sigma": "100 ug", "mean": "30 ug"}},
        "accept": {"quantile": [{"output": "range", "probability": 0.9, "below": "30 km"}]},
    }
    (goal,) = allocate(content, confirm=0).goals
    change = next(change for change in goal.changes if change.label == "errors.bias_x")
    assert (change.now, change.swept) == ("sigma 100 ug, mean 30 ug", "")
    assert change.needed.startswith("sigma ")
    assert ", mean " in change.needed
    content["errors"]["bias_x"] = "100 ug"
    (goal,) = allocate(content, confirm=0).goals
    change = next(change for change in goal.changes if change.label == "errors.bias_x")
    assert change.swept == f"100 ug, {change.needed}"
    still = hover("1 km") | {"errors": {"position": "2 km", "position_down": "1 km"}} | {
        "scenario": {"type": "ins", "trajectory": fixed("")["scenario"]["trajectory"]},
        "accept": {"quantile": [{"output": "position_east", "probability": 0.9, "below": "1 km"}]},
    }  # fmt: skip
    (goal,) = allocate(still, confirm=0).goals
    change = next(change for change in goal.changes if change.label == "errors.position")
    assert change.reached
    assert change.swept == ""


@pytest.mark.parametrize("limit", [500.0, 50_000.0])
def test_drift_of_a_platform_at_rest(limit: float) -> None:
    """The range error is R eps (t - sin(w t) / w): the drift that leaves 1.96 sigma at the limit follows."""
    rate = schuler.schuler_rate(RADIUS, GRAVITY)
    of_unit = schuler.drift_spherical(DEGREE_PER_HOUR, RADIUS, rate, DURATION)
    expected = limit / float(special.ndtri(0.975)) / abs(of_unit)
    found = allocate(hover(f"{limit} m"), confirm=0)
    (goal,) = found.goals
    assert goal.met == (limit > 1e4)
    (change,) = goal.changes
    assert change.needed == f"{round_down(expected):g} deg/h"
    assert change.result.met
    assert found.grades is None


def test_a_measurement_of_the_position() -> None:
    """Both variances are inverted and add up: 1 / (1 / s_0^2 + 1 / s_m^2); not a quadratic form of the numbers."""
    limit = 8.0
    sigma = limit / float(special.ndtri(0.95))
    (goal,) = allocate(fixed(f"{limit} m"), confirm=0).goals
    needed = {change.label: change.needed for change in goal.changes}
    assert needed["aiding.fix.position"] == f"{round_down((sigma**-2 - 100.0**-2) ** -0.5):g} m"
    assert needed["errors.position"] == f"{round_down((sigma**-2 - 10.0**-2) ** -0.5):g} m"
    whole = sigma / (10.0**-2 + 100.0**-2) ** -0.5
    assert factor_of(goal, "all numbers") == pytest.approx(round_down(whole), rel=1e-9)


def believing_too_little(limit: str) -> Entries:
    """As `fixed`, with a filter that believes the start to be known to 1 m, a hundredth of the truth."""
    described = fixed(limit)
    described["filter"]["believes"] = {"errors": {"position": "1 m"}}
    return described


def test_a_number_that_has_to_grow() -> None:
    """A believed size b has the gain K = b^2 / (b^2 + 10^2), and leaves (1 - K)^2 100^2 + K^2 10^2.

    At the believed 1 m that is 99 m, at 100 m it is least, 9.95 m: a limit of 12 m is just met in between. Nothing
    smaller than 1 m helps.
    """
    sigma, start, fix = 12.0, 100.0, 10.0
    (goal,) = allocate(believing_too_little(f"{sigma * float(special.ndtri(0.95))} m"), confirm=0).goals
    # (1 - K)^2 100^2 + K^2 10^2 = sigma^2, the smaller root
    a, half, c = start**2 + fix**2, start**2, start**2 - sigma**2
    gain = (half - math.sqrt(half**2 - a * c)) / a
    expected = math.sqrt(gain / (1.0 - gain)) * fix
    change = next(each for each in goal.changes if each.label == "filter.believes.errors.position")
    assert change.factor == pytest.approx(expected, rel=0.01)  # rounded up to three digits
    assert change.factor >= expected * (1.0 - 1e-4)
    assert change.result.met
    assert change.needed == f"{change.factor:g} m"


@pytest.mark.parametrize(("sigma", "words"), [
    (9.0, "neither smaller nor larger, at any multiple looked at from × 0 to × 1,000"), (12.0, "is a larger number"),
])  # fmt: skip
def test_words_on_numbers_that_grow_or_do_not_help(tmp_path: Path, sigma: float, words: str) -> None:
    """No believed start leaves less than 9.95 m."""
    described = believing_too_little(f"{sigma * float(special.ndtri(0.95))} m")
    found, (_, page) = write_allocation(described, tmp_path, confirm=0, examine=False)
    (change,) = (each for each in found.goals[0].changes if each.label == "filter.believes.errors.position")
    assert change.reached == (sigma > 9.95)
    assert words in page.read_text()
    if not change.reached:  # the closest is the truth, 100 times the believed size
        assert change.closest == pytest.approx(100.0, rel=0.05)


@pytest.mark.usefixtures("at_the_campaigns")
def test_a_bias_grows_with_its_instability() -> None:
    """GNSS calibrates a constant bias of any size, not what it does in run: both together are bounded."""
    described = entries(19)
    described["scenario"] |= {"end": "600 s"}
    described["aiding"][0]["outages"] = [["300 s", "540 s"]]
    described["imu"] = {"grade": "navigation"}
    described["accept"] = {"r95": [described["accept"]["r95"][0] | {"below": "30 m"}]}
    (goal,) = allocate(described, confirm=0, examine=False).goals
    assert goal.met
    assert math.isinf(factor_of(goal, "imu.accelerometer.bias"))
    assert factor_of(goal, "bias and instability, accelerometer") < 100.0


def test_loosening_ends_where_others_do_not_help() -> None:
    """With a limit above 10 m at 90 %, the start may be as uncertain as it likes."""
    (goal,) = allocate(fixed("17 m"), confirm=0).goals
    assert goal.met
    assert math.isinf(factor_of(goal, "errors.position"))
    assert 1.0 < factor_of(goal, "aiding.fix.position") < 1.1


def short(limits: tuple[str, str]) -> Entries:
    """Return three minutes of campaign 19 with an outage, and two requirements over time."""
    described = entries(19)
    described["scenario"] |= {"trajectory": "flight.csv", "end": "180 s"}
    described["aiding"][0]["outages"] = [["90 s", "150 s"]]
    outputs = ["position_north", "position_east"]
    described["accept"] = {
        "r95": [
            {"outputs": outputs, "below": limits[0], "during": "outages"},
            {"outputs": outputs, "below": limits[1], "at": "180 s"},
        ]
    }
    return described


@pytest.fixture
def at_the_campaigns(monkeypatch: pytest.MonkeyPatch) -> None:
    """Paths of dictionaries are relative to the current folder."""
    monkeypatch.chdir(CAMPAIGNS)


def proposals_are_tight(described: Entries, found: Allocation) -> int:
    """Put every number proposed into the campaign: it meets its goal, one a hundredth larger does not."""
    checked = 0
    content = {number.path: number for number in data_sheet_numbers(described, found.answer.sources)}
    for goal in found.goals:
        for change in goal.changes:
            if len(change.paths) > 1 or not math.isfinite(change.factor):
                continue
            (path,) = change.paths
            meets, fails = (
                worst(mcnav.linear_covariance(vary(described, content[path].multiplied(factor))).requirements, goal)
                for factor in (change.factor, 1.01 * change.factor)
            )
            assert meets.met
            assert meets.value == pytest.approx(change.result.value, rel=1e-12)
            assert not fails.met
            checked += 1
    return checked


@pytest.mark.usefixtures("at_the_campaigns")
def test_every_number_of_an_aided_flight() -> None:
    """Requirements during an outage and after it, one of them not met: gains change with the numbers."""
    now = [each.value for each in mcnav.linear_covariance(short(("10 m", "10 m"))).requirements]
    described = short((f"{0.9 * now[0]} m", f"{1.5 * now[1]} m"))
    found = allocate(described, confirm=0, examine=False)
    assert [goal.requirements for goal in found.goals] == [(0,), (0, 1)]
    assert proposals_are_tight(described, found) >= 4
    for goal in found.goals:
        failing = [change for change in goal.changes if not change.reached]
        assert failing
        assert all(not change.result.met for change in failing)


@pytest.mark.usefixtures("at_the_campaigns")
def test_every_number_of_a_flight_that_is_not_aided() -> None:
    described = entries(15)
    described["scenario"] |= {"end": "600 s"}
    outputs = ["position_north", "position_east"]
    described["accept"] = {"cep": [{"outputs": outputs, "below": "1 km"}]}
    now = mcnav.linear_covariance(described).requirements[0].value
    for multiple in (0.8055, 1.2555):
        described["accept"]["cep"][0]["below"] = f"{multiple * now} m"
        found = allocate(described, confirm=0, examine=False)
        assert found.goals[0].met == (multiple > 1.0)
        assert proposals_are_tight(described, found) >= 1
        assert factor_of(found.goals[0], "all numbers") == pytest.approx(round_down(multiple), rel=1e-9)


@pytest.mark.usefixtures("at_the_campaigns")
def test_the_fewest_numbers_by_one_grade() -> None:
    """Two numbers of a tactical unit moved to the next grade suffice, and no single one does."""
    described = entries(16)
    described["accept"] = {"cep": [{"outputs": ["position_north", "position_east"], "below": "60 km"}]}
    found = allocate(described, confirm=0, examine=False)
    grades = found.grades
    assert grades is not None
    assert grades.exhaustive
    assert {len(change.moves) for change in grades.changes} == {2}
    moves = {}
    for number in data_sheet_numbers(described, found.answer.sources):
        graded = next_grade(number, finer=True)
        if graded is not None:
            moves[number.path] = graded.entry
    meeting = set()
    for size in (1, 2):
        for chosen in combinations(moves, size):
            if mcnav.linear_covariance(vary(described, {path: moves[path] for path in chosen})).met:
                meeting.add(frozenset(chosen))
    assert {frozenset(move.path for move in change.moves) for change in grades.changes} == meeting


@pytest.mark.usefixtures("at_the_campaigns")
def test_no_grade_suffices() -> None:
    described = entries(16)
    described["accept"] = {"cep": [{"outputs": ["position_north", "position_east"], "below": "1 m"}]}
    grades = allocate(described, confirm=0, examine=False).grades
    assert grades is not None
    assert grades.changes == ()
    assert grades.whole is not None
    assert not grades.whole.met


def test_a_campaign_needs_requirements_that_linear_analysis_can_judge() -> None:
    described = hover("1 km")
    described["accept"] = {"sigma_ratio": "5 %"}
    with pytest.raises(mcnav.CampaignError, match="no requirement that linear analysis can judge"):
        allocate(described, confirm=0, examine=False)


def test_files(tmp_path: Path) -> None:
    found, (table, page) = write_allocation(hover("500 m"), tmp_path, confirm=0)
    stored = json.loads(table.read_text())
    (row,) = stored["changes"]
    assert row["number"] == "errors.gyro_drift"
    assert row["needed"] == found.goals[0].changes[0].needed
    assert not stored["met"]
    text = page.read_text()
    assert "The requirement is not met; 1 of 1 numbers can meet it alone" in text
    assert row["needed"] in text


def test_the_command(tmp_path: Path) -> None:
    """Campaign 23 meets its requirement; a bad one ends with a line and status 2."""
    path = CAMPAIGNS / "23_lunar_return_updated_once.toml"
    finished = invoke("allocate", path, "--out", tmp_path / "out", cwd=tmp_path)
    assert finished.returncode == 0
    assert "The requirement is met by 1,600 samples" in finished.stdout
    assert "may be" in finished.stdout
    page = (tmp_path / "out" / "allocate.html").read_text()
    shown = page[: page.index('<details class="fold"')]
    assert re.search(r"at most [\d.,]+ k?m, limit ", shown)  # as the samples show it, of which the verdict is
    refused = invoke("allocate", CAMPAIGNS / "14_polar.toml", cwd=tmp_path)
    assert refused.returncode == 2
    assert "accept: is missing; add" in refused.stderr
