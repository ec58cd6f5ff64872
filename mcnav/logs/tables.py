"""Any recorded file as named columns, whatever its format."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

from mcnav.files.whole import check_regular
from mcnav.logs import gpx, nmea, px4, ros_bags, rtklib
from mcnav.logs.binary_tables import open_mat, open_parquet
from mcnav.logs.log_error import LogError
from mcnav.logs.log_table import LogTable
from mcnav.logs.text_tables import open_text

if TYPE_CHECKING:
    import pandas as pd

LARGEST: Final = 1 << 40
"""Bytes of a file that is opened at all; how many rows are read is limited by `MOST_ROWS`."""

LARGEST_TEXT: Final = 2_000_000_000
"""Bytes of a log of a receiver."""

FORMATS: Final = ".csv, .txt, .parquet, .mat, .ulg, .bag, .db3, .mcap, .pos, .nmea, .gpx"
"""Endings of the files that can be read; a file of another ending is looked at."""


BEGINNING: Final = 4_096
"""Bytes of a file by which its format is told."""


def open_table(path: Path, topic: str | None = None, preferred: Sequence[str] = ()) -> LogTable:
    """Open a recorded file, whose format is told by its first bytes, or else by its ending.

    Parameters
    ----------
    topic : str, optional
        Of a log with several tables: the one that is read.
    preferred : sequence of str, optional
        Topics of PX4 and types of messages of ROS, of which one is read where no topic is named.

    Raises
    ------
    LogError
        When there is no such file, or it cannot be read.
    """
    if (path / "metadata.yaml").is_file():
        return ros_bags.open_bag(path, topic, preferred)
    try:
        check_regular(path, LARGEST)
        with path.open("rb") as file:
            beginning = file.read(BEGINNING)
        size = path.stat().st_size
    except OSError as failure:
        raise LogError(path, _why_unreadable(path, failure)) from None
    if not beginning:
        raise LogError(path, "is empty")
    if beginning.startswith(px4.MAGIC):
        return px4.open_ulog(path, topic, preferred)
    if beginning.startswith(ros_bags.MAGIC):
        return ros_bags.open_bag(path, topic, preferred)
    text = beginning.removeprefix(b"\xef\xbb\xbf")
    if path.suffix.lower() == ".nmea" or nmea.LOOK.search(text):
        if size > LARGEST_TEXT:
            raise LogError(path, f"is longer than {LARGEST_TEXT:,} bytes; give a part of it")
        return nmea.open_nmea(path, topic)
    if topic is not None:
        raise LogError(path, "has no topics; leave it out", "columns.topic")
    if beginning.startswith(b"PAR1"):
        return open_parquet(path)
    if path.suffix.lower() == ".mat" or beginning.startswith(b"MATLAB 5.0"):
        return open_mat(path)
    return _open_text(path, size, text)


def _open_text(path: Path, size: int, beginning: bytes) -> LogTable:
    """Open a text, by its look or its ending."""
    ending = path.suffix.lower()
    if size > LARGEST_TEXT and (ending in (".pos", ".gpx")):
        raise LogError(path, f"is longer than {LARGEST_TEXT:,} bytes; give a part of it")
    if ending == ".pos" or rtklib.LOOK.search(beginning):
        return rtklib.open_pos(path)
    if ending == ".gpx" or gpx.LOOK.search(beginning):
        return gpx.open_gpx(path)
    return open_text(path, size)


def _why_unreadable(path: Path, failure: OSError) -> str:
    if isinstance(failure, FileNotFoundError):
        return f"no such file; expected a recorded file ({FORMATS})"
    if path.is_dir():
        return f"is a folder; expected a recorded file ({FORMATS})"
    return f"cannot be read: {failure.strerror or failure}"


def read_table(path: str | Path, topic: str | None = None) -> pd.DataFrame:
    """Read all columns of a recorded file.

    Parameters
    ----------
    path : str or Path
        CSV, text separated by blanks, parquet, MATLAB, PX4 (ULog), ROS bags, RTKLIB (.pos), NMEA, GPX. Columns without
        a header are named "1", "2", ...
    topic : str, optional
        Of a log with several tables: the one that is read.

    Returns
    -------
    DataFrame, shape (rows, columns)
        In the units of the file.

    Raises
    ------
    LogError
        When it cannot be read.

    Examples
    --------
    >>> import mcnav as mc
    >>> import pandas as pd
    >>> pd.DataFrame({"time": [0.0, 0.1], "rate": [0.1, 0.2]}).to_csv("log.csv", index=False)
    >>> mc.read_table("log.csv")["rate"].tolist()
    [0.1, 0.2]
    """
    import pandas as pd

    table = open_table(Path(path), topic)
    return pd.DataFrame(dict(table.read(table.names)), copy=False)
