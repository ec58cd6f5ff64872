"""Nonsense given to the commands: each mistake is one line that names the file, and the exit status is 2."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from mcnav.errors import MOST_NAMES, suggestion
from mcnav.systems.reentry.scenario import SOURCES
from tests.commands import in_process
from tests.conftest import ROOT

REENTRY = 'samples = 100\n[scenario]\ntype = "reentry"\ntrajectory = 4\n[errors]\naltitude = "1 km"\n'
MINE = """
import numpy as np
from mcnav import Output, Source

class Mine:
    sources = (Source("a", "m", "m", 1.0),)
    outputs = (Output("y", "m", "m"),)

    def propagate(self, errors):
        BODY
"""
OWN = 'samples = 100\n[scenario]\ntype = "mine.py:Mine"\n[errors]\na = "1 m"\n'
ALL = ", ".join(source.name for source in SOURCES)

CAMPAIGNS = {
    "no TOML": ("samples = = 3", "is not TOML"),
    "a key twice": ("seed = 1\nseed = 2\n", "is not TOML: a key is given twice (at line 2, column 9): seed = 2"),
    "no text": ("\x00", "is not UTF-8 text, but seems to be UTF-16"),
    "an unknown source": (
        REENTRY + 'gyro_arw = "1 deg/h"\n',
        f"errors.gyro_arw: unknown error source; did you mean 'gyro_drift'? It is one of {ALL}",
    ),
    "a source like none": (REENTRY + 'zzz = "1 m"\n', f"errors.zzz: unknown error source; expected one of {ALL}"),
    "another unit": (REENTRY.replace("1 km", "1 deg"), "errors.altitude: got '1 deg', which is an angle"),
    "no unit": (REENTRY.replace('"1 km"', "1"), "errors.altitude: got 1 without a unit"),
    "no such unit": (REENTRY.replace("1 km", "1 furlogn"), "errors.altitude: 'furlogn' is not a known unit"),
    "no such type": (REENTRY.replace('"reentry"', '"entry"'), "scenario.type: got 'entry'"),
    "no such trajectory": (REENTRY.replace("= 4", "= 40"), "scenario.trajectory: got 40"),
    "an unknown key": ("sample = 3\n" + REENTRY, "sample: unknown key; did you mean 'samples'? It is one of name"),
    "per cent without its sign": (
        "tolerance = 5\n" + REENTRY,
        'tolerance: got 5; expected a number less than 1, such as "5 %"',
    ),
    "no scenario": ("samples = 3\n", "scenario: is missing"),
    "no code": (OWN, "scenario.type: "),
}


@pytest.mark.parametrize("command", ["run", "lincov", "check", "sweep --scale", "sweep --vary start"])
@pytest.mark.parametrize("case", CAMPAIGNS)
def test_a_bad_campaign(command: str, case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text, message = CAMPAIGNS[case]
    monkeypatch.chdir(tmp_path)
    Path("bad.toml").write_text(text)
    _refused([*command.split(), "bad.toml"], f"bad.toml: {message}")


INS = """samples = 100
[scenario]
type = "ins"
[scenario.trajectory]
rate = "1 Hz"
start = { latitude = "47 deg", longitude = "9 deg", course = "80 deg", speed = "60 m/s" }
segments = [{ hold = "60 s" }, { straight = "6 km" }]
[errors]
position = "5 m"
"""
GNSS = '[[aiding]]\ntype = "gnss"\ninterval = "1 s"\nposition = "3 m"\n'
FILTER = '[filter]\nestimates = ["position", "velocity", "attitude"]\n'
AIDED = INS + GNSS + FILTER

AIDING = {
    "no filter": (INS + GNSS, "aiding: needs a [filter], which says what is estimated from its measurements"),
    "no sensors": (INS + FILTER, "filter: no known measurement updates the errors; needs [[aiding]]"),
    "one table": (AIDED.replace("[[aiding]]", "[aiding]"), "aiding: expected tables [[aiding]]"),
    "text for a table": (
        INS.replace("[scenario]", 'filter = "ekf"\n[scenario]', 1) + GNSS,
        "filter: got 'ekf'; expected a table",
    ),
    "no such type": (AIDED.replace('"gnss"', '"gps"'), "aiding #1.type: got 'gps'; expected one of gnss, position-fix"),
    "twice": (INS + GNSS + GNSS + FILTER, "aiding #2.name: got 'gnss' twice; give one of the sensors another name"),
    "no noise": (AIDED.replace("3 m", "0 m"), "aiding #1.position: got '0 m'; expected a sigma above zero"),
    "moving": (
        AIDED.replace('"gnss"', '"zero-velocity"').replace('position = "3 m"', 'velocity = "1 cm/s"'),
        "aiding #1: the vehicle moves at 60 m/s at 1 s; expected instants at rest, at most 0.1 m/s",
    ),
    "an error of a sensor that is not there": (
        AIDED.replace('"attitude"', '"attitude", "radar_bias"'),
        "filter.estimates: got 'radar_bias'; no sensor of [[aiding]] is named 'radar'",
    ),
    "belief in a sensor that is not there": (
        AIDED + '[filter.believes.aiding.gps]\nposition = "9 m"\n',
        "filter.believes.aiding.gps: no sensor has this name; expected gnss",
    ),
    "an outage that does not begin": (
        AIDED.replace('"3 m"', '"3 m"\noutages = [["9 s", "3 s"]]'),
        "aiding #1.outages #1: got '9 s' to '3 s'; expected an end after its begin",
    ),
    "not a number": (AIDED.replace('"3 m"', "nan"), "aiding #1.position: got nan without a unit; expected a length"),
    "infinite": (AIDED.replace('"1 s"', "inf"), "aiding #1.interval: got inf without a unit; expected a time"),
    "of another scenario": (REENTRY + GNSS, "aiding: no known measurement updates the errors: this"),
    "a requirement after the end": (
        AIDED + '[[accept.cep]]\noutputs = ["position_north", "position_east"]\nbelow = "9 m"\nat = "99999 s"\n',
        "accept.cep #1.at: got 99999 s; navigation is from ",
    ),
}


@pytest.mark.parametrize("command", ["run", "lincov"])
@pytest.mark.parametrize("case", AIDING)
def test_bad_aiding(command: str, case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text, message = AIDING[case]
    monkeypatch.chdir(tmp_path)
    Path("bad.toml").write_text(text)
    _refused([*command.split(), "bad.toml"], f"bad.toml: {message}")


CODES = {
    "random": ("return errors + np.random.standard_normal(errors.shape)", ["run"]),
    "not settled": ("return errors + (errors > 0.0)", ["run"]),
    "raises": ("raise ValueError('never\\nflies')", ["run", "lincov --partials", "sweep --scale"]),
    "ends at zero": (
        "return np.where(np.abs(errors) > 1e-5, np.nan, errors)",
        ["run", "lincov --partials", "sweep --scale"],
    ),
    "no map": ("return np.sign(errors - 0.5) + errors", ["run", "--engine", "map"]),
    "no differences": (
        "return np.where(np.abs(errors) > 1e-5, np.nan, errors)\n\n    def partials(self):\n        return [[1.0]]",
        ["lincov --partials"],
    ),
}


@pytest.mark.parametrize("case", CODES)
def test_a_scenario_that_cannot_be_flown(case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    body, commands = CODES[case]
    monkeypatch.chdir(tmp_path)
    Path("mine.py").write_text(MINE.replace("BODY", body))
    Path("own.toml").write_text(OWN)
    if "--engine" in commands:
        _refused([commands[0], "own.toml", *commands[1:]], "own.toml: engine: ")
        return
    for command in commands:
        _refused([*command.split(), "own.toml"], "own.toml: scenario")


OPTIONS = {
    "a time that is none": (["run", "good.toml", "--timeout", "soon"], "--timeout: got 'soon'; expected a time"),
    "a time that is a length": (["run", "good.toml", "--timeout", "5 km"], "--timeout: got '5 km', which is a length"),
    "a time without a unit": (["run", "good.toml", "--timeout", "5"], "--timeout: got '5' without a unit; expected"),
    "no time": (["run", "good.toml", "--timeout", "0 s"], "good.toml: sample_timeout: got '0 s'"),
    "a seed too long": (["run", "good.toml", "--seed", "9" * 30], "good.toml: seed: got 9999"),
    "too many samples": (["run", "good.toml", "--samples", "9" * 20], "good.toml: samples: got 9999"),
    "no such engine": (["run", "good.toml", "--engine", "warp"], "good.toml: engine: got 'warp'"),
    "nothing to check": (["run", "good.toml", "--check"], "good.toml: accept: is missing"),
    "into a file": (
        ["run", "good.toml", "--out", "good.toml"],
        "--out: got good.toml; expected a folder, such as good",
    ),
    "into no folder of ours": (["run", "good.toml", "--out", "other"], "other: holds 'file.txt'"),
    "a campaign that is not there": (["run", "nowhere.toml"], "nowhere.toml: no such file"),
    "a folder as campaign": (["run", "other"], "other: is a folder"),
    "a report of nothing": (["report", "nowhere"], "nowhere: holds no run"),
    "a report of a file": (
        ["report", "good.toml"],
        "good.toml: holds no run (it is a file); mcnav run good.toml makes one",
    ),
    "a comparison with nothing": (["compare", "nowhere"], "nowhere: holds no run (there is no such folder)"),
    "a replay of nothing": (["replay", "nowhere", "1"], "nowhere: holds no run"),
    "an index of nothing": (["report", "--index", "nowhere"], "nowhere: is no folder; expected one that contains"),
    "a report without a run": (["report"], "mcnav report needs a run folder, or --index with a folder of runs"),
    "an index of a file": (["report", "--index", "good.toml"], "good.toml: is no folder; expected"),
    "axes of cruise": (
        ["sweep", "cruise.toml", "--vary", "start", "--axes", "trajectory"],
        "cruise.toml: start_times.axes: got 'trajectory'; axes of a steady flight are aligned at each start",
    ),
    "a sweep of nothing": (["sweep", "good.toml"], "mcnav sweep needs --vary KEY=VALUES, --vary start or --scale"),
    "a sweep of two kinds": (["sweep", "good.toml", "--scale", "--vary", "start"], "mcnav sweep needs --vary KEY"),
    "an option of another sweep": (["sweep", "good.toml", "--scale", "--axes", "start"], "--axes: belongs to --vary"),
    "times of a sweep of starts": (["sweep", "good.toml", "--vary", "start", "--at", "1 s"], "--at: does not go with"),
    "a method without partials": (["lincov", "good.toml", "--method", "runs"], "--method: belongs to --partials"),
    "partials at a time": (["lincov", "good.toml", "--partials", "--at", "1 s"], "--at: does not go with --partials"),
    "a page of a check": (["check", "good.toml", "--out", "page.html"], "--out: belongs to --trajectory"),
    "a sample without a record": (["judge", "good.toml", "--sample", "1"], "--sample: belongs to --record"),
    "a record to be judged": (
        ["judge", "good.toml", "--record", "--imu", "imu.csv"],
        "--record: takes a campaign",
    ),
    "a unit of another page": (["docs", "guide", "STIM300"], "STIM300: belongs to the page imu"),
    "a figure for a text": (
        ["export", "good", "--figure", "scatter", "--out", "x.docx"],
        "--out: got x.docx; expected a",
    ),
    "no such command": (["rnu", "good.toml"], "mcnav has no command 'rnu'; did you mean 'run'? mcnav --help lists all"),
    "no such option": (["run", "good.toml", "--sampels", "3"], "--sampels: no such option; did you mean '--samples'?"),
    "an option without its value": (["run", "good.toml", "-n"], "-n: needs a value; mcnav run --help lists"),
    "a switch with a value": (["run", "good.toml", "--fresh=1"], "--fresh: takes no value"),
    "a word for a number": (["run", "good.toml", "-n", "many"], "--samples: got 'many'; expected a whole number"),
    "too few": (["run", "good.toml", "-n", "1"], "--samples: got '1'; expected at least 2"),
    "no campaign": (["run"], "CAMPAIGN: is missing; mcnav run --help lists what it takes"),
    "two campaigns": (["run", "good.toml", "cruise.toml"], "unexpected words (cruise.toml); mcnav run --help"),
    "a campaign that is there": (["new", "campaign", "good"], "good.toml: exists already"),
    "a name that is none": (["new", "campaign", "2x"], "2x: cannot name a file"),
    "no such scheduler": (["run", "good.toml", "--scheduler", "nowhere"], "nowhere: is no scheduler"),
}


@pytest.mark.parametrize("case", OPTIONS)
def test_bad_options_and_folders(case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("good.toml").write_text(REENTRY)
    shutil.copy(ROOT / "campaigns" / "11_cruise.toml", "cruise.toml")
    Path("other").mkdir()
    Path("other", "file.txt").write_text("a")
    _refused(*OPTIONS[case])


def test_names_are_listed_up_to_a_number() -> None:
    names = [f"name_{number}" for number in range(MOST_NAMES + 3)]
    assert suggestion("zzz", names).endswith("name_19 and 3 more")


def _refused(command: list[str], message: str) -> None:
    told = in_process(*command)
    assert told.exit_code == 2, told.output
    (line,) = told.stderr.splitlines()
    assert line.startswith(f"error: {message}")
    assert line.isprintable()
    assert told.stdout == ""
