"""Margins of requirements on outputs with a nominal, and the limit in the figure of what it limits."""

from __future__ import annotations

import numpy as np
import pytest

from mcnav.analysis.summary import Summary
from mcnav.report.columns.requirements import requirement_rows
from mcnav.report.drawing.figure import Figure
from mcnav.report.drawing.marks import Axis, Line, Panel, Points, Rule, Series, Steps
from mcnav.report.figures.brief import limit_to_causes
from mcnav.report.figures.requirements import with_limit
from mcnav.report.statements.requirements import confidence_words, margin, worst_requirement
from tests import summaries

SINK_RATE = {"kind": "quantile", "outputs": ["sink_rate"], "probability": 0.99, "limits": [1.1]}


def run(*requirements: dict[str, object], nominal: float = 1.0) -> Summary:
    outputs = [{"name": "sink_rate", "unit": "m/s", "of": "truth"}, {"name": "x", "unit": "m"},
               {"name": "y", "unit": "m"}]  # fmt: skip
    return summaries.summary(
        outputs=outputs, nominal=[nominal, None, None], requirements=list(requirements), sigma_linear=[1.0] * 3
    )


def test_errors_grow_about_the_nominal_until_the_quantile_is_the_limit() -> None:
    """Of a million draws about 1 m/s the multiple brings 99 % to the limit; the ratio of sizes is 1.02."""
    errors = 0.03 * np.random.default_rng(1).standard_normal(1_000_000)
    estimate = float(np.quantile(np.abs(1.0 + errors), 0.99))
    entry = summaries.requirement("met", **SINK_RATE, estimate=estimate, interval=[1.06, 1.08])
    (row,) = requirement_rows(run(entry))
    multiple = margin(row)
    assert multiple is not None
    assert float(np.quantile(np.abs(1.0 + multiple * errors), 0.99)) == pytest.approx(1.1, rel=1e-12)
    assert multiple > 1.3 * 1.1 / estimate
    assert confidence_words(row).startswith(f"Errors may be × {multiple:.2f}; with 95 % confidence at most ")


def test_no_margin_where_both_tails_of_an_output_with_a_nominal_decide() -> None:
    entry = summaries.requirement("met", **SINK_RATE, estimate=0.9, interval=[0.8, 1.0])
    (row,) = requirement_rows(run(entry, nominal=0.1))
    assert margin(row) is None
    assert confidence_words(row) == "With 95 % confidence at most 1.00 m/s."


def test_a_ratio_of_sigmas_has_no_margin() -> None:
    """Its limit is what it may depart from one by: 0.05 over 1.01 says nothing."""
    entry = summaries.requirement("met", kind="sigma_ratio", outputs=[], limits=[0.05], estimate=1.01)
    (row,) = requirement_rows(run(entry))
    assert margin(row) is None
    assert confidence_words(row) == ""


def test_the_least_margin_is_that_of_the_errors() -> None:
    """98 % of a limit of which the nominal takes 91 % is farther away than 80 % of one without a nominal."""
    rate = summaries.requirement("met", **SINK_RATE, estimate=1.076, interval=[1.07, 1.08])
    place = summaries.requirement("met", kind="r95", limits=[900.0], estimate=715.0, interval=[700.0, 730.0])
    worst = worst_requirement(run(rate, place))
    assert worst is not None
    assert worst.entry.kind == "r95"


def test_numbers_have_the_digits_that_tell_them_from_their_bounds() -> None:
    entry = summaries.requirement("met", **SINK_RATE, estimate=1.076, interval=[1.071, 1.0803])
    (row,) = requirement_rows(run(entry))
    assert confidence_words(row).endswith("at most 1.080 m/s.")


def test_the_waterfall_allows_the_square_of_the_margin() -> None:
    """The limit of 1.1 m/s leaves 0.1 m/s to errors, of which the samples use at most 0.08."""
    causes = [{"name": "a", "share": 0.6}, {"name": "b", "share": 0.4}]
    entry = summaries.requirement("met", **SINK_RATE, estimate=1.07, interval=[1.06, 1.08], linear=1.07, causes=causes)
    (row,) = requirement_rows(run(entry))
    figure = limit_to_causes(row)
    assert figure is not None
    assert "the limit allows 156 %" in figure.shows


def _drawn(entry: dict[str, object], panel: Panel) -> Panel:
    (row,) = requirement_rows(run(entry))
    drawn = with_limit(Figure("one", "", "", [panel], [], {}), row)
    return drawn.panels[0]


def test_a_limit_is_drawn_on_the_side_that_an_output_reaches() -> None:
    counted, edges = Series("flown", "Monte Carlo", "black", "area"), np.linspace(0.9, 1.1, 11)
    entry = summaries.requirement("met", **SINK_RATE, estimate=1.07, interval=[1.06, 1.08])
    panel = Panel("", Axis("sink rate"), Axis("samples"), [Steps(counted, edges, np.ones(10))], about=["sink_rate"])
    drawn = _drawn(entry, panel)
    assert [mark.at for mark in drawn.marks if isinstance(mark, Rule)] == [1.1]


def test_the_limit_of_a_distance_is_a_circle_and_of_another_panel_nothing() -> None:
    """A requirement on three outputs has no circle in a plane of two."""
    dots = Series("flights", "samples", "black", "dot")
    points = Points(dots, np.array([-3.0, 4.0]), np.array([0.0, 1.0]))
    entry = summaries.requirement("met", kind="cep", limits=[5.0])
    panel = Panel("", Axis("x"), Axis("y"), [points], about=["x", "y"])
    (circle,) = [mark for mark in _drawn(entry, panel).marks if isinstance(mark, Line)]
    assert np.hypot(circle.x, circle.y) == pytest.approx(5.0)
    other = Panel("", Axis("x"), Axis("y"), [points], about=["x", "sink_rate"])
    assert _drawn(entry, other) is other
