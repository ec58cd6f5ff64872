"""Which source matters: shares of the variance, linear and Monte Carlo, and the error budget over time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from mcnav._types import Array
from mcnav.report.figures.figure import HALF, Figure
from mcnav.report.figures.marks import Axis, Bars, Line, Mark, Panel, Rule, Series, axis, numbered
from mcnav.report.figures.palette import INK, OTHER, SOURCE_COLOURS
from mcnav.report.model import RunAnalysis

SHOWN: Final = len(SOURCE_COLOURS)
"""Sources with a colour; where there are more, those that matter least are drawn together, or not over time."""

NUMBERED: Final = 0.04
"""Shares from this on carry their number, where it has room."""


def shown_sources(content: RunAnalysis) -> list[int]:
    """Return the sources with a colour of their own: those with the largest share in any output, in their order."""
    shares = np.nan_to_num(content.budget.shares).max(axis=0, initial=0.0)
    known = content.development
    if known is not None and len(known.partials):
        parts = np.abs(known.partials) * np.sqrt(np.diag(content.model.covariance))
        largest = parts.max(axis=0)[content.moving]
        whole = np.sqrt((parts**2).sum(axis=2)).max(axis=0)[content.moving, None]
        shares = np.maximum(
            shares, (np.divide(largest, whole, out=np.zeros_like(largest), where=whole > 0.0) ** 2).max(axis=0)
        )
    return sorted(int(j) for j in np.argsort(-shares, kind="stable")[:SHOWN] if shares[j] > 0.0)


def series_of(content: RunAnalysis, kind: str = "") -> dict[int, Series]:
    """Return the series of each source that has a colour: the same in all figures."""
    few = len(content.source_names) <= SHOWN
    return {j: numbered(j if few else k, content.source_names[j], kind) for k, j in enumerate(shown_sources(content))}


def budget(content: RunAnalysis) -> Figure:
    """Draw shares of each source in each output's linear variance, by the linear model and by Monte Carlo if known."""
    names, linear = content.output_names, np.nan_to_num(content.budget.shares)
    flown = _flown_shares(content)
    members = [j for j in range(linear.shape[1]) if (linear[:, j] > 0.0).any()]
    series = {j: each for j, each in series_of(content, "area").items() if j in members}
    rest = [j for j in members if j not in series]
    other = Series("others", f"{len(rest)} others", OTHER, "area")
    routes = {"linear": ("Linear", linear)} | (
        {} if flown is None else {"Monte Carlo": ("Monte Carlo, each source alone", flown)}
    )
    columns: dict[str, list[object]] = {"source": [content.source_names[j] for j in members]}
    panels = []
    reach = max(float(shares[:, members].sum(axis=1).max(initial=0.0)) for _, shares in routes.values())
    across = Axis("share of the linear variance", "%", low=0.0, high=100.0 * max(1.0, reach) * 1.02)
    for route, (title, shares) in routes.items():
        panels.append(Panel(title, across, Axis(names=names), _stacked(names, shares, series, other, rest)))
        for i, name in enumerate(names):
            columns[f"{name}, {route}, %"] = [float(100.0 * shares[i, j]) for j in members]
    return Figure(
        name="budget",
        title="Error budget",
        description="Share of each error source in the variance of each output, in per cent of the linear variance.",
        panels=panels,
        key=[*series.values(), *([other] if rest else [])],
        columns=columns,
        size=(HALF[0], 82.0 + 36.0 * len(names)),
    )


def _flown_shares(content: RunAnalysis) -> Array | None:
    """Return the variance of each output with one source alone over the linear one; none where it is not known."""
    flown = content.manifest.model.budget
    if not flown or "failed" in flown["alone"]:
        return None
    variances = np.diag(content.comparison.covariance_linear)
    alone = np.array(flown["alone"]["alone"]["variance"], dtype=float)
    divisor = np.where(variances > 0.0, variances, np.nan)
    return np.asarray(np.nan_to_num(alone / divisor[:, None]))


def _stacked(
    names: list[str], shares: Array, series: Mapping[int, Series], other: Series, rest: list[int]
) -> list[Mark]:
    left, rows = np.zeros(len(names)), np.arange(len(names))
    parts = [(each, shares[:, j]) for j, each in series.items()]
    parts += [(other, shares[:, rest].sum(axis=1))] if rest else []
    marks: list[Mark] = []
    for each, width in parts:
        texts = [f"{name}, {each.label}: {100.0 * share:.3g} %" for name, share in zip(names, width, strict=True)]
        told = [f"{100.0 * share:.0f}" if share >= NUMBERED else "" for share in width]
        marks.append(Bars(each, rows, 100.0 * left, 100.0 * (left + width), texts, told))
        left = left + width
    return [*marks, Rule(100.0, colour=INK, width=1.1)]


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
    series = {j: each for j, each in series_of(content).items() if parts[:, moving, j].max(initial=0.0) > 0.0}
    together = Series("all", "all errors", INK)
    columns = {known.label: known.times}
    for i in moving:
        columns[f"{names[i]}, all errors [{units[i]}]"] = whole[:, i]
        columns |= {f"{names[i]}, {each.label} [{units[i]}]": parts[:, i, j] for j, each in series.items()}
    return Figure(
        name="development",
        title="Error budget over time",
        description="Linear one-sigma error of each output over the flight, for all errors and for each source alone.",
        panels=[
            Panel(names[i], axis(known.label, margin=0.0, link=True), Axis("1σ", units[i], low=0.0),
                  [Line(together, known.times, whole[:, i], 2.7),
                   *(Line(each, known.times, parts[:, i, j]) for j, each in series.items())])
            for i in moving
        ],
        key=(together, *series.values()),
        columns=columns,
        caption="Linear model.",
    )  # fmt: skip
