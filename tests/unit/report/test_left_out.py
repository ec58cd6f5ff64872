"""What pages say that a model leaves out is what it leaves out."""

from __future__ import annotations

import numpy as np
import pytest

from mcnav.physics.constants import EARTH_RATE
from mcnav.report.results.left_out import not_modelled
from mcnav.systems.reentry.truth import airspeed_and_angle


@pytest.mark.parametrize(("kind", "still"), [("reentry", False), ("cruise", True), ("hover", True)])
def test_the_earth_turns_under_a_reentry_alone(kind: str, still: bool) -> None:
    assert ("rotation" in not_modelled(kind)) is still


def test_the_air_of_a_reentry_turns_with_the_earth() -> None:
    """A vehicle that falls along a radius at rest in inertial space meets a wind of the earth's rate times radius."""
    radius, climb = 6.5e6, -100.0
    speed, _ = airspeed_and_angle(np.array([radius, 0.0, climb, 0.0]))
    assert speed == pytest.approx(np.hypot(climb, radius * EARTH_RATE), rel=1e-12)
