"""No sentence of a page has more than 25 words; tables, code and formulas aside."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.browser.conftest import FURTHER, KINDS
from tests.sentences import texts_of, too_long

OF_DOCUMENTS = ("textbook", "ukfm", "calibration")
"""Pages that restate publications."""


@pytest.mark.parametrize("kind", [kind for kind in (*KINDS, *FURTHER) if kind not in OF_DOCUMENTS])
def test_sentences_can_be_read_at_once(page_of: Callable[[str], Path], kind: str) -> None:
    texts = texts_of(page_of(kind).read_text(encoding="utf-8"))
    assert [sentence for text in texts for sentence in too_long(text)] == []
