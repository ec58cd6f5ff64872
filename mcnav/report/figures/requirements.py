"""Requirements with their limits: over time the quantile that each limits, at the end the outputs themselves."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from mcnav.analysis.requirement_curves import RequirementCurve
from mcnav.analysis.summary import RequirementEntry
from mcnav.report.columns.requirements import RADII, RequirementRow, nominal_of, requirement_rows
from mcnav.report.drawing.figure import HALF, Figure, side_by_side
from mcnav.report.drawing.gapped import areas, curve, known_ends, upward
from mcnav.report.drawing.marks import Axis, Line, Mark, Panel, Points, Rule, Series, axis, of_requirement
from mcnav.report.drawing.palette import AREA, FLOWN, INK, LINEAR
from mcnav.report.figures.dispersion import FLIGHTS, SCATTERED, ellipses
from mcnav.report.figures.outages import outages, shading_key
from mcnav.report.names import humanize
from mcnav.report.results.model import RunAnalysis
from mcnav.report.statements.requirements import named_together

ESTIMATE: Final = Series("flown", "Monte Carlo", FLOWN)
BOUNDS: Final = Series("bounds", "bounds", AREA, "area")
BY_LINEAR: Final = Series("linear", "linear", LINEAR)
LIMIT: Final = Series("limit", "limit", INK)


ELLIPSE: Final = Series("linear", "linear, 3 sigma", LINEAR)
LONGEST: Final = 56
"""Characters of a panel's title."""

FARTHEST: Final = 10.0
"""Multiple of the span of the outputs beyond which a limit is not drawn."""


def with_limit(figure: Figure, row: RequirementRow) -> Figure:
    """Draw the limit of a requirement at the end in a panel of its outputs, whose farthest samples are left out.

    Of one output it is a line on each side that outputs reach, of the distance in two outputs a circle about zero, or
    about the nominal where that is what the requirement limits.
    """
    (panel,), entry = figure.panels, row.entry
    reaches = panel.reaches()[: len(panel.about)]
    if entry.kind == "box" or set(panel.about) != set(entry.outputs) or not all(reach.size for reach in reaches):
        return figure
    centre = row.scale * nominal_of(row.summary, panel.about) * bool(entry.about)
    limit = entry.limits[0] * row.scale
    low, high = (np.array([end(reach) for reach in reaches]) for end in (np.min, np.max))
    if limit > FARTHEST * np.max(np.maximum(np.abs(low - centre), np.abs(high - centre))):
        return figure
    marks = [mark for mark in panel.marks if not (isinstance(mark, Points) and mark.names)]
    if len(centre) == 1:
        middle, reach = 0.5 * (low[0] + high[0]) - centre[0], 0.5 * (high[0] - low[0])
        sides = [side for side in (-1.0, 1.0) if side * middle >= -0.5 * reach]
        marks += [Rule(float(centre[0] + side * limit), width=1.8, series=LIMIT) for side in sides]
    else:
        angle = np.linspace(0.0, 2.0 * np.pi, 121)
        marks.append(Line(LIMIT, centre[0] + limit * np.cos(angle), centre[1] + limit * np.sin(angle), 1.8))
        reach = 1.05 * max(limit, float(np.max(high - centre)), float(np.max(centre - low)))
        x, y = (replace(along, low=place - reach, high=place + reach)
                for along, place in zip((panel.x, panel.y), centre.tolist(), strict=True))  # fmt: skip
        panel = replace(panel, x=x, y=y, even=True)
    kept = {mark.series for mark in marks if isinstance(mark, Points)}
    key = [series for series in figure.key if series.kind != "dot" or series in kept]
    return replace(figure, panels=[replace(panel, marks=marks)], key=[*key, LIMIT])


def landing(content: RunAnalysis, row: RequirementRow) -> Figure | None:
    """Draw the samples in the two outputs that a requirement limits, with the linear ellipse; none of other numbers."""
    names, limited = [output.name for output in content.manifest.model.outputs], row.entry.outputs
    if len(limited) != 2 or row.entry.kind == "box" or not len(content.flown):
        return None
    pair = [names.index(name) for name in limited]
    scale, points = content.output_scale[pair], content.flown[:: max(1, -(-len(content.flown) // SCATTERED)), pair]
    covariance = content.comparison.covariance_linear[np.ix_(pair, pair)] * np.outer(scale, scale)
    centre = content.model.outcome_mean[pair] * scale
    x, y = (Axis(name, content.output_units[k]) for name, k in zip(named_together(limited), pair, strict=True))
    marks = [Points(FLIGHTS, points[:, 0], points[:, 1], 1.8, 0.6), *ellipses(ELLIPSE, centre, covariance)[1:]]
    return Figure(
        name="scatter",
        title="Outputs that a requirement limits",
        description=f"{len(points):,} samples with the linear ellipse of three sigma, and the limit.",
        panels=[Panel("", x, y, marks, about=limited)],
        key=(FLIGHTS, ELLIPSE),
        columns={},
        size=HALF,
    )


def requirements_over_time(content: RunAnalysis) -> Figure | None:
    """Draw each requirement that holds at epochs; none without any, or without histories."""
    curves = content.requirement_curves
    rows = requirement_rows(content.summary, "shown", content.time_unit)
    drawn = [(row, curve) for row, curve in zip(rows, curves, strict=True) if curve is not None] if curves else []
    if not drawn:
        return None
    shaded = outages(content)
    label = "time" if content.development is None else content.development.label
    columns: dict[str, Any] = {"requirement": [], label: []}
    for row, over_time in drawn:
        columns["requirement"] += [row.words] * len(over_time.times)
        columns[label] += over_time.times.tolist()
    for name, values in (
        ("Monte Carlo", [over_time.estimate * row.scale for row, over_time in drawn]),
        ("lower bound", [over_time.bounds[:, 0] * row.scale for row, over_time in drawn]),
        ("upper bound", [over_time.bounds[:, 1] * row.scale for row, over_time in drawn]),
        ("linear", [over_time.linear * row.scale for row, over_time in drawn]),
        ("limit", [_limit(row, over_time) for row, over_time in drawn]),
    ):
        columns[name] = np.concatenate(values)
    columns["unit"] = [row.unit for row, over_time in drawn for _ in over_time.times]
    linear = any(np.isfinite(over_time.linear).any() for _, over_time in drawn)
    confidence = f"{100.0 * content.summary.confidence:g} %"
    return Figure(
        name="requirements-over-time",
        title="Requirements over time",
        description="Quantile of the errors that each requirement limits, over time, with its limit. Monte Carlo with "
        "bounds, and linear analysis.",
        panels=[_panel(row, over_time, label, [*shaded]) for row, over_time in drawn],
        key=[ESTIMATE, BOUNDS, *([BY_LINEAR] if linear else []), LIMIT, *shading_key(shaded)],
        columns=columns,
        size=side_by_side(len(drawn)),
        caption=f"Bounds are one-sided at {confidence} each at one epoch and distribution-free. The finding on a "
        "requirement takes all its epochs together.",
    )


def _limit(row: RequirementRow, curve: RequirementCurve) -> NDArray[np.float64]:
    """Return the limit where the requirement holds, in the unit shown; NaN elsewhere."""
    return np.where(curve.holds, row.entry.limits[0] * row.scale, np.nan)


def measure(entry: RequirementEntry) -> str:
    """Name the quantile that a requirement limits, such as ``R95`` or ``99 % quantile``."""
    return entry.kind.upper() if entry.kind in RADII else f"{100.0 * (entry.probability or 0.0):g} % quantile"


def _panel(row: RequirementRow, over_time: RequirementCurve, label: str, shaded: list[Mark]) -> Panel:
    estimate, linear, limit = over_time.estimate * row.scale, over_time.linear * row.scale, _limit(row, over_time)
    ends = np.where(known_ends(over_time.bounds)[:, None], over_time.bounds * row.scale, np.nan)
    reach = np.concatenate([estimate, linear, limit, ends.ravel()])
    at = row.entry.time
    marks: list[Mark] = [
        *shaded,
        *areas(BOUNDS, over_time.times, ends),
        *(curve(BY_LINEAR, over_time.times, linear) if np.isfinite(linear).any() else []),
        *curve(ESTIMATE, over_time.times, estimate),
        *curve(LIMIT, over_time.times, limit),
        *([] if at is None or not over_time.holds.sum() > 1 else [Rule(at)]),
    ]
    title = f"{measure(row.entry)} of {', '.join(map(humanize, row.entry.outputs))}"
    full = f"{title}, {row.entry.when}"
    title = full if len(full) <= LONGEST else title
    across, about = axis(label, margin=0.0, link=True), (of_requirement(row.number),)
    return Panel(title, across, upward(measure(row.entry), row.unit, reach), marks, about=about)
