"""Compiled code: on disk it is valid for its sources alone, and constants have no version of their own."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numba
import pytest
from numba import types

from mcnav.physics.jit import allocation_free_part, compiled
from tests.conftest import ROOT
from tests.processes import run_to_end

CODE = """
import sys
import mcnav.physics.jit as jit

jit.sources_digest = lambda: sys.argv[1]
sys.path.insert(0, sys.argv[2])
import doubled
doubled.doubled(1.0)
print(sum(doubled.doubled.stats.cache_hits.values()))
"""


@pytest.mark.parametrize(("sources", "hits"), [("as before", "1"), ("changed", "0")])
def test_compiled_code_belongs_to_its_sources(sources: str, hits: str, tmp_path: Path) -> None:
    (tmp_path / "doubled.py").write_text(
        "from mcnav.physics.jit import compiled\n\n\n@compiled\ndef doubled(x):\n    return 2.0 * x\n"
    )
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    for digest, expected in (("as before", "0"), (sources, hits)):
        command = [sys.executable, "-c", CODE, digest, str(tmp_path)]
        assert run_to_end(command, env=environment).stdout.strip() == expected


PAIR = """
import numpy as np
from mcnav.physics.jit import compiled

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
    lost = list((tmp_path / "cache").rglob("pair.row-*"))
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
