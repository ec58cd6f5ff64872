"""Campaigns of Python objects: the run of their file; code of a notebook cell or script, kept in the run folder."""

from __future__ import annotations

import sys
import warnings
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pandas as pd
import pint
import pytest

import mcnav as mc
from mcnav.entries.inputs import SourceFile
from mcnav.systems.user.captured import captured_code
from mcnav.systems.user.code import load_class
from tests.closed_loops import DoubleIntegrator
from tests.notebooks import code_cells, execute
from tests.processes import run_to_end

ROOT = Path(__file__).parents[2]

ERRORS = {"altitude": "5 km", "gyro_drift": "0.2 deg/h"}
REENTRY = {"type": "reentry", "trajectory": 4}
PINT: pint.UnitRegistry[float] = pint.UnitRegistry()

CELLS = """
import sys
import numpy as np
import mcnav as mc

GRAVITY = 9.80665


def double(value):
    return 2.0 * value


class Shot:
    sources = (mc.Source("angle", "rad", "deg", 0.01), mc.Source("speed", "m/s", "m/s", 1.0))
    outputs = (mc.Output("range", "m", "m"),)

    def propagate(self, errors):
        angle, speed = 0.6 + errors[:, :1], 100.0 + errors[:, 1:]
        return speed**2 * np.sin(double(angle)) / GRAVITY - 100.0**2 * np.sin(double(0.6)) / GRAVITY


def shot(errors):
    return Shot().propagate(errors)


if __name__ == "__main__":
    errors = mc.Errors({"angle": "1 deg", "speed": 0.5})
    factor = 2.0
    scenarios = {
        "class": Shot,
        "function": {"type": shot, "outputs": [mc.Output("range", "m", "m")]},
        "closure": {"type": lambda given: factor * given[:, :1], "outputs": ["range"]},
    }
    for name, scenario in scenarios.items():
        for jobs in (1, 2):
            campaign = mc.Campaign(scenario, errors, samples=20_000, seed=3)
            run = mc.run(campaign, f"{sys.argv[1]}/{name}_{jobs}", jobs=jobs)
            print(name, jobs, run.samples["output range [" + ("1" if name == "closure" else "m") + "]"].sum().hex())
"""


def test_numbers_quantities_and_text_are_one_campaign() -> None:
    """With the resolved file of a campaign that has text alone."""
    text = mc.Campaign(REENTRY, ERRORS, samples=500)
    for errors in (
        {"altitude": 5000.0, "gyro_drift": PINT.Quantity(0.2, "deg/hour")},
        {"altitude": mc.normal("5 km"), "gyro_drift": "0.2 deg/h"},
        mc.Errors(ERRORS),
        mc.Errors({"altitude": np.float64(5e3), "gyro_drift": "0.2 deg/h"}),
    ):
        campaign = mc.Campaign(REENTRY, errors, samples=500)
        np.testing.assert_allclose(campaign.errors.covariance, text.errors.covariance, rtol=1e-14)
        assert "units" not in campaign.resolved  # every number has its unit in the file
    assert mc.Campaign(REENTRY, mc.Errors(ERRORS), samples=500).to_toml() == text.to_toml()


def test_numbers_of_other_tables_are_si_and_said_to_be(tmp_path: Path) -> None:
    scenario = {**REENTRY, "final_altitude": 30e3}
    campaign = mc.Campaign(scenario, ERRORS, samples=500)
    assert campaign.resolved["units"] == "SI"
    file = tmp_path / "again.toml"
    file.write_text(campaign.to_toml())
    assert mc.read_campaign(file).to_toml() == campaign.to_toml()
    file.write_text(campaign.to_toml().replace('units = "SI"', ""))
    with pytest.raises(mc.CampaignError, match=r"scenario.final_altitude: got 30000.0 without a unit"):
        mc.read_campaign(file)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"errors": {"altitude": [1.0] * 3}}, "errors.altitude"),
        (
            {"errors": {"altitude": mc.table([1.0, 2.0])}},
            "errors.altitude: holds values; a campaign has them in a file",
        ),
        ({"errors": {"altitude": object()}}, "errors.altitude: got <object"),
        ({"scenario": {"type": len, "outputs": []}}, "scenario: a function needs the names of its outputs"),
        ({"accept": [{"r95": 1, "cep": 2}]}, "accept #1: expected a table of its kind"),
        ({"sampels": 3}, "sampels: unknown key"),
    ],
)
def test_a_mistake_names_its_key(given: dict[str, Any], message: str) -> None:
    with pytest.raises(mc.CampaignError, match=f"^campaign: {message}"):
        mc.Campaign(**({"scenario": REENTRY, "errors": ERRORS} | given))


def test_requirements_may_be_a_list() -> None:
    listed = [{"quantile": {"output": "altitude", "probability": 0.95, "below": "10 km"}}, {"sigma_ratio": 0.05}]
    table = {"quantile": [listed[0]["quantile"]], "sigma_ratio": 0.05}
    campaigns = [mc.Campaign(REENTRY, ERRORS, accept=accept) for accept in (listed, table)]
    assert campaigns[0].to_toml() == campaigns[1].to_toml()


def test_a_campaign_is_varied_and_saved(tmp_path: Path) -> None:
    campaign = mc.Campaign(REENTRY, ERRORS, samples=500, name="mine")
    changed = campaign.vary({"errors.altitude": "1 km", "samples": 300})
    assert (changed.samples, changed.errors.standard_deviations[0]) == (300, 1000.0)
    assert campaign.samples == 500
    changed.save(tmp_path / "mine.toml")
    assert mc.read_campaign(tmp_path / "mine.toml").to_toml() == changed.to_toml()
    assert repr(campaign) == "Campaign 'mine': 500 samples of Reentry"


def test_code_of_a_script_runs_in_other_processes_and_is_kept(tmp_path: Path) -> None:
    """With the same samples for one and two jobs; the folder has readable source, or says why it has none."""
    (tmp_path / "cells.py").write_text(CELLS)
    finished = run_to_end([sys.executable, str(tmp_path / "cells.py"), str(tmp_path)])
    assert finished.returncode == 0, finished.stderr
    sums = [line.split() for line in finished.stdout.splitlines()]
    assert [line[:2] for line in sums] == [[name, jobs] for name in ("class", "function", "closure") for jobs in "12"]
    assert len({line[2] for line in sums[:4]}) == 1
    assert sums[4][2] == sums[5][2]
    kept = (tmp_path / "class_1" / "Shot.py").read_text()
    assert "GRAVITY = 9.80665" in kept
    assert "def double(value)" in kept
    compile(kept, "Shot.py", "exec")
    refused = (tmp_path / "closure_1" / "Simulated.py").read_text()
    assert refused.startswith("# The source of function could not be kept: <lambda> is defined within a function")
    again = mc.read_campaign(tmp_path / "class_1" / "campaign.toml")
    run = mc.run(again, tmp_path / "again", jobs=1)
    pd.testing.assert_frame_equal(run.samples, mc.open_run(tmp_path / "class_1").samples, check_exact=True)


UNIT = 3.0


class OfModule:
    """A class of a module, which uses a constant and a function of it."""

    sources = (mc.Source("a", "m", "m", 1.0),)
    outputs = (mc.Output("b", "m", "m"),)

    def propagate(self, errors: Any) -> Any:
        """Multiply."""
        return UNIT * np.asarray(errors)


def test_a_class_is_simulated_as_its_file_is() -> None:
    draws = mc.Errors({"a": "2 m"}).draw(100, seed=1)
    np.testing.assert_array_equal(mc.simulate(OfModule, draws), 3.0 * draws.to_numpy())
    text = captured_code(OfModule).text
    assert "UNIT = 3.0" in text
    assert "import mcnav as mc" in text


def test_a_closed_loop_is_simulated_and_linearized() -> None:
    """With the linear answer's P, and its covariance where there is process noise in `lincov` alone."""
    campaign = mc.Campaign(DoubleIntegrator, {"position": 3.0}, measurements={"ranging": "1 m"}, samples=500)
    partials = mc.partials(campaign, campaign_errors := mc.Errors({"position": 3.0}))
    answer = mc.lincov(campaign)
    pd.testing.assert_frame_equal(partials, answer.partials[["position"]], rtol=1e-9, atol=1e-15, check_names=False)
    assert partials.attrs["error"] < 1e-6
    draws = campaign_errors.draw(500, seed=1)
    out = mc.simulate(campaign, draws)
    pd.testing.assert_frame_equal(out, mc.simulate(campaign, draws, jobs=1), check_exact=True)
    verdict = mc.compare(answer.covariance, out)
    assert verdict.verdict in ("agrees", "undecided")  # of 500 samples, some intervals are wider than the tolerance
    assert "ranging" in mc.compare(mc.propagate_covariance(partials, campaign_errors), out).sentence


ISSUE = """
import sys
import numpy as np
import pint
import mcnav as mc

KILO = pint.UnitRegistry().Quantity(5.0, "km")


def function(errors):
    altitude, bias, tilt = errors.T
    return np.column_stack([altitude + 2e6 * tilt, 300.0 * bias + 0.02 * altitude * tilt])


if __name__ == "__main__":
    errors = mc.Errors({"altitude": KILO, "bias_x": mc.uniform("100 ug"), "tilt": 2e-4},
                       correlations={("altitude", "tilt"): 0.3})
    S = errors.covariance
    P = mc.partials(function, errors)
    C = mc.propagate_covariance(P, S)
    for jobs in (1, 2):
        draws = errors.draw(20_000, seed=1)
        out = mc.simulate(function, draws, jobs=jobs)
        verdict = mc.compare(C, out, draws, P)
        campaign = mc.Campaign({"type": function, "outputs": ["position", "velocity"]}, errors, samples=2_000)
        run = mc.run(campaign, f"{sys.argv[1]}/run_{jobs}", jobs=jobs)
        swept = mc.sweep(campaign, {"errors.altitude": [1e3, "5 km"]}, against="position")
        changes = mc.compare_runs([mc.open_run(f"{sys.argv[1]}/run_1"), run]).outputs
        print(jobs, draws.sum().sum().hex(), out.sum().sum().hex(), verdict.verdict,
              run.samples["output position [1]"].sum().hex(), swept.to_numpy().sum().hex(), set(changes["change"]))
    print(*S.columns, *C.columns, *run.outputs.columns[:3], verdict.frame.index.name, run.outputs.index.name)
"""


def test_the_lines_of_the_issue_have_the_same_results_with_one_and_two_jobs(tmp_path: Path) -> None:
    """With SI floats, quantities of pint and text; the function is one of the script."""
    (tmp_path / "lines.py").write_text(ISSUE)
    finished = run_to_end([sys.executable, str(tmp_path / "lines.py"), str(tmp_path)])
    assert finished.returncode == 0, finished.stderr
    one, two, names = finished.stdout.splitlines()
    assert one.split()[1:] == two.split()[1:]
    assert "agrees" in one
    assert names == "altitude bias_x tilt y1 y2 unit sigma_linear sigma_paired output output"


def test_the_notebook_runs_as_it_stands() -> None:
    """Trajectory 4 in twenty lines with the verdict of campaign 01, and a function of the notebook, run and stored."""
    matplotlib.use("Agg")
    notebook = ROOT / "mcnav" / "docs" / "tutorials" / "trajectory_4.ipynb"
    cells = code_cells(notebook)
    assert sum(bool(line) for cell in cells[:4] for line in cell.splitlines()) <= 20
    names = execute(notebook, cells[:4])
    assert (names["verdict"].verdict, names["verdict"].joint) == ("partly", "differs")
    assert names["verdict"].worst_ratio == pytest.approx(1.143, abs=5e-4)  # as campaign 01 prints it
    run = execute(notebook, cells)["run"]
    assert run.outputs.loc["range", "verdict"] == "agrees"
    assert [label.get_text() for label in run.plot().get_yticklabels()] == ["range"]


@pytest.mark.parametrize(("former", "name"), [("fly", "run"), ("Flown", "Simulated"), ("FlownRun", "RunResult")])
def test_a_former_name_warns(former: str, name: str) -> None:
    with pytest.warns(DeprecationWarning, match=rf"mcnav.{former} is now mcnav.{name}$"):
        assert getattr(mc, former) is getattr(mc, name)


def test_a_class_with_a_former_name_runs_and_the_user_is_told() -> None:
    """Python hides such warnings in modules by default; the campaign's class is one."""
    code = SourceFile("mine.py", "from mcnav import Flown\n\n\nclass Mine:\n    kind = Flown\n")
    with warnings.catch_warnings(record=True) as noticed:
        warnings.simplefilter("ignore")
        assert vars(load_class(code, "Mine"))["kind"] is mc.Simulated
    ours = [(str(warning.message), warning.filename) for warning in noticed if warning.filename == "mine.py"]
    assert ours == [("mcnav.Flown is now mcnav.Simulated", "mine.py")]
