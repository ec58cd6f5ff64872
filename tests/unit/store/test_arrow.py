"""Arrow tables without pandas: what pyarrow's own conversions give."""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import pytest

from mcnav.files.parquet import arrow_array, arrow_table, arrow_texts, numbers_in, parquet_bytes

NUMBERS = np.array([1.5, np.nan, -0.0, np.inf, 5e-324, 2.0, 3.0, 4.0, 5.0])


@pytest.mark.parametrize("values", [NUMBERS, NUMBERS[::2], np.arange(9), np.arange(9, dtype=np.int32), NUMBERS[:0]])
def test_numbers(values: np.ndarray) -> None:
    made = arrow_array(values)
    made.validate(full=True)
    assert made.type == pa.from_numpy_dtype(values.dtype)
    np.testing.assert_array_equal(made.to_numpy(), values)
    table, expected = arrow_table({"a": values}), pa.table({"a": pa.array(values)})
    assert parquet_bytes(table) == parquet_bytes(expected)
    for chunks in ([made], [made, made], [made.slice(1), made.slice(0, 2)], []):
        column = pa.chunked_array(chunks, type=made.type)
        found = numbers_in(column)
        assert found.dtype == values.dtype
        np.testing.assert_array_equal(found, column.to_numpy())


@pytest.mark.parametrize("gaps", [(), (0,), (8,), (1, 7, 8), tuple(range(9))])
def test_missing_numbers(gaps: tuple[int, ...]) -> None:
    missing = np.isin(np.arange(9), gaps)
    made, expected = arrow_array(NUMBERS, missing), pa.array(NUMBERS, mask=missing)
    made.validate(full=True)
    assert made.null_count == len(gaps)
    assert made.is_null().equals(expected.is_null())
    assert parquet_bytes(pa.table({"a": made})) == parquet_bytes(pa.table({"a": expected}))
    np.testing.assert_array_equal(numbers_in(pa.chunked_array([made])), np.where(missing, np.nan, NUMBERS))


@pytest.mark.parametrize("texts", [[], [""], ["ok", "", "σ of ü", "ok"]])
def test_texts(texts: list[str]) -> None:
    made = arrow_texts(texts)
    made.validate(full=True)
    assert made.equals(pa.array(texts, pa.string()))
