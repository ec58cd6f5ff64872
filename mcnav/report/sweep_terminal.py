"""A sweep in the terminal."""

from __future__ import annotations

from typing import Final

import numpy as np
from rich.console import Group, RenderableType
from rich.text import Text

from mcnav.analysis.sweep import Sweep
from mcnav.report.figures import sweep as drawn
from mcnav.report.fitted_table import FittedTable, numbers, texts
from mcnav.report.format import interval, number
from mcnav.report.model import humanize
from mcnav.report.sweep_words import (
    confirmation_rows,
    confirmed_words,
    headline,
    met_words,
    point_words,
    remarks,
    shown,
    title_of,
    tone_of,
)

TERMINAL: Final = {"agrees": "green", "differs": "red", "partly": "yellow", "undecided": "yellow"}

MOST_LINES: Final = 12
"""Points of a grid that are shown."""


def printed(sweep: Sweep) -> RenderableType:
    """Arrange the terminal's lines: headline, limits, some points of the grid, Monte Carlo."""
    words, tone = headline(sweep)
    lines: list[RenderableType] = [Text(words, style=f"bold {TERMINAL.get(tone, '')}")]
    lines += [Text(each) for each in remarks(sweep)]
    if sweep.just_met:
        lines += ["", _limits(sweep)]
    lines += ["", _points(sweep), *map(Text, _not_shown(sweep))]
    if sweep.confirmations:
        stated, colour = confirmed_words(sweep)
        lines += ["", Text(stated, style=f"bold {TERMINAL[colour]}"), _confirmations(sweep)]
    return Group(*lines)


def _limits(sweep: Sweep) -> FittedTable:
    *first, last = sweep.variables
    table = FittedTable(f"Limits along {last.path}", texts("limit", *(each.path for each in first), "met"), keys=1)
    for each in sweep.just_met:
        fixed = [] if each.fixed is None else [shown(first[0], each.fixed)]
        words = Text(met_words(each, last), style=TERMINAL[tone_of(each)])
        table.add(title_of(sweep.measures[each.measure], sweep, True), *fixed, words)
    return table


def _points(sweep: Sweep) -> FittedTable:
    """Tabulate some points of the grid, the ends included."""
    scale = drawn.scales(sweep)
    titles = [f"{title_of(each, sweep)} [{each.shown_in}]" for each in sweep.measures]
    table = FittedTable("Linear analysis", numbers(*(v.label for v in sweep.variables), *titles), len(sweep.variables))
    places = list(np.ndindex(sweep.shape))
    chosen = np.unique(np.linspace(0, len(places) - 1, min(len(places), MOST_LINES)).round().astype(int))
    own = np.isfinite(sweep.own)
    for place in (places[each] for each in chosen):
        values = [v.values[at] for v, at in zip(sweep.variables, place, strict=True)]
        cells = [
            number(true) + (f" ({number(stated)})" if own[(*place, index)] else "")
            for index, (true, stated) in enumerate(
                zip(sweep.values[place] * scale, sweep.own[place] * scale, strict=True)
            )
        ]
        table.add(*map(number, values), *cells)
    return table


def _not_shown(sweep: Sweep) -> list[str]:
    """Say which points are not in the table."""
    count, notes = int(np.prod(sweep.shape)), []
    if count > MOST_LINES:
        notes.append(f"{MOST_LINES} of {count:,} points shown; sweep.csv and --format csv have all.")
    if sweep.added:
        points = "1 point was" if len(sweep.added) == 1 else f"{len(sweep.added):,} points were"
        notes.append(f"Besides them {points} added to find where limits are met; sweep.json has them.")
    return notes


def _confirmations(sweep: Sweep) -> FittedTable:
    columns = [*texts("point", "final error"), *numbers("linear σ", "paired σ", "paired ratio", "interval")]
    table = FittedTable("Monte Carlo", [*columns, *texts("verdict")], keys=2)
    for each in sweep.confirmations:
        for row in confirmation_rows(sweep, each):
            label = f"{humanize(row['output'])} [{row['unit']}]"
            ends = interval(row["ratio_paired_from"], row["ratio_paired_to"])
            figures = [number(row[name]) for name in ("sigma_linear", "sigma_paired", "ratio_paired")]
            words = Text(row["verdict"] or "–", style=TERMINAL.get(row["verdict"], ""))
            table.add(point_words(sweep, each), label, *figures, ends, words)
    return table
