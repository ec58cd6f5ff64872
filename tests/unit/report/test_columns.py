"""A column of a table is defined once: pages, terminals, data frames, CSV and JSON show it from its definition."""

from __future__ import annotations

import csv
import io
import re
from typing import Any

import pytest
from rich.console import Console

from mcnav.report.columns import output_columns
from mcnav.report.columns.result_table import ResultColumn, ResultTable
from mcnav.report.columns.result_tables import final_tables
from mcnav.report.document.html import page_html
from mcnav.report.document.parts import Page, Section
from mcnav.report.document.table import Column, Table
from mcnav.report.document.terminal_parts import fitted
from mcnav.report.exports.export import as_csv
from mcnav.report.results.filter_summary import filter_entries
from mcnav.report.terminal import terminal
from tests import summaries
from tests.filters import OUTPUTS, consistency

NAMES = [*OUTPUTS]


def run() -> Any:
    """A run with a requirement, a quantile and a filter."""
    count = len(NAMES)
    pair = {"outputs": NAMES[:2], "largest_sigmas": [2.0], "samples_needed": 500}
    quantile = {"outputs": NAMES[:1], "probability": 0.5, "together": [0.9, 1.1], "verdict": "agrees"}
    return summaries.summary(
        sources=[{"name": "bias", "unit": "m"}],
        outputs=[{"name": name, "unit": unit} for name, (unit, *_) in OUTPUTS.items()],
        shown_in={"sources": ["km"], "outputs": [shown for _, (_, shown, _) in OUTPUTS.items()]},
        partials=[[1.0]] * count,
        start_mean=[0.0],
        start_covariance=[[1.0]],
        sigma_linear=[1.0] * count,
        sigma_sample=[1.1] * count,
        sigma_paired=[1.01] * count,
        sigma_ratio=[1.1] * count,
        sigma_ratio_interval=[[1.0, 1.2]] * count,
        sigma_ratio_paired=[1.01] * count,
        sigma_ratio_paired_interval=[[1.0, 1.02]] * count,
        verdicts=["agrees"] * count,
        mean_linear=[0.0] * count,
        mean_sample=[0.0] * count,
        bias=[0.1] * count,
        bias_standard_error=[0.01] * count,
        detectable_ratio_paired=[0.02] * count,
        requirements=[summaries.requirement("not met", **pair)],
        tails=[quantile | dict.fromkeys(("estimate", "lower", "upper", "linear"), 1.0)],
        **{key: [[1.0] * count] * count for key in ("covariance_linear", "covariance_sample", "covariance_paired")},
        budget={"shares": [[1.0]] * count, "cross_terms": [0.0] * count, "contributions": [[1.0]] * count,
                "saved": [[1.0]] * count},
        **filter_entries(consistency(3.3)),
    )  # fmt: skip


def on_page(table: Table[Any]) -> tuple[list[str], int]:
    """Return the headings of a table on a page, and its cells."""
    page = page_html(Page("", "", "", sections=[Section("table", "Table", [table])]))
    body = page[page.index('<section id="table">') :]
    headings = re.findall(r"<th scope=\"col\"[^>]*>(.*?)</th>", body)
    return headings, len(re.findall(r"<t[dh][ >]", body)) - len(headings)


def told(renderable: Any) -> str:
    """Return what a wide terminal shows."""
    console = Console(file=io.StringIO(), width=1_000)
    console.print(renderable)
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


READ = [name for name, table in final_tables(run()).items() if table.read.columns]


def test_these_tables_are_read_by_people() -> None:
    assert set(READ) >= {
        "outputs", "requirements", "allowed_sigmas", "percentiles", "filter_groups", "filter_sigmas", "filter_sensors",
    }  # fmt: skip


@pytest.mark.parametrize("name", READ)
def test_every_medium_shows_the_columns_of_the_definition(name: str) -> None:
    table: ResultTable = final_tables(run())[name]
    page, cells = on_page(table.read)
    assert page == [column.heading for column in table.read.columns_in("page")]
    assert cells == len(page) * len(table)
    assert [column.heading for column in fitted(table.read).columns] == [
        column.terminal_heading for column in table.read.columns_in("terminal")
    ]
    written = csv.reader(io.StringIO(as_csv(table.rows)))
    assert next(written) == list(table.columns) == list(table.frame().columns)
    assert len(list(written)) == len(table) == len(table.read.rows)


def test_a_new_column_of_the_outputs_is_seen_everywhere(monkeypatch: pytest.MonkeyPatch) -> None:
    """As CONTRIBUTING says it is added: one line in the definition."""
    added = ResultColumn[output_columns.OutputEntry](
        "sigma_twice", lambda each: each.at(each.summary.sigma_linear, 2.0),
        (Column("Twice σ", lambda each: each.at(each.summary.sigma_linear, 2.0), "twice σ"),),
    )  # fmt: skip
    monkeypatch.setattr(output_columns, "NUMBERS", (*output_columns.NUMBERS, added))
    summary = run()
    table = final_tables(summary)["outputs"]
    assert "Twice σ" in on_page(table.read)[0]
    assert "twice σ" in told(terminal.comparison({"": summary})).splitlines()[1]
    assert [row["sigma_twice"] for row in csv.DictReader(io.StringIO(as_csv(table.rows)))] == ["2.0"] * len(NAMES)
    assert (table.frame()["sigma_twice"] == 2.0).all()
    assert "sigma_twice" in output_columns.output_rows({"": summary})[0]
    assert (output_columns.outputs_frame(summary)["sigma_twice"] == 2.0).all()
