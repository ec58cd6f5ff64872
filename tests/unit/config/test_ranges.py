"""Ranges in a campaign file: where they may stand, and that the rest of the program sees their upper ends."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import pytest

import mcnav as mc
from mcnav.config.documents import document_of
from mcnav.config.overrides import VariedCampaign
from mcnav.config.ranges import split_ranges
from mcnav.config.read import parse_campaign, read_campaign
from mcnav.errors import CampaignError
from tests.conftest import ROOT

REENTRY: dict[str, Any] = {"scenario": {"type": "reentry", "trajectory": 4}}

EVERYWHERE = """
[scenario]
type = "ins"
trajectory = { rate = "1 Hz", start = { latitude = "47 deg", longitude = "9 deg" }, segments = [{ hold = "60..90 s" }] }

[imu.gyro]
bias = ["0.01 deg/h", "0.01..0.02 deg/h", "0.01 deg/h"]
bias_instability = { sigma = "0.003..0.01 deg/h", correlation_time = "20..200 s" }

[errors]
position = "1..5 m"
heading = { distribution = "uniform", half_width = "0.1..1 mrad" }
gnss_delay = "1..20 ms"

[[aiding]]
type = "gnss"
interval = "1 s"
outages = [["20..25 s", "30..50 s"]]
position = "1..3 m"
lever_arm = ["0..1 m", "0 m", "0 m"]

[filter]
estimates = ["position", "velocity", "attitude"]
"""


def test_ranges_stand_wherever_a_size_does() -> None:
    """Paths are those of a sweep, and the nominal campaign is that of the upper ends."""
    content = tomllib.loads(EVERYWHERE)
    nominal, ranges = split_ranges(content, "flight.toml")
    assert {spec.path: spec.upper for spec in ranges} == {
        "scenario.trajectory.segments.1.hold": "90.0 s",
        "imu.gyro.bias.2": "0.02 deg/h",
        "imu.gyro.bias_instability.sigma": "0.01 deg/h",
        "imu.gyro.bias_instability.correlation_time": "200.0 s",
        "aiding.gnss.outages.1.1": "25.0 s",
        "aiding.gnss.outages.1.2": "50.0 s",
        "aiding.gnss.position": "3.0 m",
        "aiding.gnss.lever_arm.1": "1.0 m",
        "errors.position": "5.0 m",
        "errors.heading.half_width": "1.0 mrad",
        "errors.gnss_delay": "20.0 ms",
    }
    assert content["errors"]["position"] == "1..5 m"
    campaign = parse_campaign(content, "flight.toml", "flight")
    assert campaign.ranges == ranges
    assert campaign.resolved == parse_campaign(nominal, "flight.toml", "flight").resolved


def test_campaigns_without_ranges_are_the_same_object_content() -> None:
    """Nothing of their identity changes: content goes through as it is."""
    for file in sorted((ROOT / "campaigns").glob("*.toml")):
        content = tomllib.loads(file.read_text(encoding="utf-8"))
        nominal, ranges = split_ranges(content, str(file))
        assert nominal == content or ranges


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        ({"errors": {"altitude": "5..1 km"}}, "errors.altitude: got '5..1 km', which is empty"),
        ({"errors": {"altitude": "1 m..2 deg"}}, "errors.altitude: 'm' is a length"),
        ({"errors": {"altitude": "1..2 deg"}}, "errors.altitude: got '1..2 deg', which is an angle"),
        ({"errors": {"altitude": "-1..2 km"}}, "errors.altitude: got '-1..2 km'; a sigma must not be negative"),
        (
            {
                "errors": {"altitude": "1 km"},
                "accept": {"r95": [{"outputs": ["altitude", "range"], "below": "1..2 km"}]},
            },
            "got '1..2 km', a range; expected a length",
        ),
    ],
)
def test_refusals(entries: dict[str, Any], message: str) -> None:
    with pytest.raises(CampaignError) as caught:
        parse_campaign({**REENTRY, **entries}, "r.toml", "r")
    assert message in str(caught.value)


def test_ranges_survive_objects_and_are_replaced_by_values(tmp_path: Path) -> None:
    """A campaign of Python keeps them when it is saved; a sweep that sets their key sees plain campaigns."""
    campaign = mc.Campaign(REENTRY["scenario"], {"altitude": "1..5 km", "gyro_drift": "0.2 deg/h"})
    campaign.save(tmp_path / "c.toml")
    saved = read_campaign(tmp_path / "c.toml")
    assert [spec.text for spec in saved.ranges] == ["1..5 km"]
    assert saved.errors.standard_deviations[0] == 5e3
    assert campaign.vary({"errors.altitude": "2 km"}).document.ranges == ()
    assert [spec.path for spec in campaign.vary({"samples": 9}).document.ranges] == ["errors.altitude"]
    varied = VariedCampaign(tmp_path / "c.toml")
    assert varied.at({"errors.gyro_drift": "1 deg/h"}).ranges == ()
    assert document_of(saved).ranges == saved.ranges
