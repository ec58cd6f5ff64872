"""Interface between the campaign file and its scenario types."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from mcnav.contract.quantities import Source
from mcnav.contract.scenario import Scenario
from mcnav.entries.context import FileContext
from mcnav.entries.inputs import InputFile
from mcnav.entries.quantities import Table
from mcnav.systems.ins.tables.filter import FilterPlan
from mcnav.systems.user.code import SourceFile


@dataclass(frozen=True)
class ScenarioSpec:
    """A scenario built from its table.

    Attributes
    ----------
    resolved : mapping
        Table with every default spelled out; it defines the same scenario.
    code : SourceFile, optional
        File of a user-defined scenario.
    inputs : tuple of InputFile
        Files that were read.
    sigmas : mapping of str to float
        Sigmas of normal sources that another table than ``[errors]`` gives, SI.
    filter : FilterPlan, optional
        Filter of the scenario, which lacks the statistics of ``[errors]``.
    """

    scenario: Scenario
    resolved: Mapping[str, Any]
    code: SourceFile | None = None
    inputs: tuple[InputFile, ...] = ()
    sigmas: Mapping[str, float] = field(default_factory=dict)
    filter: FilterPlan | None = None


@dataclass(frozen=True)
class ScenarioType:
    """A type of scenario.

    Attributes
    ----------
    table : type of Table
        Model of ``[scenario]``.
    read : callable
        Builds the scenario from the validated table, its entries as written and the context. Raises `ScenarioError`,
        or adds several mistakes to the context and returns None.
    sources : sequence of Source, optional
        Sources against which ``[errors]`` is checked when ``[scenario]`` itself is wrong.
    """

    table: type[Table]
    read: Callable[[Any, Mapping[str, Any], FileContext], ScenarioSpec | None]
    sources: Sequence[Source] | None = None
