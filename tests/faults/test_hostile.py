"""Run folders and campaigns from a stranger: each is told in one line, nothing executes, nothing takes long."""

from __future__ import annotations

import copy
import hashlib
import io
import json
import os
import pickle
import random
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from mcnav.config.read import parse_campaign, read_campaign
from mcnav.errors import CampaignError, RunFolderError
from mcnav.files.parquet import parquet_bytes
from mcnav.workflow.analyse import report_run, samples_of
from mcnav.workflow.run import run_campaign
from mcnav.workflow.stored_summary import summary_of
from tests.commands import in_process
from tests.conftest import TWO_ERRORS, campaign, content
from tests.faults.folders.content import VALUES, places_in, set_at, sign
from tests.faults.scenarios import VECTORISED, mcnav, write_campaign
from tests.printed import count_scripts
from tests.processes import LONG, largest_memory
from tests.runs import simulate


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished run of three chunks of the reference engine's size."""
    folder = tmp_path_factory.mktemp("stored") / "run"
    run_campaign(campaign(1, samples=70, errors=TWO_ERRORS), folder, "reference", 1, report=False)
    return folder


@pytest.fixture
def folder(stored: Path, tmp_path: Path) -> Path:
    shutil.copytree(stored, tmp_path / "run")
    return tmp_path / "run"


def refused(folder: Path) -> str:
    """The one line of `mcnav report` on a folder that it refuses."""
    began = time.process_time()
    done = in_process("report", folder)
    assert time.process_time() - began < LONG
    assert done.exit_code == 2, done.output
    assert done.exception is None or isinstance(done.exception, SystemExit)
    (line,) = done.stderr.splitlines()
    assert line.startswith("error: ")
    return line


@pytest.mark.parametrize("name", ["../../secret.parquet", "/etc/passwd", "part-00000.parquet/..", "", "part-0.parquet"])
def test_parts_that_lie_elsewhere(name: str, folder: Path) -> None:
    sign(folder, lambda manifest: manifest["parts"][0].update(file=name))
    assert "is not as this program writes it (parts.0.file" in refused(folder)


def _swap(samples: Path, folder: Path) -> None:
    one, other = samples / "part-00000.parquet", samples / "part-00001.parquet"
    contents = one.read_bytes(), other.read_bytes()
    one.write_bytes(contents[1])
    other.write_bytes(contents[0])


def _forge(samples: Path, folder: Path, table: pa.Table) -> None:
    forged = parquet_bytes(table, [name for name in table.column_names if not pa.types.is_floating(table[name].type)])
    (samples / "part-00000.parquet").write_bytes(forged)
    sign(folder, lambda manifest: manifest["parts"][0].update(sha256=hashlib.sha256(forged).hexdigest()))


def _hole(samples: Path, folder: Path) -> None:
    content = bytearray((samples / "part-00000.parquet").read_bytes())
    content[500:1500] = bytes(1000)
    (samples / "part-00000.parquet").write_bytes(content)


def _objects(samples: Path, folder: Path) -> None:
    table = pq.read_table(samples / "part-00000.parquet")
    pickled = pa.array([pickle.dumps(os.getpid)] * len(table))
    place = table.column_names.index("output altitude [m]")
    _forge(samples, folder, table.set_column(place, "output altitude [m]", pickled))


def _repeated(samples: Path, folder: Path) -> None:
    table = pq.read_table(samples / "part-00000.parquet")
    _forge(samples, folder, table.set_column(0, "index", pa.array(np.zeros(len(table), dtype=int))))


def _no_status(samples: Path, folder: Path) -> None:
    table = pq.read_table(samples / "part-00000.parquet")
    _forge(samples, folder, table.set_column(1, "status", pa.array([None] * len(table), pa.string())))


def _fewer_columns(samples: Path, folder: Path) -> None:
    _forge(samples, folder, pq.read_table(samples / "part-00000.parquet").drop_columns(["output range [m]"]))


def _expanding(samples: Path, folder: Path) -> None:
    """Thirty-two rows, one of whose reasons is a text of a gigabyte that packs well."""
    table = pq.read_table(samples / "part-00000.parquet")
    long = pa.array(["x" * 300_000_000] + ["ok"] * (len(table) - 1))
    table, buffer = table.set_column(1, "status", long), io.BytesIO()
    pq.write_table(table, buffer, compression="zstd")
    (samples / "part-00000.parquet").write_bytes(buffer.getvalue())
    forged = hashlib.sha256(buffer.getvalue()).hexdigest()
    sign(folder, lambda manifest: manifest["parts"][0].update(sha256=forged))


def _sparse(samples: Path, folder: Path) -> None:
    with (samples / "part-00000.parquet").open("r+b") as file:
        file.truncate(1 << 40)


def _pipe(samples: Path, folder: Path) -> None:
    (samples / "part-00000.parquet").unlink()
    os.mkfifo(samples / "part-00000.parquet")


DAMAGES: dict[str, Callable[[Path, Path], object]] = {
    "swapped": _swap,
    "holed": _hole,
    "cut": lambda samples, folder: os.truncate(samples / "part-00000.parquet", 1000),
    "emptied": lambda samples, folder: os.truncate(samples / "part-00000.parquet", 0),
    "objects": _objects,
    "repeated": _repeated,
    "no status": _no_status,
    "fewer columns": _fewer_columns,
    "expanding": _expanding,
    "sparse": _sparse,
    "pipe": _pipe,
    "extra": lambda samples, folder: (samples / "part-00007.parquet").write_bytes(b"PAR1"),
}


@pytest.mark.parametrize("kind", list(DAMAGES))
def test_chunks_that_are_none(kind: str, folder: Path) -> None:
    """Also where the manifest has been made to say that all is well."""
    DAMAGES[kind](folder / "samples", folder)
    before = largest_memory()
    refused(folder)
    with pytest.raises(RunFolderError):
        samples_of(folder)
    assert largest_memory() - before < 1_500_000_000, "bytes"


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_a_manifest_of_anything(folder: Path) -> None:
    """Values of wrong types anywhere, checksum and all: used or refused, never anything else."""
    chance = random.Random(7)
    content = json.loads((folder / "manifest.json").read_text())
    outcomes = {"read": 0, "refused": 0}
    for place in chance.sample(list(places_in(content)), 16):
        value = chance.choice(VALUES)
        (folder / "manifest.json").write_text(json.dumps(content))
        sign(folder, lambda manifest, place=place, value=value: set_at(manifest, place, value))  # type: ignore[misc]
        try:
            report_run(folder)
            outcomes["read"] += 1
        except RunFolderError:
            outcomes["refused"] += 1
    assert outcomes["refused"] > 2


def test_a_summary_of_anything(folder: Path) -> None:
    """The same of ``mcnav compare``, which reads nothing else."""
    chance = random.Random(8)
    summary = json.loads((folder / "summary.json").read_text())
    for path in chance.sample(list(places_in(summary)), 50):
        changed = copy.deepcopy(summary)
        set_at(changed, path, chance.choice(VALUES))
        (folder / "summary.json").write_text(json.dumps(changed))
        done = in_process("compare", folder, folder)
        assert done.exit_code in (0, 2), (path, done.output, done.exception)
        assert done.exit_code == 0 or len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize("name", ["manifest.json", "summary.json"])
@pytest.mark.parametrize(
    "content", [b"[]", b"1", b"{", b"\xff", b"[" * 200_000, b'{"a":' * 200_000, b'{"a": 1' + b"0" * 5_000 + b"}", None],
    ids=["list", "number", "cut", "bytes", "deep list", "deep table", "long number", "a gigabyte"],
)  # fmt: skip
def test_json_that_is_none(name: str, content: bytes | None, folder: Path) -> None:
    path = folder / name
    path.write_bytes(content or b"")
    if content is None:
        os.truncate(path, 1 << 30)
    began = time.process_time()
    with pytest.raises(RunFolderError) as found:
        summary_of(folder)
    assert time.process_time() - began < LONG
    assert str(path) in str(found.value)


@pytest.mark.posix
@pytest.mark.parametrize("link", [".lock", "samples", "tables", "inputs"])
def test_links_are_not_followed(link: str, folder: Path, tmp_path: Path) -> None:
    """A run neither empties, writes nor deletes what a link in its folder points to."""
    victim = tmp_path / "victim"
    victim.mkdir()
    precious = victim / "part-00000.parquet"
    precious.write_text("precious")
    shutil.rmtree(folder / link, ignore_errors=True)
    (folder / link).unlink(missing_ok=True)
    (folder / link).symlink_to(precious if link == ".lock" else victim)
    with pytest.raises(RunFolderError, match="is a link to somewhere else"):
        simulate(campaign(1, samples=70, errors=TWO_ERRORS), folder, "reference", 1, fresh=True)
    assert precious.read_text() == "precious"


def test_fresh_deletes_only_what_a_run_wrote(folder: Path) -> None:
    """Not what a manifest says that it wrote, and no temporary file of another's."""
    (folder / "thesis.py").write_text("precious")
    (folder / ".thesis.tmp").write_text("precious")
    code = {"file": "thesis.py", "sha256": "0" * 64}
    sign(folder, lambda manifest: manifest["identity"].update(code=code))
    simulate(campaign(4, samples=64), folder, "ensemble", 1, fresh=True)
    assert (folder / "thesis.py").read_text() == "precious"
    assert (folder / ".thesis.tmp").read_text() == "precious"


@pytest.fixture(scope="module")
def stored_with_inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished run of a scenario that reads ``table.txt`` beside its campaign."""
    place = tmp_path_factory.mktemp("inputs")
    (place / "table.txt").write_text("2")
    reads = f"open({str(place / 'table.txt')!r}).close()\n\nclass Mine:"
    path = write_campaign(place, "pass", VECTORISED.replace("class Mine:", reads))
    run_campaign(read_campaign(path), place / "run", None, 1, report=False)
    return place


@pytest.fixture
def with_inputs(stored_with_inputs: Path, tmp_path: Path) -> Path:
    shutil.copytree(stored_with_inputs / "run", tmp_path / "run")
    return tmp_path / "run"


@pytest.mark.parametrize(
    "spoilt",
    ["text", pytest.param("link", marks=pytest.mark.posix), pytest.param("pipe", marks=pytest.mark.posix), "folder"],
)
def test_kept_files_that_are_not_what_a_run_wrote(spoilt: str, with_inputs: Path, stored_with_inputs: Path) -> None:
    """Neither followed nor deleted by ``--fresh``; a file or link in the way is replaced, a folder told in one line."""
    precious = with_inputs.parent / "precious"
    precious.write_text("precious")
    copy = with_inputs / "inputs" / "table.txt"
    copy.unlink()
    (with_inputs / "inputs" / "thesis.csv").write_text("precious")
    make: dict[str, Callable[[], object]] = {
        "text": lambda: copy.write_text("3"),
        "link": lambda: copy.symlink_to(precious),
        "pipe": lambda: os.mkfifo(copy),
        "folder": copy.mkdir,
    }
    make[spoilt]()
    again = read_campaign(stored_with_inputs / "mine.toml")
    if spoilt == "folder":
        with pytest.raises(RunFolderError, match=r"inputs/table\.txt: cannot be written: Is a directory"):
            simulate(again, with_inputs, None, 1, fresh=True)
        copy.rmdir()
    simulate(again, with_inputs, None, 1, fresh=True)
    assert not copy.is_symlink()
    assert copy.read_text() == "2"
    assert precious.read_text() == "precious"
    assert (with_inputs / "inputs" / "thesis.csv").read_text() == "precious"


def test_fresh_deletes_the_copies_of_the_earlier_run(with_inputs: Path) -> None:
    simulate(campaign(4, samples=64), with_inputs, "ensemble", 1, fresh=True)
    assert not (with_inputs / "inputs").exists()


@pytest.mark.parametrize(
    "entry",
    [
        {"name": "../table.txt"}, {"name": "/etc/passwd"}, {"name": ".lock"}, {"name": "a/b"}, {"name": ""},
        {"bytes": -1}, {"sha256": "0"}, {"kept": "yes"}, {"setting": 3}, {"name": None},
    ],
    ids=repr,
)  # fmt: skip
def test_manifests_that_list_other_files(entry: dict[str, Any], with_inputs: Path) -> None:
    sign(with_inputs, lambda manifest: manifest["files"][0].update(entry))
    told = refused(with_inputs)
    assert f"manifest.json: is not as this program writes it (files.0.{next(iter(entry))}" in told


@pytest.mark.parametrize(
    "written_as", ["/etc/evil.py:Mine", "../mine.py:Mine", "a/../../mine.py:Mine", "a\\..\\mine.py:Mine"]
)
def test_code_from_elsewhere_is_not_executed(written_as: str, tmp_path: Path) -> None:
    mark = tmp_path / "executed"
    (tmp_path / "mine.py").write_text(f"open({str(mark)!r}, 'w')")
    (tmp_path / "below").mkdir()
    with pytest.raises(CampaignError, match="must lie beside the campaign file"):
        parse_campaign({"scenario": {"type": written_as}}, str(tmp_path / "below" / "campaign.toml"), "campaign")
    assert not mark.exists()


def test_a_run_folder_that_names_code_does_not_execute_it(folder: Path, tmp_path: Path) -> None:
    """A scenario swapped for code in a stored campaign: ``replay`` refuses, ``report`` shows its text."""
    mark = tmp_path / "executed"
    (folder / "evil.py").write_text(f"open({str(mark)!r}, 'w')")
    text = (folder / "campaign.toml").read_text().replace('type = "reentry"', 'type = "evil.py:Evil"')
    (folder / "campaign.toml").write_text(text)
    done = in_process("replay", folder, "3")
    assert done.exit_code == 2
    assert "nothing in a run folder is executed" in done.stderr
    report_run(folder)
    assert "evil.py:Evil" in (folder / "report.html").read_text()
    assert not mark.exists()


def test_panels_from_elsewhere_stay_text(folder: Path) -> None:
    """Titles, columns and events of a stored history: HTML and mathematics are text in the page."""
    table = pq.read_table(folder / "history.parquet")
    marks = {
        key: value.replace(b"The whole flight", b"</title><script>alert(1)</script>$\\\\frac{$")
        for key, value in table.schema.metadata.items()
    }
    (folder / "history.parquet").write_bytes(parquet_bytes(table.replace_schema_metadata(marks)))
    report_run(folder)
    page = (folder / "report.html").read_text()
    assert count_scripts(page) == 1  # its own
    assert "alert(1)" in page


@pytest.mark.parametrize(
    "text",
    [
        b"a." * 400_000 + b"a = 1",
        b"[" + b"a." * 400_000 + b"a]",
        b"".join(b"k%d = 1\n" % n for n in range(30_000)),
        b"[errors]\n" + b"".join(b"altitudf%d = 1\n" % n for n in range(60_000)),
        b'name = "' + b"x" * 900_000 + b'"',
        b"samples = " + b"9" * 4_000,
        b"seed = nan\nsamples = inf",
        b"[[correlations]]\n" * 50_000,
        b"x = [" + b"{}," * 200_000 + b"]",
    ],
    ids=["dotted", "dotted table", "keys", "errors", "name", "digits", "not finite", "correlations", "tables"],
)
def test_large_campaign_files(text: bytes, tmp_path: Path) -> None:
    """A third of the largest file, in a ninth of the longest time: reading may not take the square of the length."""
    path = tmp_path / "campaign.toml"
    path.write_bytes(text)
    began = time.process_time()
    with pytest.raises(CampaignError) as found:
        read_campaign(path)
    assert time.process_time() - began < LONG / 9.0
    assert len(str(found.value).splitlines()) <= 60
    assert len(str(found.value)) < 60_000


@pytest.mark.posix
def test_campaigns_and_code_that_are_pipes_or_endless(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "mine.py")
    with pytest.raises(CampaignError, match="cannot be read: is no file"):
        parse_campaign({"scenario": {"type": "mine.py:Mine"}}, str(tmp_path / "campaign.toml"), "campaign")
    (tmp_path / "endless.toml").symlink_to("/dev/zero")
    with pytest.raises(CampaignError, match="is larger than"):
        read_campaign(tmp_path / "endless.toml")
    described = content()
    described["errors"]["range"] = {"distribution": "table", "file": "values.csv", "column": "x", "unit": "km"}
    os.mkfifo(tmp_path / "values.csv")
    with pytest.raises(CampaignError, match="is no file"):
        parse_campaign(described, str(tmp_path / "campaign.toml"), "campaign")


def test_names_that_are_html_or_mathematics(tmp_path: Path) -> None:
    """Whatever a class of one's own calls its units and events; a name itself must be one."""
    path = write_campaign(tmp_path, "", samples=30)
    code = (tmp_path / "mine.py").read_text().replace('Source("a",', 'Source("<b>",')
    (tmp_path / "mine.py").write_text(code)
    with pytest.raises(CampaignError, match="is not a name of letters"):
        read_campaign(path)


def _unfinished(folder: Path) -> None:
    sign(folder, lambda manifest: manifest.update(complete=False))


def _damaged(folder: Path) -> None:
    (folder / "samples" / "part-00000.parquet").write_bytes(b"")


@pytest.mark.parametrize("spoil", [_unfinished, _damaged])
def test_a_process_that_refuses_says_one_line(folder: Path, spoil: Callable[[Path], None]) -> None:
    """Nothing but the reason is written to stderr."""
    spoil(folder)
    finished = mcnav("report", folder)
    assert finished.returncode == 2
    assert finished.stderr.startswith("error: ")
    assert finished.stderr.count("\n") == 1
