"""Scenario types of a campaign file, each with the table that describes it.

To add a type, add a module here with its table and its ``read_scenario``, and a line in `SCENARIO_TYPES`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from mcnav.systems.closed_loop import table as closed_loop
from mcnav.systems.description import ScenarioSpec, ScenarioType
from mcnav.systems.ins.scenario import SOURCES as INS_SOURCES
from mcnav.systems.ins.tables import scenario as ins
from mcnav.systems.reentry import table as reentry
from mcnav.systems.reentry.scenario import SOURCES as REENTRY_SOURCES
from mcnav.systems.steady import table as steady
from mcnav.systems.steady.scenario import SOURCES as STEADY_SOURCES
from mcnav.systems.user import table as user

SCENARIO_TYPES: Final[Mapping[str, ScenarioType]] = {
    "reentry": ScenarioType(reentry.ReentryTable, reentry.read_scenario, sources=REENTRY_SOURCES),
    "cruise": ScenarioType(steady.CruiseTable, steady.read_scenario, sources=STEADY_SOURCES),
    "hover": ScenarioType(steady.HoverTable, steady.read_scenario, sources=STEADY_SOURCES),
    "ins": ScenarioType(ins.InsTable, ins.read_scenario, ("imu", "aiding", "filter"), INS_SOURCES),
}
"""Scenario types by the ``type`` of ``[scenario]``."""

USER: Final = ScenarioType(user.UserTable, closed_loop.read_scenario, closed_loop.TABLES)
"""A class in the user's own file, a closed loop or another system: ``type = "my_module.py:Boost"``."""


def scenario_type(name: object) -> ScenarioType | None:
    """Return the scenario type of a ``type``; None when there is none."""
    if not isinstance(name, str):
        return None
    return SCENARIO_TYPES.get(name) or (USER if user.CLASS_IN_FILE.fullmatch(name) else None)


__all__ = ["SCENARIO_TYPES", "USER", "ScenarioSpec", "ScenarioType", "scenario_type"]
