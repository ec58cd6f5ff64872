"""Files of parquet read with care: their checksums verified, and not unless there is room for what they claim."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from mcnav.files.parquet import arrow_texts, repeated_text
from mcnav.files.whole import read_whole
from mcnav.physics.units import printable

LARGEST_TABLE: Final = 500_000_000
"""Bytes of a file, and of the table in it."""

MOST_EXPANSION: Final = 100
"""Bytes of numbers for each byte of a file; numbers that are all the same are packed closest."""

ROOM: Final = 100_000_000
"""Bytes that any file may expand to."""

MOST_TEXT: Final = 250_000_000
"""Bytes of the texts of a file."""

MOST_PARTS: Final = 1_000
"""Row groups of a file; those that are written here have a million rows."""

CLAIMS: Final = "it claims to hold more than there is room for"


def read_table(path: Path, most: int = LARGEST_TABLE, text: int | None = None) -> pa.Table:
    """Read a file of at most so many bytes; see `table_from`."""
    return table_from(read_whole(path, most), text=text)


def table_from(content: bytes, rows: int | None = None, text: int | None = None) -> pa.Table:
    """Read a parquet file with its checksums verified, unless it holds much more than it is long.

    Texts are read as the file has them, each once, and repeated only where there is room. Metadata of single columns
    are left alone: Arrow ends the process where they are damaged.

    Parameters
    ----------
    rows : int, optional
        Number of rows that the file must have.
    text : int, optional
        Number of the only column of texts; where it is not known, the file is opened twice.

    Raises
    ------
    ValueError, OSError, pyarrow.ArrowException
        When the file cannot be read, has another number of rows, or other columns of texts.
    """
    file = _opened(content, None, [] if text is None else [text])
    described, schema = file.metadata, file.schema_arrow
    kinds = {field.type for field in schema}
    if any(map(pa.types.is_nested, kinds)):
        nested = [field.name for field in schema if pa.types.is_nested(field.type)]
        raise ValueError(f"its column {printable(nested[0])!r} has lists or tables in it")
    if rows is not None and described.num_rows != rows:
        raise ValueError(f"it has {described.num_rows} rows, not {rows}")
    check_room(described, len(content))
    if any(map(_is_text, kinds)):
        texts = [field.name for field in schema if _is_text(field.type)]
        if text is not None:
            raise ValueError(f"its column {printable(texts[0])!r} has texts in it")
        file = _opened(content, described, texts)
    # threads of Arrow that have just begun abort a process that ends, as one does that refuses another file
    table, room = file.read(use_threads=False), MOST_TEXT
    for place, field in enumerate(table.schema):
        if pa.types.is_dictionary(field.type) and _is_text(field.type.value_type):
            column, taken = _repeated(table.column(place), field.type.value_type, room)
            room -= taken
            table = table.set_column(place, field.with_type(field.type.value_type), column)
    return table


def _opened(content: bytes, described: pq.FileMetaData | None, texts: Sequence[int | str]) -> pq.ParquetFile:
    source = pa.BufferReader(content)
    return pq.ParquetFile(source, metadata=described, page_checksum_verification=True, read_dictionary=texts)


def _is_text(kind: pa.DataType) -> bool:
    return any(test(kind) for test in (pa.types.is_string, pa.types.is_large_string, pa.types.is_binary))


def _repeated(column: pa.ChunkedArray, kind: pa.DataType, room: int) -> tuple[pa.Array, int]:
    """Return the texts of a column that has each once in its dictionaries, and their bytes.

    Raises `ValueError` where they take more than there is room for.
    """
    texts, taken = list[Any](), 0
    for chunk in column.chunks:
        known = chunk.dictionary.to_pylist()
        if len(known) == 1 and not chunk.null_count and column.num_chunks == 1 and pa.types.is_string(kind):
            taken = len(known[0].encode()) * len(chunk)
            if taken <= room:
                return repeated_text(known[0], len(chunk)), taken
        places = chunk.indices.to_pylist()
        counts = np.bincount([place for place in places if place is not None], minlength=len(known))
        taken += sum(len(text) * int(count) for text, count in zip(known, counts, strict=True) if text is not None)
        if taken > room:
            raise ValueError(CLAIMS)
        texts += [None if place is None else known[place] for place in places]
    plain = pa.types.is_string(kind) and None not in texts
    return (arrow_texts(texts) if plain else pa.array(texts, kind)), taken


def check_room(described: pq.FileMetaData, size: int, most: int = LARGEST_TABLE) -> None:
    """Raise `ValueError` when a file of so many bytes claims to hold more than there is room for.

    Numbers that a dictionary holds once are counted as often as they occur. What is read part by part takes long when
    these are many.
    """
    if described.num_row_groups > MOST_PARTS:
        raise ValueError(f"it is in {described.num_row_groups:,} parts")
    claimed = sum(described.row_group(number).total_byte_size for number in range(described.num_row_groups))
    claimed = max(claimed, 8 * described.num_rows * described.num_columns)
    if claimed > min(MOST_EXPANSION * size + ROOM, most):
        raise ValueError(CLAIMS)
