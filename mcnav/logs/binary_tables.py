"""Tables in parquet files, and the variables of MATLAB's files."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np
import pyarrow as pa

from mcnav.errors import reason_of
from mcnav.logs.log_error import LogError
from mcnav.logs.log_table import LogTable, Values, table_of
from mcnav.logs.text_tables import MOST_ROWS, column_values

MOST_BYTES: Final = 7 * 8 * MOST_ROWS
"""Bytes of the variables of a MATLAB file, all of which are read: seven columns of numbers."""


def _check_rows(path: Path, rows: int) -> None:
    if rows > MOST_ROWS:
        raise LogError(path, f"has {rows:,} rows; at most {MOST_ROWS:,} are read, so give a part of it")


def open_parquet(path: Path) -> LogTable:
    """Open a parquet file; its columns are read when they are asked for."""
    import pyarrow.parquet as pq

    try:
        file = pq.ParquetFile(path)
    except (OSError, ValueError, pa.ArrowException) as failure:
        raise LogError(path, f"is no parquet file that can be read: {reason_of(failure)}") from None
    if not (rows := file.metadata.num_rows):
        raise LogError(path, "has no rows")
    _check_rows(path, rows)

    def read(names: Sequence[str]) -> Mapping[str, Values]:
        try:
            table = file.read(columns=list(names))
            return {name: column_values(table[name]) for name in names}
        except (OSError, ValueError, pa.ArrowException) as failure:
            raise LogError(path, f"is no parquet file that can be read: {reason_of(failure)}") from None

    return LogTable(path, tuple(file.schema_arrow.names), read)


def open_mat(path: Path) -> LogTable:
    """Open a file of MATLAB's up to version 7: vectors, columns of matrices, and fields of structures.

    A matrix `w` of n rows and 3 columns has the columns `w_1`, `w_2`, `w_3`; a field of a structure `imu.w`.
    """
    from scipy.io import loadmat

    with path.open("rb") as beginning:
        hdf = beginning.read(8) == b"\x89HDF\r\n\x1a\n" or b"MATLAB 7.3" in beginning.read(128)
    if hdf:
        raise LogError(path, "is a MATLAB file of version 7.3 (HDF5); save it with save(..., '-v7')")
    try:
        if _exceeds(path, MOST_BYTES):
            raise LogError(path, f"holds over {MOST_BYTES:,} bytes of variables; save those of the record, or a part")
        content = loadmat(path, squeeze_me=False, struct_as_record=False, simplify_cells=True)
    except LogError:
        raise
    except Exception as failure:  # scipy raises many types for damaged files
        raise LogError(path, f"is no MATLAB file that can be read: {reason_of(failure)}") from None
    columns: dict[str, Values] = {}
    _add_variables(columns, "", content)
    if not columns:
        raise LogError(path, "holds no vectors and no matrices of numbers")
    longest = max(map(len, columns.values()))
    _check_rows(path, longest)
    kept = {name: values for name, values in columns.items() if len(values) == longest}
    return table_of(path, kept)


_COMPRESSED: Final = 15
"""Type of a compressed element of a MATLAB file."""

_PIECE: Final = 1 << 20
"""Bytes that are inflated at a time."""


def _exceeds(path: Path, most: int) -> bool:
    """Return whether the variables of a MATLAB file take more bytes than so many: a small file may inflate to any size.

    A file begins with 128 bytes, the last two of which give the order of bytes. Elements follow, each with its type
    and length (MAT-File Format, level 5). A file of version 4 is not compressed.

    Raises `zlib.error` where it is damaged.
    """
    with path.open("rb") as file:
        order = {b"IM": "<", b"MI": ">"}.get(file.read(128)[126:])
        if order is None:
            return path.stat().st_size > most
        size = 0
        while size <= most and len(tag := file.read(8)) == 8:
            kind, length = struct.unpack(f"{order}II", tag)
            end = file.tell() + length
            if kind != _COMPRESSED:
                size += length
            inflater = zlib.decompressobj()
            while kind == _COMPRESSED and size <= most and (piece := file.read(min(_PIECE, end - file.tell()))):
                while piece and size <= most:
                    size += len(inflater.decompress(piece, _PIECE))
                    piece = inflater.unconsumed_tail
            file.seek(end)
        return size > most


def _add_variables(columns: dict[str, Values], prefix: str, content: Mapping[str, object]) -> None:
    """Add the vectors, columns of matrices, and fields of structures that hold numbers."""
    for name, value in content.items():
        if name.startswith("__"):
            continue
        if isinstance(value, Mapping):
            _add_variables(columns, f"{prefix}{name}.", value)
            continue
        array = np.asarray(value)
        if array.dtype.kind not in "iuf" or array.ndim > 2 or array.size < 2:
            continue
        array = array if array.dtype.kind != "u" else array.astype(np.int64)
        if array.ndim == 1 or 1 in array.shape:
            columns[prefix + name] = array.reshape(-1)
            continue
        rows = array if array.shape[0] >= array.shape[1] else array.T
        for place in range(rows.shape[1]):
            columns[f"{prefix}{name}_{place + 1}"] = np.ascontiguousarray(rows[:, place])
