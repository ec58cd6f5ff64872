"""Truth and navigation of a closed loop: kinds of outputs, figures' numbers, and correlations."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rich.console import Console
from scipy import stats

from mcnav.analysis.envelopes import Envelopes
from mcnav.analysis.multivariate import CorrelationDifference
from mcnav.contract.quantities import KINDS, Output, kind_of, kinds_of
from mcnav.report.document.html import parts_html
from mcnav.report.document.table import Column, Table
from mcnav.report.document.terminal_parts import fitted
from mcnav.report.drawing.marks import Line
from mcnav.report.figures.truth import KINDS as DRAWN
from mcnav.report.figures.truth import SigmasOverTime, dispersion_over_time, ellipse, ellipses_at_end, over_time
from mcnav.report.pages.run.sections.truth import correlation_rows, truth_section
from mcnav.report.results.kinds import planes, quantities
from mcnav.statistics.estimates import Estimate

OUTPUTS = [
    Output("x", "m", "km"), Output("y", "m", "km"), Output("true_x", "m", "km", of="truth"),
    Output("true_y", "m", "km", of="truth"), Output("true_mass", "kg", "kg", of="truth"),
    Output("navigated_x", "m", "km", of="truth"), Output("navigated_y", "m", "km", of="truth"),
    Output("burn", "m/s", "m/s", of="control"), Output("final_time", "s", "s", of="time"),
]  # fmt: skip
SCALE = np.array([1e-3 if output.unit == "m" else 1.0 for output in OUTPUTS])
TIMES = np.array([0.0, 1.0, 2.0])


def covariance() -> Any:
    """In x the truth is minus the navigation error; in y both are independent; the navigator says that x is zero."""
    basis = np.zeros((len(OUTPUTS), 5))
    basis[0, 0], basis[2, 0] = 300.0, -300.0
    basis[1, 1], basis[3, 2], basis[6, 1:3] = 40.0, 500.0, (40.0, 500.0)
    basis[4, 3] = 2.0
    basis[7, 4] = basis[8, 4] = 1.0
    return basis @ basis.T


def content(outputs: list[Output] = OUTPUTS, filtered: bool = True) -> Any:
    """What the figures read of a run in which Monte Carlo sigmas are 1.1 times the linear ones."""
    count, linear = len(outputs), covariance()[: len(outputs), : len(outputs)]
    sigma = np.sqrt(np.diag(linear)) * np.array([[3.0], [2.0], [1.0]])
    known = Envelopes(
        "time [s]", TIMES, {"burn": 1.0}, 0.0 * sigma, 1.1 * sigma, 0.0 * sigma, sigma, np.zeros((3, count, count)),
        sigma**4, {}, 100, 100,
    )  # fmt: skip
    stated = SimpleNamespace(name="x", filter=np.array([9.0, 6.0, 3.0]) * 80.0, filter_linear=None)
    flown = np.random.default_rng(3).standard_normal((50, count))
    return SimpleNamespace(
        manifest=SimpleNamespace(model=SimpleNamespace(outputs=outputs)), envelopes=known, flown=flown,
        filter=SimpleNamespace(times=TIMES, outputs=[stated]) if filtered else None,
        output_scale=SCALE[:count], output_units=[output.shown_in for output in outputs],
        model=SimpleNamespace(outcome_mean=np.arange(count) * 100.0),
        comparison=SimpleNamespace(
            covariance_linear=linear, covariance_paired=1.21 * linear, covariance_sample=1.21 * linear,
            mean_sample=np.arange(count) * 110.0,
            joint=SimpleNamespace(correlations=[
                CorrelationDifference((1, 3), 0.0, 0.0, Estimate(0.0, 0.05, 400.0)),
            ]),
        ),
        criterion=SimpleNamespace(confidence=0.95),
    )  # fmt: skip


def test_outputs_have_kinds_where_not_all_are_navigation_errors() -> None:
    assert list(dict.fromkeys(map(kind_of, OUTPUTS))) == list(KINDS)
    assert kinds_of(OUTPUTS[:2]) == ["", ""]
    assert kinds_of(OUTPUTS[:3]) == [KINDS[0], KINDS[0], KINDS[1]]


def test_a_quantity_has_the_outputs_that_are_of_it() -> None:
    assert [(each.name, each.true, each.error, each.navigated) for each in quantities(OUTPUTS)] == [
        ("x", 2, 0, 5), ("y", 3, 1, 6), ("mass", 4, None, None),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("names", "pairs"),
    [
        (("range", "cross_range", "range_rate"), [("range", "cross_range")]),
        (("position_north", "position_east", "position_down"), [("position_east", "position_north")]),
        (("position_radial", "position_along", "position_across"), [("position_along", "position_across")]),
        (("range",), []), (("mass", "altitude"), []),
    ],
)  # fmt: skip
def test_two_directions_make_a_plane(names: tuple[str, ...], pairs: list[tuple[str, str]]) -> None:
    outputs = [Output(f"true_{name}", "m/s" if name.endswith("rate") else "m", "m/s", of="truth") for name in names]
    assert [(right.name, upward.name) for right, upward in planes(outputs)] == pairs


def test_sigmas_over_time_are_in_the_unit_shown() -> None:
    figure = dispersion_over_time(content())
    assert figure is not None
    assert [panel.title for panel in figure.panels] == ["x", "y", "mass"]
    assert np.allclose(figure.columns["x, true dispersion, linear, 1σ [km]"], [0.9, 0.6, 0.3])
    assert np.allclose(figure.columns["x, navigation error, Monte Carlo, 1σ [km]"], [0.99, 0.66, 0.33])
    assert np.allclose(figure.columns["x, navigation error by the filter, Monte Carlo, 1σ [km]"], [0.72, 0.48, 0.24])
    assert np.allclose(
        figure.columns["y, navigation dispersion, linear, 1σ [km]"], np.hypot(0.04, 0.5) * np.arange(3, 0, -1)
    )
    assert np.allclose(figure.columns["mass, true dispersion, linear, 1σ [kg]"], [6.0, 4.0, 2.0])
    assert {len(values) for values in figure.columns.values()} == {3}
    text = "".join(figure.svgs)
    assert "nan" not in text
    assert all(f"series-{series.name}" in text for series in figure.key)
    without = dispersion_over_time(content(filtered=False))
    assert without is not None
    assert not any(DRAWN["own"][0] in series.label for series in without.key)


def test_linear_sigmas_alone_are_drawn_without_what_the_filter_does_not_state() -> None:
    sigma = np.full((3, len(OUTPUTS)), 1000.0)
    own = np.where(np.arange(len(OUTPUTS)) == 0, sigma, np.nan)
    figure = over_time(OUTPUTS, SigmasOverTime("time [s]", TIMES, {}, {"linear": sigma}, {"linear": own}))
    assert figure is not None
    assert [series.label for series in figure.key] == [f"{words}, linear" for words, _ in DRAWN.values()]
    filtered = [name for name in figure.columns if "by the filter" in name]
    assert filtered == ["x, navigation error by the filter, linear, 1σ [km]"]
    assert over_time(OUTPUTS, SigmasOverTime("time [s]", TIMES, {}, {"linear": 0.0 * sigma}, {})) is None


def test_an_ellipse_holds_its_probability() -> None:
    """Of 200,000 samples a share within 4.5 standard errors of 95 % is inside."""
    square, centre = np.array([[4.0, 1.5], [1.5, 1.0]]), np.array([3.0, -1.0])
    points = ellipse(centre, square) - centre[:, None]
    squared = np.einsum("in,ij,jn->n", points, np.linalg.inv(square), points)
    assert np.allclose(squared, squared[0])
    drawn = np.random.default_rng(4).multivariate_normal(np.zeros(2), square, 200_000)
    inside = np.einsum("ni,ij,nj->n", drawn, np.linalg.inv(square), drawn) < squared[0]
    assert abs(inside.mean() - 0.95) < 4.5 * np.sqrt(0.95 * 0.05 / 200_000)


def test_ellipses_at_the_end_have_their_numbers() -> None:
    figure = ellipses_at_end(content())
    assert figure is not None
    rows = [dict(zip(figure.columns, row, strict=True)) for row in zip(*figure.columns.values(), strict=True)]
    of = {row["of"]: row for row in rows}
    assert set(of) == {f"{words}, {route}" for words in ("true dispersion", "navigation dispersion", "navigation error")
                       for route in ("Monte Carlo", "linear")}  # fmt: skip
    true = of["true dispersion, linear"]
    assert [true[key] for key in ("mean x", "mean y", "σ x", "σ y", "correlation")] == pytest.approx(
        [0.2, 0.3, 0.3, 0.5, 0]
    )
    assert of["navigation error, Monte Carlo"]["σ y"] == pytest.approx(0.044)
    assert np.isnan(of["navigation dispersion, linear"]["correlation"])  # x is held at zero
    assert [panel.title for panel in figure.panels] == ["true dispersion", "navigation dispersion", "navigation error"]
    assert sum(isinstance(mark, Line) for panel in figure.panels for mark in panel.marks) == len(rows)


def test_correlations_of_truth_and_navigation_error() -> None:
    rows = {row.name: row for row in correlation_rows(content())}
    assert list(rows) == ["x", "y"]
    assert (rows["x"].linear, rows["x"].flown) == pytest.approx((-1.0, -1.0))
    assert (rows["y"].linear, rows["y"].sigma_true, rows["y"].sigma_error) == pytest.approx((0.0, 0.5, 0.04))
    half = np.tanh(0.05 * stats.t(400).ppf(0.9875))  # of two rows jointly
    assert rows["y"].ends == pytest.approx((-half, half))
    assert [rows[name].verdict for name in "xy"] == ["not tested", "inside"]
    assert replace(rows["y"], linear=0.2).verdict == "outside"
    assert replace(rows["y"], linear=-1.0, ends=(-1.0, -1.0 + 1e-15)).verdict == "inside"


def test_without_outputs_of_truth_there_is_no_section() -> None:
    errors = content(OUTPUTS[:2], filtered=False)
    assert dispersion_over_time(errors) is None
    assert ellipses_at_end(errors) is None
    assert truth_section(errors, {}) is None


@dataclass(frozen=True)
class Row:
    name: str
    kind: str


def test_rows_are_listed_under_headings() -> None:
    """Once above the first row of each group, on a page and in the terminal at any width."""
    columns: list[Column[Row]] = [
        Column("Output", lambda row: row.name, "output", "label"), Column("Size", lambda _: 2.0, "size"),
    ]  # fmt: skip
    rows = [Row("x", "Errors"), Row("y", "Errors"), Row("true x", "Dispersion")]
    table = Table("", columns, rows, group=lambda row: row.kind)
    assert table.headings == ["Errors", "", "Dispersion"]
    assert parts_html([table]).count('<th scope="rowgroup" colspan="2"') == 2
    assert "rowgroup" not in parts_html([Table("", columns, rows)])
    for width in (80, 10):
        console = Console(width=width, file=None, record=True, quiet=True)
        with console.capture() as captured:
            console.quiet = False
            console.print(fitted(table))
        lines = [line.strip() for line in captured.get().splitlines()]
        assert [lines.count(name) for name in ("Errors", "Dispersion")] == [1, 1]
