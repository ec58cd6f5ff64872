"""Write all results of a run for other programs: tables as CSV, matrices for numpy and MATLAB."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from mcnav.errors import reading_file
from mcnav.execution.threads import one_thread
from mcnav.files.whole import write_whole
from mcnav.report.columns.result_table import ResultTable, Units
from mcnav.report.columns.result_tables import final_tables
from mcnav.report.columns.tables_over_time import tables_over_time
from mcnav.report.exports.arrays import arrays, as_mat, as_npz
from mcnav.report.exports.export import as_csv
from mcnav.report.exports.flight import flight_of
from mcnav.report.exports.viewers import WRITERS
from mcnav.report.pages.run.page import figures
from mcnav.report.results.model import RunAnalysis
from mcnav.store.run_folder import RunFolder
from mcnav.workflow.analyse import analyse

CONTENTS: Final = "contents.csv"
"""File that lists the tables."""

FIGURES: Final = "figures"
"""Folder of the numbers behind the figures."""


def result_tables(content: RunAnalysis, units: Units = "shown") -> dict[str, ResultTable]:
    """Return all tables of a run by name: final results, and those over the flight."""
    return final_tables(content.summary.as_stored, units) | tables_over_time(content, units)


def default_folder(path: Path) -> Path:
    """Return the folder beside a run folder that is named after it."""
    named = path if path.name not in ("", "..") else path.resolve()
    return named.with_name(f"{named.name}_export")


def export_run(path: str | Path, folder: str | Path, units: Units = "shown") -> list[Path]:
    """Write the tables of a finished run as CSV, the numbers behind its figures, and its matrices; return the files.

    Parameters
    ----------
    path, folder : str or Path
        Run folder, and where to write.
    units : str
        ``shown`` or ``SI``.

    Raises
    ------
    RunFolderError
        When there is no finished run, or it is damaged.

    Examples
    --------
    >>> import mcnav as mc
    >>> "budget.csv" in {path.name for path in mc.export_run("reports/first", "exported")}
    True
    """
    with one_thread(), reading_file(Path(path)):
        return write_export(analyse(RunFolder(Path(path))), Path(folder), units)


def export_flight(path: str | Path, file: str | Path) -> Path:
    """Write the flight of a finished run for another viewer: true, navigated, and the covariance of the error.

    Parameters
    ----------
    path, file : str or Path
        Run folder, and the file to write: ``.czml`` for Cesium, ``.mcap`` for Foxglove and PlotJuggler.

    Raises
    ------
    RunFolderError
        When there is no finished run, or it has no positions.
    ImportError
        Where the library of the format is not installed.
    """
    written, folder = Path(file), RunFolder(Path(path))
    with reading_file(Path(path)):
        folder.check_exists()
        flight = flight_of(folder)
    content = WRITERS[written.suffix.lower()](flight)
    written.parent.mkdir(parents=True, exist_ok=True)
    write_whole(written, content)
    return written


def write_export(content: RunAnalysis, folder: Path, units: Units = "shown") -> list[Path]:
    """Write the tables, figures and matrices of an analysed run into a folder; return the files.

    Parameters
    ----------
    folder : Path
        Folder of the files, created if necessary: ``NAME.csv`` of each table, ``figures/NAME.csv`` with the numbers
        behind each figure, ``contents.csv``, which lists them, ``matrices.npz`` and ``matrices.mat``.
    units : str
        ``shown`` or ``SI``. Figures are as shown, matrices in SI.
    """
    tables, result = result_tables(content, units), arrays(content)
    by_file = {f"{table.name}.csv": table for table in tables.values()}
    for name, figure in figures(content).items():
        by_file[f"{FIGURES}/{name}.csv"] = ResultTable(name, figure.title, 0, figure.columns)
    listed = [
        {"file": file, "contents": table.title, "rows": len(table), "columns": "; ".join(table.columns)}
        for file, table in by_file.items()
    ]
    files = {CONTENTS: as_csv(listed).encode()} | {file: as_csv(table.rows).encode() for file, table in by_file.items()}
    files |= {"matrices.npz": as_npz(result), "matrices.mat": as_mat(result, f"mcnav: {content.summary.campaign}")}
    for file, written in files.items():
        (folder / file).parent.mkdir(parents=True, exist_ok=True)
        write_whole(folder / file, written)
    return [folder / file for file in files]
