"""Allocation of errors as tables for the terminal, as rows, and as an HTML page."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final

from rich.console import Group, RenderableType
from rich.text import Text

from mcnav.analysis.allocation import MOST, Allocation, Goal, GradeChange, GradeSearch, NumberChange
from mcnav.analysis.linear_answer import LinearRequirement
from mcnav.report.figures import allocate as drawn
from mcnav.report.figures.lincov import short_name
from mcnav.report.fitted_table import FittedTable, numbers, texts
from mcnav.report.format import number
from mcnav.report.html import filled
from mcnav.report.lincov import TERMINAL, headline, requirement_rows, shown_limit, shown_value, units_shown
from mcnav.report.requirements import TONES

EXPLANATION: Final = (
    "Linear analysis for normal errors. Every number proposed was put into the campaign, and its linear answer "
    "computed: it is the value shown. mcnav run tests a choice by Monte Carlo simulation."
)

LOOKED_AT: Final = (
    f"“Not by this alone”: neither smaller nor larger, at any multiple looked at from × 0 to × {MOST:,.0f}; the value "
    "shown is the closest to the limit."
)

GROWS: Final = (
    "A multiple above × 1 is a larger number: the gains of the filter follow from what it believes, and then suit the "
    "errors that it neglects better."
)

IN_RUN: Final = (
    "A constant bias that a filter estimates may be large by itself. Real units with a larger bias have a larger "
    "instability of it in run, too: the lines of both together are for them."
)

ENDED: Final = 1.05
"""Margin from which a multiple is not that at which a requirement is just met."""

ENDS: Final = (
    "A multiple whose linear value is well below the limit is the largest one with a linear answer: of larger ones "
    "errors are beyond the range of linear analysis, or the campaign is refused."
)

FAILING: Final = 3
"""Changes that do not meet a goal of which a table in the terminal shows the linear value."""


def goal_title(allocation: Allocation, goal: Goal) -> str:
    """Return what a table of changes is for."""
    if goal.met:
        return "Numbers may be as large as this, one at a time"
    if len(goal.requirements) == 1:
        return f"To meet: {requirement_rows(allocation.answer)[goal.requirements[0]]['requirement']}"
    return (
        "To meet both requirements"
        if len(goal.requirements) == 2
        else (f"To meet all {len(goal.requirements)} requirements")
    )


def standing(allocation: Allocation) -> tuple[str, str]:
    """State whether the requirements are met, and how many numbers can meet them alone; return words and tone."""
    words, tone = headline(allocation.answer)
    goal = allocation.goals[-1]
    alone = [change for change in goal.changes if len(change.paths) == 1]
    reaching = sum(change.reached for change in alone)
    if goal.met:
        return words, tone
    can = (
        "no number can meet them alone"
        if not reaching
        else (f"{reaching} of {len(alone)} numbers can meet {'it' if len(goal.requirements) == 1 else 'them'} alone")
    )
    return f"{words}; {can.replace('them', 'it') if len(goal.requirements) == 1 else can}", tone


def value_words(allocation: Allocation, result: LinearRequirement) -> tuple[str, str]:
    """Format the linear value of a requirement, and its limit."""
    shown = units_shown(allocation.answer.outputs)[allocation.answer.outputs[result.requirement.outputs[0]].name]
    return shown_value(result, *shown), shown_limit(result, *shown)


def change_row(allocation: Allocation, goal: Goal, change: NumberChange) -> dict[str, Any]:
    """Arrange one change: the number now and then, its multiple, and the linear value then."""
    value, limit = value_words(allocation, change.result)
    if math.isnan(change.factor):
        needed, multiple = "not by this alone", f"× {number(change.closest, 3) if change.closest else 0}"
    elif math.isinf(change.factor):
        needed, multiple = "any", f"to × {MOST:,.0f}"
    else:
        needed, multiple = change.needed or "all of them", f"× {number(change.factor, 3)}"
    return {
        "number": change.label,
        "now": change.now or f"{len(change.paths)} numbers",
        "needed": needed,
        "multiple": multiple,
        "value": value,
        "limit": limit,
        "requirement": short_name(change.result, allocation.answer),
        "reached": change.reached,
        "together": len(change.paths) > 1,
    }


def goal_notes(goal: Goal) -> list[str]:
    """Say how far numbers were looked at, and what a larger one does."""
    notes = []
    if any(not change.reached for change in goal.changes):
        notes.append(LOOKED_AT)
    if not goal.met and any(change.reached and change.factor > 1.0 for change in goal.changes):
        notes.append(GROWS)
    if goal.met and any(math.isfinite(each.factor) and each.result.margin > ENDED for each in goal.changes):
        notes.append(ENDS)
    if goal.met and any(change.label.startswith("bias and instability") for change in goal.changes):
        notes.append(IN_RUN)
    return notes


def goal_table(allocation: Allocation, goal: Goal) -> FittedTable:
    """Tabulate the changes that just meet a goal."""
    several = len(goal.requirements) > 1
    columns = [*texts("number", "now", "may be" if goal.met else "just met with"), *numbers("multiple")]
    columns += [*numbers("linear value then", "limit"), *texts(*(["of"] if several else []))]
    table = FittedTable(goal_title(allocation, goal), columns)
    failing = [change for change in goal.changes if not change.reached]
    for change in (change for change in goal.changes if change.reached or change in failing[:FAILING]):
        row = change_row(allocation, goal, change)
        style = "" if row["reached"] else "dim"
        cells = [row["number"], row["now"], row["needed"], row["multiple"], row["value"], row["limit"]]
        table.add(*(Text(cell, style=style) for cell in [*cells, *([row["requirement"]] if several else [])]))
    if len(failing) > FAILING:
        table.add(f"and {len(failing) - FAILING} more", "", "not by this alone", *[""] * (len(columns) - 3))
    return table


def grade_words(search: GradeSearch) -> str:
    """State what changes by one grade of the catalogue do."""
    if search.whole is None:
        return f"No grade of the catalogue states a {'finer' if search.finer else 'coarser'} number."
    if not search.finer:
        kept = sum(change.met for change in search.changes)
        joined = any(len(change.moves) > 1 for change in search.changes)
        words = f"{kept} of {len(search.changes)} numbers may be one grade of the catalogue coarser, one at a time"
        return words + ("; a bias takes its instability in run along." if joined else ".")
    if not search.changes:
        return "All numbers moved to the next finer grade of the catalogue do not meet the requirements."
    count = len(search.changes[0].moves)
    fewest = "fewest" if search.exhaustive else "a set that cannot be reduced"
    moves = "one number moved" if count == 1 else f"{count} numbers moved"
    return f"Met with {moves} to the next finer grade of the catalogue ({fewest})."


def move_words(change: GradeChange) -> str:
    """List the moves of a change by one grade."""
    return "; ".join(f"{move.path} {move.now} → {move.needed} ({move.grade})" for move in change.moves)


def grade_rows(allocation: Allocation) -> list[dict[str, Any]]:
    """List the changes by one grade with the requirement of the least margin."""
    search = allocation.grades
    if search is None:
        return []
    shown = search.changes or ((search.whole,) if search.whole is not None else ())
    rows = []
    for change in shown:
        value, limit = value_words(allocation, change.worst)
        rows.append({
            "moves": move_words(change),
            "finding": "met" if change.met else "not met",
            "value": value,
            "limit": limit,
            "requirement": short_name(change.worst, allocation.answer),
        })  # fmt: skip
    return rows


def grade_table(allocation: Allocation, search: GradeSearch) -> FittedTable:
    """Tabulate changes by one grade."""
    columns = [*texts("finding", "numbers moved by one grade"), *numbers("linear value then", "limit"), *texts("of")]
    table = FittedTable(grade_words(search), columns)
    for row in grade_rows(allocation):
        table.add(row["finding"], row["moves"], row["value"], row["limit"], row["requirement"])
    return table


def printed(allocation: Allocation) -> RenderableType:
    """Arrange the terminal's lines."""
    words, tone = standing(allocation)
    lines: list[RenderableType] = [Text(words, style=f"bold {TERMINAL[tone]}")]
    for goal in allocation.goals:
        lines += ["", goal_table(allocation, goal), *map(Text, goal_notes(goal))]
    if allocation.grades is not None:
        lines += ["", grade_table(allocation, allocation.grades)]
    return Group(*lines)


def change_rows(allocation: Allocation) -> list[dict[str, Any]]:
    """List all changes of all goals, a row each."""
    return [
        {"goal": goal_title(allocation, goal), **{key: row[key] for key in row if key not in ("reached", "together")},
         "factor": change.factor if math.isfinite(change.factor) else None, "reached": row["reached"]}
        for goal in allocation.goals
        for change in goal.changes
        for row in [change_row(allocation, goal, change)]
    ]  # fmt: skip


def table(allocation: Allocation) -> Mapping[str, Any]:
    """Arrange an allocation as ``allocate.json`` has it."""
    search = allocation.grades
    return {
        "campaign": allocation.answer.campaign,
        "met": allocation.answer.met,
        "requirements": requirement_rows(allocation.answer),
        "changes": change_rows(allocation),
        "grades": None if search is None else {"words": grade_words(search), "finer": search.finer,
                                               "exhaustive": search.exhaustive, "changes": grade_rows(allocation)},
        "linear_answers": allocation.computed,
    }  # fmt: skip


def render(allocation: Allocation) -> str:
    """Render the page."""
    words, tone = standing(allocation)
    requirements = [
        row | {"tone": TONES.get(row["finding"], "undecided")} for row in requirement_rows(allocation.answer)
    ]
    return filled(
        "allocate.html",
        campaign=allocation.answer.campaign,
        headline=words,
        tone=tone,
        explanation=EXPLANATION,
        requirements=requirements,
        goals=[_shown_goal(allocation, goal, place) for place, goal in enumerate(allocation.goals, start=1)],
        grades=None if allocation.grades is None else grade_words(allocation.grades),
        grade_rows=[row | {"tone": TONES[row["finding"]]} for row in grade_rows(allocation)],
        most=f"{MOST:,.0f}",
        computed=allocation.computed,
    )


def _shown_goal(allocation: Allocation, goal: Goal, place: int) -> dict[str, Any]:
    rows = [change_row(allocation, goal, change) for change in goal.changes]
    return {
        "title": goal_title(allocation, goal),
        "met": goal.met,
        "several": len(goal.requirements) > 1,
        "figure": drawn.multiples(goal, place),
        "reached": [row for row in rows if row["reached"]],
        "failing": [row for row in rows if not row["reached"]],
        "notes": goal_notes(goal),
    }
