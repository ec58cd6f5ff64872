"""Write lunar_descent.csv, the trajectory of campaign 34: a powered descent from 15 km to 30 m above the moon.

Eastward along the equator of the moon, 460 km in 12 minutes. The body's down axis is against the thrust, and its
forward axis is level and points north; what the thrust has to give follows from the motion. Any program may write such
a file. Run as ``python campaigns/lunar_descent.py``.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mcnav.systems.ins.earth import MOON

DURATION = 720.0
"""s; the rows are two seconds apart."""

SPEED = 1_670.0
"""Over the ground at first, m/s."""

HEIGHT, LAST = 15_000.0, 30.0
"""m."""


def main() -> None:
    """Write the file beside this one."""
    tau = np.polynomial.Polynomial([0.0, 1.0 / DURATION])
    speed = SPEED * (1.0 - tau) ** 2 * (1.0 + 0.6 * tau)
    height = LAST + (HEIGHT - LAST) * (1.0 - 3.0 * tau**2 + 2.0 * tau**3)
    time = np.linspace(0.0, DURATION, round(DURATION / 2.0) + 1)
    radius = MOON.radius + height(time)
    longitude = speed.integ()(time) / MOON.radius
    # what is felt along east and up: of motion in the plane of the equator, less gravitation
    turning, falling = speed(time) / MOON.radius + MOON.rotation_rate, height.deriv()(time)
    east = radius * speed.deriv()(time) / MOON.radius + 2.0 * falling * turning
    up = height.deriv(2)(time) - radius * turning**2 + MOON.gravitational_parameter / radius**2
    roll = np.degrees(np.arctan2(east, up))
    lines = ["time,lat,lon,alt,roll,pitch,heading"]
    rows = np.column_stack([time, np.degrees(longitude), height(time), roll])
    lines += [f"{row[0]:.1f},0.0,{row[1]:.10f},{row[2]:.5f},{row[3]:.6f},0.0,0.0" for row in rows]
    Path(__file__).with_name("lunar_descent.csv").write_text("\n".join(lines) + "\n", encoding="ascii")


if __name__ == "__main__":
    main()
