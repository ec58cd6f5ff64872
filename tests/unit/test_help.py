"""The help of every command has an example that the command accepts."""

from __future__ import annotations

import shlex
from typing import Any

import pytest
from typer.main import get_command

from mcnav.cli import app
from mcnav.cli.program import GROUPS
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
    """The help lists it once, in one line of 80 columns."""
    listed = [name for names in GROUPS.values() for name in names]
    assert sorted(listed) == sorted(get_command(app).commands)  # type: ignore[attr-defined]
    lines = invoke("--help", cwd=ROOT, columns=WIDTH).stdout.splitlines()
    for name in listed:
        (line,) = (line for line in lines if line.startswith(f"  {name} "))
        assert len(line) <= WIDTH
        assert line.endswith(".")
        assert not line.endswith("...")


def test_a_former_name_still_works() -> None:
    group = get_command(app)
    former = group.get_command(None, "check-scenario")  # type: ignore[attr-defined]
    assert former is group.commands["check"]  # type: ignore[attr-defined]


def test_output_places_have_one_name() -> None:
    """Every option that names a place of output is ``--out``, whatever else it is called."""
    for command in COMMANDS.values():
        for parameter in command.params:
            if {"--html", "--in", "--into"} & set(parameter.opts):
                assert parameter.opts[0] == "--out"
