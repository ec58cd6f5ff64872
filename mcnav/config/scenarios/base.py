"""What a kind of scenario is to the campaign file."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mcnav.config.schema import Table
from mcnav.errors import Problem
from mcnav.scenarios.protocol import Scenario, Source
from mcnav.scenarios.user import SourceFile


@dataclass(frozen=True)
class Kept:
    """A file that a run was made with, by its digest, and its copy in the run folder if there is one."""

    sha256: str
    copy: Path | None


@dataclass(frozen=True)
class FileContext:
    """Where a table stands.

    Attributes
    ----------
    file : str
        The campaign file's name, for messages.
    folder : Path
        Folder of what lies beside it.
    kept : mapping of str to Kept
        Files of a run that is to be repeated, by setting: a copy takes the place of a file that has changed since.
    """

    file: str
    folder: Path
    kept: Mapping[str, Kept] = field(default_factory=dict)


@dataclass(frozen=True)
class ScenarioSpec:
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
    code: SourceFile | None = None


@dataclass(frozen=True)
class ScenarioType:
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
    describe: Callable[[Any, Mapping[str, Any], FileContext, list[Problem]], ScenarioSpec | None]
    sources: Sequence[Source] | None = None
