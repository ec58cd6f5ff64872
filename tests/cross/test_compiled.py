"""Code compiled in a process and code loaded from disk give the same bits, in whichever order it is loaded.

What a process compiles here is stored where all tests find it. These tests therefore come first (`tests/conftest.py`),
so that hardly any other compiles.
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


def bits(code: str, order: str) -> list[str]:
    """Run code in a process that either loads nothing and stores what it compiles, or compiles nothing.

    Parameters
    ----------
    order : str
        ``compile``, or, of loaded code, ``forwards`` or ``backwards``.
    """
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = run_to_end([sys.executable, "-c", BEGIN + code + END, order], cwd=ROOT, env=environment)
    assert done.returncode == 0, done.stderr
    assert done.stderr.splitlines()[-1] == ("compiles" if order == "compile" else "loads")
    return done.stdout.splitlines()


REENTRY_AND_STEADY = """
from pathlib import Path
from mcnav.config.read import read_campaign
from mcnav.contract.engine import has_histories, without_noise
from mcnav.contract.samples import Batch
from mcnav.runner.draws import DrawPlan
from mcnav.numerics.power_sums import sum_powers_about_zero

def final(name, engine, samples):
    printed(f"{name}, final errors", without_noise(engine)(samples).values)

def histories_of(engine, samples):
    if has_histories(engine):
        return engine.histories(samples)
    return engine.simulate(Batch(np.arange(len(samples)), samples, 1)).history

def history(name, engine, samples):
    printed(f"{name}, histories", histories_of(engine, samples))

def moments(name, engine, samples):
    apart = has_histories(engine)
    sums = engine.history_sums(samples) if apart else sum_powers_about_zero(histories_of(engine, samples))
    printed(f"{name}, sums", sums.sums)

for file in ("01_tn_d1772_trajectory_4", "11_cruise", "12_hover"):
    campaign = read_campaign(Path("campaigns") / f"{file}.toml")
    draws = DrawPlan(campaign.errors, campaign.design, campaign.seed, campaign.samples)
    scenario = campaign.scenario
    calls = [
        lambda: printed(f"{file}, partial derivatives", scenario.linear().end.partials),
        lambda: final(f"{file}, ensemble", scenario.engine("ensemble", draws.probes()), draws.draw(0, 200)),
        lambda: history(f"{file}, ensemble", scenario.engine("ensemble", draws.probes()), draws.draw(0, 200)),
        lambda: moments(f"{file}, ensemble", scenario.engine("ensemble", draws.probes()), draws.draw(0, 200)),
        lambda: final(f"{file}, reference", scenario.engine("reference", draws.probes()), draws.draw(0, 3)),
    ]
    for call in reversed(calls) if sys.argv[1] == "backwards" else calls:
        call()
"""


def test_compiled_and_loaded_code_give_the_same_bits() -> None:
    """Linear model, final errors, histories and sums, by both engines, of reentry, cruise and hover."""
    compiled, loaded, backwards = (bits(REENTRY_AND_STEADY, order) for order in ("compile", "forwards", "backwards"))
    assert len(compiled) == 15
    assert loaded == compiled
    assert sorted(backwards) == sorted(compiled)


INERTIAL = """
from mcnav.systems.ins.scenario import Ins, Navigation
from mcnav.contract.samples import Batch
from tests.cross.test_ins_aided import END, SIGMAS, START, WALK, draw, scenario
from tests.flights import flight

aided = scenario(("gnss", "altimeter", "stars", "doppler", "compass"))
errors = draw(19, SIGMAS, 1, aided)
free = Ins(Navigation(flight(1.0), "strapdown", START, START + 60.0, WALK))
size = len(free.sources)
for name in ("ensemble", "reference"):
    found = free.engine(name, errors[:, :size]).simulate(Batch(np.arange(2), errors[:2, :size], 1))
    for values in (found.values, found.linear_values, found.history):
        printed(f"free, {name}", values)
for name, of in (("free", free), ("aided", aided)):
    linear = of.linear().end
    printed(f"{name}, partial derivatives", linear.partials)
    printed(f"{name}, processes", np.stack([linear.processes[name] for name in sorted(linear.processes)]))
printed("own covariance", aided.filter_prediction().covariance)
for name in ("ensemble", "shared-gains"):
    found = aided.engine(name, errors).simulate(Batch(np.arange(19), errors, 1))
    for values in (found.values, found.linear_values, found.history, found.filter_values):
        printed(f"aided, {name}", values)
"""


def test_compiled_and_loaded_code_of_inertial_navigation_give_the_same_bits() -> None:
    """Free and aided: errors, linear errors, histories and records of the filters by each engine; linear covariance."""
    compiled, loaded = (bits(INERTIAL, order) for order in ("compile", "forwards"))
    assert len(compiled) == 19
    assert loaded == compiled
