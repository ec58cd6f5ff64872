"""Figures as data: ticks, places of labels, geometry of marks, the same bytes, and no matplotlib but on demand."""

from __future__ import annotations

import re
import subprocess
import sys
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mcnav.config.read import read_campaign
from mcnav.report.drawing import marks as m
from mcnav.report.drawing.figure import HALF, Figure
from mcnav.report.drawing.on_axes import crowded
from mcnav.report.drawing.palette import FLOWN, LINEAR, OTHER, SOURCE_COLOURS, VARIABLES, readable_on
from mcnav.report.drawing.paper import read_size
from mcnav.report.drawing.svg import svg
from mcnav.report.drawing.svg_paths import UNIT
from mcnav.report.drawing.ticks import (  # fmt: skip
    labelled,
    limits,
    linear_ticks,
    log_ticks,
    overlap,
    place_label,
    text_width,
    ticks_along,
)
from mcnav.report.figures.agreement import nees
from mcnav.report.figures.flight import flight
from tests.conftest import ROOT

CURVE, DOTS = m.Series("curve", "a curve", LINEAR), m.Series("dots", "dots", FLOWN, "dot")
BAR = m.Series("bar", "a bar", FLOWN, "area")

LIMITS = st.tuples(st.floats(-1e9, 1e9), st.floats(1e-9, 1e9)).map(lambda pair: (pair[0], pair[0] + pair[1])).filter(
    lambda pair: pair[1] - pair[0] > 1e-9 * abs(pair[0])
)  # fmt: skip


@given(LIMITS, st.integers(1, 10))
def test_linear_ticks(ends: tuple[float, float], most: int) -> None:
    """Within the limits, at multiples of 1, 2, 2.5 or 5, at most one more than intervals."""
    low, high = ends
    ticks, step = linear_ticks(low, high, most)
    assert len(ticks) <= most + 1
    assert all(low - 1e-5 * step <= tick <= high + 1e-5 * step for tick in ticks)
    assert np.allclose(np.diff(ticks), step, rtol=1e-6)
    assert min(abs(step / 10.0 ** np.floor(np.log10(step * 1.000001)) - nice) for nice in (1.0, 2.0, 2.5, 5.0)) < 1e-4
    assert (high - low) / step <= most * (1.0 + 1e-6)


@given(st.floats(1e-8, 1e8), st.floats(1.01, 1e9), st.integers(3, 8))
def test_log_ticks(low: float, ratio: float, most: int) -> None:
    ticks = log_ticks(low, low * ratio, most)
    assert len(ticks) <= most + 1
    assert all(low * (1.0 - 1e-6) <= tick <= low * ratio * (1.0 + 1e-6) for tick in ticks)
    assert ticks == sorted(set(ticks))


@given(LIMITS, st.floats(60.0, 500.0))
def test_labels_of_an_axis_have_room(ends: tuple[float, float], room: float) -> None:
    ticks, labels = ticks_along(*ends, log=False, room=room, extent=lambda text: text_width(text, 11.5))
    places = [(tick - ends[0]) / (ends[1] - ends[0]) * room for tick in ticks]
    for (a, left), (b, right) in zip(
        zip(places, labels, strict=True), list(zip(places, labels, strict=True))[1:], strict=False
    ):
        assert a + 0.5 * text_width(left, 11.5) < b - 0.5 * text_width(right, 11.5) or len(ticks) <= 2


def test_labels_differ_and_keep_their_digits() -> None:
    assert labelled([0.25, 0.5, 0.75], 0.25) == ["0.25", "0.50", "0.75"]
    assert labelled([6371.0005, 6371.001], 0.0005) == ["6,371.0005", "6,371.0010"]
    assert labelled([1e7, 1.5e7], 5e6) == ["1.0·10⁷", "1.5·10⁷"]


@pytest.mark.parametrize(
    ("values", "log"),
    [([], False), ([np.nan], True), ([3.0], False), ([0.0], False), ([-1.0, 0.0], True), ([5.0, 5.0], True)],
)
def test_limits_have_a_length(values: list[float], log: bool) -> None:
    low, high = limits(np.array(values), log, 0.05)
    assert low < high
    assert not log or low > 0.0


@given(st.lists(st.tuples(st.floats(0, 300), st.floats(0, 200)), min_size=1, max_size=30))
def test_labels_do_not_overlap(places: list[tuple[float, float]]) -> None:
    """Each within the picture, none over another; those without room are left out."""
    inside, taken = (0.0, 0.0, 300.0, 200.0), []
    for x, y in places:
        box = place_label(x, y, 30.0, 11.0, inside, taken, np.array(places))
        if box is not None:
            assert inside[0] <= box[0] <= box[2] <= inside[2]
            assert inside[1] <= box[1] <= box[3] <= inside[3]
            assert not any(overlap(box, other) for other in taken)
            taken.append(box)
    assert taken


def _panel(*marks: m.Mark, **options: object) -> str:
    axis = m.Axis("x", "km", low=0.0, high=10.0)
    return str(svg(m.Panel("title", axis, m.Axis("y", low=0.0, high=5.0), marks), *HALF, "key", "Title: title"))


def _scale(text: str, name: str) -> tuple[float, float]:
    """Coordinates of the ends of an axis."""
    found = re.search(rf'data-{name}="\S+ \S+ (\d+) (\d+) 0"', text)
    assert found is not None
    return float(found[1]), float(found[2])


def _points(text: str, name: str) -> np.ndarray:
    """Coordinates of a path of a class."""
    found = re.search(rf'<path class="{name}" d="([^"]+)"', text)
    assert found is not None
    place, points = np.zeros(2), []
    for command, a, b in re.findall(r"([Mml])(-?\d+) ?(-?\d+)", found[1]):
        place = np.array([float(a), float(b)]) + (0.0 if command == "M" else place)
        points.append(place)
    return np.array(points)


@pytest.mark.parametrize("kind", ["line", "points"])
def test_a_known_point_lands_on_its_pixel(kind: str) -> None:
    x, y = np.array([0.0, 2.5, 5.0, 10.0]), np.array([5.0, 0.0, 2.5, 1.0])
    text = _panel(m.Line(CURVE, x, y) if kind == "line" else m.Points(DOTS, x, y))
    (left, right), (bottom, top) = _scale(text, "x"), _scale(text, "y")
    assert left < right <= UNIT * HALF[0]
    assert top < bottom <= UNIT * HALF[1]
    expected = np.column_stack((left + (right - left) * x / 10.0, bottom + (top - bottom) * y / 5.0))
    found = _points(text, f"{kind} series-{'curve' if kind == 'line' else 'dots'}")
    np.testing.assert_allclose(found, expected, atol=1.0)


def test_marks_know_gaps_and_areas() -> None:
    line = re.findall(r' d="(M[^"]*)"', _panel(m.Line(CURVE, [0.0, 1.0, np.nan, 3.0, 4.0], [1.0, 1.0, 1.0, 2.0, 2.0])))
    assert any(path.count("M") == 2 and "l" in path for path in line if "h0" not in path)
    band = _points(_panel(m.Band(BAR, [0.0, 10.0], [1.0, 1.0], [2.0, 3.0])), "band series-bar")
    assert len(band) == 4
    steps = _points(_panel(m.Steps(BAR, [0.0, 5.0, 10.0], [1.0, 2.0])), "steps series-bar")
    assert len(set(steps[:, 0])) == 3
    assert "<title>row, a bar: 20 %</title>" in _panel(m.Bars(BAR, [1.0], [2.0], [4.0], ["row, a bar: 20 %"]))


def test_names_are_escaped_and_long_ones_cut_with_the_whole_as_title() -> None:
    name = "<b>" + 20 * "a very long name "
    text = str(svg(m.Panel("", m.Axis(), m.Axis(names=[name]), [m.Interval(BAR, 0.0, 0.0, 1.0)]), *HALF, "key", "<i>"))
    assert "<b>" not in text
    assert "<i>" not in text
    assert "…" in text
    assert "&lt;b&gt;" + 20 * "a very long name " in text


def test_sixty_series_differ() -> None:
    looks = {(each.colour, each.kind) for each in (m.numbered(k, "") for k in range(60))}
    assert len(looks) == 60
    assert len(set(SOURCE_COLOURS)) == 12


def test_the_same_bytes_again_and_every_colour_a_variable() -> None:
    x = np.random.default_rng(3).standard_normal(20_000)
    texts = {_panel(m.Points(DOTS, 5.0 + x, x[::-1]), m.Rule(3.0, name="event")) for _ in range(2)}
    assert len(texts) == 1
    assert "#" not in texts.pop().replace("url(#key-c)", "")


@pytest.mark.parametrize("misfit", [1.0, 30.0, 1e6])
def test_a_histogram_of_nees_holds_the_samples(misfit: float) -> None:
    """However far they are from what linear analysis expects; chi-square keeps 1 - 5e-4 of its samples in the plot."""
    values = misfit * np.random.default_rng(5).chisquare(4, 20_000)
    content: Any = SimpleNamespace(comparison=SimpleNamespace(ellipsoid=SimpleNamespace(dimension=4, values=values)))
    figure = nees(content)
    assert figure is not None
    counts = np.asarray(figure.columns["samples"])
    assert counts.sum() >= 0.97 * len(values)  # 2 % may lie beyond a linear axis, 1 % below a logarithmic one
    assert np.count_nonzero(counts) >= 10
    assert all(axis.label for panel in figure.panels for axis in (panel.x, panel.y))


def test_on_demand_matplotlib(tmp_path: Path) -> None:
    """Every kind of mark in a file of the width asked for, the same bytes again."""
    marks: list[m.Mark] = [
        m.Span(BAR, 1.0, 2.0), m.Line(CURVE, [1.0, 2.0], [1.0, 2.0]), m.Points(DOTS, [1.0], [2.0], names=["7"]),
        m.Band(BAR, [1.0, 2.0], [0.0, 1.0], [1.0, 2.0]), m.Rule(1.5, name="event"), m.Steps(BAR, [0.0, 1.0], [2.0]),
        m.Text("beyond", corner=True), m.Interval(BAR, 1.0, 0.5, 2.0), m.Bars(BAR, [1.0], [0.0], [2.0], ["a"], ["2"]),
    ]  # fmt: skip
    cells = m.Cells(BAR, CURVE, np.eye(2), [["1", "0"], ["0", "1"]])
    names = m.Axis(names=["a", "b"])
    panels = [m.Panel("one", m.Axis("x", "km"), m.Axis("y"), marks), m.Panel("two", names, names, [cells])]
    figure = Figure("name", "Title", "", panels, [CURVE, DOTS, BAR], {"x": [1.0]})
    assert len(replace(figure, shown=1).figure().axes) == 1 < len(figure.figure().axes)
    made = figure.figure(width=8.0)
    assert made.get_size_inches()[0] == pytest.approx(8.0 / 2.54)
    for ending in ("pdf", "svg", "png"):
        for name in ("first", "again"):
            figure.save(tmp_path / f"{name}.{ending}", width=8.0, font_scale=0.8)
        assert (tmp_path / f"first.{ending}").read_bytes() == (tmp_path / f"again.{ending}").read_bytes()


def paper_figure(panels: int = 4) -> Figure:
    time = np.linspace(0.0, 10.0, 50)
    x, y = m.Axis("time", "min"), m.Axis("position error", "m")
    drawn = [m.Panel(f"panel {k}", x, y, [m.Line(CURVE, time, np.sin(time + k))]) for k in range(panels)]
    return Figure("name", "Title", "", drawn, [CURVE, DOTS, BAR], {"x": [1.0]})


def test_a_figure_of_a_size_for_a_paper(tmp_path: Path) -> None:
    """Exact sizes in points of 1/72 inch; text is text, in fonts that journals take."""
    figure = paper_figure(1)
    width, height = read_size("88x60mm")
    figure.save(tmp_path / "a.svg", width, 0.8, height)
    figure.save(tmp_path / "a.pdf", width, 0.8, height)
    picture = (tmp_path / "a.svg").read_text(encoding="utf-8")
    found = re.search(r'<svg [^>]*width="([\d.]+)pt" height="([\d.]+)pt"', picture)
    assert found is not None
    assert [float(each) for each in found.groups()] == pytest.approx([88.0 / 25.4 * 72, 60.0 / 25.4 * 72], abs=1e-5)
    assert re.findall(r"<text[^>]*>position error \(m\)</text>", picture)
    sizes = {float(size) for size in re.findall(r"font(?:-size)?: ([\d.]+)px", picture)}
    assert sorted(sizes) == pytest.approx([0.8 * 9.0, 0.8 * 10.0])  # a pixel of matplotlib's SVG is a point
    page = (tmp_path / "a.pdf").read_bytes()
    assert b"/Type3" not in page
    assert b"/TrueType" in page or b"/CIDFontType2" in page
    box = re.search(rb"/MediaBox \[ 0 0 ([\d.]+) ([\d.]+) \]", page)
    assert box is not None
    assert [float(each) for each in box.groups()] == pytest.approx([88.0 / 25.4 * 72, 60.0 / 25.4 * 72], abs=1e-3)


def test_panels_and_columns() -> None:
    figure = paper_figure()
    assert [axes.get_title(loc="left") for axes in figure.of_panels("panel 2", "panel 0").figure().axes] == [
        "panel 2",
        "panel 0",
    ]
    places = [axes.get_subplotspec() for axes in figure.figure(columns=1).axes]
    assert [(each.rowspan.start, each.colspan.start) for each in places if each] == [(k, 0) for k in range(4)]
    with pytest.raises(ValueError, match="the figure has no panel 'panel 9'; did you mean 'panel"):
        figure.of_panels("panel 9")


def test_small_figures_have_fewer_ticks_and_narrower_keys() -> None:
    large, small = paper_figure().figure(), paper_figure().figure(width=8.8)
    assert len(small.axes[0].get_xticks()) < len(large.axes[0].get_xticks())
    assert len(paper_figure(1).figure(font_scale=2.0).axes[0].get_yticks()) < len(large.axes[0].get_yticks())
    for figure in (large, small):
        figure.draw_without_rendering()
        (legend,) = figure.legends
        assert legend.get_window_extent().x1 <= figure.bbox.x1


def test_what_does_not_fit_is_told(tmp_path: Path) -> None:
    assert not crowded(paper_figure().figure())
    assert crowded(paper_figure().figure(width=6.0, height=5.0))
    assert crowded(paper_figure(9).figure(width=4.0, height=2.0))
    with pytest.raises(ValueError, match="panels and text do not fit; choose a larger size"):
        paper_figure(9).save(tmp_path / "a.pdf", 4.0, 1.0, 2.0)


@pytest.mark.parametrize("text", ["", "88", "88x60", "x60mm", "88x60px", "1x60mm", "88x2000mm", "-8x6cm", "8e1x6cm"])
def test_sizes_that_are_none(text: str) -> None:
    with pytest.raises(ValueError, match=r"^got .*; expected"):
        read_size(text)


def test_reports_do_without_matplotlib() -> None:
    """Neither the page nor any figure imports it."""
    program = (
        "import sys, mcnav.report.pages.run.page, mcnav.report.pages.start_times, mcnav.report.pages.linearity, "
        "mcnav.report.pages.comparison, mcnav.report.pages.replay, tests.calibration.page, "
        "mcnav.validation.reproduce.tn_d1772.page, mcnav.frames.runs, mcnav.cli, "
        "mcnav.validation.reproduce.story_of_84_minutes.page; sys.exit('matplotlib' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", program], check=False, timeout=120).returncode == 0


def test_a_figure_of_errors_is_not_called_a_flight() -> None:
    """A steady flight shows what each error leaves, and its figure says so; others show the flight itself."""
    cruise = read_campaign(ROOT / "campaigns" / "11_cruise.toml").scenario.nominal()
    reentry = read_campaign(ROOT / "campaigns" / "01_tn_d1772_trajectory_4.toml").scenario.nominal()
    titles = [drawn.title for history in (cruise, reentry) if (drawn := flight(history)) is not None]
    assert titles == ["Errors left by one error alone", "Nominal flight"]


def test_texts_in_bars_are_legible_in_both_schemes() -> None:
    """Every colour of a bar, light and dark, has a contrast of 4.5 with the text in it (WCAG 2.2, 1.4.3)."""

    def luminance(colour: str) -> float:
        channels = np.array([int(colour[i : i + 2], 16) / 255.0 for i in (1, 3, 5)])
        linear = np.where(channels <= 0.04045, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4)
        return float(np.dot([0.2126, 0.7152, 0.0722], linear))

    style = files("mcnav.report.document").joinpath("templates/style.css").read_text(encoding="utf-8")
    parts = style.split("prefers-color-scheme: dark")
    schemes = [dict(re.findall(r"--([\w-]+): (#\w{6});", part)) for part in parts[:2]]
    for colour in (*SOURCE_COLOURS, OTHER):
        for scheme in schemes:
            ends = luminance(scheme[VARIABLES[colour]]), luminance(readable_on(colour))
            assert (max(ends) + 0.05) / (min(ends) + 0.05) >= 4.5, (colour, scheme[VARIABLES[colour]])
