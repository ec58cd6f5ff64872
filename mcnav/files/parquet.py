"""Tables of numbers in Arrow and parquet, whose bytes depend on their content only; without pandas."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray


def parquet_bytes(table: pa.Table, text: Sequence[str] = (), described_twice: bool = False) -> bytes:
    """Encode a parquet file with page checksums; the same table gives the same bytes.

    Parameters
    ----------
    text : sequence of str
        Columns of texts.
    described_twice : bool
        Whether the file has Arrow's own description besides that of parquet, as files of earlier versions have: it
        repeats all metadata, and adds nothing to numbers and texts.
    """
    numbers = [name for name in table.column_names if name not in text]
    marks, buffer = table.schema.metadata or {}, io.BytesIO()
    with pq.ParquetWriter(
        buffer,
        table.schema,
        compression="zstd",
        use_dictionary=list(text),
        use_byte_stream_split=[name for name in numbers if pa.types.is_floating(table.schema.field(name).type)],
        write_page_checksum=True,
        store_schema=described_twice,
    ) as file:
        file.write_table(table)
        if not described_twice:
            file.add_key_value_metadata(marks)
    return buffer.getvalue()


def arrow_array(values: NDArray[Any], missing: NDArray[np.bool_] | None = None) -> pa.Array:
    """Convert numbers to an Arrow array; ``pyarrow.array`` would import pandas, a quarter of a second.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Integers or floating-point numbers.
    missing : ndarray of bool, shape (n,), optional
        Entries that are null.
    """
    values = np.ascontiguousarray(values)
    valid = None if missing is None or not missing.any() else pa.py_buffer(np.packbits(~missing, bitorder="little"))
    return pa.Array.from_buffers(pa.from_numpy_dtype(values.dtype), len(values), [valid, pa.py_buffer(values)])


def arrow_texts(texts: Sequence[str]) -> pa.Array:
    """Convert texts to an Arrow array, without pandas."""
    encoded = [text.encode() for text in texts]
    offsets = np.cumsum([0, *map(len, encoded)], dtype=np.int32)
    return pa.StringArray.from_buffers(len(encoded), pa.py_buffer(offsets), pa.py_buffer(b"".join(encoded)))


def repeated_text(text: str, count: int) -> pa.Array:
    """Repeat a text in an Arrow array, without pandas or Arrow's functions, whose import takes as long as a report."""
    encoded = text.encode()
    offsets = np.arange(count + 1, dtype=np.int32) * len(encoded)
    return pa.StringArray.from_buffers(count, pa.py_buffer(offsets), pa.py_buffer(encoded * count))


def arrow_table(columns: Mapping[str, NDArray[Any]]) -> pa.Table:
    """Tabulate columns of numbers, without pandas."""
    return pa.Table.from_arrays([arrow_array(column) for column in columns.values()], names=list(columns))


def numbers_in(column: pa.ChunkedArray) -> NDArray[Any]:
    """Return the entries of a column, NaN where they are missing; pandas is imported only for a column with gaps."""
    plain = pa.types.is_integer(column.type) or pa.types.is_floating(column.type)
    if not plain or column.null_count:
        return np.asarray(column.to_numpy())
    if column.num_chunks == 1:
        return np.from_dlpack(column.chunk(0))
    return np.concatenate([np.empty(0, column.type.to_pandas_dtype()), *map(np.from_dlpack, column.chunks)])


def columns_in(table: pa.Table) -> dict[str, NDArray[Any]]:
    """Return the columns of a table of numbers by name."""
    return {name: numbers_in(table.column(name)) for name in table.column_names}
