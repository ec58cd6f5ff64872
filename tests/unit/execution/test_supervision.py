"""Which commands have a supervisor, its notes, and the signals that a command counts beside those passed on."""

from __future__ import annotations

import pickle
from pathlib import Path

import pytest

from mcnav.execution import supervision
from mcnav.execution.interrupts import Interrupts
from mcnav.execution.supervision import LAST_WORDS, PASSED_ON, Notes, names_code
from mcnav.systems.guard import CodeMisbehaved
from tests.conftest import ROOT


@pytest.fixture
def notes(monkeypatch: pytest.MonkeyPatch) -> Notes:
    made = Notes()
    monkeypatch.setattr(supervision, "_own", [made])
    return made


@pytest.mark.posix
@pytest.mark.parametrize(
    ("text", "arguments", "named"),
    [
        ('type = "mine.py:Mine"', ("run", "FILE"), True),
        ('type = "mine.py:Mine"', ("replay", "runs/x", "3", "--campaign=FILE"), True),
        ('type = "mine\\u002epy:Mine"', ("run", "FILE"), True),
        ('type = "cruise"', ("run", "FILE", "--out", "there"), False),
        ('type = "cruise"', ("sweep", "FILE", "--vary", "scenario.type=mine.py:Mine"), True),
        ('type = "cruise"', ("live", "FILE"), True),
        ("", ("check", "mine.py"), True),
        ("", ("show", "runs/x"), False),
        ("", (), False),
    ],
)
def test_commands_that_may_execute_code(text: str, arguments: tuple[str, ...], named: bool, tmp_path: Path) -> None:
    (tmp_path / "c.toml").write_text(text)
    assert names_code([each.replace("FILE", str(tmp_path / "c.toml")) for each in arguments]) is named


@pytest.mark.posix
def test_campaigns_in_utf_16_are_read(tmp_path: Path) -> None:
    (tmp_path / "c.toml").write_text('type = "mine.py:Mine"', encoding="utf-16")
    assert names_code(["run", str(tmp_path / "c.toml")])


@pytest.mark.posix
def test_examples_with_code_have_a_supervisor() -> None:
    with_code = [path for path in (ROOT / "campaigns").glob("*.toml") if ".py:" in path.read_text(encoding="utf-8")]
    assert with_code
    assert all(names_code([str(path)]) for path in with_code)


def test_notes_keep_their_lines(notes: Notes) -> None:
    notes.write(LAST_WORDS, "é" * 2_000)
    assert notes.read(LAST_WORDS) == "é" * 512
    notes.write(3, "mine.py\twhile it was read")
    assert [notes.read(line) for line in range(5)] == ["", "", "", "mine.py\twhile it was read", ""]


@pytest.mark.parametrize(
    ("events", "counted"),
    [
        ("d", [True]),  # kill, to the command alone
        ("dd", [True, True]),
        ("pa", [True]),  # kill, to the supervisor alone
        ("papa", [True, True]),
        ("dpa", [True, False]),  # a terminal, which sends to both
        ("pda", [True, False]),
        ("pd", [True]),  # both arrived as one
        ("dpadpa", [True, False, True, False]),
        ("dpapda", [True, False, True, False]),
    ],
)
def test_signals_count_once(events: str, counted: list[bool], notes: Notes) -> None:
    """``p``: the supervisor notes one that it will pass on, ``a``: this arrives, ``d``: one arrives directly."""
    interrupts, new = Interrupts(), list[bool]()
    for event in events:
        if event == "p":
            notes.numbers[PASSED_ON] += 1
        else:
            new.append(interrupts.count())
    assert new == counted


def test_refusals_travel_from_workers() -> None:
    sent = pickle.loads(pickle.dumps(CodeMisbehaved("type", "mine.py changed the current folder")))
    assert (type(sent), sent.key, str(sent)) == (CodeMisbehaved, "type", "mine.py changed the current folder")
