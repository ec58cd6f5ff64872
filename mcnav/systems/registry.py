"""Scenario types of a campaign file.

Each is described by a `ScenarioType` in the folder of its system. To add a type, add a folder and a line in
`SCENARIO_TYPES`; what a new campaign of the type looks like is in the folder's file ``new_TYPE.toml``.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from mcnav.systems.closed_loop.table import USER
from mcnav.systems.description import FurtherTable, ScenarioSpec, ScenarioType
from mcnav.systems.ins.tables.scenario import INS
from mcnav.systems.reentry.table import REENTRY
from mcnav.systems.steady.table import CRUISE, HOVER
from mcnav.systems.user.table import CLASS_IN_FILE

SCENARIO_TYPES: Final[Mapping[str, ScenarioType]] = {
    "reentry": REENTRY,
    "cruise": CRUISE,
    "hover": HOVER,
    "ins": INS,
}
"""Scenario types by the ``type`` of ``[scenario]``."""

FURTHER_TABLES: Final[Mapping[str, FurtherTable]] = {
    name: table for kind in (*SCENARIO_TYPES.values(), USER) for name, table in kind.tables.items()
}
"""Tables besides ``[scenario]`` that some types read, by name."""


def scenario_type(name: object) -> ScenarioType | None:
    """Return the scenario type of a ``type``; None when there is none."""
    if not isinstance(name, str):
        return None
    return SCENARIO_TYPES.get(name) or (USER if CLASS_IN_FILE.fullmatch(name) else None)


__all__ = ["FURTHER_TABLES", "SCENARIO_TYPES", "USER", "ScenarioSpec", "ScenarioType", "scenario_type"]
