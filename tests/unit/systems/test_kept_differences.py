"""Simulations for differences of a user's class: read from an earlier command, and for which class."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from mcnav.entries.inputs import SourceFile
from mcnav.systems.finite_differences import SHARES
from mcnav.systems.user import code, kept, kept_simulations
from mcnav.systems.user.code import UserScenarioSpec
from mcnav.systems.user.scenario import UserScenario
from mcnav.systems.user.stochastic_scenario import TimedUserScenario, user_scenario

CURVE = """
import os
import numpy as np
from mcnav import Epochs, Output, Source

class Mine:
    sources = (Source("a", "m", "m", 1.0), Source("b", "m", "m", 1.0))
    outputs = (Output("c", "m", "m"), Output("d", "m", "m"))
    TIMES

    def __init__(self):
        self.flown = 0

    def fly(self, errors):
        self.flown += 1
        a, b = errors
        if a > float(os.environ.get("MOST_A", "9")):
            raise ValueError("too large")
        end = np.array([np.sin(a) + 0.1 * b, float(os.environ.get("SLOPE_B", "1")) * b])
        return RETURNED
"""

ALONE = 1
"""Simulations when others are read: one with all errors."""

EVERY = ALONE + 1 + 2 * 2 * len(SHARES)
"""Simulations when none are: that one, one without errors, and to both sides of two sources with each step."""


@pytest.fixture(autouse=True)
def _kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MCNAV_CACHE_DIR", str(tmp_path / "kept"))
    monkeypatch.setattr(kept, "KEPT_FROM", 0.0)


def _opened(text: str = CURVE, sizes: tuple[float, float] = (1.0, 1.0), over_time: bool = False) -> UserScenario:
    """Return the scenario as a new process has it."""
    code._classes.clear()
    code._objects.clear()
    times = 'epochs = Epochs("time [s]", np.arange(1.0, 4.0))' if over_time else ""
    text = text.replace("TIMES", times).replace("RETURNED", "np.outer([1.0, 2.0, 3.0], end)" if over_time else "end")
    return user_scenario(UserScenarioSpec(SourceFile("mine.py", text), "Mine", ())).with_sigmas(np.array(sizes))


def _differenced(scenario: UserScenario) -> tuple[bytes, int]:
    """Return the bits of the derivatives, and how many simulations they took."""
    differences = scenario.differences
    numbers = [differences.model.partials, differences.contributions, differences.moved, differences.uneven]
    return b"".join(each.tobytes() for each in numbers), scenario._instance.flown


def test_differences_are_read_with_the_same_bits() -> None:
    first = _opened()
    bits, simulations = _differenced(first)
    np.testing.assert_allclose(first.differences.model.partials, [[1.0, 0.1], [0.0, 1.0]], atol=1e-6)
    assert simulations == EVERY
    assert _differenced(_opened()) == (bits, ALONE)


def test_those_over_time_as_well() -> None:
    first = _opened(over_time=True)
    assert isinstance(first, TimedUserScenario)
    partials = first._partials_over_time
    simulations = first._instance.flown
    again = _opened(over_time=True)
    assert isinstance(again, TimedUserScenario)
    np.testing.assert_array_equal(again._partials_over_time, partials)
    assert (simulations, again._instance.flown) == (EVERY + ALONE + 2 * 2, 2 * ALONE)


CHANGES: dict[str, Callable[[pytest.MonkeyPatch], UserScenario]] = {
    "its text": lambda _: _opened(CURVE + "\n"),
    "a sigma": lambda _: _opened(sizes=(1.0, 2.0)),
    "a variable of the environment, on which one source depends": lambda patch: (
        patch.setenv("SLOPE_B", "2"),
        _opened(),
    )[1],
}


@pytest.mark.parametrize("change", CHANGES)
def test_what_has_changed_is_simulated_anew(
    change: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    before, _ = _differenced(_opened())
    changed = CHANGES[change](monkeypatch)
    after, simulations = _differenced(changed)
    assert simulations >= EVERY
    assert (after == before) == (change == "its text")
    told = capsys.readouterr().err
    assert ("mine.py no longer simulates what it did when these simulations were kept" in told) == (
        "variable" in change
    )


def test_simulations_of_which_some_failed_are_not_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """The longest step of the first source fails to one side."""
    monkeypatch.setenv("MOST_A", "0.2")
    for _ in range(2):
        scenario = _opened()
        _, simulations = _differenced(scenario)
        assert simulations == EVERY
        assert np.isnan(scenario.differences.contributions[0, 0]).all()


def test_a_damaged_file_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bits, _ = _differenced(_opened())
    (file,) = (tmp_path / "kept" / "differences").iterdir()
    file.write_bytes(file.read_bytes()[:-8])
    assert _differenced(_opened()) == (bits, EVERY)
    assert capsys.readouterr().err == f"note: {file} is damaged; partial derivatives are computed anew\n"


def test_a_long_wait_is_told_beforehand(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(kept, "TOLD_FROM", 0.0)
    _differenced(_opened())
    told = capsys.readouterr().err
    assert told.startswith("note: simulating differences for partial derivatives: about ")
    assert told.endswith(" on this machine, kept for the next commands\n")


def test_what_the_first_flight_loads_is_not_told_of_all(monkeypatch: pytest.MonkeyPatch) -> None:
    """It takes 0.2 s longer than others; all others take milliseconds, and 1 s on the busiest machine."""
    told: list[float] = []
    monkeypatch.setattr(kept.Kind, "tell", lambda kind, seconds: told.append(seconds))
    monkeypatch.setattr(kept_simulations, "TOLD_FROM", 0.0)
    slow = CURVE.replace(
        "        a, b = errors\n", "        if self.flown == 1:\n            time.sleep(0.2)\n        a, b = errors\n"
    )
    _differenced(_opened("import time\n" + slow))
    assert len(told) == 1
    assert told[0] < 1.0 < 0.2 * (EVERY - ALONE)
