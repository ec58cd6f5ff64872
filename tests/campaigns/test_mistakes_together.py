"""All mistakes of a file are listed together, whichever tables they are in."""

from __future__ import annotations

import copy
import tomllib
from itertools import combinations
from pathlib import Path
from typing import Any, Final

import pytest

from mcnav.config.read import parse_campaign
from mcnav.errors import CampaignError

AIDED: Final = """
name = "aided"
samples = 100
[scenario]
type = "ins"
[scenario.trajectory]
rate = "1 Hz"
start = { latitude = "47 deg", longitude = "9 deg", altitude = "500 m", course = "80 deg", speed = "50 m/s" }
segments = [{ hold = "60 s" }]
[imu.gyro]
bias = "1 deg/h"
[gravity]
anomaly = { sigma = "30 mGal", correlation_length = "50 km" }
[errors]
position_north = "1 m"
gnss_position_bias_north = "1 m"
[[correlations]]
between = ["position_north", "gnss_position_bias_north"]
coefficient = 0.3
[[aiding]]
type = "gnss"
interval = "1 s"
position = "3 m"
[[faults]]
kind = "spike"
sensor = "gnss"
component = "position_north"
begin = "10 s"
size = "20 m"
[filter]
estimates = ["position", "velocity", "attitude", "gnss_position_bias"]
gate = 0.99
[[accept.quantile]]
output = "position_north"
probability = 0.9
below = "3 m"
[[accept.cep]]
outputs = ["position_north", "position_east"]
below = "3 m"
"""

MISTAKES: Final[dict[str, tuple[str | int, ...]]] = {
    "samples": ("samples",),
    "design": ("design",),
    "scenario.platform": ("scenario", "platform"),
    "scenario.trajectory.rate": ("scenario", "trajectory", "rate"),
    "imu.gyro.bias": ("imu", "gyro", "bias"),
    "imu.gyro.bais": ("imu", "gyro", "bais"),
    "gravity.anomaly.sigma": ("gravity", "anomaly", "sigma"),
    "errors.position_north": ("errors", "position_north"),
    "errors.positoin_east": ("errors", "positoin_east"),
    "correlations #1.coefficient": ("correlations", 0, "coefficient"),
    "correlations #1.between": ("correlations", 0, "between", 0),
    "aiding #1.interval": ("aiding", 0, "interval"),
    "faults #1.begin": ("faults", 0, "begin"),
    "filter.gate": ("filter", "gate"),
    "filter.estimates": ("filter", "estimates", 0),
    "accept.quantile #1.probability": ("accept", "quantile", 0, "probability"),
    "accept.quantile #1.output": ("accept", "quantile", 0, "output"),
    "accept.cep #1.outputs": ("accept", "cep", 0, "outputs", 1),
    "accept.cep #1.below": ("accept", "cep", 0, "below"),
}
"""A mistake that is told under a key, and where it is written."""

NAMES: Final = (
    "design",
    "correlations #1.between",
    "filter.estimates",
    "accept.quantile #1.output",
    "accept.cep #1.outputs",
)
"""Mistakes in names; the others are in quantities."""


def with_mistakes(*keys: str) -> dict[str, Any]:
    """Return the campaign with a wrong entry at each of these places."""
    content = copy.deepcopy(tomllib.loads(AIDED))
    for key in keys:
        *path, last = MISTAKES[key]
        table: Any = content
        for part in path:
            table = table[part]
        table[last] = "nonesuch" if key in NAMES else -5 if key == "samples" else "3 candela"
    return content


def told(content: dict[str, Any]) -> list[str]:
    """Return the keys of the mistakes of a campaign."""
    with pytest.raises(CampaignError) as refused:
        parse_campaign(content, str(Path("aided.toml")), "aided")
    return [problem.key for problem in refused.value.problems]


def test_the_campaign_without_mistakes_is_read() -> None:
    assert parse_campaign(with_mistakes(), "aided.toml", "aided").name == "aided"


@pytest.mark.parametrize("key", MISTAKES)
def test_one_mistake_is_told_alone(key: str) -> None:
    """A table that cannot be read makes no other one wrong."""
    assert set(told(with_mistakes(key))) == {key}


@pytest.mark.parametrize("first", MISTAKES)
def test_two_mistakes_are_told_together(first: str) -> None:
    for second in MISTAKES:
        if second != first:
            assert set(told(with_mistakes(first, second))) == {first, second}


def test_all_mistakes_are_told_together() -> None:
    assert set(told(with_mistakes(*MISTAKES))) == set(MISTAKES)
    for several in combinations(MISTAKES, 17):
        assert set(told(with_mistakes(*several))) == set(several)


def test_a_missing_sensor_leaves_other_tables_checked() -> None:
    content = with_mistakes("errors.position_north", "accept.cep #1.below")
    del content["aiding"]
    keys = set(told(content))
    assert {"errors.position_north", "accept.cep #1.below", "filter", "faults"} <= keys
