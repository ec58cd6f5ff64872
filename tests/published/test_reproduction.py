"""The reproduction of NASA TN D-1772 counts every printed number, and knows why some do not agree."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from mcnav.reproduce import page
from mcnav.reproduce.printed import SUMS, final_errors, sums
from mcnav.reproduce.tn_d1772 import CASES, CONTRADICTIONS, SUM_NAMES, Cell, Mark, all_cells
from tests.conftest import ROOT


@pytest.fixture(scope="module")
def cells() -> list[Cell]:
    return all_cells()


def test_every_printed_number_has_a_computed_one(cells: list[Cell]) -> None:
    """Table I: 7 x 7; III: 7 x 6; the others: their runs and four sums, four columns each."""
    runs = sum(len(final_errors(case.table)) + len(SUMS) for case in CASES)
    assert len(cells) == 7 * 7 + 7 * 6 + 4 * runs
    assert all(np.isfinite(cell.computed) for cell in cells)


def test_what_does_not_agree_has_a_reason(cells: list[Cell]) -> None:
    for cell in cells:
        if cell.mark in (Mark.INCONSISTENT, Mark.DIFFERS):
            assert cell.reason, cell


def test_no_reason_is_given_for_what_agrees(cells: list[Cell]) -> None:
    """A listed contradiction is one that the numbers show."""
    listed = [cell for cell in cells if cell.contradicted]
    assert len(listed) == len(CONTRADICTIONS)
    assert all(cell.mark == Mark.INCONSISTENT for cell in listed)


@pytest.mark.parametrize(
    ("table", "name", "column", "total"),
    [("II(a)", "equipment", 3, 11.80), ("II(a)", "all", 3, 15.44), ("IV(b)", "algebraic", 1, -358.86)],
)
def test_contradictions_by_the_printed_numbers_alone(table: str, name: str, column: int, total: float) -> None:
    """The printed runs sum to something other than the printed sum: no computation of ours is needed to see it."""
    runs = np.array(final_errors(table), dtype=float)[:10, column]
    summed = {"equipment": np.abs(runs[4:]).sum(), "all": np.abs(runs).sum(), "algebraic": runs.sum()}[name]
    assert summed == pytest.approx(total, abs=0.005)
    assert float(sums(table)[name][column]) != pytest.approx(total, abs=0.5)


def test_page_and_table(cells: list[Cell]) -> None:
    text = page.render("NASA TN D-1772", cells)
    assert text.count('class="digits"') + text.count('class="tolerance"') > 800
    assert len(page.table(cells)) == len(cells)
    for name in SUM_NAMES.values():
        assert name in text


def test_the_readme_counts_right(cells: list[Cell]) -> None:
    counted = Counter(cell.mark for cell in cells)
    agree = counted[Mark.DIGITS] + counted[Mark.TOLERANCE]
    said = f"{agree} agree, {counted[Mark.INCONSISTENT]} are contradicted by the report itself, {counted[Mark.DIFFERS]}"
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert f"all {len(cells)} printed numbers" in text
    assert said in text
