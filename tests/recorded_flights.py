"""A short flight for tests of recorded flights, and records of a scalar filter."""

from __future__ import annotations

import tomllib
from typing import Final

import numpy as np

from mcnav.config.read import Campaign, campaign_from
from mcnav.contract.recorded import Cause, FilteredRecord, Part, RecordedSensor, Stage

SHORT: Final = """
name = "Half a minute with GNSS"
samples = 50
seed = 5

[scenario]
type = "ins"

[scenario.trajectory]
start = { latitude = "48 deg", longitude = "11 deg", altitude = "500 m", course = "30 deg", speed = "40 m/s" }
segments = [{ hold = "5 s" }, { turn = "90 deg", rate = "6 deg/s" }, { hold = "5 s" }]

[imu.gyro]
bias = "20 deg/h"
angle_random_walk = "0.3 deg/sqrt(h)"

[imu.accelerometer]
bias = "1 mg"
velocity_random_walk = "60 ug/sqrt(Hz)"

[errors]
position = "3 m"
velocity = "0.1 m/s"
tilt = "5 mrad"
heading = "20 mrad"

[[aiding]]
type = "gnss"
interval = "1 s"
position = "1 m"
velocity = "5 cm/s"

[filter]
estimates = ["position", "velocity", "attitude", "gyro_bias", "accelerometer_bias"]
"""


def short_flight(*changes: tuple[str, str]) -> Campaign:
    """Return the campaign with some of its text changed."""
    text = SHORT
    for before, after in changes:
        assert before in text
        text = text.replace(before, after)
    return campaign_from(tomllib.loads(text))


def scalar_record(count: int, gain: float, q: float = 1.0, r: float = 1.0, believed: float = 1.0) -> FilteredRecord:
    """Return the record of a random walk of variance q in a step, measured with variance r, and a filter's gain.

    It is the first of the nine navigation errors; ``believed`` is the variance that the filter believes of innovations.
    """
    first, whole = np.array([0]), np.zeros((9, 9))
    response, column = np.eye(9)[:1], gain * np.eye(9)[:, :1]
    stage = Stage(
        time=0.0, sensor=0, innovation=np.zeros(1), covariance=np.array([[believed]]), accepted=True,
        transition=np.eye(9), feedback=np.zeros((9, 0)), decay=np.zeros(0), response=response,
        own_response=np.zeros((1, 0)), gain=column, processes=(Part(0, first, np.array([[q]])),),
        noise=(Part(1, first, np.array([[r]])),),
    )  # fmt: skip
    stages = tuple(Stage(**{**vars(stage), "time": 1.0 + number}) for number in range(count))
    causes = (
        Cause("walk", np.sqrt(q), "m", "m", "[imu] walk"),
        Cause("noise", np.sqrt(r), "m", "m", "[[aiding]] noise"),
    )
    sensors = (RecordedSensor("ranging", ("ranging",), (("m", "m"),), None),)
    return FilteredRecord(sensors, stages, causes, (), np.zeros(9), whole, np.full(9, -1), np.eye(9), float(count))
