"""Every kind of page: its figures visible and whole, silent, self-contained, readable by everyone and on paper."""

from __future__ import annotations

import shlex
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mcnav.report.document.page_head import page_head
from mcnav.workflow import index
from tests.browser.accessibility import CONTRAST, answers, faint_labels, faint_texts, unexplained
from tests.browser.conftest import FOLDER, KINDS, NAME, Browser
from tests.commands import invoke

FIGURES = {
    "report": 13, "many": 9, "aided": 17, "replay": 1, "comparison": 4, "index": 0, "start times": 6, "linearity": 3,
    "ins start times": 11, "lincov": 5, "bent": 3, "allocate": 2, "sweep": 2, "contours": 2,
    "calibration": 19, "story": 12, "textbook": 0, "tn": 16, "ukfm": 1, "trajectory": 1,
}  # fmt: skip
SAID = {
    "bent": "From polar to cartesian coordinates", "comparison": FOLDER, "story": "The Story of 84 Minutes",
    "calibration": "Calibration", "index": "Runs", "textbook": "Published numbers", "ukfm": "The benchmark of ukfm",
}  # fmt: skip
"""What the heading of a page says where it is not the campaign's name."""

PRINTED = {"report", "many", "aided", "textbook"}
"""Pages of which Chromium makes a PDF: with figures, with many figures, with aiding, and with tables alone."""

TEXTS = """() => {
  const wrong = [];
  document.querySelectorAll("figure svg").forEach((svg) => {
    const box = svg.getBoundingClientRect();
    const name = svg.getAttribute("aria-label");
    svg.querySelectorAll("text").forEach((text) => {
      const own = text.getBoundingClientRect();
      const out = Math.max(box.left - own.left, own.right - box.right, box.top - own.top, own.bottom - box.bottom);
      if (out > 1.5) wrong.push(["cut", name, text.textContent]);
    });
    svg.querySelectorAll("g.x, g.y, g.labels").forEach((axis) => {
      const level = (each) => !/rotate\\(-30/.test(each.getAttribute("transform") || "");
      const boxes = Array.from(axis.querySelectorAll("text")).filter(level)
        .map((each) => [each.textContent, each.getBoundingClientRect()]);
      boxes.forEach(([text, a], i) => boxes.slice(i + 1).forEach(([other, b]) => {
        const width = Math.min(a.right, b.right) - Math.max(a.left, b.left);
        const height = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
        if (width > 1 && height > 3) wrong.push(["overlapping", name, text, other]);
      }));
    });
  });
  return wrong;
}"""
"""Labels of axes and in plots that overlap, and any text that reaches beyond its figure."""

SHORTENED = """() => {
  const others = "tbody tr:nth-child(n + 6), details.data tbody tr:nth-child(n + 3), svg > g";
  Array.from(document.querySelectorAll(others)).forEach((each) => each.remove());
}"""
"""Leave to axe of long tables the first rows, which the others are like, and of figures their names and roles.

Taking the rest out of the page costs a tenth of excluding it, for which axe compares every element with each exclusion.
"""

UNREACHABLE = """() => Array.from(document.querySelectorAll("body *")).filter((each) => {
  const style = getComputedStyle(each);
  const scrolls = (overflow, content, box) => ["auto", "scroll"].includes(overflow) && content > box + 1;
  return (scrolls(style.overflowX, each.scrollWidth, each.clientWidth)
    || scrolls(style.overflowY, each.scrollHeight, each.clientHeight))
    && each.tabIndex < 0 && !each.querySelector("a[href], button, input, select, summary, [tabindex='0']");
}).map((each) => each.outerHTML.slice(0, 80))"""
"""What scrolls and cannot be scrolled from the keyboard."""

PAPER = 688
"""Width of a page of A4 without its margins, pixels."""

DARK = ("report", "aided", "calibration", "story")
"""Pages that show every colour there is between them."""

WITHOUT_SCRIPTS = (*DARK, "many", "comparison", "sweep", "tn")
"""Pages that have every kind of figure and control between them."""


def _unfold(page: Any) -> None:
    page.evaluate("document.querySelectorAll('details').forEach(each => each.open = true)")


def _every_figure_is_shown(page: Any, kind: str, width: int) -> None:
    assert page.locator("figure").count() == FIGURES[kind]
    boxes = page.locator("figure .plot:not([hidden]) svg").evaluate_all(
        "all => all.map(each => each.getBoundingClientRect().toJSON())"
    )
    assert len(boxes) >= FIGURES[kind]
    for box in boxes:
        assert box["width"] > 200
        assert box["height"] > 80
        assert box["right"] <= width
    assert page.locator("figure details.data table").count() == page.locator("figure:not([id^=figure-first-])").count()
    assert SAID.get(kind, NAME) in page.locator("h1").inner_text()


def _every_table_fits(page: Any) -> None:
    """No table outside of the data of figures is wider than its section, everything unfolded."""
    wide = page.evaluate("""() => Array.from(document.querySelectorAll(".scroll"))
      .filter((each) => !each.closest("details.data") && each.scrollWidth > each.clientWidth)
      .map((each) => `${each.textContent.trim().slice(0, 60)}: ${each.scrollWidth - each.clientWidth}`)""")
    assert wide == []


def _every_key_hides_its_series(page: Any) -> None:
    """Every entry of every key stands for something in its figure, hides it, and shows it again."""
    missing = page.evaluate("""() => Array.from(document.querySelectorAll("figure .key li"))
      .filter((each) => !each.closest("figure").querySelector(`.plots .series-${each.dataset.series}`))
      .map((each) => `${each.closest("figure").id}: ${each.textContent}`)""")
    assert missing == []
    left = page.evaluate("""() => Array.from(document.querySelectorAll("figure .key button")).filter((each) => {
      const name = each.closest("li").dataset.series;
      const shown = () => Array.from(each.closest("figure").querySelectorAll(`.series-${name}`))
        .filter((one) => getComputedStyle(one).display !== "none").length;
      const before = shown();
      each.click();
      const hidden = shown() === 0;
      each.click();
      return !hidden || shown() !== before;
    }).length""")
    assert left == 0


def _fits_on_paper(page: Any, kind: str) -> None:
    """No plot is cut by a page's end or wider than it; the heading of a table may stand on every page."""
    page.emulate_media(media="print")
    assert kind not in PRINTED or page.pdf(format="A4").startswith(b"%PDF")
    breaks = page.locator(".plot").evaluate_all("all => all.map(each => getComputedStyle(each).breakInside)")
    assert set(breaks) <= {"avoid"}
    assert page.evaluate("document.documentElement.scrollWidth") <= PAPER
    assert set(page.locator(".sort").evaluate_all("all => all.map(e => getComputedStyle(e).display)")) <= {"contents"}
    page.emulate_media(media="screen")


def _is_for_everyone(page: Any, kind: str) -> None:
    """Find nothing serious by axe with everything unfolded: names, roles, headings, tables; contrast in the dark, too.

    What axe leaves open is judged here, or explained in `tests.browser.accessibility`. Most of the page is gone then.
    """
    assert page.evaluate(UNREACHABLE) == []
    schemes = ("light", "dark") if kind in DARK else ("light",)
    assert faint_labels(page, schemes) == []
    page.evaluate(SHORTENED)
    told = answers(page, {"rules": {CONTRAST: {"enabled": False}}})
    found = told["violations"]
    assert unexplained(page, told["incomplete"]) == []
    assert [(each["id"], each["nodes"][0]["html"]) for each in found if each["impact"] in ("serious", "critical")] == []
    assert faint_texts(page, schemes) == []


@pytest.mark.parametrize("kind", KINDS)
def test_on_paper_and_on_a_screen_for_everyone(browser: Browser, page_of: Callable[[str], Path], kind: str) -> None:
    """Printed, in a hand and, with the window made larger, at a desk; ids are unique, labels whole and apart.

    At a desk tables are whole as well, keys hide their series, and everyone can read and use the page. Some pages are
    opened without JavaScript, too. A page is opened once for all that does not ask for this: Chromium takes a second.
    """
    head = page_head(page_of(kind).read_bytes()[: index.BEGINNING].decode("utf-8", errors="replace"))
    assert head is not None
    assert head.kind  # what `mcnav report --index` lists of it
    assert head.heading
    with browser.opened(page_of(kind), PAPER) as page:
        _fits_on_paper(page, kind)
        for width in (380, 1280):
            page.set_viewport_size({"width": width, "height": 900})
            _every_figure_is_shown(page, kind, width)
            assert page.evaluate(TEXTS) == []
            _unfold(page)
            assert page.evaluate("document.documentElement.scrollWidth") <= width
        identifiers = page.evaluate("Array.from(document.querySelectorAll('[id]')).map(each => each.id)")
        assert len(identifiers) == len(set(identifiers))
        _every_table_fits(page)
        _every_key_hides_its_series(page)
        _is_for_everyone(page, kind)
    if kind in WITHOUT_SCRIPTS:
        with browser.opened(page_of(kind), 380, scripts=False) as page:
            _every_figure_is_shown(page, kind, 380)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_one_faint_text_is_found(browser: Browser, page_of: Callable[[str], Path], scheme: str) -> None:
    """The last of several texts that look the same, which is faint in one scheme, is the only one that is named."""
    grey = {"light": "#aaaaaa", "dark": "#444444"}[scheme]
    with browser.opened(page_of("comparison"), 1280) as page:
        page.add_style_tag(content=f"@media (prefers-color-scheme: {scheme}) {{ .faint {{ color: {grey}; }} }}")
        alike = page.locator("summary > .title")
        assert alike.count() > 2
        faint = alike.last.evaluate("each => { each.classList.add('faint'); return each.outerHTML; }")
        assert faint_texts(page) == [faint]


def test_one_of_many_pairs_is_chosen(browser: Browser, page_of: Callable[[str], Path]) -> None:
    """Without JavaScript all pairs are there; with it some, one, or all."""
    with browser.opened(page_of("many"), 1280, scripts=False) as page:
        assert page.locator("#figure-scatter .plot").evaluate_all("all => all.every(each => each.offsetHeight > 0)")
        count = page.locator("#figure-scatter .plot").count()
    assert count == 36
    with browser.opened(page_of("many"), 1280) as page:
        shown = page.locator("#figure-scatter .plot:visible")
        assert 1 < shown.count() < count
        chosen = page.locator("#figure-scatter").get_by_label("Show")
        chosen.select_option("position north and attitude down")
        assert shown.count() == 1
        assert shown.locator("svg").get_attribute("data-y-label") == "attitude down"
        chosen.select_option(f"all {count}")
        assert shown.count() == count


def test_the_same_bytes_again(page_of: Callable[[str], Path], tmp_path: Path) -> None:
    for kind in ("calibration", "linearity"):
        assert KINDS[kind](tmp_path, page_of).read_bytes() == page_of(kind).read_bytes()


def test_two_ticked_runs_are_compared(browser: Browser, page_of: Callable[[str], Path], tmp_path: Path) -> None:
    """The command that stands there is accepted, and writes the page that is linked from then on."""
    for name in ("first one/run", "second/run"):
        shutil.copytree(page_of("report").parent, tmp_path / name)
    (tmp_path / "none").mkdir()
    written, *_ = index.write_index(tmp_path)
    with browser.opened(written, 1280) as page:
        boxes, said = page.locator("input.pick"), page.locator("[data-compare]")
        assert boxes.count() == 2
        boxes.last.check()
        assert said.inner_text() == ""
        boxes.first.check()
        assert said.locator("a").count() == 0
        command = said.locator("code").inner_text()
        assert command == "mcnav compare second/run 'first one/run' --out ."
        boxes.last.uncheck()
        assert said.inner_text() == ""
    done = invoke(*shlex.split(command)[1:], cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    index.write_index(tmp_path)
    with browser.opened(written, 1280) as page:
        for box in (page.locator("input.pick").last, page.locator("input.pick").first):
            box.check()
        assert page.locator("[data-compare] a").get_attribute("href") == "second-run_and_first%20one-run.html"
        assert (tmp_path / "second-run_and_first one-run.html").exists()
        assert page.locator("#all-studies tbody tr").count() == 1
