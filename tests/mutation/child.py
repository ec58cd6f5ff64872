"""Run of tests in a child of this process, which has imported everything but the package and its tests."""

from __future__ import annotations

import importlib
import os
import resource
import sys
import traceback
from pathlib import Path
from typing import Final, NoReturn

import numba
import pytest

MEMORY: Final = 16 << 30
"""Bytes of address space that a mutant may take."""

SHARED: Final = (
    "filterpy.kalman", "matplotlib", "pandas", "pyarrow.parquet", "pydantic", "rich.console", "scipy.integrate",
    "scipy.interpolate", "scipy.linalg", "scipy.optimize", "scipy.spatial.transform", "scipy.special", "scipy.stats",
    "typer",
)  # fmt: skip
"""Modules that are imported once for all mutants."""

for _name in SHARED:
    importlib.import_module(_name)


def run_tests(tests: list[str], tree: Path, cache: Path, scratch: Path, limit: int) -> NoReturn:
    """Run tests of a tree until one fails, and end this process with pytest's exit code.

    Parameters
    ----------
    cache : Path
        Compiled code.
    scratch : Path
        Folder for files of the tests; the output is in the file of this name that ends with ``.txt``.
    limit : int
        Seconds of processor time.
    """
    code = 99
    try:
        resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 5))
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        output = os.open(scratch.with_suffix(".txt"), os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        for number in (1, 2):
            os.dup2(output, number)
        for name in [name for name in sys.modules if name.split(".")[0] in ("tests", "mcnav")]:
            del sys.modules[name]
        sys.path[:] = [str(tree), *sys.path]
        sys.argv = ["pytest"]
        os.chdir(tree)
        os.environ.update({"PYTHONPATH": str(tree), "NUMBA_CACHE_DIR": str(cache)})
        numba.config.CACHE_DIR = str(cache)
        options = ["-x", "--tb=no", "-rfE", "-p", "no:cacheprovider", f"--basetemp={scratch}"]
        code = int(pytest.main([*options, "-W", "ignore::pytest.PytestAssertRewriteWarning", *tests]))
    except BaseException:  # of the mutant, whatever it is
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        os._exit(code)
