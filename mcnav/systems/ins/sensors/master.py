"""A master: a better navigator on the same vehicle, whose velocity and attitude align this one (transfer alignment).

The master is a lever arm away from the unit, on a structure that may bend (`mcnav.systems.ins.sensors.flexure`): it has
the velocity of its own place, and the attitude of its own axes. Its own errors are those of the measurements: constant,
Gauss-Markov, white. What it does not tell is its position, so that the position's error stays.
"""

from __future__ import annotations

from typing import Final

from mcnav.systems.ins.sensors.quantity import SensorType

SENSOR: Final = SensorType(
    name="master",
    words="Velocity and attitude of a master navigator on the vehicle (transfer alignment).",
    quantities={"velocity": "velocity", "attitude": "attitude"},
    references={"attitude": "local"},
    lever_arm=True,
    flexure=True,
    interval=1.0,
    estimated=("attitude_bias", "flexure"),
    bounds_attitude=True,
    template="""\
velocity = "2 cm/s"  # sigma of white noise along north, east and down, m/s
attitude = "0.1 mrad"  # the same of the attitude about x, y and z, rad
attitude_bias = "2 mrad"  # sigma of how the master is mounted relative to the unit, rad
# velocity_correlated = { sigma = "2 cm/s", correlation_time = "10 min" }  # the master's own error, m/s and s
# attitude_correlated = { sigma = "0.1 mrad", correlation_time = "1 h" }  # the same of its attitude, rad and s
lever_arm = ["-3 m", "-2 m", "0.5 m"]  # from the unit to the master: forward, right, down, m
# lever_arm_error = "2 cm"  # sigma of its error along each axis, m
flexure = { sigma = "0.5 mrad", frequency = "2 Hz", damping = 0.2 }  # of the structure between them, rad and Hz
""",
)
