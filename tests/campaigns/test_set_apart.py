"""Outputs that a verdict sets apart: rounding is not dispersion, and heavy tails silence nothing but what has them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mcnav.config.read import read_campaign
from mcnav.frames.runs import RunResult
from mcnav.store.run_folder import RunFolder
from mcnav.studies.linear_covariance import linear_covariance
from mcnav.workflow.compare import compare_runs
from mcnav.workflow.heavy_tails import withheld_outputs
from mcnav.workflow.recorded_model import linear_model
from tests.commands import invoke
from tests.runs import simulate

ONE_FIX = """
name = "one fix"
samples = 4_000
seed = 1
[scenario]
type = "ins"
[scenario.trajectory]
rate = "1 Hz"
start = { latitude = "47 deg", longitude = "9 deg", altitude = "500 m", course = "80 deg" }
segments = [{ hold = "10 s" }]
[imu]
[errors]
position_down = "DOWN"
position_north = "1 mm"
[[aiding]]
type = "altimeter"
instants = ["10 s"]
altitude = "2 m"
[filter]
estimates = ["position", "velocity", "attitude"]
"""

HEADING = """
name = "a heading that is wrong"
samples = 200
seed = 1
[scenario]
type = "ins"
[scenario.trajectory]
rate = "10 Hz"
start = { latitude = "-33 deg", longitude = "-120 deg", altitude = "500 m", course = "0 deg", speed = "20 m/s" }
segments = [{ hold = "5 s" }, { speed = "120 m/s" }]
[imu]
[errors]
heading = { distribution = "fixed", value = "ANGLE mrad" }
position_north = "NORTH m"
"""

TAILS = '''
import numpy as np
from mcnav import Output, Source

class Tails:
    """``far`` has heavy tails. Outputs: it, two that do not have it, its square, and a product that rarely has it."""

    sources = tuple(Source(name, "m", "m", 1.0) for name in ("far", "one", "two"))
    outputs = tuple(Output(name, "m", "m") for name in ("itself", "plain", "bent", "square", "rare"))

    def propagate(self, errors):
        far, one, two = errors.T
        rare = np.where(two > 2.6, far, 0.0)
        return np.column_stack([far + one, one, two + 0.2 * two**2, 2.0 * one + 0.1 * far**2, one + two + rare])
'''

TAILED = """
name = "tails"
samples = 20_000
seed = 2
store = "STORE"
[scenario]
type = "tails.py:Tails"
[errors]
far = { distribution = "student-t", sigma = "1 m", degrees_of_freedom = 5 }
one = "1 m"
two = "1 m"
"""


def _written(folder: Path, text: str, **values: str) -> Path:
    for name, value in values.items():
        text = text.replace(name, value)
    (folder / "campaign.toml").write_text(text)
    return folder / "campaign.toml"


def _run(folder: Path, text: str, **values: str) -> dict[str, Any]:
    return simulate(read_campaign(_written(folder, text, **values)), folder / "run", None, 1).summary


@pytest.mark.parametrize("down", ["5 m", "80 m"])
def test_a_filter_that_is_right_to_a_micrometre_is_consistent(tmp_path: Path, down: str) -> None:
    """Its beliefs are true. Of position east, to which 5 m down contribute 1e-7 m, its covariance has nothing."""
    answer = linear_covariance(read_campaign(_written(tmp_path, ONE_FIX, DOWN=down)))
    assert answer.filter is not None
    assert answer.filter.verdict == "consistent"
    assert "position_east" in answer.filter.floors
    summary = _run(tmp_path, ONE_FIX, DOWN=down)
    assert summary["filter"]["verdict"] == "consistent"
    assert (summary["verdict"], summary["verdict_matrix"]) == ("agrees", "agrees")
    assert "position_east" in summary["not_joint"]


@pytest.mark.parametrize(("angle", "north"), [(10.0, 1.0), (20.0, 5.0)])
def test_the_dispersion_of_a_fixed_error_is_no_disagreement(tmp_path: Path, angle: float, north: float) -> None:
    """A heading error psi while 100 m/s are gained northward: +100 psi m/s east, to psi and the turning of the earth.

    The local axes turn by some 3e-3 rad in 200 s at 60 m/s, and position north disperses the outputs by micrometres.
    """
    summary = _run(tmp_path, HEADING, ANGLE=f"{angle:g}", NORTH=f"{north:g}")
    east = summary["mean_sample"][[each["name"] for each in summary["outputs"]].index("velocity_east")]
    assert east == pytest.approx(0.1 * angle, rel=2.0 * (3e-3 + 1e-3 * angle))
    assert summary["verdict"] == "agrees"
    assert set(summary["verdicts"]) == {"agrees"}
    floors = dict(zip([each["name"] for each in summary["outputs"]], summary["floors"], strict=True))
    assert floors["position_east"] == pytest.approx(1e-4 * 9.4 * angle, rel=0.02)
    assert "position_east" in summary["not_joint"]
    shown = invoke("show", "run", cwd=tmp_path)
    assert "Differences too small to matter count as agreement: position east (up to" in shown.stdout
    assert "The joint verdict leaves out position east" in shown.stdout


@pytest.mark.parametrize("store", ["samples", "summary"])
def test_heavy_tails_withhold_the_verdicts_of_what_has_them(tmp_path: Path, store: str) -> None:
    """The square has no partial derivative; the rare one has the source in one sample of 200, by the samples alone."""
    (tmp_path / "tails.py").write_text(TAILS)
    summary = _run(tmp_path, TAILED, STORE=store)
    verdicts = dict(zip([each["name"] for each in summary["outputs"]], summary["verdicts"], strict=True))
    assert verdicts == {
        "itself": "undecided", "plain": "agrees", "bent": "agrees", "square": "undecided", "rare": "undecided",
    }  # fmt: skip
    assert summary["withheld"] == summary["not_joint"] == ["itself", "square", "rare"]
    assert summary["nees_dimension"] == 2
    content = RunResult(tmp_path / "run").content
    if content.convergence is not None:  # as a summary has none of growing parts
        assert np.isfinite(content.convergence.paired.ratio[-1]).tolist() == [False, True, True, False, False]
    ratio = summary["sigma_ratio_paired"][2]
    assert ratio == pytest.approx(np.sqrt(1.0 + 2.0 * 0.2**2), rel=0.01)  # var(2-sided square) = 2
    shown = invoke("show", "run", cwd=tmp_path).stdout
    assert "Undecided for itself, square and rare: tails too heavy for an interval." in shown
    assert "Within ±5 % (95 % confidence): plain and bent." in shown
    assert "The joint verdict leaves out itself, square and rare (heavy tails)." in shown


def test_a_comparison_of_runs_withholds_what_has_heavy_tails_alone(tmp_path: Path) -> None:
    """The same draws with twice the second error: no interval of the output of the heavy tail, one of the others."""
    (tmp_path / "tails.py").write_text(TAILS)
    for name, sigma in (("before", "1 m"), ("after", "2 m")):
        text = TAILED.replace("STORE", "samples").replace('one = "1 m"', f'one = "{sigma}"')
        simulate(read_campaign(_written(tmp_path, text.replace("20_000", "4_000"))), tmp_path / name, None, 1)
    rows = compare_runs([tmp_path / "before", tmp_path / "after"]).rows
    intervals = {row.output: row.change.interval for row in rows if row.change is not None}
    assert intervals["itself"] == (0.0, np.inf)
    low, high = intervals["plain"]
    assert low <= 2.0 <= high
    assert high - low < 1e-6  # linear, by the same draws


def test_runs_of_earlier_versions_have_no_verdict_at_all(tmp_path: Path) -> None:
    """A manifest that does not say which outputs depend on the source withholds all, as it did."""
    (tmp_path / "tails.py").write_text(TAILS)
    _run(tmp_path, TAILED, STORE="samples")
    folder = RunFolder(tmp_path / "run")
    manifest = folder.finished_manifest()
    model, samples = linear_model(manifest.model), folder.samples(manifest)
    assert withheld_outputs(manifest.model, manifest.heavy_tailed, model, samples) == (0, 3, 4)
    earlier = manifest.model.model_copy(update={"tail_outputs": None})
    assert withheld_outputs(earlier, manifest.heavy_tailed, model, samples) == (0, 1, 2, 3, 4)
    assert withheld_outputs(earlier, (), model, samples) == ()
