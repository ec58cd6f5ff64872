"""Memory of linear analysis, which must not grow with the number of updates beyond their times."""

from __future__ import annotations

import tracemalloc
from functools import partial

import numpy as np
import pytest

from mcnav.arrays import rows
from mcnav.linear.engine import design
from mcnav.systems.ins.imu.instruments import Imu, Noise
from mcnav.systems.ins.linear import response_blocks
from mcnav.systems.ins.linear.aided_errors import propagate_closed_loop, smooth_closed_loop
from mcnav.systems.ins.linear.closed_loop import close_loop
from mcnav.systems.ins.linear.response_blocks import Responses
from mcnav.systems.ins.sensors import measurements
from tests.aided import make_filter, make_sensor
from tests.flights import flight

FEW, MANY = 300, 1200
TRUTH = flight(1.0)
IMU = Imu(Noise(np.full(3, 6e-7), np.full(3, 1.5e-8), np.full(3, 1000.0)), Noise(np.full(3, 2e-4)))
SIGMAS = {"position": 10.0, "velocity": 0.1, "tilt": 1e-4, "heading": 1e-3, "gyro_bias": 5e-8}

OF_AN_UPDATE = 600.0
"""Bytes that an update may take: some twenty numbers such as its time, and copies while they are made.

H alone takes 576, of six components by 12 states; whole tables took 9,400."""


def peak(updates: int, smoothed: bool) -> float:
    """Return the peak of memory of a linear answer of so many updates, bytes."""
    times = np.linspace(0.0, 600.0, updates + 1)
    sensor = make_sensor("gnss", times[1:], {"position": 3.0, "velocity": 0.1})
    model = make_filter((sensor,), IMU, SIGMAS, ("gyro_bias",))
    readings = np.array([updates // 2, updates])
    tracemalloc.start()
    loop = close_loop(TRUTH, "strapdown", times, IMU, (sensor,), model, partial(Responses, kept=0))
    (smooth_closed_loop if smoothed else propagate_closed_loop)(loop, readings, np.ones(2))
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return float(most)


@pytest.mark.parametrize("smoothed", [False, True])
def test_updates_take_memory_for_their_times_alone(monkeypatch: pytest.MonkeyPatch, smoothed: bool) -> None:
    for module, name, value in (
        (rows, "KEPT", 0), (design, "KEPT", 0), (measurements, "LEAST", 0), (measurements, "BLOCK", 64),
        (response_blocks, "BLOCK", 64),
    ):  # fmt: skip
        monkeypatch.setattr(module, name, value)
    peak(10, smoothed)  # which loads and compiles
    assert peak(MANY, smoothed) - peak(FEW, smoothed) < OF_AN_UPDATE * (MANY - FEW)
