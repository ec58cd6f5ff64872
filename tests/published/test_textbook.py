"""Published numbers of textbooks: every one beside computed ones, those that differ named, the page as committed."""

from __future__ import annotations

from html import unescape
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.linalg import solve_discrete_are

from mcnav.validation.reproduce.textbook import closed_forms, page
from mcnav.validation.reproduce.textbook.free import SHORT
from mcnav.validation.reproduce.textbook.numbers import SOURCES, Agreement, Number
from tests.commands import invoke
from tests.conftest import ROOT
from tests.scalar_filter import steady_variance, true_variance
from tests.tables import assert_same_tables

pytestmark = pytest.mark.slow

DIFFERING = {
    "largest position error for 100 µg",
    "plane of oscillation turns once, 45° latitude",
    "mean drift eastwards for gyro north 0.01 deg/h at 45° latitude",
    "growth of the vertical channel at 45° latitude",
    "the same, time in which it doubles",
    "CEP rate of the system of 10 nmi/h",
    "CEP rate of the system of 0.1 nmi/h",
    "heading for 0.003 deg/√h in 300 s at 45° latitude",
    "liquid, estimate 3",
    "liquid, estimate 5",
    "liquid, estimate 8",
}

COMMITTED = ROOT / "mcnav" / "validation" / "reproduce" / "textbook" / "TEXTBOOK.md"


@pytest.fixture(scope="module")
def numbers() -> tuple[Number, ...]:
    return page.all_numbers()


@pytest.fixture(scope="module")
def folder(numbers: tuple[Number, ...], tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("textbook")
    finished = invoke("reproduce", "textbook", "--out", folder, cwd=folder)
    assert finished.returncode == 0, finished.stderr
    assert finished.stderr == ""
    assert finished.stdout.splitlines()[0] == f"{len(numbers)} published numbers"
    assert f"written: {folder / page.PAGE}" in finished.stdout
    return folder


def test_only_named_numbers_differ_and_each_has_its_cause(numbers: tuple[Number, ...]) -> None:
    differing = [each for each in numbers if each.agreement is Agreement.DIFFERS]
    assert {each.quantity for each in differing} == DIFFERING
    assert all(each.remark for each in differing)
    assert not any(each.remark for each in numbers if each.agreement is Agreement.AGREES)


def test_every_source_is_used_and_every_chapter_has_its_caption(numbers: tuple[Number, ...]) -> None:
    assert {each.source for each in numbers} == set(SOURCES)
    assert list(dict.fromkeys(each.chapter for each in numbers)) == list(page.CAPTIONS)


def test_samples_contain_every_sigma(numbers: tuple[Number, ...]) -> None:
    """Also of numbers that differ: the interval contains the linear result, with a probability of 99.9 % each."""
    for each in numbers:
        if each.interval is not None:
            low, high = each.interval
            assert low <= abs(each.linear) <= high, each


def test_paired_estimates_are_near_the_linear_sigmas(numbers: tuple[Number, ...]) -> None:
    """Second-order terms change a sigma by at most 1 %.

    Angles are milliradians, but for a heading of 3 deg, whose square is 0.3 %; and the largest output of a navigation
    changes the smallest one, a hundredth of it, by its own share of milliradians.
    """
    paired = [each for each in numbers if each.paired is not None]
    assert len(paired) > 50
    for each in paired:
        assert each.paired == pytest.approx(each.linear, rel=0.01), each


def test_the_committed_tables_are_those_of_the_command(folder: Path) -> None:
    assert_same_tables((folder / page.TABLES).read_text(encoding="utf-8"), COMMITTED.read_text(encoding="utf-8"))


def test_counts_and_causes_of_the_documentation(numbers: tuple[Number, ...]) -> None:
    differ = sum(each.agreement is Agreement.DIFFERS for each in numbers)
    text = " ".join(COMMITTED.read_text(encoding="utf-8").split())
    assert f"computes {len(numbers)} of them again" in text
    assert f"{len(numbers) - differ} agree and {differ} differ" in text
    for each in numbers:
        assert each.remark in text
    for source in SOURCES.values():
        assert source in text
    commands = (ROOT / "mcnav" / "docs" / "COMMANDS.md").read_text(encoding="utf-8")
    assert f"{len(numbers)} published numbers" in commands
    assert f"{len(numbers) - differ} agree, {differ} differ" in commands


def test_page_and_csv(numbers: tuple[Number, ...], folder: Path) -> None:
    text = unescape((folder / page.PAGE).read_text(encoding="utf-8"))
    assert text.count('class="digits"') + text.count('class="inconsistent"') == len(numbers)
    for caption in page.CAPTIONS.values():
        assert caption in text
    frame = pd.read_csv(folder / "numbers.csv")
    assert len(frame) == len(numbers)
    assert np.isfinite(frame["linear"]).all()
    assert set(frame["agreement"]) == {"agrees", "differs"}


def test_check_values_by_other_routes(numbers: tuple[Number, ...]) -> None:
    """Matched filters by scipy's Riccati equation, the mismatched one by its scalar formulas: the printed digits."""
    printed = {(each.chapter, each.quantity): each for each in numbers}
    for density, words in ((1.0, "q = 1, r = 2 m"), (0.03 / 60.0, "q = 0.03 m/s/√h, r = 2 m")):
        step, noise = np.array([[1.0, 1.0], [0.0, 1.0]]), np.array([[1.0 / 3.0, 0.5], [0.5, 1.0]]) * density**2
        before = solve_discrete_are(step.T, np.array([[1.0], [0.0]]), noise, np.array([[4.0]]))
        after = before - np.outer(before[:, 0], before[0]) / (before[0, 0] + 4.0)
        for place, quantity in enumerate(("position", "velocity")):
            number = printed["matched filter", f"{quantity}, {words}"]
            assert number.value == pytest.approx(np.sqrt(after[place, place]), abs=number.half_digit)
    own = steady_variance(0.25)
    for quantity, value in (("its variance, it says", own), ("its variance, true", true_variance(own / 4.0))):
        number = printed["mismatched filter", quantity]
        assert number.value == pytest.approx(value, abs=number.half_digit)


def test_walks_by_the_course_are_those_of_the_checks() -> None:
    """Printed digits of 0.1 deg/sqrt(h) and 0.03 m/s/sqrt(h) after ten minutes."""
    assert 9.80665 * closed_forms.integrated_walk(np.radians(0.1) / 60.0, 3, SHORT) == pytest.approx(562.4837, abs=5e-5)
    assert closed_forms.integrated_walk(0.03 / 60.0, 2, SHORT) == pytest.approx(4.2426, abs=5e-5)
    assert np.degrees(closed_forms.integrated_markov(np.radians(1.0) / 3600.0, 3600.0, SHORT)) == pytest.approx(
        0.162163, abs=5e-7
    )
