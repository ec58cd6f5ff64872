"""Modules that are executed when they are used, and not before."""

from __future__ import annotations

import sys

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
