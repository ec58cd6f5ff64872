"""Commands of the program, run in the process of the tests: without the second that a process takes to import."""

from __future__ import annotations

import contextlib
import subprocess
from pathlib import Path

from typer.testing import CliRunner

from mcnav.cli import app


def invoke(*arguments: object, cwd: Path, columns: int = 300) -> subprocess.CompletedProcess[str]:
    """Run a command in a folder, and return what a process would: exit status, output, errors.

    An exception that a process would end with as a traceback is raised.
    """
    words = [str(argument) for argument in arguments]
    with contextlib.chdir(cwd):
        done = CliRunner().invoke(app, words, prog_name="mcnav", env={"COLUMNS": str(columns)})
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    return subprocess.CompletedProcess(words, done.exit_code, done.stdout, done.stderr)
