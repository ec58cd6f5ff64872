"""Scenarios of one's own: flown, resumed, refused when changed, never executed by reading; what breaks the protocol."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import subprocess
import sys
import textwrap
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import get_args

import numpy as np
import pandas as pd
import pytest

import mcnav
from mcnav.cli.options import TemplateType
from mcnav.config.read import parse_campaign, read_campaign
from mcnav.config.templates import new_campaign, new_scenario
from mcnav.errors import CampaignError, RunFolderError
from mcnav.systems.registry import SCENARIO_TYPES
from mcnav.workflow.analyse import report_run
from mcnav.workflow.replay import as_stored, replay
from mcnav.workflow.run import run_campaign
from tests.commands import invoke
from tests.conftest import ROOT
from tests.faults.scenarios import KillsWorkers
from tests.forked import run_forked
from tests.printed import count_scripts
from tests.processes import run_to_end
from tests.runs import simulate

BOOST, POLAR = ROOT / "campaigns" / "13_boost.toml", ROOT / "campaigns" / "14_polar.toml"


def _digests(folder: Path) -> dict[str, str]:
    parts = sorted((folder / "samples").glob("part-*.parquet"))
    return {part.name: hashlib.sha256(part.read_bytes()).hexdigest() for part in parts}


def _environment() -> dict[str, str]:
    return os.environ | {"PYTHONPATH": str(ROOT), "COLUMNS": "160"}


IMPORTS = "import os\nimport numpy as np\nfrom mcnav import History, Output, Panel, Source\n\n"
"""By name: ``*`` would import all of mcnav, in every worker."""


def _written(folder: Path, body: str, scenario: str = "") -> Path:
    """A scenario file and a campaign that flies its class ``Mine``."""
    (folder / "mine.py").write_text(IMPORTS + textwrap.dedent(body))
    described = f'samples = 300\nseed = 1\n[scenario]\ntype = "mine.py:Mine"\n{scenario}\n[errors]\na = "1 m"\n'
    path = folder / "campaign_of_mine.toml"
    path.write_text(described)
    return path


GOOD = """
class Mine:
    sources = (Source("a", "m", "m", 1.0),)
    outputs = (Output("b", "m", "m"),)

    def fly(self, errors):
        return 2.0 * errors
"""


SAMPLES = {BOOST: 257, POLAR: 20_000}
"""Three chunks each; the third one of boost has one sample."""


@pytest.fixture(scope="module")
def runs_of(tmp_path_factory: pytest.TempPathFactory) -> Callable[[Path], Path]:
    """From a campaign to a folder with its runs by one job and by two, which are made once."""

    @cache
    def made(campaign: Path) -> Path:
        folder = tmp_path_factory.mktemp("runs")
        for jobs in (1, 2):
            simulate(read_campaign(campaign, {"samples": SAMPLES[campaign]}), folder / str(jobs), None, jobs)
        return folder

    return made


@pytest.mark.parametrize("campaign", SAMPLES, ids=["boost", "polar"])
def test_one_and_two_jobs_give_the_same_bits(campaign: Path, runs_of: Callable[[Path], Path]) -> None:
    folder = runs_of(campaign)
    assert _digests(folder / "1") == _digests(folder / "2")
    assert len(_digests(folder / "1")) == 3


def test_the_reports_are_complete(tmp_path: Path) -> None:
    """Every figure; boost says what was flown, polar has nothing to say of it."""
    common = {"ratios", "nees", "budget", "scatter", "histograms", "matrices", "quantiles"}
    for campaign, shown in ((BOOST, common | {"flight"}), (POLAR, common)):
        folder = tmp_path / campaign.stem
        run_campaign(read_campaign(campaign, {"samples": 300}), folder, None, 2)
        page = (folder / "report.html").read_text(encoding="utf-8")
        for figure in shown:
            assert f'id="{figure}-0-c"' in page
        assert ('id="flight-0-c"' in page) == ("flight" in shown)
        assert "partial derivatives by central differences, steps agree to" in page


def test_the_textbook_moments(tmp_path: Path) -> None:
    """Sigmas of x and y within five standard errors of their closed form; linear misses y by a factor of 2.5."""
    count, spread, distance, turned = 20_000, 20.0, 1_000.0, np.radians(15.0)
    summary = simulate(read_campaign(POLAR), tmp_path / "run", None, 1).summary
    square = 0.5 * (distance**2 + spread**2)
    along = square * (1.0 + np.exp(-2.0 * turned**2)) - (distance * np.exp(-0.5 * turned**2)) ** 2
    across = square * (1.0 - np.exp(-2.0 * turned**2))
    samples = mcnav.samples_of(tmp_path / "run").filter(like="output").to_numpy()
    for values, variance in zip(samples.T, (across, along), strict=True):
        squares = (values - values.mean()) ** 2
        assert squares.mean() == pytest.approx(variance, abs=5.0 * squares.std() / np.sqrt(count))
    mean = distance * (np.exp(-0.5 * turned**2) - 1.0)
    assert samples[:, 1].mean() == pytest.approx(mean, abs=5.0 * np.sqrt(along / count))
    np.testing.assert_allclose(summary["sigma_linear"], [distance * turned, spread], rtol=1e-6)
    assert summary["verdicts"] == ["agrees", "differs"]


def test_a_killed_worker_is_outlived(tmp_path: Path) -> None:
    """The run goes on by itself, to the same bits."""
    body = "import time\n" + GOOD.replace("return 2.0", "time.sleep(0.005)\n        return 2.0") + "    chunk = 40\n"
    run, kills = read_campaign(_written(tmp_path, body), {"samples": 160}), KillsWorkers()
    simulate(run, tmp_path / "calm", None, 2)
    simulate(run, tmp_path / "hit", None, 2, progress=kills)
    assert kills.killed
    assert _digests(tmp_path / "hit") == _digests(tmp_path / "calm")


def test_a_sample_that_kills_its_worker_is_a_failure(tmp_path: Path) -> None:
    """One beyond 2.5 sigma ends the process that flies it: it alone fails, with that reason."""
    body = GOOD.replace("return 2.0", "if abs(errors[0]) > 2.5: os._exit(9)\n        return 2.0") + "    chunk = 50\n"
    run = read_campaign(_written(tmp_path, body))
    summary = simulate(run, tmp_path / "run", None, 2).summary
    samples = pd.read_parquet(tmp_path / "run" / "samples")
    wild = samples["error a [m]"].abs() > 2.5
    assert 0 < wild.sum() == summary["failed"]
    assert (samples["status"][wild] == "failed: the worker process died while flying it").all()
    assert (samples["status"][~wild] == "ok").all()


def test_a_single_chunk_is_flown_in_a_worker_too(tmp_path: Path) -> None:
    """Its last sample ends the process: the command lives on and tells."""
    body = GOOD.replace("return 2.0", "if abs(errors[0]) > 2.5: os._exit(9)\n        return 2.0")
    summary = simulate(read_campaign(_written(tmp_path, body), {"samples": 120}), tmp_path / "run", None, 2).summary
    assert 0 < summary["failed"] < 10
    assert set(summary["failures"]) == {"failed: the worker process died while flying it"}


def test_failures_keep_their_reason_and_place(tmp_path: Path) -> None:
    body = GOOD.replace("return 2.0", "if errors[0] > 2.0: raise ValueError('too far')\n        return 2.0")
    summary = simulate(read_campaign(_written(tmp_path, body)), tmp_path / "run", None, 1).summary
    (reason,) = summary["failures"]
    assert reason == "failed: ValueError: too far (line 11)"


def test_a_vectorised_failure_is_pinned_to_its_sample(tmp_path: Path) -> None:
    """An exception for a whole chunk, and a value that is not finite."""
    body = GOOD.replace("def fly", "def propagate").replace(
        "return 2.0",
        "if (errors > 2.5).any(): raise ValueError('too far')\n        return np.sqrt(errors + 2.0) - 1.0 + 0.0",
    )
    with np.errstate(invalid="ignore"):
        summary = simulate(read_campaign(_written(tmp_path, body)), tmp_path / "run", None, 1).summary
    assert set(summary["failures"]) == {"failed: ValueError: too far (line 11)", "failed: an output is not finite"}
    samples = pd.read_parquet(tmp_path / "run" / "samples")
    errors = samples["error a [m]"]
    assert np.array_equal(samples["status"] != "ok", (errors > 2.5) | (errors < -2.0))


def test_a_changed_file_is_refused_like_a_changed_campaign(tmp_path: Path) -> None:
    campaign = _written(tmp_path, GOOD)
    simulate(read_campaign(campaign), tmp_path / "run", None, 1)
    before = _digests(tmp_path / "run")
    _written(tmp_path, GOOD.replace("2.0", "3.0"))
    with pytest.raises(RunFolderError, match=r"holds the results of another run \(code\.sha256 was"):
        simulate(read_campaign(campaign), tmp_path / "run", None, 1)
    assert _digests(tmp_path / "run") == before
    again = simulate(read_campaign(tmp_path / "run" / "campaign.toml"), tmp_path / "run", None, 1)
    assert again.simulated == 0  # the file as it was flown lies in the run folder
    simulate(read_campaign(campaign), tmp_path / "run", None, 1, fresh=True)
    assert "3.0" in (tmp_path / "run" / "mine.py").read_text()


def test_a_run_goes_on_from_what_is_stored(tmp_path: Path) -> None:
    run = read_campaign(_written(tmp_path, GOOD))
    simulate(run, tmp_path / "run", None, 1)
    before = _digests(tmp_path / "run")
    (tmp_path / "run" / "samples" / "part-00001.parquet").unlink()
    assert simulate(run, tmp_path / "run", None, 1).simulated == 128
    assert _digests(tmp_path / "run") == before


def test_reading_a_run_folder_executes_nothing(tmp_path: Path) -> None:
    """The file leaves a mark when it is executed: reports, samples and summaries leave none."""
    mark = tmp_path / "executed"
    campaign = _written(tmp_path, f"open({str(mark)!r}, 'w').close()\n" + GOOD)
    run_campaign(read_campaign(campaign), tmp_path / "run", None, 1)
    mark.unlink()
    shutil.rmtree(tmp_path / "elsewhere", ignore_errors=True)
    for command in ("report", "compare"):
        done = run_forked(command, tmp_path / "run", cwd=tmp_path)
        assert done.returncode == 0, done.stderr
    report_run(tmp_path / "run")
    mcnav.samples_of(tmp_path / "run")
    mcnav.summary_of(tmp_path / "run")
    assert not mark.exists()
    manifest = json.loads((tmp_path / "run" / "manifest.json").read_text())
    assert manifest["identity"]["code"]["file"] == "mine.py"


@pytest.mark.parametrize("campaign", [BOOST, POLAR, ROOT / "campaigns" / "11_cruise.toml"], ids=lambda path: path.stem)
def test_replayed_samples_are_those_of_the_run(campaign: Path, runs_of: Callable[[Path], Path], tmp_path: Path) -> None:
    """The code of the user's own is the file that the command names, never the one kept in the run folder."""
    own, count = campaign in SAMPLES, SAMPLES.get(campaign, 200)
    folder, described = (runs_of(campaign) / "1", campaign) if own else (tmp_path / "run", None)
    if not own:
        simulate(read_campaign(campaign, {"samples": count}), folder, None, 1)
    for index in (0, 63, count - 1):
        assert as_stored(replay(folder, index, described))
    with pytest.raises((CampaignError, RunFolderError)):
        replay(folder, count, described)


def test_settings_have_units(tmp_path: Path) -> None:
    body = GOOD.replace(
        "    def fly", "    settings = {'gain': 's'}\n    def __init__(self, gain=1.0): self.gain = gain\n    def fly"
    )
    body = body.replace("2.0 * errors", "self.gain * errors")
    run = read_campaign(_written(tmp_path, body, 'gain = "2 min"'))
    np.testing.assert_allclose(run.scenario.linear().end.partials, [[120.0]], rtol=1e-12)
    for line, message in (
        ('gain = "2 m"', "scenario.gain: got '2 m', which is a length; expected a time"),
        ('gian = "2 s"', "scenario.gian: unknown key; did you mean 'gain'?"),
    ):
        with pytest.raises(CampaignError) as refused:
            read_campaign(_written(tmp_path, body, line))
        (told,) = str(refused.value).splitlines()
        assert message in told


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("class Mine", "class Other", "mine.py has no class Mine; it has Other"),
        ("class Mine", "class Mine(", "mine.py cannot be executed: SyntaxError"),
        ("class Mine", "1 / 0\nclass Mine", "mine.py cannot be executed: ZeroDivisionError: division by zero (line 6)"),
        ("class Mine", "raise SystemExit\nclass Mine", "mine.py cannot be executed: SystemExit"),
        ('"m", "m", 1.0', '"m", "s", 1.0', "Mine.sources: 'm' shown in 's'"),
        ('"m", "m", 1.0', '"m", "m", 0.0', "Mine.sources: a needs a usual size above zero; got 0.0"),
        ('"a", "m"', '"a b", "m"', "Mine.sources: 'a b' is not a name"),
        ('(Source("a", "m", "m", 1.0),)', "()", "Mine.sources must be one or more Source of mcnav; got ()"),
        ("def fly", "def flie", "Mine has neither propagate, for many samples, nor fly, for one"),
        ("def fly", "settings = 3\n    def fly", "Mine.settings must give a unit for each name"),
        ("def fly", "def __init__(self): raise KeyError(1)\n    def fly", "Mine cannot be made: KeyError: 1 (line 10)"),
    ],
)
def test_what_is_no_scenario_is_told_in_one_line(before: str, after: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(CampaignError) as refused:
        read_campaign(_written(tmp_path, GOOD.replace(before, after)))
    (line,) = str(refused.value).splitlines()
    assert f"scenario.type: {message}" in line


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        (
            "2.0 * errors",
            "[1.0, 2.0]",
            "its flight without any error failed: ValueError: fly must return shape (1,)",
        ),
        ("2.0 * errors", "errors / (errors != 0.0)", "its flight without any error failed"),
        ("def fly", "def partials(self): return 3\n    def fly", "partials must return finite numbers of shape (1, 1)"),
        ("def fly", "def history(self): return 3\n    def fly", "history: TypeError: history must return a History"),
        ("def fly", "chunk = 0\n    def fly", "Mine.chunk must be a whole number from 1"),
        (
            "def fly",
            "sources += tuple(Source(f'e{n}', 'm', 'm', 1.0) for n in range(95))\n    chunk = 600_001\n    def fly",
            "Mine.chunk must be a whole number from 1 to 600,000; got 600001",
        ),
    ],
)
@pytest.mark.filterwarnings("ignore:invalid value:RuntimeWarning")
def test_what_cannot_be_flown_is_told_before_the_flight(before: str, after: str, message: str, tmp_path: Path) -> None:
    run = read_campaign(_written(tmp_path, GOOD.replace(before, after)))
    with pytest.raises(CampaignError) as refused:
        simulate(run, tmp_path / "run", None, 1)
    assert f"scenario.type: {message}" in str(refused.value)


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        ("nowhere.py:Mine", "nowhere.py does not exist; paths are relative to the campaign file"),
        ("mine.py", f"got 'mine.py'; expected one of {', '.join(SCENARIO_TYPES)}, or a file and class"),
        ("mine.py:not a class", "got 'mine.py:not a class'; expected one of"),
    ],
)
def test_files_that_are_not_there(kind: str, message: str, tmp_path: Path) -> None:
    described = {"scenario": {"type": kind}, "errors": {}}
    with pytest.raises(CampaignError) as refused:
        parse_campaign(described, str(tmp_path / "campaign.toml"), "campaign")
    assert message in str(refused.value)


def _check(path: Path) -> dict[str, tuple[bool, str]]:
    return {check.name: (check.passed, check.told) for check in mcnav.check_scenario(path)}


@pytest.mark.parametrize(
    "campaign",
    [*sorted((ROOT / "campaigns").glob("1[0-8]*.toml")), ROOT / "campaigns" / "04_tn_d1772_trajectory_3.toml"],
    ids=lambda path: path.stem,
)  # fmt: skip
def test_our_own_scenarios_keep_the_protocol(campaign: Path) -> None:
    found = _check(campaign)
    assert len(found) == 10
    switching = "not zero without errors: altitude 0.36"  # drag above the switch is not measured
    assert found["nominal outputs"][1].startswith(switching if "10_" in campaign.name else "zero without errors")
    assert all(passed for passed, _ in found.values()), found


@pytest.mark.parametrize(
    ("after", "name"),
    [
        ("return np.random.default_rng().normal(size=1)", "determinism"),
        ("self.n = getattr(self, 'n', 0) + 1\n        return errors * self.n", "determinism"),
        ("return np.abs(errors)", "linear near zero"),
        ("return errors + (errors > 0.001)", "linear near zero"),
        ("return errors + 0.1 * np.sign(errors)", "partials against differences"),
    ],
)
def test_what_does_not_keep_it_is_found(after: str, name: str, tmp_path: Path) -> None:
    found = _check(_written(tmp_path, GOOD.replace("return 2.0 * errors", after)))
    assert not found[name][0], found


def test_outputs_that_are_not_zero_without_errors_are_named(tmp_path: Path) -> None:
    passed, told = _check(_written(tmp_path, GOOD.replace("return 2.0 * errors", "return 5.0 + 2.0 * errors")))[
        "nominal outputs"
    ]
    assert passed
    assert told.startswith("not zero without errors: ")
    assert " 5" in told
    assert "requirements limit the outputs themselves, and count this too" in told


def test_own_partials_that_are_wrong_are_found(tmp_path: Path) -> None:
    wrong = GOOD.replace("    def fly", "    def partials(self): return [[2.1]]\n    def fly")
    assert not _check(_written(tmp_path, wrong))["partials against differences"][0]


def test_steps_are_chosen_where_the_function_allows(tmp_path: Path) -> None:
    """A cubic term wants short steps, noise long ones: the derivative is found to a thousandth with both."""
    body = GOOD.replace("2.0 * errors", "2.0 * errors + errors**3 + 1e-6 * np.sin(1e9 * errors)")
    run = read_campaign(_written(tmp_path, body))
    assert run.scenario.linear().end.partials[0, 0] == pytest.approx(2.0, rel=1e-3)


def test_steps_that_cannot_be_flown_are_left_out(tmp_path: Path) -> None:
    """A function that ends at a fifth of sigma; one that ends at zero has no derivative there."""
    body = GOOD.replace("return 2.0", "if errors[0] > 0.2: raise ValueError('beyond')\n        return 2.0")
    run = read_campaign(_written(tmp_path, body))
    assert run.scenario.linear().end.partials[0, 0] == pytest.approx(2.0, rel=1e-9)
    run = read_campaign(_written(tmp_path, body.replace("0.2", "0.0")))
    with pytest.raises(
        CampaignError, match="no two steps of source 1 could be flown to both sides: ValueError: beyond"
    ):
        simulate(run, tmp_path / "run", None, 1)


def test_what_a_history_says_stays_text(tmp_path: Path) -> None:
    """Titles and columns of a user's figure come into the page escaped."""
    history = """
        x = np.arange(3.0)
        title = "<script>alert(1)</script> $\\\\frac{$"
        return History({"t [s]": x, "<b>y [m]": x}, {}, (Panel(title, "t [s]", ("<b>y [m]",)),))
    """
    body = GOOD + "\n    def history(self):" + history
    run_campaign(read_campaign(_written(tmp_path, body)), tmp_path / "run", None, 1)
    page = (tmp_path / "run" / "report.html").read_text()
    assert "<script>alert" not in page
    assert count_scripts(page) == 1  # our own
    assert "<b>" not in page
    assert "Nominal flight" in page


def test_a_new_scenario_runs_as_it_stands(tmp_path: Path) -> None:
    """As a new user has it: written, flown, tested."""
    code, campaign, test = new_scenario("my_system", tmp_path)
    summary = simulate(read_campaign(campaign, {"samples": 2_000}), tmp_path / "run", None, 1).summary
    assert summary["verdict"] == "agrees"
    assert code.name == "my_system.py"
    pytests = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-c", os.devnull, test]
    passed = run_to_end(pytests, cwd=tmp_path, env=_environment())
    assert passed.returncode == 0, passed.stdout
    with pytest.raises(CampaignError, match="exists already"):
        new_scenario("my_system", tmp_path)


@pytest.mark.parametrize("kind", get_args(TemplateType))
def test_a_new_campaign_runs_as_it_stands(kind: str, tmp_path: Path) -> None:
    (path,) = new_campaign("mine", tmp_path, kind)
    summary = simulate(read_campaign(path, {"samples": 200}), tmp_path / "run", None, 1).summary
    assert summary["failed"] == 0


@pytest.mark.parametrize("name", ["", "2", "a b", "../x", "class", "a.b", "x" * 99])
def test_names_that_will_not_do(name: str, tmp_path: Path) -> None:
    with pytest.raises(CampaignError, match="cannot name a file"):
        new_scenario(name, tmp_path)
    assert not list(tmp_path.iterdir())


def test_commands(tmp_path: Path) -> None:
    """New, check and its exit status, run with an engine that is none."""

    def mcnav_says(*arguments: object) -> subprocess.CompletedProcess[str]:
        return invoke(*arguments, cwd=tmp_path, columns=160)

    written = mcnav_says("new", "scenario", "mine")
    assert written.returncode == 0
    assert "next: mcnav run mine.toml" in written.stdout
    assert mcnav_says("new", "campaign", "flight", "--type", "cruise").returncode == 0
    checked = mcnav_says("check", "mine.toml")
    assert checked.returncode == 0, checked.stderr
    assert checked.stdout.count(" passed ") == 12
    assert "a sample takes " in checked.stdout
    assert checked.stdout.endswith("next: mcnav run mine.toml\n")
    of_code = mcnav_says("check", "mine.py")
    assert of_code.stdout.splitlines()[0] == "Checks of the class Mine of mine.py, with mine.toml"
    told, told_of_code = (
        [line for line in each.stdout.splitlines()[1:] if not line.startswith("cost ")] for each in (checked, of_code)
    )
    assert told_of_code == told
    code = (tmp_path / "mine.py").read_text()
    plain = "np.column_stack(self._trajectory(speed, angle))"
    kinked = code.replace(plain, f"np.abs(errors) + {plain}")
    assert kinked != code
    (tmp_path / "mine.py").write_text(kinked)
    refused = mcnav_says("check", "mine.toml")
    assert refused.returncode == 1
    assert " failed " in refused.stdout
    assert refused.stdout.endswith("next: mcnav docs scenarios\n")
    (tmp_path / "mine.toml").unlink()
    alone = mcnav_says("check", "mine.py")
    assert (alone.returncode, alone.stdout.splitlines()[0]) == (1, "Checks of the class Mine of mine.py")
    assert mcnav_says("run", "mine.toml", "--engine", "magic").returncode == 2
