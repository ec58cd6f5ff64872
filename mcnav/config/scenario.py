"""The scenario of a campaign file, with the error sources that it has."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from pydantic import TypeAdapter

from mcnav.config.sources import KnownSources
from mcnav.contract.members import lacks_scenario
from mcnav.contract.scenario import ScenarioError
from mcnav.entries.context import FileContext
from mcnav.entries.validation import validate, validate_entry
from mcnav.systems.description import ScenarioType
from mcnav.systems.registry import (
    SCENARIO_TYPES,
    ScenarioSpec,
    scenario_type,
)  # fmt: skip


def read_scenario(entries: Any, context: FileContext) -> tuple[ScenarioSpec | None, KnownSources | None]:
    """Read the scenario, and the sources that ``[errors]`` may name; mistakes are added to the context.

    Where the scenario cannot be read, its further tables are checked as far as they do not depend on it.
    """
    if not isinstance(entries, dict):
        return None, None  # the validation of the whole file reports it
    kind = scenario_type(entries.get("type"))
    if kind is None:
        known = f"{', '.join(SCENARIO_TYPES)}, or a file and class such as 'my_module.py:Boost'"
        came = f"got {entries['type']!r}; expected" if "type" in entries else "is missing; it is"
        context.problem("scenario.type", f"{came} one of {known}")
        return None, None
    before = len(context.problems)
    described = _read_by_type(kind, entries, context)
    if described is None:
        _check_further(kind, context)
    sources = kind.sources if described is None else described.scenario.sources
    if sources is None:
        return described, None
    # sources of sensors are not known where a table is wrong
    incomplete = described is None or len(context.problems) > before
    brought = [table.source_patterns.values() for name, table in kind.tables.items() if name in context.content]
    return described, KnownSources(sources, tuple(each for some in brought for each in some) if incomplete else ())


def _read_by_type(kind: ScenarioType, entries: dict[str, Any], context: FileContext) -> ScenarioSpec | None:
    """Read the table of a scenario and build it; mistakes are added to the context."""
    table = validate(kind.table, entries, context, "scenario")
    if table is None:
        return None
    try:
        described = kind.read(table, entries, context)
    except ScenarioError as wrong:
        context.problem(f"scenario.{wrong.key}", str(wrong))
        return None
    lines = [] if described is None else lacks_scenario(described.scenario)
    for line in lines:
        context.problem("scenario.type", line)
    return None if lines else described


def _check_further(kind: ScenarioType, context: FileContext) -> None:
    """Add the mistakes of further tables of a scenario that cannot be read, but those that are there already."""
    alone = replace(context, problems=[])
    if kind.check_alone is not None:
        kind.check_alone(alone)
    else:
        for name, further in kind.tables.items():
            if name in context.content:
                validate_entry(TypeAdapter(further.form), context.content[name], alone, name)
    known = {problem.key for problem in context.problems}
    context.problems.extend(problem for problem in alone.problems if problem.key not in known)
