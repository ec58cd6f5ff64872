"""The guide says which question has an answer of which system: as trying says."""

from __future__ import annotations

from tests.questions import HEADING, PAGE, section


def test_the_table_of_the_guide_is_what_trying_gives() -> None:
    """Otherwise run ``python -m tests.questions`` and read what has changed."""
    page = PAGE.read_text(encoding="utf-8")
    _, _, after = page.partition(HEADING)
    assert HEADING + after[: after.index("\n## ") + 1] == section()
