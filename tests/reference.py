"""Tables of the documentation that restate the program, written from it: ``python -m tests.reference``.

`TABLES` has what stands in each page: a table of commands by their help, tables of keys by the schema of campaigns, a
table of columns by their definitions.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Final, get_args

import click
from pydantic import BaseModel
from typer.main import get_command

from mcnav.cli.program import app
from mcnav.config.schema import CampaignTable
from mcnav.report.columns import (
    faults,
    filter_columns,
    joint_columns,
    output_columns,
    percentiles,
    requirements,
    vector_sizes,
)
from mcnav.report.columns.result_table import ResultColumn
from mcnav.systems.ins.tables.filter import FilterTable
from mcnav.systems.ins.tables.instrument_tables import AccelerometerTable, GyroTable

PAGES: Final = Path(__file__).parent.parent / "mcnav" / "docs"
COMMON: Final = {"--help", "--out", "--format", "--jobs"}
"""Options that the page explains once."""


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    lines = [head, ["---"] * len(head), *rows]
    return [f"| {' | '.join(line)} |" for line in lines]


def _commands(group: Any, path: tuple[str, ...] = ("mcnav",)) -> Iterator[tuple[tuple[str, ...], Any]]:
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from _commands(command, (*path, name))
        elif not command.hidden:
            yield (*path, name), command


def commands() -> list[str]:
    """Tabulate the commands: the paragraphs of their help without status and example, and their options."""
    rows = []
    for path, command in _commands(get_command(app)):
        taken = [_argument(each) for each in command.params if each.param_type_name == "argument"]
        paragraphs = [" ".join(part.split()) for part in (command.help or "").split("\n\n")]
        said = " ".join(part for part in paragraphs if not part.startswith(("Example", "Exit status")))
        named = [_long(each) for each in command.params if each.param_type_name == "option" and not each.hidden]
        options = [f"`{name}`" for name in named if name not in COMMON]
        rows.append((f"`{' '.join([*path, *taken])}`", re.sub(r"(--[a-z][a-z-]+)", r"`\1`", said), ", ".join(options)))
    return _table(("command", "what it does", "options"), sorted(rows))


def _argument(argument: click.Parameter) -> str:
    name = (argument.metavar or argument.name or "").strip("[]{}").partition(":")[0].upper()
    return name if argument.required else f"[{name}]"


def _long(option: click.Parameter) -> str:
    return next(name for name in option.opts if name.startswith("--"))


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


FILES: Final[dict[str, Sequence[ResultColumn[Any]]]] = {
    "outputs": output_columns.NUMBERS,
    "requirements": (*requirements.COLUMNS, *requirements.EXCEEDANCE),
    "allowed_sigmas": requirements.ALLOWED,
    "percentiles": percentiles.COLUMNS,
    "sizes": vector_sizes.COLUMNS,
    "tests": joint_columns.TESTS,
    "ellipsoids": joint_columns.ELLIPSOIDS,
    "filter_groups": filter_columns.GROUPS,
    "filter_sigmas": filter_columns.SIGMAS,
    "filter_sensors": filter_columns.SENSORS,
    "neglected": filter_columns.NEGLECTED,
    "faults": faults.FAULTS,
}
"""Columns by the name of a table in data files."""


def columns() -> list[str]:
    """Tabulate the columns of data files, with their headings on pages in brackets where these are other words."""
    return _table(
        ("table", "columns"),
        [(f"`{name}`", ", ".join(map(_column, columns))) for name, columns in FILES.items()],
    )


def _column(column: ResultColumn[Any]) -> str:
    ends = " *" if column.ends is not None else ""
    heading = next((str(shown.heading) for shown in column.shown if shown.heading), "")
    same = heading.lower().replace(" ", "_") in ("", column.name)
    return f"`{column.name}`{ends}" + ("" if same else f" ({heading})")


TABLES: Final[dict[str, tuple[tuple[str, Callable[[], list[str]]], ...]]] = {
    "COMMANDS.md": (("## All commands", commands),),
    "REPORT.md": (("## Columns of the tables", columns),),
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
