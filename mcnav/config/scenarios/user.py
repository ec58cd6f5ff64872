"""``type = "my_module.py:Boost"``: a scenario of the user's own in a campaign file.

The file is found relative to the campaign file. Reading such a campaign executes it; reading a run folder never does.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import Any, Final

from pydantic import ConfigDict

from mcnav.config.scenarios.base import FileContext, Kept, ScenarioSpec
from mcnav.config.schema import Table
from mcnav.errors import Problem, suggestion
from mcnav.files import read_whole
from mcnav.scenarios.inputs import LONGEST_NAME, InputFile, file_at, plain_name
from mcnav.scenarios.protocol import ScenarioError
from mcnav.scenarios.settings import Declared, SettingError, Value, read_value, settings_of, shown
from mcnav.scenarios.user import SourceFile, UserScenario, UserScenarioSpec
from mcnav.store.inputs import INPUTS

NAMED: Final = re.compile(r"(?P<file>[^\x00-\x1f\x7f:]{1,200}\.py):(?P<name>[A-Za-z_][A-Za-z0-9_]{0,100})")
"""File and class."""

FILE: Final = re.compile(r"[^\x00-\x1f\x7f]{1,200}")
"""Path of a setting's file."""

BESIDE: Final = "the file must lie beside the campaign file, or in a folder beside it"

LARGEST_FILE: Final = 1_000_000
"""Bytes."""


class UserTable(Table):
    """``[scenario]`` of a type of the user's own; the class says which further keys there are."""

    model_config = ConfigDict(extra="allow", strict=True, frozen=True)

    type: str


def read_code(path: Path) -> SourceFile:
    """A Python file's text.

    Raises
    ------
    ScenarioError
        When it cannot be read.
    """
    try:
        return SourceFile(path.name, read_whole(path, LARGEST_FILE).decode("utf-8-sig"))
    except FileNotFoundError:
        raise ScenarioError("type", f"{path} is not there; its place is relative to the campaign file") from None
    except OSError as failure:
        raise ScenarioError("type", f"{path} cannot be read: {failure.strerror or failure}") from None
    except UnicodeDecodeError as failure:
        raise ScenarioError("type", f"{path.name} is not UTF-8 text (byte {failure.start})") from None


def read_scenario(
    table: UserTable, entries: Mapping[str, Any], place: FileContext, problems: list[Problem]
) -> ScenarioSpec | None:
    """The scenario of a table; mistakes are added to the list."""
    named = NAMED.fullmatch(table.type)
    if named is None:
        problems.append(Problem(place.file, "scenario.type", "expected a file and class such as 'my_module.py:Boost'"))
        return None
    if not _beside(named["file"]):
        problems.append(Problem(place.file, "scenario.type", f"got {table.type!r}; {BESIDE}"))
        return None
    try:
        code = read_code(place.folder / named["file"])
        settings = _settings(entries, settings_of(code.class_named(named["name"])), place, problems)
        if settings is None:
            return None
        scenario = UserScenario(UserScenarioSpec(code, named["name"], tuple(settings.items())))
    except ScenarioError as wrong:
        problems.append(Problem(place.file, f"scenario.{wrong.key}", str(wrong)))
        return None
    files = {key: f"{INPUTS}/{value.name}" for key, value in settings.items() if isinstance(value, InputFile)}
    return ScenarioSpec(scenario, {**entries, **files, "type": f"{code.file}:{named['name']}"}, code)


def _beside(written: str) -> bool:
    """Whether a path stays beside the campaign file, or below it."""
    parts = PurePosixPath(written)
    return not (parts.is_absolute() or ".." in parts.parts or "\\" in written)


def _settings(
    entries: Mapping[str, Any], declared: Mapping[str, Declared], place: FileContext, problems: list[Problem]
) -> dict[str, Value] | None:
    """Further keys of the table as the class declares them; none when one of them is wrong."""
    found: dict[str, Value] = {}
    before = len(problems)
    for key in sorted(entries.keys() - {"type"}):
        where = f"scenario.{key}"
        if key not in declared:
            known = suggestion(key, list(declared)) if declared else "; the class has no settings"
            problems.append(Problem(place.file, where, f"unknown key{known}"))
            continue
        try:
            wanted = declared[key]
            found[key] = _file(entries[key], key, place) if wanted is Path else read_value(entries[key], wanted)
        except SettingError as wrong:
            entry = "" if wrong.entry is None else f" #{wrong.entry + 1}"
            problems.append(Problem(place.file, f"{where}{entry}", str(wrong)))
    if len(problems) > before:
        return None
    return _named_apart(found)


def _named_apart(settings: dict[str, Value]) -> dict[str, Value]:
    """Settings whose files have names of their own, if need be with the setting's before them."""
    files = {key: value for key, value in settings.items() if isinstance(value, InputFile)}
    if len({file.name for file in files.values()}) == len(files):
        return settings
    apart = {
        key: replace(file, name=f"{key}.{file.name[-(LONGEST_NAME - len(key) - 1) :]}") for key, file in files.items()
    }
    return settings | apart


def _file(value: object, key: str, place: FileContext) -> InputFile:
    """The file of a setting; of a run that is repeated its kept copy, when the file has changed since."""
    if not isinstance(value, str):
        raise SettingError(f"got {shown(value)}; expected the path of a file in quotes")
    if not FILE.fullmatch(value) or not _beside(value):
        raise SettingError(f"got {shown(value)}; {BESIDE}")
    path, name, kept = place.folder / value, plain_name(value), place.kept.get(key)
    try:
        found = file_at(str(path.absolute()), name, key)
    except OSError as failure:
        if kept is None:
            raise SettingError(f"{path} {_missing(failure)}") from None
        return _copy(kept, name, key, f"{path} {_missing(failure)}")
    if kept is None or found.digest == kept.sha256:
        return found
    return _copy(kept, name, key, f"{path} has changed since the run (its SHA-256 was {kept.sha256})")


def _copy(kept: Kept, name: str, key: str, change: str) -> InputFile:
    """The copy of a file in the folder of the run that read it."""
    if kept.copy is None:
        raise SettingError(f"{change}, and the run folder has no copy of it; restore it")
    try:
        return file_at(str(kept.copy.absolute()), name, key)
    except OSError as failure:
        raise SettingError(f"{change}, and its copy {kept.copy} {_missing(failure)}") from None


def _missing(failure: OSError) -> str:
    """Why a file is of no use."""
    if isinstance(failure, FileNotFoundError):
        return "is not there; its place is relative to the campaign file"
    return f"cannot be read: {failure.strerror or failure}"
