"""Settings at which linear analysis does not hold are marked in sweeps, allocations, remedies and live pages."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w

from mcnav.analysis.examination import Linearity
from mcnav.studies.sweep import SweepPlan, run_sweep
from tests.commands import invoke

CAMPAIGNS = Path(__file__).parents[2] / "campaigns"


@pytest.fixture(scope="module")
def polar(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a campaign like 14, whose y bends with the bearing error, with limits to x and to y."""
    place = tmp_path_factory.mktemp("polar")
    shutil.copy(CAMPAIGNS / "polar.py", place)
    content: dict[str, Any] = {
        "samples": 2_000,
        "scenario": {"type": "polar.py:Target", "distance": "1 km", "bearing": "90 deg"},
        "errors": {"range": "20 m", "bearing": "2 deg"},
        "accept": {"quantile": [
            {"output": "x", "probability": 0.95, "below": "400 m"},
            {"output": "y", "probability": 0.95, "below": "60 m"},
        ]},
    }  # fmt: skip
    (place / "polar.toml").write_text(tomli_w.dumps(content), encoding="utf-8")
    return place / "polar.toml"


def true_ratio(bearing: float) -> float:
    """Return true over linear sigma of y = r cos a, for r of 1000 +- 20 m and a bearing error in degrees.

    With ``E cos^2 a = (1 + e^(-2 s^2)) / 2`` and ``E cos a = e^(-s^2 / 2)``; Julier and Uhlmann, 1997.
    """
    s = np.deg2rad(bearing)
    mean_square = (1000.0**2 + 20.0**2) * 0.5 * (1.0 + np.exp(-2.0 * s**2))
    return float(np.sqrt(mean_square - 1000.0**2 * np.exp(-(s**2))) / 20.0)


def test_sweep_marks_from_where_on_linear_analysis_does_not_hold(polar: Path, tmp_path: Path) -> None:
    """The marks follow the closed form of the ratio, from neighbour to neighbour; x holds longer than y does."""
    sweep = run_sweep(polar, SweepPlan({"errors.bearing": "0.1..30 deg"}, ("y", "x"), 20, examine=True))
    for point, _ in sweep.examined:
        verdict = sweep.verdict_at(point, 0)
        assert verdict == Linearity.HOLDS or true_ratio(point[0]) > 1.04
        assert verdict != Linearity.HOLDS or true_ratio(point[0]) < 1.05
    row = [(float(value),) for value in sweep.variables[0].values]
    held = {measure: sweep.shown_to_hold(row, measure) for measure in (0, 1)}
    edge = int(np.argmin(held[0]))
    assert held[0][:edge].all()
    assert not held[0][edge:].any()
    assert true_ratio(row[edge - 1][0]) < 1.05 < true_ratio(row[edge][0]) * 1.02
    assert np.argmin(held[1]) > edge  # the sigma of x is 0.965 times the linear one at 15 deg

    shown = invoke("sweep", polar, "--vary", "errors.bearing=0.1..30 deg", "--examine", "--out", tmp_path, cwd=tmp_path)
    assert "does not hold from errors.bearing" in shown.stdout
    assert "linear analysis does not hold in part of the range" in shown.stdout
    first = shown.stdout.splitlines()[0]
    assert first.endswith("simulate it")
    page = (tmp_path / "sweep.html").read_text(encoding="utf-8")
    assert "linear analysis, not shown to hold" in page
    assert "stroke-dasharray" in page
    stored = json.loads((tmp_path / "sweep.json").read_text(encoding="utf-8"))["linearity"]
    assert stored["unexamined"] is None
    assert {verdict for point in stored["points"] for verdict in point["verdicts"]} >= {"holds", "does not hold"}
    assert "linear analysis" in (tmp_path / "sweep.csv").read_text(encoding="utf-8").splitlines()[0]


def test_sweep_without_an_examination_has_no_mark(polar: Path) -> None:
    sweep = run_sweep(polar, SweepPlan({"errors.bearing": "0.1..30 deg"}, ("y",), 5, examine=False))
    assert (sweep.examined, sweep.unexamined, sweep.doubted) == ((), "", False)


def test_contours_and_families_are_marked(polar: Path) -> None:
    """Corners of a grid; of curves beside each other the ends of each."""
    varied = {"errors.range": "20, 200 m", "errors.bearing": "1, 30 deg"}
    sweep = run_sweep(polar, SweepPlan(varied, ("y",), examine=True))
    corners = {(float(r), float(b)): sweep.verdict_at((r, b), 0) for r in (20.0, 200.0) for b in (1.0, 30.0)}
    assert corners[20.0, 30.0] == "does not hold"
    assert corners[20.0, 1.0] == corners[200.0, 1.0] == "holds"
