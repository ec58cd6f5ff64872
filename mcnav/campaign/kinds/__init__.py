"""The kinds of scenario that a campaign file may name, each with the table that describes it.

A new kind is a module here with its table and its ``describe``, and a line in `KINDS`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from mcnav.campaign.kinds import own, reentry, steady
from mcnav.campaign.kinds.kind import Described, Kept, Kind, Place
from mcnav.scenarios.cruise import SOURCES as STEADY_SOURCES
from mcnav.scenarios.reentry import SOURCES as REENTRY_SOURCES

KINDS: Final[Mapping[str, Kind]] = {
    "reentry": Kind(reentry.ReentryTable, reentry.describe, REENTRY_SOURCES),
    "cruise": Kind(steady.CruiseTable, steady.describe, STEADY_SOURCES),
    "hover": Kind(steady.HoverTable, steady.describe, STEADY_SOURCES),
}
"""By the ``type`` that a campaign file gives."""

OWN: Final = Kind(own.OwnTable, own.describe)
"""A class in a file of the user's: ``type = "my_module.py:Boost"``."""


def kind_of(name: object) -> Kind | None:
    """The kind of a ``type``; none when there is no such."""
    if not isinstance(name, str):
        return None
    return KINDS.get(name) or (OWN if own.NAMED.fullmatch(name) else None)


__all__ = ["KINDS", "OWN", "Described", "Kept", "Kind", "Place", "kind_of"]
