"""One screen that answers, and folds with everything else: of the page of a run, and of those of all studies."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import count
from typing import Final

from markupsafe import Markup

from mcnav.report.document.parts import (
    Beside,
    Facts,
    Findings,
    Fold,
    Folded,
    Page,
    Part,
    Section,
    Sentence,
    Verdict,
    Verdicts,
    joined,
)
from mcnav.report.drawing.figure import HALF, Figure
from mcnav.report.format import rounded
from mcnav.report.names import humanize
from mcnav.report.statements.requirements import named_together
from mcnav.report.statements.words import several

RESULTS: Final = "Results"
"""Fold of a study's sections that belong to no other."""

FOLDS: Final = {
    "Filter": ("filter", "estimation", "smoother", "kinds", "innovations", "reference", "gates"),
    "Linear analysis": ("combination", "linear", "causes", "joint", "dispersion", "truth", "over-time", "correlations"),
    "Requirements": ("requirements", "limits"),
    "Budget": ("budget", "remedies"),
    RESULTS: ("change", "when", "runs"),
    "Explore": ("what-if", "settings", "deck", "throughout", "flight"),
    "Provenance": ("provenance", "inputs"),
}
"""Folds below the first screen, and the sections in each."""

LINES: Final = {
    "Requirements": "Each requirement with its estimate and bounds",
    "Provenance": "Samples, campaign file, versions, checksums",
}
"""What is inside of folds whose one section has their own name; of others the titles of the sections say it."""

ANSWER: Final = 66
"""Most words of a study's verdict, the sentences below it and findings; the fold with its results has all."""

SAID: Final = 31
"""Most words of the sentences below its verdict."""

ROOM: Final = 66
"""Most words of an answer, the contents and the folds' lines for the folds to stand on the first screen as well."""

TITLES: Final = 4
"""Titles of sections that the line of a fold lists."""

SIZES: Final = 3
"""Outputs whose sigmas are given where there are more than one more."""

ROWS: Final = 3
"""Findings listed where there are more than one more."""

TALL: Final = 380.0
"""Least height of the figure on the first screen, px, unless it has a row for each thing that is compared."""

MORE: Final = Markup('<a href="#{}">and {} more</a>').format


def folds_of(sections: Sequence[Section], above: Mapping[str, Sequence[Part]], rest: str = RESULTS) -> list[Fold]:
    """Put sections in folds; folds that would be empty are left out.

    Parameters
    ----------
    above : mapping of str to sequence of Part
        Parts above the sections, by fold.
    rest : str
        Fold of sections that belong to no other.
    """
    known = {name: title for title, names in FOLDS.items() for name in names}
    folds = []
    for title, names in FOLDS.items():
        own = [section for section in sections if known.get(section.name, rest) == title]
        own.sort(key=lambda section, names=names: names.index(section.name) if section.name in names else len(names))  # type: ignore[misc]
        parts = above.get(title, [])
        if own or parts:
            alone = title in LINES and len(own) < 2 and (not own or own[0].title == title)
            line = LINES[title] if alone else _listed([section.title for section in own])
            folds.append(Fold(_name(title), title, line, parts, own))
    return folds


def _name(title: str) -> str:
    """Return the name of a fold, to which links lead."""
    return f"fold-{title.lower().replace(' ', '-')}"


def _listed(titles: Sequence[str]) -> str:
    """List titles of sections in one line, of many the first few."""
    words = [*titles[:1], *(title[:1].lower() + title[1:] for title in titles[1:])]
    return several(words, TITLES) if len(words) > TITLES else ", ".join(words) or "The verdict"


def numbered_page(page: Page) -> Page:
    """Give figures their numbers, in the order of the page; a panel of another figure has none."""
    numbers = count(1)
    head = _numbered(page.head, numbers)
    sections = [replace(section, parts=_numbered(section.parts, numbers)) for section in page.sections]
    folds = [
        replace(fold, sections=[replace(section, parts=_numbered(section.parts, numbers)) for section in fold.sections])
        for fold in page.folds
    ]
    return replace(page, head=head, sections=sections, folds=folds)


def _numbered(parts: Sequence[Part], numbers: Iterator[int]) -> list[Part]:
    def counted(figure: Figure) -> Figure:
        return replace(figure, number=next(numbers)) if figure.shows else figure

    def with_numbers(part: Part) -> Part:
        match part:
            case Figure():
                return counted(part)
            case Beside():
                return replace(part, figures=[counted(figure) for figure in part.figures])
            case Folded():
                return replace(part, parts=_numbered(part.parts, numbers))
        return part

    return [with_numbers(part) for part in parts]


def foremost(figure: Figure, shows: str = "") -> Figure:
    """Return the copy of a figure that stands on the first screen, without its table and caption, large."""
    width, height = figure.size if figure.size[0] == HALF[0] else HALF
    size = (width, height if any(panel.y.names for panel in figure.panels) else max(height, TALL))
    return replace(figure, name=f"first-{figure.name}", caption="", columns={}, file="", shows=shows, size=size)


def sizes_at_the_end(
    known: Sequence[tuple[str, float, str]], causes: str, target: str, driven: str = ""
) -> list[tuple[str, Markup | str]]:
    """Return facts: the sigmas of the first outputs, and what drives the first one, or ``driven``.

    Parameters
    ----------
    known : sequence of (str, float, str)
        Name, sigma and unit of each output; at least one.
    causes : str
        Empty where they are not known.
    target : str
        Section or fold with all outputs.
    """
    shown = known if len(known) == SIZES + 1 else known[:SIZES]
    names = named_together([name for name, _, _ in shown])
    sizes = [f"{name} {rounded(size)} {unit}".rstrip() for name, (_, size, unit) in zip(names, shown, strict=True)]
    more = Markup(', <a href="#{}">{} more</a>').format(target, len(known) - len(shown)) if known[len(shown) :] else ""
    facts: list[tuple[str, Markup | str]] = [("Sigma at the end", Markup("{}{}").format(", ".join(sizes), more))]
    return [*facts, (f"{humanize(driven or known[0][0])} is driven by".capitalize(), causes)] if causes else facts


def answered(page: Page, figure: Figure | None = None, rest: str = "Linear analysis") -> Page:
    """Put the page of a study on one screen: its verdict, a figure, findings; everything else is folded.

    Parameters
    ----------
    figure : Figure, optional
        What shows the answer, of which the first panel is drawn; by default the first figure of the sections.
    rest : str
        Fold of sections that belong to no other, and of the parts of the head that are not on the screen.
    """
    said, others = _foremost_verdict(page.head)
    findings = [part for part in others if isinstance(part, (Facts, Findings))]
    shown = figure or next(
        (part for section in page.sections for part in section.parts if isinstance(part, Figure) and part.panels), None
    )
    asked = next((fold.name for fold in folds_of(page.sections, {}, rest) if fold.title == "Requirements"), _name(rest))
    beside = [_shortened(part, asked) if isinstance(part, Findings) else part for part in findings]
    taken = sum(
        len(Markup(f"{entry[0]} {entry[-1]}").striptags().split())
        for part in beside if isinstance(part, Findings) or part.below for entry in part.entries
    )  # fmt: skip
    brief, whole = _in_brief(said, taken)
    below = [*([] if whole else [said]), *(part for part in others if part not in findings), *page.foot]
    first = None if shown is None else foremost(replace(shown, panels=shown.panels[:1], shown=0))
    head = joined(brief, *(beside if first is None else [Beside([first], beside)]))
    folds = folds_of(page.sections, {rest: below} if below else {}, rest)
    tone = brief.tone if brief.tone in ("agrees", "partly", "undecided", "differs") else ""
    said_words = [brief.headline, *brief.sentences, *(entry[-1] for part in beside for entry in part.entries)]
    listed = [*said_words, *(2 * f"{fold.title} " + fold.line for fold in folds)]
    short = sum(len(words.split()) for words in listed) <= ROOM
    return replace(page, head=head, sections=[], foot=[], folds=folds, tone=tone or page.tone, short=short)


def _foremost_verdict(head: Sequence[Part]) -> tuple[Verdict, list[Part]]:
    """Return the verdict of a page, and the other parts of its head; a sentence stands for one."""
    others = list(head)
    for place, part in enumerate(head):
        if isinstance(part, Verdict):
            return part, [*others[:place], *others[place + 1 :]]
        if isinstance(part, Verdicts):
            first, *more = part.verdicts
            return first, [*others[:place], *([Verdicts(more)] if more else []), *others[place + 1 :]]
        if isinstance(part, Sentence):
            return Verdict(part.text, part.tone), [*others[:place], *others[place + 1 :]]
    return Verdict(""), others


def _in_brief(verdict: Verdict, taken: int) -> tuple[Verdict, bool]:
    """Return a verdict of one sentence with the next few below it, and whether that is all of it.

    ``taken``: words of the findings beside it.
    """
    first, *rest = _sentences(str(verdict.headline))
    room = min(SAID, ANSWER - taken - len(first.split()))
    texts = [*rest, *(sentence for text in verdict.sentences for sentence in _sentences(str(text)))]
    said: list[str] = []
    for text in texts:
        if sum(len(sentence.split()) for sentence in [*said, text]) > room:
            break
        said.append(text)
    whole = len(said) == len(texts) and not verdict.warnings
    return Verdict(first, verdict.tone, said), whole


def _sentences(text: str) -> list[str]:
    """Split a text at the ends of its sentences.

    >>> _sentences("All are met. It takes 1.5 s. Then: nothing.")
    ['All are met.', 'It takes 1.5 s.', 'Then: nothing.']
    """
    return re.split(r"(?<=[.!?])\s+", text)


def _shortened(findings: Findings, fold: str) -> Findings:
    """List the first few findings, and how many more there are, in a fold."""
    more = len(findings.entries) - ROWS
    if more < 2:
        return findings
    return replace(findings, entries=findings.entries[:ROWS], further=MORE(fold, more))
