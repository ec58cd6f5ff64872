"""The entries of [[aiding]]: sensors and their instants, sizes of errors, and one line for each mistake."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mcnav.config.campaign import Campaign
from mcnav.config.read import parse_campaign
from mcnav.contract.questions import UNMEASURED
from mcnav.errors import CampaignError
from mcnav.systems.ins.scenario import Ins
from mcnav.systems.ins.sensors.aiding import Sensor
from mcnav.systems.ins.tables.faults import NO_AIDING
from mcnav.systems.ins.tables.instants import MOST_MEASUREMENTS

STATES = ["position", "velocity", "attitude"]
GNSS = {"type": "gnss", "interval": "1 s", "position": "3 m"}
ALTIMETER = {"type": "altimeter", "interval": "1 s", "altitude": "3 m"}


def described(*aiding: Any, **changes: Any) -> dict[str, Any]:
    """Five minutes: a minute at rest at 500 m, a take-off, a climb of 200 m, straight on."""
    start = {"latitude": "47 deg", "longitude": "9 deg", "altitude": "500 m", "course": "80 deg"}
    segments = [{"hold": "60 s"}, {"speed": "80 m/s"}, {"climb": "200 m"}, {"straight": "20 km"}]
    flown = {"rate": "1 Hz", "start": start, "segments": segments}
    return {
        "samples": 100,
        "scenario": {"type": "ins", "trajectory": flown, "start": "0 s", "end": "300 s", **changes.pop("scenario", {})},
        "imu": {"gyro": {"bias": "0.1 deg/h", "angle_random_walk": "0.01 deg/sqrt(h)"}},
        "errors": {"position": "10 m", **changes.pop("errors", {})},
        "aiding": list(aiding),
        "filter": {"estimates": STATES},
        **changes,
    }


def read(*aiding: Any, **changes: Any) -> Campaign:
    return parse_campaign(described(*aiding, **changes), "mine.toml", "mine")


def sensors(*aiding: Any, **changes: Any) -> tuple[Sensor, ...]:
    scenario = read(*aiding, **changes).scenario
    assert isinstance(scenario, Ins)
    return scenario.navigation.sensors


def mistakes(content: dict[str, Any]) -> list[str]:
    with pytest.raises(CampaignError) as found:
        parse_campaign(content, "mine.toml", "mine")
    return str(found.value).splitlines()


def test_a_sensor_with_everything() -> None:
    entry = {
        "type": "gnss",
        "name": "receiver",
        "interval": "1 s",
        "position": {"north": "3 m", "east": "4 m"},
        "velocity": ["0.1 m/s", "0.2 m/s", "0.3 m/s"],
        "position_bias": "1 m",
        "velocity_bias": {"down": "1 cm/s"},
        "position_correlated": {"sigma": "2 m", "correlation_time": ["100 s", "200 s", "300 s"]},
        "lever_arm": ["1 m", "0 m", "-0.5 m"],
        "lever_arm_error": "2 cm",
        "delay": "20 ms",
        "jitter": "5 ms",
        "gate": "99.9 %",
    }
    campaign = read(entry, errors={"position": "10 m", "receiver_velocity_bias_east": "2 cm/s"})
    assert isinstance(campaign.scenario, Ins)
    (found,) = campaign.scenario.navigation.sensors
    assert (found.name, found.kind, found.has_lever_arm) == ("receiver", "gnss", True)
    assert found.gate == pytest.approx(0.999)
    assert (found.has_delay, found.jitter) == (True, 0.005)
    assert found.lever_arm == pytest.approx([1.0, 0.0, -0.5])
    measured = [(each.quantity, each.axis, each.noise, each.correlated) for each in found.components]
    assert measured == [
        ("position", 0, 3.0, 2.0), ("position", 1, 4.0, 2.0),
        ("velocity", 0, 0.1, 0.0), ("velocity", 1, 0.2, 0.0), ("velocity", 2, 0.3, 0.0),
    ]  # fmt: skip
    assert [each.correlation_time for each in found.components[:2]] == [100.0, 200.0]
    assert {each.label for each in found.components} == {"receiver_position", "receiver_velocity"}
    sigmas = dict(zip(campaign.errors.names, campaign.errors.standard_deviations, strict=True))
    of_sensor = {name: sigma for name, sigma in sigmas.items() if name.startswith("receiver") and sigma > 0.0}
    assert of_sensor == pytest.approx(
        {
            "receiver_position_bias_north": 1.0, "receiver_position_bias_east": 1.0,
            "receiver_velocity_bias_east": 0.02, "receiver_velocity_bias_down": 0.01,
            "receiver_lever_arm_x": 0.02, "receiver_lever_arm_y": 0.02, "receiver_lever_arm_z": 0.02,
            "receiver_delay": 0.02,
        }
    )  # fmt: skip


@pytest.mark.parametrize(
    ("entry", "quantity", "axes", "constants"),
    [
        (GNSS, "position", 3, 7),
        ({"type": "gnss", "interval": "1 s", "velocity": "1 m/s"}, "velocity", 3, 7),
        ({**ALTIMETER, "bias": "30 m", "scale_factor": "1e-3"}, "altitude", 1, 3),
        ({"type": "star-tracker", "interval": "1 s", "attitude": "5 arcsec", "bias": "3 arcsec"}, "attitude", 3, 4),
        ({"type": "position-fix", "instants": ["100 s"], "position": {"north": "9 m", "down": "9 m"}}, "position", 2,
         3),
        ({"type": "zero-velocity", "instants": ["30 s"], "velocity": "1 cm/s"}, "velocity", 3, 3),
        ({"type": "velocity", "interval": "1 s", "velocity": {"x": "1 m/s"}, "scale_factor": "1 %"}, "body_velocity", 1,
         3),
        ({"type": "heading", "interval": "1 s", "heading": "1 deg", "bias": "2 deg"}, "heading", 1, 2),
    ],
    ids=lambda each: each["type"] if isinstance(each, dict) else str(each),
)  # fmt: skip
def test_every_type(entry: dict[str, Any], quantity: str, axes: int, constants: int) -> None:
    """By default a sensor has the name of its type."""
    (found,) = sensors(entry)
    assert found.name == entry["type"].replace("-", "_")
    assert [each.quantity for each in found.components] == axes * [quantity]
    assert len(list(found.constants())) == constants
    assert all(name.startswith(f"{found.name}_") for name in found.constants())


def test_instants_of_an_interval() -> None:
    """The first one is at begin, or else an interval after the start; limits are included, ends of outages not."""
    (every,) = sensors({**GNSS, "interval": "60 s"}, scenario={"start": "30 s", "end": "270 s"})
    assert every.times.tolist() == [90.0, 150.0, 210.0, 270.0]
    (some,) = sensors({**GNSS, "begin": "100 s", "end": "104 s"})
    assert some.times.tolist() == [100.0, 101.0, 102.0, 103.0, 104.0]
    (without,) = sensors({**GNSS, "interval": "10 s", "begin": "195 s", "outages": [["210 s", "1 h"], ["5 s", "9 s"]]})
    assert without.times.tolist() == [195.0, 205.0]
    assert without.outages == ((5.0, 9.0), (210.0, 3600.0))
    (twice,) = sensors({**GNSS, "interval": "20 s", "outages": [["20 s", "80 s"], ["100 s", "280 s"]]})
    assert twice.times.tolist() == [80.0, 280.0, 300.0]


@pytest.mark.parametrize(
    ("begin", "expected"),
    [
        (31.0, [31.0, 38.0, 45.0, 52.0, 59.0]),
        (37.5, [37.5, 44.5, 51.5, 58.5]),
        (58.0, [58.0]),
        (30.0, [37.0, 44.0, 51.0, 58.0]),
        (8.0, [36.0, 43.0, 50.0, 57.0]),
        (9.0, [37.0, 44.0, 51.0, 58.0]),
        (61.0, []),
        (None, [37.0, 44.0, 51.0, 58.0]),
    ],
)
def test_begin_is_the_first_measurement(begin: float | None, expected: list[float]) -> None:
    """From there on an interval apart, whatever the start of navigation; those at the start and before are left out."""
    entry = {**GNSS, "interval": "7 s"} | ({} if begin is None else {"begin": f"{begin} s"})
    (found,) = sensors(entry, scenario={"start": "30 s", "end": "60 s"})
    assert found.times.tolist() == expected


def test_instants_that_are_not_whole_in_binary() -> None:
    """Sensors that measure at one instant have the same one to the last bit, and outages cut where they are written."""
    short, long, listed = sensors(
        {**GNSS, "interval": "0.1 s", "outages": [["0.3 s", "0.7 s"]]},
        {**ALTIMETER, "interval": "0.7 s"},
        {"type": "position-fix", "instants": ["0.9 s", "2.1 s"], "position": "1 m"},
    )
    assert short.times[:4].tolist() == [0.1, 0.2, 0.7, 0.8]
    assert long.times[:3].tolist() == [0.7, 1.4, 2.1]
    assert np.isin(long.times, short.times).all()
    assert np.isin(listed.times, short.times).all()
    assert (short.times[-1], long.times[-1]) == (300.0, 299.6)


def test_instants_one_by_one() -> None:
    """Those before the start, at it, and after the end are left out."""
    entry = {**GNSS, "instants": ["10 s", "20 s", "1 min", "100 s", "200 s"]}
    (found,) = sensors({key: value for key, value in entry.items() if key != "interval"},
                       scenario={"start": "20 s", "end": "100 s"})  # fmt: skip
    assert found.times.tolist() == [60.0, 100.0]


def test_a_sensor_that_is_never_heard() -> None:
    (found,) = sensors({**GNSS, "outages": [["0 s", "301 s"]]})
    assert len(found.times) == 0


def test_a_radar_is_silent_above_its_ceiling() -> None:
    """The climb leaves 600 m behind once."""
    (found,) = sensors({**ALTIMETER, "kind": "radar", "ceiling": "600 m"})
    (whole,) = sensors(ALTIMETER)
    assert 60 < len(found.times) < len(whole.times)
    assert found.times.tolist() == whole.times[: len(found.times)].tolist()


def test_gates_of_sensors_and_of_the_filter() -> None:
    found = sensors({**GNSS, "gate": 0.99}, ALTIMETER, filter={"estimates": STATES, "gate": 0.999})
    assert [sensor.gate for sensor in found] == [0.99, 0.999]
    assert [sensor.gate for sensor in sensors(GNSS, ALTIMETER)] == [None, None]


def test_tables_rerun_from_a_resolved_campaign() -> None:
    campaign = read({**GNSS, "outages": [["10 s", "20 s"]], "position_bias": "1 m"}, ALTIMETER)
    again = parse_campaign(dict(campaign.resolved), "mine.toml", "mine")
    assert again.resolved == campaign.resolved
    assert again.resolved["aiding"][0]["outages"] == [["10 s", "20 s"]]
    assert again.resolved["filter"] == {"estimates": STATES}
    assert again.to_toml() == campaign.to_toml()


def without(entry: dict[str, Any], *names: str) -> dict[str, Any]:
    return {key: value for key, value in entry.items() if key not in names}


REST = {"type": "zero-velocity", "velocity": "1 cm/s"}
FIX = {"type": "position-fix", "position": "9 m"}
ODOMETER = {"type": "velocity", "interval": "1 s"}


@pytest.mark.parametrize(
    ("entry", "line"),
    [
        ("gnss", "aiding #1: got 'gnss'; expected a table with a type"),
        ({"interval": "1 s"}, "aiding #1.type: is missing; it is one of gnss, position-fix, zero-velocity,"),
        ({"type": "gns"}, "aiding #1.type: got 'gns'; did you mean 'gnss'?"),
        ({"type": 3}, "aiding #1.type: got 3; expected one of gnss"),
        ({**GNSS, "postion_bias": "1 m"}, "aiding #1.postion_bias: unknown key of type gnss; did you mean 'position_b"),
        ({**GNSS, "distribution": "x"}, "aiding #1.distribution: unknown key of type gnss; "),
        ({**GNSS, "altitude": "1 m"}, "aiding #1.altitude: unknown key of type gnss; "),
        ({**GNSS, "interval": None}, "aiding #1.interval: got None; leave it out"),
        ({**REST, "instants": ["30 s"], "bias": "1 m/s"}, "aiding #1.bias: unknown key of type zero-velocity;"),
        ({**GNSS, "name": "my gnss"}, "aiding #1.name: got 'my gnss'; expected at most 40 letters, digits and _"),
        ({**GNSS, "name": "é"}, "aiding #1.name: got 'é'; expected at most 40 letters"),
        ({**GNSS, "name": "9"}, "aiding #1.name: got '9'; expected at most 40 letters"),
        ({**GNSS, "name": ""}, "aiding #1.name: got ''; expected at most 40 letters"),
        ({**GNSS, "name": "a\n"}, "aiding #1.name: got 'a\\n'; expected at most 40 letters"),
        ({**GNSS, "name": "a" * 41}, "aiding #1.name: got 'aaaa"),
        ({**GNSS, "name": ["gnss"]}, "aiding #1.name: got ['gnss']; expected at most 40 letters"),
        ({**ALTIMETER, "name": "gyro"}, "aiding #1.name: got 'gyro'; other errors have the name gyro_bias already"),
        (without(GNSS, "interval"), 'aiding #1: has no times of measurements; expected one of interval = "1 s"'),
        ({**GNSS, "instants": ["9 s"]}, "aiding #1: has interval and instants; expected one of interval = "),
        ({**GNSS, "interval": "0 s"}, "aiding #1.interval: got '0 s'; expected at least 0.001 s"),
        ({**GNSS, "interval": "-1 s"}, "aiding #1.interval: got '-1 s'; expected at least 0.001 s"),
        ({**GNSS, "interval": "1e-320 s"}, "aiding #1.interval: got '1e-320 s'; expected at least 0.001 s"),
        ({**GNSS, "interval": "1 h"}, "aiding #1.interval: got '1 h'; navigation lasts 300 s"),
        ({**GNSS, "interval": "1e308 s"}, "aiding #1.interval: got '1e308 s'; navigation lasts 300 s"),
        ({**GNSS, "interval": 1}, "aiding #1.interval: got 1 without a unit; expected a time"),
        ({**GNSS, "interval": "1 Hz"}, "aiding #1.interval: got '1 Hz', which is a frequency; expected a time"),
        ({**GNSS, "interval": "inf s"}, "aiding #1.interval: got 'inf s'; expected a time"),
        ({**GNSS, "begin": "9 s", "end": "3 s"}, "aiding #1.end: got '3 s'; expected a time after the begin of 9 s"),
        ({**GNSS, "end": "-3 s"}, "aiding #1.end: got '-3 s'; expected a time after the start of navigation at 0 s"),
        ({**GNSS, "begin": "1 km"}, "aiding #1.begin: got '1 km', which is a length; expected a time"),
        ({**GNSS, "outages": 3}, "aiding #1.outages: expected pairs of begin and end such as"),
        ({**GNSS, "outages": ["1 s", "2 s"]}, "aiding #1.outages #1: expected pairs of begin and end such as"),
        ({**GNSS, "outages": [["1 s"]]}, "aiding #1.outages #1: expected pairs of begin and end such as"),
        ({**GNSS, "outages": [["9 s", "3 s"]]}, "aiding #1.outages #1: got '9 s' to '3 s'; expected an end after its"),
        ({**GNSS, "outages": [["9 s", "9 s"]]}, "aiding #1.outages #1: got '9 s' to '9 s'; expected an end after its"),
        ({**GNSS, "outages": [["9 s", "soon"]]}, "aiding #1.outages #1: got 'soon'; expected a time"),
        ({**GNSS, "outages": 101 * [["1 s", "2 s"]]}, "aiding #1.outages: got 101; expected at most 100"),
        ({**FIX, "instants": []}, "aiding #1.instants: expected a list of times such as"),
        ({**FIX, "instants": "9 s"}, "aiding #1.instants: expected a list of times such as"),
        ({**FIX, "instants": ["9 s", 9]}, "aiding #1.instants #2: got 9 without a unit"),
        ({**FIX, "instants": ["9 s", "1 h"]}, "aiding #1.instants #2: got '1 h'; the trajectory is from 0 s to"),
        ({**FIX, "instants": ["-1 s"]}, "aiding #1.instants #1: got '-1 s'; the trajectory is from 0 s to"),
        ({**FIX, "instants": ["9 s", "9 s"]}, "aiding #1.instants #2: got '9 s'; expected a later one than 9 s"),
        ({**FIX, "instants": ["9 s"], "begin": "3 s"}, "aiding #1.begin: limits an interval; leave it out"),
        (without(GNSS, "position"), "aiding #1.position: is missing; expected the sigma of position or velocity"),
        (without(ALTIMETER, "altitude"), "aiding #1.altitude: is missing; expected the sigma of altitude"),
        ({**GNSS, "position": {}}, "aiding #1.position: names no axis; expected the sigma of at least one"),
        ({**GNSS, "position": "0 m"}, "aiding #1.position: got '0 m'; expected a sigma above zero"),
        ({**GNSS, "position": "-3 m"}, "aiding #1.position: got '-3 m'; expected a sigma above zero"),
        ({**GNSS, "position": "1e-20 m"}, "aiding #1.position: got '1e-20 m'; at least 1e-09 m makes sense"),
        ({**GNSS, "position": "1e308 m"}, "aiding #1.position: got '1e308 m'; at most 1e+09 m makes sense"),
        ({**GNSS, "position": "1e999 m"}, "aiding #1.position: got '1e999 m', which is not finite"),
        ({**GNSS, "position": "nan m"}, "aiding #1.position: got 'nan m'; expected a length"),
        ({**GNSS, "position": float("nan")}, "aiding #1.position: got nan without a unit; expected a length"),
        ({**GNSS, "position": float("inf")}, "aiding #1.position: got inf without a unit; expected a length"),
        ({**GNSS, "position": ["1 m", "2 m"]}, "aiding #1.position: got a list of 2; expected 3, for north"),
        ({**GNSS, "position": ["1 m", "2 m", "0 m"]}, "aiding #1.position #3: got '0 m'; expected a sigma above zero"),
        ({**GNSS, "position": {"up": "1 m"}}, "aiding #1.position.up: unknown axis; expected north, east, down"),
        ({**ALTIMETER, "altitude": ["3 m"]}, "aiding #1.altitude: got a list; expected a length"),
        ({**ALTIMETER, "altitude": {"down": "3 m"}}, "aiding #1.altitude: got a table; expected a length"),
        ({**GNSS, "position_bias": "-1 m"}, "aiding #1.position_bias: got '-1 m'; a size must not be negative"),
        ({**GNSS, "position_bias": "1e308 m"}, "aiding #1.position_bias: got '1e308 m'; at most 1e+09 m makes sense"),
        ({**GNSS, "velocity_bias": "1 m/s"}, "aiding #1.velocity_bias: velocity is not measured; leave it out"),
        ({**GNSS, "position": {"north": "1 m"}, "position_bias": {"down": "1 m"}},
         "aiding #1.position_bias.down: position down is not measured; leave it out"),
        ({**ODOMETER, "velocity": {"x": "1 m/s"}, "correlated": {"sigma": {"y": "1 m/s"}, "correlation_time": "9 s"}},
         "aiding #1.correlated.y: velocity y is not measured"),
        ({**GNSS, "position_correlated": "2 m"},
         'aiding #1.position_correlated: got \'2 m\'; expected { sigma = "2 m", correlation_time = "100 s" }'),
        ({**GNSS, "position_correlated": {"sigma": "2 m"}}, "aiding #1.position_correlated: got sigma; expected { sig"),
        ({**GNSS, "position_correlated": {}}, "aiding #1.position_correlated: got nothing; expected { sigma = "),
        ({**GNSS, "position_correlated": {"sigma": "2 m", "correlation_time": "-1 s"}},
         "aiding #1.position_correlated.correlation_time: got '-1 s'; expected a time above zero"),
        ({**GNSS, "position_correlated": {"sigma": "2 m", "correlation_time": "0 s"}},
         "aiding #1.position_correlated.correlation_time: got '0 s'; expected a time above zero"),
        ({**GNSS, "position_correlated": {"sigma": "2 m", "correlation_time": "9 s", "tau": 3}},
         "aiding #1.position_correlated.tau: unknown key; expected one of sigma, correlation_time"),
        ({**GNSS, "lever_arm": "1 m"}, "aiding #1.lever_arm: got '1 m'; expected lengths forward, right and down such"),
        ({**GNSS, "lever_arm": ["1 m", "2 m"]}, "aiding #1.lever_arm: got a list of 2; expected 3, for x, y, z"),
        ({**GNSS, "lever_arm": ["1 m", "2 m", "1e7 m"]}, "aiding #1.lever_arm #3: got '1e7 m'; at most 1e+05 m"),
        ({**GNSS, "lever_arm": ["1 m", "2 m", "-1e7 m"]}, "aiding #1.lever_arm #3: got '-1e7 m'; at most 1e+05 m"),
        ({**GNSS, "lever_arm_error": "-1 cm"}, "aiding #1.lever_arm_error: got '-1 cm'; a size must not be negative"),
        ({**GNSS, "delay": "-1 ms"}, "aiding #1.delay: got '-1 ms'; a size must not be negative"),
        ({**GNSS, "delay": "1 m"}, "aiding #1.delay: got '1 m', which is a length; expected a time"),
        ({**GNSS, "jitter": "2 h"}, "aiding #1.jitter: got '2 h'; at most 60 s makes sense"),
        ({**REST, "instants": ["30 s"], "delay": "20 ms"},
         "aiding #1.delay: the vehicle is at rest, and nothing that it measures changes: it cannot be late; leave it"),
        ({**GNSS, "gate": 1}, "aiding #1.gate: got 1; expected a probability between 0 and 1, such as 0.999"),
        ({**GNSS, "gate": 0.0}, "aiding #1.gate: got 0.0; expected a probability between 0 and 1"),
        ({**GNSS, "gate": "3 m"}, "aiding #1.gate: got '3 m', which is a length; expected a pure number"),
        ({**GNSS, "gate": float("nan")}, "aiding #1.gate: got 'nan'; expected a pure number"),
        ({**ALTIMETER, "kind": "laser"}, "aiding #1.kind: got 'laser'; expected 'barometric' or 'radar'"),
        ({**ALTIMETER, "kind": ["radar"]}, "aiding #1.kind: got ['radar']; expected 'barometric' or 'radar'"),
        ({**ALTIMETER, "ceiling": "1 km"}, 'aiding #1.ceiling: is of a radar; leave it out, or add kind = "radar"'),
        ({**ALTIMETER, "kind": "radar", "ceiling": "100 m"},
         "aiding #1.ceiling: got '100 m'; the lowest altitude at its instants is "),
        ({**REST, "interval": "1 s"}, "aiding #1: the vehicle moves at 0."),
        ({**REST, "instants": ["30 s", "250 s"]}, "aiding #1: the vehicle moves at 80 m/s at 250 s; expected inst"),
    ],
)  # fmt: skip
def test_one_mistake_is_one_line(entry: Any, line: str) -> None:
    (found,) = mistakes(described(entry))
    assert found.startswith(f"mine.toml: {line}"), found


@pytest.mark.parametrize(
    ("entries", "line"),
    [
        ([GNSS, GNSS], "aiding #2.name: got 'gnss' twice; give one of the sensors another name"),
        ([GNSS, {**FIX, "instants": ["9 s"], "name": "gnss_position"}],
         "aiding #2.name: got 'gnss_position'; other errors have the name gnss_position_bias already, choose another"),
        ([{**GNSS, "name": name, "interval": "1 ms"} for name in ("one", "two", "three", "four")],
         "aiding: 1,200,000 measurements; at most 1,000,000 of all sensors together"),
        (101 * [GNSS], "aiding: got 101 sensors; expected at most 100"),
        ("gnss", "aiding: expected tables [[aiding]]"),
        (GNSS, "aiding: expected tables [[aiding]]"),
        (3, "aiding: expected tables [[aiding]]"),
        ([], f"filter: {UNMEASURED}; needs [[aiding]], the sensors whose measurements it uses"),
    ],
)  # fmt: skip
def test_one_mistake_of_all_sensors_is_one_line(entries: Any, line: str) -> None:
    (found,) = mistakes({**described(), "aiding": entries})
    assert found.startswith(f"mine.toml: {line}"), found


def test_very_many_measurements_are_counted_before_they_are_listed() -> None:
    """Twenty minutes at a kilohertz are too many."""
    content = described({**GNSS, "interval": "1 ms"}, scenario={"end": "300 s"})
    content["scenario"]["trajectory"]["segments"][-1] = {"straight": "600 km"}
    content["scenario"]["end"] = "1200 s"
    (found,) = mistakes(content)
    assert found.startswith("mine.toml: aiding #1.interval: got '1 ms'; 1,200,000 measurements; at most 1,000,000")
    assert MOST_MEASUREMENTS == 1_000_000


def test_errors_of_sensors_in_the_table_of_errors() -> None:
    """One by one or by kind, but in one place."""
    campaign = read(GNSS, errors={"gnss_position_bias": "2 m", "gnss_lever_arm_y": "1 cm"})
    sigmas = dict(zip(campaign.errors.names, campaign.errors.standard_deviations, strict=True))
    assert [sigmas[f"gnss_position_bias_{axis}"] for axis in ("north", "east", "down")] == [2.0, 2.0, 2.0]
    assert sigmas["gnss_lever_arm_y"] == pytest.approx(0.01)
    (found,) = mistakes(described({**ALTIMETER, "bias": "3 m"}, errors={"altimeter_bias": "3 m"}))
    assert found == "mine.toml: errors.altimeter_bias: is given in [[aiding]] as well; keep one"
    (found,) = mistakes(described(ALTIMETER, errors={"gnss_position_bias": "3 m"}))
    assert found.startswith("mine.toml: errors.gnss_position_bias: unknown error source")


def test_mistakes_of_sensors_are_told_beside_those_of_the_scenario() -> None:
    found = mistakes(described({**GNSS, "position": "3 s"}, {"type": "gns"}, scenario={"platform": "raft"}))
    assert [line.split(":")[1].strip() for line in found] == [
        "scenario.platform",
        "aiding #1.position",
        "aiding #2.type",
    ]


def test_a_mistake_of_a_sensor_leaves_its_errors_alone() -> None:
    """Its sources are not known then, so that nothing is said about them."""
    (found,) = mistakes(described({**GNSS, "interval": "0 s"}, errors={"gnss_position_bias": "2 m"}))
    assert found.startswith("mine.toml: aiding #1.interval")


@pytest.mark.parametrize("kind", [{"type": "reentry", "trajectory": 4}, {"type": "hover", "duration": "1 h"}])
def test_other_scenarios_cannot_be_aided(kind: dict[str, Any]) -> None:
    found = mistakes({"scenario": kind, "errors": {}, "aiding": [GNSS], "filter": {"estimates": STATES}})
    assert [line.partition(";")[0] for line in found] == [
        f"mine.toml: {name}: {NO_AIDING}" for name in ("aiding", "filter")
    ]


@pytest.mark.parametrize("pitch", [88.0, 89.5, -90.0])
def test_a_vertical_body_has_no_heading_to_measure(tmp_path: Path, pitch: float) -> None:
    rows = (f"{time},47,9,500,0,{pitch},30" for time in range(61))
    (tmp_path / "up.csv").write_text("\n".join(["time,lat,lon,alt,roll,pitch,heading", *rows]), encoding="utf-8")
    compass = {"type": "heading", "interval": "5 s", "heading": "1 deg"}
    content = described(compass) | {"scenario": {"type": "ins", "trajectory": "up.csv"}}
    file = str(tmp_path / "mine.toml")
    if abs(pitch) < 89.0:
        assert parse_campaign(content, file, "mine").samples
        return
    with pytest.raises(CampaignError, match=rf"aiding #1: the pitch is {pitch:g} deg at 5 s, where the heading is not"):
        parse_campaign(content, file, "mine")


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({"bais": "1 m/s"}, "aiding #1.bais: unknown key of type zero-velocity"),
        ({"velocity": {}}, "aiding #1.velocity: names no axis"),
    ],
)
def test_mistakes_in_the_form_and_in_the_motion_are_told_together(changes: dict[str, Any], line: str) -> None:
    told = mistakes(described({**REST, "instants": ["280 s"], **changes}))
    assert len(told) == 2
    assert any(each.startswith(f"mine.toml: {line}") for each in told)
    assert any(each.startswith("mine.toml: aiding #1: the vehicle moves at 80 m/s at 280 s") for each in told)
