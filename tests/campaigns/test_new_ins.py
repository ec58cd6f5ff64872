"""``mcnav new ins``: campaigns of every unit and every set of sensors run as they are written."""

from __future__ import annotations

import re
import shutil
import tomllib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from jsonschema import Draft7Validator

from mcnav.config.json_schema.campaign import campaign_schema
from mcnav.config.json_schema.files import SCHEMA_FILE, schema_text, write_schema
from mcnav.config.read import parse_campaign, read_campaign
from mcnav.config.templates import new_campaign
from mcnav.config.templates.ins import NewIns, Platform, new_ins
from mcnav.errors import CampaignError
from mcnav.systems.ins.scenario import Ins
from mcnav.systems.ins.sensors.registry import SENSOR_TYPES
from mcnav.systems.ins.tables.imu_catalogue import catalogue_units
from mcnav.workflow.run import run_campaign
from tests.commands import invoke
from tests.conftest import ROOT
from tests.unit.config.test_trajectory_file import flight, write_csv

UNITS = [unit.name for unit in catalogue_units()]
AIDS = tuple(SENSOR_TYPES)
SETS = [(), *((aid,) for aid in AIDS), AIDS]

COMMENTED = re.compile(r"^# (\w+ = .*)$")
"""A key that is left out."""


@pytest.fixture(scope="module")
def validator() -> Draft7Validator:
    return Draft7Validator(campaign_schema())


@pytest.mark.parametrize("unit", UNITS)
def test_every_unit_with_every_sensor_is_read(unit: str, tmp_path: Path, validator: Draft7Validator) -> None:
    for number, aids in enumerate(SETS):
        (path,) = new_ins(f"with_{number}", tmp_path, NewIns(unit, aids))
        text = path.read_text(encoding="utf-8")
        content = tomllib.loads(text)
        assert [error.message for error in validator.iter_errors(content)] == []
        assert [sensor["type"] for sensor in content.get("aiding", [])] == list(aids)
        assert content["imu"] == {"grade": unit, "gyro": {}, "accelerometer": {}}
        assert all(len(line) <= 140 for line in text.splitlines())
        if aids == AIDS:
            assert read_campaign(path).scenario.sources  # read from its file as from its text


@pytest.mark.slow
@pytest.mark.parametrize(
    ("unit", "aids"),
    [
        *((unit, ()) for unit in UNITS),
        ("consumer", AIDS),
        *(("tactical", (aid,)) for aid in AIDS),
    ],
    ids=str,
)
def test_it_runs_as_it_stands(unit: str, aids: tuple[str, ...], tmp_path: Path) -> None:
    (path,) = new_ins("mine", tmp_path, NewIns(unit, aids))
    summary = run_campaign(read_campaign(path, {"samples": 8}), tmp_path / "run", None, 1, report=False).summary
    assert summary["failed"] == 0


@pytest.mark.slow
@pytest.mark.parametrize("unit", ["consumer", "ADIS16488", "Groves consumer"])
@pytest.mark.parametrize("aid", ["altimeter", "position-fix", "heading"])
def test_navigation_of_a_coarse_unit_ends_before_its_errors_are_too_large(unit: str, aid: str, tmp_path: Path) -> None:
    (path,) = new_ins("mine", tmp_path, NewIns(unit, (aid,)))
    campaign = read_campaign(path, {"samples": 8})
    assert run_campaign(campaign, tmp_path / "run", None, 1, report=False).summary["failed"] == 0
    assert isinstance(campaign.scenario, Ins)
    assert campaign.scenario.navigation.end <= 300.0


def test_its_filter_believes_the_truth(tmp_path: Path) -> None:
    """It estimates or considers every error that there is, so that its covariance is the true one, but for rounding."""
    (path,) = new_ins("mine", tmp_path, NewIns("STIM300", AIDS))
    campaign = read_campaign(path)
    assert isinstance(campaign.scenario, Ins)
    readings = campaign.scenario.linear(campaign.scenario.reading_times)
    assert readings.own is not None
    true = readings.partials @ campaign.errors.covariance @ readings.partials.swapaxes(1, 2)
    true = true + sum(readings.processes.values())
    sigmas, own = (np.sqrt(np.diagonal(each, axis1=1, axis2=2)) for each in (true, readings.own))
    np.testing.assert_allclose(own, sigmas, rtol=1e-9)  # a thousand updates, each with rounding of 1e-12 of the sigmas


@pytest.mark.parametrize("platform", ["inertial", "level"])
def test_platforms(platform: Platform, tmp_path: Path) -> None:
    (path,) = new_ins("mine", tmp_path, NewIns("STIM300", AIDS, platform))
    scenario = read_campaign(path).scenario
    assert isinstance(scenario, Ins)
    assert scenario.navigation.platform == platform


@pytest.mark.parametrize("aid", AIDS)
def test_what_is_commented_out_can_be_used(aid: str, tmp_path: Path) -> None:
    (path,) = new_ins("mine", tmp_path, NewIns("Leador A15", (aid,)))
    count = 0
    for text in uncommented(path.read_text(encoding="utf-8")):
        parse_campaign(tomllib.loads(text), str(path), "mine")
        count += 1
    assert count > 12


def uncommented(text: str) -> Iterator[str]:
    """Yield the text with each key used that is commented out, or each table."""
    blocks = [block.split("\n") for block in text.split("\n\n")]
    for place, block in enumerate(blocks):
        for first, line in enumerate(block):
            last = len(block) if line.startswith("# [") else first + 1
            if line.startswith("# [") or (COMMENTED.match(line) and not block[0].startswith("# [")):
                used = [each.removeprefix("# ") if first <= n < last else each for n, each in enumerate(block)]
                yield "\n\n".join("\n".join(each) for each in (*blocks[:place], used, *blocks[place + 1 :]))


def test_a_trajectory_of_ones_own(tmp_path: Path) -> None:
    (tmp_path / "flights").mkdir()
    shutil.copy(ROOT / "campaigns" / "flight.csv", tmp_path / "flights")
    file = tmp_path / "flights" / "flight.csv"
    aids = ("gnss", "zero-velocity")
    (path,) = new_ins("mine", tmp_path, NewIns("HG1700", aids, trajectory=file))
    content = tomllib.loads(path.read_text(encoding="utf-8"))
    assert content["scenario"]["trajectory"] == "flights/flight.csv"
    assert len(content["aiding"][1]["instants"]) == 3
    scenario = read_campaign(path).scenario
    assert isinstance(scenario, Ins)
    assert scenario.navigation.end == pytest.approx(3598.878663)  # the last row of the file


def test_other_columns_and_a_flight_that_never_rests(tmp_path: Path) -> None:
    values = flight()
    values["latitude"] = np.radians(values.pop("lat"))
    file = write_csv(tmp_path / "my flight.csv", values)
    columns = {"lat": "latitude [rad]"}
    (path,) = new_ins("mine.toml", tmp_path, NewIns("tactical", ("gnss",), trajectory=file, columns=columns))
    content = tomllib.loads(path.read_text(encoding="utf-8"))
    assert content["scenario"]["columns"] == columns
    with pytest.raises(CampaignError, match=r"--aid: zero-velocity needs a vehicle at rest"):
        new_ins("other", tmp_path, NewIns("tactical", ("zero-velocity",), trajectory=file, columns=columns))
    duration = values["time"][-1] - values["time"][0]
    interval = float(content["aiding"][0]["interval"].removesuffix(" s"))
    assert 0.0 < interval <= duration / 4.0


@pytest.mark.parametrize(
    ("wanted", "message"),
    [
        (NewIns("tactica"), r"--imu: no grade or unit 'tactica'; did you mean 'tactical'"),
        (NewIns("tactical", ("gps",)), r"--aid: no type of sensor 'gps'; expected one of gnss"),
        (NewIns("tactical", ("gnss", "gnss")), r"--aid: got gnss twice"),
        (NewIns("tactical", trajectory=Path("nowhere.csv")), r"nowhere\.csv: no such file"),
        (NewIns("tactical", trajectory=ROOT / "campaigns" / "flight.csv"), r"must lie in the folder of the campaign"),
        (NewIns("tactical", trajectory=ROOT / "Makefile"), r"Makefile: "),
    ],
    ids=["unit", "sensor", "twice", "no file", "elsewhere", "no trajectory"],
)
def test_bad_input(wanted: NewIns, message: str, tmp_path: Path) -> None:
    with pytest.raises(CampaignError, match=message) as caught:
        new_ins("mine", tmp_path, wanted)
    assert "\n" not in str(caught.value)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["", "2", "a b", "class", "a.b", "x" * 99, "folder/"])
def test_names_that_will_not_do(name: str, tmp_path: Path) -> None:
    with pytest.raises(CampaignError, match="cannot name a file"):
        new_ins(name, tmp_path, NewIns("tactical"))
    assert not list(tmp_path.iterdir())


def test_commands(tmp_path: Path) -> None:
    """Files and their schema, which is written once; bad input ends with status 2 and a line."""
    done = invoke("new", "ins", "flights/mine.toml", "--imu", "HG9900", "--aid", "gnss", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout == (
        "written: flights/mine.toml\nwritten: flights/mcnav.schema.json\n\nnext: mcnav run flights/mine.toml\n"
    )
    assert (tmp_path / "flights" / "mine.toml").read_text().startswith("#:schema ./mcnav.schema.json\n")
    again = invoke("new", "campaign", "other", "--in", "flights", cwd=tmp_path)
    assert again.stdout.startswith("written: flights/other.toml\n\n")
    wrong = invoke("new", "ins", "mine", "--aid", "gps", cwd=tmp_path)
    assert (wrong.returncode, wrong.stderr.count("\n")) == (2, 1)
    column = invoke("new", "ins", "mine", "--column", "lat", cwd=tmp_path)
    assert (column.returncode, column.stderr.count("\n")) == (2, 1)
    printed = invoke("dev", "schema", cwd=tmp_path)
    assert printed.stdout == schema_text()
    assert invoke("dev", "schema", "--out", "schemas/mine.json", cwd=tmp_path).stdout.startswith(
        "written: schemas/mine.json\n"
    )
    assert (tmp_path / "schemas" / "mine.json").read_text(encoding="utf-8") == printed.stdout


def test_the_schema_beside_campaigns(tmp_path: Path) -> None:
    """An earlier version is replaced, and no other file."""
    (path,) = new_campaign("mine", tmp_path, "cruise")
    assert path.read_text(encoding="utf-8").startswith(f"#:schema ./{SCHEMA_FILE}\n")
    assert write_schema(tmp_path) == [tmp_path / SCHEMA_FILE]
    assert write_schema(tmp_path) == []
    earlier = tmp_path / SCHEMA_FILE
    earlier.write_text(schema_text().replace("Seed", "Beginning"), encoding="utf-8")
    assert write_schema(tmp_path) == [earlier]
    assert earlier.read_text(encoding="utf-8") == schema_text()
    earlier.write_text("{}", encoding="utf-8")
    assert write_schema(tmp_path) == []
    assert earlier.read_text(encoding="utf-8") == "{}"
