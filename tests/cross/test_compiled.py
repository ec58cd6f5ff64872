"""Code compiled in a process and code loaded from disk give the same bits, in whichever order it is loaded."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from tests.conftest import ROOT
from tests.processes import run_to_end

CODE = """
import hashlib, sys
from pathlib import Path
import numpy as np
from mcnav.config.read import read_campaign
from mcnav.execution.chunks import DrawPlan

def printed(name, values):
    print(name, hashlib.sha256(np.ascontiguousarray(values).tobytes()).hexdigest())

def final(name, engine, samples):
    printed(f"{name}, final errors", engine.propagate(samples).values)

def history(name, engine, samples):
    printed(f"{name}, histories", engine.histories(samples))

def moments(name, engine, samples):
    printed(f"{name}, sums", engine.history_sums(samples).sums)

backwards = sys.argv[2] == "backwards"
for file in ("01_tn_d1772_trajectory_4", "11_cruise", "12_hover"):
    campaign = read_campaign(Path(sys.argv[1]) / f"{file}.toml")
    draws = DrawPlan(campaign.errors, campaign.design, campaign.seed, campaign.samples)
    scenario = campaign.scenario
    calls = [
        lambda: printed(f"{file}, partial derivatives", scenario.linear_model().partials),
        lambda: final(f"{file}, ensemble", scenario.engine("ensemble", draws.probes()), draws.draw(0, 200)),
        lambda: history(f"{file}, ensemble", scenario.engine("ensemble", draws.probes()), draws.draw(0, 200)),
        lambda: moments(f"{file}, ensemble", scenario.engine("ensemble", draws.probes()), draws.draw(0, 200)),
        lambda: final(f"{file}, reference", scenario.engine("reference", draws.probes()), draws.draw(0, 3)),
    ]
    for call in reversed(calls) if backwards else calls:
        call()
"""


def test_compiled_and_loaded_code_give_the_same_bits(tmp_path: Path) -> None:
    """Linear model, final errors, histories and sums, by both engines, of reentry, cruise and hover."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    compiled, loaded, backwards = (
        run_to_end([sys.executable, "-c", CODE, ROOT / "campaigns", order], env=environment)
        for order in ("forwards", "forwards", "backwards")
    )
    assert len(compiled.stdout.splitlines()) == 15, compiled.stderr
    assert loaded.stdout == compiled.stdout, loaded.stderr
    assert sorted(backwards.stdout.splitlines()) == sorted(compiled.stdout.splitlines()), backwards.stderr


AIDED = """
import hashlib
import numpy as np
from mcnav.scenarios.protocol import Batch
from tests.cross.test_ins_aided import SIGMAS, draw, scenario

names = ("gnss", "altimeter", "stars", "doppler", "compass")
of = scenario(names)
errors = draw(19, SIGMAS, 1, of)
for name in ("ensemble", "shared-gains"):
    found = of.engine(name, errors).simulate(Batch(np.arange(19), errors, 1))
    for values in (found.values, found.linear_values, found.history, found.filter_values):
        print(name, hashlib.sha256(np.ascontiguousarray(values).tobytes()).hexdigest())
prediction = of.filter_prediction()
print("own covariance", hashlib.sha256(prediction.covariance.tobytes()).hexdigest())
"""


def test_compiled_and_loaded_code_of_aided_samples_give_the_same_bits(tmp_path: Path) -> None:
    """Errors, linear errors, histories and records of the filters, with own and with shared gains."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path), "PYTHONPATH": str(ROOT)}
    compiled, loaded = (run_to_end([sys.executable, "-c", AIDED], env=environment) for _ in range(2))
    assert len(compiled.stdout.splitlines()) == 9, compiled.stderr
    assert loaded.stdout == compiled.stdout, loaded.stderr
