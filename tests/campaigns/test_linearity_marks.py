"""Settings at which linear analysis does not hold are marked in sweeps, allocations, remedies and live pages."""

from __future__ import annotations

import json
import shutil
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w

import mcnav
from mcnav.analysis.examination import Linearity
from mcnav.config.read import read_campaign
from mcnav.report.pages.allocate import examined_words
from mcnav.report.pages.run.sections.remedies import fix
from mcnav.studies import allocation_examination
from mcnav.studies.allocate import allocate
from mcnav.studies.linear_covariance import linear_covariance
from mcnav.studies.live import LiveCampaign
from mcnav.studies.remedies import remedies_of_answer
from mcnav.studies.sweep import SweepPlan, run_sweep
from tests.commands import invoke

CAMPAIGNS = Path(__file__).parents[2] / "campaigns"


@pytest.fixture(scope="module")
def polar(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a campaign like 14, whose y bends with the bearing error, with limits to x and to y."""
    place = tmp_path_factory.mktemp("polar")
    shutil.copy(CAMPAIGNS / "polar.py", place)
    content: dict[str, Any] = {
        "samples": 2_000,
        "scenario": {"type": "polar.py:Target", "distance": "1 km", "bearing": "90 deg"},
        "errors": {"range": "20 m", "bearing": "2 deg"},
        "accept": {"quantile": [
            {"output": "x", "probability": 0.95, "below": "400 m"},
            {"output": "y", "probability": 0.95, "below": "60 m"},
        ]},
    }  # fmt: skip
    (place / "polar.toml").write_text(tomli_w.dumps(content), encoding="utf-8")
    return place / "polar.toml"


def true_ratio(bearing: float) -> float:
    """Return true over linear sigma of y = r cos a, for r of 1000 +- 20 m and a bearing error in degrees.

    With ``E cos^2 a = (1 + e^(-2 s^2)) / 2`` and ``E cos a = e^(-s^2 / 2)``; Julier and Uhlmann, 1997.
    """
    s = np.deg2rad(bearing)
    mean_square = (1000.0**2 + 20.0**2) * 0.5 * (1.0 + np.exp(-2.0 * s**2))
    return float(np.sqrt(mean_square - 1000.0**2 * np.exp(-(s**2))) / 20.0)


def test_sweep_marks_from_where_on_linear_analysis_does_not_hold(polar: Path, tmp_path: Path) -> None:
    """The marks follow the closed form of the ratio, from neighbour to neighbour; x holds longer than y does."""
    sweep = run_sweep(polar, SweepPlan({"errors.bearing": "0.1..30 deg"}, ("y", "x"), 20, examine=True))
    for point, _ in sweep.examined:
        verdict = sweep.verdict_at(point, 0)
        assert verdict == Linearity.HOLDS or true_ratio(point[0]) > 1.04
        assert verdict != Linearity.HOLDS or true_ratio(point[0]) < 1.05
    row = [(float(value),) for value in sweep.variables[0].values]
    held = {measure: sweep.shown_to_hold(row, measure) for measure in (0, 1)}
    edge = int(np.argmin(held[0]))
    assert held[0][:edge].all()
    assert not held[0][edge:].any()
    assert true_ratio(row[edge - 1][0]) < 1.05 < true_ratio(row[edge][0]) * 1.02
    assert np.argmin(held[1]) > edge  # the sigma of x is 0.965 times the linear one at 15 deg

    shown = invoke("sweep", polar, "--vary", "errors.bearing=0.1..30 deg", "--examine", "--out", tmp_path, cwd=tmp_path)
    assert "does not hold from errors.bearing" in shown.stdout
    assert "linear analysis does not hold in part of the range" in shown.stdout
    first = shown.stdout.splitlines()[0]
    assert first.endswith("simulate it")
    page = (tmp_path / "sweep.html").read_text(encoding="utf-8")
    assert "linear analysis, not shown to hold" in page
    assert "stroke-dasharray" in page
    stored = json.loads((tmp_path / "sweep.json").read_text(encoding="utf-8"))["linearity"]
    assert stored["unexamined"] is None
    assert {verdict for point in stored["points"] for verdict in point["verdicts"]} >= {"holds", "does not hold"}
    assert "linear analysis" in (tmp_path / "sweep.csv").read_text(encoding="utf-8").splitlines()[0]


def test_sweep_without_an_examination_has_no_mark(polar: Path) -> None:
    sweep = run_sweep(polar, SweepPlan({"errors.bearing": "0.1..30 deg"}, ("y",), 5, examine=False))
    assert (sweep.examined, sweep.unexamined, sweep.doubted) == ((), "", False)


def test_contours_and_families_are_marked(polar: Path) -> None:
    """Corners of a grid; of curves beside each other the ends of each."""
    varied = {"errors.range": "20, 200 m", "errors.bearing": "1, 30 deg"}
    sweep = run_sweep(polar, SweepPlan(varied, ("y",), examine=True))
    corners = {(float(r), float(b)): sweep.verdict_at((r, b), 0) for r in (20.0, 200.0) for b in (1.0, 30.0)}
    assert corners[20.0, 30.0] == "does not hold"
    assert corners[20.0, 1.0] == corners[200.0, 1.0] == "holds"


def test_allocation_marks_what_linear_analysis_proposes_in_vain(polar: Path, tmp_path: Path) -> None:
    """By linear analysis y grows with the range error alone, so that both limits allow 11.6 deg of bearing error.

    There y has 1.8 times its linear sigma, by `true_ratio`.
    """
    arguments = ("--confirm", 0, "--out", tmp_path, "--examine")
    shown = invoke("allocate", polar, *arguments, cwd=tmp_path).stdout
    stored = json.loads((tmp_path / "allocate.json").read_text(encoding="utf-8"))
    (bearing,) = [row for row in stored["changes"] if row["number"] == "errors.bearing"]
    assert true_ratio(2.0 * bearing["factor"]) > 1.06
    assert bearing["linearity"] == "does not hold"
    assert stored["linearity"] == {"now": "holds", "unexamined": None}
    assert "Linear analysis does not hold with errors.bearing" in shown
    page = (tmp_path / "allocate.html").read_text(encoding="utf-8")
    assert "Linear analysis then" in page
    linear = mcnav.allocate(polar, confirm=0, examine=False)
    assert set(linear.changes["linearity"]) == {""}


def test_an_allocation_examines_what_it_states(polar: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Others are by linear analysis alone, and the words say so."""
    examined = list[dict[str, object]]()

    def verdict(_variations: object, values: dict[str, object], *_: object) -> str:
        examined.append(values)
        return "holds"

    monkeypatch.setattr(allocation_examination, "_verdict", verdict)
    found = allocate(polar, confirm=0)
    stated = found.goals[-1].stated(found.goals[-1].changes)
    assert stated is not None
    assert [sorted(values) for values in examined] == [[], sorted(stated.paths)]
    linearity = {change.label: change.linearity for change in found.goals[-1].changes}
    assert linearity == dict.fromkeys(linearity, "") | {stated.label: "holds"}
    (words,) = examined_words(found)
    assert words.startswith(f"Flights examined the campaign as it is and {stated.label} × ")
    assert "all other changes are by linear analysis alone" in words
    examined.clear()
    every = allocate(polar, confirm=0, examine=True)
    assert len(examined) == 1 + sum(change.reached for goal in every.goals for change in goal.changes)
    assert examined_words(every) == []


def failing(polar: Path, bearing: str) -> Path:
    """Return the campaign with a limit of y that range errors of 80 m miss, and a bearing error."""
    content = tomllib.loads(polar.read_text(encoding="utf-8"))
    content["errors"] |= {"bearing": bearing, "range": "80 m"}
    content["accept"] = {"quantile": [{"output": "y", "probability": 0.95, "below": "60 m"}]}
    path = polar.with_name(f"failing_{bearing.partition(' ')[0]}.toml")
    path.write_text(tomli_w.dumps(content), encoding="utf-8")
    return path


def test_a_remedy_that_is_not_linear_is_marked_and_not_advised(polar: Path) -> None:
    """With 10 m of range error left, 9 deg of bearing error make y nonlinear, which 80 m of it hide."""
    campaign = read_campaign(failing(polar, "9 deg"))
    answer = linear_covariance(campaign, examine=True)
    assert answer.examination is not None
    assert answer.examination.verdict_on([1]) == Linearity.HOLDS
    remedies = remedies_of_answer(campaign, answer, examine=True)
    assert remedies is not None
    assert remedies.best is not None
    assert "errors.range" in remedies.best.words
    assert remedies.best.linearity in ("cannot say", "does not hold")
    section = str(fix(remedies, answer.outputs))
    assert "of it: simulate it first" in section
    assert remedies.best.words not in [remedy.words for remedy in remedies.advisable.listed if remedy.linearity]


def test_no_remedy_where_linear_analysis_does_not_hold(polar: Path) -> None:
    campaign = read_campaign(failing(polar, "25 deg"))
    remedies = remedies_of_answer(campaign, linear_covariance(campaign, examine=True))
    assert remedies is not None
    assert remedies.listed == ()
    assert remedies.reason.startswith("linear analysis does not hold here")


def test_a_live_setting_says_that_it_is_not_linear(tmp_path: Path) -> None:
    """Trajectory 4 with ten times the bias of z has a range rate whose sigma is not linear."""
    text = (CAMPAIGNS / "01_tn_d1772_trajectory_4.toml").read_text(encoding="utf-8")
    (tmp_path / "trajectory.toml").write_text(text, encoding="utf-8")
    live = LiveCampaign(tmp_path / "trajectory.toml", tmp_path, 1)
    tuned = dict.fromkeys(("errors.bias_z", "errors.altitude", "errors.bias_x", "errors.gyro_drift"), 10.0)
    live.tune(1, tuned)
    first, setting = json.loads(json.dumps(live.state()))["settings"]
    assert (first["doubted"], setting["doubted"]) == ([], ["range rate"])
    assert any("It fails for range rate (" in words for words, _ in setting["sentences"])
    assert {row["words"]: row["doubt"] for row in setting["sigmas"]}["range rate"] == "linear analysis does not hold"
