"""Parquet files of other bits, columns, metadata and sizes."""

from __future__ import annotations

import base64
import hashlib
import io
import json
import math
import os
import pickle
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from tests.faults.folders.content import NAMES, VALUES, places_in, set_at, sign, store
from tests.faults.folders.file_changes import remove
from tests.faults.folders.json_changes import printable_name
from tests.faults.folders.runs import Outside


def _some_parquet(chance: random.Random, folder: Path) -> Path:
    """Choose a file that has columns."""
    return chance.choice([path for path in sorted(folder.rglob("*.parquet")) if pq.read_schema(path).names])


def parquet_bits(chance: random.Random, folder: Path, outside: Outside) -> None:
    """Bits flipped, pieces cut out or repeated."""
    path = _some_parquet(chance, folder)
    content = bytearray(path.read_bytes())
    for _ in range(chance.choice([1, 1, 3, 20])):
        place = chance.choice([chance.randrange(len(content)), max(len(content) - chance.randrange(1, 4_000), 0)])
        content[place] ^= 1 << chance.randrange(8)
    if chance.random() < 0.3:
        begin = chance.randrange(len(content))
        del content[begin : begin + chance.choice([1, 100, 10**9])]
    if chance.random() < 0.7:
        store(folder, path, bytes(content))
    else:
        path.write_bytes(content)


def parquet_columns(chance: random.Random, folder: Path, outside: Outside) -> None:
    """Columns of other types, names, lengths; values that are missing, huge, pickled."""
    path = _some_parquet(chance, folder)
    table = pq.read_table(path)
    count, number = len(table), chance.randrange(table.num_columns)
    name = table.column_names[number]
    payload = pickle.dumps(_Payload(outside.code))
    columns: list[Callable[[], Any]] = [
        lambda: pa.array([chance.choice(NAMES).replace("\ud800", "") for _ in range(count)]),
        lambda: pa.array([None] * count),
        lambda: pa.array([None] * count, pa.float64()),
        lambda: pa.array([[1.0]] * count),
        lambda: pa.array([{"a": 1.0}] * count),
        lambda: pa.array([True] * count),
        lambda: pa.array([payload] * count),
        lambda: pa.array([10**15 + k for k in range(count)], pa.timestamp("us")),
        lambda: pa.array(["1.0"] * count).dictionary_encode(),
        lambda: pa.array([chance.choice([math.nan, math.inf, -math.inf, 1e308, -1e308, 1e-308]) for _ in range(count)]),
        lambda: pa.array(np.zeros(count)),
        lambda: pa.array(np.full(count, 2**63 - 1)),
        lambda: pa.array(np.full(count, -1)),
    ]
    kind = chance.randrange(len(columns) + 5)
    if kind < len(columns):
        table = table.set_column(number, name, columns[kind]())
    elif kind == len(columns):
        table = table.rename_columns([chance.choice([printable_name(each), name, each]) for each in table.column_names])
    elif kind == len(columns) + 1:
        table = table.slice(0, chance.choice([0, 1, count - 1]))
    elif kind == len(columns) + 2:
        table = pa.concat_tables([table] * 2)
    elif kind == len(columns) + 3:
        table = table.remove_column(number)
    else:
        table = table.append_column(chance.choice([name, "further", "\x1b[1m"]), table.column(number))
    store(folder, path, table)


class _Payload:
    """Object that executes code when it is unpickled."""

    def __init__(self, code: str) -> None:
        self.code = code

    def __reduce__(self) -> tuple[Any, tuple[str]]:
        return exec, (self.code,)


def parquet_marks(chance: random.Random, folder: Path, outside: Outside) -> None:
    """Metadata of parquet files: sums, panels, events, tracebacks."""
    path = _some_parquet(chance, folder)
    table = pq.read_table(path)
    marks = dict(table.schema.metadata or {})
    if not marks:
        return
    key = chance.choice(sorted(marks))
    value, kind = marks[key], chance.randrange(6)
    if kind == 0:
        del marks[key]
    elif kind == 1:
        marks[key] = chance.choice(
            [b"", b"null", b"[]", b"{}", b"[" * 50_000, b"\xff", b"1", b"A" * 10_000_000, b"-1", b"nan"]
        )
    elif kind == 2 and value[:1] in (b"[", b"{"):
        content = json.loads(value)
        found = list(places_in(content))
        if found:
            set_at(content, chance.choice(found), chance.choice(VALUES))
        marks[key] = json.dumps(content).encode()
    elif kind == 3:
        numbers = np.array(
            [chance.choice([math.nan, math.inf, 1e308, -1.0, 0.0, 1e18]) for _ in range(chance.choice([1, 3, 1_000]))]
        )
        marks[key] = base64.b64encode(numbers.astype("<f8").tobytes())
    elif kind == 4:
        cut = chance.randrange(len(value) + 1)
        marks[key] = value[:cut] + chance.choice([b"", b"=", b"\x00", b"AAAA"]) + value[cut + chance.randrange(9) :]
    else:
        marks[chance.choice([b"mcnav.tracebacks", b"mcnav.filter", b"mcnav.summary", b"pandas", b"ARROW:schema"])] = (
            value
        )
    store(folder, path, table.replace_schema_metadata(marks))


def parquet_bombs(chance: random.Random, folder: Path, outside: Outside) -> None:
    """Small files of many rows, columns or long texts, with a manifest that says so."""
    path, kind = _some_parquet(chance, folder), chance.randrange(6)
    table = pq.read_table(path)
    names, sink = table.column_names, io.BytesIO()
    rows = chance.choice([100_000, 3_000_000, 30_000_000]) if kind == 0 else 70
    if kind == 0:  # one number again and again
        each = pa.DictionaryArray.from_arrays(pa.array(np.zeros(rows, dtype=np.int32)), pa.array([1.0]))
        pq.write_table(pa.table(dict.fromkeys(dict.fromkeys(names), each)), sink, compression="zstd")
    elif kind == 1:  # a long text again and again
        count = min(len(table), 70)
        texts = pa.array(["x" * chance.choice([1_000_000, 9_000_000])] * count)
        columns = {
            name: texts if name in ("status", names[-1]) else table.column(name).slice(0, count) for name in names
        }
        bomb = pa.table(columns).replace_schema_metadata(table.schema.metadata)
        pq.write_table(bomb, sink, compression="zstd", dictionary_pagesize_limit=1 << 30)
    elif kind == 2:  # a text that packs well
        texts = pa.array(["x" * chance.choice([1_000_000, 150_000_000])] * min(len(table), 4))
        columns = {name: texts if name == names[-1] else table.column(name).slice(0, len(texts)) for name in names}
        pq.write_table(pa.table(columns), sink, compression="zstd")
    elif kind == 3:  # columns without end
        more = {f"c{number}": table.column(0) for number in range(20_000)}
        pq.write_table(pa.table({**dict(zip(names, table.columns, strict=True)), **more}), sink, compression="zstd")
    elif kind == 4:  # row groups without end
        many = pa.concat_tables([table] * 100).slice(0, 50_000)
        pq.write_table(many, sink, row_group_size=1, compression="zstd")
    else:  # metadata that pack well
        marks = (table.schema.metadata or {}) | {b"mcnav.filter": base64.b64encode(b"\x78\x9c" + bytes(40_000_000))}
        pq.write_table(table.replace_schema_metadata(marks), sink, compression="zstd")
    store(folder, path, sink.getvalue())
    if path.parent.name == "samples" and kind == 0:

        def claim(manifest: dict[str, Any]) -> None:
            manifest["samples"] = rows
            manifest["parts"] = [{**manifest["parts"][0], "begin": 0, "end": rows, "file": path.name}]
            manifest["parts"][0]["sha256"] = hashlib.sha256(sink.getvalue()).hexdigest()

        for other in (folder / "samples").iterdir():
            if other.name != path.name:
                other.unlink()
        sign(folder, claim)


def claims(chance: random.Random, folder: Path, outside: Outside) -> None:
    """Samples beyond number, and files that are long without taking room."""
    rows = chance.choice([10**6, 10**8, 10**10, 10**12])

    def claim(manifest: dict[str, Any]) -> None:
        manifest["samples"] = rows
        manifest["parts"][-1]["end"] = rows

    path = chance.choice(sorted((folder / "samples").glob("*.parquet")))
    if chance.random() < 0.7:
        os.truncate(path, chance.choice([10**7, 9 * 10**8]))
    sign(folder, claim)


def payloads(chance: random.Random, folder: Path, outside: Outside) -> None:
    """Pickles and code, under every name that a program could load."""
    pickled, sink = pickle.dumps(_Payload(outside.code)), io.BytesIO()
    np.save(sink, np.array([_Payload(outside.code)], dtype=object), allow_pickle=True)
    content = chance.choice([pickled, sink.getvalue(), outside.code.encode()])
    names = [
        "samples/part-00000.parquet",
        "history.parquet",
        "histories.parquet",
        "epochs.parquet",
        "filter.parquet",
        "manifest.json",
        "summary.json",
        "campaign.toml",
        "mine.py",
        "__init__.py",
        "conftest.py",
        "sitecustomize.py",
        "numpy.py",
        "matrices.npz",
        "samples/__init__.py",
        "inputs/table.txt",
        "tables/a.csv",
    ]
    for name in chance.sample(names, chance.choice([1, 3])):
        (folder / name).parent.mkdir(exist_ok=True)
        remove(folder / name)
        store(folder, folder / name, content)
