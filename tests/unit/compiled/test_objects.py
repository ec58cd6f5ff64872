"""Objects of an installation: used where all that they depend on is the same, and otherwise not."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path

import llvmlite
import numba
import pytest

from mcnav.compiled import objects
from mcnav.compiled.target import LEVELS, choose_objects, highest_level
from tests.conftest import ROOT
from tests.processes import run_to_end

V3 = dict.fromkeys(LEVELS["x86-64-v3"].split(), True)
V4 = V3 | dict.fromkeys(LEVELS["x86-64-v4"].split(), True)


def test_the_level_is_the_highest_of_which_nothing_is_missing() -> None:
    assert highest_level(V4) == "x86-64-v4"
    assert highest_level(V3) == "x86-64-v3"
    for name in V4:
        assert highest_level(V4 | {name: False}) == (None if name in V3 else "x86-64-v3")


def test_a_level_that_the_processor_has_not_is_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("mcnav.compiled.target._level_here", lambda: "x86-64-v3")
    with pytest.raises(ValueError, match=r"^got x86-64-v4; this processor has x86-64-v3$"):
        choose_objects(tmp_path, "x86-64-v4")


@pytest.mark.parametrize(
    ("module", "name", "other"),
    [
        (objects, "target", lambda: "another processor"),
        (objects, "sources_digest", lambda: "other sources"),
        (numba, "__version__", "0.0"),
        (llvmlite, "__version__", "0.0"),
        (sys, "abiflags", "d"),
    ],
)
def test_the_folder_is_another_where_anything_differs(
    module: object, name: str, other: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    here = objects.objects_folder.__wrapped__()
    monkeypatch.setattr(module, name, other)
    assert objects.objects_folder.__wrapped__().name != here.name


CODE = """
import sys
from numba.core import event
from mcnav.compiled import objects

compilations = event.RecordingListener()
event.register("numba:compile", compilations)
import doubled
print(doubled.doubled(1.5), "compiles" if compilations.buffer else "loads")
"""

SOURCE = (
    "from mcnav.compiled.jit import compiled\n\nFACTOR = {}\n\n\n@compiled\ndef doubled(x):\n    return FACTOR * x\n"
)


def test_objects_are_used_without_a_folder_to_write_to_and_not_after_a_change(tmp_path: Path) -> None:
    """In a copy of the package with a file wherever a folder for code would be made; the change is of a constant."""
    package = tmp_path / "installed" / "mcnav"
    package.mkdir(parents=True)
    for name in ("__init__.py", "constants.py", "progress.py", "_types.py"):
        shutil.copy(ROOT / "mcnav" / name, package / name)
    shutil.copytree(ROOT / "mcnav" / "compiled", package / "compiled", ignore=shutil.ignore_patterns("__pycache__"))
    (package.parent / "__pycache__").touch()
    nowhere = tmp_path / "no_folder"
    nowhere.touch()
    environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    environment |= {"PYTHONPATH": str(package.parent), "HOME": str(nowhere), "XDG_CACHE_HOME": str(nowhere / "cache")}

    def call(factor: float, **more: str) -> tuple[str, str]:
        (package.parent / "doubled.py").write_text(SOURCE.format(factor))
        done = run_to_end([sys.executable, "-B", "-c", CODE], cwd=package.parent, env=environment | more)
        assert done.returncode == 0, done.stderr
        return done.stdout.strip(), done.stderr

    assert call(2.0, MCNAV_OBJECTS_INTO=str(package / "compiled" / "objects")) == ("3.0 compiles", "")
    assert call(2.0) == ("3.0 loads", "")
    printed, told = call(4.0)
    assert printed == "6.0 compiles"
    assert told.startswith("note: compiled code cannot be stored")
