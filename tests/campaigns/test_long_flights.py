"""Flights so long that the linear answer leaves the model: a report, and from when on it says nothing."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from mcnav.config.read import read_campaign
from mcnav.errors import CampaignError
from mcnav.studies.linear_covariance import linear_covariance
from mcnav.systems.histories import drawable_history
from mcnav.systems.steady.scenario import Cruise
from mcnav.systems.steady.truth import Earth, SteadyFlight
from tests.commands import in_process

MILE, FOOT = 1609.344, 0.3048
RADIUS, GRAVITY, BIAS = 3960.0 * MILE, 32.2 * FOOT, 1e-4 * 9.80665

HOVER = """
name = "hover"
samples = 200
seed = 4
[scenario]
type = "hover"
duration = "DURATION"
altitude_channel = "inertial"
platform = "inertial"
earth_radius = "3960 mi"
gravity = "32.2 ft/s^2"
[errors]
bias_z = "1e-4 g"
"""

VERTICAL = """
name = "hours without aiding"
samples = 120
seed = 1
[scenario]
type = "ins"
[scenario.trajectory]
rate = "0.02 Hz"
start = { latitude = "47 deg", longitude = "9 deg", altitude = "500 m", course = "80 deg" }
segments = [{ hold = "100 h" }]
[imu]
[errors]
accelerometer_bias_z = "100 ug"
"""


def _written(folder: Path, text: str) -> Path:
    (folder / "long.toml").write_text(text)
    return folder / "long.toml"


def _altitude_sigma(minutes: float) -> float:
    """Return that of a bias b: (b / 2 w^2) (cosh(sqrt(2) w t) - 1), w^2 = g / r."""
    square = GRAVITY / RADIUS
    return BIAS / (2.0 * square) * (math.cosh(math.sqrt(2.0 * square) * 60.0 * minutes) - 1.0)


@pytest.mark.parametrize("minutes", [96.0, 120.0])
def test_a_hover_beyond_the_model_has_a_report(tmp_path: Path, minutes: float) -> None:
    """The first of 60 readings at which the closed form is beyond half the radius is named before and after."""
    campaign = _written(tmp_path, HOVER.replace("DURATION", f"{minutes:g} min"))
    readings = np.linspace(0.0, minutes, 60)
    begin = next(time for time in readings if _altitude_sigma(time) > 0.5 * RADIUS)
    said = in_process("run", str(campaign), "--out", str(tmp_path / "run"))
    assert said.stderr.startswith(f"note: errors are beyond the range of linear analysis from {begin:.3g} min on")
    assert (tmp_path / "run" / "report.html").exists()
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["beyond_range"]["begin"] == pytest.approx(begin)
    assert summary["beyond_range"]["outputs"][0] == "altitude"
    again = in_process("report", str(tmp_path / "run"))
    assert again.exit_code == 0


def test_a_flight_within_the_model_keeps_its_linear_answer(tmp_path: Path) -> None:
    """84 minutes of hover: the linear sigma is the closed form, printed to five digits."""
    answer = linear_covariance(read_campaign(_written(tmp_path, HOVER.replace("DURATION", "84 min"))))
    assert answer.beyond is None
    assert answer.sigma[0] == pytest.approx(_altitude_sigma(84.0), rel=1e-5)


def test_the_effect_of_an_error_ends_where_it_leaves_the_model() -> None:
    flight = SteadyFlight(0.0, 0.0, 6000.0, slaved=False, level=False, earth=Earth.with_gravity(RADIUS, GRAVITY))
    history = drawable_history(Cruise(flight).nominal(), "long.toml")
    column = history.columns["altitude by bias z [km]"]
    finite = np.isfinite(column)
    assert not finite.all()
    assert np.all(finite[: finite.sum()])
    assert np.all(np.abs(column[finite]) <= RADIUS / 1e3)
    assert any("until" in entry for panel in history.panels for entry in panel.legend)


def test_a_duration_that_overflows_is_refused_in_a_line(tmp_path: Path) -> None:
    with pytest.raises(CampaignError, match=r"scenario\.duration: 240 h is too long for an inertial altitude"):
        read_campaign(_written(tmp_path, HOVER.replace("DURATION", "240 h")))


def test_hours_of_unaided_navigation_have_finite_numbers(tmp_path: Path) -> None:
    """Sigmas grow by exp(sqrt(2) w t): 1e194 in 100 h, whose square is no double."""
    answer = linear_covariance(read_campaign(_written(tmp_path, VERTICAL)))
    assert answer.beyond is not None
    assert np.isfinite(answer.covariance).all()
    assert answer.meaningful is not None
    assert answer.meaningful.readings.times[-1] < answer.beyond.time
