"""Budgets with correlations: bars that add up to 100 %, also where a share is negative."""

from __future__ import annotations

import numpy as np

from mcnav.report.drawing.marks import Bars, numbered
from mcnav.report.figures.budgets import CROSSED, shares_figure
from mcnav.report.figures.sources import Contributor


def test_bars_of_both_signs_reach_from_the_negative_shares_to_the_rest_of_the_whole() -> None:
    """Shares of 1.4, −0.5 and 0.1: to the right of zero 150 %, to the left 50 %."""
    shares = np.array([[1.4, -0.5, 0.1]])
    contributors = [Contributor(numbered(place, name), (place,)) for place, name in enumerate("abc")]
    figure = shares_figure(
        "Budget", "", ("cause", list("abc")), ["y"], {"": ("Linear", shares)}, contributors, crossed=True
    )
    ends = [(float(np.ravel(bar.low)[0]), float(np.ravel(bar.high)[0]))
            for bar in figure.panels[0].marks if isinstance(bar, Bars)]  # fmt: skip
    np.testing.assert_allclose(ends, [(0.0, 140.0), (-50.0, 0.0), (140.0, 150.0)])
    across = figure.panels[0].x
    assert across.low is not None
    assert across.high is not None
    assert across.low <= -50.0
    assert 150.0 <= across.high <= 160.0
    assert CROSSED in figure.caption
