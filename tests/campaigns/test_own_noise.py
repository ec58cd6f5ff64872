"""Scenarios of one's own with noise and errors over time: the same bits everywhere, their linear side, refusals."""

from __future__ import annotations

import hashlib
import json
import os
import signal
import sys
import textwrap
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

import mcnav
from mcnav.config.read import read_campaign
from mcnav.config.templates import new_scenario
from mcnav.contract.engine import has_histories
from mcnav.errors import CampaignError
from mcnav.report.statements.linearity import WITHOUT_NOISE
from mcnav.systems.user import noise_measurement
from mcnav.systems.user.noise_measurement import INDEPENDENT
from mcnav.workflow.replay import as_stored, replay
from mcnav.workflow.run import run_campaign
from tests.commands import in_process
from tests.conftest import ROOT
from tests.processes import LONG, run_to_end, running, wait_for
from tests.runs import simulate

STEPS = 8

WALK = """
import os
import time
import numpy as np
from mcnav import Epochs, Output, Source

class Mine:
    sources = (Source("a", "m", "m", 1.0),)
    outputs = (Output("b", "m", "m"), Output("c", "m", "m"))
    epochs = Epochs("time [s]", np.arange(9.0), {"half-way": 4.0})

    def fly(self, errors, noise):
        steps = noise.normal(0.0, 0.5, 8)
        walk = np.append(0.0, np.cumsum(steps))
        BODY
        return np.column_stack([errors[0] + walk, 2.0 * errors[0] * np.ones(9)])
"""
"""A random walk of eight steps of sigma 0.5 m about a source of sigma 1 m, and twice the source."""

COVARIANCE = """
    def noise_covariance(self):
        found = np.zeros((9, 2, 2))
        found[:, 0, 0] = 0.25 * np.arange(9.0)
        return {"walk": found}
"""

TWIN = """
    def fly_linear(self, errors, noise):
        walk = np.append(0.0, np.cumsum(noise.normal(0.0, 0.5, 8)))
        return np.outer(np.ones(9), errors @ [[1.0, 2.0]]) + np.outer(walk, [1.0, 0.0])
"""


def _written(folder: Path, body: str = "pass", more: str = COVARIANCE, samples: int = 300, top: str = "") -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    code = WALK.replace("BODY", textwrap.indent(textwrap.dedent(body), " " * 8).strip()) + more
    (folder / "mine.py").write_text(code)
    path = folder / "mine.toml"
    path.write_text(f'samples = {samples}\nseed = 3\n{top}\n[scenario]\ntype = "mine.py:Mine"\n[errors]\na = "1 m"\n')
    return path


def _digests(folder: Path) -> dict[str, str]:
    parts = sorted((folder / "samples").glob("part-*.parquet"))
    return {part.name: hashlib.sha256(part.read_bytes()).hexdigest() for part in parts}


def _outputs(folder: Path) -> np.ndarray:
    return mcnav.samples_of(folder).filter(regex="output|linear").to_numpy()


def _refused(path: Path, folder: Path, **options: bool) -> str:
    with pytest.raises(CampaignError) as refused:
        run_campaign(read_campaign(path), folder, None, 1, **options)
    (line,) = str(refused.value).splitlines()
    return line


def test_workers_chunks_restarts_and_extensions_give_the_same_bits(tmp_path: Path) -> None:
    path = _written(tmp_path / "code")
    for jobs in (1, 2):
        simulate(read_campaign(path), tmp_path / str(jobs), None, jobs)
    whole = _digests(tmp_path / "1")
    assert len(whole) == 3
    assert _digests(tmp_path / "2") == whole
    (tmp_path / "2" / "samples" / "part-00001.parquet").unlink()
    assert simulate(read_campaign(path), tmp_path / "2", None, 1).simulated == 128
    assert _digests(tmp_path / "2") == whole
    simulate(read_campaign(path, {"samples": 130}), tmp_path / "extended", None, 1)
    assert simulate(read_campaign(path), tmp_path / "extended", None, 1).simulated == 172
    assert _digests(tmp_path / "extended") == whole
    chunked = _written(tmp_path / "chunked", more=COVARIANCE + "\n    chunk = 50\n")
    simulate(read_campaign(chunked), tmp_path / "50", None, 2)
    assert len(_digests(tmp_path / "50")) == 6
    np.testing.assert_array_equal(_outputs(tmp_path / "50"), _outputs(tmp_path / "1"))
    assert all(as_stored(replay(tmp_path / "1", index, path)) for index in (0, 127, 128, 299))


def test_a_killed_run_goes_on_to_the_same_bits(tmp_path: Path) -> None:
    """SIGKILL to the command, whose workers notice by themselves; then the same command again."""
    path = _written(tmp_path, "time.sleep(0.01)", COVARIANCE + "\n    chunk = 20\n", samples=160)
    command = [sys.executable, "-m", "mcnav", "run", path, "--jobs", "2", "--no-report", "--out"]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    simulate(read_campaign(path), tmp_path / "calm", None, 2)
    with running([*command, tmp_path / "hit"], env=environment) as process:
        wait_for(lambda: _digests(tmp_path / "hit"), process)
        process.send_signal(signal.SIGKILL)
        process.communicate(timeout=LONG)
    left = _digests(tmp_path / "hit")
    assert 0 < len(left) < len(_digests(tmp_path / "calm"))
    simulate(read_campaign(path), tmp_path / "hit", None, 2)
    assert _digests(tmp_path / "hit") == _digests(tmp_path / "calm")


def test_a_sample_that_ends_its_process_leaves_the_others_their_noise(tmp_path: Path) -> None:
    """Those beyond one and a half sigma end their worker: the others are repeated one by one."""
    simulate(read_campaign(_written(tmp_path / "calm", samples=40)), tmp_path / "1", None, 1)
    body = "if abs(errors[0]) > 1.5: os._exit(9)"
    path = _written(tmp_path / "wild", body, samples=40)
    summary = simulate(read_campaign(path), tmp_path / "2", None, 1).summary
    samples = pd.read_parquet(tmp_path / "2" / "samples")
    wild = samples["error a [m]"].abs() > 1.5
    assert 0 < wild.sum() == summary["failed"]
    assert (samples["status"] == "ok").equals(~wild)
    calm, kept = _outputs(tmp_path / "1"), _outputs(tmp_path / "2")
    np.testing.assert_array_equal(kept[~wild], calm[~wild])
    assert np.isnan(kept[wild]).all()


def test_a_run_of_which_nothing_is_left(tmp_path: Path) -> None:
    """Every sample with noise ends its process: all have failed, with that reason."""
    body = "if noise.__class__ is np.random.Generator: os._exit(9)"
    summary = simulate(read_campaign(_written(tmp_path, body, samples=6)), tmp_path / "run", None, 1).summary
    assert summary["failures"] == {"failed: the worker process died while flying it": 6}


def test_a_summary_store_has_the_same_estimates(tmp_path: Path) -> None:
    found = []
    for store in ("samples", "summary"):
        path = _written(tmp_path / store, samples=600, top=f'store = "{store}"')
        found.append(simulate(read_campaign(path), tmp_path / store / "run", None, 1).summary)
    for key in ("sigma_linear", "sigma_sample", "sigma_paired", "nees_mean"):
        np.testing.assert_allclose(found[0][key], found[1][key], rtol=1e-9)


def test_linear_sigmas_pairs_and_budget(tmp_path: Path) -> None:
    """Sigma of the walk after eight steps is sqrt(2) m; the samples are linear, so that paired sigmas are exact."""
    summary = run_campaign(read_campaign(_written(tmp_path)), tmp_path / "run", None, 1).summary
    np.testing.assert_allclose(summary["sigma_linear"], [np.sqrt(3.0), 2.0], rtol=1e-9)
    np.testing.assert_allclose(summary["sigma_ratio_paired"], 1.0, atol=1e-9)  # differences round by 1e-16 / SCALE
    assert summary["verdict"] == "agrees"
    assert summary["unsettled"] is None
    assert [process["name"] for process in summary["processes"]] == ["walk"]
    np.testing.assert_allclose(summary["budget"]["shares"], [[1.0 / 3.0, 2.0 / 3.0], [1.0, 0.0]], atol=1e-9)
    epochs = pq.read_table(tmp_path / "run" / "epochs.parquet").to_pandas()
    np.testing.assert_allclose(epochs["linear sigma b [m]"], np.sqrt(1.0 + 0.25 * np.arange(9.0)), rtol=1e-9)
    samples = mcnav.samples_of(tmp_path / "run")["output b [m]"]
    assert epochs["sigma b [m]"].iloc[-1] == pytest.approx(samples.std(), rel=1e-9)
    histories = pq.read_table(tmp_path / "run" / "histories.parquet").to_pandas()
    assert len(histories) == 300 * 9
    page = (tmp_path / "run" / "report.html").read_text()
    assert "linear outcomes by differences of fly with its noise scaled down" in page


def test_partials_of_its_own_at_every_epoch(tmp_path: Path) -> None:
    """Those at the end are checked against differences; without any error going in the walk is left."""
    more = COVARIANCE + "    def partials(self): return np.tile([[1.0], [2.0]], (9, 1, 1))\n"
    path = _written(tmp_path, more=more)
    for errors, budget in (("1 m", 1.0), ("0 m", 0.0)):
        path.write_text(path.read_text().replace('a = "1 m"', f'a = "{errors}"'))
        summary = simulate(read_campaign(path), tmp_path / errors, None, 1).summary
        np.testing.assert_allclose(summary["sigma_linear"], [np.sqrt(budget + 2.0), 2.0 * budget], rtol=1e-12)
        epochs = pq.read_table(tmp_path / errors / "epochs.parquet").to_pandas()
        np.testing.assert_allclose(epochs["linear sigma c [m]"], 2.0 * budget, rtol=1e-12)
    wrong = _written(tmp_path / "wrong", more=more.replace("2.0]]", "2.2]]"))
    assert "the class's own partial derivative of output 'c' to source 'a' is" in _refused(wrong, tmp_path / "run")


def test_own_linear_simulations_are_those_of_differences(tmp_path: Path) -> None:
    for name, more in (("differences", COVARIANCE), ("own", COVARIANCE + TWIN)):
        simulate(read_campaign(_written(tmp_path / name, more=more)), tmp_path / name / "run", None, 1)
    differences, own = (_outputs(tmp_path / name / "run") for name in ("differences", "own"))
    np.testing.assert_array_equal(differences[:, :2], own[:, :2])
    np.testing.assert_allclose(differences[:, 2:], own[:, 2:], atol=1e-12)


def test_a_covariance_that_is_not_given_is_measured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Exactly with a probe for each variate, else within five standard errors, which hardly matter in paired ratios.

    Worker processes measure the same bits.
    """
    varies = "walk = walk + 0.0 * (noise.normal() if walk[-1] > 0.0 else 0.0)"
    exact = "computed from a linear simulation for each of its 8 variates"
    rough = "measured from 1,000 linear simulations, sigmas to 2.2 %"
    cases = {"differences": ("", "pass", exact), "own": (TWIN, "pass", exact), "varies": ("", varies, rough)}
    for name, (more, body, words) in cases.items():
        run = run_campaign(read_campaign(_written(tmp_path / name, body, more)), tmp_path / name / "run", None, 1)
        (process,) = run.summary["processes"]
        assert process["name"] == "noise"
        error = 5.0 * np.sqrt(2.0 / INDEPENDENT) if name == "varies" else 1e-9
        assert process["covariance"][0][0] == pytest.approx(2.0, rel=error)
        np.testing.assert_allclose(run.summary["sigma_ratio_paired"], 1.0, atol=1e-9)
        assert run.summary["verdict"] == "agrees"
        assert words in (tmp_path / name / "run" / "report.html").read_text()
    monkeypatch.setattr(noise_measurement, "SHARED_FROM", 0.0)
    alone, shared = (
        read_campaign(_written(tmp_path / name, body, "")).scenario.linear().end.processes["noise"]
        for name, body in (("differences", "pass"), ("shared", "pass  # by workers"))
    )
    np.testing.assert_array_equal(alone, shared)


@pytest.mark.parametrize("more", [COVARIANCE, ""], ids=["covariance", "measured"])
def test_a_response_that_is_not_linear_is_found(more: str, tmp_path: Path) -> None:
    """With 0.3 w^2 for a walk w of variance 2, variance 3 becomes 3 + 0.09 * 8: five standard errors of 20,000."""
    body = "walk = walk + 0.3 * walk**2"
    run = simulate(read_campaign(_written(tmp_path, body, more, 2_000)), tmp_path / "run", None, 2)
    (low, high), expected = run.summary["sigma_ratio_paired_interval"][0], np.sqrt(3.72 / 3.0)
    assert low - 0.005 < expected < high + 0.005  # the measured variance of the noise is 3 % off at most
    assert run.summary["verdicts"] == ["differs", "agrees"]


def test_a_covariance_of_noise_that_is_wrong_is_told(tmp_path: Path) -> None:
    """The paired estimate alone would agree with it."""
    path = _written(tmp_path, more=COVARIANCE.replace("0.25", "0.5"), samples=600)
    summary = run_campaign(read_campaign(path), tmp_path / "run", None, 1).summary
    assert summary["verdict"] == "undecided"
    assert (summary["unsettled"]["noise"], summary["unsettled"]["output"]) == ("noise_covariance", "b")
    assert summary["unsettled"]["disagreement"] == pytest.approx(1.0 - np.sqrt(0.5), abs=5.0 / np.sqrt(1_200.0))
    words = "own noise covariance disagrees with its linear simulations (b: "
    assert words in repr(mcnav.open_run(tmp_path / "run"))
    assert words in (tmp_path / "run" / "report.html").read_text()
    checked = {check.name: check.passed for check in mcnav.check_scenario(path)}
    assert [name for name, passed in checked.items() if not passed] == ["covariance of the noise"]


def test_linear_simulations_that_are_wrong_are_refused(tmp_path: Path) -> None:
    path = _written(tmp_path, more=COVARIANCE + TWIN.replace("0.5", "0.6"))
    assert "fly_linear() differs from simulations with small errors and noise, in output 'b' by" in _refused(
        path, tmp_path / "run"
    )
    summary = simulate(read_campaign(path), tmp_path / "run", None, 1, force=True).summary
    assert (summary["verdict"], summary["unsettled"]["noise"]) == ("undecided", "fly_linear")
    assert "own linear simulations disagree with its simulations (b: " in repr(mcnav.open_run(tmp_path / "run"))


REFUSED = {
    "random elsewhere": ("walk = walk + np.random.default_rng().normal()", "answers identical calls differently"),
    "kept between calls": ("self.n = getattr(self, 'n', 0) + 1; walk = walk * self.n", "answers identical calls"),
    "random elsewhere with noise alone": (
        "walk = walk + (np.random.default_rng().normal() if noise.normal() != 0.0 else 0.0)",
        "answers identical calls with identical noise differently",
    ),
    "its bits": ("walk = walk + 1e-9 * float(noise.bit_generator.random_raw() % 7)", "is random without noise"),
    "no scale": ("walk = walk + noise.poisson(3.0)", "noise.poisson has no linear response"),
    "a jump": ("walk = np.round(walk)", "the response of output 'b' to the noise is not linear"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_no_function_of_errors_and_noise_is_refused(case: str, tmp_path: Path) -> None:
    body, message = REFUSED[case]
    if case == "a jump":
        body = "walk = np.floor(100.0 * walk + 0.5) / 100.0 + 0.001 * walk"
    assert message in _refused(_written(tmp_path, body), tmp_path / "run")
    assert not list(tmp_path.glob("run/samples/*"))


DECLARED = {
    "noise_covariance must return finite numbers of shape (9, 2, 2)": COVARIANCE.replace('{"walk": found}', "found[0]"),
    "noise_covariance must name at least one process": COVARIANCE.replace('{"walk": found}', "{}"),
    "'a' is not a name of letters, digits and _, or is that of a source": COVARIANCE.replace('"walk"', '"a"'),
    "that of walk is not symmetric and positive semidefinite": COVARIANCE.replace("0.25 *", "-0.25 *"),
    "noise_covariance: ZeroDivisionError: division by zero (line": COVARIANCE.replace("found =", "1 / 0; found ="),
    "partials must return finite numbers of shape (9, 2, 1)": COVARIANCE + "    def partials(self): return [[1], [2]]",
    "its flight without any error failed: ValueError: fly must return shape (8, 2)": (
        COVARIANCE + "    epochs = Epochs('time [s]', np.arange(8.0))"
    ),
    "Mine.epochs must be Epochs of mcnav with 2 to 1,000 rising times": COVARIANCE + "    epochs = [3.0, 2.0]",
    "fly_linear must return finite numbers of shape (9, 2)": TWIN.replace("walk, [1.0", "walk, [np.nan"),
    "propagate takes errors alone; noise and epochs need fly": "    def propagate(self, errors): return errors",
}


@pytest.mark.parametrize("message", DECLARED)
def test_what_is_declared_wrongly_is_told_in_one_line(message: str, tmp_path: Path) -> None:
    with pytest.raises(CampaignError) as refused:
        simulate(read_campaign(_written(tmp_path, more=DECLARED[message])), tmp_path / "run", None, 1)
    (line,) = str(refused.value).splitlines()
    assert message in line


def test_what_noise_makes_meaningless_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CampaignError, match="which cannot draw noise; expected one of random"):
        read_campaign(_written(tmp_path, top='design = "sobol"'))
    path = _written(tmp_path)
    mapped = in_process("run", path, "--engine", "map", "--out", tmp_path / "run")
    assert (mapped.exit_code, "this scenario has single" in mapped.output) == (2, True)
    options = ["--samples", "200", "--largest", "1", "--out", str(tmp_path / "linearity")]
    ranged = in_process("sweep", path, "--scale", *options)
    assert ranged.exit_code == 0, ranged.output
    assert WITHOUT_NOISE in " ".join(ranged.output.split())
    with pytest.raises(CampaignError, match="alone, so its state transitions are unknown"):
        read_campaign(path, {"start_times": {}})


def test_final_errors_with_noise_alone(tmp_path: Path) -> None:
    """Without epochs, final errors and their covariance; there are no histories."""
    more = "    def noise_covariance(self): return [[2.0, 0.0], [0.0, 0.0]]\n"
    path = _written(tmp_path, "return np.array([errors[0] + walk[-1], 2.0 * errors[0]])", more)
    (tmp_path / "mine.py").write_text((tmp_path / "mine.py").read_text().replace("    epochs =", "    instants ="))
    run = read_campaign(path)
    assert run.scenario.noisy
    summary = simulate(run, tmp_path / "run", None, 1).summary
    np.testing.assert_allclose(summary["sigma_ratio_paired"], 1.0, atol=1e-9)
    assert [process["name"] for process in summary["processes"]] == ["noise"]
    assert not (tmp_path / "run" / "epochs.parquet").exists()
    assert as_stored(replay(tmp_path / "run", 7, path))


def test_errors_over_time_without_noise(tmp_path: Path) -> None:
    path = _written(tmp_path, "return np.outer(np.arange(9.0), [errors[0], errors[0] ** 3])", more="")
    code = (tmp_path / "mine.py").read_text()
    lines = [line for line in code.splitlines() if "steps" not in line]
    (tmp_path / "mine.py").write_text("\n".join(lines).replace("errors, noise", "errors"))
    run = read_campaign(path)
    assert not has_histories(run.scenario.engine("single", np.zeros((1, 1))))
    summary = simulate(run, tmp_path / "run", None, 1).summary
    assert summary["sigma_ratio_paired"][0] == pytest.approx(1.0, abs=1e-9)
    epochs = pq.read_table(tmp_path / "run" / "epochs.parquet").to_pandas()
    np.testing.assert_allclose(epochs["linear sigma b [m]"], np.arange(9.0), rtol=1e-9)
    assert not [name for name in mcnav.samples_of(tmp_path / "run").columns if name.startswith("linear")]
    assert as_stored(replay(tmp_path / "run", 7, path))


def test_failures_have_no_linear_outcome_and_do_not_count(tmp_path: Path) -> None:
    path = _written(tmp_path, "if noise.__class__ is np.random.Generator and walk[-1] > 3.0: raise ValueError('off')")
    summary = simulate(read_campaign(path), tmp_path / "run", None, 1).summary
    samples = mcnav.samples_of(tmp_path / "run")
    failed = samples["status"] == "failed: ValueError: off (line 15)"
    assert 0 < failed.sum() == summary["failed"]
    assert samples.loc[failed].filter(regex="output|linear").isna().all(axis=None)
    assert samples.loc[~failed].filter(regex="output|linear").notna().all(axis=None)


def test_a_time_limit_holds_for_each_sample(tmp_path: Path) -> None:
    body = "if abs(errors[0]) > 2.0: time.sleep(60.0)"
    path = _written(tmp_path, body, samples=30, top='sample_timeout = "2 s"')
    summary = simulate(read_campaign(path), tmp_path / "run", None, 2).summary
    samples = pd.read_parquet(tmp_path / "run" / "samples")
    hanging = samples["error a [m]"].abs() > 2.0
    assert 0 < hanging.sum() < len(samples)
    assert (samples["status"][hanging] != "ok").all()
    assert set(summary["failures"]) == {"failed: took longer than 2 s"}


def test_a_new_scenario_with_noise_runs_as_it_stands(tmp_path: Path) -> None:
    """Linear covariance of the Schuler loop by its closed form, against the samples; the tests that come with it."""
    written = in_process("new", "scenario", "drift", "--stochastic", "--in", tmp_path)
    assert written.exit_code == 0, written.output
    assert "then change fly in" in " ".join(written.output.split())
    code, campaign, test = (tmp_path / name for name in ("drift.py", "drift.toml", "test_drift.py"))
    summary = simulate(read_campaign(campaign, {"samples": 400}), tmp_path / "run", None, 2).summary
    assert (summary["verdict"], summary["unsettled"]) == ("agrees", None)
    assert max(abs(np.array(summary["sigma_ratio_paired"]) - 1.0)) < 1e-6  # the third-order term of angles of 1e-4 rad
    passed = run_to_end(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-c", os.devnull, test],
        cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    assert passed.returncode == 0, passed.stdout
    assert json.loads((tmp_path / "run" / "manifest.json").read_text())["identity"]["code"]["file"] == code.name
    with pytest.raises(CampaignError, match="exists already"):
        new_scenario("drift", tmp_path, stochastic=True)
