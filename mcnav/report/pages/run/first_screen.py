"""The first screen of a run's report: verdict, consequence, the figure that shows it, cause, remedy, requirements."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np
from markupsafe import Markup

from mcnav.report.columns.requirements import requirement_rows
from mcnav.report.document.parts import WARNINGS, Beside, Facts, Findings, Part, Tile, Verdict, joined
from mcnav.report.drawing.figure import HALF, Figure
from mcnav.report.format import rounded, signed
from mcnav.report.names import humanize, shown_units
from mcnav.report.pages.run.sections.remedies import fix, fix_name
from mcnav.report.pages.run.tiles import NAMES
from mcnav.report.pages.run.worst_case import worst_case
from mcnav.report.pages.screen import foremost as as_foremost
from mcnav.report.pages.screen import sizes_at_the_end
from mcnav.report.results.model import RunAnalysis
from mcnav.report.statements.box import simulated_in_brief
from mcnav.report.statements.fields import faults_before, initial, named_causes
from mcnav.report.statements.joint import direction_words
from mcnav.report.statements.requirements import capitalized, requirement_in_brief, worst_first
from mcnav.report.statements.verdicts import Statement, statements, tone

if TYPE_CHECKING:
    from mcnav.analysis.summary import CombinationEntry, Summary

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

SURE: Final = 4.0
"""Standard errors beyond which a mean is no chance, whichever combination differs most."""

OF_SIGMA: Final = " times its sigma of "
"""Words before the sigma of a mean error, which the fold has."""

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
    verdict = Verdict(foremost.sentence, foremost.tone, _consequences(content, foremost), _warnings(tiles))
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
    others = [_first_sentence(other) if other.subject == "means" else other for other in others]
    if _words(first, others) > ROOM:
        first = replace(first, consequences=first.consequences[:1])
    if _words(first, others) > ROOM:
        others = [other for other in others if other.tone != "agrees" or other.subject == "requirements"]
    return [first, *map(_without_repetition, others)]


def _first_sentence(statement: Statement) -> Statement:
    return replace(statement, sentence=f"{statement.sentence.partition('. ')[0].rstrip('.')}.")


def _without_repetition(statement: Statement) -> Statement:
    """Leave out what the label beside a verdict says, and of a mean error the sigma, which the fold has."""
    words, of, _ = statement.sentence.partition(OF_SIGMA)
    words = f"{words}{OF_SIGMA.removesuffix(' of ')}." if of and statement.subject == "means" else statement.sentence
    return replace(statement, sentence=capitalized(words.removeprefix("Undecided: ")))


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
    known = joint.cause == "dispersion" and abs(entry.mean_error) > max(
        summary.tolerance * entry.sigma_linear, _noise_of_mean(summary, entry)
    )
    off = f" Mean: {mean}." if known else ""
    return f"Sigma along the {words}: {simulated} simulated, {linear} linear ({of_lead}).{off}"


def _noise_of_mean(summary: Summary, entry: CombinationEntry) -> float:
    """Return the size beyond which a mean error along a combination is no chance: `SURE` standard errors."""
    return SURE * entry.sigma_paired / math.sqrt(max(summary.samples - summary.failed, 1))


def _consequences(content: RunAnalysis, answer: Statement) -> list[str]:
    return [
        *([f"{answer.next_step}{_time_of(content, answer.next_step)}"] if answer.next_step else []),
        *answer.consequences,
    ]


def _time_of(content: RunAnalysis, step: str) -> str:
    """Say how long the samples of a next step take at the speed of this run, where that is known."""
    asked = re.match(r"Run about ([\d,]+) samples", step)
    execution = content.manifest.execution
    if asked is None or execution is None or execution.samples != content.summary.samples or execution.seconds <= 0.0:
        return ""
    seconds = int(asked[1].replace(",", "")) * execution.seconds / execution.samples
    return f" At this run's speed that takes {_duration(seconds)}."


def _duration(seconds: float) -> str:
    """Write a time in two digits.

    >>> _duration(0.3), _duration(14.2), _duration(600.0), _duration(9000.0)
    ('under 1 s', '14 s', '10 min', '2.5 h')
    """
    if seconds < 1.0:
        return "under 1 s"
    size, unit = next((s for s in ((seconds, "s"), (seconds / 60.0, "min")) if s[0] < 60.0), (seconds / 3600.0, "h"))
    return f"{rounded(size, 2)} {unit}"


def _warnings(tiles: Sequence[Tile]) -> list[str]:
    """Say at which setting of ranges the run is; write out other warnings if they are short, else where they are."""
    warnings = [(warning, tile) for tile in tiles for warning in tile.warnings]
    settings = [brief for warning, _ in warnings if (brief := simulated_in_brief(str(warning)))]
    others = [(warning, tile) for warning, tile in warnings if not simulated_in_brief(str(warning))]
    if sum(len(warning.split()) for warning, _ in others) <= LONGEST:
        return [*settings, *(warning for warning, _ in others)]
    count = "One warning" if len(others) == 1 else f"{len(others)} warnings"
    return [*settings, LINK(WARNINGS, count)]


def _facts(content: RunAnalysis, answer: Statement) -> Facts | None:
    """Name the cause, and what would help most, or how large errors are; none where nothing is known."""
    best = fix(content.remedies, content.manifest.model.outputs)
    of_causes = "Driven by" if answer.tone == "agrees" else "Cause"
    cause = faults_before(content.summary) if answer.subject == "filter" and answer.cause else ""
    named = (of_causes, cause or answer.cause), (fix_name(content.remedies, answer.subject), best)
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
    driven = _largest(known)
    drives = ""
    if tone(summary) in ("agrees", "partly"):
        sources = [initial(source.name, summary.names) for source in summary.sources]
        causes = [*sources, *(process.name for process in summary.processes)]
        drives = named_causes(zip(causes, np.nan_to_num(content.budget.attributed[driven]).tolist(), strict=True))
    facts = sizes_at_the_end(list(known.values()), drives, "fold-linear-analysis", known[driven][0])
    return [*facts, *_means(summary, known)]


def _largest(known: Mapping[int, tuple[str, float, str]]) -> int:
    """Return the output with the largest sigma of those in the unit of the first one."""
    unit = known[min(known)][2]
    return max((i for i in known if known[i][2] == unit), key=lambda i: known[i][1])


def _means(summary: Summary, known: Mapping[int, tuple[str, float, str]]) -> list[tuple[str, Markup | str]]:
    """Give the mean error that is the largest in sigmas, of those that are certain and beyond the tolerance."""
    certain = {}
    for i, (name, size, unit) in known.items():
        if i >= min(len(summary.mean_error), len(summary.mean_error_interval)):
            continue
        mean, ends = summary.mean_error[i], summary.mean_error_interval[i]
        if mean is None or ends is None or ends[0] is None or ends[1] is None or ends[0] <= 0.0 <= ends[1]:
            continue
        scaled = mean * shown_units(summary)[name][0]
        if abs(scaled) > summary.tolerance * size:
            certain[abs(scaled) / size] = f"{humanize(name)} {signed(scaled, DIGITS)} {unit}".rstrip()
    return [("Mean error", certain[max(certain)])] if certain else []


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
    epochs = content.folder.epochs()
    known = None if epochs is None else epochs[0]
    most = 1 if not said and all(row.tone == "agrees" for row in rows) else REQUIREMENTS
    more = len(rows) - most if len(rows) > most + (most > 1) else 0
    listed = rows[:most] if more else rows
    entries = [(row.entry.finding, row.tone, requirement_in_brief(row, known)) for row in listed]
    others = (", met" if more == 1 else ", all met") if all(row.tone == "agrees" for row in rows[most:]) else ""
    return Findings(entries, MORE(more, others) if more else "")
