"""Responses over steps in blocks: the bits of those computed at once, whichever steps are asked for."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest

from mcnav.arrays.types import Array
from mcnav.config.read import read_campaign
from mcnav.systems.ins.imu.gravity import GravityDisturbance
from mcnav.systems.ins.imu.instruments import Imu, Noise
from mcnav.systems.ins.linear.response import StepResponses, respond
from mcnav.systems.ins.linear.response_blocks import BLOCK, LATEST, Responses
from mcnav.systems.ins.scenario import Ins, Navigation

STEPS = 2 * BLOCK + 100

CORRELATED = Noise(instability=np.full(3, 1e-6), correlation_time=np.full(3, 60.0))
GRAVITY = GravityDisturbance(deflection=1e-5, deflection_length=2e4, anomaly=1e-4, anomaly_length=2e4)
IMUS = {
    "plain": Imu(),
    "quantized, in a disturbed field": Imu(CORRELATED, Noise(quantization=np.full(3, 1e-3)), GRAVITY),
}


def navigation() -> Navigation:
    scenario = read_campaign(Path(__file__).parents[3] / "campaigns" / "15_flight_navigation_grade.toml").scenario
    assert isinstance(scenario, Ins)
    return scenario.navigation


def tables_of(responses: StepResponses) -> list[Array]:
    *tables, gravity = responses
    return [*tables, *gravity]


@pytest.mark.parametrize("kept", [0, 10**9], ids=["computed again", "kept"])
@pytest.mark.parametrize("name", IMUS)
def test_blocks_have_the_bits_of_the_whole(name: str, kept: int) -> None:
    """Of a grid that has neither rows of the trajectory nor ends of blocks in common with the intervals."""
    where, imu = navigation(), IMUS[name]
    times = where.start + 600.0 * np.linspace(0.0, 1.0, STEPS + 1) ** 1.1
    whole = respond(where.truth, where.platform, times, imu)
    blocks = Responses(where.truth, where.platform, times, imu, kept)
    bounds = [0, 1, 200, BLOCK, BLOCK, BLOCK + 1, 2 * BLOCK, STEPS, STEPS]
    for first, last in [*itertools.pairwise(bounds), (0, STEPS), (200, BLOCK + 200)]:
        found = blocks.between(first, last)
        np.testing.assert_array_equal(found.times, times[first : last + 1])
        np.testing.assert_array_equal(found.axes, whole.axes[first : last + 1])
        for table, expected in zip(tables_of(found), tables_of(whole), strict=True):
            assert np.array_equal(table, expected[first : first + len(table)])
    covered = [(steps.start, steps.stop, len(found.motion)) for steps, found in blocks.blocks()]
    assert covered == [(0, BLOCK, BLOCK), (BLOCK, 2 * BLOCK, BLOCK), (2 * BLOCK, STEPS, 100)]


def test_memory_does_not_grow_with_the_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is kept has the bytes that it may have; blocks that are asked for in a row are computed once."""
    where, computed = navigation(), list[float]()

    def counted(*given: object) -> StepResponses:
        computed.append(float(given[2][0]))  # type: ignore[index]
        return respond(*given)  # type: ignore[arg-type]

    monkeypatch.setattr("mcnav.systems.ins.linear.response_blocks.respond", counted)
    times = np.linspace(where.start, where.start + 600.0, 6 * BLOCK + 1)
    one = sum(table.nbytes for table in tables_of(respond(where.truth, where.platform, times[: BLOCK + 1], Imu())))
    blocks = Responses(where.truth, where.platform, times, Imu(), 2 * one)
    for first in range(0, 6 * BLOCK - 128, 128):
        blocks.between(first, first + 200)
    assert computed == times[:-1:BLOCK].tolist()
    blocks.between(0, 2 * BLOCK)
    assert len(computed) == 6
    held = [*blocks._first.values(), *(responses for _, responses in blocks._latest)]
    assert len(held) == 2 + LATEST
