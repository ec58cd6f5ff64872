"""Scenario types of a campaign file, each imported when it is asked for: a command pays for the system that it uses.

Each is described by a `ScenarioType` in the folder of its system. To add a type, add a folder and a line in
`SCENARIO_TYPES`, and a table that only it has to `FURTHER_NAMES`; what a new campaign of the type looks like is in the
folder's file ``new_TYPE.toml``.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, MutableMapping
from functools import cache
from importlib import import_module
from typing import Final

from mcnav.systems.description import CLASS_IN_FILE, FurtherTable, ScenarioSpec, ScenarioType

Place = tuple[str, str]
"""Module in `mcnav.systems` and the name in it."""


def _load(place: Place) -> ScenarioType:
    module, name = place
    kind: ScenarioType = getattr(import_module(f"mcnav.systems.{module}"), name)
    return kind


class ScenarioTypes(MutableMapping[str, ScenarioType]):
    """Scenario types by name, each imported when it is asked for."""

    def __init__(self, places: Mapping[str, Place]) -> None:
        self._types: dict[str, ScenarioType | Place] = dict(places)

    def __getitem__(self, name: str) -> ScenarioType:
        kind = self._types[name]
        if not isinstance(kind, ScenarioType):
            kind = self._types[name] = _load(kind)
        return kind

    def __setitem__(self, name: str, kind: ScenarioType) -> None:
        self._types[name] = kind

    def __delitem__(self, name: str) -> None:
        del self._types[name]

    def __contains__(self, name: object) -> bool:
        return name in self._types

    def __iter__(self) -> Iterator[str]:
        return iter(self._types)

    def __len__(self) -> int:
        return len(self._types)


SCENARIO_TYPES: Final = ScenarioTypes(
    {
        "reentry": ("reentry.table", "REENTRY"),
        "cruise": ("steady.table", "CRUISE"),
        "hover": ("steady.table", "HOVER"),
        "ins": ("ins.tables.scenario", "INS"),
    }
)
"""Scenario types by the ``type`` of ``[scenario]``."""

FURTHER_NAMES: Final = ("imu", "gravity", "aiding", "faults", "filter", "processes", "measurements")
"""Names of the tables besides ``[scenario]`` that some types read."""


def user_type() -> ScenarioType:
    """Return the type of scenarios that are a class of the user's."""
    return _load(("closed_loop.table", "USER"))


@cache
def further_tables() -> Mapping[str, FurtherTable]:
    """Return the tables besides ``[scenario]`` that some types read, by name."""
    kinds = (*SCENARIO_TYPES.values(), user_type())
    tables = {name: table for kind in kinds for name, table in kind.tables.items()}
    return {name: tables[name] for name in FURTHER_NAMES}


def is_code(name: object) -> bool:
    """Tell whether a ``type`` names a class of the user's."""
    return isinstance(name, str) and name not in SCENARIO_TYPES and CLASS_IN_FILE.fullmatch(name) is not None


def scenario_type(name: object) -> ScenarioType | None:
    """Return the scenario type of a ``type``; None when there is none."""
    if not isinstance(name, str):
        return None
    return SCENARIO_TYPES.get(name) or (user_type() if is_code(name) else None)


__all__ = [
    "FURTHER_NAMES", "SCENARIO_TYPES", "ScenarioSpec", "ScenarioType", "further_tables", "is_code", "scenario_type",
    "user_type",
]  # fmt: skip
