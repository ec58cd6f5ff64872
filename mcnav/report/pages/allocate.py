"""Allocation of errors as a page, in the terminal, and as rows."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Final

from mcnav.analysis.allocation import MOST, OTHERS, Allocation, Goal, GradeChange, GradeSearch, NumberChange
from mcnav.analysis.examination import Linearity
from mcnav.analysis.linear_answer import LinearRequirement
from mcnav.analysis.remedies import DOUBTED
from mcnav.analysis.simulated_requirements import Basis
from mcnav.analysis.summary import RequirementEntry
from mcnav.report.columns.requirements import TONES
from mcnav.report.document.parts import Findings, Folded, Note, Page, Part, Section, Sentence, Verdict, joined
from mcnav.report.document.table import CODE, WRAPPED, Cell, Column, Table
from mcnav.report.drawing.figure import Figure
from mcnav.report.figures import allocate as drawn
from mcnav.report.figures.lincov import short_name
from mcnav.report.format import number
from mcnav.report.pages.lincov import (
    headline,
    requirement_rows,
    requirements_in_brief,
    shown_limit,
    shown_value,
    units_shown,
)
from mcnav.report.pages.screen import answered
from mcnav.report.statements.details import remarks_in
from mcnav.report.statements.lincov import large_mean_words
from mcnav.report.statements.requirements import limited_in_brief
from mcnav.report.statements.words import several

EXPLANATION: Final = "Linear analysis for normal errors."

CHECKED: Final = "Each number proposed was put into the campaign: the value shown is that campaign's linear answer."

FIRST: Final = 8
"""Numbers on the first screen, those that may change least first."""

ALONE: Final = (
    "By linear analysis alone: no number here was simulated. mcnav allocate --confirm 3 simulates the three smallest "
    "changes."
)

SCALED: Final = (
    "Linear values are multiplied by the one-sided {confidence:g} % bound of {samples:,} samples of the campaign as it "
    "is over its linear value. Factors: {scales}. The smallest changes were simulated as well: “simulated then” is "
    "their bound."
)

FINDINGS: Final = ("met", "undecided", "not met")
"""Findings, the worst last."""

MORE: Final = (
    "Linear analysis proposes {} more changes, which were not simulated and may miss the limit: mcnav allocate "
    "--confirm {} simulates them."
)

ELSEWHERE: Final = (
    "Linear analysis proposes {} changes that meet this requirement. Those that meet all requirements are simulated, "
    "and stand below."
)

UNCONFIRMED: Final = "Left out, because simulation does not confirm a change: {}."

LOOKED_AT: Final = (
    f"“Not by this alone”: neither smaller nor larger, at any multiple looked at from × 0 to × {MOST:,.0f}. The value "
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

AS_IT_IS: Final = "Linear analysis {} of the campaign as it is: simulate it, with --confirm 3."
NOT_THEN: Final = "Linear analysis does not hold with {}: simulate before you rely on it."
UNEXAMINED: Final = "Linear analysis was not examined {}: {}. --examine does it."
ONLY: Final = "Flights examined {}; all other changes are by linear analysis alone. --examine examines them."
"""What is said of the examination of proposals by linear analysis alone."""

ENDED: Final = 1.05
"""Margin from which a multiple is not that at which a requirement is just met."""

ENDS: Final = (
    "A multiple whose linear value is well below the limit is the largest one with a linear answer. Larger errors are "
    "beyond the range of linear analysis, or the campaign is refused."
)

FAILING: Final = 3
"""Changes that do not meet a goal of which a table in the terminal shows the linear value."""

LOOSENED: Final = (
    "Largest value of each number with which all requirements are met, the others unchanged; groups are multiplied "
    f"together. “Any”: up to {MOST:,.0f} times the present number. Below the linear value: the limit with the least "
    "margin then."
)

TIGHTENED: Final = (
    "Value of each number with which the {} just met, the others unchanged; groups are multiplied together. Below the "
    "linear value: the limit with the least margin then."
)

INSUFFICIENT: Final = "Linear value that the others leave when a number is multiplied by the factor shown."

GRADES: Final = (
    "Numbers of the inertial measurement unit at the next value among the catalogue’s grades (mcnav docs imu), and the "
    "requirement with the least margin then."
)
"""Captions of tables."""


def basis_words(allocation: Allocation) -> str:
    """Say what advice rests on: linear analysis alone, or a simulation that scales it."""
    basis = allocation.basis
    if basis is None:
        return ALONE
    names = [short_name(requirement, allocation.answer) for requirement in allocation.answer.requirements]
    scales = [f"{name} × {number(scale, 3)}" for name, scale in zip(names, basis.scales, strict=True)
              if math.isfinite(scale)]  # fmt: skip
    return SCALED.format(samples=basis.samples, scales=", ".join(scales), confidence=100.0 * basis.confidence)


def goal_title(allocation: Allocation, goal: Goal) -> str:
    """Return what a table of changes is for."""
    if goal.met:
        alone = "By linear analysis alone, numbers" if allocation.basis is None else "Numbers"
        return f"{alone} may be as large as this, one at a time"
    if len(goal.requirements) == 1:
        return f"To meet: {requirement_rows(allocation.answer)[goal.requirements[0]].requirement}"
    return (
        "To meet both requirements"
        if len(goal.requirements) == 2
        else (f"To meet all {len(goal.requirements)} requirements")
    )


def standing(allocation: Allocation) -> tuple[str, str]:
    """State whether the requirements are met, and how many numbers can meet them alone; return words and tone.

    What is met is not green where linear analysis was not examined.
    """
    words, tone = headline(allocation.answer) if allocation.basis is None else _simulated_headline(allocation.basis)
    if allocation.basis is None and tone == "agrees" and not allocation.linearity:
        tone = ""
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


def _simulated_headline(basis: Basis) -> tuple[str, str]:
    """State how many requirements the samples show to be met; return the words and their tone."""
    findings = [entry.finding for entry in basis.entries]
    counts = [(findings.count(finding), finding) for finding in ("met", "not met", "undecided") if finding in findings]
    worst = max(counts, key=lambda count: FINDINGS.index(count[1]))[1]
    needed = max((entry.samples_needed or 0 for entry in basis.entries if entry.finding == "undecided"), default=0)
    decided = f" (about {needed:,} samples would decide)" if needed else ""
    by = f"by {basis.samples:,} samples{decided}"
    if len(findings) == 1:
        return f"The requirement is {worst} {by}", TONES[worst]
    if len(counts) == 1:
        both = "Both" if len(findings) == 2 else f"All {len(findings)}"
        return f"{both} requirements are {worst} {by}", TONES[worst]
    counted = ", ".join(f"{count} {finding}" for count, finding in counts)
    return f"Of {len(findings)} requirements {counted} {by}", TONES[worst]


def freedom_words(allocation: Allocation) -> list[str]:
    """Say by how much all numbers may grow together, or the one number whose change is the smallest; else nothing."""
    goal = allocation.goals[-1]
    stated = goal.stated(shown_changes(allocation, goal)[0])
    if stated is None:
        return []
    multiple = number(stated.factor, 3)
    if goal.met:
        label = stated.label
        words = f"{label[:1].upper()}{label[1:]} together" if len(stated.paths) > 1 else label
        return [f"{words} may be {multiple} times as large."]
    them = "it" if len(goal.requirements) == 1 else "them"
    return [f"Smallest change that meets {them}: {stated.label} × {multiple}."]


def value_words(allocation: Allocation, result: LinearRequirement) -> tuple[str, str]:
    """Format the linear value of a requirement, and its limit."""
    shown = units_shown(allocation.answer.outputs)[allocation.answer.outputs[result.requirement.outputs[0]].name]
    return shown_value(result, *shown), shown_limit(result, *shown)


@dataclass(frozen=True)
class ChangeRow:
    """One change: the number now and then, its multiple, and the linear value then, as CSV and JSON have it."""

    goal: str
    number: str
    now: str
    needed: str
    multiple: str
    value: str
    limit: str
    requirement: str
    factor: float | None
    reached: bool
    exceedance: float | None = None
    simulated: str = ""
    confirmed: bool = False
    linearity: str = ""


@dataclass(frozen=True)
class GradeRow:
    """A change by one grade with the requirement of the least margin, as JSON has it."""

    moves: str
    finding: str
    value: str
    limit: str
    requirement: str
    simulated: str = ""
    linearity: str = ""


def simulated_words(allocation: Allocation, entry: RequirementEntry | None) -> str:
    """Format the bound of a simulated requirement; empty where nothing was simulated."""
    if entry is None:
        return ""
    low, high = entry.interval
    if entry.kind == "box":
        return f"at least {100.0 * (low or 0.0):.3f} %"
    if high is None:
        return "no bound" if entry.exceedance is None or entry.exceedance.high is None else (
            f"beyond at most {entry.exceedance.high:.2e}"
        )  # fmt: skip
    scale, unit = units_shown(allocation.answer.outputs)[entry.outputs[0]]
    return f"at most {number(high * scale)} {unit}".rstrip()


def change_row(allocation: Allocation, goal: Goal, change: NumberChange) -> ChangeRow:
    """Arrange one change."""
    value, limit = value_words(allocation, change.result)
    if math.isnan(change.factor):
        needed, multiple = "not by this alone", f"× {number(change.closest, 3) if change.closest else 0}"
    elif math.isinf(change.factor):
        needed, multiple = "any", f"to × {MOST:,.0f}"
    else:
        needed, multiple = change.needed or "all of them", f"× {number(change.factor, 3)}"
    return ChangeRow(
        goal=goal_title(allocation, goal),
        number=change.label,
        now=change.now or f"{len(change.paths)} numbers",
        needed=needed,
        multiple=multiple,
        value=value,
        limit=limit,
        requirement=short_name(change.result, allocation.answer),
        factor=change.factor if math.isfinite(change.factor) else None,
        reached=change.reached,
        exceedance=change.result.beyond if math.isfinite(change.result.beyond) else None,
        simulated=simulated_words(allocation, change.simulated),
        confirmed=change.simulated is not None,
        linearity=change.linearity,
    )


def change_rows(allocation: Allocation) -> list[ChangeRow]:
    """List all changes of all goals."""
    return [change_row(allocation, goal, change) for goal in allocation.goals for change in goal.changes]


def unconfirmed_words(goal: Goal) -> list[str]:
    """Name the changes that simulation does not confirm."""
    return [UNCONFIRMED.format(", ".join(goal.unconfirmed))] if goal.unconfirmed else []


def shown_changes(allocation: Allocation, goal: Goal) -> tuple[list[NumberChange], list[str]]:
    """Return the changes that are shown, and what is said of others: where there are samples, those they confirm."""
    if allocation.basis is None:
        return list(goal.changes), []
    shown = [change for change in goal.changes if change.simulated is not None or not change.reached]
    left_out = len(goal.changes) - len(shown)
    if left_out and goal is not allocation.goals[-1]:
        return shown, [ELSEWHERE.format(left_out)]
    more = [MORE.format(left_out, left_out + sum(change.simulated is not None for change in shown))] if left_out else []
    return shown, [*more, *unconfirmed_words(goal)]


def goal_notes(goal: Goal) -> list[str]:
    """Say how far numbers were looked at, and what a larger one does."""
    notes = list[str]()
    if any(not change.reached for change in goal.changes):
        notes.append(LOOKED_AT)
    if not goal.met and any(change.reached and change.factor > 1.0 for change in goal.changes):
        notes.append(GROWS)
    if goal.met and any(math.isfinite(change.factor) and change.result.margin > ENDED for change in goal.changes):
        notes.append(ENDS)
    if goal.met and any(change.label.startswith("bias and instability") for change in goal.changes):
        notes.append(IN_RUN)
    return notes


def _linearity_column() -> Column[Any]:
    """Return the column that says whether linear analysis holds with a change."""

    def verdict(row: ChangeRow | GradeRow) -> Cell:
        return Cell(row.linearity or "not examined", tone="undecided" if row.linearity in DOUBTED else None)

    return Column("Linear analysis then", verdict, "linear analysis", "label")


def examined_words(allocation: Allocation) -> list[str]:
    """Say of which proposals linear analysis is not shown to hold, and why others were not examined."""
    changes = [change for goal in allocation.goals for change in shown_changes(allocation, goal)[0] if change.reached]
    proposed = [(change.label, change.linearity) for change in changes if change.simulated is None]
    failing = list(dict.fromkeys(label for label, linearity in proposed if linearity == Linearity.FAILS))
    words = []
    if allocation.linearity in DOUBTED:
        words.append(AS_IT_IS.format(allocation.linearity))
    if failing:
        words.append(NOT_THEN.format(several(failing)))
    if allocation.unexamined == OTHERS:
        stated = [f"{change.label} × {number(change.factor, 3)}" for change in changes if change.linearity]
        words.append(ONLY.format(several(["the campaign as it is", *stated])))
    elif allocation.unexamined:
        examined = "of all changes" if any(linearity for _, linearity in proposed) else "of any change"
        words.append(UNEXAMINED.format(examined, allocation.unexamined))
    return words


def change_table(goal: Goal, caption: str, rows: Sequence[ChangeRow], title: str = "") -> Table[ChangeRow]:
    """Tabulate changes with which a goal is just met, or is not met."""
    several, alone = len(goal.requirements) > 1, {change.label for change in goal.changes if len(change.paths) == 1}
    heading = "May be" if goal.met and any(row.reached for row in rows) else "Just met with"

    confirmed = any(row.confirmed for row in rows)

    def value(row: ChangeRow) -> Cell:
        return Cell(row.value, below=WRAPPED(f"limit {row.limit}{f': {row.requirement}' if several else ''}"))

    beyond: Column[ChangeRow] = Column(
        "Beyond then", lambda row: "–" if row.exceedance is None else f"{row.exceedance:.2e}", "beyond then"
    )
    of: Column[ChangeRow] = Column("of", lambda row: row.requirement, kind="text", place="terminal")
    simulated: Column[ChangeRow] = Column("Simulated then", lambda row: row.simulated or "–", "simulated then")
    columns: list[Column[ChangeRow]] = [
        Column("Number", lambda row: CODE(row.number) if row.number in alone else row.number, "number", "label"),
        Column("Now", lambda row: row.now, "now", "label"),
        Column(heading, lambda row: row.needed, "may be" if goal.met else "just met with", "label"),
        Column("Multiple", lambda row: row.multiple, "multiple"),
        *([simulated] if confirmed else []),
        *([_linearity_column()] if any(row.linearity in DOUBTED for row in rows) else []),
        Column("Linear value then", value, "linear value then"),
        Column("limit", lambda row: row.limit, place="terminal"),
        *([beyond] if any(row.exceedance is not None for row in rows) else []),
        *([of] if several else []),
    ]
    return Table(caption, columns, rows, title, faint=lambda row: not row.reached)


def goal_table(allocation: Allocation, goal: Goal) -> Table[ChangeRow]:
    """Tabulate the changes that just meet a goal, and some of those that do not, for the terminal."""
    rows = [change_row(allocation, goal, change) for change in shown_changes(allocation, goal)[0]]
    failing = [row for row in rows if not row.reached]
    shown = [row for row in rows if row.reached or row in failing[:FAILING]]
    if len(failing) > FAILING:
        more = f"and {len(failing) - FAILING} more"
        shown.append(ChangeRow("", more, "", "not by this alone", "", "", "", "", None, False))
    return change_table(goal, "", shown, goal_title(allocation, goal))


def grade_words(search: GradeSearch) -> str:
    """State what changes by one grade of the catalogue do."""
    if search.whole is None:
        return f"No grade of the catalogue states a {'finer' if search.finer else 'coarser'} number."
    if not search.finer:
        kept = sum(change.met for change in search.changes)
        joined = any(len(change.moves) > 1 for change in search.changes)
        words = f"{kept} of {len(search.changes)} numbers may be one grade of the catalogue coarser, one at a time"
        coarser = [_coarser_words(change) for change in search.changes if change.met]
        words += f": {several(coarser)}" if coarser else ""
        return words + ("; a bias takes its instability in run along." if joined else ".")
    if not any(change.met for change in search.changes):
        simulated = " in simulation" if any(change.simulated for change in search.changes) else ""
        return f"Numbers moved to the next finer grade of the catalogue do not meet the requirements{simulated}."
    count = len(search.changes[0].moves)
    fewest = "fewest" if search.exhaustive else "a set that cannot be reduced"
    moves = "one number moved" if count == 1 else f"{count} numbers moved"
    return f"Met with {moves} to the next finer grade of the catalogue ({fewest})."


def _coarser_words(change: GradeChange) -> str:
    """Name the first number of a change by one grade, and its grade."""
    move = change.moves[0]
    return f"{move.path.removeprefix('imu.')} ({move.grade})"


def move_words(change: GradeChange) -> str:
    """List the moves of a change by one grade."""
    return "; ".join(f"{move.path} {move.now} → {move.needed} ({move.grade})" for move in change.moves)


def grade_rows(allocation: Allocation) -> list[GradeRow]:
    """List the changes by one grade."""
    search = allocation.grades
    if search is None:
        return []
    shown = search.changes or ((search.whole,) if search.whole is not None else ())
    rows = []
    for change in shown:
        value, limit = value_words(allocation, change.worst)
        finding = "met" if change.met else "not met"
        name, bound = short_name(change.worst, allocation.answer), simulated_words(allocation, change.simulated)
        rows.append(GradeRow(move_words(change), finding, value, limit, name, bound, change.linearity))
    return rows


def grade_table(allocation: Allocation, search: GradeSearch) -> Table[GradeRow]:
    """Tabulate changes by one grade."""
    rows = grade_rows(allocation)
    simulated: Column[GradeRow] = Column("Simulated then", lambda row: row.simulated or "–", "simulated then")
    columns: list[Column[GradeRow]] = [
        Column("Numbers moved", lambda row: row.moves, "numbers moved by one grade", "words"),
        Column("Finding", lambda row: Cell(row.finding, tone=TONES[row.finding]), "finding", "label"),
        *([simulated] if any(row.simulated for row in rows) else []),
        *([_linearity_column()] if any(row.linearity in DOUBTED for row in rows) else []),
        Column("Linear value then", lambda row: Cell(row.value, below=WRAPPED(f"limit {row.limit}: {row.requirement}")),
               "linear value then"),
        Column("limit", lambda row: row.limit, place="terminal"),
        Column("of", lambda row: row.requirement, kind="text", place="terminal"),
    ]  # fmt: skip
    return Table(GRADES, columns, rows, grade_words(search))


def terminal(allocation: Allocation) -> list[Part]:
    """List what the terminal shows."""
    parts: list[Part] = [*_mean_errors(allocation), Verdict(*standing(allocation)), Note(basis_words(allocation)),
                         *map(Note, examined_words(allocation))]  # fmt: skip
    for goal in allocation.goals:
        notes = [*shown_changes(allocation, goal)[1], *goal_notes(goal)]
        parts += [goal_table(allocation, goal), *map(Note, notes)]
    if allocation.grades is not None:
        parts.append(grade_table(allocation, allocation.grades))
    return parts


def _mean_errors(allocation: Allocation) -> list[Part]:
    """Say first which mean errors exceed one sigma."""
    return [Sentence(f"{words}.", tone) for words, tone in large_mean_words(allocation.answer)]


def table(allocation: Allocation) -> Mapping[str, object]:
    """Arrange an allocation as ``allocate.json`` has it."""
    search = allocation.grades
    grades = None if search is None else {
        "words": grade_words(search),
        "finer": search.finer,
        "exhaustive": search.exhaustive,
        "changes": [asdict(row) for row in grade_rows(allocation)],
    }  # fmt: skip
    return {
        "campaign": allocation.answer.campaign,
        "met": allocation.answer.met,
        "simulated": None
        if allocation.basis is None
        else {
            "samples": allocation.basis.samples,
            "scales": allocation.basis.scales,
            "findings": [entry.finding for entry in allocation.basis.entries],
        },
        "requirements": [asdict(row) for row in requirement_rows(allocation.answer)],
        "changes": [asdict(row) for row in change_rows(allocation)],
        "grades": grades,
        "linearity": {"now": allocation.linearity or None, "unexamined": allocation.unexamined or None},
        "linear_answers": allocation.computed,
    }


def page(allocation: Allocation) -> Page:
    """Return the page."""
    words, tone = standing(allocation)
    name = allocation.answer.campaign
    asked = _asked(allocation)
    sections = [_goal_section(allocation, goal, place) for place, goal in enumerate(allocation.goals, start=1)]
    if allocation.grades is not None:
        table = grade_table(allocation, allocation.grades)
        parts: list[Part] = [Sentence(grade_words(allocation.grades)), *([table] if table.rows else [])]
        sections.append(Section("grades", "By one grade of the catalogue", parts))
    explained = [
        *remarks_in(allocation.answer.remarks),
        *examined_words(allocation),
        *freedom_words(allocation),
        *([] if allocation.grades is None else [grade_words(allocation.grades)]),
        basis_words(allocation),
        EXPLANATION,
    ]
    return answered(Page(
        f"{name}: allocation", "Allocation of errors", name,
        [*_mean_errors(allocation), Verdict(words, tone, explained), asked], sections,
        [Note(f"{allocation.computed:,} linear answers were computed. {CHECKED}")],
    ), _foremost(allocation), "Requirements")  # fmt: skip


def _asked(allocation: Allocation) -> Findings:
    """List the requirements as samples of the campaign show them, which the verdict is on; else by linear analysis."""
    basis, brief = allocation.basis, requirements_in_brief(allocation.answer)
    if basis is None:
        return brief
    rows = []
    for (_, _, linear), requirement, entry in zip(
        brief.entries, allocation.answer.requirements, basis.entries, strict=True
    ):
        name, (_, limit) = limited_in_brief(entry), value_words(allocation, requirement)
        words = linear if entry.kind == "sigma_ratio" else f"{name}: {_bound_words(allocation, entry)}, limit {limit}"
        rows.append((entry.finding, TONES[entry.finding], words))
    return replace(brief, entries=rows)


def _bound_words(allocation: Allocation, entry: RequirementEntry) -> str:
    """Format the bound of a requirement that its finding rests on: the lower one of a size that is not met."""
    low = entry.interval[0]
    if entry.finding != "not met" or entry.kind == "box" or low is None:
        return simulated_words(allocation, entry)
    scale, unit = units_shown(allocation.answer.outputs)[entry.outputs[0]]
    return f"at least {number(low * scale)} {unit}".rstrip()


def _foremost(allocation: Allocation) -> Figure | None:
    """Return the figure of the first screen: of the first goal that numbers meet, those that matter most."""
    drawn_goals = (
        drawn.multiples(replace(goal, changes=tuple(shown_changes(allocation, goal)[0])), place, FIRST)
        for place, goal in enumerate(allocation.goals, start=1)
    )
    return next((figure for figure in drawn_goals if figure is not None), None)


def _goal_section(allocation: Allocation, goal: Goal, place: int) -> Section:
    """Arrange what meets a goal, and below it what does not."""
    shown, left_out = shown_changes(allocation, goal)
    rows, several = [change_row(allocation, goal, change) for change in shown], len(goal.requirements) > 1
    reached, failing = [row for row in rows if row.reached], [row for row in rows if not row.reached]
    parts: list[Part] = []
    if reached:
        asked = "requirements are" if several else "requirement is"
        caption = LOOSENED if goal.met else TIGHTENED.format(asked)
        multiples = drawn.multiples(replace(goal, changes=tuple(shown)), place)
        parts += joined(change_table(goal, caption, reached), multiples)
    else:
        them = "them" if several else "it"
        parts.append(Sentence(f"No change of a number, or of all of them by one factor, meets {them}."))
    if failing:
        summary = f"{len(failing)} changes that do not suffice alone, smaller or larger"
        parts.append(Folded(summary, [change_table(goal, INSUFFICIENT, failing)]))
    return Section(f"goal-{place}", goal_title(allocation, goal), [*parts, *map(Note, [*left_out, *goal_notes(goal)])])
