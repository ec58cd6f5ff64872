"""Keys of a campaign set by their paths: what each path sets, what it leaves, and one line for each mistake."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mcnav.config.overrides import override
from mcnav.config.read import campaign_from, read_campaign
from mcnav.errors import CampaignError
from mcnav.systems.ins.scenario import Ins
from tests.runs import vary

CAMPAIGNS = Path(__file__).parents[3] / "campaigns"
AIDED = CAMPAIGNS / "19_flight_with_gnss.toml"
DEG_PER_HOUR = np.radians(1.0) / 3600.0

SENSORS: dict[str, Any] = {
    "aiding": [
        {"type": "gnss", "position": {"north": "3 m", "east": "4 m"}, "velocity": ["1 m/s", "2 m/s", "3 m/s"]},
        {"type": "star-tracker", "attitude": "5 arcsec"},
        {"type": "altimeter", "name": "barometer", "correlated": {"sigma": "2 m", "correlation_time": "100 s"}},
    ]
}


def set_one(document: dict[str, Any], path: str, value: Any) -> dict[str, Any]:
    return override(document, {path: value})


def mistake(document: dict[str, Any], path: str, value: Any = "1 m") -> str:
    with pytest.raises(CampaignError) as caught:
        override(document, {path: value}, "mine.toml")
    (line,) = str(caught.value).splitlines()
    assert line.startswith(f"mine.toml: {path}: ")
    return line.removeprefix(f"mine.toml: {path}: ")


def test_the_document_itself_is_left() -> None:
    document = {"errors": {"altitude": {"sigma": "5 km"}}}
    assert set_one(document, "errors.altitude", "1 km") == {"errors": {"altitude": {"sigma": "1 km"}}}
    assert document == {"errors": {"altitude": {"sigma": "5 km"}}}


def test_tables_that_are_not_there_are_made() -> None:
    assert set_one({}, "filter.believes.imu.gyro.bias", "1 deg/h") == {
        "filter": {"believes": {"imu": {"gyro": {"bias": "1 deg/h"}}}}
    }


@pytest.mark.parametrize(
    ("present", "expected"),
    [
        ("5 km", "1 km"),
        ({"sigma": "5 km"}, {"sigma": "1 km"}),
        (
            {"distribution": "uniform", "half_width": "5 km"},
            {"distribution": "uniform", "half_width": "1 km"},
        ),
        (
            {"distribution": "truncated-normal", "sigma": "5 km", "limit": "9 km"},
            {"distribution": "truncated-normal", "sigma": "1 km", "limit": "9 km"},
        ),
        (
            {"distribution": "student-t", "sigma": "5 km", "degrees_of_freedom": 9},
            {"distribution": "student-t", "sigma": "1 km", "degrees_of_freedom": 9},
        ),
        ({"distribution": "fixed", "value": "5 km"}, {"distribution": "fixed", "value": "1 km"}),
        (
            {"distribution": "scipy.beta", "a": 2, "loc": "-1 km", "scale": "2 km"},
            {"distribution": "scipy.beta", "a": 2, "loc": "-1 km", "scale": "1 km"},
        ),
    ],
)
def test_a_quantity_sets_the_size_of_a_distribution(present: Any, expected: Any) -> None:
    assert set_one({"errors": {"altitude": present}}, "errors.altitude", "1 km") == {"errors": {"altitude": expected}}


def test_a_group_of_errors_holds_for_its_sources_with_entries_of_their_own() -> None:
    document = {"errors": {"position": "5 m", "position_down": {"distribution": "uniform", "half_width": "9 m"}}}
    assert set_one(document, "errors.position", "1 m")["errors"] == {
        "position": "1 m",
        "position_down": {"distribution": "uniform", "half_width": "1 m"},
    }
    some = {"errors": {"velocity_north": "1 m/s", "velocity_east": "2 m/s"}}
    assert set_one(some, "errors.velocity", "3 m/s")["errors"] == {"velocity_north": "3 m/s", "velocity_east": "3 m/s"}


def test_axes() -> None:
    every = {"imu": {"gyro": {"bias": ["1 deg/h", "2 deg/h", "3 deg/h"], "scale_factor": "5 ppm"}}}
    assert set_one(every, "imu.gyro.bias", "9 deg/h")["imu"]["gyro"]["bias"] == ["9 deg/h"] * 3
    assert set_one(every, "imu.gyro.bias.y", "9 deg/h")["imu"]["gyro"]["bias"] == ["1 deg/h", "9 deg/h", "3 deg/h"]
    one = set_one(every, "imu.gyro.scale_factor.y", "9 ppm")["imu"]["gyro"]["scale_factor"]
    assert one == {"x": "5 ppm", "y": "9 ppm", "z": "5 ppm"}


def test_sensors_by_name_type_and_number() -> None:
    found = set_one(SENSORS, "aiding.gnss.position", "1 m")["aiding"][0]["position"]
    assert found == {"north": "1 m", "east": "1 m"}
    assert set_one(SENSORS, "aiding.gnss.velocity.east", "9 m/s")["aiding"][0]["velocity"] == [
        "1 m/s",
        "9 m/s",
        "3 m/s",
    ]
    assert set_one(SENSORS, "aiding.star_tracker.attitude", "1 arcsec")["aiding"][1]["attitude"] == "1 arcsec"
    third = {"sigma": "1 m", "correlation_time": "100 s"}
    assert set_one(SENSORS, "aiding.barometer.correlated", "1 m")["aiding"][2]["correlated"] == third
    assert set_one(SENSORS, "aiding.3.correlated.sigma", "1 m")["aiding"][2]["correlated"] == third
    limits = {"accept": {"r95": [{"below": "1 m"}, {"below": "2 m"}]}}
    assert set_one(limits, "accept.r95.2.below", "9 m")["accept"]["r95"] == [{"below": "1 m"}, {"below": "9 m"}]


def test_entries_of_lists_by_number() -> None:
    """Of a list of lists both numbers are given; the other entries stay."""
    outages = {"aiding": [{"type": "gnss", "outages": [["1 s", "2 s"], ["5 s", "6 s"]], "instants": ["3 s", "4 s"]}]}
    assert set_one(outages, "aiding.gnss.outages.2.1", "4 s")["aiding"][0]["outages"] == [
        ["1 s", "2 s"],
        ["4 s", "6 s"],
    ]
    assert set_one(outages, "aiding.gnss.instants.2", "9 s")["aiding"][0]["instants"] == ["3 s", "9 s"]
    assert "such as aiding.gnss.outages.1.1" in mistake(outages, "aiding.gnss.outages.1")
    assert "from 1 to 2" in mistake(outages, "aiding.gnss.outages.3.1")
    assert mistake(outages, "aiding.gnss.outages.1.2.3") == "aiding.gnss.outages.1.2 is not a table"
    found = vary(AIDED, {"aiding.gnss.outages.1.2": "1300 s"})
    assert isinstance(found.scenario, Ins)
    assert found.scenario.navigation.sensors[0].outages == ((1200.0, 1300.0),)


def test_outages_by_their_length_and_begin() -> None:
    outages = {"aiding": [{"type": "gnss", "outages": [["1 s", "2 s"], ["1 min", "90 s"]]}]}
    assert set_one(outages, "aiding.gnss.outages.2.length", "1 min")["aiding"][0]["outages"][1] == ["60.0 s", "120.0 s"]
    assert set_one(outages, "aiding.gnss.outages.2.begin", "100 s")["aiding"][0]["outages"][1] == ["100.0 s", "130.0 s"]
    assert "expected a time" in mistake(outages, "aiding.gnss.outages.2.length", "3 m")
    assert "from 1 to 2" in mistake(outages, "aiding.gnss.outages.2.middle", "3 s")


def test_a_sensor_or_a_state_that_is_absent() -> None:
    faults = [{"sensor": "barometer", "kind": "spike"}, {"sensor": "gnss", "kind": "spike"}]
    believes = {"aiding": {"barometer": {"altitude": "1 m"}}}
    document = {**SENSORS, "faults": faults, "filter": {"estimates": ["position", "gyro_bias"], "believes": believes}}
    found = set_one(document, "aiding.barometer", "absent")
    assert [entry["type"] for entry in found["aiding"]] == ["gnss", "star-tracker"]
    assert found["faults"] == faults[1:]
    assert found["filter"]["believes"] == {"aiding": {}}
    assert set_one(document, "aiding.barometer", "present") == document
    assert set_one(document, "filter.estimates.gyro_bias", "absent")["filter"]["estimates"] == ["position"]
    assert set_one(document, "filter.estimates.gyro_bias", "present") == document
    added = set_one(document, "filter.estimates.gnss_position_bias", "present")["filter"]["estimates"]
    assert added == ["position", "gyro_bias", "gnss_position_bias"]
    states = ["position", "gnss_position_bias", "gnss_2_lever_arm"]
    sensors = [{"type": "gnss"}, {"type": "gnss", "name": "gnss_2"}]
    both = {"aiding": sensors, "filter": {"estimates": states, "considers": ["gnss_lever_arm"]}}
    assert set_one(both, "aiding.gnss", "absent")["filter"] == {"estimates": [states[0], states[2]], "considers": []}
    assert "no sensor of [[aiding]] is named 'radar'" in mistake(document, "aiding.radar", "absent")
    found = vary(AIDED, {"filter.estimates.gyro_bias": "absent"})
    assert isinstance(found.scenario, Ins)
    assert found.scenario.navigation.filter is not None
    assert found.scenario.navigation.filter.estimates == ("accelerometer_bias",)


def test_values_of_the_catalogue_count_as_those_of_the_file() -> None:
    """A process keeps its correlation time, an axis leaves the others as the grade has them."""
    imu = {"imu": {"grade": "navigation", "accelerometer": {"bias": "1 ug"}}}
    gyro = set_one(imu, "imu.gyro.bias.x", "9 deg/h")["imu"]["gyro"]
    assert gyro["bias"]["x"] == "9 deg/h"
    assert gyro["bias"]["y"] == gyro["bias"]["z"] != "9 deg/h"
    assert set_one(imu, "imu.accelerometer.scale_factor", "1 ppm")["imu"]["accelerometer"]["bias"] == "1 ug"


def test_a_varied_campaign_reads_as_one_written_so() -> None:
    found = vary(AIDED, {"imu.gyro.bias": "0.016 deg/h", "aiding.gnss.position": "6 m", "errors.tilt": "0.1 mrad"})
    before = read_campaign(AIDED)
    assert isinstance(found.scenario, Ins)
    assert isinstance(before.scenario, Ins)
    ratio = found.errors.standard_deviations / np.where(before.errors.standard_deviations > 0.0, 1.0, np.nan)
    expected = {"gyro_bias_y": 0.016 * DEG_PER_HOUR, "tilt_north": 1e-4, "position_down": 5.0}
    for name, sigma in expected.items():
        assert ratio[found.errors.names.index(name)] == pytest.approx(sigma)
    assert found.scenario.navigation.sensors[0].components[0].noise == 6.0
    assert found.file == str(AIDED)


def test_campaigns_of_every_form() -> None:
    mapping = {
        "scenario": {"type": "reentry", "trajectory": 4},
        "errors": {"altitude": "1 km"},
    }
    for campaign in (mapping, campaign_from(mapping)):
        varied = vary(campaign, {"errors.altitude": "2 km"})
        assert varied.errors.standard_deviations[0] == 2000.0
    read = read_campaign(CAMPAIGNS / "01_tn_d1772_trajectory_4.toml")
    assert vary(read, {"errors.altitude": "2 km"}).errors.standard_deviations[0] == 2000.0


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"imu.gyro.biass": "1 deg/h"}, "imu.gyro.biass: unknown key; did you mean 'bias'?"),
        ({"imu.gyro.bias": "1 km"}, "imu.gyro.bias: got '1 km', which is a length; expected an angular rate"),
        ({"imuu.gyro.bias": "1 deg/h"}, "imuu: unknown key; did you mean 'imu'?"),
        ({"errors.tilt_nort": "1 mrad"}, "errors.tilt_nort: unknown error source; did you mean 'tilt_north'?"),
        ({"scenario.end": "9999 s"}, "scenario.end: got 9999 s; the trajectory has 0 to"),
    ],
)
def test_unknown_keys_and_wrong_units_are_found_when_it_is_read(values: dict[str, str], message: str) -> None:
    with pytest.raises(CampaignError) as caught:
        vary(AIDED, values)
    (line,) = str(caught.value).splitlines()
    assert line.startswith(f"{AIDED}: {message}")


def test_paths_that_lead_nowhere() -> None:
    assert mistake({}, "imu..bias").startswith("expected the names of tables")
    assert "no sensor of [[aiding]] is named 'gns'; did you mean 'gnss'?" in mistake(SENSORS, "aiding.gns.position")
    assert mistake({}, "aiding.gnss.position") == "the campaign has no [[aiding]]"
    assert mistake(SENSORS, "aiding.gnss") == "expected a key of this entry as well"
    assert mistake(SENSORS, "aiding") == "has several entries; expected the number of one, such as aiding.1"
    assert "from 1 to 1" in mistake({"accept": {"cep": [{"below": "1 m"}]}}, "accept.cep.2.below")
    assert mistake({"seed": 1}, "seed.of.it") == "seed is not a table"
    law = {"scenario": {"lift_law": {"type": "constant", "lift_to_drag": 0.2}}}
    assert mistake(law, "scenario.lift_law", 0.3) == "is a table; name one of its keys: type, lift_to_drag"
    measured = {"errors": {"bias_z": {"distribution": "table", "file": "a.csv", "column": "b", "unit": "ug"}}}
    assert mistake(measured, "errors.bias_z") == "takes its values from a file; it has no size to set"
    shaped = {"errors": {"bias_z": {"distribution": "scipy.beta", "a": 2, "b": 2}}}
    assert "without a scale" in mistake(shaped, "errors.bias_z")
    assert "expected 3, for x, y, z" in mistake({"imu": {"gyro": {"bias": ["1 deg/h"]}}}, "imu.gyro.bias.x")
