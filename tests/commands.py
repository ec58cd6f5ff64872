"""Commands of the program, run in the process of the tests: without the second that a process takes to import."""

from __future__ import annotations

import contextlib
import subprocess
from functools import cache
from pathlib import Path
from typing import Any
from unittest.mock import patch

import typer.main
from typer import testing

from mcnav.cli import app


@cache
def _program(app: typer.Typer) -> Any:
    """Build the commands; the runner of typer builds them each time, for a fifth of a second."""
    return typer.main.get_command(app)


def in_process(*arguments: object, columns: int = 300) -> testing.Result:
    """Run a command in the current folder; an exception that a process would end with is in the result."""
    words = [str(argument) for argument in arguments]
    with patch.object(testing, "_get_command", _program):
        return testing.CliRunner().invoke(app, words, prog_name="mcnav", env={"COLUMNS": str(columns)})


def invoke(*arguments: object, cwd: Path, columns: int = 300) -> subprocess.CompletedProcess[str]:
    """Run a command in a folder, and return what a process would: exit status, output, errors.

    An exception that a process would end with as a traceback is raised.
    """
    with contextlib.chdir(cwd):
        done = in_process(*arguments, columns=columns)
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    return subprocess.CompletedProcess([str(each) for each in arguments], done.exit_code, done.stdout, done.stderr)
