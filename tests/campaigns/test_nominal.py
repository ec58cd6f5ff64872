"""Requirements on states of the truth count the nominal flight, in every answer; departures alone where they say so.

The loop accelerates by 2.76 m/s^2, one sigma 0.76 %, for 100 s. The velocity change is then normal, with a mean of 276
m/s and a sigma of 2.1 m/s, so that every right value follows from the normal distribution.
"""

from __future__ import annotations

import csv
import json
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
from scipy import stats

from mcnav.analysis.improvements import largest_shares
from mcnav.config.read import read_campaign
from mcnav.errors import CampaignError
from mcnav.frames.runs import open_run
from mcnav.store.run_files import MANIFEST, as_text, json_digest
from mcnav.store.run_folder import RunFolder
from mcnav.studies.allocate import allocate
from mcnav.studies.linear_covariance import linear_covariance
from mcnav.studies.sweep import SweepPlan, run_sweep
from mcnav.workflow.analyse import report_run
from mcnav.workflow.compare import compare_runs
from mcnav.workflow.what_if import what_if_of_answer
from tests.commands import in_process
from tests.conftest import ROOT

LOOP = """
from mcnav import ClosedLoop, White


class Burn(ClosedLoop):
    truth = {"delta_v": "m/s", "drift": "m"}
    parameters = {"thrust": "1"}
    processes = {"jitter": White("m/s/sqrt(s)")}
    step, end = 1.0, 100.0
    settings = {"push": "m/s^2"}

    def __init__(self, push=2.76):
        self.push = push

    def rates(self, truth, parameters, noise):
        return {"delta_v": self.push * (1.0 + parameters.thrust) + noise.jitter}
"""

MEAN, SIGMA, LIMIT = 276.0, 2.1, 280.0
DELTA_V = {"output": "true_delta_v", "below": "280 m/s"}


def quantile(probability: float, mean: float = MEAN, sigma: float = SIGMA) -> float:
    """Return a quantile of the size of a normal variable far from zero."""
    return float(stats.norm.ppf(probability, mean, sigma))


def burn(folder: Path, *accept: dict[str, Any], thrust: str = "0.760869565 %", **changes: Any) -> Path:
    """Write the loop, and a campaign with some quantiles."""
    folder.mkdir(exist_ok=True, parents=True)
    (folder / "burn.py").write_text(LOOP, encoding="utf-8")
    content = {
        "samples": 4_000, "seed": 7, "scenario": {"type": "burn.py:Burn"}, "errors": {"thrust": thrust},
        "processes": {"jitter": "1e-4 m/s/sqrt(s)"}, "accept": {"quantile": list(accept)},
    } | changes  # fmt: skip
    path = folder / "burn.toml"
    path.write_text(tomli_w.dumps(content), encoding="utf-8")
    return path


def ran(path: Path, folder: Path, *more: str) -> dict[str, Any]:
    """Run a campaign and return its summary."""
    done = in_process("run", path, "--out", folder, "--jobs", "1", *more)
    assert done.exit_code == 0, done.output
    return dict(json.loads((folder / "summary.json").read_text(encoding="utf-8")))


def test_linear_analysis_counts_the_nominal(tmp_path: Path) -> None:
    met, unmet, about = ({**DELTA_V, "probability": 0.95}, {**DELTA_V, "probability": 0.9973},
                         {**DELTA_V, "probability": 0.9973, "below": "7 m/s", "about": "nominal"})  # fmt: skip
    answer = linear_covariance(burn(tmp_path, met, unmet, about))
    values = [each.value for each in answer.requirements]
    sides = stats.norm.ppf(0.5 + 0.5 * 0.9973)  # of a departure both sides count
    assert values == pytest.approx([quantile(0.95), quantile(0.9973), sides * SIGMA], rel=1e-6)
    assert [each.met for each in answer.requirements] == [True, False, True]
    margin = (LIMIT - MEAN) / SIGMA / stats.norm.ppf(0.9973)  # errors grow, the nominal does not
    assert answer.requirements[1].margin == pytest.approx(margin, rel=1e-6)
    assert [cause.name for cause in answer.requirement_causes(1)] == ["thrust"]


def test_a_run_counts_the_nominal(tmp_path: Path) -> None:
    """Of 4,000 samples 2.8 % lie beyond the limit, where 0.27 % may: the bounds are exact."""
    unmet, late = {**DELTA_V, "probability": 0.9973}, {**DELTA_V, "probability": 0.95, "after": "60 s"}
    about = {**DELTA_V, "probability": 0.9973, "below": "8 m/s", "about": "nominal"}
    summary = ran(burn(tmp_path, unmet, late, about), tmp_path / "run")
    first, second, third = summary["requirements"]
    assert [each["finding"] for each in (first, second, third)] == ["not met", "met", "met"]
    assert first["interval"][0] <= quantile(0.9973) <= first["interval"][1]
    assert second["interval"][0] <= quantile(0.95) <= second["interval"][1]
    assert third["about"] == "nominal"
    assert report_run(tmp_path / "run")["requirements"] == summary["requirements"]


def test_several_outputs_count_the_nominal(tmp_path: Path) -> None:
    accept = {
        "box": [{"within": {"true_delta_v": "280 m/s"}, "probability": 0.97}],
        "quantile": [{**DELTA_V, "output": "navigated_delta_v", "probability": 0.97}],
    }
    path = burn(tmp_path, accept=accept)
    share = float(stats.norm.cdf((LIMIT - MEAN) / SIGMA))
    by_kind = {each.requirement.kind: each for each in linear_covariance(path).requirements}
    assert by_kind["box"].value == pytest.approx(share, rel=1e-6)
    assert by_kind["box"].met
    assert by_kind["quantile"].value == pytest.approx(MEAN, rel=1e-9)  # navigated without an error
    summary = ran(path, tmp_path / "run")
    (box,) = (each for each in summary["requirements"] if each["kind"] == "box")
    assert box["interval"][0] <= share <= box["interval"][1]


@pytest.mark.parametrize("after", [{}, {"after": "60 s"}], ids=["at the end", "over time"])
def test_rare_events_count_the_nominal(after: dict[str, str], tmp_path: Path) -> None:
    """One in 1.4 million lies beyond 286.2 m/s: by flights along lines, whose interval holds at 95 %."""
    rare = {**DELTA_V, "probability": 0.99999, "below": "286.2 m/s", **after}
    summary = ran(burn(tmp_path, rare), tmp_path / "run")
    (required,) = summary["requirements"]
    known = required["exceedance"]
    expected = float(stats.norm.sf((286.2 - MEAN) / SIGMA))
    assert known["from"] <= expected <= known["to"]
    assert required["finding"] == "met"
    (linear,) = linear_covariance(burn(tmp_path, rare)).requirements
    assert linear.beyond == pytest.approx(expected, rel=1e-4)  # the sigma has four digits


def test_studies_count_the_nominal(tmp_path: Path) -> None:
    path = burn(tmp_path, {**DELTA_V, "probability": 0.9973})
    largest = (LIMIT - MEAN) / stats.norm.ppf(0.9973) / MEAN
    sweep = run_sweep(path, SweepPlan({"errors.thrust": "0.2..1 %"}, points=4))
    assert sweep.just_met[0].values == pytest.approx([100.0 * largest], rel=1e-4)
    assert sweep.values[0, 0] == pytest.approx(quantile(0.9973, sigma=0.002 * MEAN), rel=1e-6)
    (goal,) = allocate(path, confirm=0).goals
    alone = next(change for change in goal.changes if change.label == "errors.thrust")
    assert alone.factor == pytest.approx(largest / (SIGMA / MEAN), rel=1e-2)  # three digits, rounded down
    answer = linear_covariance(path)
    what_if = what_if_of_answer(answer, tomllib.loads(path.read_text(encoding="utf-8")), "")
    assert what_if is not None
    factors = [1.0] * len(what_if.campaign.sliders)
    shares = largest_shares(what_if.covariance, what_if.requirements, [factors])
    assert shares == pytest.approx([quantile(0.9973) / LIMIT], rel=1e-6)


def test_the_nominal_of_each_point_counts_in_a_sweep(tmp_path: Path) -> None:
    """The nominal flight is another one at each value of a setting."""
    path = burn(tmp_path, {**DELTA_V, "probability": 0.9973})
    sweep = run_sweep(path, SweepPlan({"scenario.push": "2.70, 2.76, 2.80 m/s^2"}))
    expected = [quantile(0.9973, 100.0 * push, push * SIGMA / 2.76) for push in (2.70, 2.76, 2.80)]
    assert sweep.values[:, 0] == pytest.approx(expected, rel=1e-6)


def test_every_table_has_the_nominal(tmp_path: Path) -> None:
    path = burn(tmp_path, {**DELTA_V, "probability": 0.9973})
    summary = ran(path, tmp_path / "run")
    names = [output["name"] for output in summary["outputs"]]
    assert summary["nominal"][names.index("true_delta_v")] == pytest.approx(MEAN, rel=1e-12)
    assert summary["nominal"][names.index("delta_v")] is None
    for command in (("show", tmp_path / "run"), ("lincov", path, "--out", tmp_path / "lincov")):
        line = next(line for line in in_process(*command).output.splitlines() if line.startswith("true delta v"))
        assert line.split()[4] in ("276", "276.00")
    for name, place in (("lincov/lincov.html", "276.00"), ("run/report.html", "276.00")):
        assert place in (tmp_path / name).read_text(encoding="utf-8")
    table = json.loads((tmp_path / "lincov" / "lincov.json").read_text(encoding="utf-8"))
    assert table["nominal"][names.index("true_delta_v")] == pytest.approx(MEAN, rel=1e-12)
    frame = open_run(tmp_path / "run").outputs
    assert frame.loc["true_delta_v", "nominal"] == pytest.approx(MEAN, rel=1e-12)
    printed = in_process("run", path, "--out", tmp_path / "run", "--format", "csv").stdout.splitlines()
    row = next(row for row in csv.DictReader(printed) if row["output"] == "true_delta_v")
    assert float(row["nominal"]) == pytest.approx(MEAN, rel=1e-12)


def test_a_comparison_tells_another_nominal(tmp_path: Path) -> None:
    ran(burn(tmp_path), tmp_path / "one", "--samples", "200")
    faster = {"type": "burn.py:Burn", "push": "2.9 m/s^2"}
    ran(burn(tmp_path, scenario=faster), tmp_path / "other", "--samples", "200")
    rows = {row.output: row for row in compare_runs([tmp_path / "one", tmp_path / "other"]).rows}
    assert rows["true_delta_v"].nominal == pytest.approx((276.0, 290.0), rel=1e-12)
    assert rows["delta_v"].nominal == (None, None)


def test_only_departures_are_about_the_nominal(tmp_path: Path) -> None:
    path = burn(tmp_path, {"output": "delta_v", "probability": 0.9, "below": "1 m/s", "about": "nominal"})
    with pytest.raises(CampaignError, match="delta_v is no departure from the nominal flight"):
        read_campaign(path)


def test_runs_of_earlier_versions_are_read(tmp_path: Path) -> None:
    """They have no nominal, and their requirements are on departures, as they were found."""
    ran(burn(tmp_path, {**DELTA_V, "probability": 0.9973}), tmp_path / "run")
    folder = RunFolder(tmp_path / "run")
    content = folder.finished_manifest().to_json()
    for key in ("origin", "mean_rounding"):
        del content["model"][key]
    folder.write(MANIFEST, as_text(content | {"checksum": json_digest(content)}))
    summary = report_run(tmp_path / "run")
    assert "nominal" not in summary
    assert summary["requirements"][0]["finding"] == "met"
    assert in_process("show", tmp_path / "run").exit_code == 0


def test_the_rates_of_a_guided_reentry_are_states() -> None:
    """The landing point is measured from that of the nominal flight, whose rates at the end count."""
    answer = linear_covariance(ROOT / "campaigns" / "25_guided_reentry.toml")
    names, model = [output.name for output in answer.outputs], answer.model
    assert model.origin is not None
    assert model.origin[names.index("true_range")] == 0.0
    history = read_campaign(ROOT / "campaigns" / "25_guided_reentry.toml").scenario.nominal()
    column = next(name for name in history.columns if "altitude rate" in name)
    last = 1e3 * float(np.asarray(history.columns[column])[-1])  # of km/s
    assert model.origin[names.index("true_altitude_rate")] == pytest.approx(last, rel=1e-5)
