"""Satellite navigation: position and velocity of an antenna a lever arm away from the unit."""

from __future__ import annotations

from typing import Final

from mcnav.systems.ins.sensors.quantity import SensorType

SENSOR: Final = SensorType(
    name="gnss",
    words="Satellite navigation: position and velocity of the antenna, or one of them.",
    quantities={"position": "position", "velocity": "velocity"},
    lever_arm=True,
    interval=1.0,
    bounds_attitude=True,
    template="""\
position = "3 m"  # sigma of white noise along north, east and down, m
velocity = "0.1 m/s"  # the same of the velocity, m/s; leave it out if it is not measured
# position_bias = "1 m"  # sigma of a constant error, m
# position_correlated = { sigma = "2 m", correlation_time = "100 s" }  # Gauss-Markov error, m and s
# lever_arm = ["1 m", "0 m", "-0.5 m"]  # from the unit to the antenna: forward, right, down, m
# lever_arm_error = "2 cm"  # sigma of its error along each axis, m
""",
)
