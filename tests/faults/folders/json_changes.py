"""Manifests and summaries of wrong values, keys, sizes and names."""

from __future__ import annotations

import json
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq

from mcnav.store.run_files import json_digest
from tests.faults.folders.content import NAMES, VALUES, encoded_json, places_in, set_at, sign, store
from tests.faults.folders.runs import Outside


def _json_file(chance: random.Random, folder: Path) -> str:
    return chance.choice(["manifest.json", "manifest.json", "summary.json"])


def _change_json(chance: random.Random, folder: Path, name: str, change: Callable[[dict[str, Any]], object]) -> None:
    if name == "manifest.json":
        sign(folder, change)
        return
    path = folder / name
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))


def json_values(chance: random.Random, folder: Path, outside: Outside) -> None:
    """Values of wrong types and sizes."""

    def change(content: dict[str, Any]) -> None:
        for _ in range(chance.choice([1, 1, 2, 5])):
            set_at(content, chance.choice(list(places_in(content))), chance.choice(VALUES))

    _change_json(chance, folder, _json_file(chance, folder), change)


def json_keys(chance: random.Random, folder: Path, outside: Outside) -> None:
    """Keys dropped, renamed, added."""

    def change(content: dict[str, Any]) -> None:
        path = chance.choice(list(places_in(content)))
        inner = content
        for key in path[:-1]:
            inner = inner[key]
        if not isinstance(inner, dict) or chance.random() < 0.5:
            del inner[path[-1]]
        else:
            inner[chance.choice(NAMES)] = inner.pop(path[-1]) if chance.random() < 0.5 else chance.choice(VALUES)

    _change_json(chance, folder, _json_file(chance, folder), change)


def json_numbers(chance: random.Random, folder: Path, outside: Outside) -> None:
    """Other numbers where numbers are."""

    def change(content: dict[str, Any]) -> None:
        found = [path for path in places_in(content) if isinstance(_at(content, path), float)]
        for path in chance.sample(found, min(len(found), chance.choice([1, 3, 30]))):
            set_at(content, path, chance.choice([None, 0.0, -1.0, 1e308, -1e308, 5e-324, 1e-200, 1e150]))

    _change_json(chance, folder, _json_file(chance, folder), change)


def _at(value: Any, path: tuple[Any, ...]) -> Any:
    for key in path:
        value = value[key]
    return value


def nested(depth: int) -> Any:
    """A list in a list, so many times."""
    found: Any = []
    for _ in range(depth):
        found = [found]
    return found


def json_large(chance: random.Random, folder: Path, outside: Outside) -> None:
    """Deep nesting, long keys, many entries, numbers of many digits."""
    name, kind = _json_file(chance, folder), chance.randrange(8)
    large: Any = [
        lambda: nested(chance.choice([300, 480, 900, 20_000])),
        lambda: {"k" * 10_000_000: 1},
        lambda: {f"k{number}": number for number in range(chance.choice([20_000, 1_000_000]))},
        lambda: [[]] * chance.choice([100_000, 10_000_000]),
        lambda: [0] * 3_000_000,
        lambda: "x" * 30_000_000,
        lambda: 10**4_000,
        lambda: [{"a": nested(90)}] * 1_000,
    ][kind]
    path = folder / name
    content = json.loads(path.read_text())
    content.pop("checksum", None)
    place = chance.choice([("large",), *list(places_in(content))[:40]])
    marker = "LARGE-AND-HOSTILE"
    set_at(content, place, marker)
    text = _encoded(large())
    if kind != 0 or "[" * 1_000 not in text:
        value = json.loads(text)
        set_at(content, place, value)
        path.write_text(_dumped(content, name))
    else:
        path.write_text(json.dumps(content, indent=1).replace(f'"{marker}"', text))


def _encoded(value: Any) -> str:
    if isinstance(value, list) and len(value) == 1 and isinstance(value[0], list):
        depth = 0
        while value:
            value, depth = value[0], depth + 1
        return "[" * (depth + 1) + "]" * (depth + 1)
    return json.dumps(value)


def _dumped(content: dict[str, Any], name: str) -> str:
    """Format as the program does, with a checksum; the compact form where the program itself could not."""
    if name == "manifest.json":
        content = content | {"checksum": json_digest(content)}
    try:
        return json.dumps(content, indent=1, ensure_ascii=False) + "\n"
    except RecursionError:
        return json.dumps(content)


def json_text(chance: random.Random, folder: Path, outside: Outside) -> None:
    """JSON that is none, cut, of other encodings."""
    path = folder / _json_file(chance, folder)
    content = path.read_bytes()
    cut = chance.randrange(len(content))
    path.write_bytes(
        chance.choice(
            [
                b"",
                b"null",
                b"[]",
                b'"x"',
                b"NaN",
                b"\xff\xfe{}",
                b"\x00" * 1_000,
                content[:cut],
                content + b"{}",
                b"\xef\xbb\xbf" + content,
                content.replace(b"0", b"NaN"),
                content.replace(b"1", b"Infinity"),
                content[:cut] + b"\x80" + content[cut:],
                content.replace(b": ", b":"),
                content[:-2] + b', "samples": 3}\n',
                b'{"a":' * 100_000,
                b"[" * 5_000_000,
            ]
        )
    )


def renamed(chance: random.Random, folder: Path, outside: Outside) -> None:
    """An output, source, sensor, unit or the campaign with a name of a stranger, the same in every file."""
    manifest = json.loads((folder / "manifest.json").read_text())
    model = manifest["model"]
    variables = [each[key] for which in ("outputs", "sources") for each in model[which] for key in ("name",)]
    variables += [
        manifest["campaign"],
        *(model.get("processes") or {}),
        *((model.get("filter") or {}).get("sensors") or {}),
    ]
    variables += [manifest["accuracy"], manifest["started"], manifest["identity"]["engine"]]
    old, new = chance.choice(variables), chance.choice(NAMES)
    for name in ("manifest.json", "summary.json"):
        content = _replace_texts(json.loads((folder / name).read_text()), old, new)
        if name == "manifest.json":
            content.pop("checksum", None)
            content["checksum"] = json_digest(content)
        (folder / name).write_bytes(encoded_json(content))
    for path in sorted(folder.rglob("*.parquet")):
        table = pq.read_table(path)
        with_names = [printable_name(name.replace(old, new)) for name in table.column_names]
        marks = {
            key: json.dumps(_replace_texts(json.loads(value), old, new)).encode() if value[:1] in b"[{" else value
            for key, value in (table.schema.metadata or {}).items()
        }
        store(folder, path, table.rename_columns(with_names).replace_schema_metadata(marks))


def printable_name(name: str) -> str:
    return name.encode("utf-8", "replace").decode()


def _replace_texts(value: Any, old: str, new: str) -> Any:
    if isinstance(value, str):
        return value.replace(old, new) if old else value
    if isinstance(value, list):
        return [_replace_texts(each, old, new) for each in value]
    if isinstance(value, dict):
        return {key.replace(old, new) if old else key: _replace_texts(each, old, new) for key, each in value.items()}
    return value


def units(chance: random.Random, folder: Path, outside: Outside) -> None:
    """Units that are none, or hostile."""
    unit = chance.choice(
        ["", "furlong", "m^99999999", "m/m/m/m", "<b>", "=1+1", "kg", "1", "deg", "m" * 500, "\x1b[1m", "nan m"]
    )
    key = chance.choice(["unit", "shown_in"])

    def change(content: dict[str, Any]) -> None:
        entries = content.get("model", content)
        which = entries[chance.choice(["outputs", "sources"])]
        chance.choice(which)[key] = unit
        if "shown_in" in content and isinstance(content["shown_in"], dict):
            chance.choice(list(content["shown_in"].values()))[:1] = [unit]

    _change_json(chance, folder, _json_file(chance, folder), change)
