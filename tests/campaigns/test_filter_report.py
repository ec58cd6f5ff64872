"""Pages and tables of runs with a filter: the scalar filter of `tests.scalar_filter`."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from mcnav.report.exports.export import run_rows
from mcnav.workflow.analyse import report_run
from mcnav.workflow.compare import compare_runs
from mcnav.workflow.index import write_index
from mcnav.workflow.run import run_campaign
from mcnav.workflow.stored_summary import stored_summary
from tests import scalar_filter
from tests.conftest import campaign

SENTENCE = "The filter is optimistic by a factor of 1.5"
UNKNOWN = re.compile(r">\s*(nan|inf|None)\b|[\d−]nan|\bnan[\d ]")


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Run a filter that believes in a quarter of the walk, and a scenario without a filter."""
    folder = tmp_path_factory.mktemp("runs")
    run_campaign(scalar_filter.campaign(2_000, name="filtered"), folder / "filtered", None, 1)
    run_campaign(campaign(4, name="plain", samples=100), folder / "plain", "ensemble", 1)
    return folder


def test_the_report_says_it_first(runs: Path) -> None:
    """The verdict is above all folds; it is the same bytes again, and no number is missing."""
    path = runs / "filtered" / "report.html"
    page = path.read_text(encoding="utf-8")
    assert "Do not trust this filter" in page[: page.index('<details class="fold"')]
    assert SENTENCE in page[: page.index("<section")]
    assert "the filter states" in page[: page.index("<section")]
    assert re.findall('<section id="([^"]+)"', page)[0] == "filter"
    assert not UNKNOWN.search(page)
    report_run(runs / "filtered")
    assert path.read_text(encoding="utf-8") == page


def test_a_report_without_a_filter_has_nothing_of_it(runs: Path) -> None:
    page = (runs / "plain" / "report.html").read_text(encoding="utf-8")
    body = re.sub("<(style|script)[ >].*?</(style|script)>", "", page, flags=re.DOTALL)
    assert "filter" not in body.lower()
    assert len(page) < 3_000_000


def test_comparisons_and_indexes_have_a_column(runs: Path) -> None:
    """A column where any run has a filter, a dash in the rows of the others."""
    page = compare_runs([runs / "filtered", runs / "plain"]).page
    assert SENTENCE in page
    written, count, _ = write_index(runs)
    text = written.read_text(encoding="utf-8")
    assert count == 2
    assert 'class="tag differs" title="Do not trust this filter' in text
    for table in (page, text):
        head, *rows = re.findall("<tr.*?</tr>", table[: table.index("</table>")], flags=re.DOTALL)
        cells = [len(re.findall("<t[hd][ >]", row)) for row in (head, *rows)]
        assert len(set(cells)) == 1
    alone = compare_runs([runs / "plain"]).page
    assert "Filter</th>" not in alone


def test_tables_in_full(runs: Path) -> None:
    rows = run_rows({name: stored_summary(runs / name) for name in ("filtered", "plain")})
    assert rows[0]["filter"] == "optimistic"
    assert "filter" not in rows[1]


@pytest.mark.parametrize("changes", [{"failing": range(300)}, {"samples": 12}], ids=["all failed", "few"])
def test_what_cannot_be_decided_is_said_in_words(tmp_path: Path, changes: dict[str, Any]) -> None:
    """Neither a number that is not one, nor an empty figure."""
    changes = {"samples": 300, **changes}
    summary = run_campaign(scalar_filter.campaign(**changes), tmp_path / "run", None, 1).summary
    page = (tmp_path / "run" / "report.html").read_text(encoding="utf-8")
    assert summary["filter_verdict"].startswith("Undecided: ")
    assert summary["filter_verdict"] in page[: page.index("<section")]
    assert not UNKNOWN.search(page)
    assert all("<path" in drawn for drawn in re.findall("<figure.*?</figure>", page, flags=re.DOTALL))
