"""What a kind of scenario is to the campaign file."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mcnav.campaign.problems import Problem
from mcnav.campaign.tables import Table
from mcnav.scenarios.own import Code
from mcnav.scenarios.protocol import Scenario, Source


@dataclass(frozen=True)
class Place:
    """Where a table stands: the campaign file's name, for messages, and its folder, for what lies beside it."""

    file: str
    folder: Path


@dataclass(frozen=True)
class Described:
    """A scenario built from its table.

    Attributes
    ----------
    scenario : Scenario
    resolved : mapping
        The table with every default spelled out; it builds the same scenario again.
    code : Code, optional
        The file of the user's own that the scenario is made of.
    """

    scenario: Scenario
    resolved: Mapping[str, Any]
    code: Code | None = None


@dataclass(frozen=True)
class Kind:
    """A kind of scenario.

    Attributes
    ----------
    table : type of Table
        What ``[scenario]`` may hold.
    describe : callable
        Table as read, its entries as written, place, list of mistakes to add to: the scenario, or none.
    sources : sequence of Source, optional
        What ``[errors]`` may hold while the table itself is wrong; by default nothing is said of it then.
    """

    table: type[Table]
    describe: Callable[[Any, Mapping[str, Any], Place, list[Problem]], Described | None]
    sources: Sequence[Source] | None = None
