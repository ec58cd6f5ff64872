"""The table [filter]: states, what is believed in place of the truth, and one line for each mistake."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from mcnav.config.read import parse_campaign
from mcnav.contract.questions import UNMEASURED
from mcnav.errors import CampaignError
from mcnav.runner.identity import identity_of
from mcnav.systems.ins.filter.model import FilterModel
from mcnav.systems.ins.imu.instruments import CONSTANTS, OUTPUTS, process_sizes
from mcnav.systems.ins.scenario import Ins
from mcnav.systems.ins.sensors.registry import SENSOR_TYPES
from mcnav.systems.ins.tables.sensors import keys_of_errors
from tests.unit.config.test_aiding import ALTIMETER, GNSS, STATES, described, mistakes, read

DEG_PER_HOUR = np.radians(1.0) / 3600.0
WALK = "0.01 deg/h/sqrt(h)"


def model(*aiding: Any, estimates: tuple[str, ...] = (), **changes: Any) -> FilterModel:
    """Return the filter of a campaign; ``believes`` and ``considers`` are of its table, other changes the file's."""
    table = {key: changes.pop(key) for key in ("believes", "considers") if key in changes}
    scenario = read(*aiding, filter={"estimates": [*STATES, *estimates], **table}, **changes).scenario
    assert isinstance(scenario, Ins)
    assert scenario.navigation.filter is not None
    return scenario.navigation.filter


def test_a_filter_believes_the_truth() -> None:
    errors = {"position": "10 m", "tilt": {"distribution": "uniform", "half_width": "1 mrad"},
              "accelerometer_bias_x": "1 mg", "altimeter_bias": "20 m"}  # fmt: skip
    correlations = [{"between": ["position_north", "tilt_east"], "coefficient": 0.5}]
    campaign = read(ALTIMETER, errors=errors, correlations=correlations)
    scenario = campaign.scenario
    assert isinstance(scenario, Ins)
    assert scenario.navigation.filter is not None
    beliefs = scenario.navigation.filter.beliefs
    assert process_sizes(beliefs.imu) == process_sizes(scenario.navigation.imu) != {}
    (believed,), (sensor,) = beliefs.sensors, scenario.navigation.sensors
    assert believed.components == sensor.components
    assert believed.times is sensor.times
    assert list(beliefs.sigmas) == [*CONSTANTS, "altimeter_bias", "altimeter_scale_factor", "altimeter_delay"]
    np.testing.assert_array_equal(list(beliefs.sigmas.values()), campaign.errors.standard_deviations)
    np.testing.assert_allclose(beliefs.covariance, campaign.errors.covariance[:9, :9], rtol=1e-15)
    assert beliefs.covariance[OUTPUTS.index("position_north"), OUTPUTS.index("tilt_east")] != 0.0


def test_believed_errors_scale_the_covariance() -> None:
    """Correlations stay; an error in which the filter does not believe has none, and one without truth is alone."""
    errors = {"position": "10 m", "tilt": "1 mrad"}
    correlations = [{"between": ["position_north", "tilt_east"], "coefficient": 0.5},
                    {"between": ["position_east", "tilt_north"], "coefficient": -0.6}]  # fmt: skip
    believes = {
        "errors": {
            "tilt_east": "4 mrad",
            "position_east": "0 m",
            "velocity": "0.2 m/s",
            "velocity_down": "0.3 m/s",
            "gyro_bias_x": "1 deg/h",
        }
    }
    found = model(ALTIMETER, errors=errors, correlations=correlations, believes=believes).beliefs
    north, east, heading = OUTPUTS.index("position_north"), OUTPUTS.index("position_east"), OUTPUTS.index("heading")
    tilt_north, tilt_east = OUTPUTS.index("tilt_north"), OUTPUTS.index("tilt_east")
    expected = np.diag([100.0, 0.0, 100.0, 0.04, 0.04, 0.09, 1e-6, 16e-6, 0.0])
    expected[north, tilt_east] = expected[tilt_east, north] = 0.5 * 10.0 * 4e-3
    np.testing.assert_allclose(found.covariance, expected, rtol=1e-12)
    assert not found.covariance[east].any()
    assert not found.covariance[heading].any()
    assert found.covariance[tilt_north, tilt_north] > 0.0
    assert found.sigmas["gyro_bias_x"] == pytest.approx(DEG_PER_HOUR)
    assert found.sigmas["gyro_bias_y"] == pytest.approx(0.1 * DEG_PER_HOUR)
    assert [found.sigmas[name] for name in OUTPUTS] == pytest.approx(np.sqrt(np.diag(expected)))


def test_believed_instruments_replace_the_true_ones_axis_by_axis() -> None:
    imu = {"gyro": {"bias": "0.1 deg/h", "angle_random_walk": "0.01 deg/sqrt(h)",
                    "bias_instability": {"sigma": "1 deg/h", "correlation_time": "1 h"}},
           "accelerometer": {"velocity_random_walk": "0.02 m/s/sqrt(h)"}}  # fmt: skip
    believes = {"imu": {"gyro": {"bias": {"y": "3 deg/h"}, "angle_random_walk": ["0 deg/sqrt(h)"] * 3,
                                 "rate_random_walk": {"z": WALK},
                                 "bias_instability": {"sigma": {"x": "2 deg/h"}}}}}  # fmt: skip
    found = model(ALTIMETER, estimates=("gyro_bias",), imu=imu, believes=believes)
    gyro, accelerometer = found.beliefs.imu.gyro, found.beliefs.imu.accelerometer
    assert [found.beliefs.sigmas[f"gyro_bias_{axis}"] / DEG_PER_HOUR for axis in "xyz"] == pytest.approx(
        [0.1, 3.0, 0.1]
    )
    assert gyro.random_walk.tolist() == [0.0, 0.0, 0.0]
    assert gyro.rate_random_walk == pytest.approx([0.0, 0.0, 0.01 * DEG_PER_HOUR / 60.0])
    assert gyro.instability / DEG_PER_HOUR == pytest.approx([2.0, 1.0, 1.0])
    assert gyro.correlation_time == pytest.approx([3600.0] * 3)
    assert accelerometer.random_walk == pytest.approx([0.02 / 60.0] * 3)
    states = {state.name: state for state in found.states}
    assert list(states) == [f"gyro_bias_{each}" for each in ("x", "y", "z", "instability_x", "instability_y",
                                                            "instability_z")]  # fmt: skip
    assert states["gyro_bias_z"].walk == pytest.approx(gyro.rate_random_walk[2])


def test_a_grade_may_be_believed() -> None:
    found = model(ALTIMETER, believes={"imu": {"grade": "tactical"}}).beliefs
    truth = read(ALTIMETER, imu={"grade": "tactical"})
    for name, sigma in zip(truth.errors.names, truth.errors.standard_deviations, strict=True):
        if name.startswith("gyro"):
            assert found.sigmas[name] == pytest.approx(sigma)


def test_believed_sensors() -> None:
    entry = {**GNSS, "velocity": "0.1 m/s", "position_bias": "1 m", "lever_arm": ["1 m", "2 m", "3 m"],
             "position_correlated": {"sigma": "2 m", "correlation_time": "100 s"}}  # fmt: skip
    believes = {"aiding": {"gnss": {
        "position": {"east": "7 m"}, "position_bias": "0 m", "velocity_bias": {"down": "1 cm/s"},
        "position_correlated": {"correlation_time": "50 s"}, "lever_arm_error": "1 cm",
        "velocity_correlated": {"sigma": "1 m/s", "correlation_time": "5 s"},
    }}}  # fmt: skip
    found = model(entry, ALTIMETER, estimates=("gnss_velocity_bias",), considers=["gnss_lever_arm"], believes=believes)
    gnss, altimeter = found.beliefs.sensors
    assert [each.noise for each in gnss.components] == [3.0, 7.0, 3.0, 0.1, 0.1, 0.1]
    assert [each.correlated for each in gnss.components] == [2.0, 2.0, 2.0, 1.0, 1.0, 1.0]
    assert [each.correlation_time for each in gnss.components] == [50.0, 50.0, 50.0, 5.0, 5.0, 5.0]
    assert gnss.lever_arm.tolist() == [1.0, 2.0, 3.0]
    assert altimeter.components[0].noise == 3.0
    assert found.beliefs.sigmas["gnss_position_bias_north"] == 0.0
    states = [(state.name, state.considered) for state in found.states]
    assert states == [
        ("gnss_velocity_bias_down", False), ("gnss_velocity_correlated_north", False),
        ("gnss_velocity_correlated_east", False), ("gnss_velocity_correlated_down", False),
        ("gnss_lever_arm_x", True), ("gnss_lever_arm_y", True), ("gnss_lever_arm_z", True),
    ]  # fmt: skip


def test_the_truth_is_not_what_is_believed() -> None:
    believes = {
        "errors": {"position": "99 m"},
        "aiding": {"gnss": {"position": "9 m"}},
        "imu": {"gyro": {"bias": "9 deg/h"}},
    }
    plain = read(GNSS)
    other = read(GNSS, filter={"estimates": STATES, "believes": believes})
    np.testing.assert_array_equal(plain.errors.standard_deviations, other.errors.standard_deviations)
    assert isinstance(other.scenario, Ins)
    assert [each.noise for each in other.scenario.navigation.sensors[0].components] == [3.0, 3.0, 3.0]
    again = parse_campaign(dict(other.resolved), "mine.toml", "mine")
    assert again.resolved["filter"] == {"estimates": STATES, "believes": believes}


def test_tables_are_part_of_the_identity_of_a_run() -> None:
    """Any change in them is a change of the run."""
    changed = [
        read(GNSS),
        read({**GNSS, "position": "4 m"}),
        read(GNSS, ALTIMETER),
        read(GNSS, filter={"estimates": STATES, "gate": 0.99}),
        read(GNSS, filter={"estimates": STATES, "believes": {"errors": {"position": "11 m"}}}),
    ]
    digests = {identity_of(each.resolved, "ensemble", None, (), each.scenario).digest for each in changed}
    assert len(digests) == len(changed)


@pytest.mark.parametrize(
    ("entry", "line"),
    [
        (3, "filter: got 3; expected a table"),
        ([{"estimates": STATES}], "filter: got a list; expected a table"),
        ({}, "filter.estimates: is missing"),
        ({"estimates": "position"}, "filter.estimates: got 'position'; expected a list"),
        ({"estimates": [3]}, "filter.estimates #1: got 3; expected text in quotes"),
        ({"estimates": STATES[:1]}, "filter.estimates: velocity and attitude must be there; expected position"),
        ({"estimates": STATES, "consider": []}, "filter.consider: unknown key; did you mean 'considers'?"),
        ({"estimates": [*STATES, "gyro_bais"]}, "filter.estimates: unknown error 'gyro_bais'; did you mean 'gyro_bias"),
        ({"estimates": [*STATES, "gyro_bias_x"]}, "filter.estimates: unknown error 'gyro_bias_x'; did you mean '"),
        ({"estimates": [*STATES, "tilt"]}, "filter.estimates: unknown error 'tilt'; "),
        ({"estimates": [*STATES, "baro_bias"]},
         "filter.estimates: got 'baro_bias'; no sensor of [[aiding]] is named 'baro'"),
        ({"estimates": [*STATES, "altimeter_bias"]},
         "filter.estimates: got 'altimeter_bias'; no sensor of [[aiding]] is named 'altimeter'"),
        ({"estimates": [*STATES, "gyro_bias", "gyro_bias"]}, "filter.estimates: got 'gyro_bias' twice; keep one"),
        ({"estimates": [*STATES, "gyro_bias"], "considers": ["gyro_bias"]},
         "filter.considers: got 'gyro_bias' in estimates and considers; keep one"),
        ({"estimates": STATES, "considers": ["x"]}, "filter.considers: unknown error 'x'; expected one of gyro_bias"),
        ({"estimates": STATES, "considers": ["position"]},
         "filter.considers: got 'position' in estimates and considers; keep one"),
        ({"estimates": STATES, "gate": 1.5}, "filter.gate: got 1.5; expected a probability between 0 and"),
        ({"estimates": STATES, "gate": "never"}, "filter.gate: got 'never'; expected a pure number"),
        ({"estimates": STATES, "gate": True}, "filter.gate: got true; expected a pure number"),
        ({"estimates": STATES, "believes": 3}, "filter.believes: got 3; expected a table"),
        ({"estimates": STATES, "believes": {"ium": {}}}, "filter.believes.ium: unknown key; did you mean 'imu'?"),
    ],
)  # fmt: skip
def test_one_mistake_is_one_line(entry: Any, line: str) -> None:
    (found,) = mistakes(described(GNSS, filter=entry))
    assert found.startswith(f"mine.toml: {line}"), found


@pytest.mark.parametrize(
    ("entry", "line"),
    [
        ({"imu": 3}, "imu: got 3; expected a table"),
        ({"imu": {"gyros": {}}}, "imu.gyros: unknown key; did you mean 'gyro'?"),
        ({"imu": {"gyro": 3}}, "imu.gyro: got 3; expected a table"),
        ({"imu": {"grade": "tactcal"}}, "imu.grade: got 'tactcal'; did you mean 'tactical'?"),
        ({"imu": {"gyro": {"bias": "-1 deg/h"}}}, "imu.gyro.bias: got '-1 deg/h'; a size must not be negative"),
        ({"imu": {"gyro": {"bias": "1e300 deg/h"}}}, "imu.gyro.bias: got '1e300 deg/h'; at most 1e+15 in SI units"),
        ({"imu": {"gyro": {"bias_instability": {}}}}, "imu.gyro.bias_instability: got nothing; expected { sigma = "),
        ({"imu": {"gyro": {"bias_instability": {"sigma": "1 deg/h"}}}},
         "imu.gyro.bias_instability.correlation_time: is missing, and the instrument itself has no such process"),
        ({"errors": {"position_nort": "1 m"}}, "errors.position_nort: unknown error source; did you mean 'position"),
        ({"errors": {"position": "1 s"}}, "errors.position: got '1 s', which is a time; expected a length"),
        ({"errors": {"heading": "-1 deg"}}, "errors.heading: got '-1 deg'; a size must not be negative"),
        ({"errors": {"heading": "1e99 deg"}}, "errors.heading: got '1e99 deg'; at most 1e+06 rad makes sense"),
        ({"errors": {"heading": {"distribution": "fixed"}}}, "errors.heading: got a table; expected an angle"),
        ({"errors": {"gyro_bias_x": "1 deg/h"}, "imu": {"gyro": {"bias": "1 deg/h"}}},
         "errors.gyro_bias_x: is given by another table of [filter.believes]; keep one"),
        ({"aiding": {"gns": {}}}, "aiding.gns: no sensor has this name; did you mean 'gnss'?"),
        ({"aiding": {"gnss": 3}}, "aiding.gnss: got 3; expected a table"),
        ({"aiding": {"gnss": {"interval": "3 s"}}}, "aiding.gnss.interval: unknown key; expected one of position"),
        ({"aiding": {"gnss": {"lever_arm": ["1 m", "0 m", "0 m"]}}},
         "aiding.gnss.lever_arm: is that of [[aiding]]; a wrong one is an error such as gnss_lever_arm_x = {"),
        ({"aiding": {"gnss": {"position": "0 m"}}}, "aiding.gnss.position: got '0 m'; expected a sigma above zero"),
        ({"aiding": {"gnss": {"velocity": "1 m/s"}}}, "aiding.gnss.velocity: velocity is not measured; leave it out"),
        ({"aiding": {"gnss": {"position": {"down": "1 m"}}}},
         "aiding.gnss.position.down: position down is not measured; leave it out"),
        ({"aiding": {"gnss": {"position_correlated": {}}}}, "aiding.gnss.position_correlated: got nothing; expected"),
        ({"aiding": {"gnss": {"position_correlated": {"sigma": {"north": "1 m"}}}}},
         "aiding.gnss: gnss_position_correlated_north needs a correlation_time, because the sensor itself has no such"),
    ],
)  # fmt: skip
def test_one_mistake_of_what_is_believed_is_one_line(entry: Any, line: str) -> None:
    gnss = {**GNSS, "position": {"north": "3 m", "east": "3 m"}}
    (found,) = mistakes(described(gnss, filter={"estimates": STATES, "believes": entry}))
    assert found.startswith(f"mine.toml: filter.believes.{line}"), found


def test_aiding_and_filter_come_together() -> None:
    alone = described(GNSS)
    del alone["filter"]
    (found,) = mistakes(alone)
    assert found == "mine.toml: aiding: needs a [filter], which says what is estimated from its measurements"
    alone = described()
    del alone["aiding"]
    (found,) = mistakes(alone)
    assert found == f"mine.toml: filter: {UNMEASURED}; needs [[aiding]], the sensors whose measurements it uses"


def test_a_word_for_the_table_of_instruments() -> None:
    (found,) = mistakes(described(GNSS, imu="navigation"))
    assert found == "mine.toml: imu: got 'navigation'; expected a table"


KEYS = sorted({key for kind in SENSOR_TYPES.values() for key in (*keys_of_errors(kind), *kind.further)})
WORDS = ("", "1 m", "-3 m", "0.1 m/s", "5 arcsec", "1 s", "0 s", "1e308 m", "1e308 s", "1e-320 s", "inf m", "nan m",
         "1e999 s", "\x00", "é", "position", "gnss", "radar", "0.1 deg/h", "1 %", "9" * 400, "tactical")  # fmt: skip
SCALARS = st.one_of(
    st.sampled_from(WORDS),
    st.integers(-3, 10**320),
    st.floats(),
    st.booleans(),
    st.just(10**400),
)
AXES = ("north", "east", "down", "x", "y", "z", "sigma", "correlation_time", "allan_minimum", "bias", "gyro")
VALUES = st.recursive(
    SCALARS,
    lambda each: st.lists(each, max_size=3) | st.dictionaries(st.sampled_from(AXES), each, max_size=3),
    max_leaves=6,
)
SENSORS = st.fixed_dictionaries(
    {"type": st.sampled_from([*SENSOR_TYPES, "gps"]) | VALUES},
    optional={
        "name": VALUES, "interval": st.sampled_from(["1 s", "10 s"]) | VALUES, "instants": VALUES, "begin": VALUES,
        "end": VALUES, "outages": VALUES, "gate": VALUES, **dict.fromkeys(KEYS, VALUES),
    },
)  # fmt: skip
BELIEVES = st.fixed_dictionaries(
    {},
    optional={
        "imu": VALUES | st.dictionaries(st.sampled_from(["gyro", "accelerometer", "grade"]), VALUES, max_size=2),
        "errors": VALUES | st.dictionaries(st.sampled_from([*OUTPUTS, "gnss_position_bias"]), VALUES, max_size=2),
        "aiding": VALUES | st.dictionaries(st.sampled_from(["gnss", "x"]), VALUES | SENSORS, max_size=2),
    },
)
FILTERS = st.fixed_dictionaries(
    {"estimates": st.lists(st.sampled_from([*STATES, "gyro_bias", "x"]), max_size=5) | VALUES},
    optional={"considers": VALUES, "gate": VALUES, "believes": VALUES | BELIEVES},
)


VALID = {
    "aiding": [
        {**GNSS, "velocity": "0.1 m/s", "position_bias": "1 m", "gate": 0.99, "begin": "2 s", "end": "200 s",
         "position_correlated": {"sigma": "2 m", "correlation_time": "100 s"}, "outages": [["20 s", "30 s"]],
         "lever_arm": ["1 m", "2 m", "3 m"], "lever_arm_error": "1 cm"},
        {**ALTIMETER, "kind": "radar", "ceiling": "600 m", "bias": "2 m", "scale_factor": "1e-3"},
        {"type": "zero-velocity", "instants": ["20 s", "30 s"], "velocity": {"north": "1 cm/s"}},
    ],
    "filter": {
        "estimates": [*STATES, "gyro_bias", "altimeter_bias"], "considers": ["gnss_lever_arm"], "gate": 0.999,
        "believes": {
            "imu": {"gyro": {"bias": "1 deg/h", "bias_instability": {"sigma": "1 deg/h", "correlation_time": "1 h"}}},
            "errors": {"position": "3 m", "heading": "1 mrad"},
            "aiding": {"gnss": {"position": "3 m", "lever_arm_error": {"x": "1 m"}}},
        },
    },
}  # fmt: skip


def places(value: Any, at: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """List the places of a nested value, tables and lists as well as what is in them."""
    inside = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [*([at] if at else []), *(place for key, each in inside for place in places(each, (*at, key)))]


def replaced(value: Any, place: tuple[Any, ...], by: Any) -> Any:
    """Return a nested value with another one at a place."""
    if not place:
        return by
    key, *rest = place
    if isinstance(value, dict):
        return {**value, key: replaced(value[key], tuple(rest), by)}
    return [replaced(each, tuple(rest), by) if number == key else each for number, each in enumerate(value)]


def read_or_refused(tables: dict[str, Any]) -> Ins | None:
    """Read a campaign with these tables, or check that its mistakes are told in lines that name the file."""
    try:
        scenario = parse_campaign(described() | tables, "mine.toml", "mine").scenario
    except CampaignError as error:
        told = error
    else:
        assert isinstance(scenario, Ins)
        return scenario
    assert all(line.startswith("mine.toml: ") and line.isprintable() for line in str(told).splitlines())
    return None


@settings(max_examples=200, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large])
@given(aiding=st.lists(SENSORS | VALUES, max_size=3) | VALUES, table=FILTERS | VALUES)
@example(aiding=[{**GNSS, "position_correlated": {"sigma": {}, "correlation_time": {}}}], table={"estimates": STATES})
def test_nonsense_is_refused(aiding: Any, table: Any) -> None:
    """Whatever the tables hold, a campaign is read or its mistakes are told: nothing else is raised."""
    found = read_or_refused({"aiding": aiding, "filter": table})
    assert found is None or (found.navigation.filter is None) == (not found.navigation.sensors)


@settings(max_examples=400, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large])
@given(place=st.sampled_from(places(VALID)), value=VALUES)
def test_one_value_of_nonsense_is_refused(place: tuple[Any, ...], value: Any) -> None:
    """So it is when all else is right; what is read has finite sizes."""
    found = read_or_refused(replaced(VALID, place, value))
    if found is None or found.navigation.filter is None:
        return
    beliefs = found.navigation.filter.beliefs
    assert np.isfinite([*beliefs.sigmas.values()]).all()
    assert np.isfinite(beliefs.covariance).all()
    for sensor in (*beliefs.sensors, *found.navigation.sensors):
        assert np.isfinite(sensor.lever_arm).all()
        assert (np.diff(sensor.times) > 0.0).all()
        assert all(0.0 < component.noise**2 < 1e300 for component in sensor.components)


def test_the_value_that_is_replaced_is_right() -> None:
    assert read_or_refused(VALID) is not None
    assert len(places(VALID)) > 60
