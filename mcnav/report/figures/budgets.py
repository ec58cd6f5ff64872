"""Error budgets of runs and of linear covariances: shares of the variance as bars, sigmas by contributor over time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from mcnav.arrays.types import Array
from mcnav.report.drawing.figure import HALF, Figure, side_by_side
from mcnav.report.drawing.marks import Axis, Bars, Line, Mark, Panel, Rule, Series, Span, axis
from mcnav.report.drawing.palette import INK
from mcnav.report.figures.outages import shading_key
from mcnav.report.figures.sources import Contributor

NUMBERED: Final = 0.04
"""Smallest share whose number is written in its bar, where it has room."""

CROSSED: Final = (
    "Each share has half of what the correlations of its error source contribute, so that shares add up to 100 %. A "
    "negative share takes away some of what others add."
)

ALL: Final = Series("all", "all errors", INK)
"""Name of all causes together."""


def shares_figure(
    title: str,
    description: str,
    causes: tuple[str, Sequence[str]],
    outputs: Sequence[str],
    routes: Mapping[str, tuple[str, Array]],
    contributors: Sequence[Contributor],
    crossed: bool = False,
) -> Figure:
    """Draw the share of each contributor in each output's variance, a panel for each route.

    ``causes`` are what they are called and their names; ``routes`` are the shares, shape (outputs, causes), with the
    title of their panel by what precedes the per cent sign in the table. They are ``crossed`` where they have a half of
    what correlations contribute; negative ones extend to the left of zero.
    """
    members = [j for contributor in contributors for j in contributor.members]
    kind, labels = causes
    parts = [
        shares[:, contributor.members].sum(axis=1) for _, shares in routes.values() for contributor in contributors
    ]
    ends = np.array([[np.maximum(part, 0.0), np.minimum(part, 0.0)] for part in parts])
    sums = ends.reshape(len(routes), len(contributors), 2, len(outputs)).sum(axis=1)
    reach, least = float(sums[:, 0].max(initial=0.0)), float(sums[:, 1].min(initial=0.0))
    across = Axis("share of the linear variance", "%", low=102.0 * least, high=102.0 * max(1.0, reach))
    columns: dict[str, Sequence[object]] = {kind: [labels[j] for j in members]}
    for route, (_, shares) in routes.items():
        columns |= {f"{name}{route}, %": list(100.0 * shares[i, members]) for i, name in enumerate(outputs)}
    several = any(len(contributor.members) > 1 and not contributor.other for contributor in contributors)
    return Figure(
        name="budget",
        title=title,
        description=description,
        panels=[
            Panel(heading, across, Axis(names=outputs), _stacked(outputs, shares, contributors))
            for heading, shares in routes.values()
        ],
        key=[contributor.series.of_kind("area") for contributor in contributors],
        columns=columns,
        size=(HALF[0], 82.0 + 36.0 * len(outputs)),
        caption=" ".join(
            filter(
                None,
                (
                    f"In brackets: the number of {kind}s, which differ only in their axis." if several else "",
                    CROSSED if crossed else "",
                ),
            )
        ),
    )


def _stacked(names: Sequence[str], shares: Array, contributors: Sequence[Contributor]) -> list[Mark]:
    """Return the bars of each contributor's share of each output."""
    right, left, rows = np.zeros(len(names)), np.zeros(len(names)), np.arange(len(names))
    marks: list[Mark] = []
    for contributor in contributors:
        width = shares[:, contributor.members].sum(axis=1)
        texts = [
            f"{name}, {contributor.label}: {100.0 * share:.3g} %" for name, share in zip(names, width, strict=True)
        ]
        written = [f"{100.0 * share:.0f}" if share >= NUMBERED else "" for share in width]
        begin = np.where(width < 0.0, left + width, right)
        marks.append(Bars(contributor.series, rows, 100.0 * begin, 100.0 * (begin + np.abs(width)), texts, written))
        right, left = right + np.maximum(width, 0.0), left + np.minimum(width, 0.0)
    return [*marks, Rule(100.0, colour=INK, width=1.1)]


def development_figure(
    description: str,
    times: tuple[str, Array],
    outputs: Mapping[int, tuple[str, str]],
    curves: Mapping[Series, Array],
    shaded: Sequence[Span],
    caption: str = "",
) -> Figure:
    """Draw the sigma of each output over time, of all errors and by contributor.

    ``times`` are their label and values; ``outputs`` are name and unit of those drawn, by their columns in ``curves``,
    shape (times, outputs), in the units shown.
    """
    label, values = times
    columns = {label: values}
    for i, (name, unit) in outputs.items():
        columns |= {f"{name}, {series.label} [{unit}]": curve[:, i] for series, curve in curves.items()}

    def lines(i: int) -> list[Line]:
        return [
            Line(each, values, curve[:, i], 2.7 if each.name == ALL.name else 1.9) for each, curve in curves.items()
        ]

    return Figure(
        name="development",
        title="Error budget over time",
        description=description,
        panels=[
            Panel(name, axis(label, margin=0.0, link=True), Axis("1σ", unit, low=0.0), [*shaded, *lines(i)])
            for i, (name, unit) in outputs.items()
        ],
        key=(*curves, *shading_key(shaded)),
        columns=columns,
        size=side_by_side(len(outputs)),
        caption=caption,
    )
