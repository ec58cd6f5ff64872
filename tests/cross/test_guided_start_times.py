"""Start times of a guided reentry: many from one flight, against a flight each."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest

from mcnav.config.read import parse_campaign
from mcnav.contract.scenario import Scenario
from tests.guided import ALL_SIZES

ONE_FLIGHT = 1e-8
"""Share of a row's largest contribution: integration to 1e-11, magnified a hundredfold until reentry."""


def _scenario(**options: str) -> Scenario:
    described = {"type": "reentry", "trajectory": 2, "guidance": {"final": "indicated"}} | options
    scenario = parse_campaign({"scenario": described, "errors": {}}, "test.toml", "test").scenario
    return scenario


def _apart(scenario: Scenario, minutes: float, axes: str) -> float:
    """Largest difference of partial derivatives, as a share of each output's largest contribution."""
    together = scenario.partials_at(np.array([60.0 * minutes]), axes)[0]
    alone = scenario.started_at(60.0 * minutes, axes).linear().end.partials
    largest = np.abs(alone * ALL_SIZES).max(axis=1, keepdims=True)
    return float((np.abs(together - alone) * ALL_SIZES / largest).max())


@pytest.mark.parametrize("axes", ["start", "trajectory"])
def test_one_flight_says_what_a_flight_from_each_start_says(axes: Literal["start", "trajectory"]) -> None:
    scenario = _scenario(start="-45 min")
    assert max(_apart(scenario, minutes, axes) for minutes in (-63.0, -45.0, -20.0, -1.0)) < ONE_FLIGHT


def test_starts_after_reentry_have_a_flight_each() -> None:
    scenario = _scenario()
    assert _apart(scenario, 5.0, "start") == 0.0
    times = scenario.start_times(9)
    assert times[0] == pytest.approx(-63.2976 * 60.0, abs=0.01)
    assert np.isfinite(scenario.partials_at(times, "start")).all()


def test_with_accelerometers_off_the_drag_missed_before_a_start_is_neglected() -> None:
    """Above 121.92 km it is 1e-4 of what drag does: to a thousandth of a row."""
    scenario = _scenario(accelerometers_off_above="121.92 km")
    assert 0.0 < _apart(scenario, -20.0, "start") < 1e-3
