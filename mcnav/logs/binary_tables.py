"""Tables in parquet files, and the variables of MATLAB's files."""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO, Final

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


_MATRIX: Final = 14
_COMPRESSED: Final = 15
"""Types of elements of a MATLAB file: a variable, and one that is compressed."""

_SHORT: Final = 1 << 16
"""Number above which the type of a part holds its length as well."""

_CELLS, _STRUCTURES, _OBJECTS, _FUNCTIONS, _OPAQUE = 1, 2, 3, 16, 17
"""Kinds of variables that hold others. Reading makes eight bytes at once for each entry of the first three."""

_MOST_SIZES: Final = 256
"""Bytes of the sizes of a variable: numpy has at most 64 dimensions."""

_PIECE: Final = 1 << 20
"""Bytes that are inflated at a time."""

_DEEPEST: Final = 30
"""Depth of variables within variables: reading calls itself for each."""


class _Element:
    """Content of a variable, read in order; where it is compressed it is inflated by pieces, so that it is never whole.

    Attributes
    ----------
    count : int
        Bytes that have been read or left out.
    """

    def __init__(self, file: BinaryIO, length: int, compressed: bool, order: str) -> None:
        self._file, self._left, self._order, self.count = file, length, order, 0
        self._inflater = zlib.decompressobj() if compressed else None
        self._ready, self._at = b"", 0

    def read(self, count: int) -> bytes:
        """Return so many bytes, fewer at the end. Raises `zlib.error`."""
        if self._inflater is None:
            parts = [self._file.read(min(count, self._left))]
            self._left -= len(parts[0])
        else:
            parts = []
            while count > 0 and (self._at < len(self._ready) or self._inflate(self._inflater)):
                parts.append(self._ready[self._at : self._at + count])
                self._at += len(parts[-1])
                count -= len(parts[-1])
        content = b"".join(parts)
        self.count += len(content)
        return content

    def skip(self, count: int, most: int) -> None:
        """Leave so many bytes out, or fewer where more than a number have then been read."""
        if self._inflater is None:
            count = min(count, self._left)
            self._file.seek(count, 1)
            self._left -= count
            self.count += count
            return
        while count > 0 and self.count <= most and (piece := self.read(min(count, _PIECE))):
            count -= len(piece)

    def _inflate(self, inflater: Any) -> bool:
        """Inflate a piece; return whether there was one."""
        self._ready, self._at = b"", 0
        while not self._ready:
            piece = inflater.unconsumed_tail or self._file.read(min(_PIECE, self._left))
            if not piece:
                return False
            self._left -= 0 if inflater.unconsumed_tail else len(piece)
            self._ready = inflater.decompress(piece, _PIECE)
        return True

    def begin(self) -> tuple[int, int, bytes]:
        """Return type and length of the next part, with what fills it up; a short part is within its tag, the last."""
        if len(tag := self.read(8)) < 8:
            return 0, 0, b""
        kind, length = struct.unpack(f"{self._order}II", tag)
        return (kind, -(-length // 8) * 8, b"") if kind < _SHORT else (kind % _SHORT, 0, tag[4 : 4 + kind // _SHORT])

    def numbers(self) -> tuple[int, ...]:
        """Return the next part, some whole numbers of four bytes."""
        _, length, content = self.begin()
        content = content or self.read(min(length, _MOST_SIZES))
        return struct.unpack(f"{self._order}{len(content) // 4}i", content[: len(content) // 4 * 4])

    def entries(self, most: int, depth: int = 0) -> int:
        """Walk through the next variable, or until so many bytes are exceeded; return those of entries that it states.

        Raises ValueError for variables within variables beyond `_DEEPEST`.
        """
        if depth > _DEEPEST:
            raise ValueError(f"variables are within variables, more than {_DEEPEST} deep")
        kind, length, _ = self.begin()
        end, entries = self.count + length, 0
        flags = self.numbers() if kind == _MATRIX and length else ()
        what = flags[0] & 0xFF if flags else 0
        if what in {_CELLS, _STRUCTURES, _OBJECTS}:
            entries = 8 * math.prod(self.numbers())
            self.skip(self.begin()[1], most)  # its name
            if what == _OBJECTS:
                self.skip(self.begin()[1], most)
            if what != _CELLS:
                longest = next(iter(self.numbers()), 0)
                names = self.begin()[1]
                self.skip(names, most)
                entries *= names // longest if longest > 0 else 0
        if what in {_CELLS, _STRUCTURES, _OBJECTS, _FUNCTIONS, _OPAQUE}:
            before = -1
            while before < self.count < end and self.count + entries <= most:
                before = self.count  # where the file ends before, nothing is read
                entries += self.entries(most - entries, depth + 1)
        self.skip(end - self.count, most)
        return max(entries, 0)


def _exceeds(path: Path, most: int) -> bool:
    """Return whether the variables of a MATLAB file take more bytes than so many: a small file may stand for any size.

    It may inflate, or state a number of cells that it does not have. A file begins with 128 bytes, the last two of
    which give the order of bytes. Elements follow, each with its type and length (MAT-File Format, level 5). A file of
    version 4 is not compressed, and has no cells.

    Raises `zlib.error` where it is damaged, and ValueError as `_Element.entries`.
    """
    with path.open("rb") as file:
        order = {b"IM": "<", b"MI": ">"}.get(file.read(128)[126:])
        if order is None:
            return path.stat().st_size > most
        size = 0
        while size <= most and len(tag := file.read(8)) == 8:
            kind, length = struct.unpack(f"{order}II", tag)
            end, compressed = file.tell() + length, kind == _COMPRESSED
            file.seek(0 if compressed else -8, 1)
            element = _Element(file, length if compressed else length + 8, compressed, order)
            size += element.entries(most - size)
            element.skip(most + 1, most - size)  # what follows it within what is compressed
            size += element.count
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
