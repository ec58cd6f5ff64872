"""Samples of a loop: read from an earlier command, and for which loop."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mcnav.config.read import parse_campaign
from mcnav.contract.samples import Batch
from mcnav.execution.progress import TooLong
from mcnav.systems.closed_loop import engine, nominal_flight, soundness
from mcnav.systems.user import code, kept

LOOP = """
import os
import numpy as np
from mcnav import ClosedLoop, Filter, Measurement, White

class Loop(ClosedLoop):
    truth = {"x": "m", "v": "m/s"}
    processes = {"gusts": White("m/s^2/sqrt(Hz)")}
    measurements = (Measurement("ranging", "m", interval=1.0, truth=lambda truth: truth.x),)
    filter = Filter()
    cycle, end = 1.0, 10.0

    def rates(self, truth, command, noise):
        return {"x": truth.v, "v": command + noise.gusts}

    def guide(self, estimate):
        most = float(os.environ.get("MOST_COMMAND", "9"))
        return np.clip(-0.2 * estimate.x - 0.6 * estimate.v, -most, most)

    def outputs(self, truth):
        return {"far": (np.where(np.abs(truth.x) > 8.0, np.nan, truth.x), "m", "control")}
"""


@pytest.fixture(autouse=True)
def _kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MCNAV_CACHE_DIR", str(tmp_path / "kept"))
    monkeypatch.setattr(kept, "KEPT_FROM", 0.0)


@pytest.fixture
def simulated(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Numbers of the samples that are simulated, call by call."""
    counts: list[int] = []
    for module in (engine, soundness):
        simulate = module.simulate

        def counted(setup: Any, batch: Batch, *given: Any, simulate: Any = simulate, **named: Any) -> Any:
            counts.append(len(batch.errors))
            return simulate(setup, batch, *given, **named)

        monkeypatch.setattr(module, "simulate", counted)
    return counts


def _scenario(folder: Path, text: str = LOOP, gusts: str = "0.1", **tables: Any) -> Any:
    """Return the scenario as a new process has it."""
    code._classes.clear()
    code._objects.clear()
    (folder / "loop.py").write_text(text, encoding="utf-8")
    content = {
        "samples": 10, "scenario": {"type": "loop.py:Loop"}, "errors": {"true_x": "5 m", "x": "3 m"},
        "processes": {"gusts": f"{gusts} m/s^2/sqrt(Hz)"}, "measurements": {"ranging": "2 m"}, **tables,
    }  # fmt: skip
    return parse_campaign(content, str(folder / "x.toml"), "x").scenario


def test_remarks_are_of_samples_of_an_earlier_command(tmp_path: Path, simulated: list[int]) -> None:
    first = _scenario(tmp_path).remarks
    assert len(simulated) == 2  # some together, and one of them alone
    assert _scenario(tmp_path).remarks == first
    assert len(simulated) == 2


@pytest.mark.parametrize("change", ["text", "size", "environment", "hidden"])
def test_samples_of_another_loop_are_simulated(
    change: str, tmp_path: Path, simulated: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    text, gusts = LOOP.replace('"MOST_', '"MOST" "_') if change == "hidden" else LOOP, "0.1"
    _scenario(tmp_path, text).remarks  # noqa: B018
    before = len(simulated)
    if change == "text":
        text = LOOP + "# changed\n"
    elif change == "size":
        gusts = "0.11"
    else:  # a limit beside the nominal, of which no file tells
        monkeypatch.setenv("MOST_COMMAND", {"environment": "5", "hidden": "0.5"}[change])
    _scenario(tmp_path, text, gusts).remarks  # noqa: B018
    assert len(simulated) > before


def test_check_simulations_are_kept_with_their_failures(tmp_path: Path, simulated: list[int]) -> None:
    errors = np.random.default_rng(1).normal(0.0, 5.0, (20, 4))
    errors[0, 0] = 1e4
    batch, results = Batch(np.arange(20), errors, 1), []
    for _ in range(2):
        scenario = _scenario(tmp_path)
        ready = scenario.engine("vectorised", np.zeros((1, 4)))
        before = len(simulated)
        results.append((scenario.keeping(ready, np.inf).simulate(batch), len(simulated) - before))
    (one, count), (other, none) = results
    assert not scenario._object.inputs, "what is kept is no input of the class"
    assert (count, none) == (1, 0)
    assert one.failures == other.failures
    assert 0 in one.failures
    np.testing.assert_array_equal(one.values, other.values)
    np.testing.assert_array_equal(one.linear_values, other.linear_values)
    direct = ready.simulate(batch)
    np.testing.assert_array_equal(direct.values, other.values)


def test_what_takes_too_long_is_not_simulated_unless_it_is_kept(tmp_path: Path) -> None:
    batch = Batch(np.arange(3), np.zeros((3, 4)), 1)
    scenario = _scenario(tmp_path)
    ready = scenario.engine("vectorised", np.zeros((1, 4)))
    with pytest.raises(TooLong):
        scenario.keeping(ready, 1e-9).simulate(batch)
    scenario.keeping(ready, np.inf).simulate(batch)
    assert len(scenario.keeping(ready, 1e-9).simulate(batch).values) == 3


@pytest.fixture
def differentiated(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Numbers of maps that are differentiated, call by call."""
    counts: list[int] = []
    differentiate = nominal_flight.differentiate_flown

    def counted(flown: Any, *given: Any) -> Any:
        counts.append(len(flown))
        return differentiate(flown, *given)

    monkeypatch.setattr(nominal_flight, "differentiate_flown", counted)
    return counts


def _numbers(value: Any) -> list[Any]:
    """Return all numbers and texts of a structure."""
    if isinstance(value, np.ndarray):
        return [value.shape, value.tobytes()]
    if is_dataclass(value):
        return [each for field in fields(value) for each in _numbers(getattr(value, field.name))]
    if isinstance(value, (tuple, list)):
        return [each for part in value for each in _numbers(part)]
    return _numbers(list(value.items())) if isinstance(value, dict) else [value]


def test_derivatives_are_those_of_an_earlier_command(tmp_path: Path, differentiated: list[int]) -> None:
    first = _scenario(tmp_path).linearization
    assert len(differentiated) == 1
    second = _scenario(tmp_path).linearization
    assert len(differentiated) == 1
    assert _numbers(second) == _numbers(first)


@pytest.mark.parametrize("change", ["text", "size", "environment", "hidden", "trigger"])
def test_another_loop_is_differentiated(
    change: str, tmp_path: Path, differentiated: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    text, gusts = LOOP.replace('"MOST_', '"MOST" "_') if change == "hidden" else LOOP, "0.1"
    if change == "trigger":
        ends = 'Trigger(lambda time: time - float(os.environ.get("MOST" "_TIME", "7.3")), latest=12.0)'
        text = LOOP.replace("cycle, end = 1.0, 10.0", f"cycle, end = 1.0, {ends}").replace("White", "Trigger, White", 1)
    _scenario(tmp_path, text).linearization  # noqa: B018
    if change == "text":
        text = LOOP + "# changed\n"
    elif change == "size":
        gusts = "0.11"
    elif change == "trigger":
        monkeypatch.setenv("MOST_TIME", "7.4")
    else:
        monkeypatch.setenv("MOST_COMMAND", {"environment": "5", "hidden": "0.5"}[change])
    changed = _scenario(tmp_path, text, gusts).linearization
    assert len(differentiated) == 2
    if change == "trigger":
        assert changed.end_time == pytest.approx(7.4)
