"""A page as data: one definition of a column for HTML and the terminal, and texts that are escaped in both."""

from __future__ import annotations

import re
from dataclasses import dataclass
from urllib.parse import unquote
from xml.etree import ElementTree

import pytest
from markupsafe import Markup
from rich.console import Console

from mcnav.report.document.formulas import NEES, PAIRED, SAMPLING, SHARE
from mcnav.report.document.html import page_html, parts_html
from mcnav.report.document.parts import (
    Answers,
    Facts,
    Findings,
    Folded,
    Heading,
    Lines,
    Note,
    Page,
    Part,
    Section,
    Sentence,
    Tile,
    Tiles,
    Verdict,
    folded,
    headed,
    joined,
)
from mcnav.report.document.table import CODE, Cell, Column, Table, five_digits
from mcnav.report.document.terminal_parts import printed


@dataclass(frozen=True)
class Row:
    name: str
    size: float | None
    finding: str = "met"


COLUMNS: list[Column[Row]] = [
    Column("Output", lambda row: Cell(row.name, "km"), "output", "label"),
    Column("Size", lambda row: row.size, "size", form=five_digits),
    Column("Finding", lambda row: Cell(row.finding, tone="agrees", below="at the end"), "finding", "label"),
    Column("path", lambda row: CODE(row.name), kind="text", place="terminal"),
    Column("Remark", lambda row: "long", kind="words", place="page"),
]
ROWS = [Row("range", 1234.56), Row("<b>", None)]


def table(columns: list[Column[Row]] = COLUMNS, rows: list[Row] = ROWS) -> Table[Row]:
    return Table("Sizes.", columns, rows, "Sizes, 1σ")


def text(*parts: Part) -> str:
    console = Console(width=120)
    with console.capture() as captured:
        console.print(printed(parts))
    return captured.get()


def test_a_column_is_shown_on_the_page_and_in_the_terminal() -> None:
    shown, lines = parts_html([table()]), text(table()).splitlines()
    assert re.findall('<th scope="col"[^>]*>(.*?)</th>', shown) == ["Output", "Size", "Finding", "Remark"]
    assert lines[0] == "Sizes, 1σ"
    assert lines[1].split() == ["output", "size", "finding", "path"]
    assert '<th scope="row">range <span class="unit">km</span></th><td>1,234.6</td>' in shown
    assert '<td><span class="tag agrees">met</span><br><small>at the end</small></td><td class="words">' in shown
    assert lines[2].split() == ["range", "[km]", "1,234.6", "met", "range"]


def test_only_markup_is_markup() -> None:
    assert "&lt;b&gt;" in parts_html([table()])
    assert parts_html([Sentence("<b>"), Note(CODE("<b>"))]).split() == [
        "<p>&lt;b&gt;</p>", "<p", 'class="note"><code>&lt;b&gt;</code></p>',
    ]  # fmt: skip
    assert text(Sentence("<b>"), Note(Markup("{} &amp; c").format(CODE("<i>")))).splitlines() == ["<b>", "<i> & c"]


def test_cells_that_cover_others() -> None:
    """One above covers the second row's first cell; one covers the rest of its row. The terminal shows all."""
    first: Column[int] = Column("First", lambda k: Cell("one", rows=2 - 2 * k))
    second: Column[int] = Column("Second", lambda k: Cell("wide", columns=2) if k else Cell("two"))
    covering = Table("", [first, second, Column("Third", lambda k: "three")], [0, 1])
    shown = [[cell.text for _, cell in cells] for _, _, cells in covering.placed()]
    assert shown == [["one", "two", "three"], ["wide"]]
    assert 'rowspan="2"' in parts_html([covering])
    assert 'colspan="2"' in parts_html([covering])
    assert text(covering).split()[3:] == ["one", "two", "three", "one", "wide", "three"]


def test_rows_have_the_verdict_by_which_they_are_chosen() -> None:
    chosen = Table("", COLUMNS, ROWS, name="all", verdict=lambda row: "agrees" if row.size else "differs")
    shown = parts_html([chosen])
    assert re.findall('data-verdict="(.*?)"', shown) == ["agrees", "differs"]
    assert 'data-filters="all"' in shown
    assert '<table id="all">' in shown


def test_sections_are_listed_and_tables_can_be_reached_by_keyboard() -> None:
    sections = [Section("a", "First", [table(), Folded("More", [table()])]), Section("b", "Second", [Heading("Third")])]
    page = page_html(Page("title <", "kind", "heading", [Verdict("Yes.", "agrees", ["Because."])], sections))
    assert '<li><a href="#a">First</a></li>' in page
    assert '<a href="#b">Second</a>' in page
    assert page.count('tabindex="0" role="group" aria-label="Table ') == 2
    assert "<title>title &lt; – mcnav</title>" in page
    assert '<div class="verdict agrees"><p class="headline">Yes.</p><p>Because.</p></div>' in page
    assert re.search(r"<details>\s*<summary>More</summary>", page)


def test_tiles_say_what_they_are_on_and_where_there_is_more() -> None:
    """Answer, number, sentence, link; warnings below all of them name their tile; the window's title and icon."""
    worst = Tile("Filter", "optimistic", "differs", "It is <so>.", "13.1", "of tilt", link="filter",
                 details=["Why."], warnings=["Mind it."], further=[("Causes", "budget")])  # fmt: skip
    shown = parts_html([Tiles([worst, Tile("Linear analysis", "holds", "agrees", "Yes.")])])
    assert shown.count('role="group"') == 2
    assert '<a href="#filter">Filter</a> <span class="tag">optimistic</span>' in shown
    assert shown.count('<p class="further">') == shown.count('<a href="#budget">Causes') == 1
    assert "<strong>13.1</strong> of tilt</p>" in shown
    assert shown.count("It is &lt;so&gt;.") == shown.count("<details>") == 1
    assert '<p class="warning">Mind it.</p>' in shown
    page = page_html(Page("title", "kind", "heading", status="Filter optimistic", tone="differs"))
    assert "<title>Filter optimistic – title – mcnav</title>" in page
    assert 'rel="icon"' not in page_html(Page("title", "kind", "heading"))


@pytest.mark.parametrize(("tone", "colour"), [("agrees", "#0a7a55"), ("differs", "#c2350a"), ("undecided", "#a87400")])
def test_the_icon_of_the_window_has_the_colour_of_the_worst_answer(tone: str, colour: str) -> None:
    page = page_html(Page("title", "kind", "heading", status="x", tone=tone))
    (address,) = re.findall('<link rel="icon" href="data:image/svg.xml,([^"]*)">', page)
    disc, sign = ElementTree.fromstring(unquote(address))
    assert (disc.get("fill"), sign.get("fill")) == (colour, "none")


def test_the_terminal_leaves_out_what_it_cannot_show() -> None:
    parts = joined(Verdict("No", "differs"), None, Heading("not shown"), Lines("a\n b\n", "Letters"))
    assert text(*parts).splitlines() == ["No", "", "a", " b"]


def test_parts_of_the_report_of_a_run() -> None:
    """Warnings below a verdict, requirements of which there are more, facts below each other, a named text."""
    warned = parts_html([Verdict("No.", "differs", ["Because."], ["Mind <it>."])])
    assert '<p>Because.</p><p class="warning">Mind &lt;it&gt;.</p></div>' in warned
    more = Markup('<a href="#all">and {} more</a>').format(3)
    listed = parts_html([Findings([("met", "agrees", "x below 1 m")], more)])
    assert listed.count("<li>") == 2
    assert '<li><a href="#all">and 3 more</a></li>' in listed
    assert '<dl class="plain"><dt>a</dt><dd>b</dd></dl>' in parts_html([Facts([("a", "b")], below=True)])
    assert '<dl class="facts"><div><dt>a</dt><dd>b</dd></div></dl>' in parts_html([Facts([("a", "b")])])
    assert '<pre tabindex="0" role="group" aria-label="The file"><code dir="auto">a &lt; b</code></pre>' in parts_html(
        [Lines("a < b", "The file")]
    )
    assert '<details class="explained">' in parts_html([Folded("How", [NEES], explains=True)])


def test_what_stands_beside_a_cell_of_a_small_screen() -> None:
    """The heading of a number, another name, or none; an empty cell has none."""
    columns: list[Column[Row]] = [
        Column("Output", lambda row: row.name, kind="label"),
        Column("Size", lambda row: row.size),
        Column("Monte Carlo", lambda row: 1.0, beside="Monte Carlo"),
        Column("Difference", lambda row: 0.5, beside=""),
        Column("Left out", lambda row: ""),
    ]
    shown = parts_html([Answers([Table("", columns, ROWS[:1])], "filtered")])
    assert '<div class="answers filtered">' in shown
    assert re.findall('data-name="(.*?)"', shown) == ["size", "Monte Carlo"]
    assert "data-name" not in parts_html([Table("", columns, ROWS)])


def test_what_there_is_not_has_no_heading() -> None:
    assert headed("Heading", None) == folded("Summary", None) == ()
    assert headed("Heading", None, Sentence("a")) == (Heading("Heading"), Sentence("a"))
    assert folded("Summary", Sentence("a"), None) == (Folded("Summary", (Sentence("a"),)),)


def test_equations_are_what_their_symbols_say() -> None:
    """Without its tags the MathML reads as the equation; every tag is closed."""
    for formula, words in (
        (NEES, "ε=(y−m)T(PSPT)−1(y−m)"),
        (PAIRED, "C^=cov(y)−cov(Ps)+PSPT"),
        (SAMPLING, "cov(y)−PSPT=P(S^−S)PTsampling+12tr(HSHS)second order+third order+remainder"),
        (SHARE, "shareij=Pij2Sjj(PSPT)ii"),
    ):
        assert formula.mathml.striptags() == words
        ElementTree.fromstring(formula.mathml)
