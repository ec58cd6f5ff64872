"""Write flight.csv, the trajectory of campaigns 15 and 16: an hour of a transport aircraft.

Take-off, climb, cruise with four turns, descent; one row every two seconds. Any program may write such a file. Run as
``python campaigns/flight.py``.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mcnav.systems.ins.earth import WGS84
from mcnav.systems.ins.truth.segments import Climb, Hold, SpeedChange, Start, Straight, Turn, fly_segments

DEGREE = np.pi / 180.0

START = Start(latitude=47.0 * DEGREE, longitude=8.0 * DEGREE, altitude=450.0, course=70.0 * DEGREE)
SEGMENTS = [
    Hold(60.0),
    SpeedChange(80.0, acceleration=2.0),
    Climb(1_500.0),
    SpeedChange(200.0),
    Turn(60.0 * DEGREE),
    Climb(7_000.0, angle=3.0 * DEGREE),
    Straight(120_000.0),
    Turn(-110.0 * DEGREE, bank=25.0 * DEGREE),
    Straight(100_000.0),
    Turn(80.0 * DEGREE),
    Straight(110_000.0),
    SpeedChange(140.0),
    Climb(-5_000.0, angle=3.0 * DEGREE),
    Turn(-60.0 * DEGREE),
    Straight(120_000.0),
]
"""In SI units and rad."""

ROWS = 1_801
"""One every two seconds for an hour."""


def main() -> None:
    """Write the file beside this one."""
    flown = fly_segments(START, SEGMENTS, 0.5, WGS84)
    angles = np.degrees(flown.angles)
    position = np.column_stack([np.degrees(flown.latitude), np.degrees(flown.longitude)])
    columns = [flown.time, *position.T, flown.altitude, *angles[:, ::-1].T]
    lines = ["time,lat,lon,alt,roll,pitch,heading"]
    for time, latitude, longitude, altitude, roll, pitch, heading in np.column_stack(columns)[:ROWS]:
        place = f"{time:.6f},{latitude:.10f},{longitude:.10f},{altitude:.5f}"
        lines.append(f"{place},{roll:.6f},{pitch:.6f},{heading % 360.0:.6f}")
    Path(__file__).with_name("flight.csv").write_text("\n".join(lines) + "\n", encoding="ascii")


if __name__ == "__main__":
    main()
