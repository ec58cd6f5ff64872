"""Run folders of a stranger: a share of the grammar's with a fixed seed, and what fuzzing found."""

from __future__ import annotations

import hashlib
import io
import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from mcnav.errors import RunFolderError
from mcnav.files import parquet_reading
from mcnav.files.parquet import parquet_bytes
from mcnav.files.parquet_reading import MOST_PARTS, table_from
from mcnav.report.pages.comparison import MOST_INPUTS
from mcnav.store import manifest as manifest_file
from mcnav.store.manifest import MOST_KEYS
from mcnav.store.run_files import MOST_ENTRIES
from mcnav.store.run_folder import RunFolder
from tests.commands import invoke
from tests.faults.folders.content import sign
from tests.faults.folders.make import CHANGES
from tests.faults.folders.runs import Outside, finished_runs
from tests.faults.fuzz_folders import COMMANDS, Audit, Watch, try_folder

pytestmark = pytest.mark.posix  # Linux tells which files are opened

READERS = [name for name in COMMANDS if name not in ("sweep", "lincov", "compare two")]
"""Commands that are given a run folder."""


QUICK = [name for name in COMMANDS if name not in ("replay", "figure")]
"""Commands that neither simulate nor import matplotlib."""


@pytest.fixture(scope="module")
def base(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("base")
    finished_runs(place, ["summary", "own"])
    return place


@pytest.fixture(scope="module")
def audit() -> Audit:
    """A hook stays as long as the process."""
    return Audit()


@pytest.fixture
def place(base: Path, tmp_path: Path) -> Path:
    """A folder with a copy of a finished run, and files outside of it."""
    shutil.copytree(base / "runs" / "summary", tmp_path / "hostile" / "run")
    Outside(tmp_path / "outside").fill()
    (tmp_path / "out").mkdir()
    return tmp_path


def refuse(name: str, place: Path) -> str:
    """Return the line with which a command refuses the folder; nothing outside has been opened."""
    run = place / "hostile" / "run"
    words = {"RUN": run, "GOOD": run, "PARENT": place / "hostile", "OUT": place / "out"}
    arguments = [words.get(each, each) for each in COMMANDS[name]]
    watch = Watch(place / "outside")
    done = invoke(*(str(each).replace("OUT", str(place / "out")) for each in arguments), cwd=place)
    assert watch.seen() == []
    watch.close()
    if name == "index":
        return (place / "hostile" / "index.html").read_text()
    assert done.returncode == 2, done.stdout
    (line,) = done.stderr.splitlines()
    assert line.startswith("error: ")
    return line


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("number", range(len(CHANGES)))
def test_folders_of_the_grammar(number: int, base: Path, audit: Audit, tmp_path: Path) -> None:
    """Each change once: read or refused in words, nothing executed, opened or written outside."""
    (tmp_path / "runs").symlink_to(base / "runs")
    runs = {name: base / "runs" / name for name in ("summary", "own")}
    outcomes = list(try_folder(number, 3, runs, tmp_path, audit, QUICK, 2))
    assert len(outcomes) == 2
    assert not [each for each in outcomes if each[2].startswith("finding")]


def test_what_is_opened_outside_is_seen(place: Path) -> None:
    """By Python and by libraries."""
    watch = Watch(place / "outside")
    (place / "outside" / "secret.csv").read_text()
    assert any("secret.csv" in each for each in watch.seen())
    with pytest.raises(pa.ArrowInvalid):
        pq.read_table(place / "outside" / "evil.py")
    assert any("evil.py" in each for each in watch.seen())
    watch.close()


LINKED = ["manifest.json", "summary.json", "campaign.toml", "history.parquet", "samples/part-00000.parquet", "samples"]


@pytest.mark.parametrize("name", LINKED)
def test_links_to_what_would_be_right_are_refused(name: str, place: Path) -> None:
    """By every command: a report of a stranger's folder would otherwise hold files of one's own."""
    run, moved = place / "hostile" / "run", place / "outside" / "moved"
    shutil.move(run / name, moved)
    (run / name).symlink_to(moved)
    for command in READERS:
        assert f"{name}: is a link to somewhere else" in refuse(command, place)


def test_an_index_does_not_follow_links(place: Path) -> None:
    (place / "hostile" / "linked").symlink_to(place / "outside")
    refuse("index", place)
    assert "secret" not in (place / "hostile" / "index.html").read_text()


@pytest.mark.parametrize(("name", "command"), [("campaign.toml", "replay"), ("history.parquet", "report"),
                                               ("epochs.parquet", "export"), ("summary.json", "show")])  # fmt: skip
def test_pipes_are_not_waited_for(name: str, command: str, place: Path) -> None:
    (place / "hostile" / "run" / name).unlink()
    os.mkfifo(place / "hostile" / "run" / name)
    assert name in refuse(command, place)


def test_histories_that_are_a_pipe(base: Path, place: Path) -> None:
    """Arrow opens this file, and would wait."""
    path = place / "hostile" / "run" / "histories.parquet"
    path.unlink()
    os.mkfifo(path)
    with pytest.raises(RunFolderError, match=r"histories\.parquet: is damaged"):
        RunFolder(path.parent).histories(10)


def test_histories_in_parts_beyond_number(place: Path) -> None:
    """Of one row each: fifty thousand of them take half a minute."""
    path = place / "hostile" / "run" / "histories.parquet"
    pq.write_table(pq.read_table(path).slice(0, MOST_PARTS + 1), path, row_group_size=1)
    with pytest.raises(RunFolderError, match=r"histories\.parquet: is damaged"):
        RunFolder(path.parent).histories(10)


@pytest.mark.parametrize("name", ["manifest.json", "summary.json"])
def test_entries_beyond_number(name: str, place: Path) -> None:
    """Millions of empty lists take a hundred times their bytes in memory, and long to write again."""
    path = place / "hostile" / "run" / name
    path.write_text(path.read_text().replace("{", '{"large": [' + "[]," * MOST_ENTRIES + "0],", 1))
    for command in ("report", "show") if name == "manifest.json" else ("show",):
        assert f"{name}: has more than {MOST_ENTRIES:,} entries" in refuse(command, place)


@pytest.mark.parametrize(
    "column",
    [
        lambda: pa.DictionaryArray.from_arrays(pa.array(np.zeros(10_000_000, dtype=np.int32)), pa.array([1.0])),
        lambda: pa.array(["x" * 100_000] * 300),
        lambda: pa.array(["x" * 100_000, "y"] * 300),
    ],
    ids=["numbers", "text", "texts"],
)
def test_tables_that_hold_one_thing_many_times(column: Callable[[], pa.Array], monkeypatch: pytest.MonkeyPatch) -> None:
    """A dictionary has it once, so that the bytes that a file claims say nothing."""
    monkeypatch.setattr(parquet_reading, "MOST_TEXT", 10_000_000)
    sink = io.BytesIO()
    pq.write_table(pa.table({"a": column(), "b": column()}), sink, compression="zstd")
    assert len(sink.getvalue()) < 1_000_000
    with pytest.raises(ValueError, match="more than there is room for"):
        table_from(sink.getvalue())


def test_texts_are_those_that_were_written() -> None:
    """Also where each sample has failed for a long reason of its own."""
    reasons = [f"failed: {number} {'x' * 300}" for number in range(1_000)]
    for texts in (reasons, ["ok"] * 1_000, ["ok", "failed: é"] * 500, ["ok", None] * 500, [""] * 1_000):
        table = pa.table({"status": texts, "a": np.arange(1_000.0)})
        assert table_from(parquet_bytes(table, ["status"])).equals(table)


@pytest.mark.parametrize(("samples", "length"), [(10**10, 10**8), (10**8, 900_000_000)])
def test_samples_beyond_number(samples: int, length: int, place: Path) -> None:
    """In a file that is long without taking room, and in one longer than any that is read."""
    run = place / "hostile" / "run"

    def claim(manifest: dict[str, Any]) -> None:
        manifest["samples"] = manifest["parts"][-1]["end"] = samples
        manifest["kept"] = None

    sign(run, claim)
    (part,) = (run / "samples").iterdir()
    os.truncate(part, length)
    assert "it claims to have more samples than there is room for" in refuse("report", place)


def test_too_little_memory_names_the_folder(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise MemoryError

    monkeypatch.setattr("mcnav.workflow.export.export_run", fail)
    assert refuse("export", place) == f"error: {place / 'hostile' / 'run'}: not enough memory"


@pytest.mark.parametrize("which", ["outputs", "sources"])
@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("name", "=cmd|'!A0"),
        ("name", "<b>"),
        ("name", "../x"),
        ("unit", "furlong"),
        ("shown_in", "kg"),
        ("unit", "m^999"),
    ],
)
def test_names_and_units_of_a_stranger(which: str, key: str, value: str, place: Path) -> None:
    sign(place / "hostile" / "run", lambda manifest: manifest["model"][which][0].update({key: value}))
    line = refuse("report", place)
    assert f"manifest.json: is not as this program writes it (model.{which}.0" in line


def test_escapes_do_not_reach_the_terminal(base: Path, place: Path) -> None:
    sign(place / "hostile" / "run", lambda manifest: manifest["identity"]["campaign"].update(note="\x1b[31mred\u202e"))
    done = invoke("compare", base / "runs" / "summary", place / "hostile" / "run", cwd=place)
    assert "\\x1b[31mred\\u202e" in done.stdout
    assert "\x1b" not in done.stdout


def _inputs_as_json(base: Path, place: Path) -> list[dict[str, Any]]:
    """Compare with a sound run; return the rows of inputs, which are printed without what a terminal obeys."""
    done = invoke("compare", base / "runs" / "summary", place / "hostile" / "run", "--format", "json", cwd=place)
    assert done.returncode == 0, done.stderr
    assert all(line.isprintable() for line in done.stdout.split("\n"))
    return list(json.loads(done.stdout)["inputs"])


def test_escapes_in_json(base: Path, place: Path) -> None:
    run, note = place / "hostile" / "run", "\x1b[31m\x9bred\u202e\U000e0001"
    sign(run, lambda manifest: manifest["identity"]["campaign"].update(note=note))
    (row,) = _inputs_as_json(base, place)
    assert (row["key"], row[str(run)]) == ("note", note)


def test_escapes_in_csv(base: Path, place: Path) -> None:
    """Names of a summary are not those of the manifest, which are checked."""
    path = place / "hostile" / "run" / "summary.json"
    text = path.read_text()
    for key in ("name", "lead"):
        text = text.replace(f'"{key}": "', f'"{key}": "\x9b\u202e')
    path.write_text(text)
    done = invoke("compare", path.parent, base / "runs" / "summary", "--format", "csv", cwd=place)
    assert "\\x9b\\u202e" in done.stdout
    assert all(line.isprintable() for line in done.stdout.split("\n"))


@pytest.mark.parametrize("key", ["tolerance", "confidence"])
def test_a_text_for_a_number(key: str, place: Path) -> None:
    """It is not repeated a hundred times, which takes gigabytes when it is long."""
    path = place / "hostile" / "run" / "summary.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {key: "x"}))
    mistake = f"{key}: got 'x'; expected a valid number, unable to parse string as a number"
    line = f"{path}: is not as this program writes it ({mistake}); run the campaign again"
    assert refuse("compare", place) == f"error: {line}"


def test_a_long_text_for_a_number(place: Path) -> None:
    """It is told in one line, shortened."""
    path = place / "hostile" / "run" / "summary.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"tolerance": "x" * 1_000_000}))
    assert "(tolerance: got 'xxx" in refuse("compare", place)
    assert len(refuse("compare", place)) < 600


def test_inputs_beyond_number(base: Path, place: Path) -> None:
    """The first thousand that differ are listed."""
    more = {f"k{number}": number for number in range(MOST_INPUTS + 200)}
    sign(place / "hostile" / "run", lambda manifest: manifest["identity"]["campaign"].update(more=more))
    rows = _inputs_as_json(base, place)
    assert len(rows) == MOST_INPUTS + 1
    assert rows[-2]["key"] == f"more.k{MOST_INPUTS - 1}"
    assert rows[-1]["key"] == "and 200 more"


def test_keys_beyond_number(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """More than fit into a campaign file, whose characters are a million; comparing a million keys takes a minute."""
    assert 4 * MOST_KEYS >= 1_000_000  # characters of a campaign file, of which `k=1` and its end of line take four
    monkeypatch.setattr(manifest_file, "MOST_KEYS", 1_000)
    more = {f"k{number}": number for number in range(1_000)}
    sign(place / "hostile" / "run", lambda manifest: manifest["identity"]["campaign"].update(more=more))
    assert "(identity.campaign: has more than 1,000 keys)" in refuse("compare", place)


@pytest.mark.parametrize("key", ["samples", "seed"])
def test_a_replay_of_a_campaign_without(key: str, place: Path) -> None:
    sign(place / "hostile" / "run", lambda manifest: manifest["identity"]["campaign"].pop(key))
    assert f"manifest.json: is not as this program writes it (KeyError: '{key}')" in refuse("replay", place)


def test_half_of_a_surrogate_pair(place: Path) -> None:
    """JSON can escape it, where UTF-8 has no bytes for it: no file of this program has one."""
    run = place / "hostile" / "run"
    summary = run / "summary.json"
    summary.write_text(summary.read_text().replace('"name": "altitude"', '"name": "\\ud800"'))
    for command in ("show", "compare csv", "index"):
        assert "summary.json: is damaged" in refuse(command, place)
    sign(run, lambda manifest: manifest.update({"\ud800": "\ud800"}))
    assert b'"\\ud800": "\\ud800"' in (run / "manifest.json").read_bytes()
    for command in READERS:
        assert "manifest.json: is damaged" in refuse(command, place)


def _trajectory(named: str) -> str:
    return f'samples = 70\n[scenario]\ntype = "ins"\ntrajectory = "{named}"\n[errors]\nposition = "5 m"\n'


def _table(named: str) -> str:
    table = f'{{ distribution = "table", file = "{named}", column = "a", unit = "m" }}'
    return f'samples = 70\n[scenario]\ntype = "reentry"\ntrajectory = 4\n[errors]\naltitude = {table}\n'


@pytest.mark.parametrize("written", [_trajectory, _table])
@pytest.mark.parametrize("named", ["OUTSIDE/secret.csv", "../../outside/secret.csv", "link.csv", "linked/secret.csv"])
def test_a_replay_reads_nothing_outside(written: Callable[[str], str], named: str, place: Path) -> None:
    """Neither by a path nor along a link."""
    run, outside = place / "hostile" / "run", place / "outside"
    (run / "link.csv").symlink_to(outside / "secret.csv")
    (run / "linked").symlink_to(outside)
    (run / "campaign.toml").write_text(written(named.replace("OUTSIDE", str(outside))))
    assert "the file must lie beside the campaign file, or in a folder beside it" in refuse("replay", place)


def test_the_second_folder_of_a_comparison_is_damaged(base: Path, place: Path) -> None:
    run = place / "hostile" / "run"
    (part,) = (run / "samples").iterdir()
    table = pq.read_table(part)
    marks = {key: value for key, value in table.schema.metadata.items() if key != b"mcnav.summary"}
    part.write_bytes(parquet_bytes(table.replace_schema_metadata(marks), ["status"]))
    digest = hashlib.sha256(part.read_bytes()).hexdigest()
    sign(run, lambda manifest: manifest["parts"][0].update(sha256=digest))
    done = invoke("compare", base / "runs" / "summary", run, cwd=place)
    assert done.returncode == 2
    assert done.stderr.startswith(f"error: {run}: is not as this program writes it")
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(("key", "value"), [("sigma_paired", [10**400] * 4), ("outputs", [{}] * 4)])
def test_an_index_of_damaged_summaries(key: str, value: Any, place: Path) -> None:
    """A row with the reason, also where a number is too large to be shown."""
    path = place / "hostile" / "run" / "summary.json"
    summary = json.loads(path.read_text())
    path.write_text(json.dumps(summary | {key: value}))
    assert "summary.json: is not as this program writes it" in refuse("index", place)
