"""Range of linearity: sigma ratios against the size of all errors, and the multiple that each source alone may have."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mcnav.analysis.linearity import AloneRange, DispersionRange
from mcnav.arrays.types import Array
from mcnav.report.drawing.figure import HALF, THIRD, Figure
from mcnav.report.drawing.marks import Axis, Band, Interval, Line, Mark, Panel, Points, Rule, Series
from mcnav.report.drawing.palette import AREA, FLOWN, INK, LINEAR, MUTED
from mcnav.report.figures.agreement import TOLERANCE, ratio_panel

REACH: Final = 4.0
"""Tolerances above and below one that are shown."""

ALONE: Final = 2.0
"""Factor by which the axis reaches beyond the only multiple simulated."""

RATIO: Final = Series("flown", "Monte Carlo σ / linear σ", FLOWN)
INTERVAL: Final = Series("interval", "interval", AREA, "area")
AGREES: Final = Series("agrees", "shown up to here", INK)
LEAVES: Final = Series("leaves", "exceeds tolerance", MUTED)

MATTERS: Final = Series("matters", "significant source", LINEAR, "dot")
MINOR: Final = Series("minor", "minor source", MUTED, "ring")
FARTHER: Final = Series("farther", "larger than simulated", INK, "onward")


def ratios(dispersion_range: DispersionRange, tolerance: float, names: Sequence[str]) -> Figure:
    """Draw sigma ratios against the multiple of all errors: a panel for each of ``names``, the joint one last."""
    columns: dict[str, Array] = {"multiple": dispersion_range.multiples}
    for column, name in enumerate(names):
        columns[f"{name}, ratio"] = dispersion_range.ratios[:, column]
        columns[f"{name}, from"], columns[f"{name}, to"] = (
            dispersion_range.lower[:, column],
            dispersion_range.upper[:, column],
        )
    return Figure(
        name="ratios",
        title="Sigma ratio against the multiple of the errors",
        description="Paired sigma ratio with its interval for each output and the joint distribution, against the "
        "multiple of the campaign's errors. Lines mark up to where it is shown to agree, and where it leaves the "
        "tolerance.",
        panels=[_ratio(name, dispersion_range, tolerance, column) for column, name in enumerate(names)],
        key=(RATIO, INTERVAL, TOLERANCE, AGREES, LEAVES),
        columns=columns,
        size=(THIRD[0], 240.0),
        file="linearity_dispersion.csv",
    )


def foremost_ratio(figure: Figure, dispersion_range: DispersionRange) -> Figure:
    """Return the figure of ratios with the panel first of the output whose sigma leaves the tolerance first."""
    agrees = np.where(np.isnan(dispersion_range.agrees_until), np.inf, dispersion_range.agrees_until)[:-1]
    first = int(np.argmin(agrees)) if len(agrees) else 0
    return replace(figure, panels=[figure.panels[first], *figure.panels])


def _ratio(name: str, dispersion_range: DispersionRange, tolerance: float, column: int) -> Panel:
    ratio, low, high = (
        each[:, column] for each in (dispersion_range.ratios, dispersion_range.lower, dispersion_range.upper)
    )
    shown = np.isfinite(ratio) & (np.abs(ratio - 1.0) < 3.0 * REACH * tolerance)
    multiples = dispersion_range.multiples[shown]
    top = np.minimum(high[shown], 1.0 + 3.0 * REACH * tolerance)
    marks: list[Mark] = [Band(INTERVAL, multiples, low[shown], top), Line(RATIO, multiples, ratio[shown], 2.4)]
    if shown.sum() == 1:
        marks.append(Points(Series(RATIO.name, "", FLOWN, "dot"), multiples, ratio[shown]))
    if np.isfinite(dispersion_range.agrees_until[column]):
        marks.append(Rule(float(dispersion_range.agrees_until[column]), width=1.6, series=AGREES))
    if np.isfinite(dispersion_range.departs[column]):
        marks.append(Rule(float(dispersion_range.departs[column]), width=1.6, series=LEAVES))
    first, last = (float(multiple) for multiple in dispersion_range.multiples[[0, -1]])
    margin = ALONE if first == last else 1.0  # a single multiple needs room on both sides
    across = Axis("multiple of the stated errors", log=True, low=first / margin, high=last * margin, link="multiple")
    end = 1.0 + REACH * tolerance
    upward = Axis("σ ratio", log=True, low=1.0 / end, high=end)
    return ratio_panel(name, across, upward, tolerance, marks)


def alone(
    single: AloneRange, minor: NDArray[np.bool_], directions: Sequence[str], names: Sequence[str], what: str
) -> Figure:
    """Draw the multiple of each source alone at which the final error leaves the linear one: a plot for each output.

    ``minor``, shape (directions, outputs): where a source hardly moves an output.
    """
    least = np.nanmin(np.append(single.multiples[np.isfinite(single.multiples)], 1.0))
    across = Axis("multiple of the stated error", log=True, low=0.5 * float(least), high=1.5 * single.largest)

    def panel(name: str, i: int) -> Panel:
        multiples, rows = single.multiples[:, i], np.arange(len(directions))
        marks: list[Mark] = [Rule(1.0, colour=INK)]
        for series, members in ((MATTERS, ~minor[:, i]), (MINOR, minor[:, i])):
            reached = np.isfinite(multiples) & members
            texts = [f"{directions[row]}: {multiples[row]:.3g} times" for row in rows[reached]]
            marks += [
                Interval(series, float(row), single.largest * 1e-9, float(multiples[row]), text, 1.1)
                for row, text in zip(rows[reached], texts, strict=True)
            ]
            marks.append(Points(series, multiples[reached], rows[reached], 6.0 if series is MATTERS else 7.3))
        beyond = rows[np.isinf(multiples)]
        marks.append(Points(FARTHER, np.full(len(beyond), single.largest), beyond, 8.0))
        return Panel(name, across, Axis(names=directions), marks)

    return Figure(
        name="alone",
        title="Range of linearity of each source alone",
        description=f"For each source and output the multiple of the stated error at which the nonlinear {what} "
        "departs from the linear one by the tolerance.",
        panels=[panel(name, i) for i, name in enumerate(names)],
        key=(MATTERS, MINOR, FARTHER),
        columns={"source": np.array(directions)} | {name: single.multiples[:, i] for i, name in enumerate(names)},
        size=(HALF[0], 82.0 + 20.0 * len(directions)),
        file="linearity.csv",
    )
