"""Tails of requirements beyond counting: probability beyond their limits against the limits, by all methods."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from mcnav.analysis.tail_curves import TailCurve
from mcnav.report.columns.requirements import RADII, RequirementRow, requirement_rows
from mcnav.report.drawing.figure import Figure, side_by_side
from mcnav.report.drawing.gapped import areas
from mcnav.report.drawing.marks import Axis, Line, Mark, Panel, Points, Rule, Series, of_requirement
from mcnav.report.drawing.palette import AREA, FILTER, FLOWN, INK, LINEAR, MUTED, SOURCE_COLOURS
from mcnav.report.figures.requirements import LONGEST
from mcnav.report.names import humanize
from mcnav.report.results.model import RunAnalysis

COUNTED: Final = Series("counted", "counted samples", FLOWN)
BOUNDS: Final = Series("bounds", "interval of the count", AREA, "area")
BY_LINEAR: Final = Series("linear", "linear", LINEAR)
CURVED: Final = Series("curved", "linear with curvature", SOURCE_COLOURS[1])
FLIGHTS: Final = Series("flights", "flights chosen with the linear model", FILTER, "dot")
ALLOWED: Final = Series("allowed", "limit and allowed probability", INK)

BELOW: Final = 0.1
"""Share of the smallest probability at the limit, and of the one allowed, down to which the axis goes."""


def tails(content: RunAnalysis) -> Figure | None:
    """Draw the tail of each requirement whose probability flights estimate; none without any."""
    rows = requirement_rows(content.summary, "shown", content.time_unit)
    drawn = [(row, curve) for row, curve in zip(rows, content.tail_curves, strict=False) if curve is not None]
    if not drawn:
        return None
    columns: dict[str, Any] = {"requirement": [row.words for row, tail in drawn for _ in tail.multiples]}
    for name, values in (
        ("limit", [_limits(row, tail) for row, tail in drawn]),
        ("counted", [tail.counted for _, tail in drawn]),
        ("counted from", [tail.low for _, tail in drawn]),
        ("counted to", [tail.high for _, tail in drawn]),
        ("linear", [tail.linear for _, tail in drawn]),
        ("linear with curvature", [tail.curved for _, tail in drawn]),
    ):
        columns[name] = np.concatenate(values)
    columns["unit"] = [_unit(row) for row, tail in drawn for _ in tail.multiples]
    curved = any(np.isfinite(tail.curved).any() for _, tail in drawn)
    estimated = any(row.entry.exceedance and row.entry.exceedance.estimate for row, _ in drawn)
    confidence = f"{100.0 * content.summary.confidence:g} %"
    left_out = " Curvature is that of the constant errors, which are normal; noise adds its variance." if curved else ""
    return Figure(
        name="tails",
        title="Probability beyond the limit",
        description="Probability that errors lie beyond a limit against that limit: by counting samples with its "
        "interval, by linear analysis without and with curvature, and by flights chosen with the linear model.",
        panels=[_panel(row, tail) for row, tail in drawn],
        key=[COUNTED, BOUNDS, BY_LINEAR, *([CURVED] if curved else []), *([FLIGHTS] if estimated else []), ALLOWED],
        columns=columns,
        size=side_by_side(len(drawn)),
        caption=f"Intervals are two-sided at {confidence}, of the count at each limit by itself.{left_out}",
    )


def _limits(row: RequirementRow, curve: TailCurve) -> Any:
    """Return the limits in the unit shown; of a box, multiples of those required."""
    return curve.multiples * (1.0 if row.entry.kind == "box" else row.entry.limits[0] * row.scale)


def _unit(row: RequirementRow) -> str:
    return "" if row.entry.kind == "box" else row.unit


def _panel(row: RequirementRow, curve: TailCurve) -> Panel:
    entry, known, at = row.entry, row.entry.exceedance, _limits(row, curve)
    limit = 1.0 if entry.kind == "box" else entry.limits[0] * row.scale
    allowed = 1.0 - (0.5 if entry.probability is None else entry.probability)
    seen = [allowed, *filter(np.isfinite, curve.at_limit)]
    marks: list[Mark] = []
    if np.isfinite(curve.high).all():
        floor = BELOW * min(seen)
        marks += areas(BOUNDS, at, np.column_stack([np.maximum(curve.low, floor), curve.high]))
    for series, values in ((BY_LINEAR, curve.linear), (CURVED, curve.curved), (COUNTED, curve.counted)):
        if np.isfinite(values).any():
            marks.append(Line(series, at, values))
    if known is not None and known.estimate is not None and known.low is not None and known.high is not None:
        seen.append(known.low or allowed)
        marks += [
            Line(FLIGHTS, [limit, limit], [known.low, known.high], 2.6, silent=True),
            Points(FLIGHTS, [limit], [known.estimate], 8.0, texts=[f"flights: {row.exceedance}"]),
        ]
    marks += [Rule(limit, colour=INK), Rule(allowed, level=True, colour=MUTED)]
    name = "multiple of the limits" if entry.kind == "box" else RADII.get(entry.kind, _measured(row))
    across = Axis(name, _unit(row), margin=0.0)
    title = ", ".join(map(humanize, entry.outputs))
    least = BELOW * min(value for value in seen if value > 0.0)
    upward = Axis("probability beyond", log=True, low=least, high=1.0)
    return Panel(title[:LONGEST], across, upward, marks, about=(of_requirement(row.number),))


def _measured(row: RequirementRow) -> str:
    return f"|{humanize(row.entry.outputs[0])}|"
