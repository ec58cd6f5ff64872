"""Tutorials and how-to pages are followed from the first block to the last; what they show is what is printed."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import ArrayLike

from mcnav.docs.pages import PAGES, page_text
from mcnav.identification.identify import IdentifiedNoise, identify_noise
from tests.conftest import ROOT
from tests.printed import blocks, follow, missing_line, same_text

FOLLOWED = [page for page in PAGES if page.startswith(("tutorial-", "howto-"))]
LANGUAGES = {"console", "pycon", "toml", "python"}

ELSEWHERE = {
    "docs/CAMPAIGNS.md": {"toml"},
    "docs/COMMANDS.md": {"toml"},
    "docs/EXAMINATION.md": {"console"},
    "docs/GUIDE.md": {"sh", "toml"},
    "docs/NOTEBOOK.md": {"python"},
    "docs/SCALING.md": {"sh"},
    "docs/SCENARIOS.md": {"sh", "python"},
    "docs/THEORY.md": {"math"},
    "docs/TRAJECTORIES.md": {"toml"},
}
"""Languages of the blocks of other pages, which `test_documentation.py` executes or checks."""


@pytest.fixture
def identified_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Identify equal readings once: two commands of a page have the same record, and this is what takes long."""
    known = dict[tuple[str, float, float | None], IdentifiedNoise]()

    def identify(readings: ArrayLike, interval: float, below: float | None = None) -> IdentifiedNoise:
        key = hashlib.sha256(np.ascontiguousarray(readings).tobytes()).hexdigest(), interval, below
        if key not in known:
            known[key] = identify_noise(readings, interval, below)
        return known[key]

    monkeypatch.setattr("mcnav.studies.identify.identify_noise", identify)


@pytest.mark.slow
@pytest.mark.usefixtures("identified_once")
@pytest.mark.parametrize("page", FOLLOWED)
def test_a_page_is_followed(page: str, tmp_path: Path) -> None:
    (tmp_path / "campaigns").symlink_to(ROOT / "campaigns")
    text = page_text(page)
    assert follow(text, tmp_path).done > 0
    assert {block.language for block in blocks(text)} <= LANGUAGES
    assert all(len(line) <= 160 for line in text.splitlines())


@pytest.mark.parametrize(
    "page", ["../README.md", *(file for page, file in PAGES.items() if page not in (*FOLLOWED, "questions"))]
)
def test_no_code_of_another_page_is_left_out(page: str) -> None:
    text = (ROOT / "mcnav" / page).read_text(encoding="utf-8")
    assert {block.language for block in blocks(text)} == ELSEWHERE.get(page, set())
    assert text.count("\n```") == 2 * len(blocks(text))


@pytest.mark.parametrize(
    ("shown", "printed"),
    [
        ("sigma 1.25 m", "sigma 1.27 m"),
        ("sigma 1.25 m", "sigma 1.25 km"),
        ("a\nc", "a\nb\nc"),
        ("a", "a\nb"),
        ("a\n…\nd", "a\nb\nc"),
        ("", "a"),
    ],
)
def test_what_is_shown_must_be_printed(shown: str, printed: str) -> None:
    assert missing_line(shown, printed) is not None


@pytest.mark.parametrize(
    ("shown", "printed"),
    [("sigma 1.25 m", "sigma   1.26 m\n"), ("a\n…\nc", "a\nb\nc\n\n"), ("a …\n…", "a b c\nd\n"), ("", "\n")],
)
def test_what_is_left_out_is_marked(shown: str, printed: str) -> None:
    assert missing_line(shown, printed) is None


def test_exponents_have_the_unit_of_their_last_digit() -> None:
    assert same_text("1.2e-3", "1.3e-3")
    assert not same_text("1.2e-3", "1.4e-3")
