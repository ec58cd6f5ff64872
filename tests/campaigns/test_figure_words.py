"""Sentences on the figures of a report, against the numbers of the run and those in the figure's own table."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

import mcnav
from mcnav.report.drawing.figure import Figure
from mcnav.report.figures.captions import WORDS, words_on
from mcnav.report.pages.run.page import FIGURES, figures, page
from mcnav.report.results.model import RunAnalysis
from mcnav.workflow.run import run_campaign
from tests.conftest import campaign


@pytest.fixture(scope="module")
def content(tmp_path_factory: pytest.TempPathFactory) -> RunAnalysis:
    folder = tmp_path_factory.mktemp("run")
    run_campaign(campaign(4, samples=2_000), folder, "ensemble", 1, report=False)
    return mcnav.open_run(folder).content


def number_in(pattern: str, text: str) -> float:
    match = re.search(pattern, text)
    assert match is not None, text
    return float(match[1].replace("−", "-"))


def test_every_figure_has_its_sentence(content: RunAnalysis) -> None:
    """One sentence, which ends as sentences do; figures of a run carry it, in the order of the page.

    The flight deck, which has one for each instant, has them itself.
    """
    assert {"flight", *FIGURES} == {"deck", *WORDS}
    drawn = figures(content)
    assert all(re.fullmatch(r"[A-Z\d].*\.", each.shows) for each in drawn.values())
    report = page(content)
    parts = [*report.head, *(part for section in report.all_sections for part in section.parts)]
    shown = [part for part in parts if isinstance(part, Figure)]
    assert [each.number for each in shown] == list(range(1, len(shown) + 1))


def test_numbers_are_those_of_the_figures(content: RunAnalysis) -> None:
    drawn, comparison = figures(content), content.comparison
    sigma = np.sqrt(np.diag(comparison.covariance_linear)) * content.output_scale
    away = np.abs(content.flown - content.model.outcome_mean * content.output_scale) / sigma
    farthest = words_on("histograms", content)
    assert number_in(r"is ([\d.]+) linear sigmas", farthest) == pytest.approx(away.max(), rel=5e-3)
    assert f"sample, {content.index[np.argmax(away.max(axis=1))]}," in farthest
    shares = np.asarray(content.budget.shares)
    assert number_in(r": ([\d.]+) %", words_on("budget", content)) == pytest.approx(100.0 * shares.max(), rel=5e-3)
    above = number_in(r"^([\d.]+) %", words_on("nees", content))
    assert comparison.ellipsoid is not None
    assert above == pytest.approx(100.0 * np.mean(comparison.ellipsoid.values > 9.488), rel=5e-3)  # chi-square, 4
    begin, *_, end = drawn["flight"].data["altitude [km]"]
    assert words_on("flight", content).startswith("Altitude goes from ")
    assert number_in(r"to ([\d.,]+) km", words_on("flight", content)) == pytest.approx(end, rel=5e-3)
    assert begin > end


def test_ratios_say_on_which_side_of_the_tolerance_they_are(content: RunAnalysis) -> None:
    """The paired intervals are some 1e-3 wide: within 5 %, and with a tolerance of 1e-6 beyond it or across."""
    assert words_on("ratios", content) == "All paired ratios stay within ±5 %, with their intervals."
    assert words_on("convergence", content).endswith(" samples on all paired intervals stay within ±5 %.")
    strict = replace(content, criterion=replace(content.criterion, tolerance=1e-6))
    told = words_on("ratios", strict)
    named = [name for name in content.output_names if name in told]
    assert named == content.output_names[:3]
    assert "and 1 more" in told
    assert "beyond ±0.0001 %" in told or "across a limit of ±0.0001 %" in told
    assert words_on("convergence", strict).startswith("With all 2,000 samples a paired interval still reaches beyond")
