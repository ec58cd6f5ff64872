"""Settings of every type, and files that a scenario reads: in the identity, kept, refused when they change."""

from __future__ import annotations

import hashlib
import os
import re
import textwrap
import threading
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import mcnav
from mcnav.config.read import read_campaign
from mcnav.contract.engine import without_noise
from mcnav.entries import inputs as opened_inputs
from mcnav.entries.inputs import (
    InputFile,
    content_of,
    find_inputs,
    is_input,
    record_opened_files,
    safe_name,
    system_places,
    with_unique_names,
)
from mcnav.errors import CampaignError, RunFolderError
from mcnav.execution.progress import Silent
from mcnav.store import inputs as campaign_inputs
from mcnav.store.run_folder import RunFolder
from mcnav.workflow.compare import compare_runs
from mcnav.workflow.replay import as_stored, replay
from mcnav.workflow.run import run_campaign
from tests.commands import in_process
from tests.runs import simulate

CLASS = """
from pathlib import Path
import os, threading
import numpy as np
from mcnav import History, Output, Source

class Mine:
    settings = SETTINGS
    sources = (Source("a", "m", "m", 1.0),)
    outputs = (Output("b", "m", "m"),)

    def __init__(self, **given):
        self.given = given
        self.gain = 2.0
        MADE

    def propagate(self, errors):
        FLOWN
        return self.gain * errors
MORE
"""
LOADED = "self.gain = float(np.loadtxt({}, ndmin=1)[0])"


def written(
    folder: Path,
    content: str = "",
    /,
    settings: str = "{}",
    made: str = "",
    flown: str = "",
    more: str = "",
    **values: str,
) -> Path:
    """A campaign of the class ``Mine`` with some settings and lines, beside ``table.txt``."""
    folder.mkdir(parents=True, exist_ok=True)
    text = CLASS.replace("SETTINGS", settings).replace("MORE", textwrap.indent(more, "    "))
    (folder / "mine.py").write_text(text.replace("MADE", made or "pass").replace("FLOWN", flown or "pass"))
    if content:
        (folder / "table.txt").write_text(content)
    keys = "".join(f"{key} = {value}\n" for key, value in values.items())
    path = folder / "mine.toml"
    path.write_text(
        f'samples = 300\nseed = 1\n[scenario]\ntype = "mine.py:Mine"\n{keys}[errors]\na = "1 m"\n', encoding="utf-8"
    )
    return path


def declared(folder: Path, table: str) -> Path:
    """A campaign whose class reads the file that a setting names."""
    return written(folder, table, settings='{"table": Path}', made=LOADED.format('given["table"]'), table='"table.txt"')


def noticed(folder: Path, table: str, where: str = "made") -> Path:
    """A campaign whose class opens a file that no setting names: when it is made, flown, linearised or shown."""
    read = LOADED.format(repr(str(folder / "table.txt")))
    method = {
        "partials": f"\ndef partials(self):\n    {read}\n    return [[self.gain]]\n",
        "history": f"\ndef history(self):\n    {read.replace('self.gain', 'gain')}\n    return History()\n",
    }
    if where in method:
        return written(folder, table, more=method[where])
    if where == "executed":
        return written(folder, table, more=f"\ngain = {read.partition('= ')[2]}\n", made="self.gain = type(self).gain")
    if where == "thread":
        there = f"threading.Thread(target=lambda: setattr(self, 'gain', {read.partition('= ')[2]}))"
        return written(folder, table, made=f"other = {there}; other.start(); other.join()")
    return written(folder, table, **{where: read})


def sigma(folder: Path) -> float:
    """Sigma of the samples that a folder holds."""
    return float(mcnav.samples_of(folder)["output b [m]"].std())


SETTINGS = (
    '{"speed": "m/s", "gains": ["m/s^2"], "ratio": "1", "label": str, "drag": bool, "count": int, '
    '"names": [str], "flags": [bool], "orders": [int], "table": Path}'
)


def test_settings_of_every_type_arrive_as_they_are_declared(tmp_path: Path) -> None:
    """The resolved campaign reads the same settings again beside what the run folder keeps."""
    campaign = written(
        tmp_path, "2\n", settings=SETTINGS, table='"table.txt"',
        speed='"36 km/h"', gains='["1 m/s^2", "100 ug"]', ratio="0.5", label='"a \\"b\\" ü"',
        drag="true", count="-3", names='["x", ""]', flags="[true, false]", orders="[]",
    )  # fmt: skip
    simulate(read_campaign(campaign), tmp_path / "run", None, 1)
    for place in (campaign, tmp_path / "run" / "campaign.toml"):
        given = read_campaign(place).scenario._instance.given
        gains = given.pop("gains")
        assert isinstance(gains, np.ndarray)
        np.testing.assert_allclose(gains, [1.0, 980.665e-6], rtol=1e-15)
        assert given.pop("table").read_text() == "2\n"
        assert {key: (type(value), value) for key, value in given.items()} == {
            "speed": (float, 10.0), "ratio": (float, 0.5), "label": (str, 'a "b" ü'), "drag": (bool, True),
            "count": (int, -3), "names": (list, ["x", ""]), "flags": (list, [True, False]), "orders": (list, []),
        }  # fmt: skip
    again = simulate(read_campaign(tmp_path / "run" / "campaign.toml"), tmp_path / "run", None, 1)
    assert again.simulated == 0


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("label", "3", "scenario.label: got 3; expected text in quotes"),
        ("drag", "1", "scenario.drag: got 1; expected true or false"),
        ("drag", '"true"', "scenario.drag: got 'true'; expected true or false"),
        ("count", "true", "scenario.count: got true; expected a whole number"),
        ("count", "3.0", "scenario.count: got 3.0; expected a whole number"),
        ("count", "nan", "scenario.count: got nan; expected a whole number"),
        ("count", "9" * 30, "scenario.count: got a number beyond 9223372036854775807; expected a whole number"),
        ("names", '"x"', "scenario.names: got 'x'; expected a list of texts"),
        ("names", '["x", 2]', "scenario.names #2: got 2; expected text in quotes"),
        ("flags", "[true, 0]", "scenario.flags #2: got 0; expected true or false"),
        ("orders", "[1, false]", "scenario.orders #2: got false; expected a whole number"),
        ("orders", "[[1]]", "scenario.orders #1: got a list; expected a whole number"),
        ("gains", '"1 ug"', "scenario.gains: got '1 ug'; expected a list of quantities in units such as 'm/s^2'"),
        ("gains", '["1 ug", "2 m"]', "scenario.gains #2: got '2 m', which is a length; expected an acceleration"),
        ("gains", "[1.0]", "scenario.gains #1: got 1.0 without a unit; expected an acceleration"),
        ("gains", '["inf m/s^2"]', "scenario.gains #1: got 'inf m/s^2'; expected an acceleration"),
        ("ratio", "inf", "scenario.ratio: got 'inf'; expected a pure number"),
        ("ratio", "true", "scenario.ratio: got true; expected a pure number"),
        ("table", "3", "scenario.table: got 3; expected the path of a file in quotes"),
        ("table", '["table.txt"]', "scenario.table: got a list; expected the path of a file in quotes"),
        ("table", '"/etc/passwd"', "scenario.table: got '/etc/passwd'; the file must lie beside the campaign file"),
        ("table", '"../x"', "scenario.table: got '../x'; the file must lie beside the campaign file"),
        ("table", '"a\\\\..\\\\x"', "the file must lie beside the campaign file"),
        ("table", '"a\\u0000b"', "the file must lie beside the campaign file"),
        ("table", '"nowhere.txt"', "nowhere.txt does not exist; paths are relative to the campaign file"),
        ("table", '"below"', "below cannot be read: is not a regular file"),
        ("table", '""', "the file must lie beside the campaign file"),
        ("table", '"pipe"', "pipe cannot be read: is not a regular file"),
    ],
)
def test_settings_of_the_wrong_type_are_told_in_one_line(key: str, value: str, message: str, tmp_path: Path) -> None:
    campaign = written(tmp_path, "2\n", settings=SETTINGS, **{key: value})
    (tmp_path / "below").mkdir()
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(CampaignError) as refused:
        read_campaign(campaign)
    (line,) = str(refused.value).splitlines()
    assert line.startswith(f"{campaign}: scenario.{key}")
    assert message in line


@pytest.mark.parametrize("of", ["float", "[Path]", "['m', 's']", "[]", "3", "None", "'nonsense'"])
def test_declarations_that_are_none(of: str, tmp_path: Path) -> None:
    with pytest.raises(CampaignError) as refused:
        read_campaign(written(tmp_path, settings=f"{{'x': {of}}}"))
    (line,) = str(refused.value).splitlines()
    assert "scenario.type: Mine.settings" in line


@pytest.mark.parametrize("name", ["t.csv", "t" * 150 + ".csv"])
def test_files_of_one_name_are_kept_apart(name: str, tmp_path: Path) -> None:
    campaign = written(
        tmp_path, settings='{"one": Path, "two": Path, "three": Path}',
        one=f'"a/{name}"', two=f'"b/{name}"', three='"one.t.csv"',
    )  # fmt: skip
    for place in (f"a/{name}", f"b/{name}", "one.t.csv"):
        (tmp_path / place).parent.mkdir(exist_ok=True)
        (tmp_path / place).write_text(place)
    simulate(read_campaign(campaign), tmp_path / "run", None, 1)
    kept = {path.name.partition(".")[0]: path.read_text() for path in (tmp_path / "run" / "inputs").iterdir()}
    assert kept == {"one": f"a/{name}", "two": f"b/{name}", "three": "one.t.csv"}
    again = read_campaign(tmp_path / "run" / "campaign.toml")
    assert simulate(again, tmp_path / "run", None, 1).simulated == 0


PLACES = ["declared", "executed", "made", "thread", "flown", "partials", "history"]


def campaign_reading(where: str, folder: Path, table: str) -> Path:
    """A campaign that reads ``table.txt``."""
    return declared(folder, table) if where == "declared" else noticed(folder, table, where)


@pytest.mark.parametrize("where", PLACES)
def test_a_changed_file_is_refused_like_a_changed_campaign(where: str, tmp_path: Path) -> None:
    """Also in one process, which keeps the user's objects; a file put back is the same run again."""
    campaign = campaign_reading(where, tmp_path, "2\n")
    simulate(read_campaign(campaign), tmp_path / "run", None, 1)
    before = sigma(tmp_path / "run")
    (tmp_path / "table.txt").write_text("3\n")
    was, now = (hashlib.sha256(text).hexdigest()[:12] for text in (b"2\n", b"3\n"))
    with pytest.raises(RunFolderError) as refused:
        simulate(read_campaign(campaign), tmp_path / "run", None, 1)
    assert str(refused.value) == (
        f"{tmp_path / 'run'}: holds the results of another run (files.table.txt was {was}, is {now}); "
        "--fresh replaces them, --out writes elsewhere"
    )
    assert sigma(tmp_path / "run") == before
    fresh = simulate(read_campaign(campaign), tmp_path / "other", None, 1).summary
    gain = 1.0 if where == "history" else 1.5
    assert sigma(tmp_path / "other") == pytest.approx(gain * before, rel=1e-12)
    assert fresh["sigma_linear"][0] == pytest.approx(2.0 * gain, rel=1e-9)
    (tmp_path / "table.txt").write_text("2\n")
    assert simulate(read_campaign(campaign), tmp_path / "run", None, 1).simulated == 0


@pytest.mark.parametrize("where", PLACES)
def test_files_are_listed_and_kept(where: str, tmp_path: Path) -> None:
    simulate(read_campaign(campaign_reading(where, tmp_path, "2\n")), tmp_path / "run", None, 1)
    content = RunFolder(tmp_path / "run").existing_manifest().to_json()
    digest = hashlib.sha256(b"2\n").hexdigest()
    setting = "table" if where == "declared" else None
    record = {"name": "table.txt", "bytes": 2, "sha256": digest, "kept": True, "setting": setting}
    assert content["files"] == [record]
    assert content["identity"]["files"] == {"table.txt": digest}
    assert (tmp_path / "run" / "inputs" / "table.txt").read_text() == "2\n"


def test_a_scenario_that_reads_nothing_has_the_identity_that_it_had(tmp_path: Path) -> None:
    simulate(read_campaign(written(tmp_path)), tmp_path / "run", None, 1)
    content = RunFolder(tmp_path / "run").existing_manifest().to_json()
    assert content["identity"].keys() == {"campaign", "engine", "versions", "chunks", "code"}
    assert not (tmp_path / "run" / "inputs").exists()


def test_a_large_file_is_known_by_its_digest_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """At the limit a file is kept, beyond it it is not; replay then needs the file itself."""
    limit = campaign_inputs.LARGEST_COPY
    campaign = declared(tmp_path, "2\n".ljust(limit))
    simulate(read_campaign(campaign), tmp_path / "small", None, 1)
    assert (tmp_path / "small" / "inputs" / "table.txt").stat().st_size == limit
    (tmp_path / "table.txt").write_text("2\n".ljust(limit + 1))
    simulate(read_campaign(campaign), tmp_path / "large", None, 1)
    assert not (tmp_path / "large" / "inputs").exists()
    assert as_stored(replay(tmp_path / "large", 5, campaign))
    for change in (lambda path: path.write_text("3\n"), lambda path: path.unlink()):
        change(tmp_path / "table.txt")
        with pytest.raises(CampaignError) as refused:
            replay(tmp_path / "large", 5, campaign)
        (line,) = str(refused.value).splitlines()
        assert f"scenario.table: {tmp_path / 'table.txt'} " in line
        assert "the run folder has no copy of it; restore it" in line


@pytest.mark.parametrize("change", [lambda path: path.write_text("3\n"), lambda path: path.unlink()])
def test_replay_uses_the_files_of_the_run(change: Callable[[Path], None], tmp_path: Path) -> None:
    campaign = declared(tmp_path, "2\n")
    simulate(read_campaign(campaign), tmp_path / "run", None, 1)
    assert replay(tmp_path / "run", 5, campaign).notes == ()
    change(tmp_path / "table.txt")
    again = replay(tmp_path / "run", 5, campaign)
    assert as_stored(again)
    copy = tmp_path / "run" / "inputs" / "table.txt"
    assert again.notes == (f"scenario.table: the file is not as it was; the run's own copy {copy} is used",)
    said = in_process("replay", tmp_path / "run", "5", "--campaign", campaign)
    assert said.exit_code == 0
    assert f"note: {again.notes[0]}" in said.stderr
    copy.write_text("4\n")
    with pytest.raises(CampaignError, match="restore it"):
        replay(tmp_path / "run", 5, campaign)


@pytest.mark.parametrize("where", ["executed", "made", "thread", "flown", "partials", "history"])
def test_replay_refuses_a_changed_file_that_was_only_noticed(where: str, tmp_path: Path) -> None:
    """One line that names the run's copy; restored from it, the file is the run's."""
    campaign = noticed(tmp_path, "2\n", where)
    simulate(read_campaign(campaign), tmp_path / "run", None, 1)
    assert as_stored(replay(tmp_path / "run", 5, campaign))
    (tmp_path / "table.txt").write_text("3\n")
    with pytest.raises(RunFolderError) as refused:
        replay(tmp_path / "run", 5, campaign)
    copy = tmp_path / "run" / "inputs" / "table.txt"
    line = r"reads other files than when .* \(table\.txt was [0-9a-f]{12}, is [0-9a-f]{12}\); restore the file from "
    assert re.fullmatch(rf".*{line}{re.escape(str(copy))}, or declare it as a setting", str(refused.value))
    (tmp_path / "table.txt").write_bytes(copy.read_bytes())
    assert as_stored(replay(tmp_path / "run", 5, campaign))
    (tmp_path / "table.txt").write_text("3\n")
    copy.write_text("3\n")
    with pytest.raises(RunFolderError, match=r"is [0-9a-f]{12}\); restore the file$"):
        replay(tmp_path / "run", 5, campaign)


def test_replay_refuses_a_missing_file_that_was_only_noticed(tmp_path: Path) -> None:
    campaign = noticed(tmp_path, "2\n")
    simulate(read_campaign(campaign), tmp_path / "run", None, 1)
    (tmp_path / "table.txt").unlink()
    with pytest.raises(CampaignError) as refused:
        replay(tmp_path / "run", 5, campaign)
    (line,) = str(refused.value).splitlines()
    assert "table.txt not found" in line


class ChangingProgress(Silent):
    """Progress that replaces a file whenever samples become ready."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def advance(self, samples: int, stored: bool = False) -> None:
        self.path.unlink()
        self.path.write_text("3\n")


@pytest.mark.parametrize("where", ["declared", "made", "flown"])
@pytest.mark.parametrize("engine", ["threads", "processes"])
def test_a_file_that_changes_while_the_run_goes_on(where: str, engine: str, tmp_path: Path) -> None:
    """The run stops in one line, what is stored is all of the file as it was, and goes on when it is put back."""
    campaign = campaign_reading(where, tmp_path, "2\n")
    code = (tmp_path / "mine.py").read_text().replace("    sources", "    chunk = 50\n    sources")
    if engine == "processes":
        code = code.replace("def propagate", "def fly")
    (tmp_path / "mine.py").write_text(code)

    progress = ChangingProgress(tmp_path / "table.txt")
    with pytest.raises(RunFolderError) as refused:
        simulate(read_campaign(campaign), tmp_path / "run", None, 1, progress=progress)
    assert str(refused.value) == (
        f"{tmp_path / 'table.txt'}: has changed; samples stored in {tmp_path / 'run'} come from the file as it was: "
        "restore it, or replace them with --fresh"
    )
    assert not RunFolder(tmp_path / "run").existing_manifest().complete
    with pytest.raises(RunFolderError, match=r"files\.table\.txt was"):
        simulate(read_campaign(campaign), tmp_path / "run", None, 1)
    (tmp_path / "table.txt").write_text("2\n")
    simulate(read_campaign(campaign), tmp_path / "run", None, 1)
    samples = mcnav.samples_of(tmp_path / "run")
    np.testing.assert_allclose(samples["output b [m]"], 2.0 * samples["error a [m]"], rtol=1e-15)


def test_a_file_that_changes_at_the_very_end(tmp_path: Path) -> None:
    """After the last chunk is stored: the run is not complete."""
    campaign = declared(tmp_path, "2\n")
    progress = ChangingProgress(tmp_path / "table.txt")
    with pytest.raises(RunFolderError, match="has changed; samples stored in"):
        simulate(read_campaign(campaign), tmp_path / "run", None, 1, progress=progress)
    assert len(list((tmp_path / "run" / "samples").glob("part-*.parquet"))) == 1


def test_a_campaign_that_was_read_before_its_file_changed(tmp_path: Path) -> None:
    """As in a notebook; the one read afterwards has an object of its own, and so has the first."""
    campaign = noticed(tmp_path, "2\n")
    early = read_campaign(campaign)
    (tmp_path / "table.txt").write_text("3\n")
    late = read_campaign(campaign)
    ones = np.ones((1, 1))
    assert without_noise(early.scenario.engine("vectorised", ones))(ones).values[0, 0] == 2.0
    assert without_noise(late.scenario.engine("vectorised", ones))(ones).values[0, 0] == 3.0
    with pytest.raises(RunFolderError, match=r"table\.txt: has changed; the campaign was read before that; read it"):
        run_campaign(early, tmp_path / "run", None, 1, report=False)
    assert run_campaign(late, tmp_path / "run", None, 1, report=False).summary["sigma_linear"][0] == pytest.approx(
        3.0, rel=1e-9
    )


def test_an_unchanged_scenario_is_made_once(tmp_path: Path) -> None:
    campaign = noticed(tmp_path, "2\n")
    one, other = (read_campaign(campaign).scenario._instance for _ in range(2))
    assert one is other


def test_a_comparison_names_changed_files(tmp_path: Path) -> None:
    campaign = declared(tmp_path, "2\n")
    for table in ("2\n", "3\n"):
        (tmp_path / "table.txt").write_text(table)
        run_campaign(read_campaign(campaign), tmp_path / table.strip(), None, 1, report=False)
    found = compare_runs([tmp_path / "2", tmp_path / "3"]).inputs
    assert list(found.index) == ["files.table.txt"]


def test_fresh_from_the_run_folders_own_campaign(tmp_path: Path) -> None:
    """Its copy of the file is what the new run reads: it is not deleted under it."""
    simulate(read_campaign(declared(tmp_path, "2\n")), tmp_path / "run", None, 1)
    again = read_campaign(tmp_path / "run" / "campaign.toml")
    assert simulate(again, tmp_path / "run", None, 1, fresh=True).simulated == 300


def test_a_pipe_is_no_input(tmp_path: Path) -> None:
    """Its content cannot be read again; opened without waiting for a writer."""
    os.mkfifo(tmp_path / "pipe")
    campaign = written(tmp_path, made=f"os.close(os.open({str(tmp_path / 'pipe')!r}, os.O_RDONLY | os.O_NONBLOCK))")
    with pytest.raises(CampaignError, match=r"mine\.py reads .*pipe, which is not a regular file"):
        read_campaign(campaign)


def test_what_counts_as_an_input(tmp_path: Path) -> None:
    """Files read, here and in threads that start meanwhile; none that are written, missing, Python's or another's."""
    for name in ("read.csv", "own thread.csv", "log.txt", "other.csv", "module.py", "gone.csv", "renamed.csv"):
        (tmp_path / name).write_text(name)
    (tmp_path / "link.csv").symlink_to(tmp_path / "read.csv")
    go, done = threading.Event(), threading.Event()

    def another() -> None:
        go.wait(60)
        (tmp_path / "other.csv").read_text()
        done.set()

    other = threading.Thread(target=another)
    other.start()
    with record_opened_files() as found:
        (tmp_path / "read.csv").read_bytes()
        (tmp_path / "link.csv").read_bytes()
        own = threading.Thread(target=(tmp_path / "own thread.csv").read_text)
        own.start()
        own.join()
        with (tmp_path / "log.txt").open("a+") as log:
            log.seek(0)
        (tmp_path / "log.txt").read_text()
        (tmp_path / "module.py").read_text()
        (tmp_path / "gone.csv").read_text()
        (tmp_path / "gone.csv").unlink()
        (tmp_path / "renamed.csv").rename(tmp_path / "new.csv")
        (tmp_path / "new.csv").read_text()
        with pytest.raises(FileNotFoundError):
            (tmp_path / "never.csv").read_text()
        Path(np.__file__).with_name("__init__.pyi").read_bytes()
        Path("/proc/self/stat").read_bytes()
        go.set()
        done.wait(60)
    other.join()
    (tmp_path / "module.py").read_text()  # no longer record_opened_files
    named = with_unique_names(find_inputs(found, "mine.py").values())
    assert [file.name for file in named] == ["link.csv", "own thread.csv"]


@pytest.mark.parametrize(
    ("path", "counts"),
    [
        ("/home/a/data/trajectory.csv", True),
        ("/data/matplotlib/table.txt", True),
        ("/home/a/__pycache__/mine.nbi", False),
        ("/home/a/project.egg-info/PKG-INFO", False),
        ("/usr/share/zoneinfo/UTC", False),
        (os.path.join(os.path.dirname(np.__file__), "version.txt"), False),  # noqa: PTH118, PTH120
    ],
)
def test_places_of_inputs(path: str, counts: bool) -> None:
    assert is_input(path) is counts


@pytest.mark.parametrize(
    ("platform", "environment", "counted", "left_out"),
    [
        ("linux", {}, "/System/a.ttf", "/usr/share/fonts/a.ttf"),
        ("darwin", {}, "/Users/a/Library/t.csv", "/System/Library/Fonts/a.ttc"),
        ("darwin", {}, "/private/var/folders/t.csv", "/private/var/db/timezone/zoneinfo/UTC"),
        ("win32", {"SystemRoot": "/c/Windows", "ProgramFiles": ""}, "/usr/lib/t.csv", "/c/Windows/Fonts/arial.ttf"),
        ("win32", {"ProgramFiles": "/c/Program Files"}, "/c/Users/a/t.csv", "/c/Program Files/b/units.txt"),
    ],
)
def test_folders_of_an_operating_system_hold_no_inputs(
    monkeypatch: pytest.MonkeyPatch, platform: str, environment: dict[str, str], counted: str, left_out: str
) -> None:
    """Each has its own; which they are is a function of its name and of the environment."""
    monkeypatch.setattr(opened_inputs, "system_places", lambda: system_places(platform, environment))
    opened_inputs._system_folders.cache_clear()
    try:
        assert (is_input(counted), is_input(left_out)) == (True, False)
    finally:
        opened_inputs._system_folders.cache_clear()


def test_names_are_safe_and_apart(tmp_path: Path) -> None:
    assert safe_name("/x/../..") == "file"
    assert safe_name("/x/.hidden\n<b>.csv") == "hidden__b_.csv"
    assert len(safe_name("x" * 500)) == 100
    places = ["/a/x/t.csv", "/b/x/t.csv", "/b/T.csv", "/x_t.csv"]
    names = [file.name for file in with_unique_names(InputFile("", place, "", 0) for place in places)]
    assert len({name.casefold() for name in names}) == len(places)
    assert names == [file.name for file in with_unique_names(InputFile("", place, "1", 1) for place in places)]


def test_content_is_told_by_content(tmp_path: Path) -> None:
    """Written again within the resolution of time stamps and of the same length."""
    path = tmp_path / "table.txt"
    for text in ("1", "2", "1"):
        path.write_text(text)
        os.utime(path, ns=(0, 0))
        assert content_of(str(path)) == (hashlib.sha256(text.encode()).hexdigest(), 1)
