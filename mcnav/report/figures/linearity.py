"""Range of linearity: sigma ratios against the size of all errors, and the multiple that each source alone may have."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Final

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from numpy.typing import NDArray

from mcnav._types import Array
from mcnav.analysis.linearity import AloneRange, DispersionRange
from mcnav.report.figures.figure import HALF, THIRD, Figure, Plot, Series, plainly
from mcnav.report.svg import AREA, BAND, FLOWN, INK, LINEAR, MUTED

REACH: Final = 4.0
"""Tolerances above and below one that are shown."""

ALONE: Final = 2.0
"""Factor by which the axis reaches beyond the only multiple that was flown."""

RATIO: Final = Series("flown", "Monte Carlo σ / linear σ", FLOWN)
INTERVAL: Final = Series("interval", "interval", AREA, "area")
TOLERANCE: Final = Series("tolerance", "tolerance", BAND, "area")
LEAVES: Final = Series("leaves", "exceeds tolerance", MUTED, "dashed")

MATTERS: Final = Series("matters", "significant source", LINEAR, "dot")
MINOR: Final = Series("minor", "minor source", MUTED, "ring")
FARTHER: Final = Series("farther", "larger than simulated", INK, "onward")


def ratios(found: DispersionRange, tolerance: float, names: Sequence[str]) -> Figure:
    """Sigma ratio against the multiple of all errors, a plot for each of ``names``, the joint distribution last."""
    frame: dict[str, Array] = {"multiple": found.multiples}
    for column, name in enumerate(names):
        frame[f"{name}, ratio"] = found.ratios[:, column]
        frame[f"{name}, from"], frame[f"{name}, to"] = found.lower[:, column], found.upper[:, column]
    return Figure(
        key="ratios",
        title="Sigma ratio against the multiple of the errors",
        description="Paired sigma ratio with its interval for each output and the joint distribution, against the "
        "multiple of the stated errors; a dashed line marks where it leaves the tolerance.",
        plots=[
            Plot(name, partial(_ratio, found=found, tolerance=tolerance, column=column))
            for column, name in enumerate(names)
        ],
        series=(RATIO, INTERVAL, TOLERANCE, LEAVES),
        data=pd.DataFrame(frame),
        size=(THIRD[0], 2.5),
        file="linearity_dispersion.csv",
    )


def _ratio(axes: Axes, found: DispersionRange, tolerance: float, column: int) -> None:
    ratio, low, high = (each[:, column] for each in (found.ratios, found.lower, found.upper))
    shown = np.isfinite(ratio) & (np.abs(ratio - 1.0) < 3.0 * REACH * tolerance)
    axes.axhspan(1.0 - tolerance, 1.0 + tolerance, color=BAND, zorder=-1, gid=TOLERANCE.gid)
    INTERVAL.band(axes, found.multiples[shown], low[shown], np.minimum(high[shown], 1.0 + 3.0 * REACH * tolerance))
    axes.axhline(1.0, color=LINEAR, linewidth=1.0)
    RATIO.on(axes, found.multiples[shown], ratio[shown], linewidth=1.8, marker="o" if shown.sum() == 1 else None)
    if np.isfinite(found.departs[column]):
        axes.axvline(found.departs[column], color=MUTED, linewidth=1.2, linestyle="--", gid=LEAVES.gid)
    axes.set_xscale("log")
    plainly(axes.xaxis)
    low, high = found.multiples[[0, -1]]
    margin = ALONE if low == high else 1.0  # a single multiple needs room on both sides
    axes.set_xlim(low / margin, high * margin)
    axes.set_ylim(1.0 - REACH * tolerance, 1.0 + REACH * tolerance)
    axes.locator_params(axis="y", nbins=5)
    axes.set(xlabel="multiple of the stated errors", ylabel="σ ratio")


def alone(single: AloneRange, minor: NDArray[np.bool_], directions: Sequence[str], names: Sequence[str]) -> Figure:
    """Multiple of each source alone at which the flown final error leaves the linear one: a plot for each output.

    ``minor``, shape (directions, outputs): where a source hardly moves an output.
    """
    frame = {"source": list(directions)} | {name: single.multiples[:, i] for i, name in enumerate(names)}

    def draw(axes: Axes, i: int) -> None:
        multiples, rows = single.multiples[:, i], np.arange(len(directions))
        for series, members in ((MATTERS, ~minor[:, i]), (MINOR, minor[:, i])):
            reached = np.isfinite(multiples) & members
            axes.hlines(rows[reached], single.largest * 1e-9, multiples[reached], color=series.colour, linewidth=0.8,
                        gid=series.gid)  # fmt: skip
            series.on(axes, multiples[reached], rows[reached])
        beyond = rows[np.isinf(multiples)]
        FARTHER.on(axes, np.full(len(beyond), single.largest), beyond)
        axes.axvline(1.0, color=INK, linewidth=1.0)
        axes.set_xscale("log")
        plainly(axes.xaxis)
        least = np.nanmin(np.append(single.multiples[np.isfinite(single.multiples)], 1.0))
        axes.set_xlim(0.5 * least, 1.5 * single.largest)
        axes.set_yticks(rows, list(directions))
        axes.set_ylim(len(directions) - 0.5, -0.5)
        axes.grid(axis="y", visible=False)
        axes.set_xlabel("multiple of the stated error")

    return Figure(
        key="alone",
        title="Range of linearity of each source alone",
        description="For each source and output the multiple of the stated error at which the nonlinear final error "
        "departs from the linear one by the tolerance.",
        plots=[Plot(name, partial(draw, i=i)) for i, name in enumerate(names)],
        series=(MATTERS, MINOR, FARTHER),
        data=pd.DataFrame(frame),
        size=(HALF[0], 1.0 + 0.2 * len(directions)),
        caption="The line marks the stated errors.",
        file="linearity.csv",
    )
