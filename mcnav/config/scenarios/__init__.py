"""The kinds of scenario that a campaign file may name, each with the table that describes it.

A new kind is a module here with its table and its ``describe``, and a line in `KINDS`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from mcnav.config.scenarios import reentry, steady, user
from mcnav.config.scenarios.base import FileContext, Kept, ScenarioSpec, ScenarioType
from mcnav.scenarios.reentry import SOURCES as REENTRY_SOURCES
from mcnav.scenarios.steady import SOURCES as STEADY_SOURCES

KINDS: Final[Mapping[str, ScenarioType]] = {
    "reentry": ScenarioType(reentry.ReentryTable, reentry.read_scenario, REENTRY_SOURCES),
    "cruise": ScenarioType(steady.CruiseTable, steady.read_scenario, STEADY_SOURCES),
    "hover": ScenarioType(steady.HoverTable, steady.read_scenario, STEADY_SOURCES),
}
"""By the ``type`` that a campaign file gives."""

OWN: Final = ScenarioType(user.UserTable, user.read_scenario)
"""A class in a file of the user's: ``type = "my_module.py:Boost"``."""


def scenario_type(name: object) -> ScenarioType | None:
    """The kind of a ``type``; none when there is no such."""
    if not isinstance(name, str):
        return None
    return KINDS.get(name) or (OWN if user.NAMED.fullmatch(name) else None)


__all__ = ["KINDS", "OWN", "FileContext", "Kept", "ScenarioSpec", "ScenarioType", "scenario_type"]
