"""Error budgets of outputs of several kinds: a table each, with the causes that disperse them."""

from __future__ import annotations

import numpy as np

from mcnav.contract.quantities import Output
from mcnav.report.columns.share_table import ShareRow, share_tables
from mcnav.report.document.parts import Sentence
from mcnav.report.document.table import Table

OUTPUTS = [
    Output("x", "m", "m"),
    Output("navigated_x", "m", "m", of="truth"),
    Output("true_x", "m", "m", of="truth"),
    Output("burn", "m/s", "m/s", of="control"),
]
ROWS = [
    ShareRow("gyro", np.array([1.0, 0.0, 0.4, np.nan]), np.array([2.0, 0.0, 1.0, 0.0])),
    ShareRow("wind", np.array([0.0, 1.0, 0.6, np.nan]), np.array([0.0, 3.0, 1.2, 0.0])),
]


def _tables(outputs: list[Output], rows: list[ShareRow]) -> list[Table[ShareRow]]:
    parts = share_tables("Shares.", "Cause", outputs, rows, np.zeros(len(outputs)))
    return [part for part in parts if isinstance(part, Table)]


def test_each_kind_has_a_table_of_its_outputs_and_causes() -> None:
    tables = _tables(OUTPUTS, ROWS)
    assert [table.caption for table in tables] == ["Navigation errors.", "True dispersion.", "Navigation dispersion."]
    assert [[column.heading for column in table.columns[1:]] for table in tables] == [
        ["x, %"], ["true x, %"], ["navigated x, %"],
    ]  # fmt: skip
    assert [[row.name for row in table.rows] for table in tables] == [["gyro"], ["gyro", "wind"], ["wind"]]
    assert [cell.text for cell in tables[1].cells_in("page")[1]] == ["wind", "60.00"]


def test_what_is_not_dispersed_has_no_column() -> None:
    parts = share_tables("Shares.", "Cause", OUTPUTS, ROWS, np.zeros(4))
    assert isinstance(parts[0], Sentence)
    assert not any("burn" in column.heading for table in _tables(OUTPUTS, ROWS) for column in table.columns)


def test_errors_alone_keep_one_table() -> None:
    (table,) = _tables(OUTPUTS[:1], [ShareRow("gyro", np.ones(1), np.ones(1)), ShareRow("wind", np.zeros(1), None)])
    assert (table.caption, len(table.rows)) == ("Shares.", 2)
