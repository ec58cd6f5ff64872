"""Tables of the documentation that restate the program, written from it: ``python -m tests.reference``.

`TABLES` has what stands in each page: tables of keys by the schema of campaigns.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final, get_args

from pydantic import BaseModel

from mcnav.config.schema import CampaignTable
from mcnav.systems.ins.tables.filter import FilterTable
from mcnav.systems.ins.tables.instrument_tables import AccelerometerTable, GyroTable

PAGES: Final = Path(__file__).parent.parent / "mcnav" / "docs"


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    lines = [head, ["---"] * len(head), *rows]
    return [f"| {' | '.join(line)} |" for line in lines]


def keys(*models: type[BaseModel], names: Sequence[str] = ("of",)) -> list[str]:
    """Tabulate the keys of tables of a campaign file: those of several models say of which they are."""
    fields: dict[str, tuple[list[str], Any]] = {}
    for model, name in zip(models, [*names, *[""] * len(models)], strict=False):
        for key, entry in model.model_fields.items():
            fields.setdefault(key, ([], entry))[0].append(name)
    rows = []
    for key, (owners, entry) in fields.items():
        meaning = _description(entry).rstrip(".")
        if len(models) > 1:
            rows.append((f"`{key}`", "; ".join(owners) if len(owners) < len(models) else "both", meaning))
        else:
            rows.append((f"`{key}`", _default(entry), meaning))
    return _table(("key", "of" if len(models) > 1 else "default", "meaning"), rows)


def _description(entry: Any) -> str:
    """Return the description of a field; of an optional one it is in its annotation."""
    nested = (mark for part in get_args(entry.annotation) for mark in getattr(part, "__metadata__", ()))
    found = [entry.description, *(getattr(mark, "description", None) for mark in nested)]
    return next((text for text in found if text), "")


def _default(entry: Any) -> str:
    """Write the default of a key as a campaign file has it; empty where there is none."""
    if entry.is_required():
        return "required"
    value = entry.default
    if isinstance(value, str):
        return f'`"{value}"`'
    return f"{value:,}" if isinstance(value, (int, float)) and not isinstance(value, bool) else ""


TABLES: Final[dict[str, tuple[tuple[str, Callable[[], list[str]]], ...]]] = {
    "CAMPAIGNS.md": (
        ("## Top level", lambda: keys(CampaignTable)),
        (
            "`[imu]` describes the instruments",
            lambda: keys(GyroTable, AccelerometerTable, names=("gyro", "accelerometer")),
        ),
        ("`[filter]` is required with `[[aiding]]`", lambda: keys(FilterTable)),
    ),
}
"""By page: the line that a table follows, and what writes the table."""


def written(page: str) -> str:
    """Return the text of a page with its tables as the program has them."""
    text = (PAGES / page).read_text(encoding="utf-8")
    for line, table in TABLES[page]:
        before, _, after = text.partition(line)
        if not after:
            raise ValueError(f"{page}: no line begins with {line!r}")
        head, rest = re.split(r"(?=^\|)", after, maxsplit=1, flags=re.MULTILINE)
        _, _, below = re.split(r"(^(?:\|.*\n)+)", rest, maxsplit=1, flags=re.MULTILINE)
        text = f"{before}{line}{head}" + "\n".join(table()) + f"\n{below}"
    return text


if __name__ == "__main__":
    for page in TABLES:
        (PAGES / page).write_text(written(page), encoding="utf-8")
