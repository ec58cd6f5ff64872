"""Command line: parse options, run a use case of `mcnav.workflow` or `mcnav.studies`, print the results."""

from __future__ import annotations

import atexit
import gc
import os
import sys
from collections.abc import Sequence
from copy import copy
from typing import Final

import typer
from typer.main import get_command_name

from mcnav.cli import advanced, analyse, look, start, vary
from mcnav.cli.program import app, failure
from mcnav.execution.interrupts import interruptible

MODULES: Final = (start, analyse, vary, look, advanced)
"""Modules of commands; importing one adds its commands to the program."""

GARBAGE_THRESHOLD = 50_000
"""New objects after which Python looks for cycles to free."""


def _prepare_process() -> None:
    """Prepare a process that runs one command, before numerical libraries are loaded.

    Their sums use one thread; idle threads of their pools would use processor time. pydantic would look for plugins
    in all packages. A command ends before collecting its many lasting objects would free memory; at its end they are
    frozen, because the interpreter would look through all of them once more, which took a fifth of a second. joblib's
    workers would print their stacks when a user's code crashes in them; its samples say that they have failed.
    """
    for variable in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(variable, "1")
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    os.environ.setdefault("PYTHONFAULTHANDLER", "")
    gc.set_threshold(GARBAGE_THRESHOLD, 50, 50)
    atexit.register(gc.freeze)


def _with_the_command(name: str) -> typer.Typer:
    """Return the command line with this one of its commands: building all of them takes as long as showing a run.

    It is whole where no command has that name.
    """
    named = [
        command
        for command in app.registered_commands
        if name == (command.name or get_command_name(getattr(command.callback, "__name__", "")))
    ]
    if not named:
        return app
    alone = copy(app)
    alone.registered_commands = named
    return alone


def _refuse_unreadable(words: Sequence[str]) -> None:
    """End the program where an argument has bytes that are no text: reports and files of a run could not name it."""
    for word in words:
        if any("\ud800" <= sign <= "\udfff" for sign in word):
            encoding = sys.getfilesystemencoding()
            remedy = "give the file another name" if encoding == "utf-8" else "set PYTHONUTF8=1"
            sys.exit(failure(f"{word}: is no text in this locale ({encoding}); {remedy}").exit_code)


def main() -> None:
    """Run the command line."""
    _prepare_process()
    _refuse_unreadable(sys.argv[1:])
    with interruptible():
        _with_the_command("".join(sys.argv[1:2]))(prog_name="mcnav")


__all__ = ["GARBAGE_THRESHOLD", "MODULES", "app", "main"]
