"""A short alignment in motion with a large heading error, where kinds of filters differ."""

from __future__ import annotations

from typing import Any

CAMPAIGN: dict[str, Any] = {
    "name": "Kinds", "samples": 20,
    "scenario": {
        "type": "ins", "end": "3 s",
        "trajectory": {
            "start": {"latitude": "48 deg", "longitude": "11 deg", "altitude": "500 m", "course": "30 deg",
                      "speed": "15 m/s"},
            "segments": [{"hold": "1 s"}, {"turn": "30 deg", "rate": "20 deg/s", "roll_rate": "40 deg/s"},
                         {"hold": "5 s"}],
        },
    },
    "imu": {"gyro": {"bias": "20 deg/h", "angle_random_walk": "0.3 deg/sqrt(h)"},
            "accelerometer": {"bias": "1 mg", "velocity_random_walk": "100 ug/sqrt(Hz)"}},
    "errors": {"position": "3 m", "velocity": "0.5 m/s", "tilt": "1 deg", "heading": "20 deg"},
    "aiding": [{"type": "gnss", "interval": "1 s", "position": "2 m", "velocity": "0.1 m/s",
                "lever_arm": ["2 m", "0 m", "0 m"]}],
    "filter": {"estimates": ["position", "velocity", "attitude", "gyro_bias", "accelerometer_bias"]},
}  # fmt: skip
