"""The table [gravity]: sizes, what a filter believes of them, and one line for each mistake."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from mcnav.config.data_sheet import believed_numbers, data_sheet_numbers
from mcnav.config.overrides import override
from mcnav.config.read import parse_campaign
from mcnav.errors import CampaignError
from mcnav.systems.ins.imu.gravity import GravityDisturbance
from mcnav.systems.ins.scenario import Ins
from tests.unit.config.test_aiding import ALTIMETER, STATES, read

ARCSEC = np.pi / 648_000.0
DEFLECTION = {"sigma": "5 arcsec", "correlation_length": "30 km"}
ANOMALY = {"sigma": "30 mGal", "correlation_length": "50 km"}


def mistakes(*aiding: Any, **changes: Any) -> list[str]:
    """Return the lines about a campaign that is refused."""
    with pytest.raises(CampaignError) as refused:
        read(*aiding, **changes)
    return str(refused.value).splitlines()


def believed(*estimates: str, gravity: Any = None, believes: Any = None) -> GravityDisturbance:
    """Return what a filter believes."""
    table = {"estimates": [*STATES, *estimates], "believes": {"gravity": believes or {}}}
    changes = {"gravity": gravity} if gravity else {}
    scenario = read(ALTIMETER, filter=table, **changes).scenario
    assert isinstance(scenario, Ins)
    assert scenario.navigation.filter is not None
    return scenario.navigation.filter.beliefs.imu.gravity


def test_sizes_and_what_is_missing() -> None:
    whole = read(ALTIMETER, gravity={"deflection": DEFLECTION, "anomaly": ANOMALY}).scenario
    assert isinstance(whole, Ins)
    assert whole.navigation.imu.gravity == GravityDisturbance(
        pytest.approx(5.0 * ARCSEC),
        30e3,
        pytest.approx(3e-4),
        50e3,  # type: ignore[arg-type]
    )
    assert {"gravity_deflection", "gravity_anomaly"} <= {process.name for process in whole.processes}
    part = read(ALTIMETER, gravity={"anomaly": ANOMALY}).scenario
    assert isinstance(part, Ins)
    assert part.navigation.imu.gravity.sizes == {"gravity_anomaly": pytest.approx(3e-4)}
    none = read(ALTIMETER).scenario
    assert isinstance(none, Ins)
    assert not none.navigation.imu.gravity.sizes


def test_a_filter_believes_the_truth_unless_told_otherwise() -> None:
    gravity = {"deflection": DEFLECTION, "anomaly": ANOMALY}
    true = believed(gravity=gravity)
    assert true.deflection == pytest.approx(5.0 * ARCSEC)
    other = believed(gravity=gravity, believes={"deflection": {"sigma": "10 arcsec"}})
    assert (other.deflection, other.deflection_length) == (pytest.approx(10.0 * ARCSEC), 30e3)
    assert (other.anomaly, other.anomaly_length) == (true.anomaly, 50e3)
    alone = believed("gravity_anomaly", believes={"anomaly": ANOMALY})
    assert alone.sizes == {"gravity_anomaly": pytest.approx(3e-4)}


@pytest.mark.parametrize(
    ("gravity", "told"),
    [
        ({"deflection": {"sigma": "5 m", "correlation_length": "30 km"}}, "gravity.deflection.sigma: got '5 m'"),
        ({"deflection": {"sigma": "-5 arcsec", "correlation_length": "30 km"}}, "gravity.deflection.sigma: "),
        ({"anomaly": {"sigma": "30 mGal", "correlation_length": "50 s"}}, "gravity.anomaly.correlation_length: got"),
        ({"anomaly": {"sigma": "30 mGal", "correlation_length": "5 m"}}, "gravity.anomaly.correlation_length: "),
        ({"anomaly": {"sigma": "30 mGal"}}, "gravity.anomaly.correlation_length: is missing; an anomaly needs sigma"),
        ({"deflection": "5 arcsec"}, "gravity.deflection: got '5 arcsec'; expected { sigma"),
        ({"deflections": DEFLECTION}, "gravity.deflections: unknown key; did you mean 'deflection'"),
        ({}, "gravity: got nothing; expected deflection, anomaly or both"),
        ("strong", "gravity: "),
    ],
)
def test_mistakes_in_one_line_each(gravity: Any, told: str) -> None:
    found = mistakes(ALTIMETER, gravity=gravity)
    assert any(told in line for line in found), found


def test_mistakes_of_the_filter() -> None:
    unknown = mistakes(ALTIMETER, filter={"estimates": [*STATES, "gravity_deflection"]})
    assert any(
        "filter.estimates: got 'gravity_deflection'; it needs deflection in [gravity]" in each for each in unknown
    )
    near = mistakes(ALTIMETER, filter={"estimates": [*STATES, "gravity_anomly"]})
    assert any("did you mean 'gravity_anomaly'" in each for each in near)
    lengthless = {"estimates": STATES, "believes": {"gravity": {"anomaly": {"sigma": "30 mGal"}}}}
    assert any("anomaly.correlation_length: is missing" in each for each in mistakes(ALTIMETER, filter=lengthless))


def test_a_wrong_size_is_not_called_missing() -> None:
    wrong = {"deflection": {"sigma": "5 parsec", "correlation_length": "30 km"}, "anomaly": ANOMALY}
    filter_ = {"estimates": [*STATES, "gravity_deflection", "gravity_anomaly"]}
    (line,) = mistakes(ALTIMETER, gravity=wrong, filter=filter_)
    assert "gravity.deflection.sigma: 'parsec' is not a known unit" in line


def test_other_scenarios_cannot_have_it() -> None:
    content = {
        "scenario": {"type": "hover", "duration": "5 min"}, "errors": {"altitude": "1 m"},
        "gravity": {"anomaly": ANOMALY},
    }  # fmt: skip
    with pytest.raises(CampaignError) as refused:
        parse_campaign(content, "mine.toml", "mine")
    assert (
        "gravity: this scenario has no gravity disturbance, which those of type ins can have; remove this table"
        in str(refused.value)
    )


def test_sizes_are_numbers_of_the_data_sheet_and_can_be_set() -> None:
    content = {"gravity": {"deflection": DEFLECTION, "anomaly": ANOMALY}}
    numbers = {number.path: number for number in data_sheet_numbers(content, ())}
    assert numbers["gravity.deflection"].covers("gravity_deflection")
    assert not numbers["gravity.deflection"].covers("gravity_anomaly")
    doubled = numbers["gravity.anomaly"].multiplied(2.0)
    assert doubled == {"gravity.anomaly": {"sigma": "60 mGal", "correlation_length": "50 km"}}
    assert override(content, {"gravity.deflection": "8 arcsec"})["gravity"]["deflection"] == {
        "sigma": "8 arcsec", "correlation_length": "30 km",
    }  # fmt: skip
    believes = {"filter": {"believes": {"gravity": {"anomaly": {"sigma": "9 mGal"}}}}}
    assert [number.path for number in believed_numbers(believes)] == ["filter.believes.gravity.anomaly"]
