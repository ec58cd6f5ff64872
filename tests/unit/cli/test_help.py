"""The help of every command has an example that the command accepts."""

from __future__ import annotations

import shlex
from contextlib import ExitStack
from typing import Any
from unittest.mock import patch

import pytest
from typer.main import get_command

from mcnav.cli import app, vary
from mcnav.cli.former import FORMER, current
from mcnav.cli.program import GROUPS
from mcnav.execution.interrupts import interrupts
from tests.commands import invoke
from tests.conftest import ROOT

WIDTH = 80
"""Columns of a terminal."""


def commands(group: Any, name: str) -> dict[str, Any]:
    """List the commands of a group and of those in it, by their whole names."""
    inside = getattr(group, "commands", {})
    return (
        {name: group}
        if not inside
        else {n: c for w, g in inside.items() for n, c in commands(g, f"{name} {w}").items()}
    )


COMMANDS = commands(get_command(app), "mcnav")


@pytest.mark.parametrize("name", COMMANDS)
def test_an_example_is_accepted(name: str) -> None:
    """Its options are those of the command, and the campaigns that it names exist."""
    command = COMMANDS[name]
    paragraphs = [" ".join(paragraph.split()) for paragraph in command.help.split("\n\n")]
    examples = [paragraph.partition("Example: ")[2] for paragraph in paragraphs if "Example: " in paragraph]
    assert len(examples) == 1
    for example in examples:
        assert example.startswith(f"{name} ") or example == name
        arguments = shlex.split(example.removeprefix(name))
        command.make_context(name, arguments)
        for word in arguments:
            assert not word.startswith("campaigns/") or (ROOT / word).exists()


@pytest.mark.parametrize("name", COMMANDS)
def test_the_list_of_commands_has_its_first_sentence(name: str) -> None:
    summary = COMMANDS[name].get_short_help_str(WIDTH)
    assert len(summary) > 10
    assert "Example" not in summary


def test_every_command_is_in_one_group() -> None:
    """The help lists it once, in one line of 80 columns; there are few enough to be read."""
    listed = [name for names in GROUPS.values() for name in names]
    shown = {name for name, command in get_command(app).commands.items() if not command.hidden}  # type: ignore[attr-defined]
    assert sorted(listed) == sorted(shown)
    assert len(listed) <= 20
    lines = invoke("--help", cwd=ROOT, columns=WIDTH).stdout.splitlines()
    for name in listed:
        (line,) = (line for line in lines if line.startswith(f"  {name} "))
        assert len(line) <= WIDTH
        assert line.endswith(".")
        assert not line.endswith("...")


def test_the_help_ends_with_first_steps() -> None:
    ending = invoke("--help", cwd=ROOT, columns=WIDTH).stdout.splitlines()[-3:]
    assert [line.split("  ")[1] for line in ending] == [
        "mcnav demo",
        "mcnav new ins mine --aid gnss",
        "mcnav lincov mine.toml",
    ]


@pytest.mark.parametrize("former", FORMER)
def test_a_former_name_still_works(former: str) -> None:
    """It does what its name of today does, and says that name; its help is that of today."""
    done = invoke(former, "--help", cwd=ROOT)
    assert done.returncode == 0
    assert done.stderr.startswith(f"note: mcnav {former} is now: mcnav ")


@pytest.mark.parametrize(("words", "resumes"), [(["--scale"], False), (["--vary", "start"], False),
                                               (["--vary", "errors.altitude=1, 2 km"], True)])  # fmt: skip
def test_a_sweep_promises_to_resume_where_it_does(words: list[str], resumes: bool) -> None:
    """An interrupted one says so; only runs at points of keys are stored."""
    promised = []

    def note_promise(*_: object, **__: object) -> None:
        promised.append(interrupts.resumes)

    with ExitStack() as patches:
        for name in ("_show_sweep", "_show_linearity", "_show_start_times"):
            patches.enter_context(patch.object(vary, name, note_promise))
        invoke("sweep", ROOT / "campaigns" / "11_cruise.toml", *words, cwd=ROOT)
    assert promised == [resumes]


def test_options_of_former_names_are_those_of_today() -> None:
    """Words that a former command took are accepted by the command that has its place."""
    for words in (
        ["trajectory", "flight.csv", "--out", "page.html", "--format", "csv"],
        ["partials", "mine.toml", "--method", "runs", "--format", "json"],
        ["partials", "mine.toml", "--start-times", "--count", "9", "--axes", "start", "--out", "folder"],
        ["linearity", "mine.toml", "--tolerance", "0.1", "--samples", "200", "--largest", "12", "--out", "folder"],
        ["start-times", "mine.toml", "--count", "9", "--axes", "trajectory", "--out", "folder"],
        ["figure", "--panel", "altitude", "run", "scatter", "--out=scatter.pdf", "--size", "88x60mm", "--columns", "2"],
        ["imu", "STIM300", "--format", "json"],
        ["index"],
        ["index", "reports"],
        ["record", "mine.toml", "--sample", "3", "--rate", "20", "--out", "log"],
        ["schema", "--out", "mcnav.schema.json"],
        ["compile", "--only", "11", "--jobs", "1"],
    ):  # fmt: skip
        name, *others = current(words)
        command = get_command(app).commands[name]  # type: ignore[attr-defined]
        if name == "dev":
            command, others = command.commands[others[0]], others[1:]
        command.make_context(name, others)
    assert current(["figure", "run", "scatter"]) == ["export", "run", "--figure", "scatter"]


def test_output_places_have_one_name() -> None:
    """Every option that names a place of output is ``--out``, whatever else it is called."""
    for command in COMMANDS.values():
        for parameter in command.params:
            if {"--html", "--in", "--into"} & set(parameter.opts):
                assert parameter.opts[0] == "--out"
