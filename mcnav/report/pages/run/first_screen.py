"""The first screen of a run's report: verdict, consequence, the figure that shows it, cause, remedy, requirements."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from markupsafe import Markup

from mcnav.report.columns.requirements import requirement_rows
from mcnav.report.document.parts import Beside, Facts, Findings, Part, Tile, Verdict, joined
from mcnav.report.drawing.figure import HALF, Figure
from mcnav.report.format import rounded
from mcnav.report.names import humanize, shown_units
from mcnav.report.pages.run.sections.remedies import fix, fix_name
from mcnav.report.pages.run.tiles import NAMES
from mcnav.report.pages.run.worst_case import worst_case
from mcnav.report.pages.screen import foremost as as_foremost
from mcnav.report.pages.screen import sizes_at_the_end
from mcnav.report.results.model import RunAnalysis
from mcnav.report.statements.box import simulated_in_brief
from mcnav.report.statements.fields import named_causes
from mcnav.report.statements.joint import direction_words
from mcnav.report.statements.requirements import requirement_in_brief, worst_first
from mcnav.report.statements.verdicts import Statement, statements, tone

REQUIREMENTS: Final = 3
"""Requirements listed where there are more than one more; one, if all are met and something else is the matter."""

WHOLE: Final = "combination"
"""Figure of which all panels show the verdict: it stands on the first screen alone."""

ALONE: Final = (HALF[0], 1.7 * HALF[1])
"""Size of its panels, px, where nothing stands below them on the screen."""

DIGITS: Final = 3
"""Significant digits of its numbers."""

ROOM: Final = 46
"""Most words of the verdicts: the title, requirements, a remedy, the figure and the contents take the others."""

LONGEST: Final = 12
"""Words of a warning that is written out; of longer ones the first screen says that there are some."""

MORE: Final = Markup('<a href="#requirements">and {} more{}</a>').format
LINK: Final = Markup('<a href="#{}">{}</a>').format


@dataclass(frozen=True)
class FirstScreen:
    """Parts above the folds, and the figure that stands there and nowhere else; none where it is a panel of another.

    ``short``: whether there is but a verdict and its figure, so that the folds stand on the same screen.
    """

    parts: Sequence[Part]
    moved: Figure | None = None
    short: bool = False


def first_screen(
    content: RunAnalysis, drawn: Mapping[str, Figure], tiles: Sequence[Tile], stated: Sequence[Statement] = ()
) -> FirstScreen:
    """Arrange the answers of a run, the worst first.

    Parameters
    ----------
    drawn : mapping of str to Figure
        Figures of the report by name.
    tiles : sequence of Tile
        Of the same verdicts; each says which section is on its subject.
    stated : sequence of Statement
        The verdicts in another order; by default the worst first.
    """
    foremost, *others = _in_brief(stated or stated_on(content))
    by_subject = {tile.subject: tile for tile in tiles}
    tile = by_subject[NAMES[foremost.subject]]
    said = bool(foremost.consequences) or foremost.tone == "agrees"
    figure = _figure(content, drawn, tile, said)
    beside = joined(
        _facts(content, foremost),
        _others(others, by_subject),
        _requirements(content, foremost.subject == "requirements"),
    )
    verdict = Verdict(foremost.sentence, foremost.tone, _consequences(foremost), _warnings(tiles))
    if figure is None:
        return FirstScreen([verdict, *beside])
    if figure.name == WHOLE:
        figure = figure if beside else replace(figure, size=ALONE)
        return FirstScreen([verdict, figure, *beside], figure)
    return FirstScreen([verdict, Beside([figure], beside)], short=not beside)


def _in_brief(stated: Sequence[Statement]) -> list[Statement]:
    """Shorten the verdicts to what the screen has room for: first what the filter's sensors hide, then what agrees.

    Of mean errors that another verdict precedes, the first sentence stays. All is in the folds.
    """
    first, *others = stated
    others = [
        replace(other, sentence=f"{other.sentence.partition('. ')[0].rstrip('.')}.")
        if other.subject == "means"
        else other
        for other in others
    ]
    if _words(first, others) > ROOM:
        first = replace(first, consequences=first.consequences[:1])
    if _words(first, others) > ROOM:
        others = [other for other in others if other.tone != "agrees" or other.subject == "requirements"]
    return [first, *others]


def _words(first: Statement, others: Sequence[Statement]) -> int:
    """Count the words of verdicts as they stand on the screen."""
    rows = [other.sentence for other in others if other.subject != "requirements"]
    texts = [first.sentence, first.next_step, *first.consequences, first.cause, *rows]
    return sum(bool(re.search(r"[^\W\d]", word)) for text in texts for word in text.split())


def stated_on(content: RunAnalysis) -> list[Statement]:
    """State the verdicts on a run, the worst first."""
    epochs = content.folder.epochs()
    return statements(content.summary, None if epochs is None else epochs[0])


def _figure(content: RunAnalysis, drawn: Mapping[str, Figure], tile: Tile, said: bool) -> Figure | None:
    """Return the figure that shows a verdict, of several panels the worst; none where no figure does.

    ``said``: whether the sentences say already what is the worst, or nothing is at odds.
    """
    figure = worst_case(content, drawn, tile)
    if figure is None:
        return None
    if figure.name == WHOLE:
        panels = [replace(panel, title="") for panel in drawn[WHOLE].panels]
        return replace(drawn[WHOLE], panels=panels, caption="", shows=_along(content))
    shows = "" if said else figure.shows
    if said and tile.subject == NAMES["requirements"]:  # whose words are the verdict's
        figure = replace(figure, panels=[replace(panel, title="") for panel in figure.panels])
    return as_foremost(figure, shows)


def _along(content: RunAnalysis) -> str:
    """Say by how much samples and linear analysis differ along the combination that is drawn."""
    summary = content.summary
    joint = summary.joint
    if joint is None or joint.foremost is None:
        return ""
    entry = joint.foremost
    scale, unit = shown_units(summary)[entry.lead]
    alone = summary.sigma_linear[summary.names.index(entry.lead)]
    mean, simulated, linear, own = (
        f"{rounded(size * scale, DIGITS)} {unit}".strip()
        for size in (entry.mean_error, entry.sigma_paired, entry.sigma_linear, alone)
    )
    of_lead = f"{humanize(entry.lead)} alone: {own}"
    words = direction_words(entry, summary)
    if joint.cause == "mean":
        return f"Mean error along the {words}: {mean} ({of_lead})."
    return f"Sigma along the {words}: {simulated} simulated, {linear} linear ({of_lead})."


def _consequences(answer: Statement) -> list[str]:
    return [*([answer.next_step] if answer.next_step else []), *answer.consequences]


def _warnings(tiles: Sequence[Tile]) -> list[str]:
    """Say at which setting of ranges the run is; write out other warnings if they are short, else where they are."""
    warnings = [(warning, tile) for tile in tiles for warning in tile.warnings]
    settings = [brief for warning, _ in warnings if (brief := simulated_in_brief(str(warning)))]
    others = [(warning, tile) for warning, tile in warnings if not simulated_in_brief(str(warning))]
    if sum(len(warning.split()) for warning, _ in others) <= LONGEST:
        return [*settings, *(warning for warning, _ in others)]
    count = "One warning" if len(others) == 1 else f"{len(others)} warnings"
    link = next(tile.link for _, tile in others)
    return [*settings, LINK(link, count) if link else count]


def _facts(content: RunAnalysis, answer: Statement) -> Facts | None:
    """Name the cause, and what would help most, or how large errors are; none where nothing is known."""
    best = fix(content.remedies, content.manifest.model.outputs)
    of_causes = "Driven by" if answer.tone == "agrees" else "Cause"
    named = (of_causes, answer.cause), (fix_name(content.remedies, answer.subject), best)
    known = [(name, words) for name, words in named if words]
    if not content.summary.requirements and (answer.tone == "agrees" or answer.subject == "linear"):
        known += _sizes(content)
    return Facts(known, below=True) if known else None


def _sizes(content: RunAnalysis) -> list[tuple[str, Markup | str]]:
    """Give the Monte Carlo sigmas of the first outputs, and what drives the first one where linear analysis knows."""
    summary, units = content.summary, shown_units(content.summary)
    sizes = enumerate(zip(summary.names, summary.sigma_paired, strict=False))
    known = {i: (name, size * units[name][0], units[name][1]) for i, (name, size) in sizes if size and size > 0.0}
    if not known:
        return []
    drives = ""
    if tone(summary) in ("agrees", "partly"):
        causes = [*(source.name for source in summary.sources), *(process.name for process in summary.processes)]
        drives = named_causes(zip(causes, np.nan_to_num(content.budget.attributed[min(known)]).tolist(), strict=True))
    return sizes_at_the_end(list(known.values()), drives, "linear")


def _others(others: Sequence[Statement], tiles: Mapping[str, Tile]) -> Findings | None:
    """Give the other answers a row each, which leads to their section; requirements have rows of their own."""
    rows = []
    for answer in (answer for answer in others if answer.subject != "requirements"):
        section = tiles[NAMES[answer.subject]].link
        words = LINK(section, answer.sentence) if section else answer.sentence
        rows.append((answer.word, answer.tone, words))
    return Findings(rows, name="Other verdicts") if rows else None


def _requirements(content: RunAnalysis, said: bool) -> Findings | None:
    """List the worst requirements with their estimates but the first, if sentences have it; none where none is left."""
    rows = sorted(requirement_rows(content.summary, "shown", content.time_unit), key=worst_first)[1 if said else 0 :]
    if not rows:
        return None
    most = 1 if not said and all(row.tone == "agrees" for row in rows) else REQUIREMENTS
    more = len(rows) - most if len(rows) > most + (most > 1) else 0
    listed = rows[:most] if more else rows
    entries = [(row.entry.finding, row.tone, requirement_in_brief(row)) for row in listed]
    others = (", met" if more == 1 else ", all met") if all(row.tone == "agrees" for row in rows[most:]) else ""
    return Findings(entries, MORE(more, others) if more else "")
