"""The summary of a finished run, read without its samples."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from mcnav.analysis.summary import Summary
from mcnav.errors import RunFolderError, reading_file
from mcnav.store.run_files import SUMMARY, check_exists, read_summary


def summary_of(path: str | Path) -> dict[str, Any]:
    """Read the summary of a finished run folder, ``path``, as `json.load` does; see `mcnav.analysis.summary.Summary`.

    Raises `RunFolderError` when there is none, or it is damaged.

    Examples
    --------
    >>> import mcnav as mc
    >>> mc.summary_of("reports/first")["samples"]
    200
    """
    folder = Path(path)
    check_exists(folder)
    summary = read_summary(folder)
    if not {"verdict", "outputs", "sigma_linear", "verdict_matrix", "direction_ratio"} <= summary.keys():
        raise RunFolderError(f"{folder / SUMMARY}: is not a summary of this program; run mcnav report on the folder")
    return summary


def stored_summary(path: Path) -> Summary:
    """Read the summary of a finished run folder; `RunFolderError` when there is none, or it is damaged."""
    content = summary_of(path)
    with reading_file(path / SUMMARY):
        return Summary.of(content)
