"""Results that variations of a campaign share: computed once, and again when anything differs that they depend on."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mcnav.caches.recent import Recent
from mcnav.config.read import read_campaign
from mcnav.systems.ins.imu.instruments import Imu, Noise
from mcnav.systems.ins.linear.response import respond
from mcnav.systems.ins.linear.response_blocks import recent_responses
from mcnav.systems.ins.scenario import Ins, Navigation

FLIGHT = Path(__file__).parents[3] / "campaigns" / "15_flight_navigation_grade.toml"

QUANTIZED = Noise(quantization=np.full(3, 1e-6))
OTHERS = {
    "correlation time": Imu(Noise(correlation_time=np.full(3, 60.0))),
    "quantization": Imu(QUANTIZED),
}


def navigation() -> Navigation:
    scenario = read_campaign(FLIGHT).scenario
    assert isinstance(scenario, Ins)
    return scenario.navigation


def test_only_the_last_results_are_kept() -> None:
    recent, computed = Recent[str](most=2), list[str]()

    def get(key: str) -> str:
        def compute() -> str:
            computed.append(key)
            return key

        return recent.get(key, compute, lambda found: found != "large")

    for key in ("a", "b", "a", "c", "b", "large", "large", "c"):
        assert get(key) == key
    assert computed == ["a", "b", "c", "b", "large", "large"]


def test_campaigns_along_one_file_share_its_truth() -> None:
    assert navigation().truth is navigation().truth


@pytest.mark.parametrize("what", OTHERS)
def test_shared_responses_are_those_of_the_imu(what: str) -> None:
    """They have the bits of responses computed for each, in whatever order they are asked for."""
    found = navigation()
    times = np.linspace(0.0, 20.0, 5)
    for imu in (found.imu, OTHERS[what], found.imu):
        shared = recent_responses(found.truth, found.platform, times, imu).between(0, 4)
        own = respond(found.truth, found.platform, times, imu)
        for name in own._fields:
            np.testing.assert_equal(getattr(shared, name), getattr(own, name), err_msg=name)


def test_sizes_of_errors_do_not_matter() -> None:
    found = navigation()
    times = np.linspace(0.0, 20.0, 5)
    one = recent_responses(found.truth, found.platform, times, found.imu)
    gyro = replace(found.imu.gyro, random_walk=2.0 * found.imu.gyro.random_walk)
    assert recent_responses(found.truth, found.platform, times, replace(found.imu, gyro=gyro)) is one
