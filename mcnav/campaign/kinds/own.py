"""``type = "my_module.py:Boost"``: a scenario of the user's own in a campaign file.

The file is found relative to the campaign file. Reading such a campaign executes it; reading a run folder never does.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path, PurePosixPath
from typing import Any, Final

from pydantic import ConfigDict

from mcnav.campaign.files import read_whole
from mcnav.campaign.kinds.kind import Described, Place
from mcnav.campaign.problems import Problem, suggestion
from mcnav.campaign.tables import Table
from mcnav.scenarios.own import Code, Own, Recipe, settings_of
from mcnav.scenarios.protocol import ScenarioError
from mcnav.units import UnitError, quantity

NAMED: Final = re.compile(r"(?P<file>[^\x00-\x1f\x7f:]{1,200}\.py):(?P<name>[A-Za-z_][A-Za-z0-9_]{0,100})")
"""File and class."""

LARGEST_FILE: Final = 1_000_000
"""Bytes."""


class OwnTable(Table):
    """``[scenario]`` of a type of the user's own; the class says which further keys there are."""

    model_config = ConfigDict(extra="allow", strict=True, frozen=True)

    type: str


def read_code(path: Path) -> Code:
    """A Python file's text.

    Raises
    ------
    ScenarioError
        When it cannot be read.
    """
    try:
        return Code(path.name, read_whole(path, LARGEST_FILE).decode("utf-8-sig"))
    except FileNotFoundError:
        raise ScenarioError("type", f"{path} is not there; its place is relative to the campaign file") from None
    except OSError as failure:
        raise ScenarioError("type", f"{path} cannot be read: {failure.strerror or failure}") from None
    except UnicodeDecodeError as failure:
        raise ScenarioError("type", f"{path.name} is not UTF-8 text (byte {failure.start})") from None


def describe(table: OwnTable, entries: Mapping[str, Any], place: Place, problems: list[Problem]) -> Described | None:
    """The scenario of a table; mistakes are added to the list."""
    named = NAMED.fullmatch(table.type)
    if named is None:
        problems.append(Problem(place.file, "scenario.type", "expected a file and class such as 'my_module.py:Boost'"))
        return None
    written = PurePosixPath(named["file"])
    if written.is_absolute() or ".." in written.parts or "\\" in named["file"]:
        message = f"got {table.type!r}; the file must lie beside the campaign file, or in a folder beside it"
        problems.append(Problem(place.file, "scenario.type", message))
        return None
    try:
        code = read_code(place.folder / named["file"])
        units = settings_of(code.class_named(named["name"]))
        settings = _settings(entries, units, place, problems)
        if settings is None:
            return None
        scenario = Own(Recipe(code, named["name"], settings))
    except ScenarioError as wrong:
        problems.append(Problem(place.file, f"scenario.{wrong.key}", str(wrong)))
        return None
    return Described(scenario, {**entries, "type": f"{code.file}:{named['name']}"}, code)


def _settings(
    entries: Mapping[str, Any], units: Mapping[str, str], place: Place, problems: list[Problem]
) -> tuple[tuple[str, float], ...] | None:
    """Further keys of the table in SI; none when one of them is wrong."""
    found, before = [], len(problems)
    for key in sorted(entries.keys() - {"type"}):
        if key not in units:
            known = suggestion(key, list(units)) if units else "; the class has no settings"
            problems.append(Problem(place.file, f"scenario.{key}", f"unknown key{known}"))
            continue
        try:
            found.append((key, quantity(entries[key], units[key])))
        except UnitError as wrong:
            problems.append(Problem(place.file, f"scenario.{key}", str(wrong)))
    return tuple(found) if len(problems) == before else None
