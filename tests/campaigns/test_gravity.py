"""Gravity disturbances in a campaign: rows of the budget, what pages say of them, and commands that refuse them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.commands import in_process

CAMPAIGN = """
samples = 64
[scenario]
type = "ins"
[scenario.trajectory]
rate = "1 Hz"
start = { latitude = "47 deg", longitude = "9 deg", altitude = "1 km", speed = "100 m/s" }
segments = [{ straight = "2 min" }]
[gravity]
deflection = { sigma = "5 arcsec", correlation_length = "30 km" }
anomaly = { sigma = "30 mGal", correlation_length = "50 km" }
[errors]
position = "10 m"
[[aiding]]
type = "position-fix"
interval = "10 s"
position = "3 m"
[filter]
estimates = ["position", "velocity", "attitude", "gravity_deflection"]
"""


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("gravity") / "disturbed.toml"
    path.write_text(CAMPAIGN)
    return path


def test_the_budget_has_a_row_for_each_and_the_page_says_that_it_is_no_field(campaign: Path, tmp_path: Path) -> None:
    done = in_process("lincov", campaign, "--out", tmp_path)
    assert done.exit_code == 0, done.output
    content = json.loads((tmp_path / "lincov.json").read_text())
    rows = {row["cause"]: row["sigma"] for row in content["budget"]}
    assert [name for name in rows if name.startswith("gravity")] == ["gravity_deflection", "gravity_anomaly"]
    north, down = content["outputs"].index("position_north"), content["outputs"].index("position_down")
    assert rows["gravity_deflection"][north] > 100.0 * rows["gravity_deflection"][down]
    assert rows["gravity_anomaly"][down] > 100.0 * rows["gravity_anomaly"][north]
    assert content["filter"]["causes"][0]["name"] == "gravity_anomaly"
    page = (tmp_path / "lincov.html").read_text()
    assert "no field: a place that is visited twice has two values" in page
    assert "disturbances of gravity" not in page


def test_recorded_flights_refuse_it_in_one_line(campaign: Path, tmp_path: Path) -> None:
    done = in_process("judge", campaign, "--record", "--out", tmp_path)
    assert done.exit_code == 2
    assert done.stderr.splitlines()[-1].startswith(
        f"error: {campaign}: scenario.gravity: recorded flights are not judged"
    )
