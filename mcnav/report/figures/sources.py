"""Which source matters: shares of the variance, linear beside flown, and the error budget over time."""

from __future__ import annotations

from functools import partial

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from mcnav._types import Array
from mcnav.report.figures.figure import HALF, Figure, Plot, Series, axis_label, numbered
from mcnav.report.model import RunAnalysis
from mcnav.report.svg import INK, PAPER, SOURCE_COLOURS

NUMBERED = 0.08
"""Shares from this on carry their number."""


def on(colour: str) -> str:
    """Nearly black or nearly white, whichever reads better on a colour (relative luminance, WCAG 2).

    Neither is a variable of the style sheet: the bars keep their brightness in dark mode, and so must what is on them.

    >>> on("#8fd0b8"), on("#7b3294")
    ('#101418', '#fdfdfd')
    """
    channels = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.03928 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
    return "#101418" if 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2] > 0.2 else "#fdfdfd"


def budget(content: RunAnalysis) -> Figure:
    """Stacked shares of each source in each output's linear variance; beside them, where flown, those by flights."""
    names, linear = content.output_names, np.nan_to_num(content.budget.shares)
    flown = _flown_shares(content)
    members = [j for j in range(linear.shape[1]) if (linear[:, j] > 0.0).any()]
    series = {j: numbered(j, content.source_names[j], "area") for j in members}
    plots = [Plot("Linear", lambda axes: _stacked(axes, names, linear, series))]
    frame: dict[str, list[object]] = {"source": [content.source_names[j] for j in members]}
    frame |= {f"{name}, linear, %": [float(100.0 * linear[i, j]) for j in members] for i, name in enumerate(names)}
    if flown is not None:
        plots.append(Plot("Monte Carlo, each source alone", lambda axes: _stacked(axes, names, flown, series)))
        frame |= {
            f"{name}, Monte Carlo, %": [float(100.0 * flown[i, j]) for j in members] for i, name in enumerate(names)
        }
    return Figure(
        key="budget",
        title="Error budget",
        description="Share of each error source in the variance of each output, in per cent of the linear variance.",
        plots=plots,
        series=list(series.values()),
        data=pd.DataFrame(frame),
        size=(HALF[0], 1.0 + 0.42 * len(names)),
    )


def _flown_shares(content: RunAnalysis) -> Array | None:
    """Variance of each output with one source alone, over the linear variance; none where it was not flown."""
    flown = content.manifest.model.budget
    if not flown or "failed" in flown["alone"]:
        return None
    variances = np.diag(content.comparison.covariance_linear)
    alone = np.array(flown["alone"]["alone"]["variance"], dtype=float)
    divisor = np.where(variances > 0.0, variances, np.nan)
    return np.asarray(np.nan_to_num(alone / divisor[:, None]))


def _stacked(axes: Axes, names: list[str], shares: Array, series: dict[int, Series]) -> None:
    left = np.zeros(len(names))
    for j, each in series.items():
        width = shares[:, j]
        axes.barh(np.arange(len(names)), 100.0 * width, left=100.0 * left, color=each.colour, height=0.66,
                  edgecolor=PAPER, linewidth=0.6)  # fmt: skip
        for bar in axes.patches[-len(names) :]:
            bar.set_gid(each.gid)
        for row in np.flatnonzero(width >= NUMBERED):
            place = 100.0 * (left[row] + 0.5 * width[row])
            axes.text(place, float(row), f"{100.0 * width[row]:.0f}", ha="center", va="center", color=on(each.colour),
                      fontsize=8, gid=each.gid)  # fmt: skip
        left += width
    axes.axvline(100.0, color=INK, linewidth=0.8)
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.grid(axis="y", visible=False)
    axes.set_xlabel("share of the linear variance (%)")


def partials_history(content: RunAnalysis) -> Figure | None:
    """Draw the linear sigma of each output over time, in total and by its largest sources."""
    known = content.development
    if known is None:
        return None
    names, units, moving = content.output_names, content.output_units, content.moving
    start, scale = content.model.covariance, content.output_scale
    parts = np.abs(known.partials) * np.sqrt(np.diag(start)) * scale[:, None]
    variance = np.einsum("tij,jk,tik->ti", known.partials, start, known.partials)
    whole = np.sqrt(np.maximum(variance, 0.0)) * scale
    largest = parts.max(axis=0)[moving] / whole.max(axis=0)[moving, None]  # of each source in each output
    kept = sorted(j for j in np.argsort(-largest.max(axis=0))[: len(SOURCE_COLOURS)] if largest[:, j].max() > 0.0)
    series = {int(j): numbered(int(j), content.source_names[j]) for j in kept}
    together = Series("all", "all errors", INK)

    def draw(axes: Axes, i: int) -> None:
        together.on(axes, known.times, whole[:, i], linewidth=2.0)
        for j, each in series.items():
            each.on(axes, known.times, parts[:, i, j])
        axes.set(xlabel=axis_label(known.label), ylabel=f"1σ ({units[i]})")
        axes.set_ylim(bottom=0.0)

    frame = {known.label: known.times}
    for i in moving:
        frame[f"{names[i]}, all errors [{units[i]}]"] = whole[:, i]
        frame |= {f"{names[i]}, {each.label} [{units[i]}]": parts[:, i, j] for j, each in series.items()}
    return Figure(
        key="development",
        title="Error budget over time",
        description="Linear one-sigma error of each output over the flight, for all errors and for each source alone.",
        plots=[Plot(names[i], partial(draw, i=i)) for i in moving],
        series=(together, *series.values()),
        data=pd.DataFrame(frame),
        caption="Linear model.",
    )
