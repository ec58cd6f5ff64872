"""Places where commands write: ``--out`` is a folder or, of a command that writes one file, the name of that file.

A name is that of a file when it has an ending that mcnav writes, as in ``reports/both.html``.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from mcnav.errors import CampaignError, Problem

ENDINGS: Final = (
    ".csv", ".czml", ".html", ".json", ".mat", ".mcap", ".npz", ".parquet", ".pdf", ".png", ".svg", ".toml", ".txt",
)  # fmt: skip
"""Endings of files, which no folder is given by mistake."""

OF_OTHERS: Final = (
    ".bag", ".bmp", ".doc", ".docx", ".eps", ".gif", ".gpx", ".htm", ".jpeg", ".jpg", ".kml", ".kmz", ".md", ".ps",
    ".tif", ".tiff", ".webp", ".xls", ".xlsx", ".xml", ".zip",
)  # fmt: skip
"""Endings of files that mcnav does not write, and that no folder is given by mistake either."""

OPTION: Final = "--out"


def output_folder(given: Path | None, default: Path) -> Path:
    """Return the folder into which a command writes several files.

    Raises
    ------
    CampaignError
        When a file is named.

    >>> output_folder(None, Path("reports/mine_lincov")).as_posix()
    'reports/mine_lincov'
    """
    if given is None:
        return default
    if given.is_file() or (given.suffix.lower() in (*ENDINGS, *OF_OTHERS) and not given.is_dir()):
        other = given.with_suffix("")
        kind, remedy = ("which is a file; ", "") if other == given else ("", f", such as {other}")
        raise _wrong(given, f"{kind}expected a folder{remedy}")
    return given


def output_file(given: Path, name: str, endings: Sequence[str], option: str = OPTION) -> Path:
    """Return the file that a command writes: the file named by an option or, of a folder, ``name`` in it.

    Raises
    ------
    CampaignError
        When the file that is named has another ending.

    >>> output_file(Path("both.html"), "comparison.html", [".html"]).as_posix()
    'both.html'
    >>> output_file(Path("reports"), "comparison.html", [".html"]).as_posix()
    'reports/comparison.html'
    """
    if given.is_dir():
        return given / name
    if given.suffix.lower() in endings:
        return given
    if given.suffix.lower() in (*ENDINGS, *OF_OTHERS) or given.is_file():
        known = " or ".join([", ".join(endings[:-1]), endings[-1]] if endings[1:] else endings)
        raise _wrong(given, f"expected a folder, or a file that ends in {known}", option)
    return given / name


def _wrong(given: Path, message: str, option: str = OPTION) -> CampaignError:
    return CampaignError([Problem(option, "", f"got {given}; {message}")])
