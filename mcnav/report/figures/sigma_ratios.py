"""Sigmas of a filter over time: ratios of true to filter sigma, shares of samples within the filter's sigmas."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from mcnav.analysis.filter_consistency import Band as Statistic
from mcnav.analysis.filter_consistency import FilterConsistency, SigmaConsistency
from mcnav.report.drawing.axis_groups import Group, curves, same_unit
from mcnav.report.drawing.figure import SEVERAL, Figure, side_by_side
from mcnav.report.drawing.gapped import areas, curve, ends_around
from mcnav.report.drawing.marks import Axis, Line, Mark, Panel, Rule, Series, Span
from mcnav.report.drawing.palette import AREA, FLOWN, INK, LINEAR
from mcnav.report.drawing.ticks import limits
from mcnav.report.figures.agreement import TOLERANCE
from mcnav.report.figures.filter_errors import whole_flight
from mcnav.report.figures.normalized_errors import BOUNDS, Columns
from mcnav.report.figures.outages import outages, shading_key
from mcnav.report.names import humanize
from mcnav.report.results.model import RunAnalysis

ABREAST: Final = SEVERAL + 1
"""Panels of which three stand side by side."""

RATIO: Final = Series("flown", "Monte Carlo", FLOWN)
INTERVAL: Final = Series("interval", "its interval", AREA, "area")
BY_LINEAR: Final = Series("linear", "linear", LINEAR)


def sigma_ratios_over_time(content: RunAnalysis) -> Figure | None:
    """Draw true over filter sigma of each output, a panel for each, on a logarithmic axis against the tolerance."""
    figure = content.filter
    if figure is None:
        return None
    shown = [output for output in figure.outputs if output.ratio.known.any()]
    if not shown:
        return None
    shaded = outages(content)
    columns: Columns = {figure.label: figure.times}
    for judged in figure.outputs:
        name = humanize(judged.name)
        columns[f"{name}, true σ over filter σ"] = judged.ratio.value
        columns |= {f"{name}, from": judged.ratio.each[:, 0], f"{name}, to": judged.ratio.each[:, 1]}
        if judged.linear is not None:
            columns[f"{name}, linear analysis"] = judged.linear
    linear = any(output.linear is not None for output in figure.outputs)
    tolerance = Span(TOLERANCE, 1.0 - figure.tolerance, 1.0 + figure.tolerance, level=True)

    def panel(output: SigmaConsistency) -> Panel:
        marks: list[Mark] = [tolerance, *shaded, Rule(1.0, level=True, colour=INK, width=1.0)]
        if output.linear is not None:
            marks.append(Line(BY_LINEAR, figure.times, output.linear, 3.2))
        marks += areas(INTERVAL, figure.times, output.ratio.each, 0.4)
        marks += curve(RATIO, figure.times, output.ratio.value)
        reach = np.concatenate([[tolerance.low, tolerance.high], output.ratio.value, output.ratio.each.ravel()])
        low, high = limits(reach[np.isfinite(reach) & (reach > 0.0)], True, 0.06)
        ratio = Axis("true σ / filter σ", log=True, low=low, high=high)
        return Panel(humanize(output.name), whole_flight(figure), ratio, marks, about=[output.name])

    return Figure(
        name="sigma-history",
        title="True sigma over the filter's sigma",
        description="Ratio of the sigma of the Monte Carlo errors to the sigma that the filter states, for each output "
        "over time, against the tolerance.",
        panels=[panel(output) for output in shown],
        key=[RATIO, INTERVAL, *([BY_LINEAR] if linear else []), TOLERANCE, *shading_key(shaded)],
        columns=columns,
        size=side_by_side(max(len(shown), ABREAST)),
    )


def shares_within(content: RunAnalysis) -> Figure | None:
    """Draw the share of samples within one and three of their own filter's sigmas, outputs of one unit together."""
    figure = content.filter
    if figure is None:
        return None
    groups = _drawn(same_unit([output for output in figure.outputs if output.within_1 and output.within_3]))
    if not groups:
        return None
    shaded = outages(content)
    columns: Columns = {figure.label: figure.times}
    panels = []
    for multiple in (1, 3):
        for place, (title, members) in enumerate(groups):
            known = [(member, statistic, bounds) for member in members
                     for statistic, bounds in [_within(member, multiple)] if statistic is not None]  # fmt: skip
            columns |= {f"{humanize(judged.name)}, within ±{multiple}σ [%]": 100.0 * statistic.value
                        for judged, statistic, _ in known}  # fmt: skip
            panels.append(_share_panel(figure, multiple, len(groups) * (multiple > 1) + place, title, known, shaded))
    return Figure(
        name="within-history",
        title="Share of samples within the filter's sigmas",
        description="Share of the samples whose error lies within one and three filter sigmas, for each output over "
        "time. Band: the bounds of a consistent filter.",
        panels=panels,
        key=[BOUNDS, *shading_key(shaded)],
        columns=columns,
        size=side_by_side(max(len(panels), ABREAST), 250.0),
        caption="Of normally distributed errors 68.27 % lie within ±1σ and 99.73 % within ±3σ.",
    )


def _within(consistency: SigmaConsistency, multiple: int) -> tuple[Statistic | None, tuple[float, float]]:
    return (
        (consistency.within_1, consistency.bounds_1) if multiple == 1 else (consistency.within_3, consistency.bounds_3)
    )


def _share_panel(
    consistency: FilterConsistency,
    multiple: int,
    number: int,
    title: str,
    known: Sequence[tuple[SigmaConsistency, Statistic, tuple[float, float]]],
    shaded: Sequence[Span],
) -> Panel:
    low, high = (100.0 * known[0][2][side] for side in (0, 1))
    series = curves(number, [judged for judged, _, _ in known])
    lines: list[Mark] = []
    for own, (_, statistic, _) in zip(series, known, strict=True):
        lines += curve(own, consistency.times, 100.0 * statistic.value)
    ends = ends_around(
        np.concatenate([[low, high], *(100.0 * statistic.value for _, statistic, _ in known)]), log=False
    )
    return Panel(
        f"{title}, ±{multiple}σ",
        whole_flight(consistency),
        Axis(f"within ±{multiple}σ", "%", low=ends[0], high=min(ends[1], 100.0)),
        [Span(BOUNDS, low, high, level=True), *shaded, *lines],
        series,
    )


def _drawn(groups: Sequence[Group]) -> list[Group]:
    """Leave out quantities whose ratio is not known at any epoch."""
    known = [(title, tuple(member for member in members if member.ratio.known.any())) for title, members in groups]
    return [group for group in known if group[1]]
