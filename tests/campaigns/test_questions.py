"""The thirty questions: each has one command or three lines of Python, and the answer that they print."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from mcnav.docs.pages import page_text
from tests.conftest import ROOT
from tests.printed import Block, Session, blocks

LINES = 3
"""Lines of Python that an answer may take."""


def questions() -> dict[str, list[Block]]:
    """Return the blocks of every question; those before the first one are under an empty name."""
    head, *parts = re.split(r"^### ", page_text("questions"), flags=re.MULTILINE)
    return {"": blocks(head)} | {part.partition("\n")[0]: blocks(part) for part in parts}


def test_every_question_has_one_short_answer() -> None:
    asked = questions()
    del asked[""]
    assert len(asked) == 30
    for question, answer in asked.items():
        assert question.endswith("?")
        (block,) = answer
        if block.language == "console":
            assert block.text.count("\n$ ") == 0
            assert len(block.text.splitlines()) > 1
        else:
            assert block.language == "pycon"
            entered = re.findall(r"^>>> (.*)$", block.text, re.MULTILINE)
            assert len([line for line in entered if line != "import mcnav"]) <= LINES
            assert "..." not in block.text


@pytest.mark.slow
def test_every_answer_is_as_printed(tmp_path: Path) -> None:
    """All wrong answers are listed, because later questions ask about the same runs."""
    (tmp_path / "campaigns").symlink_to(ROOT / "campaigns")
    session, wrong = Session(tmp_path), []
    for question, answer in questions().items():
        for block in answer:
            try:
                session.follow(block)
            except AssertionError as failure:
                wrong.append(f"{question}\n{failure}")
    assert not wrong, "\n\n".join(wrong)
