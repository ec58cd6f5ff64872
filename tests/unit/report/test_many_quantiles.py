"""Many outputs: a page shows the quantiles that matter, and says how many there are."""

from __future__ import annotations

from mcnav.analysis.summary import QuantileEntry
from mcnav.report.columns.percentiles import QuantileRow, prominence
from mcnav.report.document.table import MOST_ROWS, Column, Table

COLUMN = (Column[QuantileRow]("Error", lambda row: row.title),)


def _row(place: int, estimate: float | None, verdict: str) -> QuantileRow:
    entry = QuantileEntry(
        outputs=[f"y{place}"], probability=0.95, estimate=estimate, lower=None, upper=None, linear=1.0, verdict=verdict
    )
    return QuantileRow(entry, 1.0, "m")


def test_a_page_shows_the_quantiles_that_differ_and_those_farthest_from_linear_analysis() -> None:
    """Row 0 differs by least; the others depart by 0.001 a row, and a last one has no estimate."""
    rows = [_row(0, 1.0, "differs"), *(_row(i, 1.0 + 1e-3 * i, "agrees") for i in range(1, 5000)), _row(5000, None, "")]
    table = Table("Quantiles.", COLUMN, rows).foremost(prominence, "quantiles", "those that differ")
    assert table.rows == [rows[0], *rows[5001 - MOST_ROWS : 5000]]
    assert "Of 5,001 quantiles the page shows 300: those that differ. summary.json has all." in table.caption


def test_a_table_of_few_quantiles_is_whole() -> None:
    table = Table("Quantiles.", COLUMN, [_row(i, 1.0, "agrees") for i in range(MOST_ROWS)])
    assert table.foremost(prominence, "quantiles", "") is table
