"""Ratios drawn on the band of the tolerance: where they stand, what is said of them, and that cells have both."""

from __future__ import annotations

import re
from xml.etree import ElementTree

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mcnav.report.document.html import parts_html
from mcnav.report.document.table import Cell, Column, Table
from mcnav.report.drawing.strip import REACH, WIDTH, Strip

SVG = "{http://www.w3.org/2000/svg}"


def strip(ratio: float = 1.0, low: float | None = None, high: float | None = None, tolerance: float = 0.05) -> Strip:
    return Strip(ratio, low, high, tolerance)


@given(
    st.floats(1e-3, 1e3), st.floats(1e-3, 1e3), st.floats(0.001, 0.5)
)  # fmt: skip
def test_a_larger_ratio_stands_farther_right(first: float, second: float, tolerance: float) -> None:
    places = [strip(tolerance=tolerance).place(each) for each in sorted((first, second))]
    assert 0.0 <= places[0] <= places[1] <= WIDTH


@given(st.floats(0.01, 0.3), st.floats(1e-3, 1e3))
def test_what_is_drawn_in_the_band_is_within_the_tolerance(tolerance: float, ratio: float) -> None:
    """The drawing says of every ratio what the tolerance does: a verdict can be read from it."""
    own = strip(tolerance=tolerance)
    low, high = own.place(1.0 - tolerance), own.place(1.0 + tolerance)
    assert 0.0 < low < own.place(1.0) == 0.5 * WIDTH < high < WIDTH
    inside = abs(ratio - 1.0) <= tolerance
    assert (low - 1e-9 <= own.place(ratio) <= high + 1e-9) == inside or abs(abs(ratio - 1.0) - tolerance) < 1e-9


def test_the_scale_is_logarithmic_with_four_tolerances_to_an_end() -> None:
    """Twice as far off in logarithms is twice as far from the middle; what is beyond an end is an arrow."""
    own, end = strip(), 1.05**REACH
    assert [own.place(each) for each in (0.0, 1.0 / end, 1.05**-2, 1.0, 1.05, end, 1e9)] == pytest.approx(
        [0.0, 0.0, 0.25 * WIDTH, 0.5 * WIDTH, 0.5 * WIDTH * (1.0 + 1.0 / REACH), WIDTH, WIDTH]
    )
    assert "l-7 -4" in strip(1.25).svg  # an arrow
    assert "l-7 -4" not in strip(1.2).svg


@pytest.mark.parametrize(
    ("low", "high", "words"),
    [
        (0.96, 1.04, "0.960 to 1.04; within the tolerance, 0.950 to 1.05"),
        (0.96, 1.06, "0.960 to 1.06; partly beyond the tolerance, 0.950 to 1.05"),
        (9.66, 19.6, "9.66 to 19.6; beyond the tolerance, 0.950 to 1.05"),
        (0.5, 0.9, "0.500 to 0.900; beyond the tolerance, 0.950 to 1.05"),
        (1.2, None, "above 1.20; beyond the tolerance, 0.950 to 1.05"),
        (None, None, "no interval; tolerance 0.950 to 1.05"),
    ],
)
def test_words_say_where_the_interval_lies(low: float | None, high: float | None, words: str) -> None:
    assert strip(1.0, low, high).words == words


def test_the_drawing_has_band_interval_and_ratio_where_they_are() -> None:
    own = strip(1.08, 1.03, 1.16)
    drawing = ElementTree.fromstring(str(own.svg).replace("<svg ", '<svg xmlns="http://www.w3.org/2000/svg" '))
    (band,) = drawing.iter(f"{SVG}rect")
    interval = next(each.get("d") for each in drawing if each.get("stroke-width") == "1.8")
    found = re.fullmatch(r"M([\d.]+) 7H([\d.]+)", interval or "")
    assert found is not None
    assert [float(each) for each in found.groups()] == pytest.approx([own.place(1.03), own.place(1.16)], abs=0.05)
    assert float(band.get("x") or 0.0) == pytest.approx(own.place(0.95), abs=0.05)
    assert drawing.get("aria-hidden") == "true"


def test_what_cannot_be_drawn_is_left_out() -> None:
    assert Strip.of(None, (0.9, 1.1), 0.05) is Strip.of(float("nan"), None, 0.05) is Strip.of(1.0, None, None) is None
    assert Strip.of(1.0, (None, float("inf")), 0.05) == strip()


def test_a_cell_has_the_number_the_drawing_and_the_words() -> None:
    """The number first, by which a column sorts; what the drawing shows is there for copies and screen readers."""
    column: Column[Strip] = Column("Ratio", lambda row: Cell("1.08", below="at the end", strip=row), kind="label")
    shown = parts_html([Table("", [Column("Name", lambda _: "x"), column], [strip(1.08, 1.03, 1.16)])])
    words = r"1\.03 to 1\.16; partly beyond the tolerance, 0\.950 to 1\.05"
    below = "<br><small>at the end</small></td>"
    assert re.search(rf'<td>1\.08 <svg class="strip" .*?</svg><span class="hidden"> \({words}\)</span>{below}', shown)
