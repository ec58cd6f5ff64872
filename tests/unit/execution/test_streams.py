"""Output in any encoding, to a reader that has gone, and files in encodings of other programs."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from mcnav.cli.printing import escaped
from mcnav.docs.pages import PAGES, page_text
from mcnav.execution.streams import HANDLER, POWERS, tolerate
from mcnav.files.whole import TextError, text_of
from tests.forked import run_forked
from tests.processes import run_to_end

ENCODINGS = ("ascii", "cp1252", "cp437", "latin-1", "utf-8")

CAMPAIGN = """
name = "Käse, 1σ"
samples = 64
[scenario]
type = "cruise"
speed = "250 m/s"
duration = "10 min"
altitude = "10 km"
[errors]
range = "1 km"
[[accept.quantile]]
output = "range"
probability = 0.9
below = "2 km"
"""


def mcnav(*words: str, cwd: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    """Run a command in a process that Python starts with some variables of the environment."""
    return run_to_end([sys.executable, "-m", "mcnav", *words], cwd=cwd, env=os.environ | variables)


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_every_character_of_the_documentation_is_written_or_replaced(encoding: str) -> None:
    tolerate()
    for page in PAGES:
        for line in page_text(page).splitlines():
            written = line.encode(encoding, HANDLER).decode(encoding)
            assert written.isprintable()
            assert not any(sign in written for sign in POWERS) or encoding != "ascii"


def test_what_is_replaced_reads_alike() -> None:
    """No sign of a number is lost: not its minus, nor that of its power."""
    tolerate()
    text = "−0.313, 4.36×10⁻⁹ rad/s, 5·10¹², 10⁻¹², m/s², 1σ ≥ 2 °/√h, ½, Käse, K\udcc3se, 語"
    assert text.encode("ascii", HANDLER).decode() == (
        "-0.313, 4.36x10^-9 rad/s, 5*10^12, 10^-12, m/s^2, 1sigma >= 2 deg/sqrth, 1/2, Kase, K?se, ?"
    )
    assert "−1 µg, 10⁻²".encode("cp1252", HANDLER).decode("cp1252") == "-1 µg, 10^-²"
    assert "語\udcc3".encode("utf-8", HANDLER).decode() == "語?"


def test_commands_end_well_in_the_encoding_of_windows(tmp_path: Path) -> None:
    encoding = "cp1252"
    (tmp_path / "mine.toml").write_text(CAMPAIGN, encoding="utf-8")
    readings = np.random.default_rng(1).normal(0.0, 1e-3, (2_000, 3))
    table = np.column_stack([0.01 * np.arange(2_000), readings])
    np.savetxt(tmp_path / "rest.csv", table, delimiter=",", header="time,gyro_x,gyro_y,gyro_z", comments="")
    for words in (
        ("run", "mine.toml"), ("show", "reports/mine"), ("lincov", "mine.toml"), ("docs", "notation"), ("schema",),
        ("imu", "HG9900"), ("show", "reports/mine", "--format", "csv"), ("allocate", "mine.toml"), ("--help",),
        ("brief", "reports/mine"), ("compare", "reports/mine", "reports/mine"), ("run", "--help"), ("index", "reports"),
        ("sweep", "mine.toml", "--scale"), ("identify", "rest.csv", "--unit", "gyro=deg/s"),
    ):  # fmt: skip
        done = run_forked(*words, cwd=tmp_path, env={"PYTHONIOENCODING": encoding})
        assert done.returncode == 0, (words, done.stderr)
        assert "Traceback" not in done.stderr
    shown = run_forked("show", "reports/mine", "--format", "json", cwd=tmp_path, env={"PYTHONIOENCODING": encoding})
    assert shown.stdout.isascii()
    assert json.loads(shown.stdout)
    assert json.loads((tmp_path / "reports/mine/manifest.json").read_text("utf-8"))
    assert "Käse, 1σ" in (tmp_path / "reports/mine/campaign.toml").read_text("utf-8")
    for words in (("judge", "mine.toml"), ("identify", "missing.csv"), ("sweep", "mine.toml", "--vary", "−1")):
        done = run_forked(*words, cwd=tmp_path, env={"PYTHONIOENCODING": encoding})
        assert (done.returncode, done.stderr[:7]) == (2, "error: "), (words, done.stderr)
    # Python has chosen this encoding itself
    refused = mcnav("lincov", "missing.toml", cwd=tmp_path, PYTHONIOENCODING=encoding)
    assert refused.returncode == 2
    assert refused.stderr.startswith("error: missing.toml")
    assert refused.stderr.count("\n") == 1


def test_a_c_locale_writes_ascii_and_refuses_names_that_it_cannot_write(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(CAMPAIGN, encoding="utf-8")
    (tmp_path / "Käse.toml").write_text(CAMPAIGN, encoding="utf-8")
    plain = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "PYTHONIOENCODING": ""}
    done = mcnav("lincov", "mine.toml", cwd=tmp_path, **plain)
    assert done.returncode == 0, done.stderr
    assert done.stdout.isascii()
    assert "Käse, 1σ" in (tmp_path / "reports/mine_lincov/lincov.html").read_text("utf-8")
    refused = mcnav("lincov", "Käse.toml", cwd=tmp_path, **plain)
    assert refused.returncode == 2
    assert "is no text in this locale" in refused.stderr
    assert refused.stderr.count("\n") == 1


@pytest.mark.parametrize("stream", ["stdout", "stderr"])
def test_a_reader_that_has_gone_ends_no_work(tmp_path: Path, stream: str) -> None:
    (tmp_path / "mine.toml").write_text(CAMPAIGN, encoding="utf-8")
    reader, writer = os.pipe()
    os.close(reader)
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, stream: writer}
    try:
        done = run_to_end([sys.executable, "-m", "mcnav", "run", "mine.toml"], cwd=tmp_path, **pipes)
    finally:
        os.close(writer)
    assert done.returncode == 0
    assert not done.stderr
    assert (tmp_path / "reports/mine/report.html").is_file()


@pytest.mark.parametrize("form", ["table", "json"])
def test_output_that_is_closed_is_no_mistake(tmp_path: Path, form: str) -> None:
    """A shell closes it by ``>&-``."""
    command = f'exec "{sys.executable}" -m mcnav docs imu --format {form} >&-'
    done = run_to_end(["sh", "-c", command], cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")


def test_json_loses_nothing() -> None:
    text = json.dumps({"unit": "°/√h", "far": "𝄞"}, ensure_ascii=False)
    assert escaped(text).isascii()
    assert json.loads(escaped(text)) == json.loads(text)


def test_texts_of_other_programs_are_read_or_refused_in_a_line() -> None:
    text = 'name = "1 °"\n'
    for encoding in ("utf-8", "utf-8-sig", "utf-16"):
        assert text_of(text.encode(encoding)) == text
    for content, message in (
        (text.encode("utf-16-le"), "seems to be UTF-16; save it as UTF-8"),
        (text.encode("utf-16-be"), "seems to be UTF-16; save it as UTF-8"),
        (("\n" + text).encode("cp1252"), "line 2 has the byte 0xb0, which is '°' in Windows-1252; save it as UTF-8"),
        (b"\xff\xfe\x00", "no whole UTF-16 text either"),
    ):
        with pytest.raises(TextError, match=message):
            text_of(content)
