"""Settled steps and linear errors of a navigation, read from an earlier command: the same bits, or computed again."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mcnav.arrays.types import Array
from mcnav.compiled import kept
from mcnav.contract.samples import Batch
from mcnav.systems.ins import aided
from mcnav.systems.ins.ensemble.aided import simulate_aided
from mcnav.systems.ins.imu.instruments import Imu, Noise
from mcnav.systems.ins.linear.aided_errors import propagate_closed_loop
from mcnav.systems.ins.scenario import Ins, Navigation
from tests.aided import make_filter, make_sensor, sized
from tests.flights import flight

SIGMAS = {"position": 10.0, "velocity": 0.1, "tilt": 1e-4, "heading": 1e-3}
WALK = Imu(Noise(np.full(3, 3e-7)), Noise(np.full(3, 2e-4)))
END = 120.0


@pytest.fixture(autouse=True)
def _kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MCNAV_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(kept, "KEPT_FROM", 0.0)


@pytest.fixture
def computed(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What is computed, not read: flights of probes, and linear errors."""
    done: list[str] = []

    def counted(name: str, compute: Callable[..., Any]) -> Callable[..., Any]:
        def count(*given: Any) -> Any:
            done.append(name)
            return compute(*given)

        return count

    monkeypatch.setattr(aided, "simulate_aided", counted("probes", simulate_aided))
    monkeypatch.setattr(aided, "propagate_closed_loop", counted("linear", propagate_closed_loop))
    return done


def navigation(noise: float = 3.0, end: float = END, filtered: bool = True) -> Navigation:
    """Return a navigation as a new process has it."""
    if not filtered:
        return Navigation(flight(1.0), "strapdown", 0.0, end, WALK)
    sensor = make_sensor("gnss", np.arange(1.0, end + 1.0), {"position": noise, "velocity": 0.1})
    model = make_filter((sensor,), WALK, SIGMAS)
    return Navigation(flight(1.0), "strapdown", 0.0, end, WALK, (sensor,), model)


def probes(of: Ins, count: int = 8) -> Array:
    sigmas = sized(of.navigation.sensors, SIGMAS)
    return np.random.default_rng(1).standard_normal((count, len(sigmas))) * sigmas


@pytest.mark.parametrize("filtered", [True, False])
def test_samples_and_linear_errors_are_those_of_the_command_that_computed(
    filtered: bool, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    found = []
    for folder in ("first", "first", "other"):  # computed, read, computed again
        monkeypatch.setenv("MCNAV_CACHE_DIR", str(tmp_path / folder))
        of = Ins(navigation(filtered=filtered))
        engine = of.engine("ensemble", probes(of))
        result = engine.simulate(Batch(np.arange(9), probes(of, 9), 3))
        found.append((engine.accuracy, result.values.tobytes(), of.linear().end.partials.tobytes()))
    assert found[0] == found[1] == found[2]


def test_steps_and_linear_errors_are_computed_once(computed: list[str]) -> None:
    linear = []
    for _ in range(2):
        of = Ins(navigation())
        of.engine("ensemble", probes(of))
        assert of.navigation.aided is not None
        linear.append(of.navigation.aided.linear)
    assert computed == ["probes", "probes", "linear"]
    for field in fields(linear[0]):
        one, other = (getattr(errors, field.name) for errors in linear)
        np.testing.assert_equal(one, other)


@pytest.mark.parametrize("change", ["noise", "end", "platform", "instruments", "probes"])
def test_another_navigation_is_computed(change: str, computed: list[str]) -> None:
    given = navigation()
    of = Ins(given)
    of.engine("ensemble", probes(of))
    of.linear()
    computed.clear()
    walk = replace(WALK, gyro=Noise(np.full(3, np.nextafter(3e-7, 1.0))))
    changed = {
        "noise": navigation(noise=3.001), "end": navigation(end=END + 1.0), "probes": navigation(),
        "platform": replace(given, platform="level"), "instruments": replace(given, imu=walk),
    }  # fmt: skip
    other = Ins(changed[change])
    other.engine("ensemble", probes(other) * (1.0 + 1e-15 * (change == "probes")))
    other.linear()
    assert computed.count("probes") == 2
    assert computed.count("linear") == (change != "probes")
