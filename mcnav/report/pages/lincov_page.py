"""Linear covariance of a campaign as a page, and its tables and sentences in the terminal."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, TypeGuard

import numpy as np
from markupsafe import Markup

from mcnav.analysis.answer_times import as_read, read_axis
from mcnav.analysis.causes import Cause
from mcnav.analysis.examination import Linearity
from mcnav.analysis.filter_consistency import Honesty, NeglectedError
from mcnav.analysis.filter_remarks import instant
from mcnav.analysis.linear_answer import LinearAnswer, Order
from mcnav.analysis.linear_covariance import NOMINAL, LinearCovariance
from mcnav.analysis.remedies import Remedies
from mcnav.analysis.what_if import WhatIf
from mcnav.arrays.types import Array
from mcnav.contract.quantities import KINDS, end_words, kinds_of
from mcnav.report.columns.gates import gate_table
from mcnav.report.columns.share_table import ShareRow, each_cause, share_tables, together
from mcnav.report.document.html import card_html
from mcnav.report.document.parts import (
    Answers,
    Facts,
    Folded,
    Note,
    Page,
    Part,
    Section,
    Sentence,
    Verdict,
    headed,
    joined,
)
from mcnav.report.document.table import CODE, STRONG, Cell, Column, Place, Table, five_digits
from mcnav.report.drawing.figure import Figure, bare
from mcnav.report.figures import lincov as drawn
from mcnav.report.format import number
from mcnav.report.names import humanize, scale_of, unit_words
from mcnav.report.pages.box import box_section, box_tables
from mcnav.report.pages.lincov import (
    RequirementRow,
    SizeRow,
    final_rows,
    largest_rows,
    requirement_rows,
    requirements_in_brief,
    smoothed_rows,
    statements,
)
from mcnav.report.pages.run.folded import with_folded_parts, with_rest_folded
from mcnav.report.pages.run.sections.remedies import fix, fix_name, remedies_section
from mcnav.report.pages.run.sections.what_if import what_if_section
from mcnav.report.pages.screen import answered, sizes_at_the_end
from mcnav.report.results.left_out import not_modelled
from mcnav.report.results.worst_components import FOREMOST, worst_of_vectors
from mcnav.report.statements.details import BEYOND, remarks_in
from mcnav.report.statements.fields import named_causes
from mcnav.report.statements.lincov import label_of
from mcnav.report.statements.words import listed, several

EXPLANATION: Final = (
    "Linear analysis for normal errors; no number here is of samples. mcnav run tests it by Monte Carlo simulation."
)

REQUIREMENTS: Final = (
    "Requirements of the campaign's [accept] table for linear normal {}. “Errors may be ×”: the multiple of all {} at "
    "which the requirement is just met. Causes: share of the mean square of these at the instant at which the "
    "requirement is tightest"
)
"""Caption of the table of requirements."""

LONGER: Final = Markup("Whether an outage may be longer: {}.").format
"""Note below the table of requirements, where a sensor has outages."""

ALL_REMEDIES: Final = "mcnav lincov FILE --remedies"

POLAR: Final = ("reentry", "cruise", "hover")
"""Types of scenarios whose outputs are errors of a polar state."""

ARCS: Final = "Output ranges are arcs on the earth's surface; initial ranges are arcs at the radius of the start."
"""Of polar states: the same angle is a longer arc higher up."""

SECOND_ORDER: Final = " Second order: with second and third derivatives, where known to less than half the correction."

SHARES: Final = "Share of the variance at the end, %, and the sigma that a cause alone leaves"
"""Caption of the error budget."""

CAUSES: Final = "largest causes, share of the variance"
"""Heading in the terminal of the column that lists them."""


def page(
    answer: LinearAnswer, outages: drawn.Outages, what_if: WhatIf | None = None, remedies: Remedies | None = None
) -> Page:
    """Return the page; outages are those of the aiding sensors."""
    longer = [LONGER(CODE(length_sweep(name, *spans[0]))) for name, spans in outages.items() if spans][:1]
    answer, outages = _as_read(answer, outages)
    (words, tone), *others = statements(answer)
    faulty = answer.history is not None and bool(np.any(answer.history.means.get(NOMINAL, 0.0)))
    left_out, largest = not_modelled(answer.kind, answer.causes, faulty), largest_table(answer)
    verdict = Verdict(
        f"{words}.", tone, [*(f"{sentence}." for sentence, _ in others), EXPLANATION], remarks_in(answer.remarks)
    )
    smoothed = smoothed_table(answer)
    answers = Answers([final_table(answer), *(table for table in (largest, smoothed) if table.rows)])
    moving, meaningful = drawn.sigmas(answer, outages), answer.beyond is None
    sections = []
    if answer.requirements:
        parts = joined(requirement_table(answer), drawn.requirements(answer, outages), *map(Note, longer))
        sections.append(Section("requirements", "Requirements", parts))
    if (ranges := box_section(answer)) is not None:
        sections.append(ranges)
    if moving is not None:
        over_time = "Errors and dispersions over time" if any(kinds_of(answer.outputs)) else "Errors over time"
        sections.append(Section("over-time", over_time, [*joined(moving, drawn.truth(answer))]))
    looped = ".py:" in answer.kind and any(output.of == "truth" for output in answer.outputs)
    away = drawn.departures(answer) if looped else {}
    worst = sorted(worst_of_vectors(list(away), away), key=lambda name: -away[name])[:FOREMOST]
    if meaningful and (budget := drawn.budget(answer, worst)) is not None:
        sections.append(Section("budget", "Error budget", [budget, *_budget_parts(answer, outages)]))
    if (gates := gate_table(answer)) is not None:
        sections.append(Section("gates", "What the gates stop", [gates]))
    if (helpful := remedies_section(remedies, answer.outputs, ALL_REMEDIES)) is not None:
        sections.append(helpful)
    if meaningful and (changeable := what_if_section(what_if, answer.outputs, looped, _nonlinear(answer))):
        sections.append(changeable)
    if meaningful and answer.sigma.any() and (correlations := drawn.correlations(answer)) is not None:
        sections.append(Section("correlations", "Covariance and correlation", [correlations]))
    if looped:
        sections = [_shortened(section, away) for section in sections]
    asked = requirements_in_brief(answer)
    helps = fix(remedies, answer.outputs)
    fails, causes = _cause(answer)
    named = ("Cause" if fails else "Driven by", causes), (fix_name(remedies), helps)
    known = [*([(name, words) for name, words in named if words] or _sizes(answer)), *_doubts(answer)]
    facts = Facts(known, below=True) if known else None
    head = joined(verdict, facts, asked if asked.entries else None, answers, Note(left_out) if left_out else None)
    shown = _foremost(answer, moving, drawn.requirements(answer, outages))
    title = f"{answer.campaign}: linear covariance"
    return answered(Page(title, "Linear covariance", answer.campaign, head, sections), shown)


def length_sweep(sensor: str, begin: float, end: float) -> str:
    """Return the command that finds how long the first outage of a sensor may be; times in s.

    >>> length_sweep("gnss", 1200.0, 1500.0)
    "mcnav sweep FILE --vary 'aiding.gnss.outages.1.length=150..1200 s'"
    """
    length = end - begin
    return f"mcnav sweep FILE --vary 'aiding.{sensor}.outages.1.length={0.5 * length:g}..{4.0 * length:g} s'"


def _shortened(section: Section, away: Mapping[str, float]) -> Section:
    """Fold what has dozens of rows or panels; the worst component of each vector stands for it."""
    parts = [with_rest_folded(part, away) if _of_outputs(part, away) else part for part in section.parts]
    return section if section.name == "requirements" else replace(section, parts=with_folded_parts(parts))


def _of_outputs(part: Part, away: Mapping[str, float]) -> TypeGuard[Figure]:
    """Return whether a part is a figure with more than a row of panels, each of an output."""
    return isinstance(part, Figure) and len(part.panels) > part.beside and all(p.title in away for p in part.panels)


def _nonlinear(answer: LinearAnswer) -> str:
    """Say of which outputs linear analysis does not hold; empty where flights have not shown that it does not."""
    examined = () if answer.examination is None else answer.examination.outputs
    failing = [humanize(output.name) for output, row in zip(answer.outputs, examined, strict=False)
               if row.verdict == Linearity.FAILS]  # fmt: skip
    return f"for {several(failing)}" if failing else ""


def _cause(answer: LinearAnswer) -> tuple[bool, str]:
    """Return whether something fails, and the largest causes of what does, or of the tightest requirement's errors.

    A requirement that is not met comes before what a filter misses.
    """
    judged = [number for number, row in enumerate(answer.requirements) if row.judged]
    tightest = min(judged, key=lambda number: (answer.requirements[number].met, answer.requirements[number].tightness),
                   default=None)  # fmt: skip
    unmet = tightest is not None and not answer.requirements[tightest].met
    optimistic = answer.filter if answer.filter is not None and answer.filter.verdict == Honesty.OPTIMISTIC else None
    neglected = () if optimistic is None else optimistic.neglected
    if tightest is None or (neglected and not unmet):
        return bool(neglected), _named(answer, neglected)
    return unmet, _named(answer, answer.requirement_causes(tightest))


def _doubts(answer: LinearAnswer) -> list[tuple[str, Markup | str]]:
    """Say that nothing has examined linear analysis, and how many warnings there are; nothing without either."""
    warnings = len(remarks_in(answer.remarks))
    link = Markup('<a href="#fold-linear-analysis">{}</a>').format(
        f"{warnings} warnings" if warnings > 1 else "one warning"
    )
    doubts = [*(["not examined"] if answer.unexamined else []), *([link] if warnings else [])]
    return [("Linear analysis", Markup(", ").join(doubts))] if doubts else []


def _named(answer: LinearAnswer, causes: Iterable[Cause | NeglectedError]) -> str:
    """Name the largest kinds of causes with their shares."""
    return named_causes(
        (label_of(answer, cause.name) if cause.name.endswith(NOMINAL) else cause.name, cause.share) for cause in causes
    )


def _sizes(answer: LinearAnswer) -> list[tuple[str, Markup | str]]:
    """Give the first sigmas at the end, and what drives the first; none beyond the linear range."""
    rows = [row for row in final_rows(answer) if row.sigma]
    if not rows:
        return []
    first = next(i for i, output in enumerate(answer.outputs) if output.name == rows[0].output)
    known = [(row.output, row.sigma or 0.0, unit_words(row.unit)) for row in rows]
    shares = np.nan_to_num(answer.budget.attributed[first]).tolist()
    drives = named_causes(zip(answer.causes, shares, strict=True))
    return sizes_at_the_end(known, drives, "fold-linear-analysis")


def _foremost(answer: LinearAnswer, over_time: Figure | None, asked: Figure | None) -> Figure | None:
    """Return the figure that shows the answer, its first panel the worst.

    Requirements over time come first, the tightest; else the output that a filter is most wrong about, or that the
    tightest requirement at the end limits.
    """
    tightest = sorted(
        (requirement for requirement in answer.requirements if requirement.judged),
        key=lambda requirement: requirement.tightness,
    )
    if asked is not None and (answer.filter is None or answer.filter.verdict == "consistent"):
        names = [drawn.short_name(requirement, answer) for requirement in tightest]
        return replace(asked, panels=sorted(asked.panels, key=lambda panel: names.index(panel.title.split(": ", 1)[1])))
    output = "" if answer.filter is None else humanize(answer.filter.output)
    if tightest and not output:
        output = humanize(answer.outputs[tightest[0].requirement.outputs[0]].name)
    if over_time is None:
        return None
    return replace(over_time, panels=sorted(over_time.panels, key=lambda panel: panel.title != output))


def terminal(answer: LinearAnswer) -> list[Part]:
    """List what the terminal shows: sentences, requirements, sigmas at times that were asked for, outputs."""
    answer = as_read(answer)
    (words, tone), *others = statements(answer)
    tables = [
        requirement_table(answer) if answer.requirements else None,
        *box_tables(answer),
        None if answer.asked is None else reading_table(answer, answer.asked),
        final_table(answer),
        None if answer.meaningful is None else largest_table(answer),
        smoothed_table(answer) if smoothed_rows(answer) else None,
        gate_table(answer),
    ]
    remarks = [Sentence(remark, "undecided") for remark in remarks_in(answer.remarks)]
    return [Verdict(words, tone), *(Sentence(*other) for other in others), *remarks, *joined(*tables)]


def card(answer: LinearAnswer, outages: drawn.Outages) -> str:
    """Write the answer as HTML for a notebook: verdict, requirements, sigmas with their causes, budget, over time."""
    answer, outages = _as_read(answer, outages)
    (words, tone), *others = statements(answer)
    verdict = Verdict(f"{words}.", tone, [f"{sentence}." for sentence, _ in others], remarks_in(answer.remarks))
    asked = requirement_table(answer) if answer.requirements else None
    parts = joined(Sentence(STRONG(answer.campaign)), verdict, asked, final_table(answer))
    figures = [] if answer.beyond is not None else joined(drawn.budget(answer), drawn.sigmas(answer, outages))
    return card_html([*parts, *(bare(figure) for figure in figures if isinstance(figure, Figure))])


def _as_read(answer: LinearAnswer, outages: drawn.Outages) -> tuple[LinearAnswer, drawn.Outages]:
    """Return the answer, and the outages, with the times that people read."""
    axis = read_axis(answer)
    if axis is None:
        return answer, outages
    spans = {name: [(axis.read(begin), axis.read(end)) for begin, end in outage] for name, outage in outages.items()}
    return as_read(answer), spans


def _causes(causes: Sequence[tuple[str, float]]) -> str:
    """List causes, each with its share on one line."""
    return listed(causes).replace(" %", "\N{NO-BREAK SPACE}%")


BEYOND_LIMIT: Final[Column[RequirementRow]] = Column(
    "Beyond the limit", lambda row: "–" if row.exceedance is None else f"{row.exceedance:.2e}", "beyond the limit"
)
"""Linear probability beyond the limit, of requirements that allow one in a thousand and less."""

WITH_CURVATURE: Final[Column[RequirementRow]] = Column(
    "With curvature", lambda row: "–" if row.exceedance_curved is None else f"{row.exceedance_curved:.2e}",
    "with curvature",
)  # fmt: skip
SECOND: Final = (
    " To second order: by second and third derivatives from flights, with skewness for the size of one output, and the "
    "normal law for several together. ±: uncertainty; a limit within it is not judged."
)
CURVED: Final = (
    " With curvature: from second derivatives by some simulations without noise, for normal sources; noise adds its "
    "linear variance, and the probabilities of the outputs of a box are added up."
)


def requirement_table(answer: LinearAnswer) -> Table[RequirementRow]:
    """Tabulate the requirements and their linear values."""
    boxes = any(requirement.requirement.kind == "box" for requirement in answer.requirements)
    several = "; of several outputs within limits together, each in multiples of its limit" if boxes else ""
    rows = requirement_rows(answer)
    curved = any(row.exceedance_curved is not None for row in rows)
    second, doubted = any(row.order == Order.SECOND for row in rows), any(row.doubt for row in rows)
    heading = "Value" if second else "Linear"
    order: Column[RequirementRow] = Column("by", lambda row: row.order or "–", kind="text", place="terminal")
    doubt: Column[RequirementRow] = Column("why", lambda row: row.doubt or "–", kind="words", place="terminal")

    def below(row: RequirementRow) -> str:
        return f"largest at {row.at}" if row.at else row.order if second else ""

    columns: list[Column[RequirementRow]] = [
        Column("Requirement", lambda row: row.requirement, "requirement", "words"),
        Column("Finding", lambda row: Cell(row.finding, tone=row.tone, below=row.doubt), "finding", "label"),
        Column(heading, lambda row: Cell(row.shown, below=below(row)), heading.lower()),
        *([order] if second else []),
        *([doubt] if doubted else []),
        Column("largest at", lambda row: row.at or "–", kind="text", place="terminal"),
        *([BEYOND_LIMIT] if any(row.exceedance is not None for row in rows) else []),
        *([WITH_CURVATURE] if curved else []),
        Column("Errors may be ×", lambda row: row.margin, "errors may be ×"),
        Column("Largest causes", lambda row: _causes(row.causes),
               "largest causes then, share of the mean square", "words"),
    ]  # fmt: skip
    words, what = end_words(answer.outputs), "outputs" if any(kinds_of(answer.outputs)) else "errors"
    title = "Requirements, linear or to second order" if second else f"Requirements, for linear normal {what}"
    caption = REQUIREMENTS.format(what, words.many)
    noted = f"{SECOND if second else ''}{CURVED if curved else ''}"
    return Table(f"{caption}{several}.{noted}", columns, rows, title, keys=2)


def _moment(value: float | None) -> str:
    return "–" if value is None else instant(value, "")


def _size(value: float | None) -> str:
    return BEYOND if value is None else five_digits(value)


def _output(row: SizeRow) -> Cell:
    return Cell(humanize(row.output), row.unit)


def _filtered(answer: LinearAnswer) -> list[Column[SizeRow]]:
    """Return the column of the filter's sigma, if there is a filter."""
    if answer.history is None or answer.history.sigma_filter is None:
        return []
    return [Column("Filter sigma", lambda row: row.sigma_filter, "filter's σ", form=_size, size="sigma")]


def _by_kind(answer: LinearAnswer, table: Table[SizeRow]) -> Table[SizeRow]:
    """Arrange the rows of a table by the kinds of their outputs, where there are several."""
    kinds = dict(zip((output.name for output in answer.outputs), kinds_of(answer.outputs), strict=True))
    if not any(kinds.values()):
        return table
    rows = sorted(table.rows, key=lambda row: KINDS.index(kinds[row.output]))
    return replace(table, rows=rows, group=lambda row: kinds[row.output])


def final_table(answer: LinearAnswer) -> Table[SizeRow]:
    """Tabulate the final means and sigmas with the causes of the variances.

    Those of second order are in the terminal where linear analysis is not shown to hold.
    """
    rows = final_rows(answer)
    examined = () if answer.examination is None else answer.examination.outputs
    place: Place | None = None if any(row.verdict != Linearity.HOLDS for row in examined) else "page"
    heading = "Mean error" if any(kinds_of(answer.outputs)) else "Mean"
    mean: Column[SizeRow] = Column(heading, lambda row: row.mean, heading.lower(), form=_size, size="value")
    mean_second: Column[SizeRow] = Column(
        f"{heading}, second order", lambda row: row.mean_second, f"{heading.lower()}, 2nd order", form=five_digits,
        size="value", place=place,
    )  # fmt: skip
    sigma_second: Column[SizeRow] = Column(
        "Second order", lambda row: row.sigma_second, "σ, 2nd order", form=five_digits, size="sigma", place=place
    )
    second = any(row.sigma_second is not None for row in rows)
    nominal: Column[SizeRow] = Column("Nominal", lambda row: row.nominal, "nominal", form=five_digits, size="value")
    columns: list[Column[SizeRow]] = [
        Column("Output", _output, "output", "label"),
        *([nominal] if any(row.nominal is not None for row in rows) else []),
        *([mean] if any(row.mean for row in rows) else []),
        *([mean_second] if any(row.mean_second is not None for row in rows) else []),
        Column("At the end", lambda row: row.sigma, "σ", form=_size, size="sigma"),
        *([sigma_second] if second else []),
        *_filtered(answer),
        Column("Largest causes", lambda row: _causes(row.causes), CAUSES, "words"),
    ]
    what = "At the end" if any(kinds_of(answer.outputs)) else "Errors at the end"
    noted = f"{SECOND_ORDER if second else ''}{_about_ranges(answer)}"
    caption = f"{what}, one sigma. Causes: share of the variance at the end.{noted}"
    return _by_kind(answer, Table(caption, columns, rows, "Linear covariance at the end, 1σ"))


def _about_ranges(answer: LinearAnswer) -> str:
    """Say where ranges are measured, of a system whose initial ranges are arcs at another radius than its outputs."""
    polar = answer.kind in POLAR and any(output.name == "range" for output in answer.outputs)
    return f" {ARCS}" if polar else ""


def largest_table(answer: LinearAnswer) -> Table[SizeRow]:
    """Tabulate the largest sigmas over time with the causes of the variances at these times."""
    label = "" if answer.history is None else answer.history.readings.label
    columns: list[Column[SizeRow]] = [
        Column("Output", _output, "output", "label"),
        Column("Largest", lambda row: row.sigma, "largest σ", form=_size, size="sigma"),
        *_filtered(answer),
        Column(label, lambda row: row.time, f"at {label}", form=_moment),
        Column("Largest causes then", lambda row: _causes(row.causes), CAUSES, "words"),
    ]
    title = f"Largest over time{'' if answer.beyond is None else ' within the range of linear analysis'}"
    caption = f"{title}, one sigma. Causes: share of the variance at that time.{_about_ranges(answer)}"
    ranges = f" ({ARCS[0].lower()}{ARCS[1:-1]})" if _about_ranges(answer) else ""
    return _by_kind(answer, Table(caption, columns, largest_rows(answer), f"{title}, 1σ{ranges}"))


def smoothed_table(answer: LinearAnswer) -> Table[SizeRow]:
    """Tabulate the largest sigmas behind the smoother, with what it claims and the causes of the variances then."""
    label = "" if answer.smoothed is None else answer.smoothed.readings.label
    columns: list[Column[SizeRow]] = [
        Column("Output", _output, "output", "label"),
        Column("Largest", lambda row: row.sigma, "largest σ", form=_size, size="sigma"),
        Column("Smoother claims", lambda row: row.sigma_filter, "smoother's σ", form=_size, size="sigma"),
        Column(label, lambda row: row.time, f"at {label}", form=_moment),
        Column("Largest causes then", lambda row: _causes(row.causes), CAUSES, "words"),
    ]
    title = "Largest over time behind the smoother"
    caption = f"{title}, one sigma. Causes: share of the variance at that time."
    return _by_kind(answer, Table(caption, columns, smoothed_rows(answer), f"{title}, 1σ"))


@dataclass(frozen=True)
class _Reading:
    """Values of all outputs at a reading, SI: time, update and what the values are."""

    time: str
    update: str
    what: str
    values: Array
    beyond: bool


def reading_table(answer: LinearAnswer, covariance: LinearCovariance) -> Table[_Reading]:
    """Tabulate the sigmas at readings that were asked for: true ones, and below them those that the filter states.

    Then those behind a smoother, with what it claims, and the means.
    """
    smoothed = answer.smoothed_asked
    readings, own, beyond = covariance.readings, covariance.sigma_filter, answer.readings_beyond(covariance)
    several = own is not None or bool(covariance.means)
    rows = []
    for at, time in enumerate(readings.times):
        rows.append(_Reading(f"{time:g}", readings.updates[at] or "–", "true", covariance.sigma[at], beyond[at]))
        if own is not None:
            rows.append(_Reading("", "", "filter's", own[at], beyond[at]))
        if smoothed is not None and smoothed.sigma_filter is not None:
            rows.append(_Reading("", "", "smoothed", smoothed.sigma[at], beyond[at]))
            rows.append(_Reading("", "", "smoother's", smoothed.sigma_filter[at], beyond[at]))
        if covariance.means:
            rows.append(_Reading("", "", "mean", covariance.mean[at], beyond[at]))
    scale = scale_of(answer.outputs)

    def value(i: int) -> Column[_Reading]:
        output = answer.outputs[i]
        return Column(
            humanize(output.name),
            lambda row: BEYOND if row.beyond else number(float(row.values[i] * scale[i])),
            unit=output.shown_in,
        )

    what: Column[_Reading] = Column("σ", lambda row: row.what, kind="text")
    columns: list[Column[_Reading]] = [
        Column(readings.label, lambda row: row.time),
        Column("update", lambda row: row.update, kind="text"),
        *([what] if several else []),
        *map(value, range(len(answer.outputs))),
    ]
    return Table("", columns, rows, "Linear covariance, 1σ", keys=3 if several else 2)


def _budget_parts(answer: LinearAnswer, outages: drawn.Outages) -> list[Part]:
    """Tabulate the contributors, and all causes; draw how their shares develop."""
    budget, scale = answer.budget, scale_of(answer.sources)
    caused = np.abs(budget.contributions) * scale_of(answer.outputs)[:, None]
    sigmas = np.sqrt(np.diag(answer.model.covariance)) * scale
    sources = [
        (sigma, mean, source.shown_in)
        for sigma, mean, source in zip(sigmas, answer.model.mean * scale, answer.sources, strict=True)
    ]
    causes = each_cause(budget, caused, drawn.cause_labels(answer), sources, np.any(caused, axis=0).tolist())

    def tables(caption: str, rows: Sequence[ShareRow], sigmas: bool) -> list[Part]:
        return share_tables(f"{SHARES}{caption}.", "Cause", answer.outputs, rows, budget.cross_terms, sigmas=sigmas)

    foremost = tables("; of several causes together", together(budget, caused, drawn.contributors(answer)), False)
    every = Folded(f"All {len(causes)} causes", tables("", causes, True))
    return [*foremost, every, *headed("Over time", drawn.development(answer, outages))]
