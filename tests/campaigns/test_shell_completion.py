"""Completions as shells ask for them: by the scripts that ``mcnav --install-completion`` installs."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from mcnav.cli.shell_completion import aids, campaigns, engines, keys, outputs, runs, sources, trajectories
from mcnav.config.read import read_campaign
from mcnav.linear.polynomial_engine import MAP
from mcnav.systems.ins.sensors.registry import SENSOR_TYPES
from mcnav.systems.ins.tables.imu_catalogue import catalogue
from tests.conftest import ROOT
from tests.processes import run_to_end

HEAVY = {"numpy", "scipy", "numba", "pandas", "pyarrow", "matplotlib", "pint", "jinja2", "joblib"}


class Before:
    """Words before the cursor: a campaign."""

    def __init__(self, campaign: Path) -> None:
        self.params = {"campaign": campaign}
        self.args: list[str] = []


def asked(shell: str, line: str, cwd: Path, **further: str) -> subprocess.CompletedProcess[str]:
    """Ask for completions of the last word of a line as the script of a shell does."""
    words = line.split(" ")
    variables = {"COMP_WORDS": "\n".join(words), "COMP_CWORD": str(len(words) - 1)} if shell == "bash" else {}
    variables |= {"_TYPER_COMPLETE_ARGS": line, "_MCNAV_COMPLETE": f"complete_{shell}", **further}
    environment = {**os.environ, **variables, "PYTHONWARNINGS": "error"}
    return run_to_end([sys.executable, "-m", "mcnav"], cwd=cwd, env=environment)


def completed(line: str, cwd: Path) -> list[str]:
    finished = asked("bash", line, cwd)
    assert (finished.returncode, finished.stderr) == (0, "")
    return finished.stdout.split("\n")[:-1] if finished.stdout.strip() else []


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """A folder with campaigns, other files of the same endings, a trajectory and a run."""
    (tmp_path / "campaigns").mkdir()
    for name in ("11_cruise.toml", "19_flight_with_gnss.toml", "flight.csv"):
        shutil.copy(ROOT / "campaigns" / name, tmp_path / "campaigns")
    (tmp_path / "pyproject.toml").write_text('[project]\nname = "mine"\n')
    (tmp_path / ".hidden").mkdir()
    shutil.copy(ROOT / "campaigns" / "11_cruise.toml", tmp_path / ".hidden")
    shutil.copytree(ROOT / "reports" / "examples" / "14_polar", tmp_path / "reports" / "my run")
    return tmp_path


def test_bash(place: Path) -> None:
    assert completed("mcnav run ", place) == [
        "campaigns/11_cruise.toml", "campaigns/19_flight_with_gnss.toml", "reports/my\\ run/campaign.toml"
    ]  # fmt: skip
    assert completed("mcnav lincov campaigns/1", place) == [
        "campaigns/11_cruise.toml",
        "campaigns/19_flight_with_gnss.toml",
    ]
    assert completed("mcnav report ", place) == ["reports/my\\ run"]
    assert completed("mcnav docs imu Lea", place) == ["Leador\\ A15"]
    assert completed("mcnav docs guide Lea", place) == []
    assert completed("mcnav new i", place) == ["ins"]
    assert completed("mcnav docs comm", place) == ["commands"]
    assert completed("mcnav demo 19", place) == ["19_flight_with_gnss"]
    assert completed("mcnav new ins mine --trajectory ", place) == ["campaigns/flight.csv"]
    assert completed("mcnav new ins mine --aid z", place) == ["zero-velocity"]


def test_keys_and_outputs_of_a_sweep(place: Path) -> None:
    line = "mcnav sweep campaigns/19_flight_with_gnss.toml --vary"
    assert completed(f"{line} imu.gyro.b", place) == [
        "imu.gyro.bias", "imu.gyro.bias_instability.sigma", "imu.gyro.bias_instability.correlation_time"
    ]  # fmt: skip
    assert completed(f"{line} imu.gyro.bias --against position_h", place) == ["position_horizontal"]
    varied = keys(Before(place / "campaigns" / "19_flight_with_gnss.toml"), "aiding.gnss")
    assert varied[-3:] == ["aiding.gnss", "aiding.gnss.outages.1.length", "aiding.gnss.outages.1.begin"]
    states = keys(Before(place / "campaigns" / "19_flight_with_gnss.toml"), "filter.estimates.g")
    assert states == ["filter.estimates.gyro_bias"]


def test_figures_of_a_run(place: Path) -> None:
    (place / "reports" / "my run").rename(place / "reports" / "mine")
    found = completed("mcnav export reports/mine --figure ", place)
    assert {"scatter", "nees", "budget"} <= set(found)
    assert completed("mcnav export reports/mine --figure sca", place) == ["scatter"]
    assert completed("mcnav export reports/nothing --figure sca", place) == []


def test_zsh_and_fish(place: Path) -> None:
    zsh = asked("zsh", "mcnav run campaigns/11", place)
    assert zsh.stdout.strip() == """_arguments '*: :(("campaigns/11_cruise.toml"))'"""
    assert asked("zsh", "mcnav docs imu Lea", place).stdout.strip() == """_arguments '*: :(("Leador A15"))'"""
    fish = asked("fish", "mcnav run campaigns/11", place, _TYPER_COMPLETE_FISH_ACTION="get-args")
    assert fish.stdout.strip() == "campaigns/11_cruise.toml"
    assert asked("fish", "mcnav run campaigns/11", place, _TYPER_COMPLETE_FISH_ACTION="is-args").returncode == 0


def test_the_script_in_bash(place: Path) -> None:
    """The script itself, by which bash fills in the array of completions."""
    program = place / "bin" / "mcnav"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nexec {sys.executable} -m mcnav "$@"\n')
    program.chmod(0o755)
    environment = {**os.environ, "PATH": f"{program.parent}:{os.environ['PATH']}"}
    script = """
eval "$(_MCNAV_COMPLETE=source_bash mcnav)"
COMP_WORDS=(mcnav run campaigns/11); COMP_CWORD=2; _mcnav_completion mcnav; printf '%s\\n' "${COMPREPLY[@]}"
COMP_WORDS=(mcnav docs imu Lea); COMP_CWORD=3; _mcnav_completion mcnav; printf '%s\\n' "${COMPREPLY[@]}"
complete -p mcnav
"""
    finished = run_to_end(["bash", "--norc", "-c", script], cwd=place, env=environment)
    assert finished.returncode == 0, finished.stderr
    first, second, binding = finished.stdout.splitlines()
    assert (first, second) == ("campaigns/11_cruise.toml", "Leador\\ A15")
    assert binding == "complete -o default -F _mcnav_completion mcnav"


@pytest.mark.parametrize("line", ["mcnav ru", "mcnav run ca", "mcnav docs imu H", "mcnav new ins mine --aid g"])
def test_completing_imports_no_numerical_library(line: str) -> None:
    program = """
import sys
from mcnav import cli
try:
    cli.main()
except SystemExit as ended:
    assert not ended.code
print("\\nloaded:", *sorted({name.partition(".")[0] for name in sys.modules}))
"""
    words = line.split(" ")
    variables = {"COMP_WORDS": line, "COMP_CWORD": str(len(words) - 1), "_MCNAV_COMPLETE": "complete_bash"}
    finished = run_to_end([sys.executable, "-c", program], cwd=ROOT, env={**os.environ, **variables})
    assert finished.returncode == 0, finished.stderr
    before, _, loaded = finished.stdout.rpartition("loaded:")
    assert before.strip()
    assert not set(loaded.split()) & HEAVY


def test_files(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(place)
    assert campaigns("") == [
        "campaigns/11_cruise.toml", "campaigns/19_flight_with_gnss.toml", "reports/my run/campaign.toml"
    ]  # fmt: skip
    assert campaigns(".hid") == [".hidden/11_cruise.toml"]
    assert campaigns(f"{place}/campaigns/19") == [f"{place}/campaigns/19_flight_with_gnss.toml"]
    assert campaigns("nowhere/") == []
    assert runs("rep") == ["reports/my run"]
    assert trajectories("") == ["campaigns/flight.csv"]  # none of the tables of runs


def test_names_of_a_campaign(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(
        '[scenario]\ntype = "ins"\ntrajectory = { reentry = 4 }\n'
        '[imu]\ngrade = "STIM300"\n[imu.gyro]\nbias = "1 deg/h"\n'
        '[errors]\ntilt = "1 mrad"\nheading = { distribution = "uniform", half_width = "1 deg" }\n'
        '[[aiding]]\ntype = "star-tracker"\nattitude = "1 mrad"\n'
        '[[accept.r95]]\noutputs = ["position_north", "position_east"]\nbelow = "1 km"\n'
    )
    found = keys(Before(path), "")
    assert {"imu.gyro.bias", "imu.accelerometer.scale_factor", "errors.tilt", "errors.heading.half_width"} <= set(found)
    assert {"aiding.star_tracker.attitude", "accept.r95.1.below", "scenario.trajectory.reentry"} <= set(found)
    assert len(found) == len(set(found))
    assert keys(Before(path), "imu.gyro.b") == ["imu.gyro.bias"]
    assert outputs(Before(path), "position_") == [
        "position_north", "position_east", "position_down", "position_horizontal"
    ]  # fmt: skip
    assert sources(Before(path), "t") == ["tilt"]
    path.write_text("no TOML")
    assert keys(Before(path), "") == outputs(Before(path), "") == sources(Before(path), "") == []
    assert keys(Before(tmp_path / "nowhere.toml"), "") == []


@pytest.mark.parametrize(
    "campaign", ["01_tn_d1772", "11_cruise", "12_hover", "14_polar", "15_flight", "19_flight", "24_rendezvous"]
)
def test_engines_are_those_of_every_type_of_scenario(campaign: str) -> None:
    (path,) = (ROOT / "campaigns").glob(f"{campaign}*.toml")
    assert set(read_campaign(path).scenario.engines) < set(engines(""))


def test_names_are_those_of_the_program(tmp_path: Path) -> None:
    """The lists here, which importing the modules that have them would make slow."""
    assert set(aids("")) == SENSOR_TYPES.keys()
    assert aids("gn") == ["gnss"]
    path = ROOT / "campaigns" / "01_tn_d1772_trajectory_4.toml"
    assert outputs(Before(path), "") == [output.name for output in read_campaign(path).scenario.outputs]
    further = tmp_path / "further.toml"
    further.write_text(path.read_text("utf-8").replace("[scenario]", '[scenario]\nfurther_outputs = ["airspeed"]'))
    assert outputs(Before(further), "") == [output.name for output in read_campaign(further).scenario.outputs]
    assert engines("sh") == ["shared-gains"]
    assert engines("")[-1] == MAP
    assert "STIM300" in catalogue()
