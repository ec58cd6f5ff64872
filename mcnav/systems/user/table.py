"""``type = "my_module.py:Boost"``: a user-defined scenario.

The path is relative to the campaign file. Reading such a campaign executes the file; reading a run folder never does.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Final

from pydantic import ConfigDict, Field

from mcnav.contract.scenario import Scenario, ScenarioError
from mcnav.entries.context import FileContext
from mcnav.entries.files import OUTSIDE, is_inside, read_file, why_unreadable
from mcnav.entries.inputs import LONGEST_NAME, InputFile, SourceFile
from mcnav.entries.quantities import Table
from mcnav.entries.values import SettingError
from mcnav.errors import suggestion
from mcnav.files.whole import INPUTS, TextError, read_whole, text_of
from mcnav.sampler.error_model import ErrorModel
from mcnav.systems.description import CLASS_IN_FILE, ScenarioSpec
from mcnav.systems.timeouts import current_limit
from mcnav.systems.user.code import UserScenarioSpec, load_class
from mcnav.systems.user.scenario import is_users
from mcnav.systems.user.settings import Declared, Value, read_value, settings_of
from mcnav.systems.user.stochastic_scenario import user_scenario

LARGEST_FILE: Final = 1_000_000
"""Bytes."""


class UserTable(Table):
    """``[scenario]`` of a user-defined type; the class declares the other keys."""

    model_config = ConfigDict(extra="allow", strict=True, frozen=True)

    type: Annotated[
        str,
        Field(
            description="File and class of a scenario of your own.",
            examples=["my_system.py:MySystem"],
            json_schema_extra={"pattern": f"^{re.sub('[?]P<[a-z]+>', '', CLASS_IN_FILE.pattern)}$"},
        ),
    ]


def read_code(path: Path) -> SourceFile:
    """Read a Python file; `ScenarioError` when it cannot be read."""
    try:
        return SourceFile(path.name, text_of(read_whole(path, LARGEST_FILE)))
    except OSError as failure:
        raise ScenarioError("type", f"{path} {why_unreadable(failure)}") from None
    except TextError as wrong:
        raise ScenarioError("type", f"{path.name} {wrong}") from None


@dataclass(frozen=True)
class Described:
    """A class with its settings, the resolved entries of its table, and the files that settings name."""

    spec: UserScenarioSpec
    resolved: Mapping[str, Any]
    files: tuple[InputFile, ...] = ()


def read_class(table: UserTable, entries: Mapping[str, Any], context: FileContext) -> Described | None:
    """Read file, class and settings; mistakes in settings are added to the context.

    Raises `ScenarioError` when the file cannot be read or executed.
    """
    named = CLASS_IN_FILE.fullmatch(table.type)
    if named is None:
        raise ScenarioError("type", "expected a file and class such as 'my_module.py:Boost'")
    if not is_inside(named["file"]):
        raise ScenarioError("type", f"got {table.type!r}; {OUTSIDE}")
    code = context.code.get(named["file"]) or read_code(context.folder / named["file"])
    settings = _read_settings(entries, settings_of(load_class(code, named["name"])), context)
    if settings is None:
        return None
    files = {key: f"{INPUTS}/{value.name}" for key, value in settings.items() if isinstance(value, InputFile)}
    resolved = {**entries, **files, "type": f"{code.file}:{named['name']}"}
    spec = UserScenarioSpec(code, named["name"], tuple(settings.items()), limit=current_limit())
    return Described(spec, resolved, spec.declared)


def scenario_spec(described: Described) -> ScenarioSpec:
    """Build the scenario of a class that propagates errors.

    Raises `ScenarioError` when the class does not follow the protocol.
    """
    scenario = user_scenario(described.spec)
    return ScenarioSpec(scenario, described.resolved, described.spec.code, complete=_with_sigmas)


def _with_sigmas(scenario: Scenario, errors: ErrorModel) -> Scenario:
    """Give a class the sigmas of the campaign's errors, from which the steps of its differences follow."""
    return scenario.with_sigmas(errors.standard_deviations) if is_users(scenario) else scenario


def _read_settings(
    entries: Mapping[str, Any], declared: Mapping[str, Declared], context: FileContext
) -> dict[str, Value] | None:
    """Read the keys that the class declares; when there are mistakes, add them to the context and return None."""
    values: dict[str, Value] = {}
    before = len(context.problems)
    for key in sorted(entries.keys() - {"type"}):
        if key not in declared:
            known = suggestion(key, list(declared)) if declared else "; the class has no settings"
            context.problem(f"scenario.{key}", f"unknown key{known}")
            continue
        try:
            wanted = declared[key]
            values[key] = read_file(entries[key], key, context) if wanted is Path else read_value(entries[key], wanted)
        except SettingError as wrong:
            entry = "" if wrong.entry is None else f" #{wrong.entry + 1}"
            context.problem(f"scenario.{key}{entry}", str(wrong))
    return _with_unique_names(values) if len(context.problems) == before else None


def _with_unique_names(settings: dict[str, Value]) -> dict[str, Value]:
    """Prefix the names of files with their settings when two files have the same name."""
    files = {key: value for key, value in settings.items() if isinstance(value, InputFile)}
    if len({file.name for file in files.values()}) == len(files):
        return settings
    renamed = {
        key: replace(file, name=f"{key}.{file.name[-(LONGEST_NAME - len(key) - 1) :]}") for key, file in files.items()
    }
    return settings | renamed
