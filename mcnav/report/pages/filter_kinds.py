"""Kinds of filters compared, as a page, a table of the terminal, a data frame and ``filters.json``."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import pandas as pd

from mcnav.analysis.filter_kinds import HEADING, HORIZONTAL, KindComparison, KindResult
from mcnav.report.document.parts import Facts, Note, Page, Part, Section, Sentence, Verdict, Verdicts
from mcnav.report.document.table import Cell, Column, Table
from mcnav.report.drawing.figure import Figure
from mcnav.report.drawing.marks import Axis, Line, Panel, Rule, Series, numbered
from mcnav.report.format import number
from mcnav.report.names import humanize
from mcnav.report.pages.screen import answered
from mcnav.report.statements.means import mean_sentence
from mcnav.report.statements.sweep import shown
from mcnav.report.statements.words import TONES, WORST

GROUPS: Final = ("navigation", "position", "velocity", "attitude")
"""Groups of errors in the data."""

NOTE: Final = (
    "Every kind has the same samples and the same noise, by the reference engine. The ratio is that of the true sigma "
    "to the filter's own where the verdict is decided, over the whole flight, with the interval of all epochs "
    "together. NEES and sigmas are those at the end. To first order all kinds are one filter: linear analysis has one "
    "answer. Horizontal position is DRMS, the root of the sum of two variances. What a sample takes is its computing "
    "time on one thread."
)


def terminal(comparison: KindComparison) -> list[Part]:
    """List what the terminal shows."""
    return [*_mean_errors(comparison), _verdict(comparison), kind_table(comparison)]


def page(comparison: KindComparison) -> Page:
    """Return the page."""
    facts = Facts([("kinds", ", ".join(comparison.kinds)), *(
        [] if comparison.variable is None else
        [(comparison.variable.path, ", ".join(shown(comparison.variable, value) for value in comparison.variable.values))]
    ), ("samples", ", ".join(sorted({f"{result.summary.samples:,}" for result in comparison.results})))])  # fmt: skip
    parts: list[Part] = [kind_table(comparison), Note(NOTE)]
    sections = [Section("kinds", "Kinds of filters", parts)]
    if comparison.variable is not None and not comparison.variable.words:
        sections.append(Section("values", f"Over {comparison.variable.path}", [figure(comparison)]))
    head: list[Part] = [*_mean_errors(comparison), Verdicts([_verdict(comparison)]), facts]
    return answered(
        Page(f"{comparison.campaign}: filters", "Kinds of filters", comparison.campaign, head, sections), rest="Filter"
    )


def _mean_errors(comparison: KindComparison) -> list[Part]:
    """Say first in which runs mean errors exceed one sigma."""
    said = [(result, mean_sentence(result.summary)) for result in comparison.results]
    return [Sentence(f"{each.kind} ({each.folder}): {words}", "partly") for each, words in said if words]


def _verdict(comparison: KindComparison) -> Verdict:
    """Say which kinds are consistent, or from which value on each is optimistic."""
    if comparison.variable is None:
        words = [f"{result.kind} is {result.verdict}" for result in comparison.results]
        tones = {TONES.get(result.verdict, "undecided") for result in comparison.results}
        return Verdict(f"{'; '.join(words)}.", max(tones, key=WORST.index))
    words = []
    for kind, begin in comparison.optimistic_from.items():
        at = None if begin is None else shown(comparison.variable, begin)
        words.append(f"{kind}: {'nowhere certainly optimistic' if at is None else f'optimistic from {at} on'}")
    return Verdict(f"Over {comparison.variable.path}: {'; '.join(words)}.", "")


def kind_table(comparison: KindComparison) -> Table[KindResult]:
    """Tabulate the kinds: verdict, sigma, NEES, cost."""
    variable = comparison.variable
    columns: list[Column[KindResult]] = [
        Column("Kind", lambda row: row.kind, kind="label"),
        Column("Verdict", lambda row: Cell(row.verdict, tone=TONES.get(row.verdict)), kind="text"),
        Column("True σ / filter σ", _factor, "true / own"),
        Column("Decided by", lambda row: humanize(row.decided_by), kind="words", spare=3),
        Column("NEES / 9 at the end", _nees, "NEES / 9"),
        Column("Horizontal position, true DRMS (filter's)", lambda row: _sigmas(row, HORIZONTAL, 1.0),
               "horizontal DRMS", unit="m"),
        Column("Heading, true σ (filter's)", lambda row: _sigmas(row, (HEADING,), math.degrees(1.0)), "heading σ",
               unit="deg", spare=1),
        Column("Failed", lambda row: f"{row.summary.failed:,}", spare=4),
        Column("A sample takes", lambda row: number(row.milliseconds, 2),
               "cost", unit="ms", spare=2),
    ]  # fmt: skip
    if variable is not None:
        columns.insert(0, Column(variable.path, lambda row: shown(variable, float(row.value or 0.0)), kind="label"))
    return Table("Kinds of filters by Monte Carlo.", columns, comparison.results)


def _factor(each: KindResult) -> str:
    known = each.factor
    if known is None:
        return "–"
    return f"{number(known[0], 3)} ({number(known[1], 3)} to {number(known[2], 3)})"


def _nees(each: KindResult) -> str:
    group = each.group("navigation")
    if group is None or group.nees_mean is None:
        return "–"
    ends = ["–" if end is None else number(end / group.size, 3) for end in group.nees_interval or (None, None)]
    return f"{number(group.nees_mean / group.size, 3)} ({' to '.join(ends)})"


def _sigmas(each: KindResult, names: tuple[str, ...], scale: float) -> str:
    true, own = each.sigmas(names)
    return f"{number(true * scale, 3)} ({number(own * scale, 3)})"


def figure(comparison: KindComparison) -> Figure:
    """Draw the ratio of true to filter sigma by value, a line for each kind."""
    variable = comparison.variable
    assert variable is not None
    key: list[Series] = [numbered(2 * place, kind) for place, kind in enumerate(comparison.kinds)]
    axis = Axis(variable.path, variable.unit, log=variable.log)
    lines, columns = [], {variable.label: variable.values}
    for series, kind in zip(key, comparison.kinds, strict=True):
        factors = np.array([math.nan if each.factor is None else each.factor[0] for each in comparison.of(kind)])
        lines.append(Line(series, variable.values, factors))
        columns[kind] = factors
    return Figure(
        name="filters",
        title="True over filter sigma",
        description="Ratio of true to filter sigma where the verdict is decided, by kind.",
        panels=[
            Panel("Where the verdict is decided", axis, Axis("true σ / filter σ"), [Rule(1.0, level=True), *lines])
        ],
        key=key,
        columns=columns,
        file="filters.csv",
    )


def row(comparison: KindComparison, each: KindResult) -> Mapping[str, Any]:
    """Return a result in data: angles in rad, lengths in m, times in s or minutes as their names say."""
    factor = each.factor or (None, None, None)
    horizontal, heading = each.sigmas(HORIZONTAL), each.sigmas((HEADING,))
    data: dict[str, Any] = {} if comparison.variable is None else {comparison.variable.label: each.value}
    data |= {
        "kind": each.kind, "verdict": each.verdict, "ratio": factor[0], "ratio_low": factor[1], "ratio_high": factor[2],
        "decided_by": each.decided_by, "samples": each.summary.samples, "failed": each.summary.failed,
    }  # fmt: skip
    for name in GROUPS:
        group = each.group(name)
        low, high = (None, None) if group is None or group.nees_interval is None else group.nees_interval
        data |= {
            f"nees_{name}": None if group is None else group.nees_mean, f"nees_{name}_low": low,
            f"nees_{name}_high": high, f"nees_{name}_expected": None if group is None else group.size,
        }  # fmt: skip
    data |= {
        "sigma_position_horizontal": horizontal[0], "own_sigma_position_horizontal": horizontal[1],
        "sigma_heading": heading[0], "own_sigma_heading": heading[1], "milliseconds": each.milliseconds,
        "folder": each.folder,
    }  # fmt: skip
    return data


def frame(comparison: KindComparison) -> pd.DataFrame:
    """Tabulate the results, a row each."""
    return pd.DataFrame([row(comparison, result) for result in comparison.results])


def table(comparison: KindComparison) -> Mapping[str, Any]:
    """Return the content of ``filters.json``."""
    return {
        "campaign": comparison.campaign,
        "kinds": list(comparison.kinds),
        "varied": None if comparison.variable is None else comparison.variable.path,
        "unit": None if comparison.variable is None else comparison.variable.unit,
        "optimistic_from": None if comparison.variable is None else dict(comparison.optimistic_from),
        "filters": [
            {name: None if isinstance(value, float) and not math.isfinite(value) else value
             for name, value in row(comparison, result).items()}
            for result in comparison.results
        ],
    }  # fmt: skip
