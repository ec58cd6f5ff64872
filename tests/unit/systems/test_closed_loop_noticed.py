"""Loops that are silently wrong are refused, or remarked on, in one line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mcnav.config.read import parse_campaign
from mcnav.contract.scenario import ScenarioError
from mcnav.errors import CampaignError
from mcnav.systems.closed_loop.scenario import ClosedLoopScenario
from tests.closed_loops import campaign

HEAD = """
import numpy as np
from mcnav import Attitude, ClosedLoop, Correction, Filter, Measurement, Phase, Trigger, White

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

PUSH = "    corrections = (Correction('push', {}, lambda estimate: -0.1 * estimate.v, 'v'),)\n"

RANGING = "    measurements = (Measurement('ranging', 'm', lambda truth: truth.x, interval=1.0, phases=({})),)\n"

OUTPUTS = "    def outputs(self, {}):\n        return {}\n"
PHASES = "    phases = (Phase('a'), {})\n"
OWN = "    filter = None\n"

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
    (folder / "own.py").write_text(HEAD + OWN + "    measurements = ()\n", encoding="utf-8")
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
        ("    def rates(self, truth, command, noise):\n        self.n = getattr(self, 'n', 0) + 1\n"
         "        return {'x': truth.v, 'v': command + noise.gusts + 1e-3 * (self.n % 2)}\n",
         "kept in self from one call to the next"),
        ("    def rates(self, truth, command, noise):\n"
         "        return {'x': truth.v - 0.01 * np.mean(truth.x), 'v': command + noise.gusts}\n",
         "a mean or a sum taken over samples"),
        ("    end = 2000.0\n    def guide(self, estimate):\n        return 2.0 * estimate.x + 2.0 * estimate.v\n",
         "the loop diverges: the linear sigma of"),
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
        (PUSH.format("Trigger(lambda truth: truth.x + 500.0, latest=9.0)"), "its flight without any error meets no"),
        (PUSH.format("Trigger(lambda truth: 0.0 * truth.x - 1.0, 20.0)"), "meets no trigger by 10 s"),
        (PUSH.format("Trigger(lambda truth: truth.x, latest=9.0)"), "push: the trigger's function is zero"),
        (PUSH.format("Trigger(lambda command: command, latest=9.0)"), "trigger of push asks for command; it may name"),
        (PUSH.format("Trigger(lambda truth: truth.y, latest=9.0)"), "truth has no 'y'"),
        (PUSH.format("Trigger(lambda time: time - 4.25, latest='soon')"), "push must be a time, or Trigger"),
        (PUSH.format("'noon'"), "push must be a time, or Trigger"),
        ("    filter = None\n", "has measurements and no filter"),
        ("    estimate = {'x': 'm', 'z': 'm'}\n", "'z' has no counterpart"),
        ("    cycle, end = None, -1.0\n", "end must be a time"),
        ("    truth = {'x': 'furlong per fortnight', 'v': 'm/s'}\n", "furlong"),
        (OUTPUTS.format("truth", "truth.x"), 'outputs must return a mapping such as {"miss": (values, "m")}'),
        (OUTPUTS.format("truth", "{'miss': truth.x}"), "miss of outputs must be values and a unit"),
        (OUTPUTS.format("truth", "{'miss': (truth.x, 'parsnip')}"), "parsnip"),
        (OUTPUTS.format("truth", "{'x': (truth.x, 'm')}"), "the name 'x' is taken by another output"),
        (OUTPUTS.format("truth", "{'miss': (truth.x[:2], 'm')}"), "miss must have shape (n,) or (n, axes); got (2,)"),
        (OUTPUTS.format("truth", "{'miss': (truth.x, 'm', 'luck')}"), "miss is of navigation, truth, control, time"),
        (OUTPUTS.format("sky", "{'miss': (sky, 'm')}"), "outputs asks for sky; it may name time, truth, estimate"),
        (OUTPUTS.format("truth", "{'miss': (1 / 0, 'm')}"), "Loop.outputs: division by zero"),
        (OWN + "    def update(self, innovation):\n        return innovation\n", "update must return a mapping"),
        (OWN + "    def update(self, innovation):\n        return {'y': innovation}\n", "update returned 'y'"),
        (OWN + "    def update(self, truth):\n        return {}\n", "update asks for truth; it may name time, name"),
        (OWN + "    def update(self, innovation):\n        return {'x': np.nan * innovation}\n", "finite: update at"),
        (OWN + "    def update(self):\n        return {}\n    def covariance(self):\n        return np.eye(3)\n",
         "covariance must have shape"),
        (OWN + "    def update(self):\n        return {}\n    def covariance(self):\n"
         "        return np.array([[1.0, 2.0], [0.0, 1.0]])\n", "covariance must return symmetric matrices"),
        ("    def update(self):\n        return {}\n", "has a Filter and an update or covariance of its own"),
        (OWN, "has measurements and no filter"),
        (OWN + "    measurements = ()\n    def covariance(self):\n        return np.eye(2)\n", "no update of its own"),
        (PHASES.format("Phase('b')"), "b needs a time or a Trigger at which it begins"),
        (PHASES.format("Phase('a', 5.0)"), "a is there twice"),
        (PHASES.format("Phase('b', 5.0)") + RANGING.format("'bb',"), "'bb', which is no phase; did you mean"),
        (PHASES.format("Phase('b', Trigger(lambda time: time - 3.5, 9))") + RANGING.format("'a',"),
         "ranging: a begins or ends by a trigger, at another time in each sample"),
        (PHASES.format("Phase('b', 'noon')"), "b must begin at a time after 0 s"),
        (PHASES.format("Phase('b', 5.0), Phase('c', 4.0)"), "c must begin at a time after 5 s"),
        (PHASES.format("Phase('b', Trigger(lambda time: time - 3.5, 9)), Phase('c', 8.0)"), "b may begin as late as"),
        (PHASES.format("Phase('b', Trigger(lambda time: time + 3.5, 9.0))"), "b: its flight without any error"),
        (PHASES.format("Phase('b', 2.0), Phase('c', Trigger(lambda time: time - 2.0, 9.0))"),
         "c: the trigger's function is zero at 2 s"),
        (PHASES.format("5.0"), "phases must be Phase of mcnav"),
        ("    phases = (Phase('a', 5.0),)\n", "a begins with the flight"),
        ("    def guide(self, estimate, phase):\n        return 0.0\n", "guide asks for phase; it may name"),
        (PHASES.format("Phase('b', 5.0)") + "    def rates(self, phase):\n        return {'x': {'a': 1}[phase]}\n",
         "'b'"),
        ("    memory = {'x': 'm'}\n", "the name 'x' is taken"),
        ("    memory = {'kept': 'm'}\n    def guide(self, estimate, memory):\n        return memory.lost\n", "'lost'"),
        ("    truth = {'x': Attitude('north'), 'v': 'm/s'}\n", "errors are in 'reference' or 'body' axes; got 'north'"),
        ("    truth = {'x': Attitude(axes='xz'), 'v': 'm/s'}\n", "an attitude has three axes; got 'xz'"),
        ("    parameters = {'tilt': Attitude()}\n", "tilt is an Attitude, which only states can be"),
        (TURNING + "    estimate = {'turn': ('rad', 3)}\n", "'turn' has no counterpart of its size and kind"),
        (TURNING + "    def start(self):\n        return {'turn': np.ones((3, 3))}\n", "must be rotation matrices"),
        (TURNING + "    def start(self):\n        return {'turn': np.zeros(3)}\n", "must have shape (1, 3, 3)"),
        (TURNING + "    def rates(self, truth):\n        return {'turn': truth.turn}\n", "must have shape (8, 3)"),
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
        (PHASES.format("Phase('b', Trigger(lambda truth, time: time - 4.0 + 0.01 * truth.x, 9.0))"),
         "the trigger of b is met at 4 s, within one sigma of the measurement at 4 s"),
        (OUTPUTS.format("truth", "{'miss': (np.abs(truth.x), 'm')}"), "outputs has a kink at the nominal"),
        ("    end = Trigger(lambda truth, time: 1e-3 * (time - 8.0) + 1e-2 * truth.x, latest=50.0)\n",
         "the trigger grazes"),
        ("    def guide(self, estimate):\n        return np.clip(-0.2 * estimate.x - 0.6 * estimate.v, -0.5, 0.5)\n",
         "something bends within the spread, such as a limit"),
        ("    def guide(self, estimate):\n"
         "        return np.where(np.abs(estimate.x) < 3.0, 0.0, -0.2 * estimate.x) - 0.6 * estimate.v\n",
         "something bends within the spread, such as a limit, a dead band"),
        ("    end = 40.0\n    def guide(self, estimate):\n        return 0.3 * estimate.x + 0.3 * estimate.v\n",
         "the loop diverges: the linear sigma of true_"),
        ("    measurements = (Measurement('ranging', 'm', lambda truth: truth.x, instants=[100.0]),)\n",
         "the filter has no measurement within the flight"),
        (PUSH.format("Trigger(lambda time, truth: time - 4.5 + 0.5 * truth.x, latest=9.0)"),
         "the trigger of push is met at 4.5 s, within one sigma of the measurements at 4 and 5 s. It comes before or"),
        (PUSH.format("Trigger(lambda time, truth: 1e-2 * (time - 4.5) + truth.x, latest=9.0)"),
         "the trigger of push grazes: one sigma of its time is"),
        ("    end = Trigger(lambda time: time - 8.0, latest=50.0)\n", "within one sigma of the measurement at 8 s"),
        ("    measurements = (Measurement('ranging', 'm', interval=4.0, truth=lambda truth: truth.x),)\n"
         "    end = Trigger(lambda time: time - 7.0, latest=50.0)\n", "within one sigma of the command at 7 s"),
    ],
)  # fmt: skip
def test_remarks(tmp_path: Path, changes: str, told: str) -> None:
    of = scenario(tmp_path, "\n" + changes)
    assert any(told in remark for remark in of.remarks)
    assert told not in of.accuracy


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


def test_a_measurement_of_some_phases_is_made_from_their_begin_to_that_of_the_next(tmp_path: Path) -> None:
    phases = PHASES.format("Phase('b', 3.0), Phase('c', 6.5), Phase('d', 8.0)")
    limited = scenario(tmp_path, phases + RANGING.format("'b', 'd'"))
    assert [each.time for each in limited.schedule if each.measurements] == [3.0, 4.0, 5.0, 6.0, 8.0, 9.0, 10.0]


def test_steps_are_compared_one_by_one_where_a_method_takes_all_times_for_the_same(tmp_path: Path) -> None:
    """Taken together, steps would have the force of the first one."""
    swaying = """
    step = 0.05
    def rates(self, truth, time, command, noise):
        return {"x": truth.v, "v": command + noise.gusts + np.sin(time[0])}
"""
    assert not any("halved steps" in remark for remark in scenario(tmp_path, swaying).remarks)


def test_an_estimate_without_errors_of_its_own_has_the_size_of_its_truth() -> None:
    """The navigator of a satellite 500 m from its place is told that it is there; steps of 20 s will do."""
    loop = campaign("OrbitCorrection").scenario
    assert isinstance(loop, ClosedLoopScenario)
    assert not any("halved steps" in remark for remark in loop.remarks)


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
        ({"scenario": {"type": "own.py:Loop"}, "filter": {"believes": {}}}, "this loop has no Filter whose beliefs"),
        ({"imu": {}}, "has no inertial measurement unit"),
    ],
)
def test_tables(tmp_path: Path, tables: dict[str, Any], told: str) -> None:
    assert any(each in refusal(tmp_path, "", **tables) for each in told.split("|"))


TRANSFER = """
RATE = 1.14e-3

def transition(time):
    s, c, w = np.sin(RATE * time), np.cos(RATE * time), RATE
    return np.array([[c, 0.0, s / w, 0.0], [0.0, 1.0, 0.0, time], [-w * s, 0.0, c, 0.0], [0.0, 0.0, 0.0, 1.0]])

class Loop(ClosedLoop):
    truth = {"position": ("m", "xz"), "velocity": ("m/s", "xz")}
    filter = Filter()
    step, end = 20.0, ARRIVAL

    def target(estimate):
        whole = transition(ARRIVAL - 100.0)
        wanted = np.linalg.solve(whole[:2, 2:], -(estimate.position @ whole[:2, :2].T).T).T
        return wanted - estimate.velocity

    corrections = (Correction("burn", at=100.0, target=target),)

    def rates(self, truth):
        x, z = truth.position.T
        return {"position": truth.velocity, "velocity": np.stack([-(RATE**2) * x, 0.0 * z], axis=1)}
"""


@pytest.mark.parametrize(("angle", "told"), [(150.0, False), (179.0, True), (179.99, True), (180.0, True)])
def test_a_target_near_180_degrees_is_told(tmp_path: Path, angle: float, told: bool) -> None:
    """Linear analysis stays finite, and names the correction whose target is nearly singular."""
    arrival = f"ARRIVAL = 100.0 + {float(np.radians(angle)) / 1.14e-3!r}"
    errors = {"true_position": "33 m", "true_velocity": "0.04 m/s", "position": "3 m", "velocity": "0.004 m/s"}
    loop = scenario(tmp_path, arrival + TRANSFER, errors=errors, processes={}, measurements={})
    assert any("its target is nearly singular" in remark for remark in loop.remarks) == told
    assert np.isfinite(loop.linear().end.partials).all()
