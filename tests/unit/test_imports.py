"""Modules that are executed when they are used, and not before."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from mcnav._imports import UNUSED
from tests.processes import run_to_end

PARTS = {
    "numpy.f2py": ("numpy.f2py.crackfortran", "import numpy; numpy.f2py.get_include()"),
    "numpy.testing": ("numpy.testing._private", "import numpy; numpy.testing.assert_equal(1, 1)"),
    "scipy.spatial": ("scipy.spatial._kdtree", "from scipy.spatial.transform import Rotation; Rotation.identity()"),
}
"""A part of each module, and a use of it."""


@pytest.mark.parametrize("name", sorted(UNUSED))
def test_a_module_is_executed_when_it_is_used(name: str) -> None:
    part, use = PARTS[name]
    program = (
        "import sys; from mcnav._imports import load_when_used; load_when_used(); import scipy.optimize\n"
        f"print({name!r} in sys.modules, {part!r} in sys.modules); {use}; print({part!r} in sys.modules)"
    )
    finished = run_to_end([sys.executable, "-c", program])
    assert finished.returncode == 0, finished.stderr
    assert finished.stdout.split() == ["True", "False", "True"]


def test_before_code_of_others_they_are_executed(tmp_path: Path) -> None:
    """Loading a user's class executes them: its code may use them in many threads at once."""
    (tmp_path / "mine.py").write_text(
        "import sys\nPARTS = 'numpy.f2py.crackfortran', 'numpy.testing._private', 'scipy.spatial._kdtree'\n"
        "class Mine:\n    sources = outputs = ()\n    executed = sorted(part in sys.modules for part in PARTS)\n"
    )
    program = (
        "import sys; from mcnav._imports import load_when_used; load_when_used(); import scipy.optimize\n"
        "from mcnav.entries.inputs import SourceFile; from mcnav.systems.user.code import load_class\n"
        f"print(load_class(SourceFile('mine.py', open({str(tmp_path / 'mine.py')!r}).read()), 'Mine').executed)\n"
        "print([type(finder).__name__ for finder in sys.meta_path].count('_WhenUsed'))"
    )
    finished = run_to_end([sys.executable, "-c", program])
    assert finished.returncode == 0, finished.stderr
    assert finished.stdout.splitlines() == ["[True, True, True]", "0"]
