"""Requirements over time: the quantile that each limits, with its bounds, linear analysis, and the limit."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from mcnav.analysis.requirement_curves import RequirementCurve
from mcnav.analysis.summary import RequirementEntry
from mcnav.report.columns.requirements import RADII, RequirementRow, requirement_rows
from mcnav.report.drawing.figure import Figure, side_by_side
from mcnav.report.drawing.gapped import areas, curve, known_ends, upward
from mcnav.report.drawing.marks import Mark, Panel, Rule, Series, axis, of_requirement
from mcnav.report.drawing.palette import AREA, FLOWN, INK, LINEAR
from mcnav.report.figures.outages import outages, shading_key
from mcnav.report.names import humanize
from mcnav.report.results.model import RunAnalysis

ESTIMATE: Final = Series("flown", "Monte Carlo", FLOWN)
BOUNDS: Final = Series("bounds", "bounds", AREA, "area")
BY_LINEAR: Final = Series("linear", "linear", LINEAR)
LIMIT: Final = Series("limit", "limit", INK)


LONGEST: Final = 56
"""Characters of a panel's title."""


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
