"""The waterfall of two error budgets leads from the variance of one run to that of the other."""

from __future__ import annotations

import numpy as np
import pytest

from mcnav.analysis.envelopes import Envelopes
from mcnav.analysis.summary import Summary
from mcnav.report.drawing.marks import Bars, Line
from mcnav.report.figures.comparisons import CROSS, LISTED, curves, variance_parts, waterfall
from mcnav.report.pages.comparison import changed_verdicts
from tests.summaries import requirement, summary

ROUNDING = 1e-12
"""Relative error of sums of a dozen doubles."""


def run(contributions: list[list[float]], sigma: list[float], sources: list[str]) -> Summary:
    """Return a summary with two outputs and contributions of its sources, shape (2, sources)."""
    table = np.array(contributions)
    budget = {"shares": table, "cross_terms": [0.0, 0.0], "contributions": table, "saved": table}
    named = [{"name": name, "unit": "m"} for name in sources]
    return summary(
        outputs=[{"name": "x", "unit": "m"}, {"name": "y", "unit": "m"}],
        shown_in={"sources": ["m"] * len(sources), "outputs": ["km", "m"]},
        sources=named,
        sigma_linear=np.array(sigma),
        budget=budget,
    )


FIRST = run([[3.0, 4.0], [1.0, 0.0]], [5.0, 1.0], ["bias", "drift"])
CORRELATED = run([[6.0, 2.0], [0.5, 0.0]], [7.0, 0.5], ["bias", "noise"])


@pytest.mark.parametrize("pair", [(FIRST, CORRELATED), (CORRELATED, FIRST), (FIRST, FIRST)])
@pytest.mark.parametrize("output", ["x", "y"])
def test_parts_add_up_to_the_variances(pair: tuple[Summary, Summary], output: str) -> None:
    parts, unit = variance_parts(*pair, output)
    at = pair[0].names.index(output)
    for which, each in zip(("before", "after"), pair, strict=True):
        total = unit * sum(getattr(part, which) for part in parts)
        assert total == pytest.approx(float(each.sigma_linear[at] ** 2), rel=ROUNDING)
    assert [abs(part.change) for part in parts] == sorted((abs(part.change) for part in parts), reverse=True)


def test_each_cause_has_its_own_part() -> None:
    """Of x, in units of 25: bias 9 to 36, drift 16 to 0, noise 0 to 4, and 49 - 40 that correlations add."""
    parts, unit = variance_parts(FIRST, CORRELATED, "x")
    assert unit == 25.0
    changes = {part.name: part.change * unit for part in parts}
    assert changes == pytest.approx({"bias": 27.0, "drift": -16.0, CROSS: 9.0, "noise": 4.0}, rel=ROUNDING)


def test_bars_lead_from_one_run_to_the_other() -> None:
    drawn = waterfall(("first", "second"), FIRST, CORRELATED, "waterfall-1")
    assert drawn is not None
    (totals, more, less) = (mark for mark in drawn.panels[0].marks if isinstance(mark, Bars))
    assert np.asarray(totals.high) == pytest.approx([100.0, 196.0], rel=ROUNDING)
    ends = dict(zip(np.asarray(more.rows).tolist(), zip(more.low, more.high, strict=True), strict=True))
    ends |= dict(zip(np.asarray(less.rows).tolist(), zip(less.high, less.low, strict=True), strict=True))
    at = 100.0
    for row in sorted(ends):
        assert ends[row][0] == pytest.approx(at, rel=ROUNDING)
        at = ends[row][1]
    assert at == pytest.approx(196.0, rel=ROUNDING)
    assert "bias: 0.00300 km to 0.00600 km" in more.texts


def test_many_causes_stand_together() -> None:
    names = [f"cause {chr(97 + k)}" for k in range(LISTED + 5)]
    sizes = np.sqrt(np.arange(1.0, len(names) + 1.0))
    first = run([sizes.tolist(), [0.0] * len(names)], [float(np.linalg.norm(sizes)), 0.0], names)
    second = run([(2.0 * sizes).tolist(), [0.0] * len(names)], [float(2.0 * np.linalg.norm(sizes)), 0.0], names)
    drawn = waterfall(("first", "second"), first, second, "waterfall-1")
    assert drawn is not None
    (panel,) = drawn.panels  # nothing disturbs the other output
    assert len(panel.y.names) == LISTED + 3
    assert panel.y.names[-2] == f"{5 + 1} others"  # the part of correlations is one of them
    (totals, *_) = (mark for mark in panel.marks if isinstance(mark, Bars))
    assert np.asarray(totals.high) == pytest.approx([100.0, 400.0], rel=ROUNDING)


def over_time(label: str, sigma: list[float]) -> Envelopes:
    times, both = np.linspace(0.0, 1.0, 3), np.outer([1.0, 2.0, 3.0], sigma)
    nothing = np.zeros((3, 2))
    covariance = np.zeros((3, 2, 2))
    return Envelopes(label, times, {}, nothing, 1.1 * both, nothing, both, covariance, nothing, {}, 10, 10)


def test_curves_lie_over_each_other_where_times_mean_the_same() -> None:
    known = over_time("time [min]", [1000.0, 0.0]), over_time("time [min]", [2000.0, 0.0])
    drawn = curves(("a", "b"), (FIRST, CORRELATED), known)
    assert drawn is not None
    (panel,) = drawn.panels  # nothing moves the other output
    lines = [np.asarray(mark.y)[-1] for mark in panel.marks if isinstance(mark, Line)]
    assert lines == pytest.approx([3.3, 3.0, 6.6, 6.0], rel=ROUNDING)
    assert (panel.title, panel.y.unit) == ("x", "km")
    other = over_time("altitude [km]", [2000.0, 0.0])
    assert curves(("a", "b"), (FIRST, CORRELATED), (known[0], other)) is None
    assert curves(("a", "b"), (FIRST, CORRELATED), (known[0], None)) is None
    assert curves(("a", "b"), (FIRST, CORRELATED), (None, known[0])) is None


def test_verdicts_that_differ_between_runs_are_said() -> None:
    """Of the filter and of requirements; a run without a requirement is not compared."""
    met, missed = (summary(requirements=[requirement(finding)]) for finding in ("met", "not met"))
    assert changed_verdicts(["a", "b"], [met, missed]) == ["Requirements: 1 of 1 met in a, 0 of 1 met, 1 not met in b."]
    assert changed_verdicts(["a", "b"], [met, met]) == []
    assert changed_verdicts(["a", "b"], [met, summary()]) == []
