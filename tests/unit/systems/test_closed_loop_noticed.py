"""Loops that are silently wrong are refused, or remarked on, in one line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mcnav.config.read import parse_campaign
from mcnav.contract.scenario import ScenarioError
from mcnav.errors import CampaignError

HEAD = """
import numpy as np
from mcnav import Attitude, ClosedLoop, Correction, Filter, Measurement, Trigger, White

class Loop(ClosedLoop):
    truth = {"x": "m", "v": "m/s"}
    processes = {"gusts": White("m/s^2/sqrt(Hz)")}
    measurements = (Measurement("ranging", "m", interval=1.0, truth=lambda truth: truth.x),)
    filter = Filter()
    cycle, end = 1.0, 10.0

    def rates(self, truth, command, noise):
        return {"x": truth.v, "v": command + noise.gusts}

    def guide(self, estimate):
        return -0.2 * estimate.x - 0.6 * estimate.v
"""

TURNING = """
    truth = {"turn": Attitude()}
    processes, measurements, filter = {}, (), Filter()
    def rates(self):
        return {"turn": np.array([0.0, 0.0, 0.1])}
    def guide(self, time):
        return 0.0 * time
"""

TABLES: dict[str, Any] = {
    "errors": {"true_x": "10 m", "x": "3 m"},
    "processes": {"gusts": "0.1 m/s^2/sqrt(Hz)"},
    "measurements": {"ranging": "2 m"},
}


def scenario(folder: Path, changes: str = "", **tables: Any) -> Any:
    if TURNING in changes:
        tables = {"errors": {}, "processes": {}, "measurements": {}, **tables}
    (folder / "loop.py").write_text(HEAD + changes, encoding="utf-8")
    content = {"samples": 10, "scenario": {"type": "loop.py:Loop"}, **TABLES, **tables}
    return parse_campaign(content, str(folder / "x.toml"), "x").scenario


def refusal(folder: Path, changes: str, **tables: Any) -> str:
    with pytest.raises((ScenarioError, CampaignError)) as refused:
        assert scenario(folder, changes, **tables).remarks == ()
    text = str(refused.value)
    assert "Traceback" not in text
    return text


def test_a_sound_loop_has_no_remarks(tmp_path: Path) -> None:
    assert scenario(tmp_path).remarks == ()


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ("    def guide(self, estimate):\n        return -0.2 * (estimate.x - np.mean(estimate.x))\n",
         "a mean or a sum taken over samples"),
        ("    def guide(self, estimate):\n        self.n = getattr(self, 'n', 0) + 1\n        return 1e-3 * self.n\n",
         "kept in self from one call to the next"),
        ("    def guide(self, estimate):\n        return np.random.default_rng().standard_normal(len(estimate.x))\n",
         "is something random"),
        ("    def guide(self, estimate):\n        return -0.2 * estimate.y\n", "estimate has no 'y'"),
        ("    def guide(self, truth):\n        return -0.2 * truth.x\n", "guide asks for truth; it may name time"),
        ("    def guide(self, estimate):\n        return np.zeros(2)\n", "must return shape (n,) or (n, axes)"),
        ("    def rates(self, truth):\n        return {'x': truth.v, 'w': truth.v}\n",
         "rates returned 'w', which is no state of the truth"),
        ("    def rates(self, truth):\n        return truth.v\n", "rates must return a mapping of names to values"),
        ("    def rates(self, truth):\n        return {'x': truth.v[:1]}\n", "must have shape"),
        ("    def rates(self, truth):\n        truth.v += 1.0\n        return {}\n", "read-only"),
        ("    def rates(self, truth):\n        return {'x': truth.v / 0.0 + truth.v}\n", "not finite"),
        ("    end = Trigger(lambda truth: truth.x + 100.0, latest=20.0)\n", "meets no trigger by 20 s"),
        ("    end = Trigger(lambda truth: truth.x, latest=20.0)\n", "zero at the start"),
        ("    filter = None\n", "has measurements and no filter"),
        ("    estimate = {'x': 'm', 'z': 'm'}\n", "'z' has no counterpart"),
        ("    cycle, end = None, -1.0\n", "end must be a time"),
        ("    truth = {'x': 'furlong per fortnight', 'v': 'm/s'}\n", "furlong"),
        ("    truth = {'x': Attitude('north'), 'v': 'm/s'}\n", "errors are in 'reference' or 'body' axes; got 'north'"),
        ("    truth = {'x': Attitude(axes='xz'), 'v': 'm/s'}\n", "an attitude has three axes; got 'xz'"),
        ("    parameters = {'tilt': Attitude()}\n", "tilt is an Attitude, which only states can be"),
        (TURNING + "    estimate = {'turn': ('rad', 3)}\n", "'turn' has no counterpart of its size and kind"),
        (TURNING + "    def start(self):\n        return {'turn': np.ones((3, 3))}\n", "must be rotation matrices"),
        (TURNING + "    def start(self):\n        return {'turn': np.zeros(3)}\n", "must have shape (1, 3, 3)"),
        (TURNING + "    def rates(self, truth):\n        return {'turn': truth.turn}\n", "must have shape (32, 3)"),
        (TURNING + "    measurements = (Measurement('tracker', 'rad', lambda truth: 2 * truth.turn, interval=1.0),)\n",
         "must be rotation matrices"),
        (TURNING + "    corrections = (Correction('slew', 5.0, lambda estimate: np.zeros(3), 'turn', 'rad'),)\n",
         "apply must be a function that returns the matrices after it"),
        (TURNING + "    def rates(self):\n        return {'turn': np.array([np.nan, 0.0, 0.0])}\n", "not finite"),
    ],
)  # fmt: skip
def test_mistakes_get_one_line(tmp_path: Path, changes: str, told: str) -> None:
    with np.errstate(all="ignore"):
        text = refusal(tmp_path, "\n" + changes)
    assert any(each in text for each in told.split("|")), text


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ("    def guide(self, estimate):\n        return -0.2 * np.abs(estimate.x) - 0.6 * estimate.v\n",
         "guide has a kink at the nominal"),
        ("    measurements = (Measurement('ranging', 'm', lambda truth: truth.x + 1.0, lambda estimate: estimate.x,"
         " interval=1.0),)\n", "innovation of ranging is 0.5 of its sigma without any error"),
        ("    def rates(self, truth, time, command, noise):\n"
         "        return {'x': truth.v, 'v': command + noise.gusts + np.where(time > 4.3, 5.0, 0.0)}\n",
         "halved steps change"),
        ("    corrections = (Correction('push', 5.0, lambda estimate: np.stack([-estimate.v, 0 * estimate.v], axis=1),"
         " lambda truth, impulse: {'v': truth.v + impulse[:, 0]}),)\n", "the nominal push is zero"),
        ("    end = Trigger(lambda truth, time: 1e-3 * (time - 8.0) + 1e-2 * truth.x, latest=50.0)\n",
         "the trigger grazes"),
        ("    end = Trigger(lambda time: time - 8.0, latest=50.0)\n", "within one sigma of the measurement at 8 s"),
        ("    measurements = (Measurement('ranging', 'm', interval=4.0, truth=lambda truth: truth.x),)\n"
         "    end = Trigger(lambda time: time - 7.0, latest=50.0)\n", "within one sigma of the command at 7 s"),
    ],
)  # fmt: skip
def test_remarks(tmp_path: Path, changes: str, told: str) -> None:
    of = scenario(tmp_path, "\n" + changes)
    assert told in of.accuracy


def test_errors_of_steps_that_decay_do_not_add_up(tmp_path: Path) -> None:
    """A force that follows the command in three steps, for a hundred of them."""
    lag = """
    truth = {"x": "m", "v": "m/s", "force": "m/s^2"}
    estimate = {"x": "m", "v": "m/s"}
    end = 100.0

    def rates(self, truth, command, noise):
        return {"x": truth.v, "v": truth.force + noise.gusts, "force": (command - truth.force) / 3.0}

    def sense(self, truth):
        return truth.force

    def navigate(self, estimate, sensed):
        return {"x": estimate.v, "v": sensed}
"""
    assert scenario(tmp_path, lag).remarks == ()


@pytest.mark.parametrize(
    ("tables", "told"),
    [
        ({"processes": {"gust": "1 m/s^2/sqrt(Hz)"}}, "did you mean 'gusts'"),
        ({"measurements": {"ranging": "2 s"}}, "expected"),
        (
            {"filter": {"believes": {"measurements": {"sonar": "1 m"}}}},
            "unknown measurement",
        ),
        ({"filter": {"believes": {"errors": {"y": "1 m"}}}}, "unknown error source"),
        ({"filter": {"estimates": []}}, "unknown key of a closed loop's filter"),
        ({"measurements": {}}, "measurement ranging needs a size"),
        ({"imu": {}}, "has no inertial measurement unit"),
    ],
)
def test_tables(tmp_path: Path, tables: dict[str, Any], told: str) -> None:
    assert any(each in refusal(tmp_path, "", **tables) for each in told.split("|"))
