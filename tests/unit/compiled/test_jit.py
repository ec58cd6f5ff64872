"""Compiled code: on disk it is valid for its sources alone, and constants have no version of their own."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path

import numba
import pytest
from numba import types

from mcnav.compiled.jit import allocation_free_part, compiled
from tests.conftest import ROOT
from tests.processes import run_to_end

CODE = """
import sys
from mcnav.compiled import objects

objects.sources_digest = lambda: sys.argv[1]
sys.path.insert(0, sys.argv[2])
import doubled
doubled.doubled(1.0)
print(sum(doubled.doubled.stats.cache_hits.values()))
"""


@pytest.mark.parametrize(("sources", "hits"), [("as before", "1"), ("changed", "0")])
def test_compiled_code_belongs_to_its_sources(sources: str, hits: str, tmp_path: Path) -> None:
    (tmp_path / "doubled.py").write_text(
        "from mcnav.compiled.jit import compiled\n\n\n@compiled\ndef doubled(x):\n    return 2.0 * x\n"
    )
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    for digest, expected in (("as before", "0"), (sources, hits)):
        command = [sys.executable, "-c", CODE, digest, str(tmp_path)]
        assert run_to_end(command, env=environment).stdout.strip() == expected


PAIR = """
import numpy as np
from mcnav.compiled.jit import compiled

@compiled
def row(x):
    return np.full(2, x)

@compiled
def first(x):
    return row(x)[0]
"""
CALLED = "import sys, pair; print([float(pair.np.sum(getattr(pair, name)(3.0))) for name in sys.argv[1:]])"


def test_a_function_whose_own_code_is_lost_and_that_of_its_caller_is_not(tmp_path: Path) -> None:
    """It is compiled beside the copy that the caller contains, and works wherever both are loaded afterwards."""
    (tmp_path / "pair.py").write_text(PAIR)
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": f"{tmp_path}:{ROOT}"}

    def call(*names: str) -> str:
        done = run_to_end([sys.executable, "-c", CALLED, *names], env=environment)
        assert done.returncode == 0, done.stderr
        return done.stdout.strip()

    assert call("row", "first") == "[6.0, 3.0]"
    lost = list((tmp_path / "cache").rglob("pair.row.*"))
    assert lost
    for path in lost:
        path.unlink()
    for _ in ("compiled", "loaded"):
        assert call("first", "row") == "[3.0, 6.0]"


@compiled
def _double(number: int) -> int:
    return 2 * number


def test_constants_have_no_version_of_their_own() -> None:
    """As numba asks for a function when it compiles calls with a constant and with a variable."""
    for argument in (types.literal(3), types.int64):
        _double.get_call_template((argument,), {})
    assert _double(4) == 8
    assert len(_double.signatures) == 1


@allocation_free_part
def _treble(number: float) -> float:
    return 3.0 * number


@numba.njit
def _add_treble(number: float) -> float:
    return number + _treble(number)


def test_a_part_has_no_machine_code_of_its_own() -> None:
    """Its caller, which is not cached here, contains it; Python may call it all the same."""
    assert _add_treble(2.0) == 8.0
    for function, has_code in ((_treble, False), (_add_treble, True)):
        (found,) = function.overloads.values()
        assert bool(found.library.get_pointer_to_function(found.fndesc.llvm_func_name)) == has_code
    assert _treble(2.0) == 6.0


COMPILING = """
import numpy as np
from mcnav import Output, Source
from mcnav.numerics.power_sums import sum_powers_about_zero

class Compiling:
    sources = (Source("a", "m", "m", 1.0),)
    outputs = (Output("b", "m", "m"),)

    def fly(self, errors):
        return sum_powers_about_zero(errors[:1, None, None]).sums.ravel()[:1]
"""
"""A scenario whose workers compile a function of the package; the command itself compiles those of linear analysis."""


def test_an_installation_that_cannot_be_written_to(tmp_path: Path) -> None:
    """Commands work without stored code; they say so in one line, which their worker processes do not repeat.

    A file stands wherever a folder for code would be made, so that not even an administrator can write there.
    """
    package = tmp_path / "installed" / "mcnav"
    shutil.copytree(ROOT / "mcnav", package, ignore=shutil.ignore_patterns("__pycache__"))
    for folder in (package, *(path for path in package.rglob("*") if path.is_dir())):
        (folder / "__pycache__").touch()
    nowhere = tmp_path / "no_folder"
    nowhere.touch()
    environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    environment |= {"PYTHONPATH": str(package.parent), "HOME": str(nowhere), "XDG_CACHE_HOME": str(nowhere / "cache")}
    environment |= {"PYTHONPYCACHEPREFIX": str(tmp_path / "bytecode")}
    (tmp_path / "compiling.py").write_text(COMPILING)
    campaign = tmp_path / "compiling.toml"
    campaign.write_text('[scenario]\ntype = "compiling.py:Compiling"\n[errors]\na = "1 m"\n')
    options = ["--samples", "40", "--jobs", "1", "--timeout", "1 h"]
    done = run_to_end([sys.executable, "-m", "mcnav", "run", str(campaign), *options], cwd=tmp_path, env=environment)
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    told = [line for line in done.stderr.splitlines() if "cannot be stored" in line]
    start = f"note: compiled code cannot be stored: neither {package}/"
    assert len(told) == 1
    assert told[0].startswith(start)
    assert f" nor {nowhere}/cache/numba/" in told[0]
    assert " is writable; set NUMBA_CACHE_DIR to a folder that is" in told[0]
    assert (tmp_path / "reports" / campaign.stem / "report.html").exists()
