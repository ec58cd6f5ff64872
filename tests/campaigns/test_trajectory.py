"""`mcnav check --trajectory`: what it says of files and campaigns, its page, and its one line for bad input."""

from __future__ import annotations

import csv
import io
import json
import os
from pathlib import Path

import numpy as np
import pytest
from typer.testing import Result

from mcnav.physics.constants import STANDARD_GRAVITY
from tests.commands import in_process
from tests.unit.config.test_trajectory_file import flight, write_csv

CAMPAIGN = """
[scenario]
type = "ins"
start = "10 s"

[scenario.trajectory]
start = { latitude = "47 deg", longitude = "9 deg", altitude = "500 m", course = "80 deg" }
segments = [{ hold = "60 s" }, { speed = "80 m/s", acceleration = "2 m/s^2" }, { turn = "90 deg", bank = "30 deg" }]

[errors]
position = "10 m"
"""


def trajectory(*arguments: object) -> Result:
    return in_process("check", "--trajectory", *arguments)


def facts(*arguments: object) -> dict[str, tuple[float, float | None]]:
    done = trajectory(*arguments, "--format", "json")
    assert done.exit_code == 0, done.output
    rows = json.loads(done.stdout)["trajectory"]
    return {row["fact"]: (row["value"], row["time"]) for row in rows}


def test_a_file(tmp_path: Path) -> None:
    columns = flight()
    columns["VE"] = columns["VE"] + np.where(np.arange(len(columns["VE"])) == 123, 5.0, 0.0)
    path = write_csv(tmp_path / "flight.csv", columns)
    found = facts(path)
    assert found["rows"] == (400, None)
    assert found["median step"][0] == pytest.approx(0.1)
    assert found["lowest altitude"][0] == pytest.approx(3_000.0, abs=1e-6)
    assert found["highest latitude"][0] == pytest.approx(columns["lat"].max(), abs=1e-6)
    # centripetal: 150 m/s and 2 pi / 120 s; the ellipse is out of round by a few per cent
    expected = np.hypot(1.0, 150.0 * 2.0 * np.pi / 120.0 / STANDARD_GRAVITY)
    assert found["largest specific force"][0] == pytest.approx(expected, rel=0.05)
    value, time = found["largest disagreement of the velocities"]
    assert value == pytest.approx(5.0, abs=0.01)
    assert time == pytest.approx(12.3)
    table = trajectory(path)
    assert "disagreement of the velocities (rms)" in table.stdout
    rows = list(csv.DictReader(io.StringIO(trajectory(path, "--format", "csv").stdout)))
    assert rows[0]["fact"] == "rows"


def test_other_columns(tmp_path: Path) -> None:
    columns = {name: values for name, values in flight().items() if not name.startswith("V")}
    columns["height"] = columns.pop("alt") / 0.3048
    path = write_csv(tmp_path / "flight.csv", columns)
    found = facts(path, "--column", "alt=height [ft]")
    assert found["highest altitude"][0] == pytest.approx(3_000.0 + 5.0 * 39.9, abs=1e-3)
    assert not any("disagreement" in fact for fact in found)
    done = trajectory(path, "--column", "height [ft]")
    assert done.exit_code == 2
    assert "expected NAME=COLUMN" in done.stderr


def test_a_campaign(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(CAMPAIGN)
    found = facts(path)
    assert found["lowest speed"][0] == 0.0  # not what rounding leaves of it
    assert found["highest speed"][0] == pytest.approx(80.0, rel=1e-6)
    # a turn with a bank of 30 deg feels 1 / cos(30 deg); gravity and the path's curvature are right to a per cent
    assert found["largest specific force"][0] == pytest.approx(1.0 / np.cos(np.radians(30.0)), rel=0.01)
    write_csv(tmp_path / "flight.csv", flight())
    path.write_text('[scenario]\ntype = "ins"\ntrajectory = "flight.csv"\n[errors]\nposition = "10 m"\n')
    found = facts(path)
    assert found["rows"][0] == 400
    assert "largest disagreement of the velocities" in found
    done = trajectory(path, "--column", "alt=height")
    assert done.exit_code == 2
    assert "--column: belongs to a trajectory file" in done.stderr


def test_the_page(tmp_path: Path) -> None:
    path, page = write_csv(tmp_path / "flight.csv", flight()), tmp_path / "pages" / "flight.html"
    done = trajectory(path, "--out", page)
    assert done.exit_code == 0, done.output
    assert f"written: {page}" in done.stdout
    text = page.read_text()
    for panel in ("Map", "Altitude", "Speed over the earth", "Heading", "Pitch and roll", "Specific force of the body"):
        assert panel in text
    assert text.count("<svg") == 6
    again = tmp_path / "again.html"
    assert trajectory(path, "--out", again).exit_code == 0
    assert again.read_bytes() == page.read_bytes()


def test_bad_input_is_told_in_one_line(tmp_path: Path) -> None:
    columns = flight()
    columns["time"][7] = columns["time"][6]
    other = tmp_path / "other.toml"
    other.write_text('[scenario]\ntype = "hover"\nduration = "1 h"\n[errors]\ngyro_drift = "0.1 deg/h"\n')
    os.mkfifo(tmp_path / "pipe")
    cases = {
        write_csv(tmp_path / "bad.csv", columns): "bad.csv: line 9, column time: got 0.6 s, the same time",
        tmp_path: "is a folder; expected a trajectory file",
        tmp_path / "missing.csv": "missing.csv: no such file; expected a trajectory as CSV or parquet",
        tmp_path / "missing.toml": "missing.toml: no such file",
        tmp_path / "pipe": "pipe: is a pipe or device",
    }
    for path, message in cases.items():
        done = trajectory(path)
        assert done.exit_code == 2
        (line,) = done.stderr.splitlines()
        assert line.startswith("error: ")
        assert message in line
    assert "expected a campaign of type ins" in trajectory(other).stderr


def test_a_heading_of_zeros_on_a_turning_vehicle_is_remarked_on(tmp_path: Path) -> None:
    columns = flight()
    assert "The heading" not in trajectory(write_csv(tmp_path / "right.csv", columns)).stdout
    path = write_csv(tmp_path / "zeros.csv", columns | {"heading": np.zeros(len(columns["time"]))})
    done = trajectory(path, "--out", tmp_path / "zeros.html")
    assert done.exit_code == 0
    assert "track over the ground" in done.stdout
    assert "check the column heading" in " ".join(done.stdout.split())
    assert "check the column heading" in (tmp_path / "zeros.html").read_text()
    assert facts(path)["motion with heading and track 45° apart"][0] > 50.0


def test_pages_state_a_doubtful_heading_and_what_is_not_modelled(tmp_path: Path) -> None:
    columns = flight()
    write_csv(tmp_path / "zeros.csv", columns | {"heading": np.zeros(len(columns["time"]))})
    path = tmp_path / "zeros.toml"
    path.write_text('samples = 64\n[scenario]\ntype = "ins"\ntrajectory = "zeros.csv"\n[errors]\nposition = "10 m"\n')
    for command, page in (("run", "report.html"), ("lincov", "lincov.html")):
        done = in_process(command, path, "--out", tmp_path / command)
        assert done.exit_code == 0, done.output
        text = (tmp_path / command / page).read_text()
        assert "Not modelled: disturbances of gravity" in text
        assert ("check the column heading" in text) == (command == "run")
