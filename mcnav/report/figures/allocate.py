"""Figure of an allocation: the multiple of each number with which a goal is just met."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from mcnav.analysis.allocation import Goal
from mcnav.report.drawing.figure import HALF, Figure
from mcnav.report.drawing.marks import Axis, Interval, Mark, Panel, Points, Rule, Series
from mcnav.report.drawing.palette import INK, LINEAR

MET: Final = Series("met", "just met", LINEAR, "dot")
ANY: Final = Series("any", "met at any multiple", INK, "onward")
SPAN: Final = Series("span", "change", LINEAR)

SMALLEST: Final = 1e-3
"""Smallest multiple that is drawn; below it points stand at the edge."""


def multiples(goal: Goal, place: int, most: int | None = None) -> Figure | None:
    """Draw the multiples of the numbers that meet a goal on a logarithmic axis, or of the first ``most``.

    None where there are none.
    """
    changes = [change for change in goal.changes if change.reached][:most]
    if not changes:
        return None
    names, factors = [change.label for change in changes], np.array([change.factor for change in changes])
    known = np.isfinite(factors)
    low = max(SMALLEST, 0.8 * float(factors[known].min(initial=1.0)))
    high = (
        1.25 * float(factors[known].max(initial=1.0)) if known.all() else 2.5 * float(factors[known].max(initial=1.0))
    )
    at, rows = np.where(known, np.clip(factors, low, None), 0.8 * high), np.arange(len(names))
    marks: list[Mark] = [Rule(1.0, colour=INK)]
    marks += [
        Interval(SPAN, float(row), min(at[row], 1.0), max(at[row], 1.0), f"{names[row]}: × {factors[row]:.3g}")
        for row in rows[known].tolist()
    ]
    used = [(series, members) for series, members in ((MET, known), (ANY, ~known)) if members.any()]
    for series, members in used:
        words = [
            f"{names[row]}: " + (f"× {factors[row]:.3g}" if math.isfinite(factors[row]) else series.label)
            for row in rows[members].tolist()
        ]
        marks.append(Points(series, at[members], rows[members], 7.0, texts=words))
    across = Axis("multiple of the present number", log=True, low=low, high=high)
    return Figure(
        name=f"multiples-{place}",
        title="Multiples of the numbers",
        description="Multiple of each number of the data sheet with which the requirements are just met.",
        panels=[Panel("", across, Axis(names=names), marks)],
        key=[series for series, _ in used],
        columns={"number": names, "multiple": factors},
        size=(HALF[0], 82.0 + 22.0 * len(names)),
    )
