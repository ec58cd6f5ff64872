"""Code compiled in a process and code loaded from disk give the same bits, in whichever order it is loaded.

What a process compiles here is stored where all tests find it: the kernels of reentry. The test therefore comes first
(`tests/conftest.py`).
"""

from __future__ import annotations

import os
import sys

from tests.conftest import ROOT
from tests.processes import run_to_end

BEGIN = """
import hashlib, sys
import numpy as np
from numba.core import event
from mcnav.compiled.objects import CodeFiles

compilations = event.RecordingListener()
event.register("numba:compile", compilations)
if sys.argv[1] == "compile":
    CodeFiles.load = lambda file, key: None

def printed(name, values):
    print(name, hashlib.sha256(np.ascontiguousarray(values).tobytes()).hexdigest())
"""

END = """
print("compiles" if compilations.buffer else "loads", file=sys.stderr)
"""


def bits(order: str) -> list[str]:
    """Run `CODE` in a process that either loads nothing and stores what it compiles, or compiles nothing.

    Parameters
    ----------
    order : str
        ``compile``, or, of loaded code, ``forwards`` or ``backwards``.
    """
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = run_to_end([sys.executable, "-c", BEGIN + CODE + END, order], cwd=ROOT, env=environment)
    assert done.returncode == 0, done.stderr
    assert done.stderr.splitlines()[-1] == ("compiles" if order == "compile" else "loads")
    return done.stdout.splitlines()


CODE = """
from pathlib import Path
from mcnav.config.read import read_campaign
from mcnav.contract.engine import without_noise
from mcnav.runner.draws import DrawPlan
from mcnav.systems.ins.earth import WGS84
from mcnav.systems.ins.reference.collocation import STATE, advance
from mcnav.systems.ins.reference.earth_fixed_errors import gravitation_gradients
from mcnav.systems.ins.reference.normal_field import field_constants, normal_gravitation_at

def final(campaign, engine, samples):
    draws = DrawPlan(campaign.errors, campaign.design, campaign.seed, campaign.samples)
    return without_noise(campaign.scenario.engine(engine, draws.probes()))(draws.draw(0, samples)).values

def history(draws, samples):
    return reentry.scenario.engine("ensemble", draws.probes()).histories(draws.draw(0, samples))

def sums(draws, samples):
    return reentry.scenario.engine("ensemble", draws.probes()).history_sums(draws.draw(0, samples)).sums

def step():
    state = np.array([1.0, 0.1, -0.2, 0.3, 7e3, 1e2, -3e3, *position[0]])
    readings = np.linspace(-1e-3, 2e-3, 90).reshape(5, 3, 6) * [1.0, 1.0, 1.0, 1e3, 1e3, 1e3]
    states = np.empty((5, STATE))
    outcome, steps = advance(field, WGS84.rotation_rate, 6e6, np.full(5, 0.5), readings, state, states)
    return np.array([*state, *states.ravel(), outcome, steps])

reentry, hover = (
    read_campaign(Path("campaigns") / f"{file}.toml") for file in ("01_tn_d1772_trajectory_4", "12_hover")
)
draws = DrawPlan(reentry.errors, reentry.design, reentry.seed, reentry.samples)
field, position = field_constants(WGS84), np.array([[6.5e6, 1e5, -2e5]])
calls = {
    "reentry, partial derivatives": lambda: reentry.scenario.linear().end.partials,
    "reentry, final errors": lambda: final(reentry, "ensemble", 200),
    "reentry, histories": lambda: history(draws, 200),
    "reentry, sums": lambda: sums(draws, 200),
    "reentry, reference": lambda: final(reentry, "reference", 3),
    "hover, reference": lambda: final(hover, "reference", 3),
    "gravitation": lambda: normal_gravitation_at(field, position),
    "gradients of gravitation": lambda: gravitation_gradients(field, position),
    "steps of a navigator": step,
}
names = list(calls)
for name in reversed(names) if sys.argv[1] == "backwards" else names:
    printed(name, calls[name]())
"""


def test_compiled_and_loaded_code_give_the_same_bits() -> None:
    """Of all kinds of kernels whose callers contain a copy of code that is also called for itself.

    Those of inertial navigation's samples and linear analysis have none (`tests/unit/compiled/test_objects.py`).
    """
    compiled, loaded, backwards = (bits(order) for order in ("compile", "forwards", "backwards"))
    assert len(compiled) == 9
    assert loaded == compiled
    assert sorted(backwards) == sorted(compiled)
