"""The flight deck in headless Chromium: one instant for all figures over time, by slider, pointer, keys and address."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.browser.conftest import Browser

SIZES = """() => Array.from(document.querySelectorAll("#figure-deck .key li")).slice(0, 3).map(({ dataset }) => {
  const svg = document.querySelectorAll("#figure-deck svg")[1];
  const scale = ["x", "y"].map((name) => svg.getAttribute(`data-${name}`).split(" ").map(Number));
  let at = [0, 0];
  const points = Array.from(svg.querySelector(`.marks .series-${dataset.series}`).getAttribute("d").matchAll(/([Ml])(-?\\d+) ?(-?\\d+)/g), ([, command, a, b]) => {
    at = command === "M" ? [+a, +b] : [at[0] + +a, at[1] + +b];
    return at.map((v, n) => scale[n][0] + (scale[n][1] - scale[n][0]) * (v - scale[n][2]) / (scale[n][3] - scale[n][2]));
  });
  const [x, y] = [0, 1].map((n) => points.slice(1).reduce((sum, each) => sum + each[n], 0) / (points.length - 1));
  return Math.max(...points.map(([a, b]) => Math.hypot(a - x, b - y)));
})"""  # noqa: E501
"""Longer semi-axes of the ellipses in the panel about the nominal, in radii of its ring."""

CURSORS = """() => Array.from(document.querySelectorAll("svg[data-link]"), (svg) => {
  const [low, high, from, to] = svg.getAttribute("data-x").split(" ").map(Number);
  const at = parseFloat((svg.querySelector(".cursor")?.getAttribute("d") || "M").slice(1));
  return low + (high - low) * (at - from) / (to - from);
})"""
"""Instants at which the figures over time have their line, without zoom."""


def _rows(page: Any) -> list[list[float]]:
    texts = """all => all.map((row) => Array.from(row.cells, (each) => Number(each.textContent)))"""
    return list(page.locator("#figure-deck details.data tbody tr").evaluate_all(texts))


def test_all_figures_follow_one_instant(browser: Browser, page_of: Callable[[str], Path]) -> None:
    """Slider, a click in another figure, play; ellipses have the semi-axes of the table, the sentence is the instant's.

    A polygon of 72 corners and coordinates of a twentieth of a pixel keep 2e-3 of an axis of some 50 pixels.
    """
    with browser.opened(page_of("aided")) as page:
        page.wait_for_selector(".clock")
        rows, slider = np.array(_rows(page)), page.get_by_role("slider", name="Instant")
        shows, ring = (
            page.locator("#figure-deck .shows"),
            page.locator("#figure-deck svg").nth(1).locator(".labels text"),
        )
        assert rows[[0, -1], 0].tolist() == [5.0, 15.0]  # of the trajectory: navigation starts at 300 s
        begun = int(slider.input_value())
        assert rows[begun, 1] == pytest.approx(rows[1:, 1].max(), rel=1e-5)
        assert np.isnan(np.array(page.evaluate(CURSORS), dtype=float)).sum() > 0  # those of other figures, until asked
        for key, place in (("Home", 0), ("ArrowRight", 1), ("End", len(rows) - 1)):
            slider.press(key)
            shown = (slider.get_attribute("aria-valuetext") or "").split()[0]
            assert float(shown) == pytest.approx(rows[place, 0], abs=0.06)
            assert shows.inner_text().startswith(f"At {shown} min, the 95 % ellipse of the navigation error is ±")
            radius = float((ring.text_content() or "").removesuffix(" m"))
            np.testing.assert_allclose(radius * np.array(page.evaluate(SIZES)), rows[place, 1::2], rtol=2e-3)
            np.testing.assert_allclose(page.evaluate(CURSORS), rows[place, 0], atol=2e-3)
        other = page.locator("#figure-envelopes svg, #figure-errors svg").first
        other.scroll_into_view_if_needed()
        box = other.bounding_box()
        page.mouse.click(box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])
        at = page.evaluate(CURSORS)
        assert 0.2 * rows[-1, 0] < at[0] < 0.8 * rows[-1, 0]
        np.testing.assert_allclose(at, at[0], atol=2e-3)
        page.get_by_role("button", name="Play").click()
        before = slider.input_value()
        page.wait_for_function(f"() => document.querySelector('.clock input').value !== '{before}'")
        page.get_by_role("button", name="Pause").click()
        page.wait_for_function("() => location.hash.startsWith('#t=')")


def test_a_link_keeps_instant_and_zoom(browser: Browser, page_of: Callable[[str], Path]) -> None:
    address = page_of("aided").as_uri()
    with browser.visited(f"{address}#t=7.4&zoom=3~9", own=(address, "data:")) as page:
        page.wait_for_selector(".clock")
        assert page.locator(".clock output").inner_text() == page.get_by_role("slider", name="Instant").get_attribute(
            "aria-valuetext"
        )
        assert float(page.locator(".clock output").inner_text().split()[0]) == pytest.approx(7.4, abs=0.2)
        assert (
            page.locator("svg[data-link] ~ button", has_text="Whole range").count()
            == page.locator("svg[data-link]").count()
        )
        page.locator(".clock input").press("ArrowRight")
        page.wait_for_function("() => !location.hash.startsWith('#t=7.4&')")
        assert re.fullmatch(r"#t=[\d.]+&zoom=3~9", page.evaluate("location.hash"))


def test_a_figure_of_the_worst_instant_without_script(browser: Browser, page_of: Callable[[str], Path]) -> None:
    with browser.opened(page_of("aided"), scripts=False) as page:
        figure = page.locator("#figure-deck")
        assert figure.locator(".series-now").count() == 3
        worst = figure.locator("svg").first.get_attribute("aria-label").split(" at ")[-1]
        assert figure.locator(".shows").inner_text().startswith(f"At {worst}, ")
        assert page.locator(".clock").count() == 0
