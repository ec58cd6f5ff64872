"""What fails comes before every Yes: in the terminal, in headlines, on pages and in notebooks."""

from __future__ import annotations

from io import StringIO
from itertools import product
from typing import Any

import pytest
from rich.console import Console

from mcnav.analysis.summary import Summary
from mcnav.report.results.filter_summary import filter_entries
from mcnav.report.statements import verdicts
from mcnav.report.terminal import terminal
from tests import summaries
from tests.filters import consistency

BEGINNINGS = {
    ("linear", "agrees"): "Linear covariance predicts every", ("linear", "differs"): "The linear sigmas are wrong",
    ("requirements", "agrees"): "Requirements: 1 of 1 met.", ("requirements", "differs"): "Requirements: 0 of 1 met",
    ("filter", "agrees"): "The filter's covariance", ("filter", "differs"): "Do not trust this filter",
}  # fmt: skip


def run(linear: str, requirement: str, factor: float) -> Summary:
    pair: dict[str, Any] = {"outputs": [{"name": "x", "unit": "m"}, {"name": "y", "unit": "m"}]}
    return summaries.summary(
        verdict=linear, sigma_linear=[1.0, 1.0], verdicts=[linear, linear], sigma_ratio_paired=[1.0, 1.0],
        sigma_ratio_paired_interval=[[0.99, 1.01]] * 2, samples_needed=[None, None], **pair,
        requirements=[summaries.requirement(requirement)], **filter_entries(consistency(factor)),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("linear", "requirement", "factor"),
    list(product(("agrees", "differs"), ("met", "not met"), (1.0, 3.3))),
)
def test_what_fails_is_said_first(linear: str, requirement: str, factor: float) -> None:
    """Of requirements, filter and linear analysis in that order, those that fail, then the others."""
    tones = {
        "requirements": "agrees" if requirement == "met" else "differs",
        "filter": "agrees" if factor == 1.0 else "differs",
        "linear": linear,
    }
    expected = [subject for tone in ("differs", "agrees") for subject in tones if tones[subject] == tone]
    summary = run(linear, requirement, factor)
    assert [each.subject for each in verdicts.statements(summary)] == expected
    console = Console(file=StringIO(), width=1_000)
    console.print(terminal.verdict(summary))
    assert isinstance(console.file, StringIO)
    for told in (console.file.getvalue(), verdicts.headline(summary)):
        places = [told.index(BEGINNINGS[subject, tones[subject]]) for subject in expected]
        assert places == sorted(places)
        assert places[0] == 0
