"""A run as a notebook shows it: verdicts, sigmas with their largest causes, error budget, and errors over time."""

from __future__ import annotations

from mcnav.report import sentences
from mcnav.report.document import STRONG, Part, Sentence, Tiles, joined
from mcnav.report.figures.envelopes import envelopes
from mcnav.report.figures.figure import bare
from mcnav.report.figures.run_budget import budget
from mcnav.report.html import card_html
from mcnav.report.model import RunAnalysis
from mcnav.report.sections.answers import answers
from mcnav.report.tiles import tiles


def run_card(content: RunAnalysis) -> str:
    """Write a run as HTML, with its verdicts, the worst first."""
    summary = content.summary
    stated = tiles(summary, sentences.statements(summary), (), content.time_unit)
    parts: list[Part] = [Sentence(STRONG(summary.campaign)), Tiles(stated), *joined(answers(content))]
    if content.dispersed:
        over_time = envelopes(content)
        parts += [bare(budget(content)), *([] if over_time is None else [bare(over_time)])]
    return card_html(parts)
