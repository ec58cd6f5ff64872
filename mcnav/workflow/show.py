"""Show a finished run from its summary; nothing is analysed or simulated."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from rich.console import RenderableType

from mcnav.analysis.summary import Summary
from mcnav.errors import RunFolderError, reading_file
from mcnav.report.columns.result_table import Units
from mcnav.report.columns.result_tables import final_tables
from mcnav.report.exports.export import as_csv, as_json
from mcnav.report.terminal import show
from mcnav.store.run_files import SUMMARY
from mcnav.workflow.stored_summary import summary_of


def show_run(
    folder: Path, table: str | None = None, units: Units = "shown", form: Literal["table", "csv", "json"] = "table"
) -> tuple[str, RenderableType | None]:
    """Return CSV or JSON as text, and what a terminal shows; one of them is empty.

    CSV is that of one table, by default ``outputs``; JSON has all tables by name, or the one asked for.

    Raises
    ------
    RunFolderError
        When there is no finished run, its summary is damaged, or it has no such table.
    """
    run = summary_of(folder)
    with reading_file(folder / SUMMARY):
        summary = Summary.of(show.escaped(run))
        if table is None and form == "table":
            return "", show.show(summary, units)
        tables = final_tables(summary, units)
    if table is not None and table not in tables:
        raise RunFolderError(f"--table: {show.unknown_table(tables, table)}")
    if form == "csv":
        return as_csv(tables[table or "outputs"].rows), None
    if form == "json":
        chosen = tables if table is None else {table: tables[table]}
        return as_json({name: table.rows for name, table in chosen.items()}), None
    return "", show.tabulate(tables[table or "outputs"])
