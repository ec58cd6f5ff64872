"""The Story of 84 Minutes: every number beside a computed one, the misprints named, hovering, the page."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from mcnav.systems.steady.truth import Error
from mcnav.validation.reproduce.story_of_84_minutes import page as story_page
from mcnav.validation.reproduce.story_of_84_minutes.numbers import (
    HEIGHT,
    PERIOD,
    RADIUS,
    ROUND,
    Number,
    Standing,
    all_numbers,
    hovering,
    simulated,
)
from mcnav.validation.reproduce.story_of_84_minutes.schuler import hover
from tests.conftest import ROOT
from tests.sentences import too_long

PRINTED = {
    ("(a) flat", "range error"): ("287,500", 287_780),
    ("summary, flat", "range error by tilt"): ("288,000", 287_780),
    ("(a) spherical", "amplitude of range error"): ("3,650", 3_649),
    ("(b) flat", "range error"): ("10,120", 10_120),
    ("(b) spherical", "largest range error"): ("805", 805),
    ("(c) flat", "range error"): ("341,000", 164_890),
    ("(d) flat", "range error"): ("1.62e6", 269_660),
    ("(d) spherical", "range error"): ("10,250", 10_258),
    ("(a) flat", "cross-range error by azimuth"): ("4,660", 4_663),
    ("(a) spherical", "cross-range error by azimuth"): ("3,500", 3_494),
    ("Problem 4", "height after 84 min with 1e-4 g"): ("724", 715.4),
    ("footnote a", "period of a climb at 9 g"): ("28", 28.1),
}
"""Printed, and the seed's formula evaluated by hand."""

MISPRINTS = {
    ("summary, spherical", "largest range error by tilt"),
    ("(c) flat", "range error"),
    ("summary, flat", "range error by accelerometer"),
    ("(d) flat", "range error"),
    ("(d) flat", "cross-range error"),
    ("summary, flat", "range error by gyro drift"),
    ("(d) spherical", "reduction by the pendulum"),
    ("Problem 4", "height after 84 min with 1e-4 g"),
}


@pytest.fixture(scope="module")
def numbers() -> tuple[Number, ...]:
    return all_numbers()


def test_printed_and_recomputed_by_hand(numbers: tuple[Number, ...]) -> None:
    """The hand's rounding: its last digit."""
    for (place, quantity), (printed, by_hand) in PRINTED.items():
        found = [each for each in numbers if (each.place, each.quantity) == (place, quantity)]
        assert any(each.printed == printed for each in found), (place, quantity)
        assert any(each.closed == pytest.approx(by_hand, rel=2e-3) for each in found), (place, quantity)


def test_only_misprints_disagree_and_each_has_its_cause(numbers: tuple[Number, ...]) -> None:
    wrong = {(each.place, each.quantity) for each in numbers if each.standing is Standing.MISPRINT}
    assert wrong == MISPRINTS
    assert all(each.remark for each in numbers if each.standing is Standing.MISPRINT)
    assert not any(each.wrong for each in numbers if each.standing is not Standing.MISPRINT)


def test_flights_at_rest_are_the_closed_forms(numbers: tuple[Number, ...]) -> None:
    """To 1e-6 (second-order terms: errors are 1e-4 rad at most); at the zeros after two periods, to 1e-6 ft."""
    for each in numbers:
        if each.flown is None or each.place in ("Problem 4", "footnote a"):
            continue
        assert each.flown == pytest.approx(each.closed, rel=1e-6, abs=1e-5), each
        if each.linear is not None:
            assert each.linear == pytest.approx(each.closed, rel=1e-7, abs=1e-6), each


def test_the_cruising_missile_departs_by_a_few_times_its_correction(numbers: tuple[Number, ...]) -> None:
    """V^2 / g r = 1.03 %. By the end the phase is late by 4 pi 0.52 %, which is 6.5 % of an amplitude."""
    for each in numbers:
        if each.cruising is None or "period" in each.quantity:
            continue
        amplitude = {"ft": 4_182.0, "miles": 0.8}[each.unit] if each.value == 0.0 else abs(each.closed)
        assert abs(each.cruising - each.closed) < 0.065 * amplitude, each


@pytest.mark.parametrize("ratio", [1e-7, -1e-7])
def test_hovering_at_a_small_error(ratio: float) -> None:
    """Within 1e-3 of k R / 2 (cosh(sqrt(2) 2 pi) - 1) after 84 minutes."""
    gravity = ROUND.gravitational_parameter / RADIUS**2
    height = simulated(hovering(PERIOD), Error.BIAS_Z, HEIGHT, -ratio * gravity)
    closed = 0.5 * ratio * RADIUS * (np.cosh(np.sqrt(2.0) * 2.0 * np.pi) - 1.0)
    assert height == pytest.approx(closed, rel=1e-3)
    assert closed == pytest.approx(float(hover(ratio * gravity, 2.0 * np.pi / PERIOD, PERIOD)), rel=1e-12)


def test_hovering_at_the_seeds_error_departs(numbers: tuple[Number, ...]) -> None:
    """Gravity falls off: 8 % less far up, 11 % farther down."""
    (found,) = [each for each in numbers if each.standing is Standing.MISPRINT and each.place == "Problem 4"]
    assert found.flown is not None
    assert 0.90 < found.flown / found.closed < 0.94


def test_page_and_tables(tmp_path: Path) -> None:
    page, *tables = story_page.write(tmp_path)
    text = page.read_text(encoding="utf-8")
    assert text.count("<figure") == 12
    assert "nan" not in text
    for table in tables:
        assert table.name in text
    numbers = pd.read_csv(tmp_path / "numbers.csv")
    assert len(numbers) == len(all_numbers())
    assert numbers["closed form"].notna().all()
    periods = pd.read_csv(tmp_path / "periods.csv")
    assert (periods["difference, share"].abs() < 1e-4).all()
    hovering_table = pd.read_csv(tmp_path / "hover_departure.csv")
    assert hovering_table["pushed up, flown / linear"].iloc[0] == pytest.approx(1.0, abs=1e-3)
    assert hovering_table["pushed up, flown / linear"].iloc[-1] < 0.8


def test_the_chapter_has_the_numbers_of_the_findings(tmp_path: Path) -> None:
    """Every verdict is one of three; the paragraphs on new questions have numbers that the page computes."""
    story_page.write(tmp_path)
    found = pd.read_csv(tmp_path / "findings.csv")
    assert len(found) == 17
    assert set(found["verdict"]) == {"holds", "in part", "does not hold"}
    assert [sentence for text in (*found["said"], *found["found"]) for sentence in too_long(text)] == []
    document = ROOT / "mcnav" / "validation" / "reproduce" / "story_of_84_minutes" / "STORY_OF_84_MINUTES.md"
    chapter = document.read_text(encoding="utf-8").partition("## The claims\n")[2]
    number = r"\d[\d,]*\.?\d*"
    computed = set(re.findall(number, " ".join(found["found"])))
    for opening in ("The gear ratio", "In a boost", "Fly ten times", "Another altitude measuring device is"):
        paragraph = chapter.partition(f"**{opening}")[2].partition("\n**")[0].partition("An altimeter of")[0]
        assert paragraph
        stated = re.findall(rf"({number})(?= (?:miles|minutes|%|m\b|times as great by))", paragraph.partition("**")[2])
        assert {text.rstrip(",") for text in stated} <= computed | {"28", "84", "0.1", "30"}, opening
    frame = pd.read_csv(tmp_path / "reduction.csv").set_index("flight time [min]")
    for line in chapter.splitlines():
        if re.match(r"\| \d", line):
            minutes, *ratios = (float(cell) for cell in line.strip("|").split("|"))
            row = frame.iloc[int(np.abs(frame.index - minutes).argmin())]
            for ratio, computed_ratio in zip(ratios, row, strict=False):
                assert computed_ratio == pytest.approx(ratio, abs=0.5 if ratio >= 10.0 else 0.15)


def test_the_documentation_counts_right(numbers: tuple[Number, ...]) -> None:
    wrong = sum(each.standing is Standing.MISPRINT for each in numbers)
    said = f"the {len(numbers)} printed numbers and the plots of *The Story of 84 Minutes*"
    text = (ROOT / "mcnav" / "docs" / "COMMANDS.md").read_text(encoding="utf-8")
    assert said in text
    assert f"{len(numbers) - wrong} agree, {wrong} are misprinted or miscalculated" in text
