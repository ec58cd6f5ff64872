"""Files that are either there whole or not there, and whose bytes depend on their content alone."""

from __future__ import annotations

import io
import math
import os
import secrets
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq


def plain(value: Any) -> Any:
    """A value as JSON can hold it: arrays as lists, what is not finite as null."""
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, Mapping):
        return {key: plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(entry) for entry in value]
    if isinstance(value, (float, np.floating)):
        return float(value) if math.isfinite(value) else None
    return value


def write_whole(path: Path, content: bytes) -> None:
    """Write a file so that it is either there whole, or not there."""
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(6)}.tmp")
    try:
        with temporary.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def parquet_bytes(table: pa.Table, text: Sequence[str] = ()) -> bytes:
    """A parquet file with page checksums; the same table gives the same bytes."""
    numbers = [name for name in table.column_names if name not in text]
    buffer = io.BytesIO()
    pq.write_table(
        table,
        buffer,
        compression="zstd",
        use_dictionary=list(text),
        use_byte_stream_split=[name for name in numbers if pa.types.is_floating(table.schema.field(name).type)],
        write_page_checksum=True,
    )
    return buffer.getvalue()
