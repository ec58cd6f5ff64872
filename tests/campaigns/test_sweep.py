"""Sweeps from end to end: closed forms, aided campaigns, Monte Carlo at some points, pages, bad input."""

from __future__ import annotations

import json
import shutil
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import tomli_w

import mcnav
from mcnav.analysis.crossings import TOLERANCE
from mcnav.config.read import read_campaign
from mcnav.report.figures.sweep import contour_lines
from mcnav.studies.sweep import SweepPlan, run_sweep, write_sweep
from tests.commands import invoke
from tests.conftest import ROOT, content
from tests.runs import vary

CAMPAIGNS = ROOT / "campaigns"
REENTRY = CAMPAIGNS / "01_tn_d1772_trajectory_4.toml"
FREE = CAMPAIGNS / "15_flight_navigation_grade.toml"

AIDED: dict[str, Any] = {
    "name": "aided",
    "samples": 30,
    "scenario": {
        "type": "ins",
        "trajectory": {
            "rate": "1 Hz",
            "start": {"latitude": "47 deg", "longitude": "9 deg", "speed": "80 m/s"},
            "segments": [{"straight": "300 s"}],
        },
    },
    "imu": {"gyro": {"bias": "1 deg/h"}, "accelerometer": {"velocity_random_walk": "50 ug/sqrt(Hz)"}},
    "errors": {"position": "10 m", "velocity": "0.1 m/s", "tilt": "0.1 mrad", "heading": "1 mrad"},
    "aiding": [{"type": "gnss", "interval": "1 s", "outages": [["100 s", "150 s"]], "position": "3 m"}],
    "filter": {"estimates": ["position", "velocity", "attitude", "gyro_bias"]},
    "accept": {"r95": [{"outputs": ["position_north", "position_east"], "below": "15 m", "during": "outages"}]},
}

CUBIC = """
import numpy as np
from mcnav import Output, SimulationResult, Source


class Cubic:
    sources = (Source("error", "m", "m", 0.01),)
    outputs = (Output("miss", "m", "m"),)

    def propagate(self, errors):
        return SimulationResult(errors + errors**3)
"""


@pytest.mark.parametrize(
    ("name", "key", "output", "times"),
    [("11_cruise", "errors.gyro_drift", "range", [0.0, 1800.0]),
     ("01_tn_d1772_trajectory_4", "errors.altitude", "altitude", [-600.0, 60.0]),
     ("29_orbit_correction", "errors.true_position", "position_radial", [30.0])],
)  # fmt: skip
def test_times_of_any_system_are_those_of_its_linear_analysis(
    name: str, key: str, output: str, times: list[float], tmp_path: Path
) -> None:
    """As `lincov --at` has them, between epochs and without any; a short flight of the loop, and no limits."""
    described = tomllib.loads((CAMPAIGNS / f"{name}.toml").read_text())
    described.pop("accept", None)
    if "begin" in described["scenario"]:
        described["scenario"] |= {"begin": "60 s", "coast": "60 s"}
        shutil.copy(CAMPAIGNS / "orbit_correction.py", tmp_path)
    file = tmp_path / f"{name}.toml"
    file.write_text(tomli_w.dumps(described))
    size = described["errors"][key.removeprefix("errors.")]
    swept = run_sweep(
        file,
        SweepPlan({key: [f"0 {size.partition(' ')[2]}", size]}, [output], 2, times, 1, examine=False),
    )
    asked = mcnav.linear_covariance(file, np.array(times)).asked
    assert asked is not None
    number = [each.name for each in read_campaign(file).scenario.outputs].index(output)
    found = [swept.values[1, place] for place, time in enumerate(swept.times) if time is not None]
    np.testing.assert_allclose(found, asked.sigma[:, number], rtol=1e-12)


@pytest.fixture
def aided(tmp_path: Path) -> Path:
    path = tmp_path / "aided.toml"
    path.write_text(tomli_w.dumps(AIDED))
    return path


@pytest.fixture
def cubic(tmp_path: Path) -> Path:
    (tmp_path / "cubic.py").write_text(CUBIC)
    path = tmp_path / "cubic.toml"
    content = {"samples": 4000, "scenario": {"type": "cubic.py:Cubic"}, "errors": {"error": "0.01 m"}}
    path.write_text(tomli_w.dumps(content))
    return path


def test_a_limit_on_a_sigma_is_just_met_where_the_closed_form_says() -> None:
    """``sigma^2 = rest^2 + (P s)^2`` has the limit L at ``s = sqrt(L^2 - rest^2) / |P|``, to the width of a bracket."""
    campaign = read_campaign(REENTRY)
    model, names = campaign.scenario.linear().end, [source.name for source in campaign.scenario.sources]
    others = campaign.errors.covariance.copy()
    column = names.index("altitude")
    others[column, :] = others[:, column] = 0.0
    row = model.partials[0]
    expected = np.sqrt(40e3**2 - row @ others @ row) / abs(row[column]) / 1e3
    table = mcnav.sweep(REENTRY, {"errors.altitude": "0.3..30 km"}, against="altitude < 40 km", points=6)
    (found,) = table.attrs["just_met"]
    assert found["just_met"] == pytest.approx([expected], rel=2.0 * TOLERANCE)
    assert found["met"] == [[None, found["just_met"][0]]]
    sizes = table.index.to_numpy() * 1e3
    np.testing.assert_allclose(
        table["altitude < 40 km [km]"] * 1e3, np.sqrt(row @ others @ row + (row[column] * sizes) ** 2), rtol=1e-9
    )
    assert table["altitude < 40 km, met"].tolist() == (sizes / 1e3 <= expected).tolist()


def test_a_limit_over_two_sigmas_is_an_ellipse() -> None:
    """Along the contour that is drawn to 1 %, the interpolation between points of the grid; solved points to 1e-5."""
    plan = SweepPlan({"errors.altitude": "0..20 km", "errors.range": "0..20 km"}, ("altitude < 40 km",), 15)
    found = run_sweep(REENTRY, plan)
    campaign = read_campaign(REENTRY)
    names = [source.name for source in campaign.scenario.sources]
    row, others = campaign.scenario.linear().end.partials[0], campaign.errors.covariance.copy()
    picked = [names.index("altitude"), names.index("range")]
    others[picked, :] = others[:, picked] = 0.0
    left = 40e3**2 - row @ others @ row
    for each in found.just_met:
        for value in each.values:
            sizes = np.array([each.fixed, value]) * 1e3
            assert (row[picked] ** 2 * sizes**2).sum() == pytest.approx(left, rel=1e-5)
    lines = contour_lines(*found.variables, found.margins[..., 0], 0.0, False)
    assert lines
    for x, y in lines:
        np.testing.assert_allclose((row[picked[0]] * x * 1e3) ** 2 + (row[picked[1]] * y * 1e3) ** 2, left, rtol=1e-2)


@pytest.mark.parametrize(
    ("path", "unit"),
    [("imu.gyro.bias", "deg/h"), ("aiding.gnss.position", "m"), ("filter.believes.imu.gyro.bias", "deg/h"),
     ("imu.accelerometer.scale_factor", "ppm")],
)  # fmt: skip
def test_every_point_is_the_linear_covariance_of_its_campaign(aided: Path, path: str, unit: str) -> None:
    """True sigma, the filter's sigma and the requirement's value, to rounding in 300 steps: 1e-9."""
    table = mcnav.sweep(aided, {path: f"0.5, 3, 20 {unit}"}, against=["position_north", "heading"], examine=False)
    for number, size in enumerate((0.5, 3.0, 20.0)):
        answer = mcnav.linear_covariance(vary(aided, {path: f"{size} {unit}"}))
        history = answer.history
        assert history is not None
        assert history.sigma_filter is not None
        row = table.iloc[number]
        assert row["position_north [m]"] == pytest.approx(answer.sigma[0], rel=1e-9)
        assert row["position_north, filter [m]"] == pytest.approx(history.sigma_filter[-1, 0], rel=1e-9)
        assert row["heading [mrad]"] == pytest.approx(1e3 * answer.sigma[8], rel=1e-9)
        (judged,) = answer.requirements
        (radius,) = [
            name for name in table if str(name).startswith("r95") and "[m]" in str(name) and "filter" not in str(name)
        ]
        assert row[radius] == pytest.approx(judged.value, rel=1e-9)
        (met,) = [name for name in table if str(name).endswith(", met")]
        assert row[met] == judged.met


def test_a_requirement_in_an_outage_is_just_met_at_the_value_found(aided: Path) -> None:
    """The requirement's margin is one there, to the width of the bracket times the slope, which is below one."""
    table = mcnav.sweep(aided, {"aiding.gnss.position": "1..50 m"}, points=5, examine=False)
    (found,) = table.attrs["just_met"]
    (value,) = found["just_met"]
    (judged,) = mcnav.linear_covariance(vary(aided, {"aiding.gnss.position": f"{value!r} m"})).requirements
    assert judged.margin == pytest.approx(1.0, rel=2.0 * TOLERANCE)


def test_how_long_an_outage_may_be_with_each_grade(aided: Path, tmp_path: Path) -> None:
    """Of each grade the requirement is just met at the length that is found; a state's presence is no number."""
    varied = {"aiding.gnss.outages.1.length": "20..150 s", "imu.grade": "navigation, tactical"}
    sweep, files = write_sweep(aided, SweepPlan(varied, points=4, examine=False), tmp_path)
    assert [each.path for each in sweep.variables] == ["imu.grade", "aiding.gnss.outages.1.length"]
    lengths = []
    for grade, found in zip(("navigation", "tactical"), sweep.just_met, strict=True):
        (length,) = found.values
        campaign = vary(aided, {"imu.grade": grade, "aiding.gnss.outages.1.length": f"{length!r} s"})
        (requirement,) = mcnav.linear_covariance(campaign).requirements
        assert requirement.value == pytest.approx(15.0, rel=1e-4)
        lengths.append(length)
    assert lengths[1] < lengths[0]
    written = json.loads(files[1].read_text())
    assert written["variables"][0]["values"] == ["navigation", "tactical"]
    assert [row["imu.grade"] for row in written["just_met"]] == ["navigation", "tactical"]
    assert set(pd.read_csv(files[0])["imu.grade"]) == {"navigation", "tactical"}
    page = files[2].read_text()
    assert "At each value of imu.grade" in page
    state = run_sweep(aided, SweepPlan({"filter.estimates.gyro_bias": "present, absent"}))
    (met,) = state.just_met
    assert met.values == ()
    assert state.values[1, 0] > state.values[0, 0]


@pytest.mark.parametrize("points", [2, 3, 10])
def test_a_limit_that_is_met_between_the_points_of_a_coarse_grid_is_found(points: int) -> None:
    """A position known to 100 m is fixed to 10 m by a filter that believes in r: K = 1 / (1 + (r / 100)^2).

    It leaves (1 - K)^2 100^2 + K^2 10^2 = 99.01 + 10100 (K - 100/101)^2, in m^2. At 0.01, 3.16 and 1000 m that is more
    than 99.4; between 6.1 and 12.8 m it is less.
    """
    start, fix, limit = 100.0, 10.0, 99.4
    described = {
        "scenario": {"type": "ins", "trajectory": {"rate": "1 Hz", "segments": [{"hold": "60 s"}],
                                                   "start": {"latitude": "47 deg", "longitude": "9 deg"}}},
        "errors": {"position": f"{start} m"},
        "aiding": [{"type": "position-fix", "name": "fix", "instants": ["2 s"], "position": f"{fix} m"}],
        "filter": {"estimates": ["position", "velocity", "attitude"]},
    }  # fmt: skip
    best = start**2 / (start**2 + fix**2)
    width = np.sqrt((limit - (1.0 - best) * start**2) / (start**2 + fix**2))
    expected = [start * np.sqrt(1.0 / gain - 1.0) for gain in (best + width, best - width)]
    path = {"filter.believes.aiding.fix.position": "0.01..1000 m"}
    table = mcnav.sweep(
        described, path, against=f"position_east < {float(np.sqrt(limit))!r} m", at="2 s", points=points
    )
    (found,) = table.attrs["just_met"]
    assert found["just_met"] == pytest.approx(expected, rel=1e-3)  # the limit is 0.2 % above the minimum
    assert len(table) == points
    assert found["looked_at"] > points


def test_a_long_grid_says_which_points_are_shown(aided: Path) -> None:
    found = invoke("sweep", aided, "--vary", "imu.gyro.bias=0.1..10 deg/h", "--points", 25, "--against", "heading",
                   "--out", aided.parent / "out", cwd=aided.parent)  # fmt: skip
    assert found.returncode == 0, found.stderr
    assert "12 of 25 points shown; sweep.csv and --format csv have all." in found.stdout


def test_threads_and_order_do_not_matter(aided: Path) -> None:
    varied = {"imu.gyro.bias": "0.1..10 deg/h", "aiding.gnss.position": "1, 9 m"}
    one, two = (mcnav.sweep(aided, varied, points=2, jobs=jobs, examine=False) for jobs in (1, 2))
    pd.testing.assert_frame_equal(one, two, check_exact=True)
    assert one.shape[0] == 4


def test_other_times_and_campaigns_without_requirements() -> None:
    table = mcnav.sweep(FREE, {"imu.gyro.bias": "0.001, 0.1 deg/h"}, at="600 s, 30 min", examine=False)
    answer = mcnav.linear_covariance(vary(FREE, {"imu.gyro.bias": "0.1 deg/h"}), np.array([600.0, 1800.0]))
    assert answer.asked is not None
    for number, time in enumerate((600, 1800)):
        horizontal = float(np.hypot(*answer.asked.sigma[number, :2]))
        assert table.iloc[1][f"position_horizontal at {time} s [m]"] == pytest.approx(horizontal, rel=1e-9)
        assert table.iloc[1][f"heading at {time} s [mrad]"] == pytest.approx(
            1e3 * answer.asked.sigma[number, 8], rel=1e-9
        )
    assert not [name for name in table if "filter" in str(name)]


def test_limits_of_the_campaign_itself_can_be_varied(aided: Path) -> None:
    """The radius does not change, and its limit is just met at it."""
    table = mcnav.sweep(aided, {"accept.r95.1.below": "1..20 m"}, points=4, examine=False)
    (found,) = table.attrs["just_met"]
    (radius,) = table.filter(like="r95").filter(like="outages [m]").iloc[:, 0].unique()
    assert found["just_met"] == pytest.approx([radius], rel=2.0 * TOLERANCE)


def test_keys_of_whole_numbers_and_scenarios_that_change() -> None:
    table = mcnav.sweep(REENTRY, {"scenario.trajectory": [1, 4, 7]}, against="altitude < 25 km")
    for number, row in enumerate((1, 4, 7)):
        expected = mcnav.linear_covariance(vary(REENTRY, {"scenario.trajectory": row})).sigma[0]
        assert table.iloc[number]["altitude < 25 km [km]"] * 1e3 == pytest.approx(expected, rel=1e-9)
    for found in table.attrs["just_met"]:
        assert set(found["just_met"]) <= {1.0, 4.0, 7.0}


def test_monte_carlo_confirms_and_disagrees(cubic: Path) -> None:
    """Of x + x^3 the variance is s^2 + 6 s^4 + 15 s^6: with 1 cm it is linear, with 1 m its sigma is 4.7 m."""
    plan = SweepPlan({"errors.error": "0.01..1 m"}, ("miss < 0.2 m",), 5)
    found, files = write_sweep(cubic, plan, cubic.parent / "out", 4)
    assert [each.place for each in found.confirmations] == [
        (0,),
        (1,),
        (3,),
        (4,),
    ]  # the ends, next to the limit, between
    sizes = np.array([each.point[0] for each in found.confirmations])
    exact = np.sqrt(sizes**2 + 6.0 * sizes**4 + 15.0 * sizes**6)
    paired = np.array([each.values[0] for each in found.confirmations])
    # the error of an estimated sigma with 4000 samples and the kurtosis of the cube at 1 m: 3 standard errors of 16 %
    np.testing.assert_allclose(paired[:2], exact[:2], rtol=0.02)
    np.testing.assert_allclose(paired[3], exact[3], rtol=0.5)
    page = files[-1].read_text(encoding="utf-8")
    assert "Monte Carlo disagrees with linear analysis at" in page
    assert "do not rely on the linear numbers there" in page
    assert (cubic.parent / "out" / "confirm" / "05" / "report.html").exists()
    assert 'href="confirm/05/report.html"' in page
    written = json.loads((cubic.parent / "out" / "sweep.json").read_text())
    assert [each["verdict"] for each in written["monte_carlo"]][::3] == ["agrees", "differs"]
    assert written["just_met"][0]["just_met"] == pytest.approx([0.2], rel=2.0 * TOLERANCE)


def test_monte_carlo_of_a_requirement_stands_beside_the_linear_value(aided: Path) -> None:
    plan = SweepPlan({"aiding.gnss.position": "1..50 m"}, (), 3)
    found, files = write_sweep(aided, plan, aided.parent / "out", 2)
    (index,) = (number for number, measure in enumerate(found.measures) if measure.requirement is not None)
    for each in found.confirmations:
        entry = each.summary.requirements[0]
        assert each.values[index] == entry.estimate
        assert found.values[(*each.place, index)] == pytest.approx(entry.linear, rel=1e-9)
    assert "Requirements." in files[-1].read_text(encoding="utf-8")


def test_the_page_has_curves_limits_and_contours(aided: Path) -> None:
    out = aided.parent / "out"
    one = invoke("sweep", aided, "--vary", "imu.gyro.bias=0.1..10 deg/h", "--points", 4, "--out", out, cwd=aided.parent)
    assert one.returncode == 0, one.stderr
    assert "Limits along imu.gyro.bias" in one.stdout
    page = (out / "sweep.html").read_text(encoding="utf-8")
    assert "Where limits are just met" in page
    assert page.count("<svg") == 2  # the second one on the first screen
    two = invoke(
        "sweep", aided, "--vary", "imu.gyro.bias=0.1..10 deg/h", "--vary", "aiding.gnss.position=1..50 m",
        "--points", 4, "--against", "position_horizontal", "--against", "heading", "--out", out, cwd=aided.parent,
    )  # fmt: skip
    assert two.returncode == 0, two.stderr
    page = (out / "sweep.html").read_text(encoding="utf-8")
    assert "Lines of equal accuracy" in page
    assert page.count("<svg") == 4
    assert len(pd.read_csv(out / "sweep.csv")) == 16


def test_limits_that_are_asked_for_are_those_solved_for() -> None:
    """Requirements stay columns, and are solved for where no limit is asked for."""
    accept = {"quantile": [{"output": "range", "probability": 0.95, "below": "60 km"}]}
    described = content(samples=1000, accept=accept)

    def solved(against: str) -> tuple[list[str], int]:
        table = mcnav.sweep(described, {"errors.altitude": "0.3..30 km"}, against=against, points=6)
        return [row["measure"] for row in table.attrs["just_met"]], len(table.columns)

    (asked,), columns = solved("altitude < 40 km")
    assert asked.startswith("altitude")
    (required,), others = solved("altitude")
    assert "range" in required
    assert others == columns - 1  # a limit that is asked for has a column that says where it is met


def test_formats(aided: Path) -> None:
    arguments = (
        "sweep",
        aided,
        "--vary",
        "imu.gyro.bias=1, 2 deg/h",
        "--against",
        "heading",
        "--out",
        aided.parent / "o",
    )
    found = invoke(*arguments, "--format", "json", cwd=aided.parent)
    assert json.loads(found.stdout)["sweep"]["variables"][0]["values"] == [1.0, 2.0]
    lines = invoke(*arguments, "--format", "csv", cwd=aided.parent).stdout.splitlines()
    assert len(lines) == 3
    assert lines[0].startswith('imu.gyro.bias [deg/h],heading [mrad],"heading, filter [mrad]"')


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--vary", "imu.gyro.biass=1..2 deg/h"), "imu.gyro.biass: unknown key; did you mean 'bias'?"),
        (("--vary", "imu.gyro.bias=1..2 km"), "imu.gyro.bias: got '1.0 km', which is a length"),
        (("--vary", "errors.position=1..2 s"), "errors.position: got '1.0 s', which is a time"),
        (("--vary", "aiding.gns.position=1..2 m"), "aiding.gns.position: no sensor of [[aiding]] is named 'gns'"),
        (("--vary", "imu.gyro.bias=2..1 deg/h"), "--vary: imu.gyro.bias: got '2..1 deg/h', which is empty"),
        (("--vary", "imu.gyro.bias"), "--vary: got 'imu.gyro.bias'; expected KEY=VALUES"),
        (("--vary", "a=1..2", "--vary", "b=1..2", "--vary", "c=1..2"), "--vary: got 3 keys; expected one or two"),
        (("--vary", "imu.gyro.bias=1..2 deg/h", "--points", 20000), "--vary: got 20000 points; at most 10,000"),
        (("--vary", "imu.gyro.bias=1..2 deg/h", "--against", "headin"), "--against: unknown output or measure"),
        (("--vary", "imu.gyro.bias=1..2 deg/h", "--against", "heading", "--against", "heading"), "'heading' twice"),
        (("--vary", "imu.gyro.bias=1..2 deg/h", "--confirm", 1), "--confirm: got 1; expected at least 2, the ends"),
        (("--vary", "imu.gyro.bias=1, 2 deg/h", "--confirm", 3), "--confirm: got 3; expected at most 2"),
        (("--vary", "imu.gyro.bias=1..2 deg/h", "--at", "400 s"), "--at: got 400 s; navigation is from 0 s to 300 s"),
        (("--vary", "imu.gyro.bias=1..2 deg/h", "--at", "4 m"), "--at: got '4 m', which is a length"),
        (("--vary", "imu.gyro.bias=-1..2 deg/h"), "imu.gyro.bias: got '-1.0 deg/h'; a size must not be negative"),
        (("--vary", "scenario.end=200..400 s"), "scenario.end: got"),
        (("--vary", "scenario.end=200..299 s", "--at", "250 s"), "--at: got 250 s; navigation is from 0 s to 200 s"),
    ],
)  # fmt: skip
def test_bad_input_is_one_line(aided: Path, arguments: tuple[object, ...], message: str) -> None:
    found = invoke("sweep", aided, *arguments, cwd=aided.parent)
    assert found.returncode == 2
    (line,) = found.stderr.splitlines()
    assert line.startswith("error: ")
    assert message in line
    assert not (aided.parent / "reports").exists()


def test_a_users_scenario_that_has_no_linear_model_at_an_end_is_refused(cubic: Path) -> None:
    """A setting makes the scenario jump at its largest value."""
    settings = '    settings = {"jump": "1"}\n\n    def __init__(self, jump=0.0):\n        self.jump = jump\n\n'
    code = CUBIC.replace("class Cubic:\n", f"class Cubic:\n{settings}")
    code = code.replace("errors + errors**3", "errors + self.jump * np.sqrt(np.abs(errors))")
    cubic.with_name("cubic.py").write_text(code)
    found = invoke("sweep", cubic, "--vary", "scenario.jump=0, 1", cwd=cubic.parent)
    assert found.returncode == 2
    assert "have no linear model" in found.stderr or "converge" in found.stderr


def test_values_beyond_the_range_of_linear_analysis_are_not_shown(cubic: Path) -> None:
    """An output with a limit of 0.5 m: of a larger sigma there is no value, and no limit is met there."""
    limited = CUBIC.replace('Output("miss", "m", "m")', 'Output("miss", "m", "m", limit=0.5)')
    assert limited != CUBIC
    (cubic.parent / "cubic.py").write_text(limited)
    found, files = write_sweep(
        cubic, SweepPlan({"errors.error": "0.01..1 m"}, ("miss < 2 m",), 5), cubic.parent / "out"
    )
    assert np.isfinite(found.values[:, 0]).tolist() == [True, True, True, True, False]
    (just_met,) = found.just_met
    assert just_met.met == ((None, pytest.approx(0.5, rel=2.0 * TOLERANCE)),)
    assert "beyond the range of linear analysis" in files[-1].read_text(encoding="utf-8")
    assert json.loads((cubic.parent / "out" / "sweep.json").read_text())["values"][-1] == [None]


def test_numbers_may_not_grow_beyond_the_range_of_linear_analysis(cubic: Path) -> None:
    """The requirement allows a sigma of 0.61 m; linear analysis ends at 0.5 m."""
    limited = CUBIC.replace('Output("miss", "m", "m")', 'Output("miss", "m", "m", limit=0.5)')
    (cubic.parent / "cubic.py").write_text(limited)
    content = tomllib.loads(cubic.read_text(encoding="utf-8"))
    content["accept"] = {"quantile": [{"output": "miss", "probability": 0.9, "below": "1 m"}]}
    cubic.write_text(tomli_w.dumps(content))
    (change,) = mcnav.allocate(cubic, confirm=0).goals[0].changes
    assert 0.48 < 0.01 * change.factor < 0.5
    assert change.result.met
