"""Any recorded file as named columns, whatever its format."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Final

from mcnav.files import check_regular
from mcnav.logs.binary_tables import open_mat, open_parquet
from mcnav.logs.log_error import LogError
from mcnav.logs.log_table import LogTable
from mcnav.logs.text_tables import open_text

if TYPE_CHECKING:
    import pandas as pd

LARGEST: Final = 1 << 40
"""Bytes of a file that is opened at all; how many rows are read is limited by `MOST_ROWS`."""

FORMATS: Final = ".csv, .txt, .parquet, .mat, .ulg, .bag, .db3, .mcap, .pos, .nmea, .gpx"
"""Endings of the files that can be read; a file of another ending is looked at."""


def open_table(path: Path, topic: str | None = None) -> LogTable:
    """Open a recorded file, by its content or its ending.

    Parameters
    ----------
    topic : str, optional
        Of a log with several tables: the one that is read.

    Raises
    ------
    LogError
        When there is no such file, or it cannot be read.
    """
    try:
        check_regular(path, LARGEST)
        with path.open("rb") as file:
            beginning = file.read(128)
        size = path.stat().st_size
    except OSError as failure:
        raise LogError(path, _why_unreadable(path, failure)) from None
    if not beginning:
        raise LogError(path, "is empty")
    if beginning.startswith(b"PAR1"):
        return open_parquet(path)
    if path.suffix.lower() == ".mat" or beginning.startswith(b"MATLAB 5.0"):
        return open_mat(path)
    return open_text(path, size)


def _why_unreadable(path: Path, failure: OSError) -> str:
    if isinstance(failure, FileNotFoundError):
        return "no such file"
    if path.is_dir():
        return f"is a folder; expected a recorded file ({FORMATS})"
    return f"cannot be read: {failure.strerror or failure}"


def read_table(path: Path, topic: str | None = None) -> pd.DataFrame:
    """Read all columns of a recorded file.

    Parameters
    ----------
    path : Path
        CSV, text separated by blanks, parquet, or MATLAB. Columns without a header are named "1", "2", ...
    topic : str, optional
        Of a log with several tables: the one that is read.

    Raises
    ------
    LogError
        When it cannot be read.
    """
    import pandas as pd

    table = open_table(path, topic)
    return pd.DataFrame(dict(table.read(table.names)), copy=False)
