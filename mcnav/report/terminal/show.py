"""A finished run in the terminal: verdicts, sigmas, budget, requirements and the filter, from its summary."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

from rich.console import Group, RenderableType
from rich.text import Text

from mcnav.analysis.summary import Summary
from mcnav.errors import suggestion
from mcnav.physics.units import printable
from mcnav.report.columns.faults import faults_table
from mcnav.report.columns.filter_columns import groups_table, sensors_table, sigmas_of
from mcnav.report.columns.result_table import ResultTable, Units
from mcnav.report.columns.result_tables import CORRELATIONS, Results, budget_table
from mcnav.report.document.fitted_table import FittedTable, numbers, texts
from mcnav.report.document.terminal_parts import fitted
from mcnav.report.format import share
from mcnav.report.names import humanize, labels_in
from mcnav.report.terminal import terminal

LONGEST: Final = 2_000
"""Characters of a text that are shown."""

MOST: Final = 12
"""Causes that a budget lists."""

LEAST: Final = 0.005
"""Share of some output's variance from which a cause is listed."""


def escaped(value: Any) -> Any:
    """Escape what is not printable in the texts of a JSON value: a run folder may come from anywhere."""
    if isinstance(value, str):
        return printable(value, LONGEST)
    if isinstance(value, Mapping):
        return {printable(str(key), LONGEST): escaped(entry) for key, entry in value.items()}
    return [escaped(entry) for entry in value] if isinstance(value, list) else value


def unknown_table(tables: Mapping[str, ResultTable], name: str) -> str:
    """Return the message on a table that a run does not have."""
    return f"the run has no table {printable(name)!r}{suggestion(name, list(tables))}"


def show(summary: Summary, units: Units = "shown") -> RenderableType:
    """Show verdicts, sigmas, budget, requirements and consistency of the filter."""
    parts: list[RenderableType] = [terminal.comparison({"": summary}), terminal.verdict(summary)]
    if (warning := terminal.warnings({summary.campaign: summary})) is not None:
        parts.insert(0, warning)
    if any(summary.sigma_linear) and not summary.beyond_range:
        parts.append(budget(summary, budget_table(Results(summary, units))))
    if summary.requirements:
        parts.append(terminal.requirements(summary))
    if summary.filter:
        parts += _filter(summary, units)
    return Group(*_spaced(parts))


def _spaced(parts: Sequence[RenderableType]) -> Iterator[RenderableType]:
    for place, part in enumerate(parts):
        if place:
            yield Text()
        yield part


def budget(summary: Summary, table: ResultTable) -> FittedTable:
    """Tabulate the shares of the largest causes in the linear variance of each output, in per cent."""
    labels = [*labels_in(summary), *(humanize(process.name) for process in summary.processes)]
    names, outputs = summary.causes_of_errors, summary.names
    shares: dict[str, list[float]] = {name: [] for name in (*names, CORRELATIONS)}
    for row in table.rows:
        shares[row["cause"]].append(math.nan if row["share"] is None else row["share"])
    crossed = shares.pop(CORRELATIONS)
    sizes = {name: [0.0 if math.isnan(each) else each for each in result] for name, result in shares.items()}
    falling = sorted(sizes, key=lambda name: -sum(sizes[name]))
    large = [name for name in falling if max(sizes[name], default=0.0) >= LEAST][:MOST]
    rest = [name for name in falling if name not in large and any(sizes[name])]
    if len(rest) == 1:
        large, rest = [*large, *rest], []
    shown = FittedTable("Linear error budget: share of the variance, %", [
        *texts("error"), *numbers(*map(humanize, outputs)),
    ])  # fmt: skip
    label_of = dict(zip(names, labels, strict=True))
    for name in large:
        shown.add(label_of[name], *map(share, shares[name]))
    if rest:
        shown.add(f"{len(rest)} others", *(share(sum(shares[name][i] for name in rest)) for i in range(len(outputs))))
    if any(abs(each) > 1e-12 for each in crossed):
        shown.add(CORRELATIONS, *map(share, crossed))
    return shown


def _filter(summary: Summary, units: Units) -> list[RenderableType]:
    """Tabulate the verdicts on groups of states and outputs, and the innovations of sensors."""
    groups, sensors = groups_table(summary).read, sensors_table(summary).read
    groups = replace(groups, title=f"Filter: {groups.title[:1].lower()}{groups.title[1:]}")
    tables = (groups, sigmas_of(summary, "output", units), sensors, faults_table(summary, units).read)
    return [fitted(table) for table in tables if table is not None and table.rows]


def tabulate(table: ResultTable) -> FittedTable:
    """Show any table of results."""
    first = table.rows[0]
    columns = [
        (numbers if isinstance(first[name], (int, float)) and not isinstance(first[name], bool) else texts)(name)[0]
        for name in table.columns
    ]
    shown = FittedTable(table.title, columns, keys=max(table.keys, 1))
    for row in table.rows:
        shown.add(*map(_cell, row.values()))
    return shown


def _cell(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return "–"
    return f"{value:.6g}" if isinstance(value, float) else str(value)
