"""Interface between the campaign file and its scenario types."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, Final, get_args, get_origin

from mcnav.contract.quantities import Output, Source
from mcnav.contract.scenario import Scenario
from mcnav.entries.context import FileContext
from mcnav.entries.inputs import InputFile, SourceFile
from mcnav.entries.quantities import Table
from mcnav.sampler.error_model import ErrorModel

CLASS_IN_FILE: Final = re.compile(r"(?P<file>[^\x00-\x1f\x7f:]{1,200}\.py):(?P<name>[A-Za-z_][A-Za-z0-9_]{0,100})")
"""``type`` of a scenario of the user's own: a file and a class in it."""


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
    tables : mapping of str to str
        The table that gives each of them, for messages.
    complete : callable, optional
        Returns a scenario with what it takes from the statistics of the errors, which are read after it.
    further : mapping of str to Any
        Further tables of the file with the paths that their files have in a run folder.
    """

    scenario: Scenario
    resolved: Mapping[str, Any]
    code: SourceFile | None = None
    inputs: tuple[InputFile, ...] = ()
    sigmas: Mapping[str, float] = field(default_factory=dict)
    tables: Mapping[str, str] = field(default_factory=dict)
    complete: Callable[[Scenario, ErrorModel], Scenario] | None = None
    further: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class FurtherTable:
    """A table of the campaign file besides ``[scenario]``, which some types of scenario read.

    Attributes
    ----------
    form : type
        Model or type of its entry.
    description : str
        For editors.
    absent : str
        What is wrong with one where the type of scenario does not read it.
    needs, because : str
        Another table without which this one has no use, and the end of the message where it is missing.
    source_patterns : mapping of str to str
        Patterns of the names of error sources that the table brings to the scenario, by SI unit; empty for any unit.
    """

    form: Any
    description: str
    absent: str
    needs: str = ""
    because: str = ""
    source_patterns: Mapping[str, str] = field(default_factory=dict)

    @property
    def is_list(self) -> bool:
        """True where the file has several of it, ``[[name]]``."""
        form = get_args(self.form)[0] if get_origin(self.form) is Annotated else self.form
        return get_origin(form) is list


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
    outputs : sequence of Output
        Outputs that such scenarios can have, for editors and the command line.
    tables : mapping of str to FurtherTable
        Further tables of the file that it reads.
    choose_outputs : callable, optional
        Returns those outputs that the scenario of a file has, from the content of the file; all unless given.
    check_alone : callable, optional
        Adds to the context the mistakes of further tables that can be found where the scenario cannot be read; by
        default those of their forms.
    """

    table: type[Table]
    read: Callable[[Any, Mapping[str, Any], FileContext], ScenarioSpec | None]
    sources: Sequence[Source] | None = None
    outputs: Sequence[Output] = ()
    tables: Mapping[str, FurtherTable] = field(default_factory=dict)
    choose_outputs: Callable[[Mapping[str, Any]], Sequence[Output]] | None = None
    check_alone: Callable[[FileContext], None] | None = None

    def outputs_in(self, content: Mapping[str, Any]) -> Sequence[Output]:
        """Return the outputs of the scenario of a file."""
        return self.outputs if self.choose_outputs is None else self.choose_outputs(content)

    @property
    def source_patterns(self) -> Mapping[str, str]:
        """Patterns of the names of error sources that its tables bring, by SI unit; see `FurtherTable`."""
        return {
            unit: source_pattern
            for table in self.tables.values()
            for unit, source_pattern in table.source_patterns.items()
        }
