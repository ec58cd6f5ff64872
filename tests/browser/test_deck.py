"""The flight deck in headless Chromium: one instant for all figures over time, by slider, pointer, keys and address."""

from __future__ import annotations

import json
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
    """A link's instant and zoom; slider, a click in another figure, play; ellipses have the semi-axes of the table.

    A polygon of 72 corners and coordinates of a twentieth of a pixel keep 2e-3 of an axis of some 50 pixels.
    """
    address = page_of("aided").as_uri()
    with browser.visited(f"{address}#t=7.4&zoom=6~9", own=(address, "data:")) as page:
        rows, slider = np.array(_rows(page)), page.get_by_role("slider", name="Instant")
        shows = page.locator("#figure-deck .shows")
        ring = page.locator("#figure-deck svg").nth(1).locator(".labels text")
        assert rows[[0, -1], 0].tolist() == [5.0, 15.0]  # of the trajectory: navigation starts at 300 s
        assert rows[int(slider.input_value()), 0] == pytest.approx(7.4, abs=0.1)
        linked = page.locator("svg[data-link]").count()
        assert page.locator("svg[data-link] ~ button", has_text="Whole range").count() == linked
        slider.press("ArrowRight")
        page.wait_for_function("() => !location.hash.startsWith('#t=7.4&')")
        assert re.fullmatch(r"#t=[\d.]+&zoom=6~9", page.evaluate("location.hash"))
        page.locator("svg[data-link] ~ button").first.evaluate("each => each.click()")
        for key, place in (("Home", 0), ("ArrowRight", 1), ("End", len(rows) - 1)):
            slider.press(key)
            shown = (slider.get_attribute("aria-valuetext") or "").split()[0]
            assert float(shown) == pytest.approx(rows[place, 0], abs=0.06)
            assert shows.inner_text().startswith(f"95 % ellipse of the navigation error at {shown} min: ±")
            radius = float((ring.text_content() or "").removesuffix(" m"))
            np.testing.assert_allclose(radius * np.array(page.evaluate(SIZES)), rows[place, 1::2], rtol=2e-3)
            np.testing.assert_allclose(page.evaluate(CURSORS), rows[place, 0], atol=2e-3)
        other = page.locator("#figure-envelopes svg, #figure-errors svg").first
        other.scroll_into_view_if_needed()
        box = other.bounding_box()
        page.mouse.click(box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])
        at = page.evaluate(CURSORS)
        assert 7.0 < at[0] < 13.0
        np.testing.assert_allclose(at, at[0], atol=2e-3)
        before = slider.input_value()
        play = page.get_by_role("button", name="Play")
        play.evaluate("each => each.click()")
        page.wait_for_function(f"() => document.querySelector('.clock input').value !== '{before}'")
        page.get_by_role("button", name="Pause").evaluate("each => each.click()")
        assert page.evaluate("location.hash").startswith("#t=")


def test_a_figure_of_the_worst_instant_without_script(page_of: Callable[[str], Path]) -> None:
    """It is in the page itself: the instant at which the first ellipse is longest, as a line in three panels."""
    text = page_of("aided").read_text(encoding="utf-8")
    figure = re.search(r'<figure id="figure-deck">.*?</figure>', text, re.DOTALL)
    assert figure is not None
    content = json.loads(re.search(r'<script type="application/json">(.*?)</script>', figure[0], re.DOTALL)[1])  # type: ignore[index]
    worst, rows = content["at"], re.findall(r"<tr><td>([\d.e+-]+)<td>([\d.e+-]+)<td>", figure[0])
    lengths = [float(longest) for _, longest in rows]
    assert lengths[worst] == max(lengths[1:])
    assert figure[0].count("series-now") == 3
    assert f'<span class="shows">{content["words"][worst]}</span>' in figure[0]
    assert content["words"][worst].startswith(
        f"95 % ellipse of the navigation error at {content['instants'][worst]}: ±"
    )
