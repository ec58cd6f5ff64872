"""Commands of the program, run in processes of their own that are forks of one that has imported everything.

They begin as ``python -m mcnav`` does, with a supervisor where there is a user's code, without the second and a half
that an import takes. Output and errors are files, as in a shell that redirects them.
"""

from __future__ import annotations

import multiprocessing
import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.processes import LONG


def run_forked(*arguments: object, cwd: Path, env: Mapping[str, str] | None = None) -> subprocess.CompletedProcess[str]:
    """Run a command in a folder with the environment of the tests and more variables, and wait for its end.

    Output and errors are in the encoding of ``PYTHONIOENCODING``.
    """
    encoding = dict(env or {}).get("PYTHONIOENCODING", "utf-8")
    words = [str(argument) for argument in arguments]
    with TemporaryDirectory() as folder:
        files = Path(folder, "output"), Path(folder, "errors")
        given = (words, cwd, {"COLUMNS": "200"} | dict(env or {}), files)
        process = multiprocessing.get_context("forkserver").Process(target=_begin, args=given)
        process.start()
        process.join(LONG)
        assert process.exitcode is not None, f"{words} did not end in {LONG:g} s"
        output, errors = (file.read_text(encoding=encoding) for file in files)
    return subprocess.CompletedProcess(words, process.exitcode, output, errors)


def _begin(words: list[str], cwd: Path, env: Mapping[str, str], files: tuple[Path, Path]) -> None:
    """Make this process what a shell would start, and run the command."""
    from mcnav.__main__ import main

    os.environ.update(env)
    os.chdir(cwd)
    for name, number, file in zip(("stdout", "stderr"), (1, 2), files, strict=True):
        os.dup2(os.open(file, os.O_WRONLY | os.O_CREAT, 0o600), number)
        stream = open(number, "w", encoding=env.get("PYTHONIOENCODING", "utf-8"), closefd=False)  # noqa: SIM115  # until the end
        setattr(sys, name, stream)
        setattr(sys, f"__{name}__", stream)  # which keeps it open
    sys.argv = ["mcnav", *words]
    main()
