"""The way from the limit of a requirement to the causes of the errors that it limits, as a waterfall."""

from __future__ import annotations

from typing import Final

import numpy as np

from mcnav.analysis.simulated_requirements import measured_scale
from mcnav.report.columns.requirements import RequirementRow, cause_label
from mcnav.report.drawing.figure import HALF, Figure
from mcnav.report.drawing.marks import Axis, Bars, Mark, Panel, Rule, Series
from mcnav.report.drawing.palette import FLOWN, INK, LINEAR
from mcnav.report.statements.requirements import margin

LISTED: Final = 7
"""Causes that are named; the others stand together."""

NEGLIGIBLE: Final = 5e-3
"""Share below which a cause is one of the others."""

NOTHING: Final = 1e-9
"""Share of all others below which they are not drawn."""

TOTAL, PART = Series("total", "all causes", LINEAR, "area"), Series("part", "one cause", FLOWN, "area")


def limit_to_causes(row: RequirementRow) -> Figure | None:
    """Draw what each cause adds to the mean square of the errors that a requirement limits, and what the limit allows.

    Quantiles of normal errors about the nominal are in proportion to the root of their mean square. The value is what
    samples bound it by, where they do: linear analysis may be wrong. None where the causes or the estimate
    are not known, or the requirement is on no size of errors.
    """
    entry = row.entry
    measured = measured_scale(entry)
    value = (entry.linear or 0.0) * measured if np.isfinite(measured) else entry.linear or entry.estimate
    multiple = margin(row, value)
    if not entry.causes or value is None or multiple is None:
        return None
    allowed = 100.0 * multiple**2
    named = [(cause_label(row.summary, cause.name), cause.share) for cause in entry.causes if cause.share > NEGLIGIBLE]
    named = named[:LISTED]
    rest = 1.0 - sum(share for _, share in named)
    rests = "all others" if rest > 0.0 else "correlations"
    shares = [*named, *([(rests, rest)] if abs(rest) > NOTHING else [])]
    ends = 100.0 * (1.0 - np.cumsum([0.0, *(share for _, share in shares)]))
    rows = ["all causes", *(name for name, _ in shares)]
    texts = [f"{name}: {100.0 * share:.3g} %" for name, share in shares]
    written = [f"{100.0 * share:.0f}" if share > 0.06 else "" for _, share in shares]
    high = 1.05 * max(100.0, min(allowed, 200.0))
    marks: list[Mark] = [
        Bars(TOTAL, [0], [0.0], [100.0], ["all causes: 100 %"]),
        Bars(
            PART,
            np.arange(1, len(rows)),
            np.minimum(ends[1:], ends[:-1]),
            np.maximum(ends[1:], ends[:-1]),
            texts,
            written,
        ),
        *([Rule(allowed, name="the limit", colour=INK, width=1.6)] if allowed <= high else []),
    ]
    low = 1.05 * min(0.0, float(ends.min()))
    across = Axis("share of the linear mean square", "%", low=low, high=high)
    enough = 0
    while allowed < 100.0 and enough < len(shares) and ends[enough] > allowed:
        enough += 1
    by = f"By simulation (at most {row.shown(value)})," if np.isfinite(measured) else "By linear analysis,"
    words = f"{by} the limit allows {allowed:.3g} % of the present mean square, in the same proportions"
    if enough:
        names = [name for name, _ in shares[:enough]]
        last = " and ".join([", ".join(names[:-1]), names[-1]] if names[1:] else names)
        words += f". {last[:1].upper()}{last[1:]} make up {100.0 - ends[enough]:.3g} %"
    return Figure(
        name="waterfall",
        title="From the requirement to its causes",
        description="What each cause adds to the mean square that the requirement limits, and what the limit allows.",
        panels=[Panel("", across, Axis(names=rows), marks)],
        key=(),
        columns={"cause": [name for name, _ in shares], "share, %": [100.0 * share for _, share in shares]},
        size=(HALF[0], 90.0 + 24.0 * len(rows)),
        caption="Mean squares add up, sigmas do not.",
        shows=f"{words}.",
    )
