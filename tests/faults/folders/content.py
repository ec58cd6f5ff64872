"""Parts of hostile content: names and values of a stranger, places in JSON, checksums made anew."""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

import pyarrow as pa
import pyarrow.parquet as pq

from mcnav.files.parquet import parquet_bytes
from mcnav.files.whole import indented_json, to_json
from mcnav.store.run_files import json_digest
from mcnav.store.run_folder import RunFolder

NAMES: Final = (
    "<script>alert(1)</script>",
    '"><img src=x onerror=alert(1)>',
    "../../outside/x",
    "/outside/x",
    "=cmd|' /C calc'!A0",
    "@SUM(1)",
    "\x1b[31mred",
    "\u202eabc",
    "\u0000",
    "\ud800",
    "n" * 1_999,
    "a\nb",
    "${HOME}",
    "{{7*7}}",
    "$\\frac{$",
    "%s%n",
    "[bold red]x[/]",
    "[/]",
    "",
    " ",
    "con",
    ".",
    "..",
    "\U0001f680",
    "__class__",
    "x [m]",
    "&amp;",
    "\\input{/etc/passwd}",
)
"""Names of a stranger: of outputs, sources, campaigns."""


VALUES: Final[tuple[Any, ...]] = (
    None,
    True,
    False,
    -1,
    0,
    1,
    2**31,
    2**63,
    2**70,
    10**400,
    1e300,
    -1e300,
    5e-324,
    "",
    "nan",
    "x" * 3_000,
    [],
    {},
    [[]],
    [None],
    {"a": {}},
    {"": 0},
    "1",
    [0.0] * 5_000,
    *NAMES[:10],
)
"""What is put in place of a value of a manifest or summary."""


def sign(folder: Path, change: Callable[[dict[str, Any]], object]) -> None:
    """Change a manifest and give it the checksum that it should have, as somebody would who means harm.

    What another change has made no manifest any more is left as it is.
    """
    path = folder / "manifest.json"
    try:
        content = json.loads(path.read_text())
        content.pop("checksum", None)
    except (ValueError, AttributeError):
        return
    change(content)
    RunFolder(folder).write(path.name, encoded_json(content | {"checksum": json_digest(content)}))


def encoded_json(content: dict[str, Any]) -> bytes:
    """Format a JSON file as the program does; half a surrogate pair, which UTF-8 has no bytes for, is escaped."""
    text = indented_json(to_json(content), ensure_ascii=False, allow_nan=False) + "\n"
    return text.encode("utf-8", "backslashreplace")


def places_in(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Every place in a JSON value; of a long list the first and last entries."""
    if path:
        yield path
    entries = value.items() if isinstance(value, dict) else []
    if isinstance(value, list):
        entries = [(number, value[number]) for number in sorted({0, len(value) - 1} if value else ())]
    for key, entry in entries:
        yield from places_in(entry, (*path, key))


def set_at(value: Any, path: tuple[Any, ...], new: Any) -> None:
    """Put something in a place of a JSON value."""
    for key in path[:-1]:
        value = value[key]
    value[path[-1]] = new


def store(folder: Path, path: Path, content: pa.Table | bytes) -> None:
    """Write a parquet file; the manifest says that it is right."""
    if isinstance(content, pa.Table) and len(set(content.column_names)) < content.num_columns:
        sink = io.BytesIO()
        pq.write_table(content, sink, compression="zstd")
        content = sink.getvalue()
    elif isinstance(content, pa.Table):
        content = parquet_bytes(content, [each.name for each in content.schema if not pa.types.is_floating(each.type)])
    path.write_bytes(content)
    if path.parent.name == "samples":
        digest = hashlib.sha256(content).hexdigest()

        def change(manifest: dict[str, Any]) -> None:
            for part in manifest.get("parts", []):
                if part["file"] == path.name:
                    part["sha256"] = digest

        sign(folder, change)
