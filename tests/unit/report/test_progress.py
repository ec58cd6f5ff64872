"""Progress: each phase has a line, and time left stands only where samples are still to come."""

from __future__ import annotations

import time
from io import StringIO

import pytest
from rich.console import Console

from mcnav.execution.progress import MEASUREMENT, Compilation, Phase
from mcnav.report.terminal import progress
from mcnav.report.terminal.progress import Lines, shown


class Clock:
    """Seconds that pass when they are told to."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


def _text(lines: Lines) -> list[str]:
    """The lines as a terminal has them, without its bars."""
    console = Console(force_terminal=True, color_system=None, width=120, file=StringIO())
    console.print(lines)
    assert isinstance(console.file, StringIO)
    return [" ".join(line.replace("━", "").split()) for line in console.file.getvalue().splitlines()]


def test_phases_in_order() -> None:
    """A run of 50,000 samples, 10,000 of them stored: rate and time left are of those that are simulated."""
    clock = Clock()
    lines = Lines(clock)
    lines.phase(Phase.PREPARING)
    clock.now += 3.0
    assert _text(lines) == ["preparing 3 s"]
    lines.phase(Phase.SIMULATING, 50_000)
    lines.advance(10_000, stored=True)
    assert _text(lines) == ["preparing 3 s", "simulating 10,000/50,000 samples 0 s"]
    clock.now += 10.0
    lines.advance(20_000)
    assert _text(lines)[-1] == "simulating 30,000/50,000 samples 2,000 samples/s, 10 s left"
    clock.now += 10.0
    lines.advance(20_000)
    assert _text(lines)[-1] == "simulating 50,000/50,000 samples 2,000 samples/s"
    lines.phase(Phase.ANALYSING)
    clock.now += 70.0
    lines.phase(Phase.REPORTING)
    clock.now += 1.0
    assert _text(lines) == [
        "preparing 3 s", "simulating 50,000/50,000 samples 20 s", "analysing 1 min 10 s", "writing the report 1 s",
    ]  # fmt: skip


def test_a_measurement_of_noise_is_shown_in_its_phase() -> None:
    clock = Clock()
    lines = Lines(clock)
    lines.phase(Phase.PREPARING)
    with MEASUREMENT.of(546):
        clock.now += 3.0
        assert _text(lines) == ["preparing; covariance of the noise: 0 of 546 simulations 3 s"]
        MEASUREMENT.done, MEASUREMENT.began = 182, time.monotonic() - 10.0
        assert _text(lines) == ["preparing; covariance of the noise: 182 of 546 simulations, 20 s left 3 s"]
    assert _text(lines) == ["preparing 3 s"]


def test_looks_go_on_with_their_lines() -> None:
    """Nobody knows how many samples a stopping rule will ask for: the look is told, and no time left."""
    clock = Clock()
    lines = Lines(clock)
    for look in (1, 2):
        lines.phase(Phase.SIMULATING, note=f"look {look} of at most 7")
        clock.now += 4.0
        lines.advance(8_000)
        lines.phase(Phase.ANALYSING, note=f"look {look} of at most 7")
        clock.now += 1.0
    assert _text(lines) == [
        "simulating, look 2 of at most 7 16,000 samples 8 s", "analysing, look 2 of at most 7 2 s",
    ]  # fmt: skip
    lines.phase(Phase.ANALYSING)
    assert _text(lines)[-1] == "analysing 2 s"


def test_a_terminal_sees_every_phase(monkeypatch: pytest.MonkeyPatch) -> None:
    """From the first on, in order; after the samples nothing says that no time is left, and nothing stays."""
    monkeypatch.setattr(progress, "QUIET_SECONDS", 0.0)
    seen = StringIO()

    def wait_for(words: str) -> None:
        until = time.monotonic() + 120.0
        while words not in seen.getvalue():
            assert time.monotonic() < until, f"{words} is not shown"
            time.sleep(0.01)

    with shown(Console(force_terminal=True, width=120, file=seen)) as told:
        for phase in Phase:
            told.phase(phase, 400 if phase == Phase.SIMULATING else None)
            wait_for(phase.value)
            told.advance(400 if phase == Phase.SIMULATING else 0)
    text = seen.getvalue()
    places = [text.index(phase.value) for phase in Phase]
    assert places == sorted(places)
    assert "400/400 samples" in text
    assert "left" not in text[text.index("analysing") :]
    assert "0:00:00" not in text
    assert text.endswith("\x1b[1A\x1b[2K" * 4)


def test_what_is_no_terminal_sees_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress, "QUIET_SECONDS", 0.0)
    console = Console(file=StringIO())
    with shown(console) as told:
        told.phase(Phase.SIMULATING, 400)
        told.advance(400)
        time.sleep(0.1)
    assert isinstance(console.file, StringIO)
    assert console.file.getvalue() == ""


@pytest.mark.parametrize(("stored", "once"), [(True, ", once"), (False, "")])
def test_compilation_is_shown_while_it_lasts(stored: bool, once: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is once where compiled code is stored."""
    lines = Lines(Clock())
    lines.phase(Phase.PREPARING)
    monkeypatch.setattr(progress, "COMPILATION", Compilation(34, 2, stored))
    assert _text(lines) == [f"preparing; compiling for this machine{once}: 34 functions so far 0 s"]
    monkeypatch.setattr(progress, "COMPILATION", Compilation(120, 0, stored))
    assert _text(lines) == ["preparing 0 s"]
