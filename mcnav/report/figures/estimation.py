"""Estimates of the errors of instruments and sensors: their true errors over time, and the filter's sigmas."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from mcnav.analysis.filter_consistency import FilterConsistency, SigmaConsistency
from mcnav.report.drawing.axis_groups import curves, same_kind
from mcnav.report.drawing.figure import Figure, side_by_side
from mcnav.report.drawing.marks import Axis, Line, Mark, Panel, Span
from mcnav.report.figures.filter_errors import sigmas, whole_flight
from mcnav.report.figures.outages import outages, shading_key
from mcnav.report.names import humanize
from mcnav.report.results.model import RunAnalysis

LINES: Final = {"linear": "dashed", "Monte Carlo": "line", "filter": "dotted"}
"""Kinds of lines by whose sigma they are."""


def estimation(content: RunAnalysis) -> Figure | None:
    """Draw the sigma of each other state of the filter over time, the axes of one kind together."""
    figure = content.filter
    if figure is None:
        return None
    known = [state for state in figure.states if np.isfinite(state.true).any() and np.any(state.filter > 0.0)]
    groups = same_kind(known)
    if not groups:
        return None
    shaded = outages(content)
    columns: dict[str, Sequence[Any] | NDArray[Any]] = {figure.label: figure.times}
    for each in known:
        for whose, values in sigmas(each).items():
            columns[f"{humanize(each.name)}, {whose} σ [{each.shown_in}]"] = values
    linear = any(each.true_linear is not None for each in known)
    return Figure(
        name="estimation",
        title="Estimates of the errors of instruments and sensors",
        description="Sigma of the errors of the filter's estimates by Monte Carlo and linear analysis, and the sigma "
        "that the filter states, over time.",
        panels=[_panel(figure, place, title, members, shaded) for place, (title, members) in enumerate(groups)],
        key=shading_key(shaded),
        columns=columns,
        size=side_by_side(len(groups), 240.0),
        caption="Error of the estimate, one sigma. Solid: Monte Carlo."
        + (" Dashed: linear analysis." if linear else "")
        + " Dotted: the filter's own.",
    )


def _panel(
    consistency: FilterConsistency, place: int, title: str, members: Sequence[SigmaConsistency], shaded: Sequence[Span]
) -> Panel:
    series = curves(place, members)
    marks: list[Mark] = [
        Line(own, consistency.times, values, 1.9 if whose == "filter" else 1.5, LINES[whose])
        for own, member in zip(series, members, strict=True)
        for whose, values in sigmas(member).items()
    ]
    upward = Axis("1σ", members[0].shown_in, low=0.0)
    return Panel(title, whole_flight(consistency), upward, [*shaded, *marks], series)
