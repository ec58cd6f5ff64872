"""Estimates of the errors of instruments and sensors: their true errors over time, and the filter's sigmas."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from mcnav.analysis.filter_consistency import FilterConsistency, SigmaConsistency
from mcnav.report.drawing.figure import Figure, side_by_side
from mcnav.report.drawing.marks import Axis, Line, Mark, Panel, Span
from mcnav.report.figures.filter_errors import SIGMAS, sigmas, whole_flight
from mcnav.report.figures.outages import outages, shading_key
from mcnav.report.names import humanize
from mcnav.report.results.model import RunAnalysis

WIDTHS: Final = {"linear": 3.2, "Monte Carlo": 1.7, "filter": 1.4}
"""Widths of the lines by whose sigma they are: of those on one another, all are seen."""


def estimation(content: RunAnalysis) -> Figure | None:
    """Draw the sigma of each other state of the filter over time, a panel for each."""
    figure = content.filter
    if figure is None:
        return None
    known = [state for state in figure.states if np.isfinite(state.true).any() and np.any(state.filter > 0.0)]
    if not known:
        return None
    shaded = outages(content)
    columns: dict[str, Sequence[Any] | NDArray[Any]] = {figure.label: figure.times}
    for estimated in known:
        for whose, values in sigmas(estimated).items():
            columns[f"{humanize(estimated.name)}, {whose} σ [{estimated.shown_in}]"] = values
    methods = {whose for state in known for whose in sigmas(state)}
    return Figure(
        name="estimation",
        title="Estimates of the errors of instruments and sensors",
        description="Sigma of the errors of the filter's estimates by Monte Carlo and linear analysis, and the sigma "
        "that the filter states, over time.",
        panels=[_panel(figure, state, shaded) for state in known],
        key=[*(series for whose, series in SIGMAS.items() if whose in methods), *shading_key(shaded)],
        columns=columns,
        size=side_by_side(len(known), 240.0),
    )


def _panel(consistency: FilterConsistency, state: SigmaConsistency, shaded: Sequence[Span]) -> Panel:
    marks: list[Mark] = [
        Line(SIGMAS[whose], consistency.times, values, WIDTHS[whose]) for whose, values in sigmas(state).items()
    ]
    upward = Axis("1σ", state.shown_in, low=0.0)
    return Panel(humanize(state.name), whole_flight(consistency), upward, [*shaded, *marks])
