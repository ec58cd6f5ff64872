"""The next command names real paths, quotes them as a shell needs, and is one that the program accepts."""

from __future__ import annotations

import shlex
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from typer.main import get_command

from mcnav.cli import app, next_command

PROGRAM: Any = get_command(app)
CAMPAIGN, FOLDER = Path("my campaigns/mine.toml"), Path("reports/mine")


def accepted(command: str) -> list[str]:
    """Return the words of a command whose options the program has."""
    program, *words = shlex.split(command)
    assert program == "mcnav"
    context = PROGRAM.make_context("mcnav", list(words), resilient_parsing=True)
    _, chosen, rest = PROGRAM.resolve_command(context, words)
    if hasattr(chosen, "commands"):
        _, chosen, rest = chosen.resolve_command(context, rest)
    chosen.make_context(chosen.name, list(rest))
    return words


def summary(*findings: str, needed: int | None = None) -> Any:
    entries = [SimpleNamespace(finding=each, samples_needed=needed) for each in findings]
    return SimpleNamespace(requirements=entries, samples=1_000)


@pytest.mark.parametrize(
    ("findings", "needed", "reported", "opened", "expected"),
    [
        ((), None, True, False, ["report", "reports/mine", "--open"]),
        ((), None, False, False, ["report", "reports/mine", "--open"]),
        (("met",), None, True, True, ["show", "reports/mine", "--table", "budget"]),
        (("met", "not met", "undecided"), 5_000, True, False, ["allocate", "my campaigns/mine.toml"]),
        (("undecided",), 15_333, True, False, ["run", "my campaigns/mine.toml", "--samples", "16000"]),
        (("undecided",), None, True, False, ["report", "reports/mine", "--open"]),
    ],
)
def test_after_a_run(
    findings: tuple[str, ...], needed: int | None, reported: bool, opened: bool, expected: list[str]
) -> None:
    found = next_command.after_run(CAMPAIGN, FOLDER, summary(*findings, needed=needed), reported, opened)
    assert accepted(found) == expected


def test_more_samples_go_into_the_same_folder() -> None:
    found = next_command.after_run(CAMPAIGN, Path("elsewhere"), summary("undecided", needed=2_000), True, False)
    assert accepted(found)[-2:] == ["--out", "elsewhere"]


def test_a_sweep_is_confirmed_with_its_own_options() -> None:
    found = next_command.after_sweep(CAMPAIGN, Path("out"), ["a.b=1..5 m"], ["heading < 1 mrad"], None)
    options = ["--vary", "a.b=1..5 m", "--against", "heading < 1 mrad", "--confirm", "3", "--out", "out"]
    assert accepted(found) == ["sweep", str(CAMPAIGN), *options]
    confirmed = next_command.after_sweep(CAMPAIGN, Path("out"), ["a.b=1..5 m"], [], 3)
    assert accepted(confirmed) == ["report", "--index", "out"]


def test_an_allocation_without_a_change_that_a_sweep_makes_is_followed_by_a_run() -> None:
    change = SimpleNamespace(swept="", paths=("errors.altitude",))
    result: Any = SimpleNamespace(goals=[SimpleNamespace(changes=[change])])
    assert accepted(next_command.after_allocation(CAMPAIGN, result)) == ["run", str(CAMPAIGN)]


def test_an_allocation_is_followed_by_its_smallest_change() -> None:
    same = SimpleNamespace(swept="", paths=("errors.range",))
    change = SimpleNamespace(swept="3 km, 2 km", paths=("errors.altitude",))
    result: Any = SimpleNamespace(goals=[SimpleNamespace(changes=[same, change])])
    words = accepted(next_command.after_allocation(CAMPAIGN, result))
    assert words[2:4] == ["--vary", "errors.altitude=3 km, 2 km"]


@pytest.mark.parametrize(
    "command",
    [
        next_command.after_show(FOLDER, None),
        next_command.after_show(FOLDER, "budget"),
        next_command.after_comparison([FOLDER], None),
        next_command.after_comparison([FOLDER, FOLDER], None),
        next_command.after_comparison([FOLDER, FOLDER], Path("both.html")),
        next_command.after_index([]),
        next_command.after_index([FOLDER, FOLDER]),
        next_command.after_recording(CAMPAIGN, [Path("imu.csv"), Path("gnss.csv"), Path("reference.csv")]),
        next_command.after_judgement(None),
        next_command.after_judgement(CAMPAIGN),
        next_command.after_check(CAMPAIGN, CAMPAIGN, passed=True),
        next_command.after_check(CAMPAIGN, CAMPAIGN, passed=False),
        next_command.after_check(Path("a.py"), None, passed=True),
        next_command.after_check(Path("my flight.csv"), None, passed=True),
        next_command.after_check(Path("my flight.csv"), None, passed=False),
        next_command.after_trajectory(CAMPAIGN),
        next_command.after_identification([Path("a.csv")], None, None),
        next_command.after_identification([Path("a.csv")], Path("out"), None),
        next_command.after_identification([Path("a.csv")], Path("out"), CAMPAIGN),
    ],
)
def test_the_program_accepts_it(command: str) -> None:
    accepted(command)
