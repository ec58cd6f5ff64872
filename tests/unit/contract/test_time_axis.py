"""Times of flights as they are read: one unit in histories, epochs, and linear answers."""

from __future__ import annotations

import numpy as np
import pytest

from mcnav.analysis.answer_times import as_read, read_axis
from mcnav.config.read import read_campaign
from mcnav.studies.linear_covariance import linear_covariance
from tests.conftest import ROOT


@pytest.mark.parametrize(
    ("name", "unit", "end"), [("32_alignment_in_motion", "s", 30.0), ("19_flight_with_gnss", "min", 60.0)]
)
def test_a_flight_below_two_minutes_is_read_in_seconds(name: str, unit: str, end: float) -> None:
    campaign = read_campaign(ROOT / "campaigns" / f"{name}.toml")
    history, epochs = campaign.scenario.nominal(), campaign.scenario.navigation.epochs
    label = f"time [{unit}]"
    assert next(iter(history.columns)) == epochs.label == campaign.scenario.linear().label == label
    assert {panel.x for panel in history.panels} == {"longitude [deg]", label}
    assert history.events["end"] == epochs.times[-1] == history.columns[label][-1] == pytest.approx(end, abs=0.1)

    answer = linear_covariance(campaign)
    axis, read = read_axis(answer), as_read(answer)
    assert axis is not None
    assert read.history is not None
    assert answer.history is not None
    assert read.history.readings.label == axis.label == f"time of the trajectory [{unit}]"
    np.testing.assert_allclose(read.history.readings.times * axis.unit, answer.history.readings.times, rtol=4e-16)
    assert read.filter is not None
    assert read.filter.label == axis.label
