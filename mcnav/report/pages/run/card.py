"""A run as a notebook shows it: verdicts, sigmas with their largest causes, error budget, and errors over time."""

from __future__ import annotations

from mcnav.report.document.html import card_html
from mcnav.report.document.parts import Part, Sentence, Tiles, joined
from mcnav.report.document.table import STRONG
from mcnav.report.drawing.figure import bare
from mcnav.report.figures.envelopes import envelopes
from mcnav.report.figures.run_budget import budget
from mcnav.report.pages.run.sections.answers import answers
from mcnav.report.pages.run.tiles import tiles
from mcnav.report.results.model import RunAnalysis
from mcnav.report.statements import verdicts


def run_card(content: RunAnalysis) -> str:
    """Write a run as HTML, with its verdicts, the worst first."""
    summary = content.summary
    stated = tiles(summary, verdicts.statements(summary), (), content.time_unit)
    parts: list[Part] = [Sentence(STRONG(summary.campaign)), Tiles(stated), *joined(answers(content))]
    if content.dispersed:
        over_time = envelopes(content)
        parts += [bare(budget(content)), *([] if over_time is None else [bare(over_time)])]
    return card_html(parts)
