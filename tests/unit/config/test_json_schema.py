"""The JSON schema of campaign files accepts and refuses what the program does, as far as structure goes."""

from __future__ import annotations

import copy
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft7Validator

from mcnav.config.json_schema.campaign import campaign_schema
from mcnav.config.read import parse_campaign, read_campaign
from mcnav.errors import CampaignError
from tests.conftest import ROOT

Content = dict[str, Any]
Place = tuple[str | int, ...]

CAMPAIGNS = sorted((ROOT / "campaigns").glob("*.toml"))

AIDED = tomllib.loads("""
name = "A vehicle at rest with every sensor"
samples = { until = "sigma_ratio 5 %", confidence = 0.9, at_most = 1_000 }
design = "antithetic"
tolerance = 0.1

[scenario]
type = "ins"
platform = "strapdown"
start = "0 s"
end = "60 s"
trajectory = { rate = "1 Hz", start = { latitude = "47 deg", longitude = "9 deg" }, segments = [{ hold = "60 s" }] }

[imu]
grade = "navigation"
gyro = { bias = "0.01 deg/h", bias_instability = { sigma = "0.003 deg/h", correlation_time = "1 h" } }
accelerometer = { misalignment = "1 mrad", quantization = "1e-4 m/s" }

[errors]
position = "5 m"
velocity_north = { distribution = "uniform", half_width = "0.1 m/s" }
tilt = { distribution = "scipy.t", df = 5, scale = "1 mrad" }
gnss_lever_arm_x = "2 cm"
barometer_delay = { distribution = "fixed", value = "50 ms" }
barometer_bias = { distribution = "fixed", value = "10 m" }

[[correlations]]
between = ["position_north", "velocity_north"]
coefficient = 0.3

[[joint]]
sources = ["position_east", "position_down"]
distribution = "student-t"
degrees_of_freedom = 5

[[aiding]]
type = "gnss"
interval = "10 s"
outages = [["20 s", "40 s"]]
position = "3 m"
velocity = "0.1 m/s"
position_correlated = { sigma = "2 m", correlation_time = "100 s" }
lever_arm = ["1 m", "0 m", "-0.5 m"]
delay = "20 ms"
jitter = "5 ms"
gate = 0.999

[[aiding]]
type = "altimeter"
name = "barometer"
interval = "10 s"
begin = "20 s"
end = "50 s"
altitude = "2 m"
scale_factor = "0.1 %"
kind = "radar"
ceiling = "100 m"

[[aiding]]
type = "star-tracker"
instants = ["20 s", "40 s"]
attitude = "10 arcsec"
bias = "5 arcsec"

[[aiding]]
type = "position-fix"
instants = ["30 s"]
position = { north = "10 m", east = "10 m" }

[[aiding]]
type = "zero-velocity"
interval = "10 s"
velocity = "1 cm/s"

[[aiding]]
type = "velocity"
interval = "10 s"
velocity = "0.1 m/s"
scale_factor = "1000 ppm"

[[aiding]]
type = "heading"
interval = "10 s"
heading = "1 deg"
correlated = { sigma = "1 deg", correlation_time = "60 s" }

[filter]
estimates = ["position", "velocity", "attitude", "gyro_bias", "barometer_scale_factor", "barometer_delay"]
considers = ["gnss_lever_arm", "gnss_delay"]
gate = 0.9999

[filter.believes.imu.gyro]
bias = "0.02 deg/h"
bias_instability = { sigma = "0.01 deg/h" }

[filter.believes.errors]
tilt = "2 mrad"
gnss_lever_arm = "5 cm"

[filter.believes.aiding.gnss]
position = "5 m"
delay = "30 ms"

[accept]
sigma_ratio = "5 %"
quantile = [{ output = "heading", probability = 0.9, below = "1 rad", at = "30 s" }]
r95 = [{ outputs = ["position_north", "position_east"], below = "1 km", during = "outages" }]
sep = [{ outputs = ["position_north", "position_east", "position_down"], below = "1 km", during = ["20 s", "50 s"] }]
box = [{ within = { position_north = "1 km", tilt_north = "1 rad" }, probability = 0.9 }]
""")
"""A campaign with every sensor that takes milliseconds to read."""

WITHOUT_SENSORS: Content = dict.fromkeys(("aiding", "filter", "accept", "correlations", "joint"))

FORMS: dict[str, Content] = {
    "axes as a list": {"imu": {"gyro": {"bias": ["1 deg/h", "2 deg/h", "3 deg/h"]}}},
    "axes as a table": {"imu": {"accelerometer": {"misalignment": {"xy": "1 mrad"}}}},
    "Allan minimum": {"imu": {"gyro": {"bias_instability": {"allan_minimum": "1 deg/h", "correlation_time": "1 h"}}}},
    "quantization as a step": {"imu": {"gyro": {"quantization": {"step": "1e-5 rad", "interval": "0.02 s"}}}},
    "quantization by axis": {"imu": {"gyro": {"quantization": {"x": "1e-6 rad"}}}},
    "units as on data sheets": {"imu": {"gyro": {"angle_random_walk": "0.1 °/√h"}}},
    "a number of samples": {"samples": 100, "design": "sobol", "imu": {}},
    "a sphere": {
        "scenario": AIDED["scenario"]
        | {"earth": {"radius": "6378 km", "gravitational_parameter": "4e14 m^3/s^2", "rotation_rate": "0 rad/s"}}
    },
    "a reentry on the globe": {"scenario": {"type": "ins", "trajectory": {"reentry": 4, "azimuth": "60 deg"}}},
    "a boost": {
        "scenario": {
            "type": "ins",
            "trajectory": {
                "boost": {
                    "latitude": "28 deg",
                    "longitude": "-80 deg",
                    "azimuth": "90 deg",
                    "stages": [{"acceleration": "1.3 g", "last": "3.5 g", "burn": "60 s"}],
                }
            },
        }
    },
    "segments": {
        "scenario": {
            "type": "ins",
            "trajectory": {
                "start": {"latitude": "47 deg", "longitude": "9 deg"},
                "segments": [
                    {"hold": "10 s"},
                    {"speed": "80 m/s", "acceleration": "2 m/s^2"},
                    {"climb": "300 m"},
                    {"turn": "90 deg", "bank": "30 deg"},
                    {"turn": "-90 deg", "rate": "3 deg/s"},
                    {"straight": "1 min"},
                    {"straight": "5 km"},
                    {"to": {"latitude": "47.2 deg", "longitude": "9.2 deg"}},
                ],
            },
        }
    },
    "start times": {
        "start_times": {"count": 5, "weights": {"position_north": "1 m"}, "errors": {"heading": [["0 s", "1 mrad"]]}},
        "errors": {"heading": "1 mrad"},
    },
}
"""Other forms of entries; each replaces those of `AIDED` without its sensors."""

WRONG: dict[str, Content] = {
    "sensors without a filter": {"filter": None},
    "a filter without sensors": {"aiding": None, "accept": None},
    "an unknown type of sensor": {"aiding": [{"type": "sextant", "interval": "10 s", "attitude": "1 deg"}]},
    "instants and an interval": {
        "aiding": [{"type": "heading", "interval": "10 s", "instants": ["20 s"], "heading": "1 deg"}]
    },
    "neither": {"aiding": [{"type": "heading", "heading": "1 deg"}]},
    "limits without an interval": {
        "aiding": [{"type": "heading", "instants": ["20 s"], "end": "30 s", "heading": "1 deg"}]
    },
    "nothing measured": {"aiding": [{"type": "gnss", "interval": "10 s"}]},
    "a key of another sensor": {
        "aiding": [{"type": "heading", "interval": "10 s", "heading": "1 deg", "altitude": "1 m"}]
    },
    "a vehicle at rest that is late": {
        "aiding": [{"type": "zero-velocity", "interval": "10 s", "velocity": "1 cm/s", "delay": "20 ms"}]
    },
    "a lever arm for all axes": {
        "aiding": [{"type": "gnss", "interval": "10 s", "position": "1 m", "lever_arm": "1 m"}]
    },
    "two values for three axes": {"aiding": [{"type": "gnss", "interval": "10 s", "position": ["1 m", "1 m"]}]},
    "a filter without attitude": {"filter": {"estimates": ["position", "velocity"]}},
    "a state twice": {"filter": {"estimates": ["position", "velocity", "attitude", "gyro_bias", "gyro_bias"]}},
    "an unknown state": {"filter": {"estimates": ["position", "velocity", "attitude", "gyro_biass"]}},
    "believed quantization": {
        "filter": AIDED["filter"] | {"believes": {"imu": {"gyro": {"quantization": "1e-6 rad"}}}}
    },
    "an unknown grade": {"imu": {"grade": "tactica"}},
    "instability without its time": {"imu": {"gyro": {"bias_instability": {"sigma": "1 deg/h"}}}},
    "instability of two sizes": {
        "imu": {
            "gyro": {"bias_instability": {"sigma": "1 deg/h", "allan_minimum": "1 deg/h", "correlation_time": "1 h"}}
        }
    },
    "an unknown axis": {"imu": {"gyro": {"bias": {"w": "1 deg/h"}}}},
    "no scenario": {"scenario": None},
    "no type": {"scenario": {"trajectory": {"reentry": 4}}},
    "an unknown type": {"scenario": {"type": "submarine"}},
    "keys of another type": {"scenario": AIDED["scenario"] | {"duration": "1 h"}},
    "a trajectory of no kind": {"scenario": {"type": "ins", "trajectory": {"latitude": "1 deg"}}},
    "a trajectory of two kinds": {"scenario": {"type": "ins", "trajectory": {"reentry": 4, "file": "flight.csv"}}},
    "a bank and a rate": {
        "scenario": {
            "type": "ins",
            "trajectory": {
                "start": {"latitude": "1 deg", "longitude": "1 deg", "speed": "80 m/s"},
                "segments": [{"turn": "90 deg", "bank": "20 deg", "rate": "1 deg/s"}],
            },
        }
    },
    "a distribution without a key": {"errors": {"heading": {"distribution": "uniform"}}},
    "an unknown distribution": {"errors": {"heading": {"distribution": "uniformm", "half_width": "1 mrad"}}},
    "an unknown source": {"errors": {"headin": "1 mrad"}},
    "a source of another scenario": {"errors": {"misalignment": "1 mrad"}},
    "a number without a unit": {"errors": {"heading": 1e-3}},
    "a text without a unit": {"errors": {"heading": "0.001"}},
    "a correlation of an unknown source": {"correlations": [{"between": ["heading", "headin"], "coefficient": 0.1}]},
    "a correlation with two coefficients": {
        "correlations": [
            {"between": ["heading", "tilt_north"], "coefficient": 0.1, "rank_coefficient": 0.1},
        ]
    },
    "a joint distribution without a variance": {
        "joint": [{"sources": ["heading", "tilt_north"], "distribution": "student-t", "degrees_of_freedom": 2}]
    },
    "a requirement over half a span": {
        "accept": {"quantile": [{"output": "heading", "probability": 0.9, "below": "1 rad", "during": ["30 s"]}]}
    },
    "a requirement on an unknown output": {
        "accept": {"quantile": [{"output": "altitude", "probability": 0.9, "below": "1 m"}]}
    },
    "an unknown precision": {"samples": {"until": "sigma 1 %", "at_most": 1_000}},
    "a probability of one": {"accept": {"quantile": [{"output": "heading", "probability": 1.0, "below": "1 rad"}]}},
    "instruments of a reentry": WITHOUT_SENSORS | {"scenario": {"type": "reentry", "trajectory": 4}, "errors": {}},
}
"""Mistakes of structure: entries that replace those of `AIDED`; None leaves one out."""

UNKNOWN: dict[str, Content] = {
    "a unit of another dimension": {"errors": {"heading": "1 m"}},
    "a unit that there is not": {"errors": {"heading": "1 parsec"}},
    "a sensor that there is not": {"filter": AIDED["filter"] | {"considers": ["sextant_bias"]}},
    "a time beyond the trajectory": {"scenario": AIDED["scenario"] | {"end": "2 h"}},
    "a file that does not exist": {"scenario": {"type": "ins", "trajectory": "nowhere.csv"}},
}
"""Mistakes that the schema cannot know."""


@cache
def validator() -> Draft7Validator:
    return Draft7Validator(campaign_schema())


def replaced(entries: Content) -> Content:
    return {key: value for key, value in (AIDED | entries).items() if value is not None}


def refuses(content: Content) -> bool:
    try:
        parse_campaign(content, "mine.toml", "mine")
    except CampaignError:
        return True
    return False


def test_it_is_a_schema() -> None:
    Draft7Validator.check_schema(campaign_schema())


@pytest.mark.parametrize("path", CAMPAIGNS, ids=lambda path: path.stem)
def test_every_campaign(path: Path) -> None:
    assert [error.message for error in validator().iter_errors(tomllib.loads(path.read_text(encoding="utf-8")))] == []


def test_a_campaign_with_all_defaults_spelled_out() -> None:
    for name in ("08_every_option", "12_hover", "14_polar", "22_navaho", "23_lunar_return_updated_once"):
        resolved = read_campaign(ROOT / "campaigns" / f"{name}.toml").resolved
        assert [error.message for error in validator().iter_errors(resolved)] == []


def test_a_campaign_with_every_sensor() -> None:
    assert [error.message for error in validator().iter_errors(AIDED)] == []
    assert not refuses(AIDED)


@pytest.mark.parametrize("name", FORMS)
def test_other_forms(name: str) -> None:
    content = replaced({**WITHOUT_SENSORS, "errors": {}} | FORMS[name])
    content["scenario"] = {"start": "0 s", **content["scenario"]}
    assert [error.message for error in validator().iter_errors(content)] == []
    assert not refuses(content)


@pytest.mark.parametrize("name", WRONG)
def test_mistakes_of_structure(name: str) -> None:
    content = replaced(WRONG[name])
    assert refuses(content)
    assert not validator().is_valid(content)


@pytest.mark.parametrize("name", UNKNOWN)
def test_what_the_schema_cannot_know(name: str) -> None:
    content = replaced(UNKNOWN[name])
    assert refuses(content)
    assert validator().is_valid(content)


def changed(content: Content) -> Iterator[tuple[Place, Content]]:
    """Yield the content with each key misspelled, and with each value replaced by one that no key takes."""
    for place in places(content):
        for wrong in ("key", "value"):
            other = copy.deepcopy(content)
            table: Any = other
            for part in place[:-1]:
                table = table[part]
            last = place[-1]
            if wrong == "value":
                table[last] = True
            elif isinstance(last, str):
                table[f"{last}x"] = table.pop(last)
            else:
                continue
            yield place, other


def places(entry: Any, above: Place = ()) -> Iterator[Place]:
    items = entry.items() if isinstance(entry, dict) else enumerate(entry) if isinstance(entry, list) else ()
    for key, value in items:
        yield (*above, key)
        yield from places(value, (*above, key))


NAMED = {
    ("filter", "believes", "aiding", "gnss"),
    *(("errors", *names) for names in (("tilt", "df"), ("range", "a"), ("range", "b"), ("range", "loc"))),
}
"""Names of sensors, which another table has, and of parameters of scipy's distributions."""


def test_every_key_misspelled_and_every_value_of_the_wrong_type() -> None:
    content = copy.deepcopy(AIDED)
    count = 0
    for place, wrong in changed(content):
        assert refuses(wrong), place
        assert (place in NAMED) or not validator().is_valid(wrong), place
        count += 1
    assert count > 200


@pytest.mark.parametrize("path", CAMPAIGNS, ids=lambda path: path.stem)
def test_the_same_for_every_campaign(path: Path) -> None:
    content = tomllib.loads(path.read_text(encoding="utf-8"))
    own = ".py:" in content["scenario"]["type"]
    for place, wrong in changed(content):
        if place not in NAMED and not (own and place[0] in ("scenario", "errors", "processes", "measurements")):
            assert not validator().is_valid(wrong), place


def described(node: Any, at: str) -> Iterator[str]:
    """Yield the keys of a schema without a description; those beside an open table stand in it."""
    if isinstance(node, dict):
        for key, value in node.get("properties", {}).items():
            if isinstance(value, dict) and "description" not in value:
                yield f"{at}.{key}"
        for key, value in node.items():
            if key not in ("if", "then", "else", "dependencies", "examples", "enum"):
                yield from described(value, f"{at}.{key}" if key != "properties" else at)
    elif isinstance(node, list):
        for each in node:
            yield from described(each, at)


def test_every_key_has_a_description() -> None:
    short = {"north", "east", "down", "x", "y", "z", "xy", "xz", "yx", "yz", "zx", "zy", "1", "2", "3"}
    schema = campaign_schema()
    found = [place for place in described(schema, "") if place.rpartition(".")[2] not in short]
    assert found == []
