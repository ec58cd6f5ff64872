"""Intervals of sigmas over time are there from as many samples on as those of the same sigmas at the end."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import mcnav
from tests.conftest import campaign
from tests.runs import simulate


@pytest.mark.parametrize(("samples", "known"), [(60, False), (120, True)])
def test_both_are_known_or_neither(samples: int, known: bool, tmp_path: Path) -> None:
    simulate(campaign(1, samples=samples), tmp_path / "run", None, 1)
    run = mcnav.open_run(tmp_path / "run")
    end = run.outputs[["ratio_plain_from", "ratio_plain_to"]].to_numpy(dtype=float)
    last = run.epochs[["sigma_plain_from", "sigma_plain_to"]].to_numpy(dtype=float)
    moving = run.outputs["sigma_linear"].to_numpy(dtype=float) > 0.0
    assert np.isfinite(end[moving]).all() == known
    assert np.isfinite(last).all() == known
