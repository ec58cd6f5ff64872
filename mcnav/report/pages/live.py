"""The live page: the page on linear covariance with its sliders first, and the settings that were tried beside it."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

from mcnav.analysis.answer_times import as_read
from mcnav.analysis.linear_answer import LinearAnswer
from mcnav.analysis.remedies import DOUBTED
from mcnav.analysis.summary import Summary
from mcnav.report.document.parts import Beside, Fold, LivePart, Note, Page, Section, Verdict, WhatIfPart
from mcnav.report.format import number, signed
from mcnav.report.names import humanize
from mcnav.report.pages.lincov import SizeRow, final_rows, requirement_rows, statements
from mcnav.report.pages.run.tiles import NAMES, status
from mcnav.report.statements.verdicts import statements as statements_on

EXPLANATION: Final = (
    "This page follows the campaign's file. When a slider is released, the filter is re-tuned for the numbers above, "
    "as mcnav lincov does. The answer is kept here beside those before.",
    "All of it is linear analysis, which may be wrong. Confirm by Monte Carlo runs a setting and tells. Copy as TOML "
    "gives its campaign file. Save it beside the watched file.",
)


@dataclass(frozen=True)
class Confirmation:
    """A Monte Carlo run of a setting: what it does, or the verdicts once it has ended.

    Attributes
    ----------
    state : str
        ``running``, ``done`` or ``failed``.
    words : str
        Phase with samples; or what went wrong.
    share : float, optional
        Of the samples that are ready, where their number is known.
    verdicts : sequence of (str, str, str)
        Subject, verdict and its tone, the worst first.
    folder : str
        Of the run.
    """

    state: str
    words: str = ""
    share: float | None = None
    verdicts: Sequence[tuple[str, str, str]] = ()
    folder: str = ""


@dataclass(frozen=True)
class Setting:
    """Numbers that were tried, and the linear answer to them.

    Attributes
    ----------
    number : int
        Among all that were answered.
    title : str
        Its name on the page.
    revision : int
        Number of the file's content to which the factors belong.
    when : str
        Time of day of the answer.
    factors : mapping of str to float
        By the keys of the numbers.
    changed : sequence of (str, str)
        Keys with the numbers tried.
    confirmation : Confirmation, optional
    """

    number: int
    title: str
    revision: int
    when: str
    factors: Mapping[str, float]
    changed: Sequence[tuple[str, str]]
    answer: LinearAnswer
    confirmation: Confirmation | None = None


def verdicts(summary: Summary) -> list[tuple[str, str, str]]:
    """List the verdicts on a run: subject, verdict in a word or two, tone."""
    return [
        (NAMES[statement.subject], status(summary, statement.subject), statement.tone)
        for statement in statements_on(summary)
    ]


def live_state(settings: Sequence[Setting], revision: int, error: str) -> dict[str, object]:
    """Return what the page shows of the settings, with the number of the file's content and what is wrong with it."""
    return {"revision": revision, "error": error, "settings": [_column(setting) for setting in settings]}


def _column(setting: Setting) -> dict[str, object]:
    """Return one setting in words; means and sigmas are in the units shown, at the end."""
    answer, confirmation = setting.answer, setting.confirmation
    return {
        "number": setting.number,
        "title": setting.title,
        "revision": setting.revision,
        "when": setting.when,
        "factors": setting.factors,
        "curves": _curves(answer),
        "doubted": [humanize(row.output) for row in final_rows(answer) if row.linearity in DOUBTED],
        "changed": setting.changed,
        "sentences": statements(answer),
        "requirements": [
            {"words": row.requirement, "shown": row.shown, "finding": row.finding, "tone": row.tone,
             "margin": "" if row.margin is None else number(row.margin, 3)}
            for row in requirement_rows(answer)
        ],
        "sigmas": [
            {"words": humanize(row.output), "unit": row.unit, "shown": _shown(row),
             "claimed": "" if row.sigma_filter is None else number(row.sigma_filter),
             "doubt": f"linear analysis {row.linearity}" if row.linearity in DOUBTED else ""}
            for row in final_rows(answer)
        ],
        "run": None if confirmation is None else vars(confirmation),
    }  # fmt: skip


def _curves(answer: LinearAnswer) -> dict[str, list[float]]:
    """Return the sigma of each output over time in words' names, SI, after updates; nothing beyond the linear range."""
    history = as_read(answer).meaningful
    if history is None:
        return {}
    settled = history.settled
    times = [float(f"{time:.9g}") for time in history.readings.times[settled]]
    sigmas = {
        humanize(output.name): [float(f"{value:.5g}") for value in history.sigma[settled, i]]
        for i, output in enumerate(answer.outputs)
    }
    return {"": times, **sigmas}


def _shown(row: SizeRow) -> str:
    """Write the sigma of an output at the end, about its value on the nominal flight, and its mean error."""
    if row.sigma is None:
        return "–"
    about = "" if row.nominal is None else f"{number(row.nominal)} ± "
    return f"{about}{number(row.sigma)}{f', mean error {signed(row.mean)}' if row.mean else ''}"


def live_page(page: Page, state: Mapping[str, object]) -> Page:
    """Return the page on linear covariance as a live one, which begins with a state."""
    text = json.dumps(state, ensure_ascii=False, allow_nan=False).replace("<", "\\u003c")
    tried = Section("settings", "Settings tried", [*map(Note, EXPLANATION), LivePart(text)])
    settings = Fold("fold-settings", "Settings", "Side by side, to be confirmed by Monte Carlo", [], [tried])
    sliders = [part for section in page.all_sections for part in section.parts if isinstance(part, WhatIfPart)]
    folds = [replace(fold, sections=[_without_sliders(section) for section in fold.sections]) for fold in page.folds]
    shown = [replace(part, first=True) for part in sliders]
    head = [part for part in page.head if not (shown and isinstance(part, Beside))]  # sliders in place of the figure
    verdict = [replace(part, sentences=[], warnings=[]) if isinstance(part, Verdict) else part for part in head]
    title = f"{page.heading}: live"
    return replace(page, title=title, kind="Live", head=[*verdict, *shown], folds=[settings, *folds], short=False)


def _without_sliders(section: Section) -> Section:
    return replace(section, parts=[part for part in section.parts if not isinstance(part, WhatIfPart)])
